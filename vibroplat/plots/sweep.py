"""Figures of a sweep, or of several laid over each other: response, bifurcation diagram and map of regimes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap, Normalize
from matplotlib.patches import Patch

from vibroplat.columns import QUANTITIES, with_shaking
from vibroplat.errors import TableError
from vibroplat.plots.labels import ABSCISSAE, key_label
from vibroplat.plots.reading import Curve, rest_of
from vibroplat.plots.response import response_figure
from vibroplat.plots.studies import Study, read_sweeps
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
    new_figure,
    widen_ticks,
)
from vibroplat.plots.timelines import read_measured
from vibroplat.study.branches import EXCITATION, SUPPLY

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
#: Most ticks of the vertical axis of a map.
_TICKS = 12


def sweep_figures(
    directories: Sequence[Path], kinds: Sequence[str] = (), *, x: str = "excitation", data: Path | None = None
) -> Iterator[tuple[Path, str, Figure]]:
    """Draw figures of a sweep, or of several over each other; yield the directory and the name of each.

    Parameters
    ----------
    directories
        Result directories of ``vibroplat sweep``.
    kinds
        ``response`` (RMS, phase difference, power, force and flight over frequency), ``bifurcation`` (points of the
        Poincaré section and impact speeds), ``map`` (synchronization, period and flight over supply frequency and a key
        of the grid). Default: response and the kind of the sweep.
    x
        Horizontal axis: ``excitation`` or ``supply`` frequency.
    data
        File of measured data laid over the response.

    Raises
    ------
    TableError
        Tables are missing, have another schema version, or lack data that a figure needs.
    """
    column = ABSCISSAE[x]
    measured = None if data is None else read_measured(data, column, QUANTITIES, ABSCISSAE.values())
    response = read_sweeps(directories, x=column, data=measured)
    if not kinds:
        kinds = list(
            dict.fromkeys(
                ["response", *([response.results[0].given("sweep", "kind")] if len(directories) == 1 else [])]
            )
        )
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
        response.results[0].columns(name, ("direction",), (x, "branch", column))
        for name, column in (("section", "y_m"), ("impacts", "impact_speed_m_per_s"))
    )
    scenes = {c.rows["branch"].iloc[0]: response.scene_of(c.rows, response.grid) for c in curves}
    rests = {branch: rest_of(scene) for branch, scene in scenes.items() if scene is not None}
    name = "$y$ from rest" if rests else "$y$"
    section = section.assign(y_m=section["y_m"] - section["branch"].map(rests).fillna(0.0).astype(float))
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
    widen_ticks(axes[0, 0], "x")
    head(figure, ", ".join(response.names), response.parameters(response.varied))
    directions = dict.fromkeys(curve.direction for curve in curves)
    if len(directions) > 1:
        colours = {f"supply frequency {name}": _DIRECTIONS[name] for name in directions}
        dot = {"ls": "", "marker": "o", "ms": 4.0, "mew": 0.0}
        named = [*colours.items(), ("the other direction", _BEHIND)]
        handles = [entry(label, color=colour, **dot) for label, colour in named]
        figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


# -- map of regimes ----------------------------------------------------------------------------------------------------


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


def draw_map(axis: Axes, table: pd.DataFrame, key: str, values: pd.Series, colours: Any, norm: Any) -> Axes:
    """Draw a tile of equal size for each point of one direction of a sweep; failed points are hatched.

    Rows are in the order of the key's values, evenly spaced whatever these are: their ticks say which.

    Parameters
    ----------
    axis
        Where to draw.
    table
        The points, each with a supply frequency and a value of the key.
    key
        The key of the vertical axis.
    values
        What is drawn; NaN where a point failed.
    colours, norm
        Matplotlib's colour map and norm of these values.

    Returns
    -------
    Axes
        The same axis.
    """
    grid = table.assign(value=values).pivot_table(
        index=key, columns=SUPPLY, values="value", aggfunc="first", dropna=False, sort=True
    )
    found = grid.to_numpy(dtype=float)
    rows = np.arange(len(grid.index))
    axis.pcolormesh(grid.columns, rows, found, cmap=colours, norm=norm, shading="nearest", rasterized=True)
    missing = np.ma.masked_where(np.isfinite(found), np.zeros(found.shape))
    if missing.count():
        axis.pcolor(
            grid.columns, rows, missing, cmap=ListedColormap(["white"]), hatch=_HATCH, shading="nearest", lw=0.0
        )
    every = max(1, -(-len(rows) // _TICKS))
    axis.set_yticks(rows[::every], [f"{value:g}" for value in grid.index[::every]])
    axis.grid(visible=False)
    return axis


def regimes(response: Study) -> Figure:
    """Draw maps of synchronization, period and flight over supply frequency and a grid key."""
    key, table = _key(response), response.points
    directions = list(dict.fromkeys(table["direction"]))
    flies = "flight_fraction" in table and bool((table["flight_fraction"] > 0.0).any())
    classes = [("synchronization", sync_classes(table), SYNC), ("period (turns)", period_classes(table), PERIODS)]
    size = (5.0 * (2 + flies), 1.4 + 3.0 * len(directions))
    figure, axes = new_figure(len(directions), 2 + flies, size, sharex=True, sharey=True)
    scale = mpl.colormaps["viridis_r"](np.linspace(0.05, 1.0, 256))  # from short flights, pale, to long ones, dark
    scale[0] = mpl.colors.to_rgba(NO_FLIGHT)
    flight = ScalarMappable(Normalize(0.0, 1.0), ListedColormap(scale))
    for row, direction in zip(axes, directions, strict=True):
        rows = table[table["direction"] == direction]
        for axis, (title, values, colours) in zip(row, classes, strict=False):
            norm = BoundaryNorm(np.arange(len(colours) + 1) - 0.5, len(colours))
            draw_map(axis, rows, key, values[rows.index], ListedColormap(list(colours.values())), norm)
            axis.set_title(f"{title}, {direction}", loc="left")
        if flies:
            draw_map(row[2], rows, key, rows["flight_fraction"].astype(float), flight.cmap, flight.norm)
            row[2].set_title(f"flight, {direction}", loc="left")
        row[0].set_ylabel(key_label(key))
    for axis in axes[-1]:
        axis.set_xlabel(key_label(SUPPLY))
    head(figure, ", ".join(response.names), response.parameters(response.varied))
    for axis, (_, values, colours) in zip(axes[-1], classes, strict=False):
        _map_legend(axis, values, colours, response.rotation)
    if flies:
        bar = figure.colorbar(flight, ax=axes[-1, 2], location="bottom", aspect=40)
        bar.set_label("flight fraction; white: no flight")
    return figure


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
