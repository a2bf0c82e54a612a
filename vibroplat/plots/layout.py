"""Where the panels of a picture are: in rows and columns, below strips."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from vibroplat.plots.axes import label_axis
from vibroplat.plots.strips import height_of
from vibroplat.plots.style import CAPTION_COLOUR, new_figure
from vibroplat.results.picture import Facet, Panel, Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Maximum number of panels in a row, and dots in their order; panels that are wide enough for two columns.
ACROSS, RANKS, TWO = 3, 4, 5


class Cell(NamedTuple):
    """A panel of a facet in its axis; whether it is the first and the last one of its row."""

    axis: Axes
    panel: Panel
    facet: Facet
    is_first: bool
    is_last: bool


class _Grid(NamedTuple):
    """Rows and columns, a size (inch), whether panels share the horizontal and the vertical axis, and widths.

    Panels are column by column (``down``), or row by row.
    """

    rows: int
    columns: int
    size: tuple[float, float]
    sharex: Any
    sharey: Any = False
    widths: Sequence[float] | None = None
    down: bool = False


def _grid(picture: Picture, panels: Sequence[Panel], facets: Sequence[Facet]) -> _Grid:
    """Return how panels are arranged."""
    kinds, count = {panel.kind for panel in panels}, len(panels)
    square, own = bool(kinds & {"tiles", "plane"}), any(panel.x for panel in panels)
    if any(facet.width for facet in facets):
        return _Grid(count, len(facets), (10.0, 1.5 + 1.45 * count), "col", "row", [facet.width for facet in facets])
    if count > 1 and (len(facets) > 1 or "plane" in kinds):
        size = (
            max(5.8 if own else 8.0, 1.5 + 4.3 * len(facets)),
            1.4 + (3.4 if picture.high or square else 2.9) * count,
        )
        return _Grid(count, len(facets), size, not own, "row")
    if len(facets) > 1 or square or kinds & {"bars", "ranks"} or (picture.high and (count == 1 or own)):
        shown = max(count * len(facets), 1)
        across = min(shown, RANKS if "ranks" in kinds else ACROSS)
        down, width = -(-shown // across), 2.9 if "ranks" in kinds else 4.4
        size = (max(width * across, 7.5), 0.9 + (4.2 if picture.high or square else 2.8) * down)
        return _Grid(down, across, size, sharex=False)
    columns = 1 + (count > TWO and not own)
    rows, each = -(-count // columns), 4.0 if count == 1 else 2.6 if picture.high else 1.75
    height = 1.5 + each * sum(panel.height for panel in panels) / columns
    return _Grid(rows, columns, (8.0 if columns == 1 else 11.0, height), not own, down=True)


def cells_of(picture: Picture, x: str) -> tuple[Figure, list[tuple[Axes, Facet]], list[Cell]]:
    """Return a figure, the axes of its strips with their facets, and its panels."""
    panels = [panel for panel in picture.panels if panel.column != x or panel.kind == "ranks"]
    panels = panels or ([*picture.panels[:1]] if picture.strips is None else [])
    facets = picture.facets or (Facet("", range(len(picture.series))),)
    grid = _grid(picture, panels, facets)
    shown = [(panel, facet) for panel in panels for facet in facets]
    heights = [panel.height for panel in panels] if len(panels) == grid.rows else None
    look: dict[str, Any] = {"widths": grid.widths, "heights": heights}
    figure, axes, above = new_figure(
        grid.rows, grid.columns, grid.size, height_of(picture), sharex=grid.sharex, sharey=grid.sharey, **look
    )
    strips = [*zip(above, facets if grid.columns == len(facets) else facets[:1], strict=False)]
    for unused in above[len(strips) :]:
        unused.remove()
    for axis, facet in strips if len(facets) > 1 else ():
        axis.set_title(facet.label, loc="left", color=CAPTION_COLOUR, fontsize=8.5)
    order = [*(axes.T if grid.down else axes).ravel()]
    while len(order) > len(shown):  # where columns share an axis the one on top, so that they end alike
        order.pop(grid.rows if grid.down else -1).set_axis_off()
    cells = [*_cells(grid, picture, x, zip(order, shown, strict=False))]
    for axis, _ in strips if not panels else ():
        label_axis(axis.xaxis, x, picture.unit(x))
    return figure, strips, cells


def _cells(grid: _Grid, picture: Picture, x: str, placed: Any) -> Iterator[Cell]:
    """Yield panels in their axes, with titles, and labels of horizontal axes where none is below."""
    for axis, (panel, facet) in placed:
        spec = axis.get_subplotspec()
        if facet.label and (spec.is_first_row() or not (grid.sharey or grid.down) or panel.title):
            axis.set_title(facet.label, loc="left", color=CAPTION_COLOUR, fontsize=8.5)
        if spec.is_last_row() or not (grid.sharex or grid.down):
            column = panel.column if panel.kind == "ranks" else panel.x or x
            label_axis(axis.xaxis, column, picture.unit(column), panel.label if panel.kind == "bars" else "")
            axis.tick_params(labelbottom=True)
        yield Cell(axis, panel, facet, spec.is_first_col(), spec.is_last_col())
