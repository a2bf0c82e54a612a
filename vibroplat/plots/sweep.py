"""Figures of a sweep, or of several laid over each other: response, bifurcation diagram and map of regimes."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap, Normalize
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke

from vibroplat.columns import PHASE_COLUMN, QUANTITIES, quantity_of, with_shaking
from vibroplat.errors import TableError
from vibroplat.plots.labels import ABSCISSAE, in_ratios, key_label, key_name
from vibroplat.plots.orbits import MEANINGS
from vibroplat.plots.reading import Curve, has_table, rest_of
from vibroplat.plots.response import response_figure
from vibroplat.plots.studies import UNREACHED, Study, reached, read_sweeps
from vibroplat.plots.style import (
    BLUE,
    CURVES,
    GREEN,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    entry,
    head,
    in_decades,
    new_figure,
    widen_ticks,
)
from vibroplat.plots.timelines import read_measured, wrapped
from vibroplat.results.files import SavedFiles
from vibroplat.study.branches import EXCITATION, SUPPLY, column_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vibroplat.kernels.compiled import FloatArray

#: Colours of the directions of a bifurcation diagram, and of the other direction behind them.
_DIRECTIONS, _BEHIND = {"up": CURVES[0], "down": CURVES[1]}, "#c9c9c9"
#: Kinds of synchronization and their colours on a map.
SYNC = {"antiphase": BLUE, "in-phase": ORANGE, "intermediate": GREEN, "none": "#3c3c3c"}
_SYNC_LABELS = {"none": "not synchronous"}
#: Classes of periods: upper limits and labels; after them the motions that do not repeat, and their colours.
_ENDS = ((1, "1"), (2, "2"), (4, "3, 4"), (8, "5 … 8"), (64, "9 … 64"))
_APERIODIC = {"quasi-periodic": "quasi-periodic", "chaotic": "chaotic", "undecided": "not periodic"}
PERIODS = {
    **dict(zip((name for _, name in _ENDS), (BLUE, SKY, GREEN, ORANGE, VERMILION), strict=True)),
    "quasi-periodic": PURPLE,
    "chaotic": "#5c2a4d",
    "not periodic": "#d4d4d4",
}
#: Hatch of points that failed, and the colour of points without flight.
_HATCH, NO_FLIGHT = "xxxx", "#ffffff"
#: Lines of boundaries on a map, by the kinds of special points.
_LINES: dict[str, Any] = dict(
    zip(MEANINGS, ("-", "--", "-.", ":", (0, (7, 2)), (0, (1, 2, 1, 2, 5, 2)), (0, (9, 1, 2, 1))), strict=True)
)
#: Their widths by whether motion comes to their orbits.
_WIDTHS = {True: 1.3, False: 0.5}
#: Most ticks of the vertical axis of a map.
_TICKS = 12


def sweep_figures(
    directories: Sequence[Path],
    kinds: Sequence[str] = (),
    *,
    x: str | None = None,
    data: Path | None = None,
    measure: Sequence[str] = (),
) -> Iterator[tuple[Path, str, Figure]]:
    """Draw figures of a sweep, or of several over each other; yield the directory and the name of each.

    Parameters
    ----------
    directories
        Result directories of ``vibroplat sweep``.
    kinds
        ``response`` (RMS, phase difference, power, force and flight over the key), ``bifurcation`` (points of the
        Poincaré section and impact speeds), ``map`` (synchronization, period and flight over the key and one of the
        grid, with boundaries of orbits over both in the same directory). Default: response and the kind of the sweep.
    x
        Horizontal axis: ``excitation`` or ``supply`` frequency. Default: the excitation frequency if the key is the
        supply frequency, else the key.
    data
        File of measured data laid over the response.
    measure
        Columns that response and map show instead.

    Raises
    ------
    TableError
        Tables are missing, have another schema version, or lack data that a figure needs.
    """
    response = read_sweeps(directories, x=None if x is None else ABSCISSAE[x], measures=measure)
    if data is not None:
        measured = read_measured(data, response.x, QUANTITIES, (*ABSCISSAE.values(), response.key))
        response = replace(response, data=measured)
    if not kinds:
        kinds = list(
            dict.fromkeys(
                ["response", *([response.results[0].given("sweep", "kind")] if len(directories) == 1 else [])]
            )
        )
    if measure and not {"response", "map"} & {*kinds}:
        raise TableError(f"--measure {', '.join(measure)}: {kinds[0]} does not show it; allowed: response, map")
    if len(directories) > 1 and {*kinds} != {"response"}:
        other = next(kind for kind in kinds if kind != "response")
        raise TableError(f"--kind {other} shows one sweep; allowed with {len(directories)} of them: response")
    for kind in kinds:
        yield directories[0], kind, FIGURES[kind](response)


# -- bifurcation diagram -----------------------------------------------------------------------------------------------


def draw_section(
    axis: Axes, points: pd.DataFrame, column: str, *, x: str = EXCITATION, factor: float = 1.0, **look: Any
) -> Axes:
    """Draw points of a table ``section`` or ``impacts`` over frequency; in PDF and SVG they are dots of an image."""
    style: dict[str, Any] = {"ls": "", "marker": "o", "ms": 1.6, "mew": 0.0, "rasterized": len(points) > 2000} | look
    axis.plot(points[x], factor * points[column], **style)
    return axis


def bifurcation(response: Study) -> Figure:
    """Draw the Poincaré section and impact speeds over frequency, a column for each branch.

    Behind the points of a branch are those of the other direction, in grey: where both are alike, none is hidden.
    """
    curves, x = response.curves, response.x
    section, impacts = (
        response.results[0].columns(name, ("direction",), (x, response.key, "branch", column))
        for name, column in (("section", "y_m"), ("impacts", "impact_speed_m_per_s"))
    )
    scenes = {c.rows["branch"].iloc[0]: response.scene_of(c.rows, response.grid) for c in curves}
    rests = {
        (branch, value): rest_of(scene if response.key == SUPPLY else scene.replace({response.key: value}))
        for (branch, value), _ in section.groupby(["branch", response.key])
        if (scene := scenes[branch]) is not None
    }
    name = "$y$ from rest" if any(scenes.values()) else "$y$"
    rest = [rests.get(place, 0.0) for place in zip(section["branch"], section[response.key], strict=True)]
    section = section.assign(y_m=section["y_m"] - rest)
    quantities = [(section, "y_m", 1e3, f"{name} at whole turns of exciter 1 (mm)")]
    if len(impacts):
        quantities.append((impacts, "impact_speed_m_per_s", 1.0, "impact speed (m/s)"))
    size = (max(8.0, 1.0 + 4.2 * len(curves)), 1.2 + 2.9 * len(quantities))
    figure, axes = new_figure(len(quantities), len(curves), size, sharex=True, sharey="row")
    for row, (table, column, factor, label) in zip(axes, quantities, strict=True):
        for axis, curve in zip(row, curves, strict=True):
            others = [c for c in curves if c.number == curve.number and c.direction != curve.direction]
            looks: list[tuple[Curve, dict[str, Any]]] = [(c, {"color": _BEHIND, "zorder": 1.5}) for c in others]
            for shown, look in [*looks, (curve, {"color": _DIRECTIONS.get(curve.direction, CURVES[0])})]:
                points = table[table["branch"] == shown.rows["branch"].iloc[0]]
                draw_section(axis, points, column, x=x, factor=factor, **look)
        row[0].set_ylabel(label)
        widen_ticks(row[0], "y")
    for axis, curve in zip(axes[0], curves, strict=True):
        axis.set_title(", ".join(part for part in (curve.label, curve.direction) if part), loc="left")
    for axis in axes[-1]:
        axis.set_xlabel(key_label(x))
    if in_ratios(response.points[x]):
        in_decades(axes[0, 0], "x")
    widen_ticks(axes[0, 0], "x")
    head(figure, ", ".join(response.names), response.parameters([response.key, *response.varied]))
    directions = dict.fromkeys(curve.direction for curve in curves)
    if len(directions) > 1:
        colours = {f"{key_name(response.key)} {name}": _DIRECTIONS[name] for name in directions}
        dot = {"ls": "", "marker": "o", "ms": 4.0, "mew": 0.0}
        named = [*colours.items(), ("the other direction", _BEHIND)]
        handles = [entry(label, color=colour, **dot) for label, colour in named]
        figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


# -- map of regimes ----------------------------------------------------------------------------------------------------


def attractor_colours(attractors: Iterable[str]) -> dict[str, str]:
    """Return colours of attractors, which their order does not change; their names begin with the synchronization.

    The first one of a synchronization, an orbit if there is any, has its colour on maps, others have what is left.
    """
    given = list(dict.fromkeys(attractors))
    names = sorted(given, key=lambda name: (", period" not in name, name))
    firsts = {name.partition(",")[0]: name for name in reversed(names)}
    found = {name: SYNC[sync] for sync, name in firsts.items() if sync in SYNC}
    left = sorted((c for c in CURVES if c not in found.values()), key=lambda colour: colour in SYNC.values())
    found |= zip((name for name in names if name not in found), itertools.cycle(left), strict=False)
    return {name: found[name] for name in given}


def sync_classes(table: pd.DataFrame) -> pd.Series:
    """Return the number of each point's synchronization in ``SYNC``, or NaN if it failed."""
    return table["sync"].map({name: float(i) for i, name in enumerate(SYNC)})


