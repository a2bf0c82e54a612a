"""Draws pictures in print: the panels of each, with what they have in common below them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
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
from matplotlib.ticker import MaxNLocator

from vibroplat.columns import PHASE_COLUMN, QUANTITIES, quantity_of
from vibroplat.plots.layout import cells_of
from vibroplat.plots.measured import Measured, curve_of
from vibroplat.plots.panels import DRAWERS, HATCH, coloured, ended, placed_by_size, size_at, tick_sizes
from vibroplat.plots.strips import PALE, draw_jumps, draw_strips, draw_words, entries_of
from vibroplat.plots.style import TOLD, begin_at_zero, entry, few, head, in_decades, legend_below, widen_ticks
from vibroplat.plots.timelines import in_units, name_axis, tell_shaking
from vibroplat.results.content import motions_of
from vibroplat.results.labels import EXCITATION, is_number, key_label
from vibroplat.results.picture import (
    BEHIND,
    BLACK,
    BLUE,
    BROKEN,
    FAILED,
    REFERENCE,
    STATES,
    Mark,
    Panel,
    Picture,
    Series,
)
from vibroplat.study.curves import branch_series, failed_of, marked_series, open_of, placed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vibroplat.kernels.compiled import FloatArray

#: Fillings of markers by the state of a point.
_FILLINGS = dict(zip(STATES, ("full", "none", "bottom", "none"), strict=True))
_CROSS: Mapping[str, Any] = {"marker": "x", "ls": "", "color": FAILED, "ms": 5.0, "mew": 1.4}
#: Most entries of a legend in the place of a panel that is left empty.
MOST_WITHIN = 11
#: Opacity of intervals that are shaded.
_SHADE = 0.15


# -- series ------------------------------------------------------------------------------------------------------------


class _Drawn(NamedTuple):
    """A series with what all panels share, found once: places on the horizontal axis, and the states of its points."""

    series: Series
    x: FloatArray
    states: list[tuple[str, Any]]


def _prepared(series: Series, x: FloatArray, states: Any) -> _Drawn:
    """Prepare a series for its panels; the numbers of ``x`` end as :func:`ended` says."""
    known = np.zeros(len(x), dtype=int)
    known[: len(states)] = states
    own = np.where(series.places == BROKEN, -1, known[series.places])
    found = [(name, own == number) for number, name in enumerate(STATES) if (own == number).any()]
    return _Drawn(series, x[series.places], found)


def _draw(axis: Axes, drawn: _Drawn, y: FloatArray, *, wraps: bool = False, colour: str = "") -> None:
    """Draw a series; its axis is scaled once, after the last one.

    Lines are added as such, which takes half as long as ``plot``: there may be thousands.
    """
    series, x = drawn.series, drawn.x
    y = y[series.places]
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
        axis.plot(x[known], y[known], "o", ms=1.6 * series.size, mew=0.0, rasterized=len(x) > 2000, **style)
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

    It is solid, and dashed on the way down. Jumps are left open. Where the motion does not repeat, points are open
    circles, half-full ones where that is undecided; points that failed are crosses on the horizontal axis.

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
        Of the line.
    size
        Factor of its width.

    Returns
    -------
    Axes
        The same axis.
    """
    rows = rows.reset_index(drop=True)
    drawn = _prepared(branch_series(rows, "", color, size), ended(placed(rows, x)), motions_of(rows))
    count, y = len(axis.lines), ended(in_units(rows[column], column))
    _draw(axis, drawn, y, wraps=column == PHASE_COLUMN)
    for marked in marked_series(rows, color, open_of(rows) | failed_of(rows), size):
        _draw(axis, _prepared(marked, ended(placed(rows, x)), motions_of(rows)), y)
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


# -- the figure --------------------------------------------------------------------------------------------------------


