"""Sweeps and orbits on the page: series of points, each a row of a table, and the orbits that a click on them shows."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.columns import shown_in, with_shaking, words, words_in_place
from vibroplat.config.coordinates import COORDINATES, RATES
from vibroplat.config.scene import Scene
from vibroplat.errors import VibroplatError
from vibroplat.page.run import impacts_of, initial, machine_of, packed_coarsely
from vibroplat.plots.labels import ABSCISSAE, in_ratios, is_number, value_words
from vibroplat.plots.orbits import MARKERS, MEANINGS, at_special, places_of
from vibroplat.plots.reading import Curve, curves_of, finite, rest_of
from vibroplat.plots.response import LEAST_RANGE
from vibroplat.plots.studies import UNREACHED, Study, grid_of
from vibroplat.plots.style import DIRECTIONS, SYMBOLS

EXCITATION = ABSCISSAE["excitation"]
#: Most rows of a table on the page.
MOST_ROWS = 5000
#: Most samples of all orbits on a page, some 65 for each turn: 1.5 MB.
MOST_SAMPLES = 50_000
#: Significant digits of the numbers in tables.
DIGITS = 9
#: Columns of a state, which few readers want to see.
_STATE = {*COORDINATES, *RATES}
#: Share of the largest RMS (m or rad) up to which another one is rounding: orbits in antiphase have 2e-13 m along x and
#: 4e-11 rad beside 9e-3 m along y.
ROUNDING = 1e-7
#: Columns drawn over the frequency, one panel each.
DRAWN = (
    *("rms_y_m", "phase_difference_rad", "gap_max_m", "contact_force_max_n", "motor_power_w", "flight_fraction"),
    *("impulse_max_n_s", "rms_x_m", "rms_phi_rad", "lyapunov_per_s"),
)
#: Columns of an orbit.
_ORBIT = (
    *("t_s", "x_m", "y_m", "phi_rad", "phi1_rad", "phi2_rad", "y_rate_m_per_s"),
    *("gap_m", "upper_m", "contact_force_n"),
)

Series = list[dict[str, Any]]

# -- tables ------------------------------------------------------------------------------------------------------------


def thinned(table: pd.DataFrame, most: int | None = None) -> pd.DataFrame:
    """Return the rows of a table that the page has, numbered anew; one that is too long loses some evenly."""
    most = most or MOST_ROWS
    if len(table) > most:
        table = table.iloc[np.unique(np.linspace(0, len(table) - 1, most).round().astype(int))]
    return finite(table).reset_index(drop=True)


def table_data(title: str, result: int, whole: pd.DataFrame, most: int | None = None) -> dict[str, Any]:
    """Return a table for the page, thinned, and how many rows it had."""
    table = thinned(whole, most)
    columns = [
        {
            "name": str(name),
            "words": words(str(name)),
            "unit": shown_in(str(name))[0],
            "factor": shown_in(str(name))[1],
            "state": name in _STATE,
            "values": plain_column(table[name]),
        }
        for name in table.columns
    ]
    return {"title": title, "result": result, "columns": columns, "rows": len(table), "of": len(whole)}


def plain_column(column: pd.Series) -> list[Any]:
    """Return the values of a column for JSON; numbers have :data:`DIGITS` digits, what is missing is None."""
    return [_plain(value) for value in column.astype(object).tolist()]


def _plain(value: Any) -> Any:
    if value is None or value is pd.NA or (isinstance(value, float) and not math.isfinite(value)):
        return None
    if isinstance(value, bool | int | str):
        return value
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else str(value)


def axes(table: pd.DataFrame, columns: Iterable[str]) -> list[dict[str, Any]]:
    """Return those of some columns that points may be drawn over, numbers that vary, in their order."""
    given = [name for name in dict.fromkeys(columns) if name in table and is_number(table[name])]
    found = [name for name in given if len(table[name].dropna().unique()) > 1] or given[:1]
    return [
        {"column": name, "words": words_in_place(name), "unit": unit, "factor": factor, "log": in_ratios(table[name])}
        for name in found
        for unit, factor in [shown_in(name)]
    ]


def measures(table: pd.DataFrame, columns: Iterable[str] = DRAWN) -> list[dict[str, Any]]:
    """Return the panels that a table fills; what moves by rounding alone has none.

    A small RMS is drawn small: the end of its axis is ``least``.
    """
    numbers = [name for name in columns if name in table and is_number(table[name]) and table[name].notna().any()]
    largest = {name: float(table[name].abs().max()) for name in numbers}
    moved = max((size for name, size in largest.items() if name.startswith("rms")), default=0.0)
    found = []
    for name in numbers:
        if largest[name] > (ROUNDING * moved if name.startswith("rms") else 0.0):
            unit, factor = shown_in(name)
            small = name.startswith("rms") and largest[name] < LEAST_RANGE * moved
            least = factor * LEAST_RANGE * moved if small else 0.0
            found.append({"column": name, "words": words(name), "unit": unit, "factor": factor, "least": least})
    return found


def shaking(table: pd.DataFrame, rotation: str) -> str:
    """Return a sentence on what the machine does in each synchronization of a table, or ""."""
    found = [with_shaking(str(sync), rotation) for sync in table["sync"].dropna().unique()] if "sync" in table else []
    told = "; ".join(text for text in found if ": " in text)
    return told and f"{told[0].upper()}{told[1:]}."


def _label(keys: Iterable[str], row: pd.Series) -> str:
    """Return the values of some keys in a legend."""
    return ", ".join(value_words(key, row[key]) for key in keys)


# -- sweeps ------------------------------------------------------------------------------------------------------------


def sweep_series(table: pd.DataFrame) -> Series:
    """Return a series of row numbers for each branch of a sweep; None stands where a curve is broken."""
    several = [key for key in grid_of(table) if len(table[key].unique()) > 1]
    series = []
    for curve in curves_of(table.sort_values("branch", kind="stable"), ["branch"], lambda row: _label(several, row)):
        rows, direction = curve.rows, curve.direction
        places = [int(place) for place in rows.index]
        breaks: list[list[int | None]] = [
            [place, None] if jumped else [place] for place, jumped in zip(places, [*curve.jumps, False], strict=True)
        ]
        series.append(
            {
                "label": ", ".join(part for part in (curve.label, direction) if part),
                "colour": curve.number,
                "symbol": SYMBOLS[DIRECTIONS["down" if direction == "down" else "up"]],
                "dash": "solid",
                "rows": [place for part in breaks for place in part],
                "open": [int(place) for place in rows.index[rows["motion"] != "periodic"]],
                "undecided": [int(place) for place in rows.index[rows["motion"] == "undecided"]],
                "failed": [int(place) for place in rows.index[rows["outcome"] != "ok"]],
            }
        )
    return series


# -- branches of orbits ------------------------------------------------------------------------------------------------


def _branches(found: Study, table: pd.DataFrame) -> list[Curve]:
    """Return the branches of a thinned table, without a grid each with a name of its own."""
    return curves_of(table, [*found.grid, "branch"], lambda row: _label(found.varied, row) or f"branch {row['branch']}")


def orbit_series(found: Study, table: pd.DataFrame) -> Series:
    """Return two series of row numbers, of stable and of unstable orbits, for each combination of the grid's values.

    Without a grid, for each branch. None stands where a line is broken.
    """
    series: dict[tuple[str, bool], dict[str, Any]] = {}
    for name, number, rows in _branches(found, table):
        stable = rows["stable"].astype(bool).to_numpy()
        places = [int(place) for place in rows.index]
        edges = [0, *(np.flatnonzero(np.diff(stable)) + 1).tolist(), len(places)]
        for first, after in pairwise(edges):
            good = bool(stable[first])
            look = {
                "label": name,
                "colour": number,
                "symbol": SYMBOLS["o"] if good else f"{SYMBOLS['o']}-open",
                "dash": "solid" if good else "dash",
            }
            one = series.setdefault((name, good), {**look, "rows": [], "open": [], "failed": []})
            one["rows"] += [*places[max(first - 1, 0) : after], None]  # joined to the stretch before
    return list(series.values())


def special_marks(found: Study, special: pd.DataFrame, table: pd.DataFrame) -> Series:
    """Return for each kind of special point its rows, where they lie, and the row of the last point before each.

    Columns that a special point does not have lie between the points of the branch before and after it.
    """
    marks: dict[str, dict[str, Any]] = {}
    for _, _, rows in _branches(found, table):
        whole, own = (found.alike(every, rows.iloc[0]) for every in (found.points, special))
        shares = places_of(whole, own)
        drawn = {name: _at(whole, own, name, shares) for name in (found.key, EXCITATION, *DRAWN)}
        points = rows["point"].to_numpy(dtype=float)
        for number, (place, kind) in enumerate(own["kind"].items()):
            empty: dict[str, Any] = {"rows": [], "nearest": [], "at": {name: [] for name in drawn}}
            named = {
                "kind": str(kind),
                "meaning": MEANINGS.get(str(kind), ""),
                "symbol": SYMBOLS[MARKERS.get(str(kind), "*")],
            }
            mark = marks.setdefault(str(kind), {**named, **empty})
            mark["rows"].append(place)
            mark["nearest"].append(int(rows.index[np.abs(points - shares[number]).argmin()]))
            for name, at in drawn.items():
                mark["at"][name].append(at[number])
    return list(marks.values())


def _at(whole: pd.DataFrame, own: pd.DataFrame, name: str, shares: Any) -> list[Any]:
    """Return a column at special points: their own values, or those between the points of their branch."""
    if name in own:
        return plain_column(own[name])
    return plain_column(pd.Series(at_special(whole, own, shares, name))) if name in whole else [None] * len(own)


def ends(found: Study, table: pd.DataFrame) -> list[int]:
    """Return the first and the last row of each branch."""
    return [int(rows.index[place]) for _, _, rows in _branches(found, table) for place in (0, -1)]


def boundary_series(found: Study, table: pd.DataFrame) -> Series:
    """Return a series of row numbers for each kind of special point and combination of the grid's values.

    Those of orbits that no motion comes to have one of their own; the column ``reached`` tells them.
    """
    kinds, series = list(dict.fromkeys(table["kind"])), []
    keys = [*found.grid, "kind", "reached"]
    for combination, number, rows in curves_of(table, keys, lambda row: _label(found.varied, row)):
        kind, is_reached = rows["kind"].iloc[0], bool(rows["reached"].iloc[0])
        series.append(
            {
                "label": ": ".join(filter(None, (combination, f"{kind}{'' if is_reached else f' {UNREACHED}'}"))),
                "reached": is_reached,
                "colour": kinds.index(kind),
                "dash": number,
                "rows": [row for _, curve in rows.groupby("curve") for row in [*curve.index.tolist(), None]],
            }
        )
    return series


# -- orbits of points --------------------------------------------------------------------------------------------------

Row = Mapping[str, Any]
#: Computes one period of the orbit of a row: its scene, trajectory, events. Raises VibroplatError.
Mover = Callable[[Scene, Row], tuple[Scene, pd.DataFrame, pd.DataFrame]]
#: Called with how many points are done, and how many there are.
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
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

    def of(self, special: pd.DataFrame | None, table: pd.DataFrame, first: Iterable[int]) -> dict[str, Any]:
        """Return the orbits of special points, of some rows of a table, then of rows evenly chosen while there is room.

        Returns
        -------
        dict
            ``list``: the orbits; ``machines`` that move through them; ``rows``, ``special``: for each row number the
            place of its orbit, or why it has none; ``asked``: whether orbits were to be computed.
        """
        records, rows = ([] if shown is None else _records(shown) for shown in (special, table))
        marked: dict[int, int | str] = {}
        found: dict[int, int | str] = {row: text for row, text in enumerate(map(_why_none, rows)) if text}
        order = [row for row in dict.fromkeys([*first, *spread(len(rows))]) if row not in found]
        wanted = [*((marked, *one) for one in enumerate(records)), *((found, row, rows[row]) for row in order)]
        orbits: Series = []
        machines: Series = []
        used = 0
        for done, (places, row, record) in enumerate(wanted):
            if self.mover is None:
                break
            if self.progress is not None:
                self.progress(done, len(wanted))
            try:
                scene, trajectory, events = self.mover(self.scene, record)
            except VibroplatError as error:
                places[row] = f"It has no orbit on this page: {error}."
                continue
            used += len(trajectory)
            if used > self.room:
                break
            places[row] = len(orbits)
            machine = machine_of(scene)
            machines += [] if machine in machines else [machine]
            orbits.append(
                _packed(trajectory.assign(y_m=trajectory["y_m"] - rest_of(scene)), events)
                | {"machine": machines.index(machine)}
            )
        return {"rows": found, "special": marked, "list": orbits, "machines": machines, "asked": self.mover is not None}


def _packed(trajectory: pd.DataFrame, events: pd.DataFrame) -> dict[str, Any]:
    """Return what the page shows of an orbit."""
    seconds = float(trajectory["t_s"].iloc[-1])
    turns = abs(float(np.ptp(trajectory["phi1_rad"].iloc[[0, -1]]))) / (2.0 * np.pi)
    return {
        "end": seconds,
        "turns": round(turns),
        "columns": {name: packed_coarsely(trajectory[name]) for name in _ORBIT if name in trajectory},
        "modes": "".join(trajectory["mode"].map(initial)),
        "impacts": impacts_of(events, 0.0, seconds),
    }


def spread(count: int) -> list[int]:
    """Order numbers from 0 so that the first ones, however many, lie evenly among all: by their bits, backwards."""
    bits = max(count - 1, 1).bit_length()
    return sorted(range(count), key=lambda number: int(f"{number:0{bits}b}"[::-1], 2))


def _records(table: pd.DataFrame) -> list[Row]:
    """Return the rows of a table by column."""
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]


def _why_none(row: Row) -> str:
    """Say why a row of a sweep cannot have an orbit; "" if it can."""
    if row.get("outcome", "ok") != "ok":
        return f"This point failed ({row['outcome']}), so it has no orbit."
    period = row.get("period")
    return "" if pd.notna(period) and period else "The motion of this point does not repeat, so it has no orbit."
