"""Orbits that a click on a point shows: one period of each, sampled evenly, as many as there is room for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.config.coordinates import TURN
from vibroplat.config.scene import Scene
from vibroplat.errors import VibroplatError
from vibroplat.page.machine import machine_of, moving, pack
from vibroplat.page.run import impulses_of, resample
from vibroplat.results.picture import Picture

#: Samples of a turn, and most samples of all orbits on a page: half a megabyte.
SAMPLES, MOST_SAMPLES = 32, 16_000

#: What is said of a point whose orbit had no room.
NOT_HELD = "The page does not hold the orbit of this point."

Row = Mapping[str, Any]
#: Computes one period of the orbit of a row: its scene, trajectory, events. Raises VibroplatError.
Mover = Callable[[Scene, Row], tuple[Scene, pd.DataFrame, pd.DataFrame]]
#: Called with how many points are done, and how many there are.
Progress = Callable[[int, int], None]


@dataclass
class Motions:
    """Computes the orbits of the pictures of a result.

    Attributes
    ----------
    scene
        Whose points they are.
    mover
        Computes them; None for a page without orbits.
    room
        How many samples they may have.
    machines
        What the drawings of all machines need, to which new ones are added.
    progress
        Told of each point.
    computed
        The orbits of tables so far; pictures may share one.
    homes
        Pictures on the page by the tables that they and their orbits have, whose data later ones share.
    """

    scene: Scene
    mover: Mover | None
    room: int
    machines: list[dict[str, Any]]
    progress: Progress | None = None
    computed: dict[int, dict[str, Any]] = field(default_factory=dict)
    homes: dict[tuple[int, int], int] = field(default_factory=dict)

    def of(self, picture: Picture, places: Any) -> dict[str, Any]:
        """Return what moves at some places of a picture.

        Returns
        -------
        dict
            ``list``: the orbits; ``owner``: of each place its number in the list, or -1 minus the number of the reason
            why it has none; ``why``: the reasons; ``owned``: whether these are orbits of another table; ``words`` about
            them; ``asked``: whether orbits were to be computed.
        """
        orbits = picture.orbits
        if orbits is None:
            return {"list": [], "owner": [], "why": [], "owned": False, "words": "", "asked": False}
        own = range(len(orbits.table)) if orbits.owner is None else orbits.owner
        owner = [own[point] if point < len(own) else None for point in places]
        if id(orbits.table) not in self.computed:
            wanted = [row for row in owner if row is not None]
            self.computed[id(orbits.table)] = self._computed(orbits.table, orbits.first, wanted)
        known = self.computed[id(orbits.table)]
        entries = [known["rows"].get(row, NOT_HELD) for row in owner]
        why = list(dict.fromkeys(one for one in entries if isinstance(one, str)))
        numbers = [-1 - why.index(one) if isinstance(one, str) else one for one in entries]
        owned = orbits.owner is not None and orbits.table is not picture.table
        data = {"list": known["list"], "owner": numbers, "why": why, "owned": owned, "words": orbits.words}
        return data | {"asked": self.mover is not None}

    def _computed(self, table: pd.DataFrame, first: Iterable[int], rows: Sequence[int]) -> dict[str, Any]:
        """Return the orbits of some rows of a table, then of those evenly chosen among others while there is room.

        Returns
        -------
        dict
            ``list``: the orbits; ``rows``: for each row the place of its orbit, or why it has none.
        """
        chosen = sorted({*rows})
        records: dict[int, Any] = dict(zip(chosen, table.iloc[chosen].to_dict("records"), strict=True))
        orbits: list[dict[str, Any]] = []
        entries: dict[int, int | str] = {row: text for row in chosen if (text := _why_none(records[row]))}
        order = dict.fromkeys([*(row for row in first if row in records), *(chosen[n] for n in evenly(len(chosen)))])
        wanted, used = [row for row in order if row not in entries], 0
        for done, row in enumerate(wanted):
            if self.mover is None:
                break
            if self.progress is not None:
                self.progress(done, len(wanted))
            try:
                scene, trajectory, events = self.mover(self.scene, records[row])
            except VibroplatError as error:
                entries[row] = f"It has no orbit on this page: {error}."
                continue
            orbit = self._packed(scene, trajectory, events)
            used += orbit["frames"]
            if used > self.room:
                break
            entries[row] = len(orbits)
            orbits.append(orbit)
        return {"list": orbits, "rows": entries}

    def _packed(self, scene: Scene, trajectory: pd.DataFrame, events: pd.DataFrame) -> dict[str, Any]:
        """Return what the page shows of an orbit."""
        seconds = float(trajectory["t_s"].iloc[-1])
        turns = max(1, round(abs(float(np.ptp(trajectory["phi1_rad"].iloc[[0, -1]]))) / TURN))
        count, machine = SAMPLES * turns, machine_of(scene)
        self.machines += [] if machine in self.machines else [machine]
        samples = resample(trajectory, scene, np.linspace(0.0, seconds, count, endpoint=False), "y_rate_m_per_s")
        hits = impulses_of(events, 0.0, seconds, count)
        windows, number = [[0.0, round(seconds, 6), 0, count]], self.machines.index(machine)
        orbit = moving(samples, scene, hits, windows=windows, turns=turns, machine=number)
        orbit["columns"]["y_rate_m_per_s"] = pack(samples["y_rate_m_per_s"])
        return orbit


def evenly(count: int) -> list[int]:
    """Order numbers from 0 so that the first ones, however many, lie evenly among all: by their bits, backwards."""
    bits = max(count - 1, 1).bit_length()
    return sorted(range(count), key=lambda number: int(f"{number:0{bits}b}"[::-1], 2))


def _why_none(row: Row) -> str:
    """Say why a row of a sweep cannot have an orbit; "" if it can."""
    if row.get("outcome", "ok") != "ok":
        return f"This point failed ({row['outcome']}), so it has no orbit."
    period = row.get("period")
    return "" if pd.notna(period) and period else "The motion of this point does not repeat, so it has no orbit."
