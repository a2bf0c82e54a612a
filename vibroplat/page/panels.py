"""Panels of pictures: each kind draws what the data model of pictures says into a drawing of the page."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.columns import PHASE_COLUMN, display_name, indexed_name, quantity_of, unit_of
from vibroplat.config.digits import quantity
from vibroplat.page.run import wrapped
from vibroplat.page.svg import Floats, Plot, Scale, plain_text, unit_for
from vibroplat.results.picture import BEHIND, FULL, LOST, REFERENCE, VERMILION, Facet, Panel, Picture, Series, shade

#: Patterns of lines by matplotlib's names, in points of the screen.
_DASHES = {"-": "", "--": "6 3", ":": "1.5 3", "-.": "7 3 1.5 3"}
#: Signs of matplotlib's markers.
SIGNS = dict(zip("osD^vXP*", "○□◇△▽✕✚★", strict=True))
#: Colours of a scale, from small values, pale, to large ones.
SHADES = 12
#: Samples up to which dots are large and named.
FEW = 400


@dataclass(frozen=True)
class View:
    """A picture over one axis, of which some places are rows on the page.

    Attributes
    ----------
    picture, axis
        The picture and the column of its horizontal axis.
    renumbered
        For each place its number among those on the page, negative if it is none of them.
    """

    picture: Picture
    axis: str
    renumbered: Any

    # -- values and axes ----------------------------------------------------------------------------

    def values(self, column: str) -> Floats:
        """Return the numbers of a column at all places, phases from -90° to 270°."""
        points = self.picture.points
        if column not in points or not pd.api.types.is_numeric_dtype(points[column]):
            return np.full(len(points), np.nan)
        found: Floats = points[column].to_numpy(dtype=float, na_value=np.nan)
        return wrapped(found) if column == PHASE_COLUMN else found

    def across(self, panel: Panel, series: Sequence[Series]) -> Scale:
        """Return the horizontal axis, the same for all panels of a picture."""
        column = panel.x or self.axis
        shown = series if panel.x else self.picture.series
        places = _places(shown)
        for line in () if panel.x else self.picture.lines:
            if line.column == column:
                return Scale.of(
                    np.append(self.values(column)[places], np.asarray(line.at, dtype=float)),
                    column,
                    label=axis_name(column),
                )
        return Scale.of(self.values(column)[places], column, label=axis_name(column), log=self.picture.log(column))

    # -- figures ------------------------------------------------------------------------------------

    def figures(self, facet: Facet | None) -> list[str]:
        """Return the figures of all panels, of a facet or of all series."""
        all_of = list(self.picture.series)
        numbers = range(len(all_of)) if facet is None else facet.series
        shown, behind = [all_of[n] for n in numbers], [all_of[n] for n in facet.behind] if facet else []
        found = self.strips() if facet is None or facet is self.picture.facets[0] else []
        for panel in self.picture.panels:
            if panel.column == (panel.x or self.axis) and panel.kind == "points":
                continue
            named = plain_text(facet.label) if facet is not None and panel.kind == "bars" else ""
            if any(len(_places([one])) for one in shown):
                found.append(_KINDS[panel.kind](self, panel, shown, behind, named).html())
        return found

    def _plot(self, panel: Panel, x: Scale, y: Scale, title: str = "") -> Plot:
        """Return the drawing of a panel, with lines of reference, shaded intervals and words."""
        plot = Plot(title or heading(panel), x, y, "picture")
        plot.height = "--h:300px" if self.picture.high else ""
        column = panel.x or self.axis
        for one in self.picture.ranges:
            if one.column == column:
                plot.box((max(one.low, x.low), min(one.high, x.high)), (y.low, y.high), REFERENCE, one.label, 0.15)
        for line in self.picture.lines:
            for number, value in enumerate(line.at):
                text = (getattr(line, "text", "") or line.label) if not number else ""
                if line.column == panel.column and panel.kind != "bars":
                    plot.rule(plain_text(text), y=_shown(line.column, value), dash=dashes(line.dash))
                elif line.column == column:
                    plot.rule(plain_text(text), x=value, dash=dashes(line.dash))
        for word in getattr(self.picture, "words", ()):
            if word.column == panel.column:
                plot.word(word.x, word.y, plain_text(word.text), word.colour)
        return plot

    def hits(self, plot: Plot, x: Any, y: Any, places: Any) -> None:
        """Let points of a drawing be found by a click: their numbers on the page, and where they are."""
        across, up, numbers = plot.x.share(x), plot.y.share(y), self.renumbered[places]
        good = np.isfinite(across) & np.isfinite(up) & (numbers >= 0) & (across >= -0.01) & (across <= 1.01)
        parts = [numbers[good], np.clip(across[good], 0, 1) * 65535, (1.0 - np.clip(up[good], 0, 1)) * 65535]
        plot.hits = base64.b64encode(np.concatenate(parts).round().astype("<u2").tobytes()).decode("ascii")

    # -- kinds of panels ----------------------------------------------------------------------------

    def points(self, panel: Panel, shown: Sequence[Series], behind: Sequence[Series], _: str) -> Plot:
        """Draw curves and dots."""
        column, x_column = panel.column, panel.x or self.axis
        own = [one for one in shown if not getattr(one, "of", ()) or column in getattr(one, "of", ())]
        places = _places([*own, *behind])
        lines = [_shown(column, v) for line in self.picture.lines if line.column == column for v in line.at]
        y = Scale.of(
            np.append(self.values(column)[places], near(lines, self.values(column)[places])),
            column,
            least=panel.least,
            log=panel.scale == "log",
        )
        plot = self._plot(panel, self.across(panel, shown), y)
        x_values, y_values = self.values(x_column), self.values(column)
        for one in behind:
            plot.dots(x_values[_places([one])], y_values[_places([one])], "", BEHIND, size=2.5)
        for one in own:
            if panel.by and one.mode == "dots":
                self._classed(plot, panel, one)
            else:
                self._series(plot, one, x_values, y_values)
        for jump in getattr(self.picture, "jumps", ()):
            if column in jump.of:
                plot.jump(x_values[[jump.before, jump.after]], y_values[[jump.before, jump.after]], jump.colour)
        for mark in self.picture.marks:
            for place in mark.rows:
                plot.mark(x_values[place], y_values[place], mark.kind, SIGNS.get(mark.symbol, "◆"), mark.colour)
        places = np.unique(
            np.concatenate([_places(own), *(np.asarray(mark.rows, dtype=int) for mark in self.picture.marks)])
        )
        self.hits(plot, x_values[places], y_values[places], places)
        return plot

    def _series(self, plot: Plot, series: Series, x: Floats, y: Floats) -> None:
        """Draw a series: its line, and dots where there is none or where points are not as usual."""
        name = ", ".join(filter(None, (plain_text(series.label), plain_text(series.look))))
        places = _places([series])
        states = self.picture.states
        state = (
            np.zeros(len(places), dtype=int)
            if states is None
            else np.append(states, [0] * len(self.picture.points))[places]
        )
        if series.mode in ("lines", "both"):
            rows = series.places
            line_x, line_y = (np.where(rows >= 0, values[np.maximum(rows, 0)], np.nan) for values in (x, y))
            alone = places[_alone(np.isfinite(line_x) & np.isfinite(line_y), rows)]
            if plot.y.unit == "°":
                line_x, line_y = unwrapped(line_x, line_y)
            plot.curve(
                line_x,
                line_y,
                name,
                series.colour,
                dash=dashes(series.dash),
                width=1.3 * min(series.width, 1.3),
                pale=series.pale,
            )
            plot.dots(x[alone], y[alone], "", series.colour, size=5.0)
            odd = (state != FULL) & (state != LOST) & (series.mode == "both")
            plot.dots(x[places[odd]], y[places[odd]], "", series.colour, size=5.0, hollow=True, pale=series.pale)
        else:
            size = 3.0 if series.mode == "dots" else 5.5 * min(series.size, 1.2)
            full = (state == FULL) | (series.mode == "dots")
            plot.dots(x[places[full]], y[places[full]], name, series.colour, size=size, pale=series.pale)
            odd = ~full & (state != LOST)
            plot.dots(x[places[odd]], y[places[odd]], "" if full.any() else name, series.colour, size=size, hollow=True)
        lost = places[state == LOST]
        for place in lost[:FEW]:
            plot.mark(x[place], y[place] if np.isfinite(y[place]) else plot.y.low, "failed", "✕", "#a00000")

    def _classed(self, plot: Plot, panel: Panel, series: Series) -> None:
        """Draw dots in the colours of a column."""
        places = _places([series])
        x, y = self.values(panel.x or self.axis)[places], self.values(panel.column)[places]
        size = 5.0 if len(places) <= FEW else 3.2
        for name, colour, chosen in coloured(panel, self.picture.points.iloc[places]):
            plot.dots(x[chosen], y[chosen], name, colour, size=size)

    def tiles(self, panel: Panel, shown: Sequence[Series], _: Sequence[Series], __: str) -> Plot:
        """Draw a tile for each point, in rows that are evenly spaced; neighbours of one colour are one."""
        places = _places([one for one in shown if one.mode == "dots"])
        points, x_values = self.picture.points, self.values(panel.x or self.axis)
        rows = self.values(panel.column)
        levels = np.unique(rows[places][np.isfinite(rows[places])])
        over = np.unique(x_values[places][np.isfinite(x_values[places])])
        if not (len(levels) and len(over)):
            return self._plot(panel, Scale(0.0, 1.0), Scale(0.0, 1.0))
        unit, factor = unit_for(panel.column, float(np.abs(levels).max()))
        ends, (x_unit, x_factor) = edges(over), unit_for(self.axis, float(over[-1]))
        x = Scale(ends[0], ends[-1], x_unit, x_factor, label=axis_name(panel.x or self.axis))
        y = Scale(-0.5, len(levels) - 0.5, unit, names=[f"{level * factor:.4g}" for level in levels])
        title = plain_text(panel.title or panel.label) or axis_name(panel.by)
        plot = self._plot(panel, x, y, f"{title}; upwards: {axis_name(panel.column)}")
        colours = np.full((len(levels), len(over)), "", dtype=object)
        for name, colour, chosen in coloured(panel, points.iloc[places]):
            known = places[chosen][np.isfinite(x_values[places[chosen]]) & np.isfinite(rows[places[chosen]])]
            colours[np.searchsorted(levels, rows[known]), np.searchsorted(over, x_values[known])] = f"{colour}|{name}"
        for row, cells in enumerate(colours):
            first = 0
            for end in range(1, len(over) + 1):
                if end == len(over) or cells[end] != cells[first]:
                    colour, _, name = cells[first].partition("|")
                    if colour:
                        plot.box((ends[first], ends[end]), (row - 0.49, row + 0.49), colour, name)
                    first = end
        for one in (one for one in shown if one.mode != "dots"):
            rows_of = one.places
            at = np.where(
                rows_of >= 0,
                np.interp(rows[np.maximum(rows_of, 0)], levels, np.arange(len(levels)), np.nan, np.nan),
                np.nan,
            )
            plot.curve(
                np.where(rows_of >= 0, x_values[np.maximum(rows_of, 0)], np.nan),
                at,
                plain_text(one.label),
                one.colour,
                dash=dashes(one.dash),
                width=1.3 * one.width,
            )
        self.hits(plot, x_values[places], np.searchsorted(levels, rows[places]).astype(float), places)
        return plot

    def bars(self, panel: Panel, shown: Sequence[Series], _: Sequence[Series], named: str) -> Plot:
        """Draw horizontal bars over words, the first one on top."""
        places = _places(shown)
        values = self.values(self.axis)[places]
        words = [display_name(str(word)) or str(word) for word in self.picture.points[panel.column].iloc[places]]
        x = Scale.of(np.append(values, 0.0), self.axis, label=plain_text(panel.label) or axis_name(self.axis))
        y = Scale(len(words) - 0.5, -0.5, names=words)
        plot = self._plot(panel, x, y, named or heading(panel))
        plot.look, plot.height = "picture bars", f"--h:{22 * max(len(words), 1) + 6}px"
        for row, value in enumerate(values):
            colour = shown[0].colour if value >= 0.0 else VERMILION
            plot.box((0.0, float(value)), (row - 0.34, row + 0.34), colour, f"{words[row]}: {value:.3g}")
        plot.rule(x=0.0, dash="none")
        return plot

    def stack(self, panel: Panel, shown: Sequence[Series], _: Sequence[Series], __: str) -> Plot:
        """Draw fractions on each other."""
        plot = self._plot(panel, self.across(panel, shown), Scale(0.0, 1.0, "%", 100.0))
        x, y = self.values(self.axis), self.values(panel.column)
        over = np.unique(x[np.isfinite(x)])
        below = np.zeros(len(over))
        spots: list[tuple[Floats, Floats, Any]] = []
        for one in shown:
            places = _places([one])
            share = pd.Series(y[places], x[places]).groupby(level=0).sum().reindex(over).fillna(0.0).to_numpy()
            plot.band(over, below, below + share, plain_text(one.label), one.colour)
            spots.append((x[places], np.interp(x[places], over, below) + 0.5 * y[places], places))
            below = below + share
        self.hits(plot, *(np.concatenate(part) for part in zip(*spots, strict=True)))
        return plot

    def ranks(self, panel: Panel, shown: Sequence[Series], _: Sequence[Series], __: str) -> Plot:
        """Draw each point a dot in the order of its values, over which stands the share of those not larger."""
        places = _places(shown)
        values = self.values(panel.column)
        places = places[np.isfinite(values[places])]
        order = places[np.argsort(values[places], kind="stable")]
        shares = (np.arange(len(order)) + 0.5) / max(len(order), 1)
        lines = [v for line in self.picture.lines if line.column == panel.column for v in line.at]
        unit = quantity_of(panel.column).name
        x = Scale.of(np.append(values[order], near(lines, values[order])), panel.column, label=plain_text(unit))
        plot = Plot(heading(panel), x, Scale(0.0, 1.0, "%", 100.0), "picture")
        for line in self.picture.lines:
            for value in line.at if line.column == panel.column else ():
                plot.rule(plain_text(getattr(line, "text", "") or line.label), x=value, dash=dashes(line.dash))
        at = pd.Series(shares, order)
        for name, colour, chosen in (
            coloured(panel, self.picture.points.iloc[order]) if panel.by else [("", shown[0].colour, slice(None))]
        ):
            own = order[chosen]
            plot.dots(values[own], at[own].to_numpy(), name, colour, size=5.0 if len(order) <= FEW else 3.2)
        for share in (0.05, 0.5, 0.95) if len(order) else ():
            value = float(np.quantile(values[order], share))
            plot.mark(value, share, f"{100 * share:g} %: {quantity(value, unit_of(panel.column))}")
        self.hits(plot, values[order], shares, order)
        return plot

    def strips(self) -> list[str]:
        """Return what happens along branches, as strips over the axis, one below the other."""
        strips = getattr(self.picture, "strips", None)
        if strips is None or not strips.rows:
            return []
        at = self.values(self.axis)
        spans = [strip.spans(at) for strip in strips.rows]
        ends = [end for row in spans for span in row for end in (span.low, span.high)]
        if not ends:
            return []
        x = self.across(Panel(self.axis), self.picture.series)
        y = Scale(len(spans) - 0.5, -0.5, names=[plain_text(strip.label) for strip in strips.rows])
        plot = Plot(plain_text(strips.label), x, y, "picture strips")
        plot.height = f"--h:{24 * len(spans) + 6}px"
        hatches = list(strips.hatches)
        for row, found in enumerate(spans):
            for span in found:
                colour, meaning = strips.classes.get(span.kind, ("", ""))
                ends_of = (max(span.low, x.low), min(span.high, x.high))
                tip = ", ".join(
                    filter(None, (meaning, strips.hatches.get(span.hatch, ""), strips.line if span.lined else ""))
                )
                if colour:
                    plot.box(ends_of, (row - 0.36, row + 0.36), colour, plain_text(tip))
                if span.hatch in hatches:
                    plot.box(ends_of, (row - 0.36, row + 0.36), f"url(#hatch-{hatches.index(span.hatch) % 3})")
                if span.lined:
                    plot.box(ends_of, (row + 0.38, row + 0.46), "#000")
                if span.text:
                    plot.word(0.5 * (span.low + span.high), row, span.text, "#fff" if colour else "#222")
        plot.key = [(plain_text(meaning), colour) for colour, meaning in strips.classes.values()]
        return [plot.html()]


_KINDS: Mapping[str, Callable[[View, Panel, Sequence[Series], Sequence[Series], str], Plot]] = {
    "points": View.points,
    "plane": View.points,
    "tiles": View.tiles,
    "bars": View.bars,
    "stack": View.stack,
    "ranks": View.ranks,
}


# -- words and values --------------------------------------------------------------------------------------------------


def axis_name(column: str) -> str:
    """Return what a column is called on an axis, without its unit."""
    name = plain_text(quantity_of(column).name)
    return indexed_name(column) if name == display_name(column) else name


def heading(panel: Panel, *, bare: bool = False) -> str:
    """Return what is said above a panel."""
    label = plain_text(panel.label)
    told = label.rpartition(" (")[0] if label.endswith(")") else label
    words = plain_text(panel.title) or told or axis_name(panel.column)
    return words if bare or not getattr(panel, "note", "") else f"{words} – {plain_text(panel.note)}"


def _shown(column: str, value: float) -> float:
    return float(wrapped(value)) if column == PHASE_COLUMN else float(value)


def dashes(dash: Any) -> str:
    """Return a style of lines as the lengths of its dashes and gaps."""
    if isinstance(dash, str):
        return _DASHES.get(dash, "6 3")
    return " ".join(f"{1.3 * part:g}" for part in dash[1])


def _places(series: Sequence[Series]) -> Any:
    """Return the places of some series."""
    found = [one.places[one.places >= 0] for one in series]
    return np.concatenate(found) if found else np.zeros(0, dtype=int)


def _alone(known: Any, rows: Any) -> Any:
    """Return which points of a series, gaps left out, have no neighbour on its line."""
    left, right = np.append(False, known[:-1]), np.append(known[1:], False)
    return (known & ~left & ~right)[rows >= 0]


def unwrapped(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Break a line of phases where it jumps by most of a turn."""
    far = np.flatnonzero(np.abs(np.diff(y)) > math.pi) + 1
    return np.insert(x, far, np.nan), np.insert(y, far, np.nan)


