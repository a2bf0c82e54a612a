"""Pictures of a sweep, or of several laid over each other: response, bifurcation diagram and map of regimes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from vibroplat.config.digits import percent
from vibroplat.config.plans import FREQUENCY
from vibroplat.errors import TableError
from vibroplat.frames import pd
from vibroplat.hybrid.state import static_rest
from vibroplat.inspection.material import ERROR, range_of_row
from vibroplat.results import content, picture
from vibroplat.results.labels import ABSCISSAE, SPECIAL_POINTS, axis_label, key_name
from vibroplat.results.result import Result
from vibroplat.study import titles
from vibroplat.study.branches import EXCITATION, SUPPLY
from vibroplat.study.curves import (
    HATCHES,
    PERIODS,
    curves_of,
    fill_failed,
    hatches_of,
    period_kinds,
    strips_of,
    sync_classes,
)
from vibroplat.study.sweeps import MAX_COLOURS, Sweeps, read

OPTIONS = ("x", "data", "measure")
#: Colours of the directions of a bifurcation diagram.
_COLOURS = {"up": picture.BLUE, "down": picture.VERMILION}
#: Fewest values of the second key that make a map of tiles; fewer are bars.
MIN_ROWS = 5
#: Fractions of flight at which a map has lines.
_FLIGHTS = {1e-6: ("-", "material flies"), 0.5: ("--", "half of the time"), 0.9: (":", "90 % of the time")}
#: Lines of boundaries that have one colour, by the kinds of special points; what thin ones are.
_DASHES: Sequence[Any] = ("-", "--", "-.", ":", (0, (7, 2)), (0, (1, 2, 1, 2, 5, 2)), (0, (9, 1, 2, 1)))
UNSTABLE_LOOK = "thin: of unstable orbits"
#: Column with the speed that formulas of practice give, and what their band is called.
SPEED_COLUMN, PRACTICE = "conveying_speed_m_per_s", f"formulas of practice (simulations: up to {percent(ERROR)} off)"


def pictures(
    results: Sequence[Result],
    kinds: Sequence[str] = (),
    *,
    x: str | None = None,
    measure: Sequence[str] = (),
    kept: Sequence[str] = (),
) -> list[picture.Picture]:
    """Return the pictures of a sweep, or of several laid over each other.

    ``response`` shows measures over the key, ``bifurcation`` points of the Poincaré section and impact speeds, ``map``
    synchronization, period and flight over the key and one of the grid, with boundaries of orbits over both in the same
    directory. Default: response, and the kind of a single sweep. Columns that are ``kept``, as they were measured, have
    a panel whatever they say.

    Raises
    ------
    TableError
        Tables are missing, or lack data that a picture needs.
    """
    if not kinds:
        own = [str(results[0].given("sweep", "kind"))] if len(results) == 1 else []
        kinds = list(dict.fromkeys(["response", *own]))
    if measure and not {"response", "map"} & {*kinds}:
        raise TableError(f"--measure {', '.join(measure)}: {kinds[0]} does not show it; allowed: response, map")
    if len(results) > 1 and {*kinds} != {"response"}:
        other = next(kind for kind in kinds if kind != "response")
        raise TableError(f"--kind {other} shows one sweep; allowed with {len(results)} of them: response")
    sweeps = read(results, x=None if x is None else ABSCISSAE[x], columns=measure, kept=kept)
    return [_MAKERS[kind](sweeps, measure) for kind in kinds]


# -- response ----------------------------------------------------------------------------------------------------------


def response(sweeps: Sweeps, columns: Sequence[str] = ()) -> picture.Picture:
    """Return all measures of a sweep that say something, or these, along its branches.

    Where all points failed none has an excitation frequency, and the values of the key show where they are.
    """
    table = sweeps.table
    drawn = table.astype({sweeps.x: float})
    for rows in sweeps.branches:
        drawn.loc[rows.index, sweeps.x] = fill_failed(rows, sweeps.x)
    colours, scale = sweeps.colours, sweeps.shown_scale
    strips = strips_of(sweeps, colours)
    panels, left = content.measures(
        table, asked=columns, kept=sweeps.kept, stripped=strips is not None or table["sync"].nunique() == 1
    )
    series, jumps = curves_of(sweeps, [panel.column for panel in panels], colours, mark_aperiodic=strips is None)
    practice, drawn = _practice(sweeps, drawn, colours)
    formula = " Bands: conveying speed by formulas of practice, from the path of the platform." if practice else ""
    known = sweeps.x if drawn[sweeps.x].notna().any() else sweeps.key
    return picture.Picture(
        name="response",
        heading="Sweep",
        title=titles.response(sweeps, columns),
        table=table,
        table_name="sweep",
        drawn=drawn,
        axes=list(dict.fromkeys([known, *content.axes_of(table, (sweeps.x, EXCITATION, sweeps.key, *sweeps.grid))])),
        panels=panels,
        series=[*practice, *series],
        jumps=jumps,
        strips=strips,
        states=content.motions_of(table),
        rotation=sweeps.rotation,
        scale=scale,
        caption=sweeps.caption(left),
        meaning=f"Solid: up; dashed: down, seen where it differs; arrows: jumps; ×: failed.{formula}{sweeps.meaning}",
        orbits=picture.Orbits(table),
    )


def _practice(
    sweeps: Sweeps, drawn: pd.DataFrame, colours: Mapping[str, str]
) -> tuple[list[picture.Series], pd.DataFrame]:
    """Return the band of each combination, along its first branch, and the points with those of the bands behind.

    Its points are those of the branch with the upper ends of the ranges, and the lower ones in a column of their own.
    """
    series, parts, first = list[picture.Series](), [drawn], dict[str, pd.DataFrame]()
    for rows in sweeps.branches if SPEED_COLUMN in drawn and len(colours) <= MAX_COLOURS else ():
        first.setdefault(sweeps.label(rows.iloc[0]), rows)
    for label, rows in first.items():
        low, high = np.array([_practical_range(sweeps, rows.loc[[index]]) for index in rows.index]).T
        if np.isfinite(low).any():
            places = sum(map(len, parts)) + np.arange(len(rows))
            name = ": ".join(filter(None, (label, PRACTICE)))
            broken = np.where(np.isfinite(low), places, picture.BROKEN)
            series.append(picture.Series(name, broken, "", colours[label], "band", of=(SPEED_COLUMN,)))
            parts.append(drawn.loc[rows.index].assign(**{SPEED_COLUMN: high, f"{SPEED_COLUMN}{picture.LOW}": low}))
    return series, pd.concat(parts, ignore_index=True) if series else drawn


def _practical_range(sweeps: Sweeps, row: pd.DataFrame) -> tuple[float, float]:
    """Return the range of a row, from its scene; NaN of several results."""
    scene = sweeps.scene_of(row, sweeps.grid)
    if scene is None or scene.transport is None:
        return np.nan, np.nan
    key = FREQUENCY if sweeps.key == SUPPLY else sweeps.key
    return range_of_row(scene.replace({key: row[sweeps.key].tolist()[0]}), row.iloc[0])


# -- bifurcation diagram -----------------------------------------------------------------------------------------------


def bifurcation(sweeps: Sweeps, _: Sequence[str] = ()) -> picture.Picture:
    """Return the Poincaré section and impact speeds, a facet for each combination of the grid's values.

    The way down lies below the way up. Strips say after how many turns the motion repeats.
    """
    (result,), x = sweeps.results, sweeps.x
    section, impacts = (
        result.columns(name, ("direction",), (x, sweeps.key, "branch", column))
        for name, column in (("section", "y_m"), ("impacts", "impact_speed_m_per_s"))
    )
    rest = _rests(sweeps, section)
    table = pd.concat([section.assign(y_m=section["y_m"] - rest), impacts], ignore_index=True)
    name = "y from rest" if sweeps.results[0].known_scene else "y"
    panels = [picture.Panel("y_m", label=f"${name[0]}${name[1:]} at whole\nturns of exciter 1")]
    panels += [picture.Panel("impact_speed_m_per_s", least=0.0)] if len(impacts) else []
    labels = list(dict.fromkeys(sweeps.label(rows.iloc[0]) for rows in sweeps.branches))
    series, facets = list[picture.Series](), list[picture.Facet]()
    for label in labels:
        numbers = [n for n, rows in enumerate(sweeps.branches) if sweeps.label(rows.iloc[0]) == label]
        made = [*_dots(sweeps, table, [sweeps.branches[n] for n in numbers])]
        facets.append(picture.Facet(label, range(len(series), len(series) + len(made)), strips=numbers))
        series += made
    drawn, strips = _with_periods(sweeps, table)
    return picture.Picture(
        name="bifurcation",
        heading="Bifurcation diagram",
        title=titles.motions(sweeps.table),
        table=table,
        table_name="section and impacts",
        drawn=drawn,
        axes=content.axes_of(table, (x, sweeps.key)),
        panels=panels,
        series=series,
        facets=facets if len(facets) > 1 else (),
        strips=strips,
        caption=sweeps.caption(),
        meaning="Each dot is a point of the Poincaré section, or an impact; the way down lies below the way up.",
        high=True,
    )


def _dots(sweeps: Sweeps, table: pd.DataFrame, own: Sequence[pd.DataFrame]) -> Iterator[picture.Series]:
    """Yield the points of branches of one combination: small where the motion does not repeat."""
    for rows in sorted(own, key=lambda rows: rows["direction"].iloc[0] != "down"):
        direction = str(rows["direction"].iloc[0])
        mine = (table["branch"] == rows["branch"].iloc[0]).to_numpy(dtype=bool)
        steady = table[sweeps.key].isin(rows[sweeps.key][rows["period"].gt(0)]).to_numpy(dtype=bool)
        for chosen, size in ((mine & steady, 1.5), (mine & ~steady, 1.0)):
            label = f"{key_name(sweeps.key)} {direction}" if chosen.any() else ""
            look: dict[str, Any] = {"size": size, "pale": size == 1.0}
            yield picture.Series(
                label, content.rows_of(chosen), "", _COLOURS.get(direction, picture.BLUE), "dots", **look
            )


def _with_periods(sweeps: Sweeps, table: pd.DataFrame) -> tuple[pd.DataFrame, picture.Strips | None]:
    """Return the drawn points with those of the sweep behind them, and strips of the periods along each branch."""
    begin, whole = len(table), sweeps.table.reset_index(drop=True)
    strips = []
    for rows in sweeps.branches:
        kinds, period = period_kinds(rows), rows["period"].to_numpy(dtype=float, na_value=np.nan)
        texts = [f"{period[n]:g}" if kind == "n" else "" for n, kind in enumerate(kinds)]
        name = str(rows["direction"].iloc[0])
        colour = _COLOURS.get(name, picture.BLUE)
        strips.append(picture.Strip(name, colour, (begin + rows.index).tolist(), kinds, (), (), texts))
    drawn = pd.concat(
        [table, whole[list(dict.fromkeys(name for name in (sweeps.x, sweeps.key) if name in whole))]], ignore_index=True
    )
    present = {kind for strip in strips for kind in strip.kinds}
    classes = {name: texts for name, texts in PERIODS.items() if name in present}
    return drawn, picture.Strips(strips, classes) if len(present) > 1 else None


def _rests(sweeps: Sweeps, section: pd.DataFrame) -> list[float]:
    """Return y at the static rest of the scene of each point (m); 0 where that is not known."""
    scenes = {rows["branch"].iloc[0]: sweeps.scene_of(rows, sweeps.grid) for rows in sweeps.branches}
    rests = {}
    for (branch, value), _ in section.groupby(["branch", sweeps.key]):
        if (scene := scenes[branch]) is not None:
            placed = scene if sweeps.key == SUPPLY else scene.replace({sweeps.key: value})
            rests[branch, value] = float(static_rest(placed)[1])
    return [rests.get(point, 0.0) for point in zip(section["branch"], section[sweeps.key], strict=True)]


# -- map of regimes ----------------------------------------------------------------------------------------------------


def regimes(sweeps: Sweeps, columns: Sequence[str] = ()) -> picture.Picture:
    """Return a map of what happens over the key and one of the grid, or maps of measures.

    Few values of the second key are bars, one for each branch; of more there is a map for each way, in which colours
    say how exciters synchronize, hatches where the motion does not repeat each turn, and lines where material flies.
    """
    key, table, (result,) = sweeps.scale, sweeps.table, sweeps.results
    if not key:
        raise TableError(f"{result.place} varies {sweeps.varied}; a map needs one grid key with several numbers")
    curves = content.beside(result, "orbits", "boundaries")
    if curves is None or not {sweeps.key, key} <= {*curves.columns}:
        curves = pd.DataFrame()
    few = table[key].nunique() < MIN_ROWS and not columns and curves.empty
    drawn = pd.concat([table.assign(hatch=hatches_of(table)), curves], ignore_index=True)
    directions = list(dict.fromkeys(table["direction"]))
    series = [picture.Series("", content.rows_of(table["direction"] == name), mode="dots") for name in directions]
    lines = boundary_series(curves, len(table), [picture.BLACK]) if len(curves) else []
    behind = [len(series) + number for number in range(len(lines))]
    facets = [picture.Facet(str(name), [number, *behind]) for number, name in enumerate(directions)]
    labels = dict.fromkeys((sweeps.label(rows.iloc[0]) for rows in sweeps.branches), picture.BLACK)
    panels = [picture.Panel(key, kind="tiles", by=column, title=axis_label(column, "")) for column in columns]
    return picture.Picture(
        name="map",
        heading="Map",
        title=titles.motions(sweeps.table),
        table=table,
        table_name="sweep",
        special=curves if len(curves) else None,
        special_name="boundaries",
        drawn=drawn,
        axes=[sweeps.key],
        panels=panels or ([] if few else [_regimes_panel(sweeps, key)]),
        series=[] if few else [*series, *lines],
        facets=facets if len(facets) > 1 and not few else (),
        strips=strips_of(sweeps, labels, flies=True) if few else None,
        rotation=sweeps.rotation,
        states=content.motions_of(table),
        caption=sweeps.caption(),
        meaning="Each tile is a point of the sweep; white: failed.",
        orbits=picture.Orbits(table) if not len(curves) else None,
        high=True,
    )


def _regimes_panel(sweeps: Sweeps, key: str) -> picture.Panel:
    """Return the panel in which colours, hatches and lines tell the regime."""
    present, hatches = {*sweeps.table["sync"].dropna()}, {*hatches_of(sweeps.table)}
    classes = {name: text for name, text in sync_classes(sweeps.rotation).items() if name in present}
    flight = sweeps.table["flight_fraction"] if "flight_fraction" in sweeps.table else pd.Series(dtype=float)
    levels = {level: text for level, text in _FLIGHTS.items() if flight.min() <= level < flight.max()}
    contours = picture.Contours("flight_fraction", levels) if levels else None
    meanings = {hatch: text for hatch, text in HATCHES.items() if hatch in hatches}
    return picture.Panel(
        key, kind="tiles", by="sync", classes=classes, hatch="hatch", hatches=meanings, contours=contours
    )


def boundary_series(curves: pd.DataFrame, begin: int, colours: Sequence[str]) -> list[picture.Series]:
    """Return boundaries of orbits by kind, from a place on; those of orbits that no motion comes to are thin."""
    reached = (curves.groupby("curve")["n_unstable"].transform("min") == 0).astype(bool)
    kinds, series = list(SPECIAL_POINTS), []
    for (kind, is_reached), rows in curves.groupby(["kind", reached], sort=False):
        number = kinds.index(str(kind)) if kind in kinds else len(kinds)
        places = [
            index for own in content.in_groups(rows, ["curve"]) for index in [*(begin + own.index), picture.BROKEN]
        ]
        look: dict[str, Any] = {"colour": colours[number % len(colours)], "width": 1.4}
        look |= {"dash": _DASHES[number % len(_DASHES)]} if len(colours) == 1 else {}
        if not is_reached:
            look |= {"width": 0.6, "look": UNSTABLE_LOOK} | ({"dash": ":"} if len(colours) > 1 else {})
        label = ": ".join(filter(None, (str(kind), SPECIAL_POINTS.get(str(kind), ""))))
        series.append(picture.Series(label, places[:-1], mode="lines", **look))
    return series


_MAKERS: Mapping[str, Callable[[Sweeps, Sequence[str]], picture.Picture]] = {
    "response": response,
    "bifurcation": bifurcation,
    "map": regimes,
}
