"""Figures of a run, drawn from its tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from vibroplat.errors import TableError
from vibroplat.plots.reading import read_parts, read_result
from vibroplat.plots.style import CONTACT, FORCE, MATERIAL, PLATFORM, plain, plt, save, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Most points of a line over the whole run, more than a figure can show.
POINTS = 20_000
#: Turns of the exciters shown by motion and force if no interval is given.
SHOWN_TURNS = 10


@dataclass(frozen=True)
class _Result:
    """Tables of a run: the trajectory thinned out, and both tables cut to the interval shown."""

    name: str
    whole: pd.DataFrame
    shown: pd.DataFrame
    events: pd.DataFrame
    co_rotating: bool


def plot_run(
    directory: Path, kinds: Sequence[str], start: float | None = None, stop: float | None = None
) -> list[Path]:
    """Draw figures of a run and save them in its directory.

    Parameters
    ----------
    directory
        Result directory of ``vibroplat run``.
    kinds
        ``motion`` (y and gap), ``force`` (contact force), ``exciters`` (speeds and phase difference).
    start, stop
        Interval shown by motion and force (s). Default: the last ten turns of the exciters.

    Returns
    -------
    list of Path
        The PNG files. ``force`` is omitted if the scene has no contact.

    Raises
    ------
    TableError
        Tables are missing or have another schema version, or the interval is empty.
    """
    result = _read(directory, start, stop)
    written = []
    for kind in kinds:
        if kind == "force" and "contact_force_n" not in result.shown:
            continue
        with styled():
            written.append(save(FIGURES[kind](result), directory / f"{kind}.png"))
    return written


def of_tables(
    summary: Mapping[str, Any],
    trajectory: pd.DataFrame,
    events: pd.DataFrame,
    start: float | None = None,
    stop: float | None = None,
) -> _Result:
    """Prepare the tables of a run for :data:`FIGURES`; parameters as of :func:`plot_run`."""
    if trajectory.empty:
        raise TableError("the trajectory is empty; there is nothing to plot")
    first, last = trajectory["t_s"].iloc[0], trajectory["t_s"].iloc[-1]
    begin, end = _interval(summary["excitation_frequency_hz"], first, last, start, stop)
    whole, shown = _thinned_and_cut([trajectory], math.ceil(len(trajectory) / POINTS), begin, end)
    _, cut = _thinned_and_cut([events], 1, begin, end)
    _require_data(shown, begin, end, first, last)
    return _Result(summary["name"], whole, shown, cut, summary.get("rotation") == "co-rotating")


def _interval(
    frequency: float | None, first: float, last: float, start: float | None, stop: float | None
) -> tuple[float, float]:
    """Return the interval to show (s)."""
    end = last if stop is None else stop
    begin = max(first, end - SHOWN_TURNS / frequency) if frequency else first
    return begin if start is None else start, end


def _require_data(shown: pd.DataFrame, begin: float, end: float, first: float, last: float) -> None:
    """Refuse an interval with less than two times."""
    if shown["t_s"].nunique() < 2:
        raise TableError(f"no data from {begin:g} to {end:g} s; the run lasted from {first:g} to {last:g} s")


def _read(directory: Path, start: float | None, stop: float | None) -> _Result:
    result = read_result(directory, "run")
    summary = result.document("summary")
    if not _is_summary(summary):
        raise TableError(f"{directory / 'summary.json'} is not the summary of a run")
    angles = ("phi1_rad", "phi2_rad", "phi1_rate_rad_per_s", "phi2_rate_rad_per_s")
    parts = (part["t_s"] for part in read_parts(result, "trajectory", (), ("t_s",)))
    times = [(len(part), part.min(), part.max()) for part in parts if len(part)]
    if not times:
        raise TableError(f"{directory} holds an empty trajectory; there is nothing to plot")
    rows, first, last = sum(n for n, *_ in times), float(min(t for _, t, _ in times)), float(max(t for *_, t in times))
    begin, end = _interval(summary["excitation_frequency_hz"], first, last, start, stop)
    trajectory = read_parts(result, "trajectory", "mode", ("t_s", "y_m", *angles), ("gap_m", "contact_force_n"))
    whole, shown = _thinned_and_cut(trajectory, math.ceil(rows / POINTS), begin, end)
    _, events = _thinned_and_cut(read_parts(result, "events", "kind", ("t_s", "impulse_n_s")), 1, begin, end)
    _require_data(shown, begin, end, first, last)
    co_rotating = summary.get("rotation") == "co-rotating"
    return _Result(summary["name"], whole, shown, events, co_rotating)


def _thinned_and_cut(
    parts: Iterable[pd.DataFrame], every: int, begin: float, end: float
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return one row in so many of a table in parts, and its rows in an interval (s)."""
    thinned, cut, rows = [], [], 0
    for part in parts:
        thinned.append(part.iloc[-rows % every :: every])
        cut.append(part[part["t_s"].between(begin, end)])
        rows += len(part)
    return pd.concat(thinned, ignore_index=True), pd.concat(cut, ignore_index=True)


