"""The paper's figures in its axes and numbering, from the tables of a reproduction alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from vibroplat.columns import COORDINATES, PHASE, PHASE_COLUMN
from vibroplat.plots.response import draw_response, drawn_values, marker_legend
from vibroplat.plots.style import BLACK, BLUE, GREEN, ORANGE, PURPLE, REFERENCE, VERMILION, entry, new_figure
from vibroplat.plots.timelines import FloatArray
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
#: Names and colours of curves, in the paper's numbering.
Curves = Sequence[tuple[str, str]]
#: Least change at a jump that is shown, over the range of the quantity.
VISIBLE = 0.02
#: The paper's symbols of the RMS.
_SYMBOLS = {
    "rms_y_m": r"$\widetilde{A}_y$ (mm)",
    "rms_x_m": r"$\widetilde{A}_x$ (mm)",
    "rms_phi_rad": r"$\widetilde{A}_\varphi$ (mrad)",
    PHASE_COLUMN: PHASE,
}


def paper_figures(directories: Sequence[Path], _: Sequence[str] = ()) -> Iterator[tuple[Path, str, Figure]]:
    """Draw Figs. 2–7 from the tables of reproductions; yield the directory and the name of each."""
    for directory in directories:
        result = Result(directory, "paper")
        for name, draw in FIGURES.items():
            yield directory, name, draw(result)


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
    f, values = rows[EXCITATION].to_numpy(dtype=float), drawn_values(rows, column)
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
    handles = [entry(name, color=colour, lw=2.0) for name, colour in curves.items()]
    figure.legend(handles=[*handles, *marker_legend(table)], loc="outside lower center", ncols=4)


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
        table, quantity = result.table(name), COORDINATES[column]
        panels = [table[table["panel"] == panel] for panel in dict.fromkeys(table["panel"])]
        beside = [_differences(rows, column, near) for rows in panels]
        heights = [h for found in beside for h in ([2.2, 1.0] if found else [2.2])]
        figure, axes = new_figure(len(heights), 1, (8.0, 1.2 + 0.95 * sum(heights)), height_ratios=heights)
        left = iter(axes[:, 0])
        for letter, rows, found in zip("abcd", panels, beside, strict=False):
            axis = next(left)
            for number, curve in _curves(rows).items():  # the first ones are wider, visible below the others
                label, colour = curves[number - 1]
                look = {"lw": 2.4 - 0.5 * (number - 1), "color": colour, "label": label}
                axis.plot(1e3 * curve["t_s"], quantity.factor * curve[column], **look)
            axis.set_ylabel(quantity.label)
            shown = " … ".join(dict.fromkeys(f"{f:.2f}" for f in (rows[EXCITATION].min(), rows[EXCITATION].max())))
            axis.set_title(f"Fig. {name[3:]}({letter}). {title}, $f$ = {shown} Hz", loc="left")
            if found:
                below = next(left)
                below.axhline(0.0, color=REFERENCE, lw=0.6)
                for number, (times, change) in found.items():
                    below.plot(1e3 * times, quantity.factor * change, lw=0.9, color=curves[number - 1][1])
                below.set_ylabel(f"{', '.join(map(str, found))} minus 1\n(mm)", fontsize=8.5)
                below.sharex(axis)
                axis.tick_params(labelbottom=False)
        axes[-1, 0].set_xlabel("$t$ (ms)")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
        return figure

    return draw


def _curves(rows: pd.DataFrame) -> dict[int, pd.DataFrame]:
    """Return the curves of a panel by their numbers."""
    return {int(str(number)): curve for number, curve in rows.groupby("curve")}


def _differences(rows: pd.DataFrame, column: str, near: float) -> dict[int, tuple[FloatArray, FloatArray]]:
    """Return times (s) and differences from the first curve where these stay below a share of its amplitude."""
    curves = _curves(rows)
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


#: By the name of the file.
FIGURES: dict[str, Callable[[Result], Figure]] = {
    "fig2": _fig2,
    "fig3": _fig3,
    "fig4": history("fig4", "y_m", _MASS_CURVES, "$R$ = 0", near=0.5),
    "fig5": history("fig5", "gap_m", _MASS_CURVES[:2], "$R$ = 0"),
    "fig6": _fig6,
    "fig7": history("fig7", "y_m", _MODEL_CURVES, r"$\mu_w$ = 0.2", near=0.2),
}
