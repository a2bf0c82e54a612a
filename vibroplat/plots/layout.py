"""Where the panels of a picture are: in rows and columns, below strips."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from vibroplat.columns import QUANTITIES, quantity_of
from vibroplat.plots.strips import height_of
from vibroplat.plots.style import below_strips, new_figure
from vibroplat.results.labels import EXCITATION, SUPPLY, key_label
from vibroplat.results.picture import Facet, Panel, Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Panels beside each other at most, and dots in their order.
ACROSS, RANKS = 3, 4
#: Panels that are wide enough for two columns.
TWO = 5


class Cell(NamedTuple):
    """A panel in its axis, with the numbers of its series and of those behind them."""

    axis: Axes
    panel: Panel
    series: Sequence[int]
    behind: Sequence[int]


def label_of(column: str) -> str:
    """Return what a column is called on an axis, with its unit."""
    return quantity_of(column).label if column in QUANTITIES or column.endswith("_m") else key_label(column)


def cells_of(picture: Picture, x: str) -> tuple[Figure, Axes | None, list[Cell]]:
    """Return a figure, the axis of its strips and its panels."""
    panels = [panel for panel in picture.panels if panel.column != x or panel.kind == "ranks"]
    panels = panels or ([*picture.panels[:1]] if picture.strips is None else [])
    facets = picture.facets or (Facet("", range(len(picture.series))),)
    label = key_label(x) if x in (EXCITATION, SUPPLY) or "." in x or picture.facets else label_of(x)
    kinds = {panel.kind for panel in panels}
    if len(panels) > 1 and (len(facets) > 1 or "plane" in kinds):
        return _in_rows(picture, panels, facets, label)
    if len(facets) > 1 or kinds & {"tiles", "bars", "ranks", "plane"} or (picture.high and len(panels) == 1):
        return _beside(picture, panels, facets, label)
    two = len(panels) > TWO
    rows, each = -(-len(panels) // (1 + two)), 4.0 if len(panels) == 1 else 2.6 if picture.high else 1.75
    figure, axes, strip = below_strips(rows, 1 + two, (11.0 if two else 8.0, 1.5 + each * rows), height_of(picture))
    grid = list(axes.T.ravel())
    if len(panels) % 2 and two:  # on top, so that all columns end alike
        empty = grid.pop(rows)
        empty.set_axis_off()
    if strip is not None and two:
        strip.tick_params(labelbottom=True)
    for axis in [*{grid[rows - 1], grid[-1]}] if panels else [strip]:
        axis.set_xlabel(label)
        axis.tick_params(labelbottom=True)
    return figure, strip, [Cell(axis, panel, *facets[0][1:]) for axis, panel in zip(grid, panels, strict=False)]


def _in_rows(
    picture: Picture, panels: Sequence[Panel], facets: Sequence[Facet], label: str
) -> tuple[Figure, Axes | None, list[Cell]]:
    """Return a row for each panel and a column for each facet."""
    high = picture.high or any(panel.kind in ("tiles", "plane") for panel in panels)
    share = not any(panel.kind == "plane" for panel in panels)
    size = (max(8.0 if share else 5.8, 1.5 + 4.3 * len(facets)), 1.4 + (3.4 if high else 2.9) * len(panels))
    above = height_of(picture)
    figure, axes, strip = below_strips(len(panels), len(facets), size, above, sharex=share, sharey=True)
    cells = [
        Cell(axis, panel, facet.series, facet.behind)
        for row, panel in zip(axes, panels, strict=True)
        for axis, facet in zip(row, facets, strict=True)
    ]
    for axis, panel, *_ in cells:
        if panel.title or axis in axes[0]:
            axis.set_title(facets[axis.get_subplotspec().colspan.start].label, loc="left")  # type: ignore[union-attr]
    for axis in axes[-1]:
        axis.set_xlabel(label)
    return figure, strip, cells


def _beside(
    picture: Picture, panels: Sequence[Panel], facets: Sequence[Facet], label: str
) -> tuple[Figure, Axes | None, list[Cell]]:
    """Return panels beside each other, each with an axis of its own."""
    shown = [(panel, facet) for panel in panels for facet in facets]
    ranks = any(panel.kind == "ranks" for panel in panels)
    across = min(max(len(shown), 1), RANKS if ranks else ACROSS)
    down = -(-max(len(shown), 1) // across)
    high = picture.high or any(panel.kind in ("tiles", "plane") for panel in panels)
    width = 2.9 if ranks else 4.4
    figure, axes = new_figure(down, across, (max(width * across, 7.5), 0.9 + (4.2 if high else 2.8) * down))
    grid = list(axes.ravel())
    for axis in grid[len(shown) :]:
        axis.set_axis_off()
    cells = [Cell(axis, panel, f.series, f.behind) for axis, (panel, f) in zip(grid, shown, strict=False)]
    for (axis, panel, *_), (_, facet) in zip(cells, shown, strict=True):
        own = label_of(panel.column) if panel.kind == "ranks" else panel.label if panel.kind == "bars" else label
        axis.set_xlabel(own)
        if len(facets) > 1:
            axis.set_title(facet.label, loc="left")
    return figure, None, cells
