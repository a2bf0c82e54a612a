"""Figures at a prompt and in a notebook: the one place between results and what draws them."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from vibroplat.continuation.orbit import Orbit
from vibroplat.plots import histories
from vibroplat.plots import run as drawing
from vibroplat.plots.basins import basins_figure
from vibroplat.plots.designs import design_figure
from vibroplat.plots.orbits import branches_figure, orbit_figure
from vibroplat.plots.reading import ends_of
from vibroplat.plots.response import response_figure
from vibroplat.plots.studies import branches_of, sweep_of
from vibroplat.plots.style import styled
from vibroplat.plots.thresholds import threshold_figure
from vibroplat.results.result import Result
from vibroplat.results.run import RunResult


def figure_of(shown: Result | Orbit, kind: str | None = None, **options: Any) -> Figure:
    """Draw a figure of a result or of an orbit.

    Raises
    ------
    ValueError
        There is no such figure.
    TableError
        There is nothing to draw.
    """
    with styled():
        if isinstance(shown, Orbit):
            return orbit_figure(shown)
        if isinstance(shown, RunResult):
            return _run_figure(shown, kind or "motion", **options)
        return _study_figure(shown, kind)


def _study_figure(result: Result, kind: str | None) -> Figure:
    scene: Any
    scene, tables = result.scene, result.tables
    if result.command == "sweep":
        return response_figure(sweep_of(tables["sweep"]))
    if result.command == "orbits":
        found = branches_of(tables["branches"], tables["special"])
        return branches_figure(found, found.x)
    if result.command == "find":
        return threshold_figure(scene.name, scene, scene.find.model_dump(), tables["scan"], tables["thresholds"])
    if result.command == "basins":
        return basins_figure(scene.name, scene, scene.basins.model_dump(), tables["attractors"], tables["starts"])
    return design_figure(scene.name, scene, scene.design, tables, kind or "sensitivities")


def _run_figure(run: RunResult, kind: str, start: float | None = None, stop: float | None = None) -> Figure:
    """Draw a figure of a run."""
    if kind not in drawing.FIGURES:
        raise ValueError(f"kind = {kind!r}; allowed: {', '.join(drawing.FIGURES)}")
    if kind == "force" and not run.scene.has_contact:
        allowed = ", ".join(name for name in drawing.FIGURES if name != kind)
        raise ValueError(f"kind = 'force' but this run has no contact; allowed: {allowed}")
    table = run.trajectory
    whole = histories.run_of(run.summary, run.scene, ends_of([table]), [table], [run.events], start, stop)
    return drawing.FIGURES[kind](drawing.Shown([whole]))