def draw_picture(picture: Picture, x: str = "", data: Measured | None = None) -> Figure:
    """Draw a picture over the first of its axes, or another column, with measured data laid over it."""
    x = x or picture.axes[0]
    computed, picture = picture.points, _in_units(picture, x)
    figure, strip, cells = cells_of(picture, x)
    if strip is not None:
        draw_strips(strip, picture, x)
    prepared = [_prepared(series, ended(picture.points[x]), picture.states) for series in picture.series]
    for axis, panel, *numbers in cells:
        shown, behind = ([prepared[n] for n in own if _within(picture.series[n], panel)] for own in numbers)
        _panel(axis, picture, panel, x, shown, behind)
        if data is not None:
            places = [picture.series[n].places for n in numbers[0]]
            curves = [curve_of(computed.iloc[rows[rows != BROKEN]], panel.column, x) for rows in places]
            data.compare(panel.column, x, curves)
            data.draw(axis, x, panel.column)
            _limit(axis, panel, picture.points)
    first = cells[0].axis if cells else strip
    assert first is not None
    if picture.log(x) and not {panel.kind for panel in picture.panels} & {"tiles", "bars", "ranks"}:
        in_decades(next((axis for axis, panel, *_ in cells if not panel.x), first), "x")  # that all share
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
    entries = [*legend_of(picture), *(measured if data is not None else [])]
    empty = next((axis for axis in figure.axes if not axis.axison), None)
    if empty is not None and len(cells) > 1 and len(entries) <= MOST_WITHIN:
        empty.legend(handles=entries, loc="center", fontsize=8.0)
    else:
        legend_below(figure, entries)
    return figure


def _in_units(picture: Picture, x: str) -> Picture:
    """Return a picture whose drawn columns are in the units of their axes."""
    names = {x, *(name for panel in picture.panels for name in (panel.column, panel.x, panel.by))}
    numbers = [name for name in names if name in picture.points and is_number(picture.points[name])]
    return replace(picture, drawn=picture.points.assign(**{n: in_units(picture.points[n], n) for n in numbers}))


def _within(series: Series, panel: Panel) -> bool:
    """Whether a series is in a panel."""
    return not series.of or panel.column in series.of


def _panel(axis: Axes, picture: Picture, panel: Panel, x: str, shown: list[_Drawn], behind: list[_Drawn]) -> None:
    """Draw what a panel shows, and name its axis."""
    points, series = picture.points, [one.series for one in shown]
    kind = "dots" if panel.by and panel.kind == "points" else panel.kind
    if kind in DRAWERS:
        DRAWERS[kind](axis, picture, panel, x, series)
    else:
        _curves(axis, picture, panel, x, shown, behind)
    if kind != "ranks" and (axis.get_subplotspec().is_first_col() or len(picture.facets) < 2):  # type: ignore[union-attr]
        _name(axis, panel)
    _references(axis, picture, panel, x)
    _limit(axis, panel, points)
    if panel.column == PHASE_COLUMN and kind != "ranks":
        tell_shaking(axis, picture.rotation)
    if kind in ("points", "dots", "tiles") and not picture.log(x):
        widen_ticks(axis, "x")
    draw_words(axis, picture, panel.column, x)
    if panel.note:
        axis.set_title(panel.note, loc="right", fontsize=8.0, color=TOLD)
    if panel.by and panel.kind not in ("plane", "ranks"):
        _explain(axis, picture, panel)
    if panel.title:
        own = axis.get_title(loc="left")
        axis.set_title(f"{panel.title}, {own}" if own else panel.title, loc="left")


def _curves(axis: Axes, picture: Picture, panel: Panel, x: str, shown: list[_Drawn], behind: list[_Drawn]) -> None:
    """Draw series and marks."""
    if panel.scale == "one":
        axis.set_yscale("function", functions=(placed_by_size, size_at))
        axis.update_datalim([(0.0, 1.0)], updatex=False)
    y = ended(picture.points[panel.column])
    for one in behind:
        _draw(axis, one, y, colour=BEHIND)
    for one in shown:
        _draw(axis, one, y, wraps=panel.column == PHASE_COLUMN)
    draw_jumps(axis, picture, panel.column, x)
    for mark in picture.marks:
        places, size = picture.points[x].iloc[[*mark.rows]], 8.0 if mark.colour else 3.6
        axis.plot(places, y[mark.rows], zorder=4.0, **_marked(mark) | {"ms": size})
    axis.autoscale_view()


def _marked(mark: Mark) -> dict[str, Any]:
    """Return the look of special points."""
    edge, filling = mark.colour or BLACK, mark.colour or "white"
    return {"marker": mark.symbol, "ls": "", "mfc": filling, "mec": edge, "mew": 0.8, "ms": 5.0}


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


