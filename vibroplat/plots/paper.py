"""The paper's figures in its axes and numbering, from the tables of a reproduction alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from vibroplat.plots.style import CURVES, plt, save, styled
from vibroplat.plots.sweep import phase_axis
from vibroplat.results import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

F = "excitation_frequency_hz"
#: Distance of neighbouring points (Hz) that is a jump; a change of synchronization is one as well.
JUMP = 0.6
#: Names of the curves in the paper's numbering.
_MASSES = ("1 – μ = 0.1", "2 – μ = 0.2", "3 – μ = 0")
_MODELS = ("1 – R = 0", "2 – R = 0.3", "3 – R = 0.5", "4 – non-impact")


def plot_paper(directory: Path) -> list[Path]:
    """Draw Figs. 2–7 from the tables of a reproduction into its directory."""
    result = Result(directory, "paper")
    with styled():
        return [save(draw(result), directory / f"{name}.png") for name, draw in FIGURES.items()]


def _curves(axis: Axes, table: pd.DataFrame, column: str, factor: float, colour: str, label: str) -> None:
    """Draw both directions of a quantity over f: up full, down dashed, jumps of f as thin arrows."""
    for direction, style in (("up", "-o"), ("down", "--s")):
        rows = table[table["direction"] == direction]
        f, values = rows[F].to_numpy(dtype=float), factor * rows[column].to_numpy(dtype=float)
        if column == "phase_difference_rad":
            values = np.mod(values + 0.5, 2.0 * np.pi) - 0.5
        up = direction == "up"
        sync = rows["sync"].to_numpy()
        jumps = np.flatnonzero((sync[1:] != sync[:-1]) | (np.abs(np.diff(f)) > JUMP))
        axis.plot(
            np.insert(f, jumps + 1, np.nan),
            np.insert(values, jumps + 1, np.nan),
            style,
            ms=2,
            lw=1.0,
            color=colour,
            alpha=1.0 if up else 0.5,
            label=label if up else None,
        )
        for i in jumps:
            arrow = {"arrowstyle": "->", "color": colour, "lw": 0.6, "alpha": 0.8 if up else 0.4, "ls": style[:-1]}
            axis.annotate("", (f[i + 1], values[i + 1]), (f[i], values[i]), arrowprops=arrow)


def _fig2(result: Result) -> Figure:
    table = result.table("fig2")
    figure, (top, bottom) = plt.subplots(2, 1, figsize=(8, 6.5), sharex=True)
    _curves(top, table, "rms_y_m", 1e3, CURVES[0], "Ã_y")
    _curves(top, table, "rms_x_m", 1e3, CURVES[1], "Ã_x")
    other = top.twinx()
    other.grid(visible=False)
    other.spines["right"].set_visible(True)
    _curves(other, table, "rms_phi_rad", 1e3, CURVES[2], "Ã_φ")
    top.plot([], [], color=CURVES[2], label="Ã_φ (right)")
    top.set_ylabel("Ã_x, Ã_y (mm)")
    other.set_ylabel("Ã_φ (mrad)", color=CURVES[2])
    for axis in (top, other):
        axis.set_ylim(bottom=0.0)
    top.legend(loc="upper left")
    top.set_title("Fig. 2(a). μ = 0; up full, down dashed", loc="left")
    _curves(bottom, table, "phase_difference_rad", 1.0, CURVES[0], "Δφ")
    phase_axis(bottom)
    bottom.set_title("Fig. 2(b)", loc="left")
    bottom.set_xlabel("f (Hz)")
    return figure


def _fig3(result: Result) -> Figure:
    table = result.table("fig3")
    figure, (top, bottom) = plt.subplots(2, 1, figsize=(8, 6.5), sharex=True)
    for label, mass_ratio, colour in zip(_MASSES, (0.1, 0.2, 0.0), CURVES, strict=False):
        rows = table[table["material.mass_ratio"] == mass_ratio]
        _curves(top, rows, "rms_y_m", 1e3, colour, label)
        _curves(bottom, rows, "phase_difference_rad", 1.0, colour, label)
    top.set_ylabel("Ã_y (mm)")
    top.set_ylim(bottom=0.0)
    top.legend()
    top.set_title("Fig. 3(a). R = 0; up full, down dashed", loc="left")
    phase_axis(bottom)
    bottom.set_title("Fig. 3(b)", loc="left")
    bottom.set_xlabel("f (Hz)")
    return figure


def _fig6(result: Result) -> Figure:
    table = result.table("fig6")
    figure, axis = plt.subplots(figsize=(8, 4.6))
    shown = table[table["direction"] == "up"]
    for label, restitution, colour in zip(_MODELS, (0.0, 0.3, 0.5), CURVES, strict=False):
        _curves(axis, shown[shown["contact.restitution"] == restitution], "rms_y_m", 1e3, colour, label)
    if any(result.directory.glob("fig6-nonimpact.*")):
        viscous = result.table("fig6-nonimpact")
        _curves(axis, viscous[viscous["direction"] == "up"], "rms_y_m", 1e3, CURVES[3], _MODELS[3])
    axis.set_ylabel("Ã_y (mm)")
    axis.set_ylim(bottom=0.0)
    axis.set_xlabel("f (Hz)")
    axis.legend()
    axis.set_title("Fig. 6. μ = 0.2, upward", loc="left")
    return figure


def _history(name: str, column: str, label: str, curves: tuple[str, ...], title: str) -> Callable[[Result], Figure]:
    """Make a drawer of time histories, a panel for each of the paper's frequencies."""

    def draw(result: Result) -> Figure:
        table = result.table(name)
        panels = list(dict.fromkeys(table["panel"]))
        figure, axes = plt.subplots(len(panels), 1, figsize=(8, 2.4 * len(panels)))
        for letter, axis, panel in zip("abcd", axes, panels, strict=False):
            rows = table[table["panel"] == panel]
            for number, curve in rows.groupby("curve"):
                i = int(str(number)) - 1
                axis.plot(1e3 * curve["t_s"], 1e3 * curve[column], lw=1.1, color=CURVES[i], label=curves[i])
            measured = f"{rows[F].min():.2f} … {rows[F].max():.2f} Hz"
            axis.set_ylabel(label)
            axis.set_title(f"Fig. {name[3:]}({letter}). {title}, f = {measured}", loc="left", fontsize=9)
            axis.legend(fontsize=6.5, ncols=4, loc="lower right", bbox_to_anchor=(1.01, 0.97), columnspacing=1.0)
        axes[-1].set_xlabel("t (ms)")
        return figure

    return draw


#: By the name of the file.
FIGURES: dict[str, Callable[[Result], Figure]] = {
    "fig2": _fig2,
    "fig3": _fig3,
    "fig4": _history("fig4", "y_m", "y (mm)", _MASSES, "R = 0"),
    "fig5": _history("fig5", "gap_m", "y_w1 (mm)", _MASSES[:2], "R = 0"),
    "fig6": _fig6,
    "fig7": _history("fig7", "y_m", "y (mm)", _MODELS, "μ = 0.2"),
}
