"""Draws pictures in print: the panels of each, with what they have in common below them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import FixedLocator, MaxNLocator

from vibroplat.columns import PHASE_COLUMN, QUANTITIES, quantity_of
from vibroplat.plots.style import (
    begin_at_zero,
    entry,
    few,
    head,
    in_decades,
    legend_below,
    new_figure,
    panel_grid,
    widen_ticks,
)
from vibroplat.plots.timelines import Measured, in_units, name_axis, tell_shaking
from vibroplat.results.labels import EXCITATION, SUPPLY, in_ratios, is_number, key_label, key_name
from vibroplat.results.picture import (
    BEHIND,
    BLACK,
    BLUE,
    BROKEN,
    FAILED,
    REFERENCE,
    STATES,
    VERMILION,
    Panel,
    Picture,
    Series,
    motions_of,
)
from vibroplat.study.picture import branch_series, placed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vibroplat.kernels.compiled import FloatArray

#: Panels beside each other at most, and bars of a panel and of a histogram.
ACROSS, BARS, BINS = 3, 10, 30
#: Fillings of markers by the state of a point.
_FILLINGS = dict(zip(STATES, ("full", "none", "bottom", "none"), strict=True))
#: Hatch of tiles of points that failed, and most ticks of their vertical axis.
_HATCH, _TICKS = "xxxx", 12
#: Largest real and imaginary part on the plane, and the least frame, just around the unit circle.
FARTHEST, NEAREST = 2.0, 1.1
#: The axis of sizes of multipliers is linear up to this distance from 1, and logarithmic farther away.
NEAR_ONE = 1e-3
_SIZE_TICKS = (1.0, 0.9, 1.1, 0.99, 1.01, 0.0, 2.0, 0.999, 1.001, *(10.0**power for power in range(1, 32)))
_CROSS: Mapping[str, Any] = {"marker": "x", "ls": "", "color": FAILED, "ms": 5.0, "mew": 1.4}
#: Opacity of intervals that are shaded.
_SHADE = 0.15


# -- series ------------------------------------------------------------------------------------------------------------


class _Drawn(NamedTuple):
    """A series with what all panels share, found once: places on the horizontal axis, and the states of its points."""

    series: Series
    x: FloatArray
    states: list[tuple[str, Any]]


def _ended(values: Any) -> FloatArray:
    """Return numbers with a missing one behind them, which is at the place of :data:`BROKEN`."""
    return np.append(pd.Series(values).to_numpy(dtype=float, na_value=np.nan), np.nan)


def _prepared(series: Series, x: FloatArray, states: Any) -> _Drawn:
    """Prepare a series for its panels; the numbers of ``x`` end as :func:`_ended` says."""
    known = np.zeros(len(x), dtype=int)
    known[: len(states)] = states
    own = np.where(series.rows == BROKEN, -1, known[series.rows])
    found = [(name, own == number) for number, name in enumerate(STATES) if (own == number).any()]
    return _Drawn(series, x[series.rows], found)


def _draw(axis: Axes, drawn: _Drawn, y: FloatArray, *, wraps: bool = False, colour: str = "") -> None:
    """Draw a series; its axis is scaled once, after the last one.

    Lines are added as such, which takes half as long as ``plot``: there may be thousands.
    """
    series, x = drawn.series, drawn.x
    y = y[series.rows]
    if not np.isfinite(y).any() and all(name != "failed" for name, _ in drawn.states):
        return  # of another panel
    # lines are clipped and take no room beside the axes; to ask each of them takes a tenth of the time
    behind = bool(colour) or (series.pale and series.mode == "markers")
    layer = 1.5 if behind else 2.4 if series.pale else 2.5
    style: dict[str, Any] = {"color": colour or series.colour, "in_layout": False, "zorder": layer}
    style |= {"alpha": 0.5} if series.pale else {}
    line: dict[str, Any] = {"ls": series.dash if series.mode in ("lines", "both") else "", "lw": 0.9 * series.width}
    marker: dict[str, Any] = {"marker": series.symbol, "ms": 3.2 * series.size, "mew": 0.7}
    if series.mode == "dots":
        known = np.isfinite(y)
        axis.plot(x[known], y[known], ls="", marker="o", ms=1.6, mew=0.0, rasterized=len(x) > 2000, **style)
        return
    shown = [(name, chosen) for name, chosen in drawn.states if name != "failed"]
    alone = len(shown) == 1 and series.mode == "both" and len(drawn.states) == 1
    if line["ls"] != "":
        gaps = np.flatnonzero(np.abs(np.diff(y)) > np.pi) + 1 if wraps else ()
        gapped = [np.insert(values, gaps, np.nan) if len(gaps) else values for values in (x, y)]
        more: dict[str, Any] = marker | {"fillstyle": _FILLINGS[shown[0][0]]} if alone else {}
        axis.add_line(Line2D(gapped[0], gapped[1], **line, **style, **more))
    lone = series.mode == "lines" and np.isfinite(x).sum() == 1  # no line
    for name, chosen in shown if lone or (series.mode != "lines" and not alone) else ():
        look: dict[str, Any] = {"fillstyle": _FILLINGS[name], "markerfacecoloralt": "white"}
        axis.add_line(Line2D(x[chosen], y[chosen], ls="", **style, **marker, **look))
    for _, chosen in (one for one in drawn.states if one[0] == "failed" and np.isfinite(x[one[1]]).any()):
        across = axis.get_xaxis_transform()
        axis.plot(x[chosen], np.zeros(int(chosen.sum())), clip_on=False, zorder=4.0, transform=across, **_CROSS)


def draw_response(
    axis: Axes,
    rows: pd.DataFrame,
    column: str,
    *,
    x: str = EXCITATION,
    color: Any = BLUE,
    label: str | None = None,
    size: float = 1.0,
) -> Axes:
    """Draw a quantity along one branch of a sweep.

    The way down is wide and pale below the way up, so that both are seen where they coincide. Jumps are left open.
    Markers point in the direction of the branch: full ones are periodic, open ones quasi-periodic or chaotic, half-full
    ones undecided. Points that failed are crosses on the horizontal axis.

    Parameters
    ----------
    axis
        Where to draw.
    rows
        The points of a branch, in their order.
    column
        A column of the sweep table, e.g. ``rms_y_m``.
    x
        Column of the horizontal axis.
    color, label
        Of the line and its markers.
    size
        Factor of the line's width and the markers' size.

    Returns
    -------
    Axes
        The same axis.
    """
    rows = rows.reset_index(drop=True)
    drawn = _prepared(branch_series(rows, "", color, size), _ended(placed(rows, x)), motions_of(rows))
    count = len(axis.lines)
    _draw(axis, drawn, _ended(in_units(rows[column], column)), wraps=column == PHASE_COLUMN)
    if label is not None:
        axis.lines[count].set_label(label)
    axis.autoscale_view()
    return name_axis(axis, column)


def draw_section(
    axis: Axes, points: pd.DataFrame, column: str, *, x: str = EXCITATION, factor: float = 1.0, **look: Any
) -> Axes:
    """Draw points of a table ``section`` or ``impacts`` over frequency; in PDF and SVG they are dots of an image."""
    style: dict[str, Any] = {"ls": "", "marker": "o", "ms": 1.6, "mew": 0.0, "rasterized": len(points) > 2000} | look
    axis.plot(points[x], factor * points[column], **style)
    return axis


# -- tiles, bars, stacks, planes ---------------------------------------------------------------------------------------


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
    axis.set_yticks(rows[::every], [f"{value:.4g}" for value in grid.index[::every]])
    axis.grid(visible=False)
    return axis


def _edges(values: FloatArray) -> FloatArray:
    """Return the edges of tiles around ascending values: half way, of values in equal ratios by their logarithms."""
    if in_ratios(values):
        return np.exp(_edges(np.log(values)))
    half = 0.5 * np.diff(values) if len(values) > 1 else 0.01 * np.abs(values) + 1e-9
    return np.concatenate([[values[0] - half[0]], values[:-1] + half[: len(values) - 1], [values[-1] + half[-1]]])


def _coloured(panel: Panel, points: pd.DataFrame) -> tuple[FloatArray, Any, Normalize]:
    """Return the number by which each point is coloured, the colours and their norm."""
    if panel.classes:
        numbers = points[panel.by].map({name: float(i) for i, name in enumerate(panel.classes)})
        colours: Any = ListedColormap([colour for colour, _ in panel.classes.values()])
        return np.asarray(numbers, dtype=float), colours, Normalize(-0.5, len(panel.classes) - 0.5)
    values = np.asarray(points[panel.by].to_numpy(dtype=float, na_value=np.nan))
    known = values[np.isfinite(values)]
    dark = colormaps["viridis_r"](np.linspace(0.05, 1.0, 256))  # from small values, pale, to large ones, dark
    if panel.least is not None:  # what is none is white
        dark[0] = 1.0
        return values, ListedColormap(dark), Normalize(0.0, panel.least)
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    return values, ListedColormap(dark), Normalize(low, high)


def _tiles(axis: Axes, picture: Picture, panel: Panel, x: str, shown: Sequence[Series]) -> None:
    """Draw tiles, and lines over them; beyond the first and the last row there are none."""
    points, (values, colours, norm) = picture.points, _coloured(panel, picture.points)
    rows = np.concatenate([series.rows for series in shown if series.mode == "dots"])
    table = points.iloc[rows]
    draw_map(axis, table, panel.column, pd.Series(values[rows], table.index), colours, norm, x=x)
    levels = np.unique(table[panel.column])
    across, up = _ended(points[x]), _ended(points[panel.column])
    for series in (series for series in shown if series.mode == "lines"):
        places = np.interp(up[series.rows], levels, np.arange(len(levels)), left=np.nan, right=np.nan)
        outlined = [Stroke(linewidth=2.3 * series.width, foreground="white"), Normal()]
        look: dict[str, Any] = {
            "color": series.colour,
            "lw": 0.9 * series.width,
            "ls": series.dash,
            "path_effects": outlined,
        }
        axis.plot(across[series.rows], places, scalex=False, scaley=False, **look)


def _bars(axis: Axes, picture: Picture, panel: Panel, x: str, shown: Sequence[Series]) -> None:
    """Draw horizontal bars of the first rows, which are the largest."""
    own = picture.points.iloc[shown[0].rows[:BARS]] if shown else picture.points.iloc[:0]
    places, values = np.arange(len(own)), own[x].to_numpy(float)
    axis.barh(places, values, color=[BLUE if value > 0.0 else VERMILION for value in values], height=0.7)
    axis.set_yticks(places, [key_name(key) for key in own[panel.column]], fontsize=8.0)
    axis.set_ylim(max(min(max(len(s.rows) for s in picture.series), BARS) if picture.series else 1, 4) - 0.4, -0.6)
    axis.axvline(0.0, color=REFERENCE, lw=0.8)
    axis.grid(visible=False, axis="y")


def _stack(axis: Axes, picture: Picture, panel: Panel, x: str, shown: Sequence[Series]) -> None:
    """Stack fractions over a key; bars say how well each is known from so many starts."""
    points, below = picture.points, pd.Series(0.0, np.unique(picture.points[x]))
    values = below.index.to_numpy(float)
    for series in shown:
        own = points.iloc[series.rows].set_index(x).reindex(values)
        share, low, high = (own[f"{panel.column}{end}"].astype(float) for end in ("", "_low", "_high"))
        top = below + share.fillna(0.0)
        if len(values) > 1:
            axis.fill_between(values, below, top, color=series.colour, alpha=0.55, linewidth=0.0)
        else:
            axis.bar(values, top - below, bottom=below, width=0.1, color=series.colour, alpha=0.55)
        known = (top < 1.0 - 1e-9).to_numpy()  # the uppermost is what the others leave
        bars = np.array([share - low, high - share])[:, known]
        look: dict[str, Any] = {"fmt": ".", "markersize": 3.0, "linewidth": 0.8, "capsize": 1.5}
        axis.errorbar(values[known], top[known], bars, color=series.colour, **look)
        below = top
    axis.margins(x=0.0 if len(values) > 1 else None)


def _plane(axis: Axes, picture: Picture, panel: Panel, _: str, shown: Sequence[Series]) -> None:
    """Draw complex numbers and the unit circle; say how many lie farther away than the frame."""
    points, angle = picture.points, np.linspace(0.0, 2.0 * np.pi, 361)
    axis.plot(np.cos(angle), np.sin(angle), color=REFERENCE, lw=1.0)
    farthest = points[[panel.x, panel.column]].abs().max().max()
    frame = float(np.clip(np.nan_to_num(1.05 * farthest), NEAREST, FARTHEST))
    own = points.iloc[np.concatenate([series.rows for series in shown if series.mode == "dots"])]
    real, imaginary, by = (own[name].to_numpy(float) for name in (panel.x, panel.column, panel.by))
    far = (np.abs(real) > frame) | (np.abs(imaginary) > frame)
    norm = Normalize(float(points[panel.by].min()), float(points[panel.by].max()))
    look: dict[str, Any] = {"s": 7.0, "cmap": "viridis", "norm": norm, "linewidths": 0.0}
    axis.scatter(real[~far], imaginary[~far], c=by[~far], **look)
    if far.any():
        told = f"{int(far.sum()) // 2} farther away"  # each is there with its conjugate
        axis.text(0.02, 0.02, told, transform=axis.transAxes, fontsize=8, color=REFERENCE)
    axis.set(xlabel=f"{panel.x} part", aspect="equal", xlim=(-frame, frame), ylim=(-frame, frame))
    if axis.get_subplotspec().is_last_col() or len(picture.facets) < 2:  # type: ignore[union-attr]
        row = [one for one in axis.figure.axes if one.get_ylim() == axis.get_ylim() and one.get_aspect() == 1.0]
        axis.figure.colorbar(ScalarMappable(norm, "viridis"), ax=row, pad=0.01).set_label(key_label(panel.by))


def _place(size: Any) -> Any:
    """Return where a multiplier's size is on its axis, on which those near 1, which decide on stability, have room."""
    return np.arcsinh((size - 1.0) / NEAR_ONE)


