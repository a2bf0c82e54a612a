"""Sweeps and orbits on the page: series of points, each of which is a row of a table."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.columns import unit_of
from vibroplat.config.coordinates import COORDINATES, RATES
from vibroplat.page.labels import words
from vibroplat.page.thinning import plain_column
from vibroplat.plots.names import ABSCISSAE, MEASURES, PHASE_COLUMN, is_number
from vibroplat.plots.orbits import Branches, meaning, places_of

EXCITATION, SUPPLY = ABSCISSAE["excitation"], ABSCISSAE["supply"]
#: Most rows of a table on the page.
MOST_ROWS = 5000
#: Share of the range of RMS x or y in a sweep beyond which the step between two neighbours is a jump.
JUMP = 1 / 3
#: Columns of a state, which few readers want to see.
_STATE = {*COORDINATES, *RATES}
_SIZES = ["rms_x_m", "rms_y_m"]
#: Share of the largest RMS (m or rad) up to which another one is rounding: orbits in antiphase have 2e-13 m along x and
#: 4e-11 rad beside 9e-3 m along y.
ROUNDING = 1e-7
#: Columns drawn over the frequency, one panel each.
DRAWN = (
    *("rms_y_m", "phase_difference_rad", "gap_max_m", "contact_force_max_n", "motor_power_w", "flight_fraction"),
    *("impulse_max_n_s", "rms_x_m", "rms_phi_rad", "lyapunov_per_s"),
)


def thinned(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of a table that the page has, numbered anew; one that is too long loses some evenly."""
    if len(table) > MOST_ROWS:
        table = table.iloc[np.unique(np.linspace(0, len(table) - 1, MOST_ROWS).round().astype(int))]
    return table.reset_index(drop=True)


def table_data(title: str, result: int, table: pd.DataFrame, rows: int) -> dict[str, Any]:
    """Return a table for the page that has been thinned from so many rows."""
    columns = [
        {
            "name": str(name),
            "words": words(str(name)),
            "unit": unit_of(str(name)),
            "state": name in _STATE,
            "values": plain_column(table[name]),
        }
        for name in table.columns
    ]
    return {"title": title, "result": result, "columns": columns, "rows": len(table), "of": rows}


