"""Figures of a run, or of several laid over each other, drawn from their tables."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from vibroplat.columns import COORDINATES, PHASE
from vibroplat.config.scene import Scene
from vibroplat.errors import TableError
from vibroplat.plots import timelines
from vibroplat.plots.labels import compared, distinct, run_parameters
from vibroplat.plots.reading import Cut, Ends, Saved, ends_of, rest_of
from vibroplat.plots.style import (
    BLACK,
    CURVES,
    FORCE,
    MATERIAL,
    PLATFORM,
    REFERENCE,
    begin_at_zero,
    head,
    legend_below,
    new_figure,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LOG = logging.getLogger("vibroplat")

#: Most points of a line, more than a figure can show.
POINTS = 20_000
#: Most bins of an envelope; none is shorter than a turn, over which it would not be one.
BINS = 400
#: Turns of the exciters that are shown in detail if no interval is given.
SHOWN_TURNS = 10
#: Least range of the axes of x and y, over the largest range of what moves, that of the exciters' axes included.
LEAST_RANGE = 0.05
#: Range of a coordinate over the largest one, above which it has a panel.
MATTERS = 0.05
#: Most turns that are drawn as a line; more of them as an envelope.
MOST_TURNS = 60

_ANGLES = ("phi1_rad", "phi2_rad", "phi1_rate_rad_per_s", "phi2_rate_rad_per_s")
_MOVING = ("x_m", "y_m", "phi_rad")

# -- tables ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Run:
    """Tables of a run over the interval of its figures.

    Attributes
    ----------
    name, scene
        Its name, and its scene if the configuration can be read.
    whole
        The trajectory in that interval, thinned out.
    envelope
        Its least and largest values in short intervals: columns ``t_s``, ``y_m:min``, ``y_m:max`` …
    shown
        The rows shown in detail: all in the interval if one was given, otherwise the last turns.
    events
        The events among them.
    co_rotating
        Whether the exciters co-rotate.
    chosen
        Whether an interval was given.
    from_rest
        Whether y is counted from the static rest; if that is not known, it is as in the table.
    """

    name: str
    scene: Scene | None
    whole: pd.DataFrame
    envelope: pd.DataFrame
    shown: pd.DataFrame
    events: pd.DataFrame
    co_rotating: bool
    chosen: bool
    from_rest: bool

    @property
    def turns(self) -> float:
        """Turns of exciter 1 in the rows shown."""
        angles = self.shown["phi1_rad"]
        return abs(float(angles.iloc[-1] - angles.iloc[0])) / (2.0 * math.pi)

    @property
    def is_long(self) -> bool:
        """Whether it is much longer than its part shown in detail."""
        return float(np.ptp(self.whole["t_s"])) > 1.5 * float(np.ptp(self.shown["t_s"]))

    def range_of(self, column: str) -> float:
        """Return the range of a coordinate over the whole interval (m)."""
        ends = [f"{column}:min", f"{column}:max"]
        return self.size(self.envelope[ends], column) if ends[0] in self.envelope else 0.0

    def size(self, values: pd.DataFrame | pd.Series, column: str) -> float:
        """Return the range of a coordinate's values (m); of a rotation, that of the exciters' axes."""
        arm = (self.scene.body.distance if self.scene else 0.1) if column == "phi_rad" else 1.0
        found = values.to_numpy(dtype=float)
        found = found[np.isfinite(found)]
        return arm * float(np.ptp(found)) if len(found) else 0.0


#: How messages call a run in memory, an end of an interval of it, and a trajectory without rows.
_IN_MEMORY = ("the run lasted", "{} = {:g}", "the trajectory is empty")


def read_run(directory: Path, start: float | None = None, stop: float | None = None) -> Run:
    """Read the tables of a run from ``start`` to ``stop`` (s); raises as :func:`run_of`, and where one is missing."""
    result = Saved(directory, "run")
    summary = result.summary
    frequency = summary.get("excitation_frequency_hz", "")
    known = frequency is None or (type(frequency) in (int, float) and frequency >= 0.0)
    if not known or not isinstance(summary.get("name"), str):
        raise TableError(f"{directory / 'summary.json'} is not the summary of a run")
    ends = ends_of(result.column_parts("trajectory", (), ("t_s",)))
    optional = [column for column in COORDINATES if column != "y_m"]
    trajectory = result.column_parts("trajectory", ("mode",), ("t_s", "y_m", *_ANGLES), optional)
    events = result.column_parts("events", ("kind",), ("t_s", "impulse_n_s"))
    told = (f"{directory} runs", "--{} {:g}", f"{directory} holds an empty trajectory")
    return run_of(summary, result.known_scene, ends, trajectory, events, start, stop, told)


def run_of(
    summary: Mapping[str, Any],
    scene: Scene | None,
    ends: Ends | None,
    trajectory: Iterable[pd.DataFrame],
    events: Iterable[pd.DataFrame],
    start: float | None = None,
    stop: float | None = None,
    told: tuple[str, str, str] = _IN_MEMORY,
) -> Run:
    """Cut the tables of a run, in parts, from ``start`` to ``stop`` (s).

    Raises
    ------
    TableError
        The trajectory is empty, or the interval holds no data.
    """
    subject, option, empty = told
    if ends is None:
        raise TableError(f"{empty}; there is nothing to plot")
    first, last = float(ends.first["t_s"]), float(ends.last["t_s"])
    length = f"{subject} from {first:g} to {last:g} s"
    begin, end = _interval(first, last, start, stop, length, option)
    frequency = summary["excitation_frequency_hz"]
    chosen = start is not None or stop is not None
    detail = max(begin, end - SHOWN_TURNS / frequency) if frequency and not chosen else begin
    turns = int((end - begin) * (frequency or 0.0))
    bins = min(turns, BINS) if turns else BINS
    sag = summary.get("static_sag_m") if scene is None else -rest_of(scene)
    parts = (part.assign(y_m=part["y_m"] + (sag or 0.0)) for part in trajectory)
    found = Cut(parts, (detail, end), (begin, end, bins), COORDINATES, every=math.ceil(ends.rows / POINTS))
    shown_events = pd.concat([part[part["t_s"].between(detail, end)] for part in events], ignore_index=True)
    if found.shown["t_s"].nunique() < 2:
        raise TableError(f"no data between {begin:g} and {end:g} s; {length}")
    co_rotating = summary.get("rotation") == "co-rotating"
    cut = (found.thinned, found.envelope(), found.shown, shown_events)
    return Run(summary["name"], scene, *cut, co_rotating, chosen, from_rest=sag is not None)


def _interval(
    first: float, last: float, start: float | None, stop: float | None, length: str, option: str
) -> tuple[float, float]:
    """Return the interval of the figures; say how long the run was where the one given lies outside, or in part."""
    begin, end = first if start is None else start, last if stop is None else stop
    given = [(name, value) for name, value in (("start", start), ("stop", stop)) if value is not None]
    beyond = [("start", begin)] if begin > last else [("stop", end)] if end < first else []
    for name, value in [(name, value) for name, value in given if math.isnan(value)] + beyond:
        raise TableError(f"{option.format(name, value)}: {length}; allowed: a time within it")
    if begin >= end:
        raise TableError(f"{option.format('start', begin)} is not before {option.format('stop', end)}; {length}")
    for name, value in given:
        if not first <= value <= last:
            _LOG.warning("%s: %s; the figures show what there is", option.format(name, value), length)
    return max(begin, first), min(end, last)


# -- figures -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Shown:
    """The runs of a figure, measured data laid over them, and what several of them are called."""

    runs: Sequence[Run]
    data: timelines.Measured | None = None
    names: Sequence[str] = ()

    @property
    def only(self) -> Run | None:
        """The run, if there is one."""
        return self.runs[0] if len(self.runs) == 1 else None

    @property
    def aligned(self) -> bool:
        """Whether times are counted from a whole turn of exciter 1, to compare the last turns of several runs."""
        return self.only is None and self.data is None and not any(run.chosen for run in self.runs)

    @property
    def detail(self) -> str:
        """The label of the horizontal axis where turns are shown in detail."""
        return "$t$ since a whole turn of exciter 1 (s)" if self.aligned else "$t$ (s)"

    def origin(self, run: Run) -> float:
        """Return the time (s) from which those of a run are counted in detail."""
        if not self.aligned:
            return 0.0
        turns = run.shown["phi1_rad"].abs() // (2.0 * np.pi)
        return float(run.shown["t_s"].iloc[int(turns.gt(turns.iloc[0]).argmax())])

    def look(self, number: int, column: str) -> dict[str, Any]:
        """Return the look of a run's line: a colour for each quantity, or for each run if there are several."""
        if self.only is not None:
            return {"color": {"gap_m": MATERIAL, "contact_force_n": FORCE}.get(column, PLATFORM)}
        colour = CURVES[number % len(CURVES)]
        return {"color": colour, "label": self.names[number], "lw": 1.8 - 0.9 * number / len(self.runs), "alpha": 0.9}