def _references(axis: Axes, picture: Picture, panel: Panel, x: str) -> None:
    """Draw lines of reference and shade intervals."""
    over = panel.column if panel.kind == "ranks" else panel.x or x
    for line in picture.lines:
        draw: Any = axis.axvline if line.column == over else axis.axhline if line.column == panel.column else None
        for value in in_units(list(line.at), line.column) if draw else ():
            draw(value, color=line.colour, lw=0.9, ls=line.dash, zorder=1.5)
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
        tick_sizes(axis)
    elif panel.kind == "stack":
        axis.set_ylim(0.0, 1.0)
    elif panel.least is not None and not axis.dataLim.y1 < 0.0:
        begin_at_zero(axis, max(axis.get_ylim()[1], float(in_units(panel.least, panel.column))))
    elif panel.column != PHASE_COLUMN:
        widen_ticks(axis, "y")


def _explain(axis: Axes, picture: Picture, panel: Panel) -> None:
    """Say what the scale of a panel's colours means; classes of several kinds have a legend below each."""
    if not panel.classes and (axis.get_subplotspec().is_last_col() or len(picture.facets) < 2):  # type: ignore[union-attr]
        _, colours, norm = coloured(panel, picture.points)
        bar = axis.figure.colorbar(ScalarMappable(norm, colours), ax=axis, aspect=40)
        bar.set_label(panel.label or quantity_of(panel.by).label)


# -- legends -----------------------------------------------------------------------------------------------------------


def legend_of(picture: Picture) -> list[Any]:
    """Return the entries of a legend: what colours, lines, fillings and marks mean, of those that the picture needs."""
    series, entries = picture.series, [] if picture.strips is None else [*entries_of(picture.strips)]
    labels = {one.label: one for one in reversed(series) if one.label}
    names = dict.fromkeys(one.label for one in series if one.label)
    if not picture.scale:
        entries += few([_labelled(labels[name]) for name in names])
    for panel in picture.panels:
        rows = np.concatenate([one.places for one in series if one.mode == "dots"] or [np.zeros(0, dtype=int)])
        known = picture.points[panel.by].iloc[rows] if panel.classes else pd.Series(dtype=object)
        if panel.kind == "tiles" and (picture.states == STATES.index("failed")).any():
            entries.append(Patch(facecolor="white", edgecolor="black", hatch=HATCH, lw=0.3, label="failed"))
        entries += [
            Patch(facecolor=colour, alpha=PALE if panel.kind == "tiles" else 1.0, label=label)
            for name, (colour, label) in panel.classes.items()
            if (known == name).any()
        ]
        entries += [Patch(fc="white", ec="black", hatch=hatch, lw=0.3, label=t) for hatch, t in panel.hatches.items()]
        for dash, told in panel.contours.levels.values() if panel.contours else ():
            entries.append(entry(told, color=BLACK, lw=0.9, ls=dash))
    entries += _looks(picture)
    if picture.jumps:
        entries.append(entry("jump", color=REFERENCE, lw=0.6, ls=":", marker="^", ms=3.0, mew=0.0))
    for mark in picture.marks:
        entries.append(entry(": ".join(filter(None, (mark.kind, mark.meaning))), **_marked(mark)))
    entries += [
        entry(line.label, color=line.colour, lw=0.9, ls=line.dash) for line in picture.lines if line.label and line.at
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
    marked = [one.places[one.places != BROKEN] for one in picture.series if one.mode in ("both", "markers")]
    rows, states = np.concatenate([*marked, np.zeros(0, dtype=int)]), picture.states
    found = [name for number, name in enumerate(STATES) if (states[rows[rows < len(states)]] == number).any()]
    for name in found if found != ["full"] else ():
        look = {"marker": "o", "ls": "", "color": BLACK, "ms": 6.0, "mew": 0.7, "markerfacecoloralt": "white"}
        look = dict(_CROSS) if name == "failed" else look | {"fillstyle": _FILLINGS[name]}
        if meaning := picture.meanings[STATES.index(name)]:
            yield entry(meaning, **look)


def marker_legend(table: pd.DataFrame) -> Iterator[Line2D]:
    """Yield the entries of a legend that say what markers of a sweep mean, of those that a table needs."""
    table = table.reset_index(drop=True)
    series = [branch_series(rows) for _, rows in table.groupby("direction", sort=False)]
    series += marked_series(table, BLACK, open_of(table) | failed_of(table))
    yield from _looks(Picture("response", "", "", table, "", [EXCITATION], [], series, states=motions_of(table)))
