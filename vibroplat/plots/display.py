"""Figures at a prompt and in a notebook: the one place between results and what draws them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vibroplat.columns import COORDINATES
from vibroplat.config.kinds import KINDS
from vibroplat.continuation.orbit import Orbit
from vibroplat.errors import ConfigError, TableError
from vibroplat.hybrid.state import static_rest
from vibroplat.plots import run as drawing
from vibroplat.plots.command import draw_study
from vibroplat.plots.histories import Shown, run_of
from vibroplat.plots.style import begin_at_zero, head, new_figure, styled, widen_ticks
from vibroplat.plots.timelines import FROM_REST, in_units
from vibroplat.results.labels import run_parameters
from vibroplat.results.picture import CURVES
from vibroplat.results.result import Result
from vibroplat.results.run import RunResult

#: Points of an orbit that are drawn.
DRAWN = 2000


def figure_of(shown: Result | Orbit, kind: str | None = None, **options: Any) -> Figure:
    """Draw a figure of a result or of an orbit.

    Raises
    ------
    ConfigError
        There is no such figure.
    TableError
        There is nothing to draw.
    """
    with styled():
        if isinstance(shown, Orbit):
            return orbit_figure(shown)
        if isinstance(shown, RunResult):
            return _run_figure(shown, kind or "motion", **options)
        return _study_figure(shown, kind, options)


def _study_figure(result: Result, kind: str | None, options: Mapping[str, Any]) -> Figure:
    """Draw a figure of a study, the first one if none is named."""
    if result.command not in KINDS:
        raise ConfigError("the figures of the paper are many; allowed: vibroplat plot DIR")
    names, own = KINDS[result.command].figures.split(), KINDS[result.command].pictures
    if kind is not None and kind not in names:
        raise ConfigError(f"kind = {kind!r}; allowed: {', '.join(names)}")
    if wrong := [name for name in options if name not in own.OPTIONS]:
        raise ConfigError(f"option {wrong[0]} is unknown; allowed: {', '.join(own.OPTIONS) or 'none'}")
    figures = draw_study(result.command, [result], [] if kind is None else [kind], **options)
    for _, figure in figures:
        return figure
    raise TableError(f"{result.place} holds nothing to draw")


def _run_figure(
    run: RunResult, kind: str, start: float | None = None, stop: float | None = None, **wrong: object
) -> Figure:
    """Draw a figure of a run."""
    if wrong:
        raise ConfigError(f"option {next(iter(wrong))} is unknown; allowed: start, stop")
    if kind not in drawing.FIGURES:
        raise ConfigError(f"kind = {kind!r}; allowed: {', '.join(drawing.FIGURES)}")
    shown = Shown([run_of(run, start, stop)])
    if lacking := drawing.missing(kind, shown):
        allowed = ", ".join(name for name in drawing.FIGURES if not drawing.missing(name, shown))
        raise ConfigError(f"kind = {kind!r} but this run {lacking}; allowed: {allowed}")
    return drawing.draw(kind, shown)


def orbit_figure(orbit: Orbit) -> Figure:
    """Draw an orbit: its speed over its height, and the gap over the phase of exciter 1 where there is material."""
    count = 2 if orbit.scene.has_contact else 1
    figure, axes = new_figure(1, count, (1.0 + 4.2 * count, 4.0))
    table = orbit.run(np.linspace(0.0, orbit.run.segments[-1].end, DRAWN))
    first, heights = axes[0, 0], table["y_m"] - static_rest(orbit.scene)[1]
    first.plot(in_units(heights, "y_m"), table["y_rate_m_per_s"], color=CURVES[0])
    first.set(xlabel=FROM_REST, ylabel=r"$\dot y$ (m/s)")
    widen_ticks(first, "x")
    first.set_title(f"period {orbit.period}, {'stable' if orbit.stable else 'unstable'}, {orbit.sequence}", loc="left")
    if count == 2:
        second, gap = axes[0, 1], COORDINATES["gap_m"]
        turns = (table["phi1_rad"] - table["phi1_rad"].iloc[0]).abs() / (2.0 * np.pi)
        second.plot(turns, gap.factor * table["gap_m"], color=CURVES[1])
        second.set(xlabel="phase of exciter 1 (turns)", ylabel=gap.label)
        begin_at_zero(second)
    head(figure, orbit.scene.name, run_parameters(orbit.scene))
    return figure
