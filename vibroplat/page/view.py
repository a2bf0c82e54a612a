"""A picture over one of its axes: its values, axes and colours, and drawings for its panels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.columns import AXIS_NAMES, indexed_name
from vibroplat.page.machine import base64_of
from vibroplat.page.svg import COLUMNS, Floats, Plot, Scale, plain_text
from vibroplat.results.picture import REFERENCE, Panel, Picture, Series, on_axis, shade

#: Patterns of lines by matplotlib's names, in points of the screen.
_DASHES = {"-": "", "--": "6 3", ":": "1.5 3", "-.": "7 3 1.5 3"}
#: Most points of all curves of a picture: half a megabyte; and parts of the width that a curve has at least.
MOST_POINTS, FEW_COLUMNS = 50_000, 100
#: Colours of a scale, from small values, pale, to large ones.
SHADES = 12


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
        return np.asarray(on_axis(column, points[column].to_numpy(dtype=float, na_value=np.nan)))

    def scale(self, column: str, values: Floats, **look: Any) -> Scale:
        """Return an axis of a column with room for some values."""
        return Scale.of(values, *self.picture.unit(column), **look)

    def across(self, panel: Panel, series: Sequence[Series]) -> Scale:
        """Return the horizontal axis, the same for all panels of a picture, or of a facet with an axis of its own."""
        column = panel.x or self.axis
        own = panel.x or any(facet.width for facet in self.picture.facets)
        shown = series if own else self.picture.series
        values = self.reached(column, places_of(shown) if shown else np.arange(len(self.picture.points)))
        return self.scale(column, values, label=axis_name(column), log=self.picture.log(column))

    def reached(self, column: str, places: Any) -> Floats:
        """Return the values of a column at some places, and those of lines of reference that are not far away."""
        values = self.values(column)[places]
        lines = [on_axis(column, value) for line in self.picture.lines if line.column == column for value in line.at]
        known = values[np.isfinite(values)]
        if known.size:
            room = max(float(np.ptp(known)), 0.1 * abs(float(known.max())))
            lines = [one for one in lines if known.min() - room <= one <= known.max() + room]
        return np.append(values, lines)

    # -- drawings -----------------------------------------------------------------------------------

    def plot(self, panel: Panel, x: Scale, y: Scale, title: str = "") -> Plot:
        """Return the drawing of a panel, with lines of reference, shaded intervals and words."""
        plot = Plot(title or heading(panel), x, y, "picture")
        curves = max(len(self.picture.series) * len(self.picture.panels), 1)
        plot.columns = min(max(MOST_POINTS // (4 * curves), FEW_COLUMNS), COLUMNS)
        plot.height, plot.note = "--h:300px" if self.picture.high else "", plain_text(panel.note)
        column = panel.x or self.axis
        for one in self.picture.ranges:
            if one.column == column:
                plot.box((max(one.low, x.low), min(one.high, x.high)), (y.low, y.high), REFERENCE, one.label, 0.15)
        for line in self.picture.lines:
            for text, value in zip([line.label, *[""] * len(line.at)], line.at, strict=False):
                if line.column == panel.column and panel.kind != "bars":
                    plot.rule(plain_text(text), y=float(on_axis(line.column, value)), dash=dashes(line.dash))
                elif line.column == column:
                    plot.rule(plain_text(text), x=value, dash=dashes(line.dash))
        for word in self.picture.words:
            if word.column == panel.column and not y.names:
                plot.word(word.x, word.y, plain_text(word.text), word.colour)
        return plot

    def hits(self, plot: Plot, x: Any, y: Any, places: Any) -> None:
        """Let points of a drawing be found by a click: their numbers on the page, and where they are."""
        across, up, numbers = plot.x.share(x), plot.y.share(y), self.renumbered[places]
        inside = [np.isfinite(part) & (np.abs(part - 0.5) <= 0.51) for part in (across, up)]
        good = inside[0] & inside[1] & (numbers >= 0)
        parts = [numbers[good], np.clip(across[good], 0, 1) * 65535, (1.0 - np.clip(up[good], 0, 1)) * 65535]
        plot.hits = base64_of(np.concatenate(parts))


# -- words and values --------------------------------------------------------------------------------------------------


def axis_name(column: str) -> str:
    """Return what a column is called on an axis, without its unit; in words where a symbol has an index."""
    name = AXIS_NAMES.get(column, "")
    return indexed_name(column) if "_" in name or not name else plain_text(name)


def heading(panel: Panel, *, whole: bool = False) -> str:
    """Return the heading of a panel: its title, else the label of its axis; both if ``whole``."""
    label, title = plain_text(panel.label), plain_text(panel.title)
    return (": ".join(filter(None, (label, title))) if whole else title or label) or axis_name(panel.column)


def dashes(dash: Any) -> str:
    """Return a style of lines as the lengths of its dashes and gaps."""
    if isinstance(dash, str):
        return _DASHES.get(dash, "6 3")
    return " ".join(f"{1.3 * part:g}" for part in dash[1])


def places_of(series: Sequence[Series]) -> Any:
    """Return the places of some series."""
    parts = [one.places[one.places >= 0] for one in series]
    return np.concatenate(parts) if parts else np.zeros(0, dtype=int)


def isolated_points(known: Any, rows: Any) -> Any:
    """Return which points of a series, gaps left out, have no neighbour on its line."""
    left, right = np.append(False, known[:-1]), np.append(known[1:], False)
    return (known & ~left & ~right)[rows >= 0]


def colour_classes(panel: Panel, picture: Picture, places: Any = slice(None)) -> list[tuple[str, str, Any]]:
    """Return names, colours and which of some places have them: by classes of a column, or along a scale."""
    by, (unit, factor) = picture.points[panel.by].iloc[places], picture.unit(panel.by)
    if panel.classes:
        named = [(plain_text(text or name), colour, name) for name, (colour, text) in panel.classes.items()]
        classes = [(text, colour, (by == name).to_numpy()) for text, colour, name in named]
        return [one for one in classes if one[2].any()]
    values = by.to_numpy(dtype=float, na_value=np.nan)
    low, high = ends_of_scale(panel, values)
    step = np.clip(np.floor((values - low) / ((high - low) or 1.0) * SHADES), 0, SHADES - 1)
    classes = [("none", "#d9d9d9", ~np.isfinite(values))]
    if panel.least is not None:  # white where there is nothing
        classes.append((f"0 {unit}".strip(), "#f4f4f4", values == 0.0))
        step = np.where(values == 0.0, -1, step)
    ends = factor * np.linspace(low, high, SHADES + 1)
    for number in range(SHADES):
        text = f"{ends[number]:.3g} … {ends[number + 1]:.3g} {unit}".strip()
        classes.append((text, shade(1.0 - (number + 0.5) / SHADES), step == number))
    return [one for one in classes if one[2].any()]


def ends_of_scale(panel: Panel, values: Floats) -> tuple[float, float]:
    """Return the ends of a scale of colours."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    return (low, high) if panel.least is None else (0.0, panel.least)