def _is_summary(found: object) -> bool:
    """Whether a document has what figures need of the summary of a run."""
    if not isinstance(found, dict) or not isinstance(found.get("name"), str) or "excitation_frequency_hz" not in found:
        return False
    frequency = found["excitation_frequency_hz"]
    return frequency is None or (type(frequency) in (int, float) and frequency >= 0.0)


def _motion(result: _Result) -> Figure:
    """Draw the platform's y and below it the gap; contact is shaded, impacts are marked."""
    table = result.shown
    has_gap = "gap_m" in table
    figure, axes = plt.subplots(1 + has_gap, 1, figsize=(8, 2.6 + 2.2 * has_gap), sharex=True, squeeze=False)
    top: Axes = axes[0, 0]
    top.plot(table["t_s"], 1e3 * table["y_m"], color=PLATFORM)
    top.set_ylabel("platform y (mm)")
    top.set_title(plain(result.name), loc="left")
    if has_gap:
        bottom: Axes = axes[1, 0]
        bottom.plot(table["t_s"], 1e3 * table["gap_m"], color=MATERIAL)
        bottom.set_ylabel("gap (mm)")
        impacts = result.events[result.events["kind"] == "impact"]
        bottom.plot(impacts["t_s"], np.zeros(len(impacts)), "v", color="black", ms=5, label="impact", clip_on=False)
        for axis in (top, bottom):
            _shade_contact(axis, table)
        bottom.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
    axes[-1, 0].set_xlabel("t (s)")
    return figure


def _force(result: _Result) -> Figure:
    """Draw the contact force, and the impulses of impacts as stems on a second axis."""
    table, events = result.shown, result.events
    figure, axis = plt.subplots(figsize=(8, 3.0))
    _shade_contact(axis, table)
    axis.plot(table["t_s"], table["contact_force_n"], color=FORCE)
    axis.set_xlabel("t (s)")
    axis.set_ylabel("contact force (N)", color=FORCE)
    axis.set_title(plain(result.name), loc="left")
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
    """Draw the speeds of both exciters and their phase difference over the whole run."""
    table = result.whole
    figure, (top, bottom) = plt.subplots(2, 1, figsize=(8, 4.8), sharex=True)
    for number, style in ((1, "-"), (2, "--")):
        speed = table[f"phi{number}_rate_rad_per_s"].abs() / (2.0 * np.pi)
        top.plot(table["t_s"], speed, style, lw=0.9, label=f"exciter {number}")
    top.set_ylabel("speed (Hz)")
    top.set_title(plain(result.name), loc="left")
    top.legend(loc="best", ncols=2)
    sign = -1.0 if result.co_rotating else 1.0
    phase = np.mod(table["phi1_rad"] + sign * table["phi2_rad"], 2.0 * np.pi)
    bottom.plot(table["t_s"], phase, ".", ms=1.5, color=PLATFORM)
    bottom.set_ylim(-0.2, 2.0 * np.pi + 0.2)
    bottom.set_yticks([0.0, np.pi, 2.0 * np.pi], ["0 in-phase", "π antiphase", "2π"])
    bottom.set_ylabel("φ₁ − φ₂" if result.co_rotating else "φ₁ + φ₂")
    bottom.set_xlabel("t (s)")
    return figure


def _shade_contact(axis: Axes, table: pd.DataFrame) -> None:
    """Shade the times in mode ``attached``."""
    attached = (table["mode"] == "attached").to_numpy()
    t = table["t_s"].to_numpy()
    edges = np.flatnonzero(np.diff(np.concatenate(([0], attached.astype(int), [0]))))
    for number, (first, after) in enumerate(zip(edges[::2], edges[1::2], strict=True)):
        axis.axvspan(t[first], t[after - 1], color=CONTACT, lw=0, zorder=0, label="attached" if number == 0 else None)


FIGURES: dict[str, Callable[[_Result], Figure]] = {"motion": _motion, "force": _force, "exciters": _exciters}
