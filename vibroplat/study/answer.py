"""The answer of a sweep in a few lines: what was measured, where motion jumps and lifts off, the largest amplitude."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from operator import itemgetter
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.columns import PHASE_COLUMN, describe_sync, display_name, unit_of
from vibroplat.config.digits import MISSING, given, interval, number, percent, quantity
from vibroplat.results.answer import WIDTH, counted, in_columns
from vibroplat.results.content import in_groups
from vibroplat.results.labels import value_words
from vibroplat.study.bands import FORCE, RMS
from vibroplat.study.branches import axis_name
from vibroplat.study.sweeps import grid_of

#: Most combinations of the grid's values, and kinds of jumps, that have a row and a column.
MAX_ROWS, MAX_JUMPS = 5, 2
#: Kinds of synchronization between which others are left out.
MAIN_SYNCS = {"antiphase", "in-phase"}
#: Relative difference of amplitudes up to which both directions agree, and of steps up to which they are the same.
AGREE, EVEN = 0.01, 1e-6
#: Column of the speed of material along the deck.
CONVEYING_SPEED = "conveying_speed_m_per_s"
#: Columns of points, after the keys and the branch, that the answer is made of.
NEEDED = {
    *("outcome", "sync", "relative_rotation", "motion", "period", "flight_fraction", "motor_power_w"),
    *(RMS, "rms_x_m", FORCE, PHASE_COLUMN, CONVEYING_SPEED),
}


def short_answer(points: pd.DataFrame, bands: pd.DataFrame) -> tuple[str, list[str]]:
    """Return the headline of a sweep and the lines below it, from its tables."""
    key = str(points.columns[0])
    place = [*points.columns[: list(points.columns).index("branch") + 1]]
    points = points[[column for column in points if column in {*place, *NEEDED}]]  # each part copies all columns
    good = points[points["outcome"] == "ok"]
    first = f"{_counts(points)}, {range_text(key, points[key])}, {' and '.join(points['direction'].unique())}"
    if good[RMS].notna().sum() == 0:
        return first, []
    ends: list[dict[Any, Any]] = bands.to_dict("records")
    lines = [*_rows(points, ends, key), *_agreement(points, ends, key), *_legend(good)]
    motions = motions_text(good)
    headline = f"{first}; {motions}"
    return (headline, lines) if len(headline) <= WIDTH else (first, [motions, *lines])


def range_text(key: str, values: pd.Series) -> str:
    """Return the name of a swept key, its range and its step, if that is the same throughout."""
    known, step = np.unique(values.to_numpy(dtype=float)), _step(values)
    unit, ends = unit_of(key), " … ".join(given(end) for end in dict.fromkeys((known[0], known[-1])))
    steps = f" in steps of {given(step)}" if step else f" at {len(known)} values" if len(known) > 1 else ""
    return " ".join(filter(None, (axis_name(key), ends, unit))) + steps


def motions_text(table: pd.DataFrame) -> str:
    """Count the motions that are not periodic, and those that repeat after several turns."""
    several = ("of period " + table["period"].astype("Int64").astype(str)).where(
        table["period"].gt(1).fillna(False), ""
    )
    names = table["motion"].where(table["motion"] != "periodic", several)
    odd = names[names != ""].value_counts()
    texts = [f"{count} {name}" for name, count in odd.head(MAX_ROWS).items()]
    others = ["the others repeat every turn"] if odd.sum() < len(table) else []
    return ", ".join([*texts, *others]) if texts else "all repeat every turn"


def main_rms(points: pd.DataFrame) -> str:
    """Return the column of the direction in which the platform vibrates most."""
    return RMS if "rms_x_m" not in points or points[RMS].max() >= points["rms_x_m"].max() else "rms_x_m"


def _counts(points: pd.DataFrame) -> str:
    """Count the points, and first those that failed."""
    counts, number = points.loc[points["outcome"] != "ok", "outcome"].value_counts(), counted(len(points), "point")
    why = ", ".join(str(outcome) for outcome in counts.index)
    return f"{counts.sum()} of {number} FAILED ({why})" if len(counts) else number


def _combinations(table: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """Yield the rows of each combination of the grid's values, with what tells it from the others."""
    keys = grid_of(table)
    varied = [key for key in keys if len(table[key].unique()) > 1] or keys[:1]
    for rows in in_groups(table, keys) if keys else [table]:
        yield ", ".join(value_words(key, rows[key].iloc[0]) for key in varied), rows


