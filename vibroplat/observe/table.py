"""The trajectory table: rows on the output grid and at events, made of segments while a run goes on or afterwards."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from vibroplat.columns import Column, Columns, labelled
from vibroplat.config.coordinates import COORDINATES, RATES, Mode
from vibroplat.config.scene import Scene
from vibroplat.config.sections import State
from vibroplat.hybrid.state import Automaton
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.motor import motor_powers
from vibroplat.model.parameters import parameters, supply
from vibroplat.model.systems import FULL_SIZE
from vibroplat.observe.segments import Segment, closed

#: Rows that are made and written at a time.
BLOCK = 2**15
#: Columns of the trajectory table, which are the keys of a full state, and of the Poincaré section.
_KEYS = dict.fromkeys(("t_s", "mode")) | dict.fromkeys(State.model_fields)
TRAJECTORY: Columns = {name: Column(State.model_fields[name].description or "") for name in _KEYS}


@dataclass(frozen=True)
class Rows:
    """Rows of a table.

    Attributes
    ----------
    t
        Times (s), shape (n,).
    mode, interval
        Numbers of the modes and of the drive's intervals, shape (n,).
    states, force
        Full states (n, 14) and contact forces (n,).
    """

    t: FloatArray
    mode: npt.NDArray[np.int64]
    interval: npt.NDArray[np.int64]
    states: FloatArray
    force: FloatArray

    def __len__(self) -> int:
        return self.t.size

    @property
    def columns(self) -> tuple[npt.NDArray[Any], ...]:
        """All arrays, with a row for each time."""
        return self.t, self.mode, self.interval, self.states, self.force

    def part(self, start: int, stop: int | None = None) -> Rows:
        """Return the rows from one number to another."""
        return Rows(*(column[start:stop] for column in self.columns))


def room(size: int) -> Rows:
    """Make room for rows."""
    mode, interval = np.empty((2, size), np.int64)
    return Rows(np.empty(size), mode, interval, np.empty((size, FULL_SIZE)), np.empty(size))


def together(parts: Sequence[Rows]) -> Rows:
    """Put rows one after another."""
    columns = zip(*(part.columns for part in (room(0), *parts)), strict=True)
    return Rows(*map(np.concatenate, columns))


class TableMaker:
    """Makes the trajectory tables of a scene."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._p = parameters(scene)
        self._intervals = scene.drive.intervals
        self._corners = [interval.start for interval in self._intervals[1:]]

    def rows(self, segment: Segment, times: FloatArray) -> Rows:
        """Evaluate a segment at ascending times (s)."""
        # no corner lies inside a segment
        owner = np.searchsorted(self._corners, 0.5 * (segment.start + segment.end), side="right")
        mode, interval = (np.full(times.size, int(n), np.int64) for n in (segment.system.mode, owner))
        return Rows(times, mode, interval, *segment(times))

    def blocks(self, segment: Segment) -> Iterator[Rows]:
        """Yield the rows of a segment: its beginning after an event, the output grid strictly inside, its end."""
        rate = self.scene.output.sample_rate_hz
        first, last = math.floor(segment.start * rate), math.ceil(segment.end * rate) + 1
        beginning = [] if segment.joined else [segment.start]
        for number in range(first, last, BLOCK):
            stop = min(number + BLOCK, last)
            grid = np.arange(float(number), float(stop)) / rate
            inside = grid[(grid > segment.start) & (grid < segment.end)]
            end = [segment.end] if stop == last else []
            times = np.concatenate((beginning, inside, end))
            if times.size:
                yield self.rows(segment, times)
            beginning = []

    def table(self, rows: Rows) -> pd.DataFrame:
        """Make a table of rows."""
        return labelled(pd.DataFrame(self.columns(rows)), TRAJECTORY)

    def columns(self, rows: Rows) -> dict[str, Any]:
        """Return the columns of a table by their names."""
        labels = pd.Index([mode.label for mode in Mode])
        columns: dict[str, Any] = {"t_s": rows.t, "mode": pd.Categorical.from_codes(rows.mode, categories=labels)}
        for half, names in ((0, COORDINATES), (7, RATES)):
            columns |= {names[i]: rows.states[:, half + i] for i in self.scene.coordinates}
        if self.scene.has_contact:
            columns["contact_force_n"] = rows.force
        return columns | self._supply(rows)

    def _supply(self, rows: Rows) -> dict[str, FloatArray]:
        """Power of both motors (W), and the supply frequency (Hz) where a program changes it, in all rows."""
        speeds, program = rows.states[:, 10:12], self.scene.drive.program
        power, frequency = np.empty(speeds.shape), np.empty(len(rows))
        for k in np.unique(rows.interval):
            interval, mine = self._intervals[k], rows.interval == k
            supply(self._p, self.scene, interval)
            power[mine] = motor_powers(rows.t[mine], speeds[mine], self._p)
            if program is not None:
                frequency[mine] = interval.frequency + interval.ramp * (rows.t[mine] - interval.start)
        columns = {} if program is None else {"supply_frequency_hz": frequency}
        return columns | {"motor_power_1_w": power[:, 0], "motor_power_2_w": power[:, 1]}


def column_count(scene: Scene) -> int:
    """Return the number of columns of a scene's trajectory table."""
    return len(TableMaker(scene).columns(room(0)))


class TableParts:
    """Observes a run: hands over its trajectory table in parts, and keeps none of them.

    Parameters
    ----------
    scene
        What moves.
    take
        Called with each part, the last of which may be shorter.
    """

    def __init__(self, scene: Scene, take: Callable[[pd.DataFrame], object]) -> None:
        self._maker = TableMaker(scene)
        self._take = take
        self._block = room(BLOCK)
        self._filled = 0
        self._last: Rows | None = None  # of the segment before: it is no row if the next one goes on from it
        self._handed_over = False

    def read(self, h: Automaton) -> None:
        """Make the rows of the closed pieces."""
        for segment in closed(h):
            self.add(segment)

    def add(self, segment: Segment) -> None:
        """Make the rows of the next segment."""
        if self._last is not None and not segment.joined:
            self._put(self._last)
        self._last = None
        for rows in self._maker.blocks(segment):
            if self._last is not None:
                self._put(self._last)
                self._last = None
            self._put(rows.part(0, -1))
            self._last = rows.part(-1)

    def finish(self) -> None:
        """Hand over the rest; a run without a step has one part without rows."""
        if self._last is not None:
            self._put(self._last)
            self._last = None
        if self._filled or not self._handed_over:
            self._hand_over()

    def _put(self, rows: Rows) -> None:
        """Add rows to the block, and hand it over whenever it is full."""
        while len(rows):
            if self._filled == BLOCK:
                self._hand_over()
            added = rows.part(0, BLOCK - self._filled)
            for column, values in zip(self._block.columns, added.columns, strict=True):
                column[self._filled : self._filled + len(added)] = values
            self._filled += len(added)
            rows = rows.part(len(added))

    def _hand_over(self) -> None:
        self._take(self._maker.table(self._block.part(0, self._filled)))
        self._filled, self._handed_over = 0, True
