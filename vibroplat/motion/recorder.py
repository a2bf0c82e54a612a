"""What a run keeps, and what it hands over while it goes on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from vibroplat.config.scene import Scene
from vibroplat.motion.motion import Observer
from vibroplat.motion.space import COPIES
from vibroplat.observe.events import EventParts, Events
from vibroplat.observe.notes import Peaks
from vibroplat.observe.segments import Segment, Segments
from vibroplat.observe.table import TableParts
from vibroplat.system.memory import Share

#: What a run keeps besides its summary.
Keep = Literal["segments", "table", "events", "summary"]

#: What to change if it does not fit into memory.
ADVICE: dict[Keep, str] = {
    "segments": "shorten run.duration_s, or simulate with keep='table'",
    "table": "lower output.sample_rate_hz or shorten run.duration_s",
    "events": "shorten run.duration_s, or simulate with keep='summary'",
    "summary": "",
}


class Sink(NamedTuple):
    """Functions that are given the trajectory table and the event table of a run, part by part, while it goes on.

    They are called at least once, by a run without rows too.
    """

    trajectory: Callable[[pd.DataFrame], object]
    events: Callable[[pd.DataFrame], object]


class Kept:
    """What a run keeps.

    Parameters
    ----------
    scene, keep, sink
        As in :func:`vibroplat.motion.run.simulate`.
    since
        When the measured part begins (s).

    Attributes
    ----------
    observers
        What reads the motion for it.
    """

    def __init__(self, scene: Scene, keep: Keep, sink: Sink | None, since: float) -> None:
        self._share = Share(ADVICE[keep])
        self._segments, self._events = Segments(self._share), Events(self._share)
        self._peaks = Peaks(since)
        self._sink = sink
        self._parts: list[pd.DataFrame] = []
        self._keeps_table = keep == "table"
        self._makers: list[TableParts | EventParts] = []
        if self._keeps_table or sink is not None:
            self._makers.append(TableParts(scene, self._take))
        if sink is not None:
            self._makers.append(EventParts(sink.events))
        self.observers: list[Observer] = [*self._makers]
        if keep == "segments":
            self.observers.append(self._segments)
        if keep != "summary":
            self.observers.append(self._events)

    def _take(self, part: pd.DataFrame) -> None:
        """Take a part of the trajectory table."""
        if self._keeps_table:
            self._share.take(COPIES * int(part.memory_usage(index=False).sum()))
            self._parts.append(part)
        if self._sink is not None:
            self._sink.trajectory(part)
        self._peaks.add(part)

    def finish(self) -> None:
        """Take the rest of the tables when the motion has ended."""
        self._share = Share(bounded=False)  # the rest is small, and a run without memory ends here
        for maker in self._makers:
            maker.finish()

    @property
    def segments(self) -> list[Segment]:
        """All segments, if they are kept."""
        return self._segments.kept

    @property
    def events(self) -> npt.NDArray[np.void]:
        """All events, if they are kept."""
        return self._events.rows

    @property
    def table(self) -> pd.DataFrame | None:
        """The trajectory table, if that is kept."""
        return pd.concat(self._parts, ignore_index=True) if self._keeps_table else None

    @property
    def peaks(self) -> Mapping[str, float] | None:
        """Largest values of the trajectory table in the measured part, if it was made."""
        return self._peaks.largest if self._makers else None
