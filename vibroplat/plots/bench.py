"""Figures of benches."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from vibroplat.plots.style import plt, save, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ENGINES = {"native": "#1f4e79", "sundae": "#c05a1c"}


def plot_precision(table: pd.DataFrame, directory: Path, name: str = "precision") -> Path:
    """Draw run time against error, a row of panels for each case with a line for each engine and integrator.

    Returns the PNG file, ``name``.png in the directory.
    """
    errors = {"y_m": "y (m)", "event_time_s": "event time (s)", "contact_force": "contact force (relative)"}
    cases = list(dict.fromkeys(table["case"]))
    with styled():
        figure, axes = plt.subplots(len(cases), len(errors), figsize=(11, 2.7 * len(cases)), squeeze=False)
        for row, case in zip(axes, cases, strict=True):
            for axis, (column, label) in zip(row, errors.items(), strict=True):
                _precision_lines(axis, table[table["case"] == case], column)
                axis.set_xlabel(f"largest error of {label}")
            row[0].set_ylabel("ms per simulated second")
            row[0].set_title(case, loc="left")
            row[0].legend(fontsize=7)
        return save(figure, directory / f"{name}.png")


def _precision_lines(axis: Axes, table: pd.DataFrame, column: str) -> None:
    """Draw one panel; a case without this quantity leaves it empty."""
    drawn = False
    for (engine, smooth), rows in table.groupby(["engine", "smooth_modes"]):
        shown = rows[rows[column] > 0.0] if column in rows else rows.iloc[:0]
        style: Any = {"color": _ENGINES.get(str(engine), "black"), "ls": "--" if smooth == "adams" else "-"}
        errors: Any = shown.get(column, [])
        axis.plot(errors, shown["ms_per_s_median"], "o", ms=3, label=f"{engine}, {smooth}", **style)
        drawn |= len(shown) > 0
    if not drawn:
        axis.set_axis_off()
        return
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.invert_xaxis()