def _rows(points: pd.DataFrame, bands: Sequence[Mapping[Any, Any]], key: str) -> Iterator[str]:
    """Yield a table: for each combination of the grid's values its jumps, liftoff and largest amplitude."""
    groups, values = list(_combinations(points)), points[key]
    branches = [{*rows["branch"]} for _, rows in groups]
    parts = [[band for band in bands if band["branch"] in own] for own in branches]
    jumps = [_changes(own, key) for own in parts]
    kinds = list(dict.fromkeys(name for one in jumps for name in one))
    both_ways = len(points["direction"].unique()) > 1
    height = main_rms(points)
    columns = {f"at {axis_label(key)}": [name for name, _ in groups]}
    for kind in kinds[:MAX_JUMPS]:
        columns[kind] = [_cell(changes.get(kind, {}), values, both_ways=both_ways) for changes in jumps]
    if points["flight_fraction"].gt(0.0).any() or _has_material(points):
        columns["liftoff"] = [_liftoff(rows, own, key) for (_, rows), own in zip(groups, parts, strict=True)]
    columns[f"largest {display_name(height)}"] = [_largest(rows, height, key) for _, rows in groups]
    if CONVEYING_SPEED in points and points[CONVEYING_SPEED].notna().any():
        speed = [rows[CONVEYING_SPEED] for _, rows in groups]
        columns["conveying speed"] = [interval(one.min(), one.max(), "m/s") for one in speed]
    if not kinds:
        power = [rows["motor_power_w"] for _, rows in groups]
        columns["motor power"] = [interval(one.min(), one.max(), "W") for one in power]
    yield from by_columns(columns, "-v, table bands")
    if kinds[MAX_JUMPS:]:
        yield f"and {', '.join(kinds[MAX_JUMPS : 2 * MAX_JUMPS])}, …: -v, table bands"


def axis_label(key: str) -> str:
    """Return what a swept key is called above its values, with its unit."""
    unit = unit_of(key)
    return f"{axis_name(key)} ({unit})" if unit else axis_name(key)


def by_columns(columns: Mapping[str, Sequence[str]], more: str) -> Iterator[str]:
    """Yield a table by its columns: a row for each of the first combinations, and where the others are."""
    yield from in_columns([*zip(*([head, *cells[:MAX_ROWS]] for head, cells in columns.items()), strict=True)])
    left = max(map(len, columns.values())) - MAX_ROWS
    if left > 0:
        yield f"and {counted(left, 'more combination')} of the grid: {more}"


def _changes(bands: Sequence[Mapping[Any, Any]], key: str) -> dict[str, dict[str, list[tuple[float, float]]]]:
    """Return the ends of the changes of a combination, by what changes as the key grows and by direction.

    These are changes of synchronization, whether the amplitude jumps there or not, and further jumps.
    """
    ends_of: dict[str, dict[str, list[tuple[float, float]]]] = {}
    for _, branch in itertools.groupby(bands, itemgetter("branch")):
        rows, ends = list(branch), (f"from_{key}", f"to_{key}")
        way = rows[0]["direction"]
        changes = [(one["name"], one[ends[1]], other["name"], other[ends[0]]) for one, other in _pairs(rows)]
        jumps = [row for row in rows if row["kind"] == "jump" and "→" not in row["name"]]
        changes += [("", row[ends[0]], "", row[ends[1]]) for row in jumps]
        for before, begin, after, end in changes:
            names = (before, after) if begin < end else (after, before)
            name = " → ".join(names) if before else "jump"
            ends_of.setdefault(name, {}).setdefault(way, []).append((min(begin, end), max(begin, end)))
    return ends_of


def _pairs(rows: Iterable[Mapping[Any, Any]]) -> Iterator[tuple[Any, Any]]:
    """Yield the bands on both sides of each change of synchronization; short of those between the two main ones."""
    bands = [row for row in rows if row["kind"] == "band"]
    names = [band["name"] for band in bands]
    between = [{*names[i - 1 : i + 2 : 2]} == MAIN_SYNCS for i in range(1, len(names) - 1)]
    chosen = [band for band, skipped in zip(bands, [False, *between, False][: len(bands)], strict=True) if not skipped]
    yield from itertools.pairwise(chosen)


def _cell(changes: Mapping[str, list[tuple[float, float]]], values: pd.Series, *, both_ways: bool) -> str:
    """Write where a change is in each direction; once where they agree, or where there is one."""
    texts = {way: ", ".join(_place(*ends, values) for ends in changes[way]) for way in changes}
    if len(set(texts.values())) == 1 and (len(texts) > 1 or not both_ways):
        return next(iter(texts.values()))
    return ", ".join(f"{text} {way}" for way, text in texts.items()) or MISSING


