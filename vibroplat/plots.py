"""Figures from result tables alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
import pandas as pd

from vibroplat.errors import TableError
from vibroplat.provenance import SCHEMA
from vibroplat.tables import read_json, read_table

mpl.use("Agg")

import matplotlib.pyplot as plt

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Turns of the exciters that motion and force show when no interval is asked for.
SHOWN_TURNS = 10

_STYLE: Any = {
    "figure.constrained_layout.use": True,
    "figure.dpi": 130,
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.alpha": 0.25,
    "lines.linewidth": 1.3,
    "font.size": 9.5,
    "legend.frameon": False,
}
_ENGINES = {"native": "#1f4e79", "sundae": "#c05a1c"}
_PLATFORM, _MATERIAL, _FORCE, _CONTACT = "#1f4e79", "#c05a1c", "#2a7f4f", "#dfe8f1"


@dataclass(frozen=True)
class _Result:
    """Tables of a run, cut to the interval shown."""

    name: str
    whole: pd.DataFrame
    shown: pd.DataFrame
    events: pd.DataFrame


def plot_run(
    directory: Path, kinds: Sequence[str], start: float | None = None, stop: float | None = None
) -> list[Path]:
    """Draw figures of a run into its directory.

    Parameters
    ----------
    directory
        What ``vibroplat run`` has written.
    kinds
        ``motion`` (y and gap), ``force`` (contact force), ``exciters`` (speeds and phase difference).
    start, stop
        Interval of motion and force (s); the last ten turns of the exciters if neither is given.

    Returns
    -------
    list of Path
        The PNG files. ``force`` is left out where the scene has no contact.

    Raises
    ------
    TableError
        Tables are missing or of a version this one does not read, or the interval is empty.
    """
    result = _read(directory, start, stop)
    written = []
    for kind in kinds:
        if kind == "force" and "contact_force_n" not in result.shown:
            continue
        with mpl.rc_context(_STYLE):
            figure = FIGURES[kind](result)
            path = directory / f"{kind}.png"
            try:
                figure.savefig(path)
            except OSError as error:
                raise TableError(f"{path} cannot be written: {error.strerror or error}") from None
            finally:
                plt.close(figure)
        written.append(path)
    return written


def plot_precision(table: pd.DataFrame, directory: Path, name: str = "precision") -> Path:
    """Draw run time against error, a row of panels for each case with a line for each engine and integrator.

    Returns the PNG file, ``name``.png in the directory.
    """
    errors = {"y_m": "y (m)", "event_time_s": "event time (s)", "contact_force": "contact force (relative)"}
    cases = list(dict.fromkeys(table["case"]))
    with mpl.rc_context(_STYLE):
        figure, axes = plt.subplots(len(cases), len(errors), figsize=(11, 2.7 * len(cases)), squeeze=False)
        for row, case in zip(axes, cases, strict=True):
            for axis, (column, label) in zip(row, errors.items(), strict=True):
                _precision_lines(axis, table[table["case"] == case], column)
                axis.set_xlabel(f"largest error of {label}")
            row[0].set_ylabel("ms per simulated second")
            row[0].set_title(case, loc="left")
            row[0].legend(fontsize=7)
        path = directory / f"{name}.png"
        figure.savefig(path)
        plt.close(figure)
    return path


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


def _read(directory: Path, start: float | None, stop: float | None) -> _Result:
    if not directory.is_dir():
        raise TableError(f"{directory} is no directory; allowed: one that `vibroplat run` has written")
    origin = read_json(directory, "provenance")
    found = origin.get("schema") if isinstance(origin, dict) else None
    if found != SCHEMA:
        raise TableError(f"{directory} holds results of schema {found}; this version reads schema {SCHEMA}")
    summary = read_json(directory, "summary")
    if not isinstance(summary, dict) or not {"name", "excitation_frequency_hz"} <= summary.keys():
        raise TableError(f"{directory / 'summary.json'} is no summary of a run")
    angles = ("phi1_rad", "phi2_rad", "phi1_rate_rad_per_s", "phi2_rate_rad_per_s")
    whole = _read_columns(directory, "trajectory", "mode", ("t_s", "y_m", *angles))
    events = _read_columns(directory, "events", "kind", ("t_s", "impulse_n_s"))
    if whole.empty:
        raise TableError(f"{directory} holds an empty trajectory; there is nothing to draw")
    first, last = float(whole["t_s"].min()), float(whole["t_s"].max())
    end = last if stop is None else stop
    frequency = summary["excitation_frequency_hz"]
    begin = start if start is not None else max(first, end - SHOWN_TURNS / frequency) if frequency else first
    shown = whole[whole["t_s"].between(begin, end)]
    if shown["t_s"].nunique() < 2:
        raise TableError(f"nothing between {begin} and {end} s; allowed: an interval within {first} … {last} s")
    return _Result(summary["name"], whole, shown, events[events["t_s"].between(begin, end)])


def _read_columns(directory: Path, name: str, label: str, numbers: Sequence[str]) -> pd.DataFrame:
    """Read a table that must have a column of labels and these of numbers."""
    table = read_table(directory, name)
    for column in numbers:
        if column not in table or not (pd.api.types.is_numeric_dtype(table[column]) or table.empty):
            raise TableError(f"the {name} table in {directory} has no numbers in column {column}")
    if label not in table:
        raise TableError(f"the {name} table in {directory} has no column {label}")
    return table


def _motion(result: _Result) -> Figure:
    """Y of the platform; below it the gap, with contact shaded and impacts marked."""
    table = result.shown
    has_gap = "gap_m" in table
    figure, axes = plt.subplots(1 + has_gap, 1, figsize=(8, 2.6 + 2.2 * has_gap), sharex=True, squeeze=False)
    top: Axes = axes[0, 0]
    top.plot(table["t_s"], 1e3 * table["y_m"], color=_PLATFORM)
    top.set_ylabel("platform y (mm)")
    top.set_title(result.name, loc="left")
    if has_gap:
        bottom: Axes = axes[1, 0]
        bottom.plot(table["t_s"], 1e3 * table["gap_m"], color=_MATERIAL)
        bottom.set_ylabel("gap (mm)")
        impacts = result.events[result.events["kind"] == "impact"]
        bottom.plot(impacts["t_s"], np.zeros(len(impacts)), "v", color="black", ms=5, label="impact", clip_on=False)
        for axis in (top, bottom):
            _shade_contact(axis, table)
        bottom.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
    axes[-1, 0].set_xlabel("t (s)")
    return figure


def _force(result: _Result) -> Figure:
    """Contact force, with the impulses of the impacts as stems on an axis of their own."""
    table, events = result.shown, result.events
    figure, axis = plt.subplots(figsize=(8, 3.0))
    _shade_contact(axis, table)
    axis.plot(table["t_s"], table["contact_force_n"], color=_FORCE)
    axis.set_xlabel("t (s)")
    axis.set_ylabel("contact force (N)", color=_FORCE)
    axis.set_title(result.name, loc="left")
    strikes = events[events["impulse_n_s"] > 0.0]
    if len(strikes):
        other = axis.twinx()
        other.grid(visible=False)
        other.spines["right"].set_visible(True)
        other.vlines(strikes["t_s"], 0.0, strikes["impulse_n_s"], color="black", lw=1.0)
        other.plot(strikes["t_s"], strikes["impulse_n_s"], "v", color="black", ms=4)
        other.set_ylim(bottom=0.0)
        other.set_ylabel("impulse (N s)")
    axis.set_ylim(bottom=0.0)
    return figure


def _exciters(result: _Result) -> Figure:
    """Speeds of both exciters and their phase difference over the whole run."""
    table = result.whole
    figure, (top, bottom) = plt.subplots(2, 1, figsize=(8, 4.8), sharex=True)
    for number, style in ((1, "-"), (2, "--")):
        speed = table[f"phi{number}_rate_rad_per_s"].abs() / (2.0 * np.pi)
        top.plot(table["t_s"], speed, style, lw=0.9, label=f"exciter {number}")
    top.set_ylabel("speed (Hz)")
    top.set_title(result.name, loc="left")
    top.legend(loc="best", ncols=2)
    phase = np.mod(table["phi1_rad"] + table["phi2_rad"], 2.0 * np.pi)
    bottom.plot(table["t_s"], phase, ".", ms=1.5, color=_PLATFORM)
    bottom.set_ylim(-0.2, 2.0 * np.pi + 0.2)
    bottom.set_yticks([0.0, np.pi, 2.0 * np.pi], ["0 in-phase", "π antiphase", "2π"])
    bottom.set_ylabel("φ₁ + φ₂")
    bottom.set_xlabel("t (s)")
    return figure


def _shade_contact(axis: Axes, table: pd.DataFrame) -> None:
    """Shade the stretches of time in mode ``attached``."""
    attached = (table["mode"] == "attached").to_numpy()
    t = table["t_s"].to_numpy()
    edges = np.flatnonzero(np.diff(np.concatenate(([0], attached.astype(int), [0]))))
    for number, (first, after) in enumerate(zip(edges[::2], edges[1::2], strict=True)):
        axis.axvspan(t[first], t[after - 1], color=_CONTACT, lw=0, zorder=0, label="attached" if number == 0 else None)


FIGURES: dict[str, Callable[[_Result], Figure]] = {"motion": _motion, "force": _force, "exciters": _exciters}
