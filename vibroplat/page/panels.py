"""Panels of pictures: each kind draws what the data model of pictures says into a drawing of the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from contourpy import contour_generator

from vibroplat.config.circular import ranked, shown_value
from vibroplat.page.svg import Floats, Plot, Scale, plain_text
from vibroplat.page.text import escape
from vibroplat.page.view import (
    View,
    axis_name,
    colour_classes,
    dashes,
    heading,
    isolated_points,
    places_of,
)
from vibroplat.results.labels import halfway, in_ratios, key_name
from vibroplat.results.legend import HALF, Entry, legend_of_strips
from vibroplat.results.picture import (
    BLACK,
    FAILED,
    FULL,
    LOST,
    LOW,
    REFERENCE,
    VERMILION,
    Facet,
    Panel,
    Series,
    Strip,
    StripSpan,
    on_axis,
)

#: Signs of matplotlib's markers.
SIGNS = dict(zip("osD^vXP*", "○□◇△▽✕✚★", strict=True))
#: What columns of classes are called.
_CALLED = {"sync": "synchronization"}
#: Numbers of the page's hatches by matplotlib's.
HATCHES = {"/////": 0, "....": 2}
#: Samples up to which dots are large, and failed points that are marked.
MAX_MARKED = 400
#: Width of a band of a single point.
BAND_WIDTH = 5.0


def entry_html(one: Entry) -> str:
    """Return an entry of a legend."""
    text, meaning = escape(plain_text(one.text)), f' title="{escape(one.more)}"' if one.more else ""
    if one.kind == "line" and one.dash == "-" and not one.symbol and one.colour != REFERENCE:
        return f'<em style="color:{one.colour}">{text}</em>'
    sample = ""
    if one.kind == "line":
        look = f"stroke:{one.colour};stroke-width:1.6;stroke-dasharray:{dashes(one.dash) or 'none'}"
        sample = f'<svg width="26" height="8"><path d="M0 4H26" style="{look}"/></svg>'
    elif one.hatch:
        size, number = 'width="600" height="480"', HATCHES.get(one.hatch, "")
        area = f'<rect {size} fill="#777"/><rect {size} fill="url(#hatch-{number})"/>'
        sample = f'<svg width="18" height="12" viewBox="0 0 600 480">{area}</svg>'
    elif one.kind == "area":
        opacity = one.opacity if one.opacity < HALF else 1.0
        sample = f'<b class="box" style="background:{one.colour};opacity:{opacity:g}"></b>'
    if one.symbol:
        sample += f'<b style="color:{one.colour}">{SIGNS.get(one.symbol, "◆")}</b>'
    return f"<span{meaning}>{sample} {text}</span>"


def figures(view: View, facet: Facet | None) -> list[str]:
    """Return the figures of all panels, of a facet or of all series."""
    all_of = list(view.picture.series)
    numbers = range(len(all_of)) if facet is None else facet.series
    shown = [all_of[n] for n in numbers]
    html = strips(view, facet) if facet is None or facet.strips or facet is view.picture.facets[0] else []
    for panel in view.picture.panels:
        if panel.column == (panel.x or view.axis) and panel.kind == "points":
            continue
        titled = replace(panel, title=facet.label) if facet is not None and panel.kind == "bars" else panel
        if len(places_of(shown)):
            html.append(_KINDS[panel.kind](view, titled, shown).html())
    return html


def points(view: View, panel: Panel, shown: Sequence[Series]) -> Plot:
    """Draw curves and dots."""
    column, x_column = panel.column, panel.x or view.axis
    own = [one for one in shown if not one.of or column in one.of]
    places = places_of(own)
    x_values, y_values = view.values(x_column), view.values(column)
    bands = [one for one in own if one.mode == "band"]
    low = view.values(f"{column}{LOW}")[places_of(bands)]
    y = view.scale(column, np.append(view.reached(column, places), low), least=panel.least, log=panel.scale == "log")
    plot = view.plot(panel, view.across(panel, shown), y)
    for one in bands:
        _band(view, plot, column, one, x_values)
    for one in (one for one in own if one.mode == "shade"):
        for part in np.split(one.places, np.flatnonzero(one.places < 0)):
            ends = x_values[part[part >= 0][[0, -1]]] if (part >= 0).any() else (0.0, 0.0)
            plot.box((ends[0], ends[1]), (y.low, y.high), one.colour, one.label)
    for one in (one for one in own if one.mode not in ("band", "shade")):
        if panel.by and one.mode == "dots":
            own_places = places_of([one])
            _draw_classes(view, plot, panel, own_places, x_values[own_places], y_values[own_places])
        else:
            _series(view, plot, one, x_values, y_values)
    for jump in view.picture.jumps:
        if column in jump.of:
            plot.jump(x_values[[jump.before, jump.after]], y_values[[jump.before, jump.after]], jump.colour)
    for mark in view.picture.marks:
        for row in mark.rows:
            plot.mark(x_values[row], y_values[row], mark.kind, SIGNS.get(mark.symbol, "◆"), mark.colour)
    # Where all series are drawn, points that belong to none can be clicked as well.
    whole = len(shown) == len(view.picture.series)
    places = np.arange(len(x_values)) if whole else np.unique(places_of(own))
    view.hits(plot, x_values[places], y_values[places], places)
    return plot


def _band(view: View, plot: Plot, column: str, series: Series, x: Floats) -> None:
    """Draw what lies between a column and its lower ends, in parts; one of a single point is a bar."""
    name, low, high = plain_text(series.label), view.values(f"{column}{LOW}"), view.values(column)
    for places in np.split(series.places, np.flatnonzero(series.places < 0)):
        part = places[places >= 0]
        if len(part) == 1:
            ends = [low[part[0]], high[part[0]]]
            plot.curve(x[part].repeat(2), ends, name, series.colour, width=BAND_WIDTH, pale=True)
        else:
            plot.band(x[part], low[part], high[part], name, series.colour)


def _series(view: View, plot: Plot, series: Series, x: Floats, y: Floats) -> None:
    """Draw a series: its line, and dots where there is none or where points are not as usual."""
    name = ", ".join(filter(None, (plain_text(series.label), plain_text(series.look))))
    places = places_of([series])
    if series.mode == "stems":
        ends, ups = (
            np.stack(of, axis=1).ravel() for of in ([x[places]] * 3, [0.0 * y[places], y[places], np.nan * x[places]])
        )
        plot.curve(ends, ups, "", series.colour, width=1.0)
    state = np.append(view.picture.states, np.full(len(x), FULL))[places]
    full = (state == FULL) | (series.mode == "dots")
    odd = ~full & (state != LOST) & (series.mode != "lines")
    size = {"dots": 3.0, "markers": 5.5 * min(series.size, 1.2)}.get(series.mode, 5.0)
    if series.mode in ("lines", "both"):
        rows = series.places
        line_x, line_y = (np.where(rows >= 0, values[np.maximum(rows, 0)], np.nan) for values in (x, y))
        width, dash = 1.3 * min(series.width, 1.3), dashes(series.dash)
        plot.curve(line_x, line_y, name, series.colour, dash=dash, width=width, pale=series.pale)
        full, name = isolated_points(np.isfinite(line_x) & np.isfinite(line_y), rows), ""
    plot.dots(x[places[full]], y[places[full]], name, series.colour, size=size, pale=series.pale)
    label = "" if full.any() else name
    plot.dots(x[places[odd]], y[places[odd]], label, series.colour, size=size, hollow=True, pale=series.pale)
    lost = places[state == LOST]
    for point in lost[:MAX_MARKED]:
        plot.mark(x[point], y[point] if np.isfinite(y[point]) else plot.y.low, "failed", "✕", FAILED)


def _draw_classes(view: View, plot: Plot, panel: Panel, places: Any, x: Floats, y: Floats, colour: str = "") -> None:
    """Draw dots at some places in the colours of a column, or in one where the panel has none."""
    looks = colour_classes(panel, view.picture, places) if panel.by else [("", colour, slice(None))]
    for name, own, chosen in looks:
        plot.dots(x[chosen], y[chosen], name, own, size=5.0 if len(places) <= MAX_MARKED else 3.2)


def tiles(view: View, panel: Panel, shown: Sequence[Series]) -> Plot:
    """Draw a tile for each point, in rows that are evenly spaced; neighbours of one colour are one."""
    across, up = view.values(panel.x or view.axis), view.values(panel.column)
    places = places_of([one for one in shown if one.mode == "dots"])
    places = places[np.isfinite(across[places]) & np.isfinite(up[places])]
    if not len(places):
        return view.plot(panel, Scale(0.0, 1.0), Scale(0.0, 1.0))
    levels, over = np.unique(up[places]), np.unique(across[places])
    at = np.searchsorted(levels, up[places])
    unit, factor = view.picture.unit(panel.column)
    ends, column = halfway(over), panel.x or view.axis
    x = Scale(ends[0], ends[-1], *view.picture.unit(column), label=axis_name(column), log=in_ratios(over))
    y = Scale(-0.5, len(levels) - 0.5, unit, names=[f"{level * factor:.4g}" for level in levels])
    title = plain_text(panel.title or panel.label) or _CALLED.get(panel.by) or axis_name(panel.by)
    plot = view.plot(panel, x, y, f"{title}; upwards: {axis_name(panel.column)}")
    points = view.picture.points
    looks = colour_classes(panel, view.picture)
    kinds = np.select([chosen for *_, chosen in looks], [name for name, *_ in looks], "")
    classes = {name: (colour, name) for name, colour, _ in looks}
    hatched = points[panel.hatch].to_numpy(dtype=object) if panel.hatch else np.full(len(points), "")
    for row in range(len(levels)):
        own = places[at == row]
        strip = Strip("", "", own.tolist(), kinds[own].tolist(), hatched[own].tolist())
        _spans(plot, row, strip.spans(across), classes, panel.hatches, 0.49)
    if panel.contours and min(len(levels), len(over)) > 1:
        grid: Any = np.full((len(levels), len(over)), np.nan)
        grid[at, np.searchsorted(over, across[places])] = view.values(panel.contours.column)[places]
        drawing = contour_generator(over, np.arange(len(levels)), np.ma.masked_invalid(grid))
        for level, (text, dash) in panel.contours.levels.items():
            for line in map(np.asarray, drawing.lines(level)):
                plot.curve(line[:, 0], line[:, 1], plain_text(text), BLACK, dash=dashes(dash), width=1.2)
    for word in view.picture.words:
        if word.column == panel.column:
            row_of = float(np.interp(word.y, levels, np.arange(len(levels))))
            plot.word(word.x, row_of, plain_text(word.text), word.colour)
    for one in (one for one in shown if one.mode != "dots"):
        known = np.maximum(one.places, 0)
        height = np.interp(up[known], levels, np.arange(len(levels)), np.nan, np.nan)
        over_x, over_y = (np.where(one.places >= 0, values, np.nan) for values in (across[known], height))
        plot.curve(over_x, over_y, plain_text(one.label), one.colour, dash=dashes(one.dash), width=1.3 * one.width)
    view.hits(plot, across[places], at.astype(float), places)
    return plot


def _spans(
    plot: Plot,
    row: float,
    spans: Sequence[StripSpan],
    classes: Mapping[str, tuple[str, str]],
    hatches: Mapping[str, str],
    half: float,
) -> None:
    """Draw the intervals of a row: colours, hatches, lines below and texts."""
    up = (row - half, row + half)
    for span in spans:
        colour, meaning = classes.get(span.kind, ("", ""))
        across = (max(span.low, plot.x.low), min(span.high, plot.x.high))
        if colour:
            plot.box(across, up, colour, plain_text(meaning))
        if span.hatch in hatches:
            plot.box(across, up, f"url(#hatch-{HATCHES[span.hatch]})", hatches[span.hatch])
        if span.lined:
            plot.box(across, (row + 0.38, row + 0.46), "#000")
        if span.text:
            plot.word(0.5 * (span.low + span.high), row, span.text, "#fff" if colour else "#222")


def bars(view: View, panel: Panel, shown: Sequence[Series]) -> Plot:
    """Draw horizontal bars over words, the first one on top."""
    places = places_of(shown)
    values = view.values(view.axis)[places]
    words = [plain_text(key_name(str(word))) for word in view.picture.points[panel.column].iloc[places]]
    x = view.scale(view.axis, np.append(values, 0.0), label=plain_text(panel.label) or axis_name(view.axis))
    y = Scale(len(words) - 0.5, -0.5, names=words)
    plot = view.plot(panel, x, y, heading(panel))
    plot.look, plot.height = "picture bars", f"--h:{22 * max(len(words), 1) + 6}px"
    for row, value in enumerate(values):
        colour = shown[0].colour if value >= 0.0 else VERMILION
        plot.box((0.0, float(value)), (row - 0.34, row + 0.34), colour, f"{words[row]}: {value:.3g}")
    plot.rule(x=0.0, dash="none")
    return plot


def stack(view: View, panel: Panel, shown: Sequence[Series]) -> Plot:
    """Draw fractions on each other."""
    plot = view.plot(panel, view.across(panel, shown), Scale(0.0, 1.0, "%", 100.0))
    x, y = view.values(view.axis), view.values(panel.column)
    over = np.unique(x[np.isfinite(x)])
    below = np.zeros(len(over))
    spots: list[tuple[Floats, Floats, Any]] = []
    for one in shown:
        places = places_of([one])
        heights = pd.Series(y[places], x[places]).groupby(level=0).sum().reindex(over).fillna(0.0).to_numpy()
        plot.band(over, below, below + heights, plain_text(one.label), one.colour)
        spots.append((x[places], np.interp(x[places], over, below) + 0.5 * y[places], places))
        below = below + heights
    view.hits(plot, *(np.concatenate(part) for part in zip(*spots, strict=True)))
    return plot


def ranks(view: View, panel: Panel, shown: Sequence[Series]) -> Plot:
    """Draw each point a dot in the order of its values, over which stands the share of those not larger."""
    places = places_of(shown)
    values = view.values(panel.column)
    places = places[np.isfinite(values[places])]
    fractions = (0.05, 0.5, 0.95)
    ranks, quantiles = ranked(panel.column, values[places], fractions)
    order = places[ranks]
    shares = (np.arange(len(order)) + 0.5) / max(len(order), 1)
    x = view.scale(panel.column, view.reached(panel.column, order), label=axis_name(panel.column))
    plot = view.plot(replace(panel, column="", x=panel.column), x, Scale(0.0, 1.0, "%", 100.0), heading(panel))
    _draw_classes(view, plot, panel, order, values[order], shares, shown[0].colour)
    for fraction, value in zip(fractions, quantiles.tolist(), strict=False):
        text = shown_value(panel.column, value, float(np.abs(values[order]).max()))
        plot.mark(float(on_axis(panel.column, value)), fraction, f"{100 * fraction:g} %: {text}")
    view.hits(plot, values[order], shares, order)
    return plot


def strips(view: View, facet: Facet | None = None) -> list[str]:
    """Return what happens along branches, as strips over the axis, one below the other."""
    strips = view.picture.strips
    if strips is None:
        return []
    at, shown = view.values(view.axis), strips.of(facet)
    spans = [strip.spans(at) for strip in shown]
    if not any(spans):
        return []
    x = view.across(Panel(view.axis), view.picture.series)
    y = Scale(len(spans) - 0.5, -0.5, names=[plain_text(strip.label) for strip in shown])
    plot = Plot(plain_text(strips.label), x, y, "picture strips")
    plot.height = f"--h:{24 * len(spans) + 6}px"
    plot.key = [entry_html(one) for one in legend_of_strips(strips)]
    for row, row_spans in enumerate(spans):
        _spans(plot, row, row_spans, strips.classes, strips.hatches, 0.36)
    places = np.concatenate([np.asarray(strip.rows, dtype=int) for strip in shown])
    rows = np.repeat(np.arange(len(spans), dtype=float), [len(strip.rows) for strip in shown])
    view.hits(plot, at[places], rows, places)
    return [plot.html()]


_KINDS: Mapping[str, Callable[[View, Panel, Sequence[Series]], Plot]] = {
    "points": points,
    "plane": points,
    "tiles": tiles,
    "bars": bars,
    "stack": stack,
    "ranks": ranks,
}