def near(lines: Sequence[float], values: Floats) -> list[float]:
    """Return those lines of reference for which an axis has room: not farther away than values spread."""
    known = values[np.isfinite(values)]
    if not known.size:
        return list(lines)
    low, high = float(known.min()), float(known.max())
    room = max(high - low, 0.1 * abs(high))
    return [line for line in lines if low - room <= line <= high + room]


def edges(values: Floats) -> Floats:
    """Return the ends of intervals around values, half way between them."""
    if len(values) < 2:
        return np.array([*(values - 0.5), *(values + 0.5)])
    middle = 0.5 * (values[1:] + values[:-1])
    return np.concatenate([[2.0 * values[0] - middle[0]], middle, [2.0 * values[-1] - middle[-1]]])


def coloured(panel: Panel, points: pd.DataFrame) -> list[tuple[str, str, Any]]:
    """Return names, colours and which points have them: by classes of a column, or along a scale."""
    by = points[panel.by]
    if panel.classes:
        found = [
            (plain_text(told or name), colour, (by == name).to_numpy())
            for name, (colour, told) in panel.classes.items()
        ]
        return [one for one in found if one[2].any()]
    values = by.to_numpy(dtype=float, na_value=np.nan)
    low, high, unit, factor = ends_of_scale(panel, values)
    step = np.clip(np.floor((values - low) / ((high - low) or 1.0) * SHADES), 0, SHADES - 1)
    found = [("none", "#d9d9d9", ~np.isfinite(values))]
    if panel.least is not None:  # white where there is nothing
        found.append((f"0 {unit}".strip(), "#f4f4f4", values == 0.0))
        step = np.where(values == 0.0, -1, step)
    for number in range(SHADES):
        ends = [(low + (high - low) * (number + end) / SHADES) * factor for end in (0, 1)]
        found.append(
            (f"{ends[0]:.3g} … {ends[1]:.3g} {unit}".strip(), shade(1.0 - (number + 0.5) / SHADES), step == number)
        )
    return [one for one in found if one[2].any()]


def ends_of_scale(panel: Panel, values: Floats) -> tuple[float, float, str, float]:
    """Return the ends of a scale of colours, and its unit with the factor to it."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    if panel.least is not None:
        low, high = 0.0, panel.least
    return low, high, *unit_for(panel.by, max(abs(low), abs(high)))
