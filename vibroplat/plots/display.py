"""Figures at a prompt and in a notebook, from results and orbits; ``vibroplat plot`` does not load orbits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vibroplat.config.kinds import KINDS
from vibroplat.continuation.orbit import Orbit
from vibroplat.errors import ConfigError, TableError
from vibroplat.plots import run as drawing
from vibroplat.plots.command import draw_study
from vibroplat.plots.histories import run_of
from vibroplat.plots.pictures import draw_picture
from vibroplat.plots.reading import rest_of
from vibroplat.plots.run import Shown
from vibroplat.plots.style import styled
from vibroplat.results.labels import run_parameters
from vibroplat.results.picture import CURVES, Panel, Picture, Series, finite
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
    """Draw an orbit: its speed over its height, and the gap over turns of exciter 1 where there is material."""
    table = orbit.run(np.linspace(0.0, orbit.run.segments[-1].end, DRAWN))
    turns = (table["phi1_rad"] - table["phi1_rad"].iloc[0]).abs() / (2.0 * np.pi)
    title = f"period {orbit.period}, {'stable' if orbit.stable else 'unstable'}, {orbit.sequence}"
    panels = [Panel("y_rate_m_per_s", "y_from_rest_m", label=r"$\dot y$ (m/s)", title=title)]
    panels += [Panel("gap_m", "turns_of_exciter_1", least=0.0)] if orbit.scene.has_contact else []
    places = range(len(table))
    look: dict[str, Any] = {"name": "orbit", "heading": "Orbit", "table_name": "orbit", "high": True}
    picture = Picture(
        title=orbit.scene.name,
        table=finite(table.assign(y_from_rest_m=table["y_m"] - rest_of(orbit.scene), turns_of_exciter_1=turns)),
        axes=["y_from_rest_m"],
        panels=panels,
        series=[Series("", places, "", CURVES[n], "lines", of=(one.column,)) for n, one in enumerate(panels)],
        caption=run_parameters(orbit.scene),
        **look,
    )
    return draw_picture(picture)
