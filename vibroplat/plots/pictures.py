"""Draws pictures in print: the panels of each, with what they have in common below them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import AsinhLocator, MaxNLocator

from vibroplat.columns import PHASE_COLUMN
from vibroplat.measured.data import Measured, curve_of
from vibroplat.plots.axes import begin_at_zero, in_decades, label_axis, show_phases, widen_ticks, write_each
from vibroplat.plots.layout import Cell, cells_of
from vibroplat.plots.panels import DRAWERS, colour_numbers, with_gap
from vibroplat.plots.strips import draw_jumps, draw_strips, draw_words
from vibroplat.plots.style import CAPTION_COLOUR, head, legend_below
from vibroplat.results.labels import is_number, plain
from vibroplat.results.legend import BAND, FILLINGS, HALF, SHADE, Entry, legend_of, legend_of_strips
from vibroplat.results.picture import (
    BLACK,
    BROKEN,
    FAILED,
    LOST,
    LOW,
    REFERENCE,
    Mark,
    Panel,
    Picture,
    Series,
    on_axis,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vibroplat.kernels.compiled import FloatArray

_CROSS: Mapping[str, Any] = {"marker": "x", "ls": "", "color": FAILED, "ms": 5.0, "mew": 1.4}
#: Most entries of a legend in the place of a panel that is left empty, most dots that are drawn as such, and most wraps
#: of a line of common width; of more, nothing but a drift is to be seen.
MOST_WITHIN, MOST_DOTS, MOST_WRAPS = 11, 2000, 60
#: Most measured points that are drawn large.
MOST_LARGE = 100
#: An axis that has room for numbers near 0 is linear up to this distance from it, and logarithmic farther away;
#: and about how many ticks have room there.
NEAR_ZERO, MAX_TICKS = 1e-3, 6


# -- series ------------------------------------------------------------------------------------------------------------


class _Pen:
    """Draws a series into axes: its places on the horizontal axis, states of its points, and how they look.

    Lines are added as such, which takes half as long as ``plot``: there may be thousands. They are clipped and take no
    room outside of the axes; computing their extents would take a tenth of the time.
    """

    def __init__(self, axis: Axes, series: Series, x: FloatArray, states: Any) -> None:
        self.axis, self.series, self.x = axis, series, x[series.places]
        self.states = np.append(states, np.zeros(len(x), dtype=int))[series.places]
        layer = 2.5 if not series.pale else 1.5 if series.mode == "markers" else 2.4
        self.look: dict[str, Any] = {"color": series.colour, "in_layout": False, "zorder": layer}
        self.look |= {"alpha": HALF} if series.pale else {}

    def line(self, y: FloatArray, *, wraps: bool) -> None:
        """Draw a line; a single point is a dot."""
        gaps = np.flatnonzero(np.abs(np.diff(y)) > np.pi) + 1 if wraps else ()
        x, up = (np.insert(values, gaps, np.nan) if len(gaps) else values for values in (self.x, y))
        width = (0.9 if len(gaps) <= MOST_WRAPS else 0.25) * self.series.width
        self.axis.add_line(Line2D(x, up, ls=self.series.dash, lw=width, **self.look))
        if self.series.mode == "both" or np.isfinite(self.x).sum() == 1:
            self.markers(y)

    def markers(self, y: FloatArray) -> None:
        """Draw markers whose filling shows the class of each point."""
        symbol: dict[str, Any] = {"marker": self.series.symbol, "ms": 3.2 * self.series.size, "mew": 0.7, "ls": ""}
        for state in np.unique(self.states[self.series.places != BROKEN]):
            chosen = (self.states == state) & (self.series.places != BROKEN)
            if state != LOST:
                filled = symbol | {"fillstyle": FILLINGS[state], "markerfacecoloralt": "white"}
                self.axis.add_line(Line2D(self.x[chosen], y[chosen], **filled, **self.look))
            elif np.isfinite(self.x[chosen]).any():
                across, zero = self.axis.get_xaxis_transform(), np.zeros(int(chosen.sum()))
                self.axis.plot(self.x[chosen], zero, clip_on=False, zorder=4.0, transform=across, **_CROSS)

    def dots(self, y: FloatArray) -> None:
        """Draw small dots; of many an image in PDF and SVG."""
        known, size = np.isfinite(y), 1.6 * self.series.size
        self.axis.plot(self.x[known], y[known], "o", ms=size, mew=0.0, rasterized=len(y) > MOST_DOTS, **self.look)

    def band(self, low: FloatArray, high: FloatArray) -> None:
        """Draw what lies between two curves, and these as thin lines."""
        if not self.series.pale:
            self.axis.fill_between(self.x, low, high, color=self.look["color"], lw=0.0, alpha=BAND)
            if np.isfinite(low).sum() == 1:  # which has no area
                self.axis.vlines(self.x, low, high, self.look["color"], lw=4.0, alpha=BAND)
        for edge in (low, high):
            self.axis.add_line(Line2D(self.x, edge, lw=0.7, ls=self.series.dash, **self.look))

    def stems(self, y: FloatArray) -> None:
        """Draw a line from 0 to each point."""
        ends = np.stack([np.column_stack([self.x, np.zeros_like(y)]), np.column_stack([self.x, y])], axis=1)
        self.axis.add_collection(LineCollection(list(ends), colors=self.look["color"], lw=0.9))
        self.axis.plot(self.x, y, "o", ms=3.0, **self.look)

    def shade(self) -> None:
        """Shade the whole height over each stretch of points."""
        for part in np.split(self.x, np.flatnonzero(self.series.places == BROKEN)):
            known = part[np.isfinite(part)]
            if len(known):
                self.axis.axvspan(known[0], known[-1], color=self.look["color"], lw=0.0, zorder=0.0)


def _draw(axis: Axes, series: Series, picture: Picture, column: str, x: FloatArray) -> None:
    """Draw a series; its axis is scaled once, after the last one."""
    y = with_gap(picture.points[column])[series.places]
    pen = _Pen(axis, series, x, picture.states)
    if series.mode == "shade":
        pen.shade()
    elif not np.isfinite(y).any() and not (pen.states == LOST).any():
        return  # of another panel
    elif series.mode == "band":
        pen.band(with_gap(picture.points[f"{column}{LOW}"])[series.places], y)
    elif series.mode in ("lines", "both"):
        pen.line(y, wraps=column == PHASE_COLUMN)
    else:
        {"markers": pen.markers, "dots": pen.dots, "stems": pen.stems}[series.mode](y)


# -- the figure --------------------------------------------------------------------------------------------------------


def draw_picture(picture: Picture, x: str = "", data: Measured | None = None) -> Figure:
    """Draw a picture over the first of its axes, or another column, with measured data laid over it."""
    x, data = x or picture.axes[0], None if picture.name == "measured" else data  # which it has itself
    computed, picture = picture.points, _on_axes(picture, x)
    figure, strips, cells = cells_of(picture, x)
    for axis, facet in strips:
        draw_strips(axis, picture, facet, x)
    for cell in cells:
        _panel(cell, picture, x, (data, computed) if data is not None else None)
    for cell in cells:  # that may share their axis, which so has all points
        if cell.panel.kind in ("points", "tiles") and not picture.log(x):
            widen_ticks(cell.axis, "x")
    first = cells[0].axis if cells else strips[0][0]
    if picture.log(x) and not {panel.kind for panel in picture.panels} & {"tiles", "bars", "ranks"}:
        in_decades(next((cell.axis for cell in cells if not cell.panel.x), first), "x")  # that all share
    if x == "start":
        first.xaxis.set_major_locator(MaxNLocator(integer=True))
    head(figure, picture.title, picture.caption)
    if picture.scale:
        values = picture.points[picture.scale]
        norm = Normalize(float(values.min()), float(values.max()))
        dark = ListedColormap(colormaps["viridis"](np.linspace(0.0, 0.9, 256)))
        bar = figure.colorbar(ScalarMappable(norm, dark), ax=figure.axes, aspect=50, pad=0.01)
        label_axis(bar.ax.yaxis, picture.scale, picture.unit(picture.scale))
    measured = [line for axis in figure.axes for line in axis.get_legend_handles_labels()[0]][:1]
    named = [] if picture.strips is None else legend_of_strips(picture.strips)
    entries = [
        *map(handle_of, [*named, *legend_of(picture, colours=not picture.scale)]),
        *(measured if data is not None else []),
    ]
    empty = next((axis for axis in figure.axes if not axis.axison), None)
    if empty is not None and len(cells) > 1 and len(entries) <= MOST_WITHIN:
        empty.legend(handles=entries, loc="center", fontsize=8.0)
    else:
        legend_below(figure, entries)
    return figure


def draw_measured(axis: Axes, data: Measured, x: str, column: str) -> None:
    """Draw measured data over another column where they have both, in black diamonds, smaller ones if they are many.

    Over time, data outside of the range of all drawn curves are left out.
    """
    if {x, column} <= {*data.table.columns}:
        low, high = axis.dataLim.intervalx if x == "t_s" else (-np.inf, np.inf)
        table = data.table[data.table[x].between(low, high)]
        size, edge = (4.0, 1.0) if len(table) <= MOST_LARGE else (2.0, 0.5)
        look: dict[str, Any] = {"color": BLACK, "mfc": "white", "ms": size, "mew": edge, "zorder": 5.0, "ls": ""}
        label = ", ".join([f"measured: {plain(data.path.name)}", *data.differences()])
        axis.plot(table[x], on_axis(column, table[column]), marker="D", label=label, **look)


def _on_axes(picture: Picture, x: str) -> Picture:
    """Return a picture whose drawn columns are as their axes have them."""
    points = picture.points
    names = {x, *(name for panel in picture.panels for name in (panel.column, panel.x, panel.by))}
    known = [name for name in names if name in points and is_number(points[name])]
    return replace(picture, drawn=points.assign(**{name: on_axis(name, points[name]) for name in known}))


def _panel(cell: Cell, picture: Picture, x: str, data: tuple[Measured, pd.DataFrame] | None) -> None:
    """Draw what a panel shows, and name its axis."""
    axis, panel, facet = cell[:3]
    shown = [one for n in facet.series if not (one := picture.series[n]).of or panel.has(one.of)]
    kind = "dots" if panel.by and panel.kind == "points" else panel.kind
    if kind in DRAWERS:
        DRAWERS[kind](cell, picture, x, shown)
    else:
        _curves(axis, picture, panel, x, shown)
    if data is not None:
        curves = [curve_of(data[1].iloc[s.places[s.places != BROKEN]], panel.column, x) for s in shown]
        data[0].compare(panel.column, x, curves)
        draw_measured(axis, data[0], x, panel.column)
    if kind not in ("ranks", "bars") and (cell.is_first or not picture.facets):
        label = "" if panel.by and panel.kind != "plane" else panel.label
        label_axis(axis.yaxis, panel.column, picture.unit(panel.column), label)
        if panel.column == PHASE_COLUMN:
            show_phases(axis, picture.rotation)
    _references(axis, picture, panel, x)
    _limit(axis, panel)
    draw_words(axis, picture, panel.column, x)
    if panel.note:
        axis.set_title(panel.note, loc="right", fontsize=8.0, color=CAPTION_COLOUR)
    if panel.by and panel.kind not in ("plane", "ranks") and not panel.classes and (cell.is_last or not picture.facets):
        _, colours, norm = colour_numbers(panel, picture.points)
        bar = axis.figure.colorbar(ScalarMappable(norm, colours), ax=axis, aspect=40)
        label_axis(bar.ax.yaxis, panel.by, picture.unit(panel.by), panel.label)
    if panel.title:
        own = axis.get_title(loc="left")
        axis.set_title(f"{panel.title}, {own}" if own else panel.title, loc="left")


def _curves(axis: Axes, picture: Picture, panel: Panel, x: str, shown: Sequence[Series]) -> None:
    """Draw series and marks."""
    if panel.scale == "asinh":
        axis.set_yscale("asinh", linear_width=NEAR_ZERO)
        axis.yaxis.set_major_locator(AsinhLocator(NEAR_ZERO, numticks=MAX_TICKS))
    over = panel.x or x
    across = with_gap(picture.points[over])
    for one in shown:
        _draw(axis, one, picture, panel.column, across)
    draw_jumps(axis, picture, panel, over)
    for mark in picture.marks:
        places, size = picture.points[over].iloc[[*mark.rows]], 8.0 if mark.colour else 3.6
        axis.plot(places, picture.points[panel.column].iloc[[*mark.rows]], zorder=4.0, **_marked(mark) | {"ms": size})
    axis.autoscale_view()


def _marked(mark: Mark) -> dict[str, Any]:
    """Return the look of special points."""
    edge, filling = mark.colour or BLACK, mark.colour or "white"
    return {"marker": mark.symbol, "ls": "", "mfc": filling, "mec": edge, "mew": 0.8, "ms": 5.0}


def _references(axis: Axes, picture: Picture, panel: Panel, x: str) -> None:
    """Draw lines of reference and shade intervals."""
    over = panel.column if panel.kind == "ranks" else panel.x or x
    for line in picture.lines:
        draw: Any = axis.axvline if line.column == over else axis.axhline if line.column == panel.column else None
        for value in on_axis(line.column, line.at) if draw else ():
            draw(value, color=line.colour, lw=0.9, ls=line.dash, zorder=1.5)
    for one in picture.ranges:
        if one.column == over:
            axis.axvspan(one.low, one.high, color=REFERENCE, alpha=SHADE, lw=0.0, zorder=0.5)


def _limit(axis: Axes, panel: Panel) -> None:
    """Begin axes of non-negative quantities at 0, and draw small quantities small, instead of magnifying noise."""
    if panel.kind not in ("points", "stack") or panel.by:
        return
    if panel.scale == "log":
        in_decades(axis, "y")
    elif panel.scale == "asinh":
        write_each(axis.yaxis)
    elif panel.kind == "stack":
        axis.set_ylim(0.0, 1.0)
    elif panel.least is not None and not axis.dataLim.y1 < 0.0:
        begin_at_zero(axis, max(axis.get_ylim()[1], panel.least))
    elif panel.scale == "linear" and panel.column != PHASE_COLUMN:
        widen_ticks(axis, "y")


# -- legends -----------------------------------------------------------------------------------------------------------


def handle_of(entry: Entry) -> Any:
    """Return how matplotlib draws an entry of a legend."""
    if entry.kind == "area":
        look: dict[str, Any] = {"edgecolor": BLACK, "lw": 0.3} if entry.hatch else {"lw": 0.0}
        return Patch(facecolor=entry.colour, alpha=entry.opacity, hatch=entry.hatch or None, label=entry.label, **look)
    line: dict[str, Any] = {
        "fillstyle": entry.filling,
        "ls": entry.dash if entry.kind == "line" else "",
        "lw": entry.width,
        "color": entry.colour,
    }
    width = 1.4 if entry.symbol == "x" else 0.7
    look = {"marker": entry.symbol or None, "ms": entry.size, "mew": width, "markerfacecoloralt": "white"}
    return Line2D([], [], label=entry.label, alpha=entry.opacity, **line, **look)