def sweep_series(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return a series of row numbers for each branch of a sweep; None stands where a curve is broken."""
    keys = [str(name) for name in table.columns[: list(table.columns).index("direction")] if name != SUPPLY]
    several = [key for key in keys if len(table[key].unique()) > 1]
    numbers: dict[str, int] = {}
    series = []
    spread = table[_SIZES].max() - table[_SIZES].min()
    for _, rows in table.groupby("branch", sort=True):
        first = rows.iloc[0]
        label = ", ".join(_valued(key, first[key]) for key in several)
        colour = numbers.setdefault(label, len(numbers))
        direction = str(first["direction"])
        series.append(
            {
                "label": ", ".join(part for part in (label, direction) if part),
                "colour": colour,
                "symbol": "triangle-down" if direction == "down" else "triangle-up",
                "dash": "solid",
                "rows": list(_broken_at_jumps(rows, (rows[_SIZES].diff().abs() > JUMP * spread).any(axis=1))),
                "open": [int(place) for place in rows.index[rows["motion"] != "periodic"]],
                "failed": [int(place) for place in rows.index[rows["outcome"] != "ok"]],
            }
        )
    return series


def _broken_at_jumps(rows: pd.DataFrame, jumps: pd.Series) -> Iterator[int | None]:
    """Yield the numbers of rows in order, and None between two that another motion lies between."""
    before = None
    for place, jumped, sync in zip(rows.index, jumps, rows["sync"], strict=True):
        if before is not None and (jumped or before != sync):
            yield None
        before = sync
        yield int(place)


def orbit_series(found: Branches, table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return two series of row numbers, of stable and of unstable orbits, for each combination of the grid's values.

    Without a grid, for each branch. None stands where a line is broken.
    """
    series: dict[tuple[str, bool], dict[str, Any]] = {}
    names: dict[str, int] = {}
    for values, rows in _branches(found, table):
        name = ", ".join(_valued(key, values[key]) for key in found.varied) or f"branch {values['branch']}"
        stable = rows["stable"].astype(bool).to_numpy()
        places = [int(place) for place in rows.index]
        edges = [0, *(np.flatnonzero(np.diff(stable)) + 1).tolist(), len(places)]
        for first, after in pairwise(edges):
            good = bool(stable[first])
            look = {
                "label": name,
                "colour": names.setdefault(name, len(names)),
                "symbol": "circle" if good else "circle-open",
                "dash": "solid" if good else "dash",
            }
            one = series.setdefault((name, good), {**look, "rows": [], "open": [], "failed": []})
            one["rows"] += [*places[max(first - 1, 0) : after], None]  # joined to the stretch before
    return list(series.values())


def _branches(found: Branches, table: pd.DataFrame) -> Iterator[tuple[pd.Series, pd.DataFrame]]:
    """Yield what all rows of a branch share, and its rows."""
    for _, rows in table.groupby([*found.grid, "branch"], sort=False):
        yield rows.iloc[0], rows


def special_marks(found: Branches, special: pd.DataFrame, table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return for each kind of special point its rows, where they lie, and the row of the last point before each.

    Columns that a special point does not have lie between the points of the branch before and after it.
    """
    marks: dict[str, dict[str, Any]] = {}
    for values, rows in _branches(found, table):
        whole, own = _alike(found, found.points, values), _alike(found, special, values)
        shares = places_of(whole, own)
        drawn = {name: _between(whole, own, name, shares) for name in (found.key, EXCITATION, *DRAWN)}
        points = rows["point"].to_numpy(dtype=float)
        for number, (place, kind) in enumerate(own["kind"].items()):
            empty: dict[str, Any] = {"rows": [], "nearest": [], "at": {name: [] for name in drawn}}
            mark = marks.setdefault(str(kind), {"kind": str(kind), "meaning": meaning(str(kind)), **empty})
            mark["rows"].append(place)
            mark["nearest"].append(int(rows.index[np.abs(points - shares[number]).argmin()]))
            for name, at in drawn.items():
                mark["at"][name].append(at[number])
    return list(marks.values())


def _alike(found: Branches, table: pd.DataFrame, values: pd.Series) -> pd.DataFrame:
    """Return the rows of the branch to which some values belong."""
    for key in (*found.grid, "branch"):
        table = table[table[key] == values[key]]
    return table


def _between(whole: pd.DataFrame, own: pd.DataFrame, name: str, shares: Any) -> list[Any]:
    """Return a column at special points: their own values, or those between the points of their branch."""
    if name in own:
        return plain_column(own[name])
    if name not in whole:
        return [None] * len(own)
    values = whole[name].to_numpy(dtype=float)
    values = np.unwrap(values) if name == PHASE_COLUMN else values
    return plain_column(pd.Series(np.interp(shares, np.arange(len(whole)), values)))


def ends(found: Branches, table: pd.DataFrame) -> list[int]:
    """Return the first and the last row of each branch."""
    return [int(rows.index[place]) for _, rows in _branches(found, table) for place in (0, -1)]


def axes(table: pd.DataFrame, columns: Iterable[str]) -> list[dict[str, Any]]:
    """Return those of some columns that points may be drawn over, numbers that vary, in their order."""
    given = [name for name in dict.fromkeys(columns) if name in table and is_number(table[name])]
    found = [name for name in given if len(table[name].dropna().unique()) > 1] or given[:1]
    return [{"column": name, "words": words(name), "unit": unit_of(name)} for name in found]


def sweep_axes(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return what a sweep may be drawn over: frequencies, and what its grid varies."""
    return axes(table, [EXCITATION, SUPPLY, *table.columns[: list(table.columns).index("direction")]])


def orbit_axes(found: Branches, table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return what branches may be drawn over: their key and the excitation frequency, as figures have it first."""
    return axes(table, [found.abscissa, found.key, EXCITATION])


def measures(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the panels that a table fills; what does not move but for rounding has none."""
    numbers = [name for name in DRAWN if name in table and is_number(table[name]) and table[name].notna().any()]
    largest = {name: float(table[name].abs().max()) for name in numbers}
    moved = max((size for name, size in largest.items() if name.startswith("rms")), default=0.0)
    found = []
    for name in numbers:
        if largest[name] > (ROUNDING * moved if name.startswith("rms") else 0.0):
            shown = MEASURES[name]
            unit = "rad" if name == PHASE_COLUMN else shown.unit
            found.append({"column": name, "words": words(name), "unit": unit, "factor": shown.factor})
    return found


def boundary_series(found: Branches, table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return a series of row numbers for each kind of special point and combination of the grid's values."""
    kinds, series = list(dict.fromkeys(table["kind"])), []
    looks: dict[str, int] = {}
    for values, rows in ((rows.iloc[0], rows) for _, rows in table.groupby([*found.grid, "kind"], sort=False)):
        combination = ", ".join(_valued(key, values[key]) for key in found.varied)
        curves = [[*curve.index.tolist(), None] for _, curve in rows.groupby("curve")]
        series.append(
            {
                "label": ": ".join(part for part in (combination, str(values["kind"])) if part),
                "colour": kinds.index(values["kind"]),
                "dash": looks.setdefault(combination, len(looks)),
                "rows": [row for curve in curves for row in curve],
            }
        )
    return series


def _valued(key: str, value: Any) -> str:
    """Return a value of a key in a legend."""
    number = f"{value:g}" if isinstance(value, int | float | np.number) else str(value)
    return f"{words(key)} {number} {unit_of(key)}".rstrip()
