"""Pictures of a sweep, or of several laid over each other: response, bifurcation diagram and map of regimes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from vibroplat.errors import TableError
from vibroplat.results import content, picture
from vibroplat.results.labels import ABSCISSAE
from vibroplat.results.result import Result
from vibroplat.study import titles
from vibroplat.study.branches import EXCITATION
from vibroplat.study.curves import DISTINCT, curves_of, placed, strips_of
from vibroplat.study.diagrams import bifurcation, regimes
from vibroplat.study.practice import bands
from vibroplat.study.sweeps import Sweeps, read

OPTIONS = ("x", "data", "measure")


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
        drawn.loc[rows.index, sweeps.x] = placed(rows, sweeps.x)
    names = list(dict.fromkeys(sweeps.label(rows.iloc[0]) for rows in sweeps.branches))
    scale = sweeps.scale if len(names) > DISTINCT else ""
    shown = table.groupby([*sweeps.varied], sort=False)[scale].first() if scale else ()
    found = picture.shades(list(map(float, shown))) if scale else picture.palette(len(names))
    colours = dict(zip(names, found, strict=True))
    strips = strips_of(sweeps, colours)
    panels, left = content.measures(
        table, asked=columns, kept=sweeps.kept, stripped=strips is not None or table["sync"].nunique() == 1
    )
    series, jumps, equal = curves_of(sweeps, [panel.column for panel in panels], colours, told=strips is None)
    practice, drawn = bands(sweeps, drawn, colours)
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
        told=sweeps.told(left, f"curves coincide: {'; '.join(equal)}" if equal else ""),
        meaning=f"Solid: up; dashed: down, seen where it differs; arrows: jumps; ×: failed.{formula}{sweeps.meaning}",
        orbits=picture.Orbits(table),
    )


_MAKERS: Mapping[str, Callable[[Sweeps, Sequence[str]], picture.Picture]] = {
    "response": response,
    "bifurcation": bifurcation,
    "map": regimes,
}