def _size(place: Any) -> Any:
    """Return the size of a multiplier at a place of its axis, the inverse of :func:`_place`."""
    return 1.0 + NEAR_ONE * np.sinh(place)


def _near_one(axis: Axes) -> None:
    """Give an axis ticks of sizes, those near 1 first, as many as there is room for."""
    (low, high), kept = axis.get_ylim(), list[float]()
    for tick in _SIZE_TICKS:
        distances = [abs(_place(tick) - _place(other)) for other in kept]
        if low <= tick <= high and min(distances, default=np.inf) > 0.05 * (_place(high) - _place(low)):
            kept.append(tick)
    axis.yaxis.set_major_locator(FixedLocator(kept))
    axis.yaxis.set_major_formatter("{x:g}")


# -- the figure --------------------------------------------------------------------------------------------------------


def draw_picture(picture: Picture, x: str = "", data: Measured | None = None) -> Figure:
    """Draw a picture over the first of its axes, or another column, with measured data laid over it."""
    x = x or picture.axes[0]
    picture = _in_units(picture, x)
    figure, cells = _cells(picture, x)
    prepared = [_prepared(series, _ended(picture.points[x]), _states(picture)) for series in picture.series]
    for axis, panel, series, behind in cells:
        _panel(axis, picture, panel, x, [prepared[n] for n in series], [prepared[n] for n in behind])
        if data is not None:
            data.draw(axis, x, panel.column)
            _limit(axis, panel, picture.points)
    first = cells[0][0]
    if picture.log(x) and not picture.counted and picture.panels[0].kind not in ("tiles", "bars"):
        in_decades(next(axis for axis, panel, *_ in cells if not panel.x), "x")  # that all share
    if x == "start":
        first.xaxis.set_major_locator(MaxNLocator(integer=True))
    head(figure, picture.title, picture.told)
    if picture.scale:
        values = picture.points[picture.scale]
        norm = Normalize(float(values.min()), float(values.max()))
        dark = ListedColormap(colormaps["viridis"](np.linspace(0.0, 0.9, 256)))
        bar = figure.colorbar(ScalarMappable(norm, dark), ax=figure.axes, aspect=50, pad=0.01)
        bar.set_label(key_label(picture.scale))
    measured = [line for axis in figure.axes for line in axis.get_legend_handles_labels()[0]][:1]
    legend_below(figure, [*legend_of(picture), *(measured if data is not None else [])])
    return figure


