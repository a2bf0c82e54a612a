"""Figures at a prompt and in a notebook: the one place between runs, orbits and tables and what draws them."""

from __future__ import annotations

import math
from functools import singledispatch

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from vibroplat.basin.question import BasinTables
from vibroplat.continuation.orbit import Orbit
from vibroplat.continuation.tables import OrbitTables
from vibroplat.designs.question import DesignTables
from vibroplat.errors import TableError
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
from vibroplat.results.run import Kind, Trajectory
from vibroplat.study.branches import EXCITATION
from vibroplat.thresholds.tables import Thresholds

#: Columns by which tables are recognized.
_NEEDED = {
    "branches": {"branch", "stable", "multiplier_1_re", EXCITATION},
    "sweep": {"direction", "branch", "sync", EXCITATION},
    "trajectory": {"t_s", "mode", "y_m", "phi1_rad", "phi1_rate_rad_per_s"},
}


@singledispatch
def figure_of(shown: object, *_: object) -> Figure:
    """Draw the figure of a run, a table, branches of orbits or an orbit."""
    raise TypeError(f"no figure of {type(shown).__name__} is known")


@figure_of.register
def _(run: Trajectory, kind: Kind = "motion", start: float | None = None, stop: float | None = None) -> Figure:
    """Draw a figure of a run.

    Raises
    ------
    ValueError
        The figure is unknown, or the run has no contact force to draw.
    TableError
        There is nothing to draw in the interval.
    """
    if kind not in drawing.FIGURES:
        raise ValueError(f"kind = {kind!r}; allowed: {', '.join(drawing.FIGURES)}")
    if kind == "force" and not run.scene.has_contact:
        allowed = ", ".join(name for name in drawing.FIGURES if name != kind)
        raise ValueError(f"kind = 'force' but this run has no contact; allowed: {allowed}")
    table = run.trajectory
    whole = histories.run_of(run.summary, run.scene, ends_of([table]), [table], [run.events], start, stop)
    with styled():
        return drawing.FIGURES[kind](drawing.Shown([whole]))


@figure_of.register
def _(table: pd.DataFrame, x: str | None = None) -> Figure:
    """Draw the figure of a table; see :meth:`vibroplat.columns.TableAccessor.plot`."""
    kind = next((kind for kind, needed in _NEEDED.items() if needed <= {*table.columns}), None)
    if kind is None:
        raise ValueError(
            "no figure of this table alone is known; allowed: of a trajectory, of a sweep, of branches of orbits; "
            "those of basins, thresholds and designs are drawn by plot() of the result"
        )
    if x is not None and (kind == "trajectory" or x not in table):
        raise ValueError(f"x = {x!r}; allowed: {'not given' if kind == 'trajectory' else 'a column of the table'}")
    if table.empty:
        raise TableError("the table is empty; there is nothing to plot")
    with styled():
        if kind == "branches":
            found = branches_of(table)
            return branches_figure(found, x or found.x)
        if kind == "sweep":
            return response_figure(sweep_of(table, x))
        return drawing.FIGURES["motion"](drawing.Shown([_run_of_table(table)]))


def _run_of_table(table: pd.DataFrame) -> histories.Run:
    """Prepare a trajectory of which nothing else is known: how the exciters turn is seen at its end."""
    first, second = (float(table[f"phi{n}_rate_rad_per_s"].tail(len(table) // 4 + 1).mean()) for n in (1, 2))
    rotation = "co-rotating" if first * second > 0.0 else "counter-rotating"
    seen = {"name": "trajectory", "excitation_frequency_hz": abs(first) / (2.0 * math.pi), "rotation": rotation}
    return histories.run_of(seen, None, ends_of([table]), [table], [_impacts(table)])


def _impacts(table: pd.DataFrame) -> pd.DataFrame:
    """Return the impacts of a trajectory, at which it has two rows between which the gap's rate jumps."""
    times = table["t_s"]
    struck = times[(times.diff() == 0.0) & (table["gap_rate_m_per_s"].diff() != 0.0)] if "gap_m" in table else times[:0]
    return pd.DataFrame({"kind": "impact", "t_s": struck.to_numpy(), "impulse_n_s": np.nan})


@figure_of.register
def _(followed: OrbitTables) -> Figure:
    """Draw branches of orbits with their special points."""
    found = branches_of(followed.branches, followed.special)
    with styled():
        return branches_figure(found, found.x)


@figure_of.register
def _(found: Thresholds) -> Figure:
    """Draw the values that were looked at, with the thresholds."""
    scene = found.scene
    assert scene.find is not None
    with styled():
        return threshold_figure(scene.name, scene, scene.find.model_dump(), found.scan, found.thresholds)


@figure_of.register
def _(found: Orbit) -> Figure:
    """Draw an orbit: its speed over its height, and the gap over the phase where there is material."""
    with styled():
        return orbit_figure(found)


@figure_of.register
def _(found: BasinTables) -> Figure:
    """Draw the starts by the attractors that they come to, or over a key the shares of these."""
    scene = found.scene
    assert scene.basins is not None
    with styled():
        return basins_figure(scene.name, scene, scene.basins.model_dump(), found.attractors, found.starts)


@figure_of.register
def _(found: DesignTables, kind: str) -> Figure:
    """Draw elasticities, measures of samples, or what a search looked at."""
    plan = found.scene.design
    assert plan is not None
    with styled():
        return design_figure(found.scene.name, found.scene, plan, found.tables, kind)
