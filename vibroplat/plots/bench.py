"""Figures of benchmarks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
from matplotlib.lines import Line2D

from vibroplat.plots.style import CURVES, MARKERS, REFERENCE, new_figure, save, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Errors shown in work–precision figures, by column: of our own benchmarks, and of comparisons with peers.
OWN = {"y_m": "$y$ (m)", "event_time_s": "event times (s)", "contact_force": "contact force (relative)"}
SCALED = {"coordinates": "coordinates (over their scales)"} | {
    key: OWN[key] for key in ("event_time_s", "contact_force")
}
#: Most panels side by side.
COLUMNS = 3


def plot_precision(table: pd.DataFrame, directory: Path, name: str, errors: dict[str, str], line: list[str]) -> Path:
    """Draw run time against error: a panel for each case and each error that it has.

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
    names = table[line].astype(str).agg(", ".join, axis=1)
    looks = _looks(list(dict.fromkeys(names)))
    panels = [
        (case, column, label)
        for case in dict.fromkeys(table["case"])
        for column, label in errors.items()
        if column in table and ((table["case"] == case) & (table[column] > 0.0)).any()
    ]
    rows = -(-len(panels) // COLUMNS)
    with styled():
        figure, axes = new_figure(rows, min(COLUMNS, len(panels)), (11.0, 2.6 * rows + 1.0))
        for axis, (case, column, label) in zip(axes.flat, panels, strict=False):
            here = table["case"] == case
            _precision_lines(axis, table[here], names[here], column, looks)
            axis.set_xlabel(f"largest error of {label}")
            axis.set_title(case, loc="left")
        for axis in axes.flat[len(panels) :]:
            axis.set_axis_off()
        for row in axes:
            row[0].set_ylabel("ms per simulated second")
        figure.suptitle("run time over error; more accurate to the right, faster below", x=0.01, ha="left")
        handles = [Line2D([], [], ms=4.5, label=each, **look) for each, look in looks.items()]
        spare = axes.flat[-1] if len(panels) < axes.size else None
        _place_legend(figure, spare, handles)
        return save(figure, directory, name)


def _place_legend(figure: Any, spare: Axes | None, handles: list[Line2D]) -> None:
    """Put the legend where a panel would be empty, or below all panels."""
    if spare is None:
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
    else:
        spare.legend(handles=handles, loc="center", fontsize=8.5)


def _looks(names: list[str]) -> dict[str, dict[str, Any]]:
    """Return the looks of lines: later ones are thinner and smaller, so that they leave visible what they lie on."""
    last = max(len(names) - 1, 1)
    return {
        name: {
            "color": CURVES[i % len(CURVES)],
            "ls": "-" if i < len(CURVES) else "--",
            "marker": MARKERS[i % len(MARKERS)],
            "lw": 2.6 - 1.8 * i / last,
            "mfc": "white" if i % 2 else CURVES[i % len(CURVES)],
        }
        for i, name in enumerate(names)
    }


def _precision_lines(axis: Axes, table: pd.DataFrame, names: pd.Series, column: str, looks: dict[str, Any]) -> None:
    """Draw one panel."""
    for number, (name, rows) in enumerate(table.groupby(names, sort=False)):
        shown = rows[rows[column] > 0.0]
        time = "ms_per_s_median" if "ms_per_s_median" in rows else "ms_per_s"
        axis.plot(shown[column], shown[time], ms=5.5 - 0.25 * number, mew=0.9, **looks[str(name)])
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.invert_xaxis()


def plot_scaling(tables: dict[str, pd.DataFrame], directory: Path) -> Path:
    """Draw run time against simulated time, restarts and number of scenes, and the memory used.

    ``tables`` are those of :mod:`vibroplat.bench.peers.scaling` by name. Returns the PNG file, scaling.png.
    """
    with styled():
        figure, axes = new_figure(2, 2, (11.0, 7.5))
        lengths, restarts, scenes, memory = axes.flat
        _lengths(lengths, tables["time"])
        _restarts(restarts, tables["events"])
        _scenes(scenes, tables["scenes"])
        _memory(memory, tables["memory"])
        return save(figure, directory, "scaling")


def _lengths(axis: Axes, table: pd.DataFrame) -> None:
    for i, (peer, of_peer) in enumerate(table.groupby("peer", sort=False)):
        for style, (scene, rows) in zip(("-", "--"), of_peer.groupby("scene", sort=False), strict=False):
            label = f"{peer}: {str(scene).replace('f_e', '$f_e$ =')} Hz"
            look: dict[str, Any] = {"color": CURVES[i], "marker": MARKERS[i], "ms": 4.0, "label": label}
            axis.loglog(rows["simulated_s"], rows["wall_s"], style, **look)
    axis.set(xlabel="simulated time (s)", ylabel="run time (s)", title="simulated time")
    axis.legend(fontsize=8)


def _restarts(axis: Axes, table: pd.DataFrame) -> None:
    for i, (restitution, rows) in enumerate(table.groupby("restitution")):
        shown = rows[rows["outcome"] == "ok"]
        look: dict[str, Any] = {
            "color": CURVES[i],
            "mfc": "none",
            "ms": 7.0 - 1.5 * i,
            "label": f"$R$ = {restitution:g}",
        }
        axis.plot(shown["restarts_per_s"], shown["ms_per_s"], MARKERS[i], **look)
    axis.set(xlabel="restarts per simulated second", ylabel="ms per simulated second", title="events, vibroplat")
    axis.set_ylim(bottom=0.0)
    axis.legend()


def _scenes(axis: Axes, table: pd.DataFrame) -> None:
    for i, (jobs, rows) in enumerate(table.groupby("jobs")):
        label = f"{jobs} process{'' if jobs == 1 else 'es'}"
        axis.plot(rows["scenes"], rows["wall_s"], f"{MARKERS[i]}-", ms=4.5, color=CURVES[i], label=label)
    axis.set(xlabel="scenes of 5 s", ylabel="run time (s)", title="number of scenes, vibroplat")
    axis.set_ylim(bottom=0.0)
    axis.legend()


def _memory(axis: Axes, table: pd.DataFrame) -> None:
    """Draw the memory of processes; what a run adds is too little for a bar, and stands beside it."""
    largest = table.groupby("peer", sort=False)[["loaded_mb", "added_mb"]].max().iloc[::-1]
    axis.barh(largest.index, largest["loaded_mb"], color=CURVES[0], height=0.7)
    for place, (loaded, added) in enumerate(largest.itertuples(index=False)):
        axis.text(loaded, place, f" +{added:.1f}", va="center", fontsize=8, color=REFERENCE)
    axis.set(xlabel="memory when loaded, and what a run adds (MB)", title="memory of a process")
    axis.set_xlim(0.0, 1.15 * largest["loaded_mb"].max())
    axis.grid(visible=False, axis="y")
