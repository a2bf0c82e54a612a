"""Bands of a sweep: from where to where exciters synchronize, motion jumps, material lifts off, points fail."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.columns import COUNT, TEXT, Column, Columns, display_name, indexed_name, unit_of
from vibroplat.config.circular import wrap
from vibroplat.config.digits import given, together
from vibroplat.kernels.compiled import FloatArray
from vibroplat.results.answer import in_columns
from vibroplat.results.labels import value_words
from vibroplat.study.branches import BRANCH, EXCITATION, SUPPLY, axis_name, study_table

Flags = np.ndarray[Any, np.dtype[np.bool_]]
#: Columns of a table, or of a part of it.
Rows = Mapping[str, np.ndarray[Any, Any]]

RMS, ERROR, FORCE = "rms_y_m", "rms_y_error_m", "contact_force_max_n"
#: Fewest points that show a jump: two on each side.
MIN_POINTS = 4
#: A change between two points is a jump if it is this many times both changes next to it. Up a resonance the amplitude
#: grows as much, but over several points; where the symmetry of a motion breaks, the phase difference turns first by
#: 2.4 times what it turns next.
ISOLATION = 4.0
#: Smallest change of the excitation frequency that is a jump, divided by that of the synchronous frequency. Along a
#: smooth branch it is about 1, less where a resonance holds the motors back.
FREQUENCY_JUMP = 2.5
#: The same over another key than the supply, relative to the excitation frequency.
RELATIVE_FREQUENCY_JUMP = 1e-3
#: Smallest change of the phase difference that is a jump (rad).
PHASE_JUMP = np.pi / 4.0
#: Smallest change of the amplitude that is a jump, relative to the largest amplitude of the branch.
AMPLITUDE_JUMP = 0.15

#: Columns of the table, after the grid keys, direction and branch; the last ones describe both ends of the band.
ENDS: Columns = {
    f"{end}_{column}": Column(f"{meaning} at the {place} point", "along the branch")
    for column, meaning in ((SUPPLY, "supply frequency"), (EXCITATION, "excitation frequency"), (RMS, "RMS of y"))
    for end, place in (("from", "first"), ("to", "last"))
}
BANDS: Columns = {
    "kind": Column(
        "kind of band",
        "band: points of one synchronization; jump: synchronization, phase difference, excitation frequency or "
        "amplitude changes by more than 4 times the changes on either side. A jump needs two points on each side, "
        "but one where frequency and synchronization change; a finer sweep may turn it into a steep change. liftoff "
        "and flight-end: from the last point before to the first point after, both with material that can lift off; "
        "largest: maximum RMS of y; failed: points that failed",
        kind=TEXT,
    ),
    "name": Column(
        "synchronization", "for a jump, before and after it; for failed points, their outcome instead", kind=TEXT
    ),
    "points": Column("number of points", kind=COUNT),
    **ENDS,
}


def find_jumps(rows: pd.DataFrame | Rows) -> Flags:
    """Return where the motion jumps along a branch: whether it does between each point and the next.

    Parameters
    ----------
    rows
        The points of one branch of a sweep table, in their order. The first column is the key that was swept.

    Returns
    -------
    array
        One value less than there are points. All values between the two points of a jump are true.
    """
    jumps = np.zeros(max(len(rows["sync"]) - 1, 0), dtype=bool)
    for before, after in _jump_rows(rows):
        jumps[before:after] = True
    return jumps


def _jump_rows(rows: pd.DataFrame | Rows) -> list[tuple[int, int]]:
    """Return the numbers of the last point before each jump of a branch and of the first point after it.

    A jump is a discontinuity of the response. Its evidence is a change that is ISOLATION times both changes next to it:
    of synchronization that is lost or found, of the phase difference, of the excitation frequency or of the amplitude.
    So it takes two points on each side; at an end of the branch one, where exciters that a resonance held get free, or
    are captured, and synchronize otherwise. Points that failed are passed over, and points that jumped while they were
    measured: the standard error of their amplitude is as large as a jump.
    """
    key, along = (SUPPLY, rows[SUPPLY]) if SUPPLY in rows else next(iter(rows.items()))
    frequency, x, y, phase = (
        np.asarray(rows[column], dtype=float) for column in (EXCITATION, "rms_x_m", RMS, "phase_difference_rad")
    )
    places, height = np.asarray(along, dtype=float), np.hypot(x, y)
    rise = AMPLITUDE_JUMP * np.nanmax(height, initial=0.0)
    steady = np.isfinite(frequency)
    if ERROR in rows:
        steady &= ~(np.asarray(rows[ERROR], dtype=float) > rise)
    known = np.flatnonzero(steady)
    if len(known) < MIN_POINTS:
        return []
    sync = np.asarray(rows["sync"], dtype=object)
    synchronized = np.where(pd.isna(sync), np.nan, sync != "none").astype(float)
    turned = wrap(np.diff(np.where(synchronized == 1.0, phase, np.nan)[known]))
    steps, shift = np.abs(np.diff(places[known])), RELATIVE_FREQUENCY_JUMP * frequency[known][1:]
    if key == SUPPLY:
        shift = FREQUENCY_JUMP * steps * np.median(frequency[known] / places[known])
    changes = (
        (np.diff(synchronized[known]), 0.0),
        (turned, PHASE_JUMP),
        (np.diff(frequency[known]), shift),
        (np.diff(height[known]), rise),
    )
    jump = np.any([(np.abs(change) > least) & _isolated(np.abs(change), steps) for change, least in changes], axis=0)
    freed = (np.abs(changes[2][0]) > shift) & (sync[known][1:] != sync[known][:-1])
    jump |= freed & _isolated(np.abs(changes[2][0]), steps, ends=True)
    return [(int(known[i]), int(known[i + 1])) for i in np.flatnonzero(jump)]


def _isolated(change: FloatArray, steps: FloatArray, *, ends: bool = False) -> Flags:
    """Return whether each change along a branch is far larger than both next to it, which are known.

    Where points are farther apart than those next to them, these changes count as if they had gone on. Where they are
    more than ISOLATION times as far apart, nothing is known. A change at an end has one beside it, which
    is enough with ``ends``.
    """
    alone = np.ones(change.size, dtype=bool)
    alone[[0, -1]] = ends
    neighbours, width = np.pad(change, 1), np.pad(steps, 1, mode="edge")
    for side in (slice(None, -2), slice(2, None)):
        with np.errstate(divide="ignore", invalid="ignore"):
            farther = np.maximum(steps / width[side], 1.0)
            alone &= (change > ISOLATION * farther * neighbours[side]) & (farther <= ISOLATION)
    return alone


def bands(table: pd.DataFrame) -> pd.DataFrame:
    """Return the bands of all branches of a sweep table: the grid keys, direction and branch, and :data:`BANDS`.

    Over another key than the supply, which is the first column of the table, the ends are in its columns.
    """
    key, *group = table.columns[: list(table.columns).index("branch") + 1]
    needed = (key, *group, EXCITATION, RMS, "rms_x_m", "phase_difference_rad", "flight_fraction", "outcome", "sync")
    columns = {name: table[name].to_numpy() for name in (*needed, *(name for name in (ERROR, FORCE) if name in table))}
    order = np.argsort(columns["branch"], kind="stable")
    ends = np.flatnonzero(np.diff(columns["branch"][order])) + 1
    records = [
        {key: rows[key][0] for key in group} | band
        for branch in (np.split(order, ends) if len(table) else [])
        for rows in [{name: values[branch] for name, values in columns.items()}]
        for band in _bands_of(rows, key)
    ]
    meanings = {key: Column(text) for key, text in table.attrs.get("meanings", {}).items()}
    meant = {
        name.replace(SUPPLY, key): column._replace(
            meaning=column.meaning.replace(display_name(SUPPLY), indexed_name(key))
        )
        for name, column in BANDS.items()
    }
    return study_table(
        records, [*group, *meant], {**meanings, **BRANCH, **meant}, {key: table[key] for key in group[:-2]}
    )


def _bands_of(rows: Rows, key: str) -> Iterator[dict[str, Any]]:
    """Yield the bands of a branch: synchronization and failures, jumps, flight, the largest amplitude."""
    failed = rows["outcome"] != "ok"
    names = np.where(failed, rows["outcome"], rows["sync"]).astype(str)
    begins = np.flatnonzero(np.append(True, names[1:] != names[:-1])).tolist()
    for first, after in zip(begins, [*begins[1:], len(names)], strict=True):
        yield _band(rows, key, first, after - 1, "failed" if failed[first] else "band", str(names[first]))
    for before, after in _jump_rows(rows):
        change = dict.fromkeys(rows["sync"][[before, after]])
        yield _band(rows, key, before, after, "jump", " → ".join(change))
    good = {name: values[~failed] for name, values in rows.items()}
    flies = good["flight_fraction"] > 0.0
    rests = ~flies
    if FORCE in good:  # without material there is none
        rests = ~flies & np.isfinite(good[FORCE].astype(float))
    begins_flight, ends_flight = rests[:-1] & flies[1:], flies[:-1] & rests[1:]
    for i in np.flatnonzero(begins_flight | ends_flight).tolist():
        yield _band(good, key, i, i + 1, "liftoff" if flies[i + 1] else "flight-end", "")
    if not np.isnan(good[RMS]).all():
        top = int(np.nanargmax(good[RMS]))
        yield _band(good, key, top, top, "largest", str(good["sync"][top]))


def _band(rows: Rows, key: str, first: int, last: int, kind: str, name: str) -> dict[str, Any]:
    at = {f"{end}_{c}": rows[c][i] for c in (key, EXCITATION, RMS) for end, i in (("from", first), ("to", last))}
    return {"kind": kind, "name": name, "points": last - first + 1} | at


# -- for the user -----------------------------------------------------------------------------------------

#: Branches whose bands are printed; the table holds those of all.
MAX_PRINTED = 6
_LABELS = {"band": "", "failed": "", "flight-end": "end of flight", "largest": "largest RMS y"}


def band_lines(table: pd.DataFrame) -> Iterator[str]:
    """Yield the bands of the first branches as text: a line for each branch, and one for each of its bands below it."""
    keys = list(table.columns[: list(table.columns).index("direction")])
    key = next(str(column) for column in table if str(column).startswith("from_")).removeprefix("from_")
    branches = table["branch"].unique()
    for branch in branches[:MAX_PRINTED]:
        rows = table[table["branch"] == branch]
        yield ", ".join([*(value_words(key, rows[key].iloc[0]) for key in keys), str(rows["direction"].iloc[0])])
        yield from in_columns([_cells(row, key) for _, row in rows.iterrows()])
    if len(branches) > MAX_PRINTED:
        yield f"bands of {len(branches) - MAX_PRINTED} more branches are in the table bands"


def _cells(row: pd.Series, key: str) -> list[str]:
    """Return what a band is, where it begins and ends, and the motion there."""
    across = " → " if row["kind"] in ("jump", "liftoff", "flight-end") else " … "
    over, frequency, height = ((row[f"from_{name}"], row[f"to_{name}"]) for name in (key, EXCITATION, RMS))
    name = " ".join(filter(None, (_LABELS.get(row["kind"], row["kind"]), row["name"])))
    cells = [f"  {name}", f"{axis_name(key)} {across.join(dict.fromkeys(map(given, over)))} {unit_of(key)}".rstrip()]
    if not np.isfinite(frequency).all():
        return [*cells, "", ""]
    return [*cells, f"f {together(frequency, 'Hz', across)}", f"RMS y {together(height, 'm', across)}"]