def period_classes(table: pd.DataFrame) -> pd.Series:
    """Return the number of each point's class in ``PERIODS``, or NaN if it failed."""
    period = table["period"].to_numpy(dtype=float, na_value=np.nan)
    classes = np.searchsorted([end for end, _ in _ENDS], np.nan_to_num(period)).astype(float)
    motion = table["motion"] if "motion" in table else pd.Series("undecided", table.index)
    names = motion.map(_APERIODIC).fillna("not periodic").map(list(PERIODS).index)
    classes = np.where(period == 0.0, names.to_numpy(dtype=float), classes)
    return pd.Series(np.where(np.isfinite(period), classes, np.nan), table.index)


def draw_map(
    axis: Axes, table: pd.DataFrame, key: str, values: pd.Series, colours: Any, norm: Any, *, x: str = SUPPLY
) -> Axes:
    """Draw a tile of equal height for each point of one direction of a sweep; failed points are hatched.

    Rows are in the order of the key's values, evenly spaced whatever these are: their ticks say which.

    Parameters
    ----------
    axis
        Where to draw.
    table
        The points, each with a value of the horizontal axis and of the key.
    key
        The key of the vertical axis.
    values
        What is drawn; NaN where a point failed.
    colours, norm
        Matplotlib's colour map and norm of these values.
    x
        Column of the horizontal axis.

    Returns
    -------
    Axes
        The same axis.
    """
    grid = table.assign(value=values).pivot_table(
        index=key, columns=x, values="value", aggfunc="first", dropna=False, sort=True
    )
    found = grid.to_numpy(dtype=float)
    rows, edges = np.arange(len(grid.index)), _edges(grid.columns.to_numpy(dtype=float))
    corners = edges, np.arange(len(rows) + 1) - 0.5
    axis.pcolormesh(*corners, found, cmap=colours, norm=norm, rasterized=True)
    missing = np.ma.masked_where(np.isfinite(found), np.zeros(found.shape))
    if missing.count():
        axis.pcolor(*corners, missing, cmap=ListedColormap(["white"]), hatch=_HATCH, lw=0.0)
    if in_ratios(grid.columns):
        in_decades(axis, "x")
    every = max(1, -(-len(rows) // _TICKS))
    axis.set_yticks(rows[::every], [f"{value:g}" for value in grid.index[::every]])
    axis.grid(visible=False)
    return axis


def _edges(values: FloatArray) -> FloatArray:
    """Return the edges of tiles around ascending values: half way, of values in equal ratios by their logarithms."""
    if in_ratios(values):
        return np.exp(_edges(np.log(values)))
    half = 0.5 * np.diff(values) if len(values) > 1 else 0.01 * np.abs(values) + 1e-9
    return np.concatenate([[values[0] - half[0]], values[:-1] + half[: len(values) - 1], [values[-1] + half[-1]]])


def regimes(response: Study) -> Figure:
    """Draw maps of synchronization, period and flight, or of measures, over the key and one of the grid."""
    key, table = _key(response), response.points
    directions, panels = list(dict.fromkeys(table["direction"])), list(_panels(response))
    curves = _boundaries(response, column_of(key))
    kinds = [kind for kind in MEANINGS if len(curves) and (curves["kind"] == kind).any()]
    size = (max(5.0 * len(panels), 7.0), 1.4 + 3.0 * len(directions) + 0.25 * len(kinds))
    figure, axes = new_figure(len(directions), len(panels), size, sharex=True, sharey=True)
    for row, direction in zip(axes, directions, strict=True):
        rows = table[table["direction"] == direction]
        for axis, panel in zip(row, panels, strict=True):
            look = panel.colours
            draw_map(axis, rows, key, panel.numbers[rows.index], look.cmap, look.norm, x=response.key)
            axis.set_title(f"{panel.title}, {direction}", loc="left")
            _draw_boundaries(axis, curves, response.key, column_of(key), np.unique(rows[key]))
        row[0].set_ylabel(key_label(key))
    for axis in axes[-1]:
        axis.set_xlabel(key_label(response.key))
    head(figure, ", ".join(response.names), response.parameters([response.key, *response.varied]))
    for axis, panel in zip(axes[-1], panels, strict=True):
        if panel.classes:
            _map_legend(axis, panel.numbers, panel.classes, response.rotation)
        else:
            figure.colorbar(panel.colours, ax=axis, location="bottom", aspect=40).set_label(panel.label)
    if kinds:
        handles = [entry(f"{kind}: {MEANINGS[kind]}", color="black", ls=_LINES[kind]) for kind in kinds]
        handles += [] if reached(curves).all() else [entry(f"thin: {UNREACHED}", color="black", lw=_WIDTHS[False])]
        figure.legend(handles=handles, loc="outside lower center", ncols=1)
    return figure


class _Panel(NamedTuple):
    """A column of maps: its title, the number of each point, their colours, and the names of classes or a label."""

    title: str
    numbers: pd.Series
    colours: ScalarMappable
    classes: dict[str, str]
    label: str = ""


def _panels(response: Study) -> Iterator[_Panel]:
    """Yield what maps show: measures that are asked for, or else classes, and flight if there is any."""
    table = response.points
    dark = mpl.colormaps["viridis_r"](np.linspace(0.05, 1.0, 256))  # from small values, pale, to large ones, dark
    for column in response.measures:
        quantity = quantity_of(column)
        found = table[column].to_numpy(dtype=float, na_value=np.nan)
        values = pd.Series(wrapped(found) if column == PHASE_COLUMN else quantity.factor * found, table.index)
        norm = Normalize(float(values.min()), float(values.max())) if values.notna().any() else Normalize(0.0, 1.0)
        yield _Panel(quantity.name, values, ScalarMappable(norm, ListedColormap(dark)), {}, quantity.label)
    if response.measures:
        return
    shown = (("synchronization", sync_classes(table), SYNC), ("period (turns)", period_classes(table), PERIODS))
    for title, values, classes in shown:
        norm = BoundaryNorm(np.arange(len(classes) + 1) - 0.5, len(classes))
        yield _Panel(title, values, ScalarMappable(norm, ListedColormap(list(classes.values()))), classes)
    if "flight_fraction" in table and bool((table["flight_fraction"] > 0.0).any()):
        dark[0] = mpl.colors.to_rgba(NO_FLIGHT)
        flight, label = ScalarMappable(Normalize(0.0, 1.0), ListedColormap(dark)), "flight fraction; white: no flight"
        yield _Panel("flight", table["flight_fraction"].astype(float), flight, {}, label)


def _boundaries(response: Study, second: str) -> pd.DataFrame:
    """Return the boundaries of orbits over the two keys of a map in the same directory; none are no rows."""
    place = response.results[0].directory
    table = SavedFiles(place, "orbits").table("boundaries") if has_table(place, "boundaries") else pd.DataFrame()
    return table if {response.key, second} <= {*table.columns} else table.iloc[:0]


def _draw_boundaries(axis: Axes, curves: pd.DataFrame, x: str, second: str, rows: FloatArray) -> None:
    """Draw boundaries over tiles, whose rows are evenly spaced; beyond the first and the last row there are none."""
    for (_, is_reached), curve in curves.groupby(["curve", reached(curves)]) if len(curves) else ():
        places = np.interp(curve[second], rows, np.arange(len(rows)), left=np.nan, right=np.nan)
        width = _WIDTHS[bool(is_reached)]
        outlined = [Stroke(linewidth=2.3 * width, foreground="white"), Normal()]
        look = {"color": "black", "lw": width, "ls": _LINES[curve["kind"].iloc[0]], "path_effects": outlined}
        axis.plot(curve[x], places, scalex=False, scaley=False, **look)


def _key(response: Study) -> str:
    """Return the grid key with several numbers, if there is exactly one."""
    if response.scale is not None:
        return response.scale
    place = response.results[0].directory
    raise TableError(f"{place} varies {response.varied}; a map needs one grid key with several numbers")


def _map_legend(axis: Axes, values: pd.Series, colours: dict[str, str], rotation: str) -> None:
    """Name the colours that a map needs below it."""
    names = [name for i, name in enumerate(colours) if (values == i).any()]
    told = {name: _SYNC_LABELS.get(name, with_shaking(name, rotation)) for name in names}
    entries = [Patch(color=colours[name], label=told[name]) for name in names]
    if values.isna().any():
        entries.append(Patch(facecolor="white", edgecolor="black", hatch=_HATCH, lw=0.3, label="failed"))
    columns = 4 if told == dict(zip(names, names, strict=True)) else 2
    axis.legend(handles=entries, loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=columns, columnspacing=1.2)


FIGURES: dict[str, Callable[[Study], Figure]] = {
    "response": response_figure,
    "bifurcation": bifurcation,
    "map": regimes,
}
