"""Bands of a sweep: from where to where exciters synchronize, motion jumps, material lifts off, points fail."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.columns import SHAKING, Column, Columns, unit_of, words, words_in_place
from vibroplat.study.branches import EXCITATION, SUPPLY, study_table

Flags = np.ndarray[Any, np.dtype[np.bool_]]
#: Columns of a table, or of a part of it.
Rows = Mapping[str, np.ndarray[Any, Any]]

RMS = "rms_y_m"
#: Change of the excitation frequency between two points that is a jump, over that of the synchronous frequency. Along
#: a smooth branch it is about 1, less where a resonance holds the motors back.
LEAP = 2.5
#: Change of the phase difference between two points that is a jump (rad); where radii differ it may shift gradually.
TURN = np.pi / 4.0
#: Change of amplitude between two points that is a jump, over the largest amplitude of the branch and over the changes
#: next to it; up a resonance the amplitude grows as much, but over several points.
RISE, ALONE = 0.15, 4.0

#: Columns of the table, after the grid keys, direction and branch; the last ones are of the ends.
ENDS: Columns = {
    f"{end}_{column}": Column(f"{meaning} at the {place} point", "in the order of the branch")
    for column, meaning in ((SUPPLY, "supply frequency"), (EXCITATION, "excitation frequency"), (RMS, "RMS of y"))
    for end, place in (("from", "first"), ("to", "last"))
}
BANDS: Columns = {
    "kind": Column(
        "kind of band",
        "band: points of one synchronization; jump: of the motion, between two points; liftoff and flight-end: from "
        "the last point before to the first one after; largest: the largest RMS of y; failed: points that failed",
    ),
    "name": Column("synchronization", "of a jump, before and after it; of failed points, their outcome instead"),
    "points": Column("points from end to end"),
    **ENDS,
}


def jumps(rows: pd.DataFrame | Rows) -> Flags:
    """Return where the motion jumps along a branch: whether it does between each point and the next.

    It does where synchronization is lost or found, or where the phase difference, the excitation frequency or the
    amplitude changes far more than it would along a smooth branch. Next to a failed point nothing is known. Over
    another key than the supply the excitation frequency should change as it does next to it.

    Parameters
    ----------
    rows
        The points of one branch of a sweep table, in their order.

    Returns
    -------
    array
        One value less than there are points.
    """
    columns = (EXCITATION, "rms_x_m", RMS, "phase_difference_rad")
    found, x, y, phase = (np.asarray(rows[column], dtype=float) for column in columns)
    known = np.isfinite(found)
    if len(found) < 2 or not known.any():
        return np.zeros(max(len(found) - 1, 0), dtype=bool)
    sync = np.asarray(rows["sync"], dtype=object)
    sync = np.where(pd.isna(sync), "", sync)
    both = (sync[:-1] != "") & (sync[1:] != "")
    held = (sync[:-1] != "none") & (sync[1:] != "none")
    lost = both & ((sync[:-1] == "none") != (sync[1:] == "none"))
    moved, height = np.abs(np.diff(found)), np.hypot(x, y)
    if SUPPLY in rows:
        supply = np.asarray(rows[SUPPLY], dtype=float)
        most = LEAP * np.abs(np.diff(supply)) * np.median(found[known] / supply[known])
    else:
        most = ALONE * _beside(np.nan_to_num(moved))
    change = np.abs(np.diff(height))
    with np.errstate(invalid="ignore"):
        turned = held & (np.abs(np.angle(np.exp(1j * np.diff(phase)))) > TURN)
        leapt = moved > np.maximum(most, 1e-3 * found[1:])
        rose = (change > RISE * np.nanmax(height, initial=0.0)) & (change > ALONE * _beside(change))
    return np.asarray(lost | turned | leapt | rose)


def _beside(change: Any) -> Any:
    """Return the larger of the changes before and after each change along a branch."""
    return np.maximum(np.append(change[1:], 0.0), np.insert(change[:-1], 0, 0.0))


def bands(table: pd.DataFrame) -> pd.DataFrame:
    """Return the bands of all branches of a sweep table: the grid keys, direction and branch, and :data:`BANDS`.

    Over another key than the supply, which is the first column of the table, the ends are in its columns.
    """
    key, *place = table.columns[: list(table.columns).index("branch") + 1]
    needed = {*place, key, EXCITATION, RMS, "rms_x_m", "phase_difference_rad", "flight_fraction", "outcome", "sync"}
    columns = {name: table[name].to_numpy() for name in needed}
    order = np.argsort(columns["branch"], kind="stable")
    ends = np.flatnonzero(np.diff(columns["branch"][order])) + 1
    found = [
        {key: rows[key][0] for key in place} | band
        for branch in (np.split(order, ends) if len(table) else [])
        for rows in [{name: values[branch] for name, values in columns.items()}]
        for band in _bands_of(rows, key)
    ]
    meanings = {key: Column(text) for key, text in table.attrs.get("meanings", {}).items()}
    meant = {
        name.replace(SUPPLY, key): column._replace(meaning=column.meaning.replace(words(SUPPLY), words_in_place(key)))
        for name, column in BANDS.items()
    }
    return study_table(found, [*place, *meant], {key: table[key] for key in place[:-2]}, {**meanings, **meant})


def _bands_of(rows: Rows, key: str) -> Iterator[dict[str, Any]]:
    """Yield the bands of a branch: synchronization and failures, jumps, flight, the largest amplitude."""
    failed = rows["outcome"] != "ok"
    names = np.where(failed, rows["outcome"], rows["sync"]).astype(str)
    begins = np.flatnonzero(np.append(True, names[1:] != names[:-1])).tolist()
    for first, after in zip(begins, [*begins[1:], len(names)], strict=True):
        yield _band(rows, key, first, after - 1, "failed" if failed[first] else "band", str(names[first]))
    good = {name: values[~failed] for name, values in rows.items()}
    for i in np.flatnonzero(jumps(good)).tolist():
        change = list(dict.fromkeys(good["sync"][i : i + 2]))
        yield _band(good, key, i, i + 1, "jump", " → ".join(change))
    flies = good["flight_fraction"] > 0.0
    for i in np.flatnonzero(flies[1:] != flies[:-1]).tolist():
        yield _band(good, key, i, i + 1, "liftoff" if flies[i + 1] else "flight-end", "")
    if not np.isnan(good[RMS]).all():
        top = int(np.nanargmax(good[RMS]))
        yield _band(good, key, top, top, "largest", str(good["sync"][top]))


def _band(rows: Rows, key: str, first: int, last: int, kind: str, name: str) -> dict[str, Any]:
    at = {f"{end}_{c}": rows[c][i] for c in (key, EXCITATION, RMS) for end, i in (("from", first), ("to", last))}
    return {"kind": kind, "name": name, "points": last - first + 1} | at


# -- for the user -----------------------------------------------------------------------------------------

#: Branches whose bands are printed; the table holds those of all.
SHOWN = 6
_LABELS = {"jump": "jump", "liftoff": "lift-off", "flight-end": "end of flight", "largest": "largest RMS y"}


def band_lines(table: pd.DataFrame, rotation: str = "") -> Iterator[str]:
    """Yield the bands of the first branches as text: a line for each branch, and one for each of its bands below it.

    They say what the machine does if it is known how its exciters are driven, ``counter-rotating`` or ``co-rotating``.
    """
    keys = list(table.columns[: list(table.columns).index("direction")])
    branches = table["branch"].unique()
    for branch in branches[:SHOWN]:
        rows = table[table["branch"] == branch]
        yield ", ".join([*(f"{key} {rows[key].iloc[0]}" for key in keys), str(rows["direction"].iloc[0])])
        for _, row in rows.iterrows():
            shakes = SHAKING.get((rotation, row["name"])) if row["kind"] == "band" else None
            yield f"  {_LABELS.get(row['kind'], row['name']):<26}{_span(row)}{f': {shakes}' if shakes else ''}"
    if len(branches) > SHOWN:
        yield f"bands of {len(branches) - SHOWN} more branches are in the table bands"


def _span(row: pd.Series) -> str:
    """Describe where a band is, and what happens there."""
    kind = row["kind"]
    across = " → " if kind in ("jump", "liftoff", "flight-end") else " … "
    key = next(str(column) for column in row.index if str(column).startswith("from_")).removeprefix("from_")
    over, found, height = ((row[f"from_{c}"], row[f"to_{c}"]) for c in (key, EXCITATION, RMS))
    parts = [f"{'f_e' if key == SUPPLY else words_in_place(key)} {_ends(over, 'g', across)} {unit_of(key)}".rstrip()]
    if np.isfinite(found).all():
        parts.append(f"f {_ends(found, '.2f', across)} Hz")
    if kind in ("jump", "largest"):
        parts.append(f"RMS y {_ends([1e3 * h for h in height], '.3g', across)} mm")
    if kind == "jump":
        parts.append(row["name"])
    return ", ".join(parts)


def _ends(values: Iterable[float], form: str, across: str) -> str:
    return across.join(dict.fromkeys(format(value, form) for value in values))
