"""The paper's figures in its axes and numbering, from the tables of a reproduction alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from matplotlib.lines import Line2D

from vibroplat.plots.histories import history
from vibroplat.plots.names import MEASURES, PHASE, PHASE_COLUMN
from vibroplat.plots.response import draw_response, marker_legend
from vibroplat.plots.style import BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILION, Saving, new_figure, save, styled
from vibroplat.plots.timelines import wrapped
from vibroplat.results.files import Result
from vibroplat.study.bands import jumps
from vibroplat.study.branches import EXCITATION

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: One colour for each mass ratio, and one for each model of contact at the mass ratio 0.2, in all figures.
MASSES = {0.1: BLUE, 0.2: VERMILION, 0.0: BLACK}
RESTITUTIONS = {0.0: VERMILION, 0.3: ORANGE, 0.5: PURPLE}
NON_IMPACT = GREEN
#: Names of the curves in the paper's numbering.
_MASS_NAMES = {mass: rf"{i} – $\mu_w$ = {mass:g}" for i, mass in enumerate(MASSES, start=1)}
_MODEL_NAMES = [*(f"{i} – $R$ = {r:g}" for i, r in enumerate(RESTITUTIONS, start=1)), "4 – non-impact"]
_F = "$f$ (Hz)"
#: Least change at a jump that is shown, over the range of the quantity.
VISIBLE = 0.02
#: The paper's symbols of the RMS.
_SYMBOLS = {
    "rms_y_m": r"$\widetilde{A}_y$ (mm)",
    "rms_x_m": r"$\widetilde{A}_x$ (mm)",
    "rms_phi_rad": r"$\widetilde{A}_\varphi$ (mrad)",
    PHASE_COLUMN: PHASE,
}


def plot_paper(directory: Path, saving: Saving | None = None) -> list[Path]:
    """Draw Figs. 2–7 from the tables of a reproduction into its directory."""
    result = Result(directory, "paper")
    with styled():
        return [save(draw(result), directory, name, saving) for name, draw in FIGURES.items()]


def _branches(axis: Axes, table: pd.DataFrame, column: str, colour: str, size: float = 1.0) -> None:
    """Draw the branches of a quantity over f, with a vertical arrow at each jump."""
    for _, rows in table.groupby("direction", sort=False):
        draw_response(axis, rows, column, color=colour, size=size)
        _arrows(axis, rows, column, colour)
    axis.set_ylabel(_SYMBOLS[column])


def _arrows(axis: Axes, rows: pd.DataFrame, column: str, colour: str) -> None:
    """Draw jumps as vertical arrows, from the last point before to the height of the first one after.

    A dotted line leads on to that point. Where a quantity does not change visibly there is no arrow.
    """
    f, values = (rows[c].to_numpy(dtype=float) for c in (EXCITATION, column))
    values = wrapped(values) if column == PHASE_COLUMN else MEASURES[column].factor * values
    up = rows["direction"].iloc[0] != "down"
    arrow = {"arrowstyle": "->", "color": colour, "lw": 0.8, "ls": "-" if up else "--", "shrinkA": 0.0, "shrinkB": 0.0}
    known = [0.0, 2.0 * np.pi] if column == PHASE_COLUMN else [0.0, *values[np.isfinite(values)]]
    least = VISIBLE * float(np.ptp(known))
    for i in np.flatnonzero(jumps(rows)):
        if abs(values[i + 1] - values[i]) > least:
            axis.annotate("", (f[i], values[i + 1]), (f[i], values[i]), arrowprops=arrow)
            axis.hlines(values[i + 1], min(f[i : i + 2]), max(f[i : i + 2]), colors=colour, ls=":", lw=0.6)


def _legend(figure: Figure, table: pd.DataFrame, curves: dict[str, str]) -> None:
    """Name the curves, by their colours, and the markers."""
    handles = [Line2D([], [], color=colour, lw=2.0, label=name) for name, colour in curves.items()]
    handles += marker_legend(table)
    figure.legend(handles=handles, loc="outside lower center", ncols=4)


def _fig2(result: Result) -> Figure:
    table = result.table("fig2")
    figure, axes = new_figure(4, 1, (8.0, 8.6), sharex=True)
    for axis, column in zip(axes[:, 0], _SYMBOLS, strict=True):
        _branches(axis, table, column, MASSES[0.0])
        if column != PHASE_COLUMN:
            axis.set_ylim(bottom=0.0)
    axes[0, 0].set_title(r"Fig. 2(a). $\mu_w$ = 0", loc="left")
    axes[3, 0].set_title("Fig. 2(b)", loc="left")
    axes[3, 0].set_xlabel(_F)
    _legend(figure, table, {})
    return figure


def _fig3(result: Result) -> Figure:
    table = result.table("fig3")
    figure, axes = new_figure(4, 1, (8.0, 9.0), sharex=True, height_ratios=[3.0, 1.2, 1.2, 1.2])
    for i, (mass, colour) in enumerate(MASSES.items()):
        rows = table[table["material.mass_ratio"] == mass]
        _branches(axes[0, 0], rows, "rms_y_m", colour, 1.4 - 0.3 * i)
        _branches(axes[1 + i, 0], rows, PHASE_COLUMN, colour)
        axes[1 + i, 0].set_title(f"Fig. 3(b). {_MASS_NAMES[mass]}", loc="left")
    axes[0, 0].set_ylim(bottom=0.0)
    axes[0, 0].set_title("Fig. 3(a). $R$ = 0", loc="left")
    axes[3, 0].set_xlabel(_F)
    _legend(figure, table, {_MASS_NAMES[mass]: colour for mass, colour in MASSES.items()})
    return figure


def _fig6(result: Result) -> Figure:
    table = result.table("fig6")
    shown = table[table["direction"] == "up"]
    curves = {
        name: (shown[shown["contact.restitution"] == r], colour)
        for name, (r, colour) in zip(_MODEL_NAMES, RESTITUTIONS.items(), strict=False)
    }
    if any(result.directory.glob("fig6-nonimpact.*")):
        viscous = result.table("fig6-nonimpact")
        curves[_MODEL_NAMES[3]] = (viscous[viscous["direction"] == "up"], NON_IMPACT)
    figure, axes = new_figure(1, 1, (8.0, 5.0))
    for i, (rows, colour) in enumerate(curves.values()):
        _branches(axes[0, 0], rows, "rms_y_m", colour, 1.5 - 0.25 * i)
    axes[0, 0].set_ylim(bottom=0.0)
    axes[0, 0].set_xlabel(_F)
    axes[0, 0].set_title(r"Fig. 6. $\mu_w$ = 0.2", loc="left")
    _legend(figure, pd.concat([rows for rows, _ in curves.values()]), {n: colour for n, (_, colour) in curves.items()})
    return figure


_MASS_CURVES = [(_MASS_NAMES[mass], colour) for mass, colour in MASSES.items()]
_MODEL_CURVES = list(zip(_MODEL_NAMES, [*RESTITUTIONS.values(), NON_IMPACT], strict=True))

#: By the name of the file.
FIGURES: dict[str, Callable[[Result], Figure]] = {
    "fig2": _fig2,
    "fig3": _fig3,
    "fig4": history("fig4", "y_m", _MASS_CURVES, "$R$ = 0", near=0.5),
    "fig5": history("fig5", "gap_m", _MASS_CURVES[:2], "$R$ = 0"),
    "fig6": _fig6,
    "fig7": history("fig7", "y_m", _MODEL_CURVES, r"$\mu_w$ = 0.2", near=0.2),
}
