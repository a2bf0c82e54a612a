"""Figures of benchmarks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
from matplotlib.lines import Line2D

from vibroplat.plots.style import CURVES, plt, save, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Errors shown in work–precision figures, by column: of our own benchmarks, and of comparisons with peers.
OWN = {"y_m": "y (m)", "event_time_s": "event times (s)", "contact_force": "contact force (relative)"}
SCALED = {"coordinates": "coordinates (over their scales)"} | {
    key: OWN[key] for key in ("event_time_s", "contact_force")
}


def plot_precision(table: pd.DataFrame, directory: Path, name: str, errors: dict[str, str], line: list[str]) -> Path:
    """Draw run time against error, one row of panels per case.

    Parameters
    ----------
    errors
        Columns of errors and the labels of their axes.
    line
        Columns whose values together identify a line.

    Returns
    -------
    Path
        The PNG file, ``name``.png in the directory.
    """
    cases = list(dict.fromkeys(table["case"]))
    names = table[line].astype(str).agg(", ".join, axis=1)
    looks: dict[str, dict[str, Any]] = {
        each: {"color": CURVES[i % len(CURVES)], "ls": "-" if i < len(CURVES) else "--"}
        for i, each in enumerate(dict.fromkeys(names))
    }
    with styled():
        figure, axes = plt.subplots(len(cases), len(errors), figsize=(11, 2.7 * len(cases) + 0.5), squeeze=False)
        for row, case in zip(axes, cases, strict=True):
            for axis, (column, label) in zip(row, errors.items(), strict=True):
                here = table["case"] == case
                _precision_lines(axis, table[here], names[here], column, looks)
                axis.set_xlabel(f"largest error of {label}")
            row[0].set_ylabel("ms per simulated second")
            row[0].set_title(case, loc="left")
        handles = [Line2D([], [], marker="o", ms=3, label=each, **look) for each, look in looks.items()]
        figure.legend(handles=handles, loc="outside upper center", ncols=4, fontsize=8)
        return save(figure, directory / f"{name}.png")


def _precision_lines(axis: Axes, table: pd.DataFrame, names: pd.Series, column: str, looks: dict[str, Any]) -> None:
    """Draw one panel; it stays empty if the case does not have this quantity."""
    drawn = False
    for name, rows in table.groupby(names, sort=False):
        shown = rows[rows[column] > 0.0] if column in rows else rows.iloc[:0]
        time = "ms_per_s_median" if "ms_per_s_median" in rows else "ms_per_s"
        errors: Any = shown.get(column, [])
        axis.plot(errors, shown[time], "o", ms=3, **looks[str(name)])
        drawn |= len(shown) > 0
    if not drawn:
        axis.set_axis_off()
        return
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.invert_xaxis()


def plot_scaling(tables: dict[str, pd.DataFrame], directory: Path) -> Path:
    """Draw run time against simulated time, restarts and number of scenes, and the memory used.

    ``tables`` are those of :mod:`vibroplat.bench.peers.scaling` by name. Returns the PNG file, scaling.png.
    """
    with styled():
        figure, axes = plt.subplots(2, 2, figsize=(11, 7.5))
        lengths, restarts, scenes, memory = axes.flat
        for i, (peer, of_peer) in enumerate(tables["time"].groupby("peer", sort=False)):
            for style, (scene, rows) in zip(("-", "--"), of_peer.groupby("scene", sort=False), strict=False):
                label = f"{peer}: {scene}"
                lengths.loglog(
                    rows["simulated_s"], rows["wall_s"], style, marker="o", ms=3, color=CURVES[i], label=label
                )
        lengths.set(xlabel="simulated time (s)", ylabel="run time (s)", title="simulated time")
        lengths.legend(fontsize=7)
        for i, (restitution, rows) in enumerate(tables["events"].groupby("restitution")):
            shown = rows[rows["outcome"] == "ok"]
            restarts.plot(shown["restarts_per_s"], shown["ms_per_s"], "o", color=CURVES[i], label=f"R {restitution}")
        restarts.set(
            xlabel="restarts per simulated second", ylabel="ms per simulated second", title="events, vibroplat"
        )
        restarts.set_ylim(bottom=0.0)
        restarts.legend()
        for i, (jobs, rows) in enumerate(tables["scenes"].groupby("jobs")):
            scenes.plot(rows["scenes"], rows["wall_s"], "o-", color=CURVES[i], label=f"{jobs} at a time")
        scenes.set(xlabel="scenes of 5 s", ylabel="run time (s)", title="number of scenes, vibroplat")
        scenes.set_ylim(bottom=0.0)
        scenes.legend()
        largest = tables["memory"].groupby("peer", sort=False)[["loaded_mb", "added_mb"]].max()
        memory.barh(largest.index, largest["loaded_mb"], color=CURVES[0], label="loaded")
        memory.barh(
            largest.index, largest["added_mb"], left=largest["loaded_mb"], color=CURVES[1], label="added by a run"
        )
        memory.set(xlabel="memory (MB)", title="memory of a process", xlim=(0.0, 1.5 * largest["loaded_mb"].max()))
        memory.legend(loc="center right")
        return save(figure, directory / "scaling.png")
