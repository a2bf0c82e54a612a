"""Contents of printed panels other than curves: tiles, bars, stacked fractions, complex numbers, dots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import MaxNLocator

from vibroplat.config.circular import ranked, shown_value
from vibroplat.config.coordinates import TURN
from vibroplat.plots.axes import in_decades, label_axis
from vibroplat.results.labels import halfway, in_ratios, key_name
from vibroplat.results.legend import HATCH, TILE
from vibroplat.results.picture import BLUE, REFERENCE, VERMILION, Panel, Picture, Series, on_axis

if TYPE_CHECKING:
    from vibroplat.kernels.compiled import FloatArray
    from vibroplat.plots.layout import Cell

#: Bars of a panel, dots from which on they are smaller, and fractions of points that are marked (%).
BARS, MANY, QUANTILES, SHARES = 10, 200, (5, 50, 95), (5, 25, 50, 75, 95)
#: Most ticks of the vertical axis of tiles.
_TICKS = 12
#: Largest real and imaginary part on the plane, and the smallest frame, just around the unit circle.
FARTHEST, NEAREST = 2.0, 1.1


def with_gap(values: Any) -> FloatArray:
    """Return numbers with a missing one behind them, at the place of :data:`vibroplat.plots.pictures.BROKEN`."""
    return np.append(pd.Series(values).to_numpy(dtype=float, na_value=np.nan), np.nan)


# -- tiles, bars, stacks, planes ---------------------------------------------------------------------------------------


def _tile(
    axis: Axes, table: pd.DataFrame, key: str, values: pd.Series, colours: Any, norm: Any, x: str, alpha: float | None
) -> None:
    """Draw a tile of equal height for each point; failed points are hatched.

    Rows are in the order of the key's values and evenly spaced; their ticks show the values.
    """
    grid = _grid(table, key, x, values)
    if grid.empty:
        return
    cells, rows = grid.to_numpy(), np.arange(len(grid.index))
    corners = halfway(grid.columns.to_numpy(dtype=float)), np.arange(len(rows) + 1) - 0.5
    axis.pcolormesh(*corners, cells, cmap=colours, norm=norm, alpha=alpha, rasterized=True)
    missing = np.ma.masked_where(np.isfinite(cells), np.zeros(cells.shape))
    if missing.count():
        axis.pcolor(*corners, missing, cmap=ListedColormap(["white"]), hatch=HATCH, lw=0.0)
    if in_ratios(grid.columns):
        in_decades(axis, "x")
    every = max(1, -(-len(rows) // _TICKS))
    axis.set_yticks(rows[::every], [f"{value:.4g}" for value in grid.index[::every]])
    axis.grid(visible=False)


def _grid(table: pd.DataFrame, key: str, x: str, values: Any) -> pd.DataFrame:
    """Return numbers of points in rows of a key and columns of the horizontal axis."""
    known = table.assign(value=values).dropna(subset=[key, x])
    look: dict[str, Any] = {"index": key, "columns": x, "aggfunc": "first", "dropna": False, "sort": True}
    return known.pivot_table(values="value", **look).astype(float)


def colour_numbers(panel: Panel, points: pd.DataFrame) -> tuple[FloatArray, Any, Normalize]:
    """Return the number by which each point is coloured, the colours and their norm."""
    if panel.classes:
        numbers = points[panel.by].map({name: float(i) for i, name in enumerate(panel.classes)})
        colours: Any = ListedColormap([colour for colour, _ in panel.classes.values()])
        return np.asarray(numbers, dtype=float), colours, Normalize(-0.5, len(panel.classes) - 0.5)
    values = np.asarray(points[panel.by].to_numpy(dtype=float, na_value=np.nan))
    known = values[np.isfinite(values)]
    dark = colormaps["viridis_r"](np.linspace(0.05, 1.0, 256))  # from small values, pale, to large ones, dark
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    return values, ListedColormap(dark), Normalize(low, high)


def _tiles(cell: Cell, picture: Picture, x: str, shown: Sequence[Series]) -> None:
    """Draw tiles, and lines over them; beyond the first and the last row there are none."""
    axis, panel = cell[:2]
    points, (values, colours, norm) = picture.points, colour_numbers(panel, picture.points)
    rows = np.concatenate([series.places for series in shown if series.mode == "dots"])
    table = points.iloc[rows]
    shades, alpha = pd.Series(values[rows], table.index), TILE if panel.classes else None
    _tile(axis, table, panel.column, shades, colours, norm, x, alpha)
    _over_tiles(axis, panel, table, x)
    levels = np.unique(table[panel.column])
    across, up = with_gap(points[x]), with_gap(points[panel.column])
    for series in (series for series in shown if series.mode == "lines"):
        places = np.interp(up[series.places], levels, np.arange(len(levels)), left=np.nan, right=np.nan)
        look: dict[str, Any] = {"color": series.colour, "lw": 0.9 * series.width, "ls": series.dash}
        outlined = [Stroke(linewidth=2.3 * series.width, foreground="white"), Normal()]
        axis.plot(across[series.places], places, scalex=False, scaley=False, path_effects=outlined, **look)


def _over_tiles(axis: Axes, panel: Panel, table: pd.DataFrame, x: str) -> None:
    """Draw hatches of tiles and contours over them."""
    if not (panel.hatch or panel.contours):
        return
    across, rows = np.unique(table[x]), np.arange(table[panel.column].nunique())
    corners = halfway(across), np.arange(len(rows) + 1) - 0.5
    for hatch in panel.hatches:
        flags = _grid(table, panel.column, x, np.where(table[panel.hatch] == hatch, 1.0, np.nan))
        values = np.ma.masked_invalid(flags.to_numpy())
        if values.count():
            axis.pcolor(*corners, values, cmap=ListedColormap(["#ffffff00"]), hatch=hatch, lw=0.0)
    if panel.contours and min(len(across), len(rows)) > 1:
        heights = _grid(table, panel.column, x, table[panel.contours.column]).to_numpy()
        levels = panel.contours.levels
        dashes = [dash for dash, _ in levels.values()]
        axis.contour(across, rows, heights, [*levels], colors="k", linewidths=0.9, linestyles=dashes)


def _bars(cell: Cell, picture: Picture, x: str, shown: Sequence[Series]) -> None:
    """Draw horizontal bars of the first rows, which are the largest."""
    axis, panel = cell[:2]
    own = picture.points.iloc[shown[0].places[:BARS]] if shown else picture.points.iloc[:0]
    places, values = np.arange(len(own)), own[x].to_numpy(float)
    axis.barh(places, values, color=[BLUE if value > 0.0 else VERMILION for value in values], height=0.7)
    axis.set_yticks(places, [key_name(key) for key in own[panel.column]], fontsize=8.0)
    axis.set_ylim(max(min(max(len(s.places) for s in picture.series), BARS) if picture.series else 1, 4) - 0.4, -0.6)
    axis.axvline(0.0, color=REFERENCE, lw=0.8)
    axis.grid(visible=False, axis="y")


def _stack(cell: Cell, picture: Picture, x: str, shown: Sequence[Series]) -> None:
    """Stack fractions over a key; bars show the confidence interval of each."""
    axis, panel = cell[:2]
    points, below = picture.points, pd.Series(0.0, np.unique(picture.points[x]))
    values = below.index.to_numpy(float)
    for series in shown:
        own = points.iloc[series.places].drop_duplicates(x).set_index(x).reindex(values)
        middle, low, high = (own[f"{panel.column}{end}"].astype(float) for end in ("", "_low", "_high"))
        top = below + middle.fillna(0.0)
        if len(values) > 1:
            axis.fill_between(values, below, top, color=series.colour, alpha=0.55, linewidth=0.0)
        else:
            axis.bar(values, top - below, bottom=below, width=0.1, color=series.colour, alpha=0.55)
        known = (top < 1.0 - 1e-9).to_numpy()  # the uppermost is what the others leave
        bars = np.array([middle - low, high - middle])[:, known]
        look: dict[str, Any] = {"fmt": ".", "markersize": 3.0, "linewidth": 0.8, "capsize": 1.5}
        axis.errorbar(values[known], top[known], bars, color=series.colour, **look)
        below = top
    axis.margins(x=0.0 if len(values) > 1 else None)


def _plane(cell: Cell, picture: Picture, _: str, shown: Sequence[Series]) -> None:
    """Draw complex numbers and the unit circle, and write how many lie outside of the frame."""
    axis, panel = cell[:2]
    points, angle = picture.points, np.linspace(0.0, TURN, 361)
    axis.plot(np.cos(angle), np.sin(angle), color=REFERENCE, lw=1.0)
    farthest = points[[panel.x, panel.column]].abs().max().max()
    frame = float(np.clip(np.nan_to_num(1.05 * farthest), NEAREST, FARTHEST))
    own = points.iloc[np.concatenate([series.places for series in shown if series.mode == "dots"])]
    real, imaginary, by = (own[name].to_numpy(float) for name in (panel.x, panel.column, panel.by))
    far = (np.abs(real) > frame) | (np.abs(imaginary) > frame)
    norm = Normalize(float(points[panel.by].min()), float(points[panel.by].max()))
    look: dict[str, Any] = {"s": 7.0, "cmap": "viridis", "norm": norm, "linewidths": 0.0}
    axis.scatter(real[~far], imaginary[~far], c=by[~far], **look)
    if far.any():
        text = f"{int(far.sum()) // 2} farther away"  # each is there with its conjugate
        axis.text(0.02, 0.02, text, transform=axis.transAxes, fontsize=8, color=REFERENCE)
    axis.set(xlabel=f"{panel.x} part", aspect="equal", xlim=(-frame, frame), ylim=(-frame, frame))
    if cell.is_last:
        row = [one for one in axis.figure.axes if one.get_ylim() == axis.get_ylim() and one.get_aspect() == 1.0]
        bar = axis.figure.colorbar(ScalarMappable(norm, "viridis"), ax=row, pad=0.01)
        label_axis(bar.ax.yaxis, panel.by, picture.unit(panel.by))


def _ranks(cell: Cell, picture: Picture, _: str, series: Sequence[Series]) -> None:
    """Draw each point in the order of its values, in the colour of its class, and rings at 5, 50 and 95 %."""
    axis, panel = cell[:2]
    own = picture.points.iloc[np.concatenate([one.places for one in series])].dropna(subset=[panel.column])
    values = own[panel.column].to_numpy(dtype=float)
    order, quantiles = ranked(panel.column, values, np.divide(QUANTILES, 100.0))
    own, values, percent = own.iloc[order], values[order], 100.0 * (np.arange(len(own)) + 0.5) / max(len(own), 1)
    size = 2.4 if len(own) <= MANY else 1.2
    for name, (colour, _) in panel.classes.items():
        chosen = (own[panel.by] == name).to_numpy(dtype=bool)
        axis.plot(values[chosen], percent[chosen], "o", ms=size, mew=0.0, color=colour)
    axis.set(yticks=SHARES, ylim=(-4.0, 104.0))
    axis.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    if cell.is_first:
        axis.set_ylabel("samples that are smaller (%)")
    if len(own) and np.ptp(values) > 0.0:
        largest = float(np.abs(values).max())
        for quantile, number in zip(QUANTILES, quantiles.tolist(), strict=False):
            value, text = float(on_axis(panel.column, number)), shown_value(panel.column, number, largest)
            left = value > 0.5 * (values[0] + values[-1])
            axis.plot(value, quantile, "o", ms=5.0, mfc="white", mec=BLUE)
            axis.annotate(
                text, (value, quantile), (-6.0 if left else 6.0, 0.0), fontsize=8.0, color=BLUE,
                textcoords="offset points", ha="right" if left else "left", va="center",
            )  # fmt: skip


def _dots(cell: Cell, picture: Picture, x: str, series: Sequence[Series]) -> None:
    """Draw dots in the colours of their classes, or along a scale."""
    axis, panel = cell[:2]
    rows = np.concatenate([one.places for one in series])
    values, colours, norm = colour_numbers(panel, picture.points)
    own, size = picture.points.iloc[rows], float(np.clip(4e4 / max(len(rows), 1), 3.0, 40.0))
    look: dict[str, Any] = {"cmap": colours.with_extremes(bad="0.85"), "norm": norm, "linewidths": 0.0}
    axis.scatter(own[x], own[panel.column], c=values[rows], s=size, plotnonfinite=True, **look)
    axis.grid(visible=False)


DRAWERS: Mapping[str, Any] = {
    "dots": _dots,
    "ranks": _ranks,
    "tiles": _tiles,
    "bars": _bars,
    "stack": _stack,
    "plane": _plane,
}
