"""Strips of classes along an axis, arrows of jumps, and texts in panels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.collections import LineCollection

from vibroplat.results.legend import TILE
from vibroplat.results.picture import BLACK, Facet, Panel, Picture, Strip, on_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Height of a strip, of one that is a bar without panels below, and of the space around them (inch).
STRIP, BAR, AROUND = 0.17, 0.36, 0.4
#: Fraction of an axis that a letter takes.
LETTER = 0.011


def height_of(picture: Picture) -> float:
    """Return the height of the strips of a picture (inch)."""
    if picture.strips is None:
        return 0.0
    most = max((len(picture.strips.of(facet)) for facet in picture.facets), default=len(picture.strips.rows))
    return AROUND + (STRIP if picture.panels else BAR) * max(most, 2)


def draw_strips(axis: Axes, picture: Picture, facet: Facet, x: str) -> None:
    """Draw the strips of a facet, one below the other, with their names next to them, over a column."""
    strips = picture.strips
    assert strips is not None
    values, ends, rows = picture.points[x], list[float](), strips.of(facet)
    for number, strip in enumerate(rows):
        spans = strip.spans(values)
        ends += [end for span in spans for end in (span.low, span.high)]
        for look in dict.fromkeys((span.kind, span.hatch) for span in spans):
            own = [(span.low, span.high - span.low) for span in spans if (span.kind, span.hatch) == look]
            colour = strips.classes[look[0]][0] if look[0] in strips.classes else "white"
            axis.broken_barh(own, (-number - 0.36, 0.72), facecolor=colour, alpha=TILE, lw=0.0)
            if look[1]:
                axis.broken_barh(own, (-number - 0.36, 0.72), facecolor="none", hatch=look[1], edgecolor=BLACK, lw=0.0)
        for span in (span for span in spans if span.lined):
            axis.plot([span.low, span.high], [-number - 0.43] * 2, color=BLACK, lw=1.4, solid_capstyle="butt")
    labels = [strip.label for strip in rows]
    axis.set_yticks([-number for number in range(len(labels))], labels, fontsize=8.5)
    for text, strip in zip(axis.get_yticklabels(), rows, strict=False):
        text.set_color(strip.colour)
    if ends and min(ends) < max(ends):
        axis.set_xlim(min(ends), max(ends))
    axis.set(ylim=(0.5 - len(labels), 0.6), ylabel=strips.label if not picture.panels else "")
    axis.grid(visible=False)
    axis.tick_params(axis="y", length=0)
    axis.spines["left"].set_visible(False)
    _tell(axis, rows, values)


def _tell(axis: Axes, rows: Sequence[Strip], values: Any) -> None:
    """Write the texts of intervals above them, as far as there is room."""
    low, high = axis.get_xlim()
    for number, strip in enumerate(rows):
        free = -np.inf
        for span in (span for span in strip.spans(values) if span.text):
            middle = 0.5 * (span.low + span.high)
            half = 0.5 * LETTER * (high - low) * len(span.text)
            if middle - half > free:
                axis.text(middle, -number, span.text, ha="center", va="center", fontsize=7.0)
                free = middle + half


def draw_jumps(axis: Axes, picture: Picture, panel: Panel, x: str) -> None:
    """Draw the jumps that are seen in a panel as thin arrows: dotted lines with a small head."""
    across, up = (picture.points[name].to_numpy(dtype=float, na_value=np.nan) for name in (x, panel.column))
    jumps = [jump for jump in picture.jumps if panel.has(jump.of)]
    lines = [[(across[n], up[n]) for n in (jump.before, jump.after)] for jump in jumps]
    kept = [number for number, line in enumerate(lines) if np.isfinite(line).all()]
    if not kept:
        return
    shown = LineCollection([lines[n] for n in kept], colors=[jumps[n].colour for n in kept], lw=0.6, ls=":")
    axis.add_collection(shown)
    for n in kept:
        (_, begin), (at, end) = lines[n]
        axis.plot(at, end, "^" if end > begin else "v", color=jumps[n].colour, ms=3.0, mew=0.0)


def draw_words(axis: Axes, picture: Picture, column: str, x: str) -> None:
    """Write the texts of a panel at their points or next to them; of tiles at their rows."""
    levels = np.unique(picture.points[column]) if any(panel.kind == "tiles" for panel in picture.panels) else None
    low, high = axis.get_xlim()
    for word in (word for word in picture.words if word.column == column and x == picture.axes[0]):
        at, height = (float(on_axis(name, value)) for value, name in ((word.x, x), (word.y, column)))
        if levels is not None:
            height = float(np.interp(height, levels, np.arange(len(levels))))
        is_left = at < 0.5 * (low + high)
        side = ("left" if is_left else "right") if word.beside else "center"
        axis.annotate(
            word.text, (at, height), ((7.0 if is_left else -7.0) * word.beside, 0.0), textcoords="offset points",
            ha=side, va="center", fontsize=8.0, color=word.colour, in_layout=False, annotation_clip=True,
            bbox={"fc": "white", "ec": "none", "pad": 1.0, "alpha": 0.75},
        )  # fmt: skip
