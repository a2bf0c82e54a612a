"""Bifurcation diagrams: the Poincaré section and the impact speeds over frequency."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from vibroplat.plots.names import FREQUENCIES
from vibroplat.plots.reading import read_columns
from vibroplat.plots.style import CURVES, head, new_figure
from vibroplat.study.branches import EXCITATION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vibroplat.plots.sweep_tables import Response

#: Colours of the directions, and of the other direction behind them.
_COLOURS, _BEHIND = {"up": CURVES[0], "down": CURVES[1]}, "#c9c9c9"


def draw_section(
    axis: Axes, points: pd.DataFrame, column: str, *, x: str = EXCITATION, factor: float = 1.0, **look: Any
) -> Axes:
    """Draw points of a table ``section`` or ``impacts`` over frequency; in PDF and SVG they are dots of an image."""
    style: dict[str, Any] = {"ls": "", "marker": "o", "ms": 1.6, "mew": 0.0, "rasterized": len(points) > 2000} | look
    axis.plot(points[x], factor * points[column], **style)
    return axis


def bifurcation(response: Response) -> Figure:
    """Draw the Poincaré section and impact speeds over frequency, a column for each branch.

    Behind the points of a branch are those of the other direction, in grey: where both are alike, none is hidden.
    """
    needed = (response.x, "branch")
    section = read_columns(response.result, "section", "direction", (*needed, "y_m"))
    impacts = read_columns(response.result, "impacts", "direction", (*needed, "impact_speed_m_per_s"))
    curves = list(response.curves())
    quantities = [(section, "y_m", 1e3, "$y$ at whole turns of exciter 1 (mm)")]
    if len(impacts):
        quantities.append((impacts, "impact_speed_m_per_s", 1.0, "impact speed (m/s)"))
    size = (max(8.0, 1.0 + 4.2 * len(curves)), 1.2 + 2.9 * len(quantities))
    figure, axes = new_figure(len(quantities), len(curves), size, sharex=True, sharey="row")
    for row, (table, column, factor, label) in zip(axes, quantities, strict=True):
        for axis, curve in zip(row, curves, strict=True):
            beside = [c for c in curves if c.number == curve.number and c.direction != curve.direction]
            for other in beside:
                draw_section(
                    axis, _of(table, other.rows), column, x=response.x, factor=factor, color=_BEHIND, zorder=1.5
                )
            colour = _COLOURS.get(curve.direction, CURVES[0])
            draw_section(axis, _of(table, curve.rows), column, x=response.x, factor=factor, color=colour)
        row[0].set_ylabel(label)
    for axis, curve in zip(axes[0], curves, strict=True):
        axis.set_title(", ".join(part for part in (curve.label, curve.direction) if part), loc="left")
    for axis in axes[-1]:
        axis.set_xlabel(FREQUENCIES[response.x])
    head(figure, ", ".join(response.names), response.parameters)
    _legend(figure, [curve.direction for curve in curves])
    return figure


def _of(table: pd.DataFrame, rows: pd.DataFrame) -> pd.DataFrame:
    """Return the points of a branch."""
    found: pd.DataFrame = table[table["branch"] == rows["branch"].iloc[0]]
    return found


def _legend(figure: Figure, directions: list[str]) -> None:
    if len({*directions}) < 2:
        return
    dots = [(f"supply frequency {name}", _COLOURS[name]) for name in dict.fromkeys(directions)]
    dots.append(("the other direction", _BEHIND))
    handles = [Line2D([], [], ls="", marker="o", ms=4.0, mew=0.0, color=colour, label=label) for label, colour in dots]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
