"""What the check of a run has found."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Final, NamedTuple

#: Difference, in the scales of the scene, up to which engines are said to agree.
CLOSE: Final = 1e-3
#: Name of the quantity that is the time of an event.
EVENT_TIME: Final = "event time"


class Difference(NamedTuple):
    """A difference of a quantity between two engines.

    Attributes
    ----------
    quantity
        Column of the trajectory table, or EVENT_TIME.
    t_s, place
        When, and in which mode or at which event of the first engine's run.
    first, other
        Both values, in the quantity's unit.
    difference, allowed
        In its scale; that of event times is 1/ω₀.
    scale
        In the quantity's unit.
    """

    quantity: str
    t_s: float
    place: str
    first: float
    other: float
    difference: float
    allowed: float
    scale: float


@dataclass(frozen=True)
class RunCheck:
    """What the check of a run has found.

    Attributes
    ----------
    engine, other
        Names of the engine of the run and of that which checked it.
    outcomes
        How the runs of both ended.
    compared_until_s
        Until when they were compared: until a run ended, or until what is allowed had grown to LOST.
    agree_until_s
        Until when no coordinate, and not the contact force, differed by more than CLOSE of its scale.
    amplification
        Largest change under a repetition until then, over the tolerance, in the scales of the scene.
    events
        Number of events that both have until then.
    largest
        The largest difference of each quantity.
    disagreement
        What amplification does not explain, where it first shows; empty if the engines agree.
    """

    engine: str
    other: str
    outcomes: tuple[str, str]
    compared_until_s: float
    agree_until_s: float
    amplification: float
    events: int
    largest: tuple[Difference, ...]
    disagreement: str

    @property
    def agrees(self) -> bool:
        """Whether amplification explains all differences."""
        return not self.disagreement

    def to_tree(self) -> dict[str, Any]:
        """Return all of it as nested plain values."""
        largest = {d.quantity: {k: v for k, v in d._asdict().items() if k != "quantity"} for d in self.largest}
        return asdict(self) | {"largest": largest, "agrees": self.agrees}

    def lines(self) -> dict[str, str]:
        """Summarize it in a few lines: label and text."""
        found = {
            "checked by": f"engine {self.other}, until {self.compared_until_s:.6g} s; "
            f"errors of the tolerance grow {self.amplification:.2g} times until then"
        }
        states = [d for d in self.largest if d.quantity != EVENT_TIME]
        if states:
            worst = max(states, key=lambda d: d.difference)
            found["largest difference"] = (
                f"{worst.quantity}, {worst.difference:.2g} of its scale at {worst.t_s:.6g} s; "
                f"all within {CLOSE:g} until {self.agree_until_s:.6g} s"
            )
        times = [abs(d.first - d.other) for d in self.largest if d.quantity == EVENT_TIME]
        if times:
            found["events of both"] = f"{self.events}, their times within {times[0]:.2g} s"
        return found
