"""Pictures of branches of periodic orbits: their measures, their multipliers, and boundaries over two keys."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vibroplat.columns import PHASE_COLUMN
from vibroplat.config import digits
from vibroplat.errors import TableError
from vibroplat.frames import pd
from vibroplat.results import content, picture
from vibroplat.results.labels import (
    ABSCISSAE,
    EXCITATION,
    LIFTOFF,
    SPECIAL_POINTS,
    is_number,
    shortened,
)
from vibroplat.results.result import Result
from vibroplat.study import titles
from vibroplat.study.branches import column_of
from vibroplat.study.picture import boundary_series
from vibroplat.study.sweeps import Sweeps, abscissa

OPTIONS = ("x",)
#: Markers of kinds of special points.
MARKERS = dict(zip(SPECIAL_POINTS, "oDsX^vP", strict=True))
#: What is 0 without flight.
_OF_FLIGHT = ("flight_fraction", "gap_max_m", "impulse_max_n_s")
_STABLE = ("stable", "unstable")


@dataclass(frozen=True)
class Branches(Sweeps):
    """Tables of branches over a key, and with boundaries a second one."""

    special: pd.DataFrame = field(default_factory=pd.DataFrame)
    second: str = ""

    def curve(self, rows: pd.DataFrame) -> str:
        """Return what the curve of a branch is called: by its combination, or by its period where there is one."""
        return self.label(rows.iloc[0]) or f"period {rows.get('period', pd.Series([1])).iloc[0]:g}"

    def special_of(self, row: pd.Series) -> pd.DataFrame:
        """Return the special points of the branch of a row."""
        same = [self.special[key] == row[key] for key in (*self.grid, "branch")]
        return self.special[np.logical_and.reduce(same)]


def pictures(results: Sequence[Result], kinds: Sequence[str] = (), *, x: str | None = None) -> list[picture.Picture]:
    """Return the pictures of branches of orbits of each result.

    ``branches`` shows measures: stable parts solid, unstable ones dashed, special points marked, points of a sweep in
    the same directory behind; ``multipliers`` those on the plane, and the largest one; ``boundaries`` curves of special
    points over two keys. Default: all that there are tables of.

    Raises
    ------
    TableError
        Tables are missing, or lack data that a picture needs.
    """
    made = []
    for result in results:
        branches, has_curves = read(result, None if x is None else ABSCISSAE[x]), "boundaries" in result.tables
        if branches.x not in branches.table:
            raise TableError(f"--x {x}: the branches table in {result.place} has no column {branches.x}")
        if "boundaries" in kinds and not has_curves:
            raise TableError(f"{result.place} holds no boundaries; add orbits.boundaries to its configuration")
        made += [_MAKERS[kind](branches) for kind in kinds or [*_MAKERS][: 3 if has_curves else 2]]
    return made


def read(result: Result, x: str | None = None) -> Branches:
    """Read the tables of branches."""
    plan = result.given("orbits")
    key = column_of(str(plan["key"]))
    second = column_of(str(plan["boundaries"]["key"])) if plan.get("boundaries") else ""
    numbers = (key, EXCITATION, "branch", "rms_x_m", "rms_y_m", PHASE_COLUMN, "motor_power_w", "multiplier_1_re")
    points = content.rows_in(result, "branches", ("sequence",), numbers, ("contact_force_max_n",))
    if "stable" not in points:
        raise TableError(f"the branches table in {result.place} has no column stable")
    special = result.columns("special", ("kind",), (key, EXCITATION, "branch", "point"))
    points, special = (picture.finite(table).reset_index(drop=True) for table in (points, special))
    grid = list(points.columns[: list(points.columns).index(key)])
    return Branches([result], [result.name], points, key, grid, x or abscissa(key), special=special, second=second)


# -- branches ----------------------------------------------------------------------------------------------------------


def branches(data: Branches) -> picture.Picture:
    """Return measures of branches over a column, with special points at their exact places."""
    table, special = data.table, data.special
    everything = pd.concat([table, special], ignore_index=True)
    if "period" in everything:
        seconds = everything["period"] / everything[EXCITATION]
        everything["period_s"] = everything.get("period_s", seconds).fillna(seconds)
    drawn, series, first = _lines(data)
    panels, left = content.measures(table)
    marks = []
    for kind, rows in special.groupby("kind", sort=False):
        name, places = str(kind), (len(table) + rows.index).tolist()
        marks.append(picture.Mark(name, SPECIAL_POINTS.get(name, ""), MARKERS.get(name, "*"), places))
    behind = content.beside(data.results[0], "sweep", "sweep")
    if behind is not None:
        drawn = pd.concat([drawn, behind[[name for name in behind if name in table]]], ignore_index=True)
        series = [*_behind(data, behind.reset_index(drop=True)), *series]
    return picture.Picture(
        name="branches",
        heading="Orbits",
        title=data.results[0].answer.headline,
        table=table,
        table_name="branches",
        special=special,
        special_name="special points",
        drawn=drawn,
        axes=list(dict.fromkeys([data.x, *content.axes_of(table, [data.x, data.key, EXCITATION])])),
        panels=panels,
        series=series,
        marks=marks,
        states=content.states_of(~table["stable"].astype(bool)),
        meanings=_STABLE,
        rotation=data.rotation,
        scale=data.shown_scale,
        caption=data.caption(left),
        meaning="Solid: stable orbits; dashed: unstable ones. White marks: special points of "
        f"branches, at their exact frequency.{data.meaning}",
        orbits=picture.Orbits(everything, [*range(len(table), len(everything)), *first]),
    )


def _lines(data: Branches) -> tuple[pd.DataFrame, list[picture.Series], list[int]]:
    """Return all points with special ones behind them, stable and unstable parts of branches, and rows at their ends.

    Measures of special points are those between the points of their branch. Phase differences are followed beyond their
    range; a liftoff begins the flight.
    """
    table, special, parts = data.table, data.special, dict[tuple[str, bool], list[int]]()
    drawn, ends = pd.concat([table, special], ignore_index=True), list[int]()
    numbers = [name for name in content.DRAWN if name in table]
    drawn[numbers] = drawn[numbers].astype(float)
    for rows in data.branches:
        own = data.special_of(rows.iloc[0])
        fractions = _fractions(rows, own)
        drawn.loc[rows.index, PHASE_COLUMN] = np.unwrap(drawn.loc[rows.index, PHASE_COLUMN])
        along = np.concatenate([np.arange(len(rows)), fractions])
        order = np.argsort(along, kind="stable")
        own_places = np.concatenate([rows.index, len(table) + own.index])[order]
        between = drawn.loc[own_places, numbers].set_axis(along[order]).interpolate("index").set_axis(own_places)
        drawn.loc[len(table) + own.index, numbers] = between.loc[len(table) + own.index]
        ends += [int(rows.index[0]), int(rows.index[-1]), *(rows.index[np.round(fractions).astype(int)])]
        for is_stable, part in _stretches(own_places, len(table), table["stable"].to_numpy(dtype=bool)):
            parts.setdefault((data.curve(rows), is_stable), []).extend([*part, picture.BROKEN])
    drawn.loc[len(table) + special.index[special["kind"] == LIFTOFF], [n for n in _OF_FLIGHT if n in drawn]] = 0.0
    colours, series = data.colours, list[picture.Series]()
    for (name, is_stable), places in parts.items():
        look: dict[str, Any] = {"look": "stable"} if is_stable else {"look": "unstable", "dash": "--"}
        label = name if len(colours) > 1 else ""
        series.append(picture.Series(label, places[:-1], colour=colours[name], mode="lines", size=0.7, **look))
    return drawn, series, ends


def _fractions(rows: pd.DataFrame, special: pd.DataFrame) -> Any:
    """Return where special points lie along a branch: the number of the point before and the fraction of the step."""
    before = np.clip(special["point"].to_numpy(dtype=int), 0, max(len(rows) - 2, 0))
    values = rows[EXCITATION].to_numpy(dtype=float)
    here, there = values[before], values[np.minimum(before + 1, len(rows) - 1)]
    step = np.where(there == here, 1.0, there - here)
    return before + np.clip((special[EXCITATION].to_numpy(dtype=float) - here) / step, 0.0, 1.0)


def _stretches(places: Any, count: int, stable: Any) -> Iterator[tuple[bool, list[int]]]:
    """Yield the parts of a branch of one stability, by places in their order; special points are those from a count on.

    A piece between two places is as stable as the point at its end, if a special point is at the other one; between two
    special points nothing is known, and it counts as unstable.
    """
    whole = places < count
    known = np.where(whole, stable[np.minimum(places, count - 1)], True)
    pieces = (whole[:-1] | whole[1:]) & known[:-1] & known[1:]
    if not len(pieces):
        yield bool(known[0]), places.tolist()
        return
    for first, last in itertools.pairwise([0, *(np.flatnonzero(np.diff(pieces)) + 1), len(pieces)]):
        yield bool(pieces[first]), places[first : last + 1].tolist()


def _behind(data: Branches, table: pd.DataFrame) -> Iterator[picture.Series]:
    """Yield the points of a sweep, which stand behind all others, in the colours of their combinations."""
    varied, begin = data.varied if {*data.varied} <= {*table} else [], len(data.table) + len(data.special)
    for own in content.in_groups(table, [*varied, "direction"]):
        colour = data.colours.get(data.label(own.iloc[0]), picture.BEHIND) if varied else picture.BEHIND
        look, places = f"sweep, {own['direction'].iloc[0]}", begin + own.index.to_numpy()
        yield picture.Series("", places, look, colour, "markers", pale=True, size=0.8)


# -- multipliers -------------------------------------------------------------------------------------------------------


def multipliers(data: Branches) -> picture.Picture:
    """Return the leading multipliers on the plane, and the largest one over a column, a facet for each combination."""
    table = data.table
    names = [str(name)[:-3] for name in table if str(name).startswith("multiplier_") and str(name).endswith("_re")]
    columns = [data.x, "stable", "real", "imaginary", "stability_margin"]
    parts, facets, series = list[pd.DataFrame](), dict[str, list[int]](), list[picture.Series]()
    for rows in data.branches:
        label, begin = data.label(rows.iloc[0]), sum(map(len, parts))
        colour = picture.CURVES[[*facets, label].index(label) % len(picture.CURVES)]
        largest = rows["multiplier_1_re"].astype(float), rows["multiplier_1_im"].astype(float)
        parts.append(rows.assign(stability_margin=1.0 - np.hypot(*largest)).reindex(columns=columns))
        for name, sign in itertools.product(names, (1.0, -1.0)):  # the table may have one of a pair
            real, imaginary = (rows[f"{name}_{part}"].astype(float) for part in ("re", "im"))
            parts.append(rows.assign(real=real, imaginary=sign * imaginary).reindex(columns=columns))
        places = np.arange(begin, sum(map(len, parts)))
        facets.setdefault(label, []).extend((len(series), len(series) + 1))
        dots, line = picture.Series("", places[len(rows) :], mode="dots"), places[: len(rows)]
        series += [dots, picture.Series("", line, "", colour, "lines")]
    melted = pd.concat(parts, ignore_index=True)
    unstable, size = int((~table["stable"].astype(bool)).sum()), 1.0 - melted["stability_margin"].min()
    return picture.Picture(
        name="multipliers",
        heading="Multipliers",
        title=f"{unstable} of {len(table)} orbits unstable; largest |multiplier| {digits.number(size)}",
        table=melted,
        table_name="multipliers",
        axes=[data.x],
        panels=[
            picture.Panel("imaginary", "real", "plane", by=data.x, label="imaginary part"),
            picture.Panel("stability_margin", label="stability margin, 1 − |multiplier|", scale="asinh"),
        ],
        series=series,
        lines=[picture.Line("stability_margin", [0.0], dash="-")],
        facets=[picture.Facet(label, numbers) for label, numbers in facets.items()],
        caption=data.caption(),
        places=("print",),  # the page has them beside each point
    )


# -- boundaries --------------------------------------------------------------------------------------------------------


def boundaries(data: Branches) -> picture.Picture:
    """Return curves of special points over two keys: the second one over the first; a colour for each kind."""
    table = picture.finite(data.results[0].columns("boundaries", ("kind",), ("curve", "n_unstable")))
    if not all(key in table and is_number(table[key]) for key in (data.key, data.second)):
        raise TableError(f"the boundaries table in {data.results[0].place} has no numbers of two keys")
    groups = [*content.in_groups(table, data.varied)] if data.varied else [table]
    over = data.x if data.x in table else data.key
    limits = [f"{kind} at {titles.place(over, rows[over])}" for kind, rows in table.groupby("kind", sort=False)]
    series, facets = list[picture.Series](), list[picture.Facet]()
    for rows in groups:
        own = boundary_series(rows, 0, picture.CURVES)
        facets.append(
            picture.Facet(data.label(rows.iloc[0]) if data.varied else "", range(len(series), len(series) + len(own)))
        )
        series += own
    return picture.Picture(
        name="boundaries",
        heading="Boundaries",
        title=titles.sentence(", ".join(shortened(limits)) or "No boundaries"),
        table=table,
        table_name="boundaries",
        axes=content.axes_of(table, (data.x, data.key)),
        panels=[picture.Panel(data.second)],
        series=series,
        facets=facets if len(facets) > 1 else (),
        caption=data.caption(beside=data.second),
        meaning="Curves of special points over two keys.",
        high=True,
    )


_MAKERS: Mapping[str, Callable[[Branches], picture.Picture]] = {
    "branches": branches,
    "multipliers": multipliers,
    "boundaries": boundaries,
}
