"""Maps of regimes over supply frequency and a key of the grid."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap, Normalize
from matplotlib.patches import Patch

from vibroplat.errors import TableError
from vibroplat.plots.names import FREQUENCIES, is_number, key_label
from vibroplat.plots.style import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION, head, new_figure
from vibroplat.study.branches import SUPPLY

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vibroplat.plots.sweep_tables import Response

#: Kinds of synchronization and their colours.
SYNC = {"antiphase": BLUE, "in-phase": ORANGE, "intermediate": GREEN, "none": "#3c3c3c"}
_SYNC_LABELS = {"none": "not synchronous"}
#: Classes of periods: upper limits and labels; after them the motions that do not repeat, and their colours.
_ENDS = ((1, "1"), (2, "2"), (4, "3, 4"), (8, "5 … 8"), (64, "9 … 64"))
_APERIODIC = {"quasi-periodic": "quasi-periodic", "chaotic": "chaotic", "undecided": "not periodic"}
PERIODS = {
    **dict(zip((name for _, name in _ENDS), (BLUE, SKY, GREEN, ORANGE, VERMILION), strict=True)),
    "quasi-periodic": PURPLE,
    "chaotic": "#5c2a4d",
    "not periodic": "#d4d4d4",
}
#: Hatch of points that failed, and the colour of points without flight.
_HATCH, NO_FLIGHT = "xxxx", "#ffffff"


def sync_classes(table: pd.DataFrame) -> pd.Series:
    """Return the number of each point's synchronization in ``SYNC``, or NaN if it failed."""
    return table["sync"].map({name: float(i) for i, name in enumerate(SYNC)})


def period_classes(table: pd.DataFrame) -> pd.Series:
    """Return the number of each point's class in ``PERIODS``, or NaN if it failed."""
    period = table["period"].to_numpy(dtype=float, na_value=np.nan)
    classes = np.searchsorted([end for end, _ in _ENDS], np.nan_to_num(period)).astype(float)
    motion = table["motion"] if "motion" in table else pd.Series("undecided", table.index)
    names = motion.map(_APERIODIC).fillna("not periodic").map(list(PERIODS).index)
    classes = np.where(period == 0.0, names.to_numpy(dtype=float), classes)
    return pd.Series(np.where(np.isfinite(period), classes, np.nan), table.index)


def draw_map(axis: Axes, table: pd.DataFrame, key: str, values: pd.Series, colours: Any, norm: Any) -> Axes:
    """Draw a tile of equal size for each point of one direction of a sweep; failed points are hatched.

    Rows are in the order of the key's values, evenly spaced whatever these are: their ticks say which.

    Parameters
    ----------
    axis
        Where to draw.
    table
        The points, each with a supply frequency and a value of the key.
    key
        The key of the vertical axis.
    values
        What is drawn; NaN where a point failed.
    colours, norm
        Matplotlib's colour map and norm of these values.

    Returns
    -------
    Axes
        The same axis.
    """
    grid = table.assign(value=values).pivot_table(
        index=key, columns=SUPPLY, values="value", aggfunc="first", dropna=False, sort=True
    )
    found = grid.to_numpy(dtype=float)
    rows = np.arange(len(grid.index))
    axis.pcolormesh(grid.columns, rows, found, cmap=colours, norm=norm, shading="nearest", rasterized=True)
    missing = np.ma.masked_where(np.isfinite(found), np.zeros(found.shape))
    if missing.count():
        axis.pcolor(
            grid.columns, rows, missing, cmap=ListedColormap(["white"]), hatch=_HATCH, shading="nearest", lw=0.0
        )
    every = max(1, -(-len(rows) // 12))
    axis.set_yticks(rows[::every], [f"{value:g}" for value in grid.index[::every]])
    axis.grid(visible=False)
    return axis


def regimes(response: Response) -> Figure:
    """Draw maps of synchronization, period and flight over supply frequency and a grid key."""
    key = _key(response)
    table = response.table
    directions = list(dict.fromkeys(table["direction"]))
    flies = "flight_fraction" in table and bool((table["flight_fraction"] > 0.0).any())
    figure, axes = new_figure(
        len(directions), 2 + flies, (5.0 * (2 + flies), 1.4 + 3.0 * len(directions)), sharex=True, sharey=True
    )
    for row, direction in zip(axes, directions, strict=True):
        rows = table[table["direction"] == direction]
        _classes(row[0], rows, key, sync_classes(rows), list(SYNC.values()))
        _classes(row[1], rows, key, period_classes(rows), list(PERIODS.values()))
        titles = [f"synchronization, {direction}", f"period (turns), {direction}"]
        if flies:
            flight = rows["flight_fraction"].astype(float)
            draw_map(row[2], rows, key, flight, _flight_colours(), Normalize(0.0, 1.0))
            titles.append(f"flight, {direction}")
        for axis, title in zip(row, titles, strict=True):
            axis.set_title(title, loc="left")
        row[0].set_ylabel(key_label(key))
    for axis in axes[-1]:
        axis.set_xlabel(FREQUENCIES[SUPPLY])
    head(figure, ", ".join(response.names), response.parameters)
    _legends(axes[-1], table, flies)
    return figure


def _key(response: Response) -> str:
    """Return the grid key with several numbers, if there is exactly one."""
    keys = [key for key in response.keys if is_number(response.table[key])]
    if len(keys) == len(response.keys) == 1:
        return keys[0]
    raise TableError(
        f"{response.result.directory} varies {response.keys}; a map needs one grid key with several numbers"
    )


def _classes(axis: Axes, table: pd.DataFrame, key: str, values: pd.Series, colours: list[str]) -> None:
    norm = BoundaryNorm(np.arange(len(colours) + 1) - 0.5, len(colours))
    draw_map(axis, table, key, values, ListedColormap(colours), norm)


def _flight_colours() -> ListedColormap:
    """Return a scale from short flights, pale, to long ones, dark; points without flight are white."""
    scale = mpl.colormaps["viridis_r"](np.linspace(0.05, 1.0, 256))
    scale[0] = mpl.colors.to_rgba(NO_FLIGHT)
    return ListedColormap(scale)


def _legends(axes: Any, table: pd.DataFrame, flies: bool) -> None:
    """Name the colours that a table needs below the maps."""
    for axis, classes, colours, labels in (
        (axes[0], sync_classes(table), SYNC, _SYNC_LABELS),
        (axes[1], period_classes(table), PERIODS, {}),
    ):
        names = [name for i, name in enumerate(colours) if (classes == i).any()]
        entries = [Patch(color=colours[name], label=labels.get(name, name)) for name in names]
        if classes.isna().any():
            entries.append(Patch(facecolor="white", edgecolor="black", hatch=_HATCH, lw=0.3, label="failed"))
        axis.legend(handles=entries, loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=4, columnspacing=1.2)
    if flies:
        bar = axes[2].figure.colorbar(
            ScalarMappable(Normalize(0.0, 1.0), _flight_colours()), ax=axes[2], location="bottom", aspect=40
        )
        bar.set_label("flight fraction; white: no flight")
