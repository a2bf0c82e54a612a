"""Figures of a run, or of several laid over each other, drawn from their tables."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroplat.columns import FORCES, PHASE
from vibroplat.errors import TableError
from vibroplat.plots import accelerations, timelines
from vibroplat.plots.headlines import headline
from vibroplat.plots.histories import RATES, Drawn, Run, Shown, run_of, turns_of
from vibroplat.plots.measured import Measured, curve_of
from vibroplat.plots.style import (
    TOLD,
    begin_at_zero,
    head,
    legend_below,
    new_figure,
)
from vibroplat.results.files import directory_of
from vibroplat.results.labels import compared, distinct, run_parameters
from vibroplat.results.labels import named as label_of_runs
from vibroplat.results.picture import BLACK, CURVES, REFERENCE
from vibroplat.results.run import RunResult

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LOG = logging.getLogger("vibroplat")

#: Least range of the axes of x and y, over the largest range of what moves, that of the exciters' axes included.
LEAST_RANGE = 0.05
#: Range of a coordinate over the largest one, above which it has a panel.
MATTERS = 0.05
#: Most turns that are drawn as a line; more of them as an envelope.
MOST_TURNS = 60

_MOVING = ("x_m", "y_m", "phi_rad")

# -- figures -----------------------------------------------------------------------------------------------------------


def run_figures(
    directories: Sequence[Path],
    kinds: Sequence[str] = (),
    *,
    start: float | None = None,
    stop: float | None = None,
    data: Measured | None = None,
) -> Iterator[tuple[Path, str, Figure]]:
    """Draw figures of a run, or of several over each other; yield the directory and the name of each.

    Parameters
    ----------
    directories
        Result directories of ``vibroplat run``.
    kinds
        ``motion`` (platform and gap: the whole run, and its last turns), ``force`` (contact force and impulses),
        ``exciters`` (speeds and phase difference), ``loads`` (force into the foundation, strokes and speeds),
        ``acceleration`` and ``spectrum``, ``measured`` (measured data beside what was computed); all by default. Those
        that need what there is not (contact, accelerations, data) are left out, and refused if nothing else is asked
        for.
    start, stop
        Interval shown (s). Default: the whole run, and beside it the last turns of the exciters.
    data
        Measured data laid over the figures: y is counted from the static rest.

    Raises
    ------
    TableError
        Tables are missing or have another schema version, or the interval is empty.
    """
    given = [] if data is None else [*map(str, data.given)]
    if data is not None and data.shift is None and start is stop is None:
        start, stop = _measured_interval(data, RunResult.read(directories[0], "run").trajectory)
    runs = [run_of(RunResult.read(place, "run"), start, stop, given) for place in directories]
    if data is not None:
        numbers = [column for column in map(str, runs[0].shown.select_dtypes("number")) if column != "t_s"]
        data.select("t_s", numbers).fit(runs[0].shown)
        for column in numbers:
            data.compare(column, "t_s", [curve_of(run.shown, column) for run in runs if column in run.shown])
    shown = _shown(runs, directories, data)
    drawn = [kind for kind in kinds or FIGURES if not missing(kind, shown)]
    if not drawn:
        raise TableError(f"--kind {kinds[0]}: {directories[0]} {missing(kinds[0], shown)}")
    for kind in drawn:
        yield directory_of(directories[0], "run"), kind, draw(kind, shown)


def _measured_interval(data: Measured, whole: pd.DataFrame) -> tuple[float | None, float | None]:
    """Find the shift of measured data in a whole run, and the interval that they cover; (None, None) without one."""
    numbers = [column for column in map(str, whole.select_dtypes("number")) if column != "t_s"]
    if "t_s" not in data.given or not {*numbers} & {*map(str, data.given)}:
        return None, None
    found = replace(data, errors={}).select("t_s", numbers, [*map(str, data.given)])
    found.fit(whole)
    data.shift = found.shift
    first, last = (
        max(found.table["t_s"].min(), whole["t_s"].iloc[0]),
        min(found.table["t_s"].max(), whole["t_s"].iloc[-1]),
    )
    return (float(first), float(last)) if first < last else (None, None)


def missing(kind: str, shown: Shown) -> str:
    """Say what runs do not have that a figure needs; "" if nothing."""
    columns = {str(column) for run in shown.runs for column in run.shown}
    if kind == "force" and "contact_force_n" not in columns:
        return "has no contact force, as its scene is bare or non-impact"
    if kind in ("acceleration", "spectrum") and not any(column.startswith("acceleration_") for column in columns):
        return "has no accelerations; simulate it with --set output.accelerations=true"
    return "needs --data FILE" if kind == "measured" and shown.data is None else ""


def _shown(runs: Sequence[Run], directories: Sequence[Path], data: Measured | None) -> Shown:
    """Name several runs by how they differ."""
    if len(runs) == 1:
        return Shown(runs, data)
    names = distinct([run.name for run in runs], directories)
    return Shown(runs, data, compared("run", names, [run.scene for run in runs]))


def draw(kind: str, shown: Shown) -> Figure:
    """Draw a figure, with what it shows above it, and below it the lines of an axis that names them.

    Several runs are always named, by the lines of the last axis if there is no other.
    """
    figure, named = FIGURES[kind](shown)
    run = shown.only
    parameters = "" if run is None else run_parameters(run.scene, float(run.whole["t_s"].iloc[0]))
    told = [] if shown.data is None or kind != "measured" else shown.data.differences()
    names = label_of_runs([run.name for run in shown.runs], parameters)
    head(figure, "; ".join(told) or headline(kind, shown.runs), names)
    if run is None or named is not None:
        legend_below(figure, (named or figure.axes[-1]).get_legend_handles_labels()[0])
    return figure


def _legend_above(axis: Axes, columns: int = 1) -> None:
    """Name what has a name in a panel; an envelope has none."""
    if axis.get_legend_handles_labels()[0]:
        axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.0, ncols=columns)


def _over_time(shown: Shown, rows: Sequence[str], more: int = 0) -> tuple[Figure, Any, bool]:
    """Draw columns over time, the range of each turn of a long run on the left and its last turns on the right.

    Both have the scale of the whole run. ``more`` panels below are left to others.
    """
    overview = not any(run.chosen for run in shown.runs) and any(run.is_long for run in shown.runs)
    count = len(rows) + more
    figure, axes = new_figure(
        count, 1 + overview, (10.0 if overview else 8.0, 1.5 + 1.45 * count),
        sharex="col", sharey="row", width_ratios=[2.2, 1.0] if overview else None,
    )  # fmt: skip
    for column, row in zip(rows, axes, strict=False):
        for axis in row:
            _draw(axis, shown, column, detail=axis is row[-1])
        if overview:
            row[-1].set_ylabel("")
    if overview:
        turns = round(turns_of(shown.runs[0].last))
        axes[0, 0].set_title("whole run: range of each turn", loc="left", color=TOLD, fontsize=8.5)
        axes[0, 1].set_title(f"last {turns} turns", loc="left", color=TOLD, fontsize=8.5)
        axes[-1, 0].set_xlabel("time (s)")
    axes[-1, -1].set_xlabel(shown.detail)
    return figure, axes, overview


def _motion(shown: Shown) -> Drawn:
    """Draw the platform and the gap."""
    runs = shown.runs
    largest = [max(run.range_of(c) for c in _MOVING) for run in runs]
    rows = ["y_m"]
    for column in ("x_m", "phi_rad"):
        if any(run.range_of(column) > MATTERS * most for run, most in zip(runs, largest, strict=True)):
            rows.append(column)
    rows += ["gap_m"] if any("gap_m" in run.shown for run in runs) else []
    figure, axes, _ = _over_time(shown, rows)
    if shown.only is not None:
        if "gap_m" in rows:
            _legend_above(axes[-1, -1], 2)
        if shown.data is not None:
            _legend_above(axes[0, -1])
    return figure, None


def _draw(axis: Axes, shown: Shown, column: str, *, detail: bool = True) -> None:
    """Draw a coordinate in detail, or its range over the whole run.

    If there is one run, contact is shaded and impacts are marked in detail.
    """
    alone = shown.only is not None
    for number, run in enumerate(shown.runs):
        if column not in run.shown:
            continue
        look = shown.look(number, column)
        if not detail or run.turns > MOST_TURNS:
            colour, label = look["color"], look.get("label")
            timelines.draw_envelope(axis, run.envelope, column, color=colour, label=label, filled=alone)
            continue
        timelines.draw_coordinate(axis, shown.last(run), column, **look)
        if alone and column in ("y_m", "x_m", "phi_rad", "gap_m", "contact_force_n") and "gap_m" in run.shown:
            timelines.draw_contact(axis, run.last)
            if column == "gap_m":
                timelines.draw_impacts(axis, _during(run))
    if column == "y_m" and all(run.from_rest for run in shown.runs):
        axis.set_ylabel(timelines.FROM_REST)
    if shown.data is not None:
        shown.data.draw(axis, "t_s", column, inside=True)
    if detail and column in ("x_m", "y_m"):
        _no_noise(axis, shown)


def _during(run: Run) -> pd.DataFrame:
    """Return the events of the last turns."""
    return run.events[run.events["t_s"] >= float(run.last["t_s"].iloc[0])]


def _no_noise(axis: Axes, shown: Shown) -> None:
    """Widen an axis of x or y on which numerical noise would fill the panel."""
    ranges = [run.size(run.shown[c], c) for run in shown.runs for c in _MOVING if c in run.shown]
    least, (low, high) = LEAST_RANGE * 1e3 * max(ranges), axis.get_ylim()
    if high - low < least:
        axis.set_ylim(0.5 * (low + high - least), 0.5 * (low + high + least))


def _force(shown: Shown) -> Drawn:
    """Draw the contact force, and below it the impulses of impacts as stems: they are no forces."""
    strikes = any((_during(run)["impulse_n_s"] > 0.0).any() for run in shown.runs)
    ratios = {"height_ratios": [2.0, 1.0]} if strikes else {}
    figure, axes = new_figure(1 + strikes, 1, (8.0, 4.4 if strikes else 3.2), sharex=True, gridspec_kw=ratios)
    force: Axes = axes[0, 0]
    _draw(force, shown, "contact_force_n")
    begin_at_zero(force)
    for number, run in enumerate(shown.runs if strikes else []):
        events = _during(run)
        events = events.assign(t_s=events["t_s"] - shown.origin(run))
        look = shown.look(number, "")
        timelines.draw_impulses(axes[1, 0], events, BLACK if shown.only else look["color"], look.get("label"))
    if strikes and shown.only is not None and shown.only.turns <= MOST_TURNS:
        timelines.draw_contact(axes[1, 0], shown.only.last)
    axes[-1, 0].set_xlabel(shown.detail)
    if any(patch.get_label() == "attached" for patch in force.patches) or shown.data is not None:
        _legend_above(force, 2)
    return figure, None


def _exciters(shown: Shown) -> Drawn:
    """Draw the speeds of both exciters and their phase difference."""
    only = shown.only
    figure, axes = new_figure(2, 1, (8.0, 4.4), sharex=True)
    speeds, phases = axes[:, 0]
    for number, run in enumerate(shown.runs):
        colour = CURVES[number % len(CURVES)]
        _speeds(speeds, run, (colour, CURVES[1] if only else colour))
        if only is not None and only.scene is not None:
            timelines.draw_synchronous_speed(speeds, only.scene, run.whole["t_s"])
        label = None if only else shown.names[number]
        timelines.draw_phase_difference(
            phases, run.whole, co_rotating=run.co_rotating, color=BLACK if only else colour, label=label
        )
    if only is None:
        for number, style in enumerate(("-", "--"), 1):
            phases.plot([], [], label=f"exciter {number}", ls=style, color=REFERENCE)
    if len({run.co_rotating for run in shown.runs}) > 1:
        phases.set_ylabel(PHASE)
    phases.set_xlabel("time (s)")
    return figure, speeds if only else phases


def _speeds(axis: Axes, run: Run, colours: tuple[str, str]) -> None:
    """Draw the speeds of both exciters over the whole run; of many turns their range in each, and its middle."""
    envelope = run.envelope
    if turns_of(run.whole) <= MOST_TURNS or f"{RATES[0]}:max" not in envelope:
        timelines.draw_speeds(axis, run.whole, colours)
        return
    ranges = [envelope[[f"{rate}:min", f"{rate}:max"]].astype(float) / timelines.TURN for rate in RATES]
    same = timelines.coincide(*(found.mean(axis=1).abs() for found in ranges))
    for found, colour in zip(ranges[: 1 if same else 2], colours, strict=False):
        low, high = (found * np.sign(found.to_numpy().sum())).to_numpy().T
        look: dict[str, Any] = {"alpha": timelines.PALE, "lw": 0.0, "label": "range in each turn"}
        axis.fill_between(envelope["t_s"], low, high, color=colour, **look)
    middle = {rate: timelines.TURN * found.mean(axis=1) for rate, found in zip(RATES, ranges, strict=True)}
    timelines.draw_speeds(axis, envelope[["t_s"]].assign(**middle), colours)


def _loads(shown: Shown) -> Drawn:
    """Draw forces into the foundation and displacements with their peaks, and the speeds."""
    rows: list[str] = []
    for columns in (FORCES, ("y_m", "x_m")):
        ranges = {c: max(run.range_of(c) for run in shown.runs) for c in columns}
        rows += [c for c in columns if ranges[c] > MATTERS * max(ranges.values())]
    figure, axes, overview = _over_time(shown, rows, 1)
    for number, run in enumerate(shown.runs):
        colour = CURVES[number % len(CURVES)]
        pair = (colour, CURVES[1] if shown.only else colour)
        _speeds(axes[-1, 0], run, pair)
        if overview:
            timelines.draw_speeds(axes[-1, 1], shown.last(run), pair)
            axes[-1, 1].set_ylabel("")
        for axis, column in zip(axes[:, 0], rows, strict=False):
            if shown.only and column in run.peaks:
                timelines.mark_peak(axis, run.envelope, column, *run.peaks[column])
    return figure, axes[-1, 0] if shown.only or not rows else axes[0, 0]


FIGURES: dict[str, Callable[[Shown], Drawn]] = {
    "motion": _motion,
    "force": _force,
    "exciters": _exciters,
    "loads": _loads,
    "acceleration": accelerations.draw_accelerations,
    "spectrum": accelerations.draw_spectra,
    "measured": accelerations.draw_measured,
}
