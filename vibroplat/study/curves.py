"""Branches of a sweep as curves, jumps, and strips of what the exciters do.

The way down is drawn only where it differs from the way up, and a curve that coincides with another one is told.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from vibroplat.columns import PHASE_COLUMN, describe_sync
from vibroplat.config import digits
from vibroplat.frames import pd
from vibroplat.results import picture
from vibroplat.results.labels import key_name
from vibroplat.study.bands import find_jumps
from vibroplat.study.branches import EXCITATION, SUPPLY
from vibroplat.study.sweeps import Sweeps, key_of

#: Most values of a key that have colours of their own; more of them follow a colour scale.
DISTINCT = 5
#: Distance of curves that coincide, and height of a jump that has an arrow, over the range of a panel.
SAME, VISIBLE = 0.015, 0.05
#: Most strips of a picture.
MOST_STRIPS = 12
#: Classes of periods of a bifurcation diagram, their colours and meanings.
PERIODS = {
    "1": ("#cfe3f1", "period 1"),
    "n": ("#f3c14b", "period of several turns"),
    "quasi-periodic": (picture.PURPLE, "quasi-periodic"),
    "chaotic": ("#5c2a4d", "chaotic"),
    "undecided": ("#9a9a9a", "not periodic"),
}
#: Hatches of motions that do not repeat each turn, and what they mean.
APERIODIC, SEVERAL = "/////", "...."
HATCHES = {APERIODIC: "not periodic", SEVERAL: "period of several turns"}
#: Signs of ways.
WAYS = {"up": "↑", "down": "↓"}


class _Branch(NamedTuple):
    """A branch: its rows in the order of the key, how it goes, and where it jumps."""

    rows: pd.DataFrame
    label: str
    direction: str
    colour: str
    width: float
    jumps: Any

    def values(self, column: str) -> pd.Series:
        """Return a column over the key."""
        over = self.rows[key_of(self.rows)].to_numpy(dtype=float)
        return pd.Series(self.rows[column].to_numpy(dtype=float, na_value=np.nan), over)


def branch_series(rows: pd.DataFrame, label: str = "", colour: str = picture.BLUE, size: float = 1.0) -> picture.Series:
    """Return the points of a branch as a line that is broken where the motion jumps, dashed on the way down."""
    direction = str(rows["direction"].iloc[0])
    places = np.insert(rows.index.to_numpy(), np.flatnonzero(find_jumps(rows)) + 1, picture.BROKEN)
    look: dict[str, Any] = {"dash": "--" if direction == "down" else "-", "width": size}
    return picture.Series(label, places, f"{key_name(key_of(rows))} {direction}", colour, "lines", **look)


def marked_series(rows: pd.DataFrame, colour: str, marked: Any, size: float = 1.0) -> Iterator[picture.Series]:
    """Yield points that are marked on a line, if there are any."""
    if marked.any():
        yield picture.Series("", rows.index[marked].to_numpy(), "", colour, "markers", size=0.7 * size)


def curves_of(
    sweeps: Sweeps, columns: Sequence[str], colours: Mapping[str, str], *, told: bool
) -> tuple[list[picture.Series], list[picture.Jump], dict[str, str]]:
    """Return branches as series in panels of columns, their jumps, and by columns which of them coincide.

    ``colours`` are those of their labels.
    With ``told`` points whose motion does not repeat are marked, as no strips say it.
    """
    table, notes = sweeps.table, dict[str, str]()
    series, jumps = list[picture.Series](), list[picture.Jump]()
    groups: dict[str, list[_Branch]] = {}
    for rows in sweeps.branches:
        label, direction = sweeps.label(rows.iloc[0]), str(rows["direction"].iloc[0])
        width = _size([*colours].index(label), len(colours))
        one = _Branch(rows, label, direction, colours[label], width, find_jumps(rows))
        groups.setdefault(label, []).append(one)
    shown: dict[int, dict[str, Any]] = {}
    for column in columns:
        span = _range_of(table, column)
        kept: dict[str, list[str]] = {}
        for label, group in groups.items():
            same = next(
                (one for one in kept if len(groups) <= DISTINCT and _coincide(groups[one], group, column, span)), ""
            )
            if same:
                kept[same].append(label)
                continue
            kept[label] = [label]
            for number, one in enumerate(group):
                first = group[0] if number and group[0].direction != one.direction else None
                shown.setdefault(id(one), {})[column] = _places(one, first, column, span)
        if several := [labels for labels in kept.values() if len(labels) > 1]:
            notes[column] = "; ".join(map(_equal, several))
    for one in (one for group in groups.values() for one in group):
        of = shown.get(id(one), {})
        series += _series_of(one, of, told)
        jumps += _jumps_of(one, groups[one.label][0], [*of], table)
    if len({one.direction for group in groups.values() for one in group}) > 1:
        series = _with_both_ways(series)
    return series, jumps, notes


def _with_both_ways(series: Sequence[picture.Series]) -> list[picture.Series]:
    """Say that solid lines are both ways where no dashed one is drawn, as the way down coincides with the way up."""
    if any(one.dash == "--" for one in series):
        return [*series]
    return [replace(one, look=f"{one.look} and down") if one.mode == "lines" else one for one in series]


def _series_of(one: _Branch, shown: Mapping[str, Any], told: bool) -> Iterator[picture.Series]:
    """Yield the series of a branch, one for all columns in which the same points are drawn, and where it failed."""
    alike: dict[bytes, list[str]] = {}
    for column, places in ((name, found) for name, found in shown.items() if (found != picture.BROKEN).any()):
        alike.setdefault(places.tobytes(), []).append(column)
    is_down = one.direction == "down"
    look = f"{key_name(key_of(one.rows))} {one.direction}{', where it differs' if is_down else ''}"
    for columns in alike.values():
        dash, places = "--" if is_down else "-", shown[columns[0]]
        yield picture.Series(
            one.label, places, look, one.colour, "lines", dash=dash, width=one.width, of=tuple(columns)
        )
    yield from marked_series(one.rows, one.colour, failed_of(one.rows) | (told & open_of(one.rows)))


def _range_of(table: pd.DataFrame, column: str) -> float:
    """Return the range of a panel; of phase differences half a turn."""
    if column == PHASE_COLUMN:
        return float(np.pi)
    values = table[column].to_numpy(dtype=float, na_value=np.nan)
    return float(np.ptp([0.0, *values[np.isfinite(values)]]))


def _size_of(change: Any, column: str) -> Any:
    """Return how large a change is; of phase differences on their circle."""
    return np.abs(np.angle(np.exp(1j * change)) if column == PHASE_COLUMN else change)


def _apart(one: pd.Series, other: pd.Series, column: str) -> Any:
    """Return how far one curve is from another at its values of the key."""
    beside = other[~other.index.duplicated()].reindex(one.index)
    return _size_of(one.to_numpy() - beside.to_numpy(), column)


def _coincide(first: Sequence[_Branch], others: Sequence[_Branch], column: str, span: float) -> bool:
    """Whether the branches of two combinations are the same in a column, up to the width of a line."""
    if [one.direction for one in first] != [one.direction for one in others]:
        return False
    for one, other in zip(first, others, strict=True):
        a, b = one.values(column), other.values(column)
        known = a.notna().to_numpy()
        if not known.any() or {*a.index[known]} != {*b.dropna().index}:
            return False
        if (_apart(a, b, column)[known] > SAME * span).any():
            return False
    return True


def _equal(labels: Sequence[str]) -> str:
    """Say that curves coincide: "mass ratio 0 = 0.1"."""
    return " = ".join([labels[0], *(_short(label, labels) for label in labels[1:])])


def _places(one: _Branch, first: _Branch | None, column: str, span: float) -> Any:
    """Return where a branch is drawn: where it is more than nothing, and differs from another way, and beside these.

    Lines are broken at jumps.
    """
    values = one.values(column)
    known = drawn = values.notna().to_numpy()
    if column != PHASE_COLUMN and not (values < 0.0).any():
        drawn = drawn & (values > digits.NEGLIGIBLE * span).to_numpy()
    if first is not None:
        drawn = drawn & ~(_apart(values, first.values(column), column) <= SAME * span)
    joined = ~one.jumps
    grown = drawn.copy()  # a line begins where it leaves another one, or nothing
    grown[1:] |= drawn[:-1] & joined
    grown[:-1] |= drawn[1:] & joined
    places = np.where(grown & known, one.rows.index.to_numpy(), picture.BROKEN)
    return np.insert(places, np.flatnonzero(one.jumps) + 1, picture.BROKEN)


def _jumps_of(one: _Branch, first: _Branch, columns: Sequence[str], table: pd.DataFrame) -> Iterator[picture.Jump]:
    """Yield the jumps of a branch in the columns in which they are seen, but those that another way has as well."""
    places, over = one.rows.index.to_numpy(), one.rows[key_of(one.rows)].to_numpy(dtype=float)
    beside = first.rows[key_of(first.rows)].to_numpy(dtype=float)
    known = {frozenset((beside[i], beside[i + 1])) for i in np.flatnonzero(first.jumps)}
    for before, after in np.flatnonzero(np.diff(np.pad(one.jumps.astype(int), 1))).reshape(-1, 2):
        if one is not first and {over[before], over[after]} in known:
            continue
        rise = {column: np.diff(one.values(column).iloc[[before, after]])[0] for column in columns}
        of = [name for name in columns if _size_of(rise[name], name) > VISIBLE * _range_of(table, name) > 0.0]
        if of:
            yield picture.Jump(int(places[before]), int(places[after]), one.colour, tuple(of))


# -- strips ------------------------------------------------------------------------------------------------------------


def sync_classes(rotation: str) -> dict[str, tuple[str, str]]:
    """Return colours of synchronizations and what a machine does in each."""
    found = {name: (colour, describe_sync(name, rotation)) for name, colour in picture.SYNC.items()}
    return found | {"none": (picture.SYNC["none"], picture.NOT_SYNCHRONOUS)}


def hatches_of(rows: pd.DataFrame) -> list[str]:
    """Return the hatch of each point: of a motion that does not repeat, or after several turns."""
    told = {"": "", "1": "", "n": SEVERAL}
    return [told.get(kind, APERIODIC) for kind in period_kinds(rows)]


def strips_of(sweeps: Sweeps, colours: Mapping[str, str], *, flies: bool = False) -> picture.Strips | None:
    """Return how exciters synchronize along each branch; None where there are too many, or all do it alike.

    A way that is like the other one shares its strip. With ``flies`` a line is below where material flies.
    """
    made: dict[Any, tuple[str, picture.Strip]] = {}
    for rows in sweeps.branches:
        first, sync = rows.iloc[0], rows["sync"].where(~failed_of(rows), "").fillna("")
        flight = rows["flight_fraction"].fillna(0.0).gt(0.0).tolist() if flies and "flight_fraction" in rows else ()
        label, way = sweeps.label(first), WAYS.get(str(first["direction"]), "")
        strip = picture.Strip(
            label, colours[label], rows.index.tolist(), sync.astype(str).tolist(), hatches_of(rows), flight, ()
        )
        key = (label, *strip.spans(sweeps.table[sweeps.key]))
        made[key] = (made[key][0] + way, made[key][1]) if key in made else (way, strip)
    found = [strip._replace(label=f"{_short(strip.label, [*colours])} {way}".strip()) for way, strip in made.values()]
    kinds = {(kind, hatch) for strip in found for kind, hatch in zip(strip.kinds, strip.hatches, strict=True) if kind}
    if not flies and (len(found) > MOST_STRIPS or (len(kinds) < 2 and not any(hatch for _, hatch in kinds))):
        return None
    line = "material flies" if any(any(strip.lined) for strip in found) else ""
    hatched = {hatch for strip in found for hatch in strip.hatches}
    hatches = {hatch: told for hatch, told in HATCHES.items() if hatch in hatched}
    present = {kind for strip in found for kind in strip.kinds}
    classes = {name: told for name, told in sync_classes(sweeps.rotation).items() if name in present}
    return picture.Strips(found, classes, hatches, line, common_words([*colours]))


def common_words(labels: Sequence[str]) -> str:
    """Return the words with which all labels begin, but for the last one of each."""
    words = zip(*(label.split(" ")[:-1] for label in labels), strict=False)
    return " ".join(one[0] for one in itertools.takewhile(lambda one: len({*one}) == 1, words))


def _short(label: str, labels: Sequence[str]) -> str:
    """Return a label without the words with which all of them begin."""
    return label.removeprefix(common_words(labels)).strip() if len(labels) > 1 else ""


# -- points ------------------------------------------------------------------------------------------------------------


def failed_of(rows: pd.DataFrame) -> Any:
    """Return whether each point failed."""
    return (rows["outcome"] != "ok" if "outcome" in rows else rows[EXCITATION].isna()).to_numpy(dtype=bool)


def open_of(rows: pd.DataFrame) -> Any:
    """Return whether the motion of each point does not repeat, as far as is known."""
    return ~np.isin(period_kinds(rows), ["", "1", "n"])


def period_kinds(rows: pd.DataFrame) -> list[str]:
    """Return the class of each point in :data:`PERIODS`, "" if it failed."""
    motion = rows["motion"] if "motion" in rows else pd.Series("periodic", rows.index)
    period = rows["period"].to_numpy(dtype=float, na_value=np.nan) if "period" in rows else np.ones(len(rows))
    period = np.where(motion.isin(["periodic"]) & (period != 0.0), period, 0.0)
    open_ = motion.where(motion.isin([*PERIODS]), "undecided").to_numpy(dtype=object)
    kinds = np.where(period == 0.0, open_, np.where(period > 1.0, "n", "1"))
    return [str(kind) for kind in np.where(failed_of(rows), "", kinds)]


def failed_places(rows: pd.DataFrame, x: str) -> Any:
    """Return where points failed; excitation frequencies they do not have follow from those of their neighbours."""
    failed = failed_of(rows)
    key = key_of(rows)
    over = rows[key].to_numpy(dtype=float)
    if x == key or not failed.any():
        return over[failed]
    expected = over if key == SUPPLY else np.ones(len(over))
    ratio = rows[x].to_numpy(dtype=float, na_value=np.nan) / expected
    known = np.flatnonzero(np.isfinite(ratio))
    known = known[np.argsort(over[known])]
    if not len(known):
        return np.full(int(failed.sum()), np.nan)
    return expected[failed] * np.interp(over[failed], over[known], ratio[known])


def placed(rows: pd.DataFrame, x: str) -> pd.Series:
    """Return a column along a branch, with the places of points that failed where it can tell them."""
    failed = failed_of(rows)
    found = rows[x].astype(float)
    found[failed] = failed_places(rows, x)
    return found


def _size(number: int, count: int) -> float:
    """Return the size of a curve, from large to small: where curves lie on each other, the first ones stand out."""
    if count == 1:
        return 1.0
    largest = 1.4 if count <= DISTINCT else 1.1
    return largest - (largest - 0.8) * number / (count - 1)