def run_figures(
    directories: Sequence[Path],
    kinds: Sequence[str] = (),
    *,
    start: float | None = None,
    stop: float | None = None,
    data: Path | None = None,
) -> Iterator[tuple[Path, str, Figure]]:
    """Draw figures of a run, or of several over each other; yield the directory and the name of each.

    Parameters
    ----------
    directories
        Result directories of ``vibroplat run``.
    kinds
        ``motion`` (platform and gap: the whole run, and its last turns), ``force`` (contact force and impulses),
        ``exciters`` (speeds and phase difference); all by default. ``force`` is left out if no scene has contact, and
        refused if nothing else is asked for.
    start, stop
        Interval shown (s). Default: the whole run, and the last ten turns of the exciters in detail.
    data
        File of measured data laid over the figures, as they are: y is counted from the static rest.

    Raises
    ------
    TableError
        Tables are missing or have another schema version, or the interval is empty.
    """
    measured = None if data is None else timelines.read_measured(data, "t_s", COORDINATES)
    shown = _shown([read_run(place, start, stop) for place in directories], directories, measured)
    has_force = any("contact_force_n" in run.shown for run in shown.runs)
    drawn = [kind for kind in kinds or FIGURES if has_force or kind != "force"]
    if not drawn:
        raise TableError(f"--kind force: {directories[0]} has no contact force, as its scene is bare or non-impact")
    for kind in drawn:
        yield directories[0], kind, FIGURES[kind](shown)