def _in_units(picture: Picture, x: str) -> Picture:
    """Return a picture whose drawn columns are in the units of their axes."""
    names = {x, *(name for panel in picture.panels for name in (panel.column, panel.x, panel.by))}
    numbers = [name for name in names if name in picture.points and is_number(picture.points[name])]
    return replace(picture, drawn=picture.points.assign(**{n: in_units(picture.points[n], n) for n in numbers}))


def _states(picture: Picture) -> Any:
    return np.zeros(0, dtype=int) if picture.states is None else picture.states


def _cells(picture: Picture, x: str) -> tuple[Figure, list[tuple[Axes, Panel, Sequence[int], Sequence[int]]]]:
    """Return a figure and its panels, each with the numbers of its series and of those behind them."""
    panels, facets = [p for p in picture.panels if p.column != x or picture.counted], picture.facets
    whole = range(len(picture.series))
    label = key_label(x) if x in (EXCITATION, SUPPLY) or "." in x or picture.facets else _label(x)
    high = any(panel.kind in ("tiles", "plane") for panel in panels) or picture.high
    if len(facets) > 1 and len(panels) > 1:
        size = (max(8.0, 1.5 + 4.3 * len(facets)), 1.4 + (3.4 if high else 2.9) * len(panels))
        share = any(panel.kind == "plane" for panel in panels)
        figure, axes = new_figure(len(panels), len(facets), size, sharex=not share, sharey="row")
        cells = [
            (axis, panel, facet.series, facet.behind)
            for row, panel in zip(axes, panels, strict=True)
            for axis, facet in zip(row, facets, strict=True)
        ]
        for axis, panel, *_ in cells:
            if panel.title or axis in axes[0]:
                axis.set_title(facets[axis.get_subplotspec().colspan.start].label, loc="left")
        for axis in axes[-1]:
            axis.set_xlabel(label)
        return figure, cells
    count, many = max(len(panels), len(facets), 1), picture.counted or len(facets) > 1 or high
    shown = [(panels[0], facet.series, facet.behind) for facet in facets] if len(facets) > 1 else None
    shown = shown or [(p, facets[0].series if facets else whole, facets[0].behind if facets else ()) for p in panels]
    if many:
        across = min(count, ACROSS)
        figure, axes = new_figure(
            -(-count // across), across, (max(4.4 * across, 6.0), 0.9 + (4.2 if high else 2.6) * -(-count // across))
        )
        grid = list(axes.ravel())
        for axis in grid[count:]:
            axis.set_axis_off()
        for axis, (panel, *_) in zip(grid, shown, strict=False):
            own = _label(panel.column) if picture.counted else panel.label if panel.kind == "bars" else label
            axis.set_xlabel(own)
    else:
        two = count > 5
        size = (11.0 if two else 8.0, 1.9 + (4.0 if count == 1 else 1.75) * -(-count // (1 + two)))
        figure, grid = panel_grid(count, 1 + two, size, label)
    for axis, facet in zip(grid, facets, strict=False):
        axis.set_title(facet.label, loc="left")
    return figure, [(axis, *one) for axis, one in zip(grid, shown, strict=False)]


def _label(column: str) -> str:
    """Return what a column is called on an axis, with its unit."""
    return quantity_of(column).label if column in QUANTITIES or column.endswith("_m") else key_label(column)


def _panel(axis: Axes, picture: Picture, panel: Panel, x: str, shown: list[_Drawn], behind: list[_Drawn]) -> None:
    """Draw what a panel shows, and name its axis."""
    points, series = picture.points, [one.series for one in shown]
    draw: Any = _DRAWERS.get("counts" if picture.counted else panel.kind)
    if draw is not None:
        draw(axis, picture, panel, x, series)
    elif panel.by:
        _dots(axis, picture, panel, x, series)
    else:
        _curves(axis, picture, panel, x, shown, behind)
    if not picture.counted and (axis.get_subplotspec().is_first_col() or len(picture.facets) < 2):  # type: ignore[union-attr]
        _name(axis, panel)
    _references(axis, picture, panel, x)
    _limit(axis, panel, points)
    if panel.column == PHASE_COLUMN and not picture.counted:
        tell_shaking(axis, picture.rotation)
    if panel.by and panel.kind != "plane" and not picture.counted:
        _explain(axis, picture, panel)
    if panel.title:
        own = axis.get_title(loc="left")
        axis.set_title(f"{panel.title}, {own}" if own else panel.title, loc="left")


def _curves(axis: Axes, picture: Picture, panel: Panel, x: str, shown: list[_Drawn], behind: list[_Drawn]) -> None:
    """Draw series and marks."""
    if panel.scale == "one":
        axis.set_yscale("function", functions=(_place, _size))
        axis.update_datalim([(0.0, 1.0)], updatex=False)
    y = _ended(picture.points[panel.column])
    for one in behind:
        _draw(axis, one, y, colour=BEHIND)
    for one in shown:
        _draw(axis, one, y, wraps=panel.column == PHASE_COLUMN)
    for mark in picture.marks:
        look: dict[str, Any] = {
            "mfc": mark.colour or "white",
            "mec": mark.colour or BLACK,
            "mew": 1.1,
            "zorder": 4.0,
            "ls": "",
        }
        places = picture.points[x].iloc[[*mark.rows]]
        axis.plot(places, y[mark.rows], marker=mark.symbol, ms=11.0 if mark.colour else 5.0, **look)
    axis.autoscale_view()


def _name(axis: Axes, panel: Panel) -> None:
    """Label a vertical axis."""
    if panel.kind == "bars":
        return
    if panel.label and not (panel.by and panel.kind != "plane"):
        axis.set_ylabel(panel.label)
    elif panel.column in QUANTITIES or (panel.kind == "points" and "." not in panel.column and not panel.by):
        name_axis(axis, panel.column)
    else:
        axis.set_ylabel(key_label(panel.column))


def _histogram(axis: Axes, picture: Picture, panel: Panel, _: str, series: Sequence[Series]) -> None:
    """Draw how often the values of a measure occur, in the colours of its classes."""
    own = picture.points.iloc[np.concatenate([one.rows for one in series])]
    values = own[panel.column].to_numpy(dtype=float, na_value=np.nan)
    parts = [values[(own[panel.by] == name).to_numpy() & np.isfinite(values)] for name in panel.classes]
    if any(len(part) for part in parts):
        axis.hist(parts, bins=BINS, stacked=True, color=[colour for colour, _ in panel.classes.values()])
    axis.xaxis.set_major_locator(MaxNLocator(5))
    axis.set_ylabel("samples")


def _dots(axis: Axes, picture: Picture, panel: Panel, x: str, series: Sequence[Series]) -> None:
    """Draw dots in the colours of their classes, or along a scale."""
    rows = np.concatenate([one.rows for one in series])
    values, colours, norm = _coloured(panel, picture.points)
    own, size = picture.points.iloc[rows], float(np.clip(4e4 / max(len(rows), 1), 3.0, 40.0))
    look: dict[str, Any] = {"cmap": colours.with_extremes(bad="0.85"), "norm": norm, "linewidths": 0.0}
    axis.scatter(own[x], own[panel.column], c=values[rows], s=size, plotnonfinite=True, **look)
    axis.grid(visible=False)


_DRAWERS: Mapping[str, Any] = {"counts": _histogram, "tiles": _tiles, "bars": _bars, "stack": _stack, "plane": _plane}


def _references(axis: Axes, picture: Picture, panel: Panel, x: str) -> None:
    """Draw lines of reference and shade intervals."""
    over = panel.column if picture.counted else panel.x or x
    for line in picture.lines:
        draw: Any = axis.axvline if line.column == over else axis.axhline if line.column == panel.column else None
        for value in in_units(list(line.at), line.column) if draw else ():
            draw(value, color=REFERENCE, lw=0.9, ls=line.dash, zorder=1.5)
    for one in picture.ranges:
        if one.column == over:
            axis.axvspan(one.low, one.high, color=REFERENCE, alpha=_SHADE, lw=0.0, zorder=0.5)


def _limit(axis: Axes, panel: Panel, points: pd.DataFrame) -> None:
    """Begin axes of what is never negative at 0, and draw small quantities small, instead of magnified to noise."""
    if panel.kind not in ("points", "stack") or panel.by:
        return
    if panel.scale == "log":
        in_decades(axis, "y")
    elif panel.scale == "one":
        _near_one(axis)
    elif panel.kind == "stack":
        axis.set_ylim(0.0, 1.0)
    elif panel.least is not None:
        begin_at_zero(axis, max(axis.get_ylim()[1], float(in_units(panel.least, panel.column))))
    elif panel.column != PHASE_COLUMN:
        widen_ticks(axis, "y")


def _explain(axis: Axes, picture: Picture, panel: Panel) -> None:
    """Say what the scale of a panel's colours means; classes of several kinds have a legend below each."""
    if not panel.classes and (axis.get_subplotspec().is_last_col() or len(picture.facets) < 2):  # type: ignore[union-attr]
        _, colours, norm = _coloured(panel, picture.points)
        bar = axis.figure.colorbar(ScalarMappable(norm, colours), ax=axis, aspect=40)
        bar.set_label(panel.label or quantity_of(panel.by).label)


# -- legends -----------------------------------------------------------------------------------------------------------


def legend_of(picture: Picture) -> list[Any]:
    """Return the entries of a legend: what colours, lines, fillings and marks mean, of those that the picture needs."""
    series, entries = picture.series, list[Any]()
    labels = {one.label: one for one in reversed(series) if one.label}
    names = dict.fromkeys(one.label for one in series if one.label)
    if not picture.scale:
        entries += few([_labelled(labels[name]) for name in names])
    for panel in picture.panels:
        rows = np.concatenate([one.rows for one in series if one.mode == "dots"] or [np.zeros(0, dtype=int)])
        known = picture.points[panel.by].iloc[rows] if panel.classes else pd.Series(dtype=object)
        if panel.kind == "tiles" and (_states(picture) == STATES.index("failed")).any():
            entries.append(Patch(facecolor="white", edgecolor="black", hatch=_HATCH, lw=0.3, label="failed"))
        entries += [
            Patch(color=colour, label=label) for name, (colour, label) in panel.classes.items() if (known == name).any()
        ]
    entries += _looks(picture)
    for mark in picture.marks:
        look = {"ls": "", "mfc": mark.colour or "white", "mec": mark.colour or BLACK, "mew": 1.1, "ms": 6.0}
        entries.append(entry(": ".join(filter(None, (mark.kind, mark.meaning))), marker=mark.symbol, **look))
    entries += [
        entry(line.label, color=REFERENCE, lw=0.9, ls=line.dash) for line in picture.lines if line.label and line.at
    ]
    entries += [entry(one.label, color=REFERENCE, alpha=_SHADE, lw=5.0) for one in picture.ranges]
    if picture.facets and any(facet.behind for facet in picture.facets):
        entries.append(entry("the other direction", color=BEHIND, marker="o", ls="", ms=4.0, mew=0.0))
    return entries


def _labelled(one: Series) -> Line2D:
    """Return the entry of what a colour means."""
    if one.mode in ("markers", "dots"):
        return entry(one.label, color=one.colour, marker=one.symbol, ls="", ms=4.0)
    return entry(one.label, color=one.colour, lw=2.0, ls=one.dash if one.mode == "lines" and not one.look else "-")


def _looks(picture: Picture) -> Iterator[Line2D]:
    """Yield entries of what lines and symbols mean, and of what is known of points."""
    looks = {one.look: one for one in picture.series if one.look}
    for name, one in looks.items():
        colour = BEHIND if one.colour == BEHIND else REFERENCE
        line = {"ls": one.dash if one.mode in ("lines", "both") else "", "lw": 0.9 * one.width, "color": colour}
        marker = {} if one.mode == "lines" else {"marker": one.symbol, "ms": 4.5 * one.size}
        yield entry(name, alpha=0.5 if one.pale else None, **line, **marker)
    marked = [one.rows[one.rows != BROKEN] for one in picture.series if one.mode in ("both", "markers")]
    rows, states = np.concatenate([*marked, np.zeros(0, dtype=int)]), _states(picture)
    found = [name for number, name in enumerate(STATES) if (states[rows[rows < len(states)]] == number).any()]
    for name in found if found != ["full"] else ():
        look = {"fillstyle": _FILLINGS[name], "markerfacecoloralt": "white", "color": BLACK, "ls": "", "ms": 6.0}
        yield entry(picture.meanings[name], **(_CROSS if name == "failed" else look | {"marker": "o", "mew": 0.7}))


def marker_legend(table: pd.DataFrame) -> Iterator[Line2D]:
    """Yield the entries of a legend that say what markers of a sweep mean, of those that a table needs."""
    table = table.reset_index(drop=True)
    series = [branch_series(rows) for _, rows in table.groupby("direction", sort=False)]
    yield from _looks(Picture("response", "", "", table, "", [EXCITATION], [], series, states=motions_of(table)))
