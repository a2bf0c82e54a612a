"""Orbits of the points of sweeps and branches on the page: one period of as many of them as there is room for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.config.scene import Scene
from vibroplat.errors import VibroplatError
from vibroplat.page.run import impacts_of, initials, machine_of
from vibroplat.page.thinning import packed_coarsely, spread

#: Most samples of all orbits on a page, some 65 for each turn: 1.5 MB.
ROWS = 50_000

Row = Mapping[str, Any]
#: Computes one period of the orbit of a row: its scene, trajectory, events. Raises VibroplatError.
Mover = Callable[[Scene, Row], tuple[Scene, pd.DataFrame, pd.DataFrame]]
#: Called with how many points are done, and how many there are.
Progress = Callable[[int, int], None]

_SHOWN = (
    *("t_s", "x_m", "y_m", "phi_rad", "phi1_rad", "phi2_rad", "y_rate_m_per_s"),
    *("gap_m", "upper_m", "contact_force_n"),
)


@dataclass
class Motions:
    """Computes the orbits of a figure.

    Attributes
    ----------
    scene
        Whose points they are.
    mover
        Computes them; None for a page without orbits.
    room
        How many samples they may have.
    progress
        Told of each point.
    """

    scene: Scene
    mover: Mover | None
    room: int
    progress: Progress | None = None
    _list: list[dict[str, Any]] = field(default_factory=list)
    _machines: list[dict[str, Any]] = field(default_factory=list)

    def of(self, special: pd.DataFrame | None, table: pd.DataFrame, first: Iterable[int]) -> dict[str, Any]:
        """Return the orbits of special points, of some rows of a table, then of rows evenly chosen while there is room.

        Returns
        -------
        dict
            ``list``: the orbits; ``machines`` that move through them; ``rows``, ``special``: for each row number the
            place of its orbit, or why it has none.
        """
        records: list[Row] = [] if special is None else _records(special)
        rows = _records(table)
        told = {row: text for row, text in enumerate(map(_why_none, rows)) if text}
        order = [row for row in dict.fromkeys([*first, *spread(len(rows))]) if row not in told]
        found: dict[str, dict[int, int | str]] = {"rows": {**told}, "special": {}}
        wanted = [(found["special"], row, record) for row, record in enumerate(records)]
        self._compute([*wanted, *((found["rows"], row, rows[row]) for row in order)])
        return {**found, "list": self._list, "machines": self._machines}

    def _compute(self, wanted: list[tuple[dict[int, int | str], int, Row]]) -> None:
        """Compute orbits in this order, until there is no more room."""
        used = 0
        for done, (places, row, record) in enumerate(wanted if self.mover else ()):
            if self.progress is not None:
                self.progress(done, len(wanted))
            assert self.mover is not None
            try:
                scene, trajectory, events = self.mover(self.scene, record)
            except VibroplatError as error:
                places[row] = f"It has no orbit on this page: {error}."
                continue
            used += len(trajectory)
            if used > self.room:
                break
            places[row] = len(self._list)
            self._list.append(self._packed(scene, trajectory, events))

    def _packed(self, scene: Scene, trajectory: pd.DataFrame, events: pd.DataFrame) -> dict[str, Any]:
        """Return what the page shows of an orbit."""
        machine = machine_of(scene)
        if machine not in self._machines:
            self._machines.append(machine)
        seconds = float(trajectory["t_s"].iloc[-1])
        turns = abs(float(np.ptp(trajectory["phi1_rad"].iloc[[0, -1]]))) / (2.0 * np.pi)
        return {
            "end": seconds,
            "turns": round(turns),
            "columns": {name: packed_coarsely(trajectory[name]) for name in _SHOWN if name in trajectory},
            "modes": "".join(trajectory["mode"].map(initials)),
            "impacts": impacts_of(events, 0.0, seconds),
            "machine": self._machines.index(machine),
        }


def _records(table: pd.DataFrame) -> list[Row]:
    """Return the rows of a table by column."""
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]


def _why_none(row: Row) -> str:
    """Say why a row of a sweep cannot have an orbit; "" if it can."""
    if row.get("outcome", "ok") != "ok":
        return f"This point failed ({row['outcome']}), so it has no orbit."
    period = row.get("period")
    return "" if pd.notna(period) and period else "The motion of this point does not repeat, so it has no orbit."
