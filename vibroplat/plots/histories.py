"""Time histories of the paper (Figs. 4, 5, 7), with the differences of curves that nearly coincide."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from vibroplat.plots.names import COORDINATES
from vibroplat.plots.style import REFERENCE, new_figure
from vibroplat.results.files import Result
from vibroplat.study.branches import EXCITATION

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Names and colours of the curves, in the paper's numbering.
Curves = Sequence[tuple[str, str]]
#: Times (s) and differences from the first curve, by the number of the curve.
Differences = dict[int, tuple["np.ndarray[Any, Any]", "np.ndarray[Any, Any]"]]


def history(name: str, column: str, curves: Curves, title: str, *, near: float = 0.0) -> Callable[[Result], Figure]:
    """Make a drawer of time histories, a panel for each of the paper's frequencies.

    Parameters
    ----------
    name
        Of the table, and of the figure.
    column
        What is drawn.
    curves, title
        Names and colours of the curves, and what they have in common.
    near
        Differences from the first curve that stay below this share of its amplitude are drawn below.
    """

    def draw(result: Result) -> Figure:
        table = result.table(name)
        panels = [table[table["panel"] == panel] for panel in dict.fromkeys(table["panel"])]
        beside = [_differences(rows, column, near) for rows in panels]
        heights = [h for found in beside for h in ([2.2, 1.0] if found else [2.2])]
        figure, axes = new_figure(len(heights), 1, (8.0, 1.2 + 0.95 * sum(heights)), height_ratios=heights)
        left = iter(axes[:, 0])
        for letter, rows, found in zip("abcd", panels, beside, strict=False):
            axis = next(left)
            _curves(axis, rows, column, curves)
            axis.set_title(f"Fig. {name[3:]}({letter}). {title}, $f$ = {_range(rows[EXCITATION])} Hz", loc="left")
            if found:
                below = next(left)
                _lines_of_differences(below, found, curves, column)
                below.sharex(axis)
                axis.tick_params(labelbottom=False)
        axes[-1, 0].set_xlabel("$t$ (ms)")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
        return figure

    return draw


def _range(frequencies: pd.Series) -> str:
    ends = dict.fromkeys(f"{f:.2f}" for f in (frequencies.min(), frequencies.max()))
    return " … ".join(ends)


def _curves(axis: Axes, rows: pd.DataFrame, column: str, curves: Curves) -> None:
    """Draw the curves of a panel, the first ones wider: a curve on another leaves it visible."""
    quantity = COORDINATES[column]
    for number, curve in rows.groupby("curve"):
        label, colour = curves[int(str(number)) - 1]
        width = 2.4 - 0.5 * (int(str(number)) - 1)
        axis.plot(1e3 * curve["t_s"], quantity.factor * curve[column], lw=width, color=colour, label=label)
    axis.set_ylabel(quantity.label)


def _differences(rows: pd.DataFrame, column: str, near: float) -> Differences:
    """Return the differences from the first curve that stay below a share of its amplitude."""
    curves = {int(str(number)): curve for number, curve in rows.groupby("curve")}
    first = curves.pop(min(curves))
    times = first["t_s"].to_numpy()
    amplitude = 0.5 * float(np.ptp(first[column]))
    found = {}
    for number, curve in curves.items():
        shown = times[times <= curve["t_s"].max()]
        change = np.interp(shown, curve["t_s"], curve[column]) - first[column].to_numpy()[: len(shown)]
        if np.abs(change).max() <= near * amplitude:
            found[number] = (shown, change)
    return found


def _lines_of_differences(axis: Axes, found: Differences, curves: Curves, column: str) -> None:
    axis.axhline(0.0, color=REFERENCE, lw=0.6)
    for number, (times, change) in found.items():
        axis.plot(1e3 * times, COORDINATES[column].factor * change, lw=0.9, color=curves[number - 1][1])
    names = ", ".join(str(number) for number in found)
    axis.set_ylabel(f"{names} minus 1\n(mm)", fontsize=8.5)
