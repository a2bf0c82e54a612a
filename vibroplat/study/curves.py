"""Branches of a sweep as curves, jumps, and strips of what the exciters do."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from vibroplat.columns import PHASE_COLUMN, describe_sync
from vibroplat.config.circular import beyond
from vibroplat.frames import pd
from vibroplat.results import picture
from vibroplat.results.labels import key_name
from vibroplat.study.bands import find_jumps
from vibroplat.study.branches import EXCITATION, SUPPLY
from vibroplat.study.sweeps import MAX_COLOURS, Sweeps, key_of

#: Height of a jump that has an arrow, relative to the range of its panel.
MIN_ARROW_HEIGHT = 0.05
#: Most strips of a picture.
MAX_STRIPS = 12
#: Classes of periods of a bifurcation diagram, their colours and meanings.
PERIODS = {
    "1": ("#cfe3f1", "period 1"),
    "n": ("#f3c14b", "period of several turns"),
    "quasi-periodic": (picture.PURPLE, "quasi-periodic"),
    "chaotic": ("#5c2a4d", "chaotic"),
    "undecided": ("#9a9a9a", "non-periodic or undecided"),
}
#: Hatches of motions that do not repeat each turn, and what they mean.
APERIODIC, SEVERAL = "/////", "...."
HATCHES = {APERIODIC: "non-periodic", SEVERAL: "period of several turns"}
#: Signs of ways.
WAYS = {"up": "↑", "down": "↓"}


class _Branch(NamedTuple):
    """A branch: its rows in the order of the key, its direction and colour, the width of its line, and its jumps."""

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


def curves_of(
    sweeps: Sweeps, columns: Sequence[str], colours: Mapping[str, str], *, mark_aperiodic: bool
) -> tuple[list[picture.Series], list[picture.Jump]]:
    """Return branches as series in panels of columns, and their jumps.

    ``colours`` are those of their labels. Ways
    down lie below ways up, and so are seen where they differ. With ``mark_aperiodic`` points whose motion does not
    repeat are marked, as no strips say it.
    """
    groups: dict[str, list[_Branch]] = {}
    for rows in sweeps.branches:
        label, direction = sweeps.label(rows.iloc[0]), str(rows["direction"].iloc[0])
        width = _size([*colours].index(label), len(colours))
        one = _Branch(rows, label, direction, colours[label], width, find_jumps(rows))
        groups.setdefault(label, []).append(one)
    branches = sorted((one for group in groups.values() for one in group), key=lambda one: one.direction != "down")
    series = [made for one in branches for made in _series_of(one, columns, mark_aperiodic=mark_aperiodic)]
    jumps = [jump for one in branches for jump in _jumps_of(one, groups[one.label][0], columns, sweeps.table)]
    return series, jumps


def _series_of(one: _Branch, columns: Sequence[str], *, mark_aperiodic: bool) -> Iterator[picture.Series]:
    """Yield the line of a branch, broken where the motion jumps, and the points that are marked on it."""
    places = np.insert(one.rows.index.to_numpy(), np.flatnonzero(one.jumps) + 1, picture.BROKEN)
    look: dict[str, Any] = {"dash": "--" if one.direction == "down" else "-", "width": one.width}
    way = f"{key_name(key_of(one.rows))} {one.direction}"
    yield picture.Series(one.label, places, way, one.colour, "lines", of=tuple(columns), **look)
    marked = failed_of(one.rows) | (mark_aperiodic & open_of(one.rows))
    if marked.any():
        yield picture.Series("", one.rows.index[marked].to_numpy(), "", one.colour, "markers", size=0.7)


def _range_of(table: pd.DataFrame, column: str) -> float:
    """Return the range of a panel; of phase differences half a turn."""
    if column == PHASE_COLUMN:
        return float(np.pi)
    values = table[column].to_numpy(dtype=float, na_value=np.nan)
    return float(np.ptp([0.0, *values[np.isfinite(values)]]))


def _jumps_of(one: _Branch, first: _Branch, columns: Sequence[str], table: pd.DataFrame) -> Iterator[picture.Jump]:
    """Yield the jumps of a branch in the columns in which they are seen, but those that another way has as well."""
    places, over = one.rows.index.to_numpy(), one.rows[key_of(one.rows)].to_numpy(dtype=float)
    values = first.rows[key_of(first.rows)].to_numpy(dtype=float)
    known = {frozenset((values[i], values[i + 1])) for i in np.flatnonzero(first.jumps)}
    for before, after in np.flatnonzero(np.diff(np.pad(one.jumps.astype(int), 1))).reshape(-1, 2):
        if one is not first and {over[before], over[after]} in known:
            continue
        ends = {column: one.values(column).iloc[[before, after]] for column in columns}
        rise = {column: beyond(column, after, before) for column, (before, after) in ends.items()}
        of = [name for name in columns if abs(rise[name]) > MIN_ARROW_HEIGHT * _range_of(table, name) > 0.0]
        if of:
            yield picture.Jump(int(places[before]), int(places[after]), one.colour, tuple(of))


# -- strips ------------------------------------------------------------------------------------------------------------


def sync_classes(rotation: str) -> dict[str, tuple[str, str]]:
    """Return colours of synchronizations and what a machine does in each."""
    return {name: (colour, describe_sync(name, rotation)) for name, colour in picture.SYNC.items()}


def hatches_of(rows: pd.DataFrame) -> list[str]:
    """Return the hatch of each point: of a motion that does not repeat, or after several turns."""
    hatches = {"": "", "1": "", "n": SEVERAL}
    return [hatches.get(kind, APERIODIC) for kind in period_kinds(rows)]


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
    strips = [strip._replace(label=f"{_short(strip.label, [*colours])} {way}".strip()) for way, strip in made.values()]
    kinds = {(kind, hatch) for strip in strips for kind, hatch in zip(strip.kinds, strip.hatches, strict=True) if kind}
    if not flies and (len(strips) > MAX_STRIPS or (len(kinds) < 2 and not any(hatch for _, hatch in kinds))):
        return None
    line = "material flies" if any(any(strip.lined) for strip in strips) else ""
    hatched = {hatch for strip in strips for hatch in strip.hatches}
    hatches = {hatch: text for hatch, text in HATCHES.items() if hatch in hatched}
    present = {kind for strip in strips for kind in strip.kinds}
    classes = {name: text for name, text in sync_classes(sweeps.rotation).items() if name in present}
    return picture.Strips(strips, classes, hatches, line, common_words([*colours]))


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


def fill_failed(rows: pd.DataFrame, x: str) -> pd.Series:
    """Return a column along a branch; excitation frequencies of points that failed follow from their neighbours."""
    values, failed, key = rows[x].astype(float), failed_of(rows), key_of(rows)
    over = rows[key].to_numpy(dtype=float)
    expected = over if key == SUPPLY else np.ones(len(over))
    known = np.argsort(over)[np.isfinite(values.to_numpy())[np.argsort(over)]]
    if x != key and failed.any() and len(known):
        ratios = np.interp(over, over[known], values.to_numpy()[known] / expected[known])
        values = values.where(~failed, expected * ratios)
    return values


def _size(number: int, count: int) -> float:
    """Return the size of a curve, from large to small: where curves lie on each other, the first ones stand out."""
    if count == 1:
        return 1.0
    largest = 1.4 if count <= MAX_COLOURS else 1.1
    return largest - (largest - 0.8) * number / (count - 1)