def _shown(runs: Sequence[Run], directories: Sequence[Path], data: timelines.Measured | None) -> Shown:
    """Name several runs by how they differ."""
    if len(runs) == 1:
        return Shown(runs, data)
    names = distinct([run.name for run in runs], directories)
    return Shown(runs, data, compared("run", names, [run.scene for run in runs]))


def _head(figure: Figure, shown: Shown, named: Axes | None = None) -> None:
    """Put the runs' names and parameters above a figure, and below it the lines of an axis that names them.

    Several runs are always named, by the lines of the last axis.
    """
    run = shown.only
    parameters = "" if run is None else run_parameters(run.scene)
    head(figure, ", ".join(run.name for run in shown.runs), parameters)
    if run is None or named is not None:
        legend_below(figure, (named or figure.axes[-1]).get_legend_handles_labels()[0])


def _legend_above(axis: Axes, columns: int = 1) -> None:
    """Name what has a name in a panel; an envelope has none."""
    if axis.get_legend_handles_labels()[0]:
        axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.0, ncols=columns)


def _motion(shown: Shown) -> Figure:
    """Draw the platform and the gap: the whole run on the left, the last turns on the right."""
    runs = shown.runs
    largest = [max(run.range_of(c) for c in _MOVING) for run in runs]
    rows = ["y_m"]
    for column in ("x_m", "phi_rad"):
        if any(run.range_of(column) > MATTERS * most for run, most in zip(runs, largest, strict=True)):
            rows.append(column)
    rows += ["gap_m"] if any("gap_m" in run.shown for run in runs) else []
    overview = not any(run.chosen for run in runs) and any(run.is_long for run in runs)
    size = (10.0 if overview else 8.0, 1.5 + 1.45 * len(rows))
    figure, axes = new_figure(len(rows), 1 + overview, size, sharex="col")
    for column, row in zip(rows, axes, strict=True):
        if overview:
            _draw(row[0], shown, column, detail=False)
        _draw(row[-1], shown, column)
    if overview:
        axes[0, 0].set_title("whole run, range of values", loc="left")
        axes[0, 1].set_title("last turns, grey on the left" if shown.only else "last turns", loc="left")
        axes[-1, 0].set_xlabel("$t$ (s)")
    axes[-1, -1].set_xlabel(shown.detail)
    if shown.only is not None:
        if "gap_m" in rows:
            _legend_above(axes[-1, -1], 2)
        if shown.data is not None:
            _legend_above(axes[0, -1])
    _head(figure, shown)
    return figure


