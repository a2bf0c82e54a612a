"""Sweeps and orbits on the page: series of points, each of which is a row of a table."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.page.labels import unit, words
from vibroplat.page.thinning import plain_column

EXCITATION = "excitation_frequency_hz"
SUPPLY = "supply_frequency_hz"
#: Most rows of a table on the page.
MOST_ROWS = 5000
#: Share of the range of RMS x or y in a sweep beyond which the step between two neighbours is a jump.
JUMP = 1 / 3
_SIZES = ["rms_x_m", "rms_y_m"]
#: Columns drawn over the frequency, with the factor to the unit shown.
MEASURES = {
    "rms_y_m": (1e3, "mm"),
    "phase_difference_rad": (1.0, "rad"),
    "gap_max_m": (1e3, "mm"),
    "contact_force_max_n": (1.0, "N"),
    "motor_power_w": (1.0, "W"),
    "flight_fraction": (1.0, ""),
    "impulse_max_n_s": (1.0, "N s"),
    "rms_x_m": (1e3, "mm"),
    "rms_phi_rad": (1e3, "mrad"),
    "lyapunov_per_s": (1.0, "1/s"),
}


def thinned(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of a table that the page has, numbered anew; one that is too long loses some evenly."""
    if len(table) > MOST_ROWS:
        table = table.iloc[np.unique(np.linspace(0, len(table) - 1, MOST_ROWS).round().astype(int))]
    return table.reset_index(drop=True)


def table_data(title: str, result: int, table: pd.DataFrame, rows: int) -> dict[str, Any]:
    """Return a table for the page that has been thinned from so many rows."""
    columns = [
        {"name": str(name), "words": words(str(name)), "unit": unit(str(name)), "values": plain_column(table[name])}
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
        label = ", ".join(f"{words(key)} {_short(first[key])}{_with_unit(key)}" for key in several)
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


def orbit_series(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return a series for each stretch of a branch of orbits that is stable or unstable throughout."""
    series = []
    for number, (branch, rows) in enumerate(table.groupby("branch", sort=True)):
        stable = rows["stable"].astype(bool).to_numpy()
        places = [int(place) for place in rows.index]
        edges = [0, *(np.flatnonzero(np.diff(stable)) + 1).tolist(), len(places)]
        for first, after in pairwise(edges):
            series.append(
                {
                    "label": f"branch {branch}, {'stable' if stable[first] else 'unstable'}",
                    "colour": number,
                    "symbol": "circle" if stable[first] else "circle-open",
                    "dash": "solid" if stable[first] else "dash",
                    "rows": places[max(first - 1, 0) : after],  # joined to the stretch before
                    "open": [],
                    "failed": [],
                }
            )
    return series


def special_marks(special: pd.DataFrame, table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return for each kind of special point its rows, and the nearest orbit of its branch to each of them."""
    shared = [
        name
        for name in special.columns
        if name in table and name != "branch" and is_numeric(special[name]) and is_numeric(table[name])
    ]
    spread = {name: float(np.ptp(table[name].dropna())) or 1.0 for name in shared if table[name].notna().any()}
    marks: dict[str, dict[str, Any]] = {}
    for place, point in enumerate(special.to_dict("records")):
        rows = table[table["branch"] == point["branch"]]
        distance = sum(((rows[name] - point[name]) / width).abs().fillna(0.0) for name, width in spread.items())
        if len(rows) and isinstance(distance, pd.Series):
            mark = marks.setdefault(str(point["kind"]), {"kind": str(point["kind"]), "rows": [], "nearest": []})
            mark["rows"].append(place)
            mark["nearest"].append(int(rows.index[int(distance.argmin())]))
    return list(marks.values())


def axes(table: pd.DataFrame, preferred: str) -> list[dict[str, Any]]:
    """Return the columns that points may be drawn over, the preferred one first."""
    names = [str(name) for name in table.columns]
    stop = names.index(preferred) if preferred in names else len(names)
    keys = [name for name in names[:stop] if is_numeric(table[name]) and name not in ("branch", "parent", "point")]
    varying = [name for name in keys if len(table[name].dropna().unique()) > 1]
    found = [name for name in (preferred, *varying) if name in names]
    return [{"column": name, "words": words(name), "unit": unit(name)} for name in dict.fromkeys(found)]


def measures(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the panels that a table fills."""
    found = []
    for name, (factor, shown) in MEASURES.items():
        if name in table and is_numeric(table[name]) and table[name].notna().any() and table[name].abs().max() > 0.0:
            found.append({"column": name, "words": words(name), "unit": shown, "factor": factor})
    return found


def is_numeric(column: pd.Series) -> bool:
    """Whether a column has real numbers."""
    return pd.api.types.is_numeric_dtype(column) and not pd.api.types.is_bool_dtype(column)


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, int | float | np.number) else str(value)


def _with_unit(key: str) -> str:
    return f" {unit(key)}" if unit(key) else ""