def _place(low: float, high: float, values: pd.Series) -> str:
    """Write where a change is: in the middle of two values next to each other, else between which ones.

    The middle has a digit more than half their distance, which stands beside it where that is not the same throughout.
    """
    if ((values > low) & (values < high)).any():
        return f"{given(low)} … {given(high)}"
    middle = number(0.5 * (low + high), 12, error=0.05 * (high - low))
    return middle if _step(values) else f"{middle} ± {number(0.5 * (high - low), 2)}"


def _has_material(points: pd.DataFrame) -> bool:
    return FORCE in points and bool(points[FORCE].notna().any())


def _liftoff(rows: pd.DataFrame, bands: Sequence[Mapping[Any, Any]], key: str) -> str:
    """Write where material first lifts off as the key grows; whether it always or never does."""
    if not _has_material(rows):
        return "no material"
    changes = [
        (band["kind"] == "liftoff", float(band[f"from_{key}"]), float(band[f"to_{key}"]))
        for band in bands
        if band["kind"] in ("liftoff", "flight-end")
    ]
    if not changes:
        return "everywhere" if rows["flight_fraction"].gt(0.0).any() else "never"
    starts = sorted((min(begin, end), max(begin, end)) for lifts, begin, end in changes if lifts == (begin < end))
    return _place(*starts[0], rows[key]) if starts else "from the start"


def _largest(rows: pd.DataFrame, column: str, key: str) -> str:
    if rows[column].notna().sum() == 0:
        return MISSING
    top = int(rows[column].argmax())
    place, height, way = (rows[name].iloc[top] for name in (key, column, "direction"))
    both = f" {way}" if len(rows["direction"].unique()) > 1 else ""
    return f"{quantity(height, unit_of(column))} at {given(float(place))}{both}"


def _step(values: pd.Series) -> float:
    """Return the distance of successive values of a swept key; 0 if that is not the same throughout."""
    steps = np.diff(np.unique(values.to_numpy(dtype=float)))
    return float(steps[0]) if steps.size and np.ptp(steps) <= EVEN * steps.max() else 0.0


def _agreement(points: pd.DataFrame, bands: Sequence[Mapping[Any, Any]], key: str) -> Iterator[str]:
    """Yield how far jumps are known, and whether both directions agree."""
    good = points[points["outcome"] == "ok"]
    step, unit, both_ways = _step(points[key]), unit_of(key), len(good["direction"].unique()) > 1
    if _changes(bands, key):
        known = [f"each change ± {given(0.5 * step)} {unit}".rstrip()] if step else []
        known += ["where up and down differ, the start decides"] if both_ways else []
        yield from ["; ".join(known)] if known else []
        return
    if not both_ways:
        yield "no jump"
        return
    size = np.hypot(good["rms_x_m"], good[RMS])
    both = good.assign(size=size).pivot_table(index=[key, *grid_of(good)], columns="direction", values="size").dropna()
    if both.empty:
        return
    apart = (both.iloc[:, 0] - both.iloc[:, 1]).abs() / both.max(axis=1)
    if apart.max() <= AGREE:
        yield "no jump; up and down agree within 1 %"
    else:
        value = apart.index.get_level_values(key)[int(apart.argmax())]
        where = f"at {axis_name(key)} {given(value)} {unit_of(key)}".rstrip()
        yield f"no jump; up and down differ by up to {percent(apart.max())}, {where}"


def sync_counts(table: pd.DataFrame) -> Iterable[tuple[str, str, int]]:
    """Yield the kinds of synchronization: rotation of the exciters, name and number of points."""
    pairs = zip(table["relative_rotation"].tolist(), table["sync"].tolist(), strict=True)
    counts = Counter(pair for pair in pairs if all(isinstance(one, str) for one in pair))
    for (rotation, sync), count in sorted(counts.items(), key=lambda entry: (-entry[1], entry[0])):
        yield rotation, sync, count


def _legend(good: pd.DataFrame) -> Iterator[str]:
    """Yield what the machine does in each kind of synchronization."""
    known = [*sync_counts(good)]
    if [sync for _, sync, _ in known] == ["intermediate"]:
        phases = np.degrees(good[PHASE_COLUMN].astype(float))  # none is near 0 or 180, so that each side is an interval
        sides = [side for side in (phases[phases < 0.0], phases[phases >= 0.0]) if len(side)]
        ranges = " and ".join(interval(side.min(), side.max(), "°") for side in sides)
        yield f"always intermediate: phase difference {ranges}"
        return
    named = [describe_sync(sync, rotation) for rotation, sync, _ in known if sync != "intermediate"]
    if named:
        yield f"{'always ' if len(named) == 1 else ''}{'; '.join(named)}"