def _draw(axis: Axes, shown: Shown, column: str, *, detail: bool = True) -> None:
    """Draw a coordinate in detail, or its range over the whole run.

    If there is one run, contact is shaded and impacts are marked in detail; the other panel shades what detail shows.
    """
    alone = shown.only is not None
    for number, run in enumerate(shown.runs):
        if column not in run.shown:
            continue
        look = shown.look(number, column)
        if not detail or run.turns > MOST_TURNS:
            colour, label = look["color"], look.get("label")
            timelines.draw_envelope(axis, run.envelope, column, color=colour, label=label, filled=alone)
            if alone and not detail:
                axis.axvspan(run.shown["t_s"].iloc[0], run.shown["t_s"].iloc[-1], color=REFERENCE, alpha=0.25, lw=0)
            continue
        table = run.shown.assign(t_s=run.shown["t_s"] - shown.origin(run))
        timelines.draw_coordinate(axis, table[table["t_s"] >= 0.0] if shown.aligned else table, column, **look)
        if alone and "gap_m" in run.shown:
            timelines.draw_contact(axis, run.shown)
            if column == "gap_m":
                timelines.draw_impacts(axis, run.events)
    if column == "y_m" and all(run.from_rest for run in shown.runs):
        axis.set_ylabel(timelines.FROM_REST)
    if shown.data is not None:
        shown.data.draw(axis, "t_s", column)
    if detail and column in ("x_m", "y_m"):
        _no_noise(axis, shown)


def _no_noise(axis: Axes, shown: Shown) -> None:
    """Widen an axis of x or y on which numerical noise would fill the panel."""
    ranges = [run.size(run.shown[c], c) for run in shown.runs for c in _MOVING if c in run.shown]
    least, (low, high) = LEAST_RANGE * 1e3 * max(ranges), axis.get_ylim()
    if high - low < least:
        axis.set_ylim(0.5 * (low + high - least), 0.5 * (low + high + least))


def _force(shown: Shown) -> Figure:
    """Draw the contact force, and below it the impulses of impacts as stems: they are no forces."""
    strikes = any((run.events["impulse_n_s"] > 0.0).any() for run in shown.runs)
    ratios = {"height_ratios": [2.0, 1.0]} if strikes else {}
    figure, axes = new_figure(1 + strikes, 1, (8.0, 4.4 if strikes else 3.2), sharex=True, gridspec_kw=ratios)
    force: Axes = axes[0, 0]
    _draw(force, shown, "contact_force_n")
    begin_at_zero(force)
    for number, run in enumerate(shown.runs if strikes else []):
        events = run.events.assign(t_s=run.events["t_s"] - shown.origin(run))
        look = shown.look(number, "")
        timelines.draw_impulses(axes[1, 0], events, BLACK if shown.only else look["color"], look.get("label"))
    if strikes and shown.only is not None and shown.only.turns <= MOST_TURNS:
        timelines.draw_contact(axes[1, 0], shown.only.shown)
    axes[-1, 0].set_xlabel(shown.detail)
    if any(patch.get_label() == "attached" for patch in force.patches) or shown.data is not None:
        _legend_above(force, 2)
    _head(figure, shown)
    return figure


def _exciters(shown: Shown) -> Figure:
    """Draw the speeds of both exciters and their phase difference over the whole interval."""
    figure, axes = new_figure(2, 1, (8.0, 5.0), sharex=True)
    speeds, phases = axes[:, 0]
    only = shown.only
    for number, run in enumerate(shown.runs):
        colour = CURVES[number % len(CURVES)]
        timelines.draw_speeds(speeds, run.whole, (colour, CURVES[1] if only else colour))
        if only is not None and only.scene is not None:
            timelines.draw_synchronous_speed(speeds, only.scene, run.whole["t_s"])
        label = None if only else shown.names[number]
        timelines.draw_phase_difference(phases, run.whole, co_rotating=run.co_rotating, color=colour, label=label)
    if only is None:
        for number, line in enumerate(speeds.lines[:2], 1):
            look: dict[str, Any] = {"ls": line.get_linestyle(), "lw": line.get_linewidth(), "color": REFERENCE}
            phases.plot([], [], label=f"exciter {number}", **look)
    if len({run.co_rotating for run in shown.runs}) > 1:
        phases.set_ylabel(PHASE)
    phases.set_xlabel("$t$ (s)")
    _head(figure, shown, speeds if only else phases)
    return figure


FIGURES: dict[str, Callable[[Shown], Figure]] = {"motion": _motion, "force": _force, "exciters": _exciters}
