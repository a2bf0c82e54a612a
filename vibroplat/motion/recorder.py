"""Records a run: keeps what was asked for, and hands its tables over part by part during the run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import AfterValidator
from pydantic_core import PydanticCustomError

from vibroplat.config.scene import Scene
from vibroplat.frames import ArrayTable, pd
from vibroplat.hybrid.state import EVENT, Automaton
from vibroplat.observe.tables import COPIES, Blocks, Records, Segment, TrajectoryRows, closed, event_table
from vibroplat.results.tables import TableFile
from vibroplat.system.memory import MemoryBudget, size_text

#: What a run keeps besides its summary.
Keep = Literal["segments", "table", "events", "summary"]
#: Functions that are given the trajectory table and the event table part by part, at least once, without rows if need
#: be.
Sink: TypeAlias = "tuple[Callable[[pd.DataFrame], object], Callable[[pd.DataFrame], object]]"
#: Files that these tables are written to.
Files = tuple[TableFile, TableFile]


def _sink(value: Any) -> Any:
    listed = value if isinstance(value, Sequence) else ()
    if len(listed) != 2 or not all(callable(one) or isinstance(one, TableFile) for one in listed):
        raise PydanticCustomError("sink", "two functions, or two files of tables")
    return value


#: Either of them, given to a function.
SinkArgument = Annotated[Any, AfterValidator(_sink)]

#: What to change if it does not fit into memory.
ADVICE: dict[Keep, str] = {
    "segments": "shorten run.duration_s, or simulate with keep='table'",
    "table": "lower output.sample_rate_hz or shorten run.duration_s",
    "events": "shorten run.duration_s, or simulate with keep='summary'",
    "summary": "",
}

#: Most dense output (bytes) that a run keeps: 600 000 steps. Stiff scenes take millions.
MAX_DENSE_OUTPUT = 2**30

_NO_EVENTS = np.zeros(0, EVENT)


class Recorder:
    """Observes a run and records it.

    Parameters
    ----------
    scene, keep, sink
        As in :func:`vibroplat.motion.run.simulate`.

    Attributes
    ----------
    segments
        All segments, if they are kept.
    note
        Warning that the trajectory table is kept instead of dense output, which grew too large; else "".
    """

    def __init__(self, scene: Scene, keep: Keep, sink: Sink | Files | None = None) -> None:
        self.segments: list[Segment] = []
        self.note = ""
        self._scene, self._keep, self._sink = scene, keep, sink
        self._budget = MemoryBudget(ADVICE[keep])
        self._kept_events: list[Records] = []
        self._parts: list[pd.DataFrame] = []
        self._rows: list[TrajectoryRows] = []
        self._events: Blocks | None = None
        if keep == "table" or sink is not None:
            self._rows = [TrajectoryRows(scene, self._take)]
        if sink is not None:
            self._events = Blocks(EVENT, lambda events: _hand(event_table(events, scene), sink[1]))

    def read(self, h: Automaton) -> None:
        """Record the closed pieces and the events; MemoryError if they would take too much memory."""
        try:
            for segment in closed(h) if self._rows or self._keep == "segments" else ():
                for rows in self._rows:
                    rows.add(segment)
                if self._keep == "segments":
                    self._budget.take(segment.nbytes)
                    self.segments.append(segment)
                    if self._budget.taken > MAX_DENSE_OUTPUT:
                        self._keep_table()
        finally:  # events are recorded even if memory has run out
            if h.run["events"]:
                events = h.events[: h.run["events"]].copy()
                if self._events is not None:
                    self._events.put(events)
                if self._keep != "summary":
                    self._budget.take(events.nbytes)
                    self._kept_events.append(events)

    def _keep_table(self) -> None:
        """Keep the trajectory table from here on, and instead of the dense output so far."""
        self.note = (
            f"dense output takes more than {size_text(MAX_DENSE_OUTPUT)} after {self.segments[-1].end:.4g} s: the run "
            "keeps the trajectory table at output.sample_rate_hz instead; shorten run.duration_s for dense output"
        )
        self._budget = MemoryBudget(ADVICE["table"])
        rows = TrajectoryRows(self._scene, self._keep_part)
        for segment in self.segments:
            rows.add(segment)
        self._rows.append(rows)
        self.segments, self._keep = [], "events"

    def _keep_part(self, part: ArrayTable) -> None:
        """Keep a part of the trajectory table."""
        self._budget.take(COPIES * int(part.frame.memory_usage(index=False).sum()))
        self._parts.append(part.frame)

    def _take(self, part: ArrayTable) -> None:
        """Take a part of the trajectory table."""
        if self._keep == "table":
            self._keep_part(part)
        if self._sink is not None:
            _hand(part, self._sink[0])

    def finish(self) -> None:
        """Record the rest of the tables when the motion has ended."""
        self._budget = MemoryBudget(bounded=False)  # the rest is small, and a run without memory ends here
        for rows in self._rows:
            rows.finish()
        if self._events is not None:
            self._events.finish()

    @property
    def events(self) -> Records:
        """All events, records of :data:`vibroplat.hybrid.state.EVENT`, if they are kept."""
        return np.concatenate(self._kept_events) if self._kept_events else _NO_EVENTS

    @property
    def table(self) -> pd.DataFrame | None:
        """The trajectory table, if that is kept."""
        return pd.concat(self._parts, ignore_index=True) if self._parts else None


def _hand(part: ArrayTable, taker: Callable[[pd.DataFrame], object] | TableFile) -> None:
    """Hand a part of a table over, to files without making a DataFrame of it."""
    if isinstance(taker, TableFile):
        taker.append(part)
    else:
        taker(part.frame)
