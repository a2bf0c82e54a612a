"""Figures at a prompt and in a notebook: the one place between runs, orbits and tables and what draws them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import singledispatch

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from vibroplat.basin.question import BasinTables
from vibroplat.columns import COORDINATES
from vibroplat.config.scene import Scene
from vibroplat.continuation.orbit import Orbit
from vibroplat.continuation.tables import OrbitTables
from vibroplat.designs.question import DesignTables
from vibroplat.errors import TableError
from vibroplat.hybrid.state import static_rest
from vibroplat.plots import histories
from vibroplat.plots import run as drawing
from vibroplat.plots.pictures import draw_picture
from vibroplat.plots.reading import ends_of, pictures_of
from vibroplat.plots.style import begin_at_zero, head, new_figure, styled, widen_ticks
from vibroplat.plots.timelines import FROM_REST, in_units
from vibroplat.results.files import Command
from vibroplat.results.labels import EXCITATION, run_parameters
from vibroplat.results.picture import CURVES, Shown
from vibroplat.results.run import Kind, Trajectory
from vibroplat.study.picture import key_of
from vibroplat.thresholds.tables import Thresholds

#: Columns by which tables are recognized.
_NEEDED = {
    "branches": {"branch", "stable", "multiplier_1_re", EXCITATION},
    "sweep": {"direction", "branch", "sync", EXCITATION},
    "trajectory": {"t_s", "mode", "y_m", "phi1_rad", "phi1_rate_rad_per_s"},
}


#: Points of an orbit that are drawn.
DRAWN = 2000


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
    if kind == "branches":
        return _branches(table, None, None, x or "")
    if kind == "sweep":
        plan = {"sweep": {"over": {"key": key_of(table)}}}
        return _drawn(Shown("sweep", "sweep", None, plan, {"sweep": table}), "response", x or "")
    with styled():
        return drawing.FIGURES["motion"](drawing.Shown([_run_of_table(table)]))


def _drawn(shown: Shown, kind: str, x: str = "") -> Figure:
    """Draw the first picture of a kind of a result in memory."""
    picture = next(one for one in pictures_of(shown.command, [shown], [kind]) if "print" in one.places)
    with styled():
        return draw_picture(picture, x)


def _branches(branches: pd.DataFrame, special: pd.DataFrame | None, scene: Scene | None, x: str = "") -> Figure:
    """Draw tables of branches, whose key stands before ``branch``."""
    *grid, key = (str(column) for column in branches.columns[: list(branches.columns).index("branch")])
    none = pd.DataFrame({name: pd.Series(dtype=float) for name in (*grid, key, EXCITATION, "branch", "point")})
    tables = {"branches": branches, "special": none.assign(kind=pd.Series(dtype=str)) if special is None else special}
    return _drawn(Shown("orbits", "orbits", scene, {"orbits": {"key": key}}, tables), "branches", x)


def _of(command: Command, scene: Scene, tables: Mapping[str, pd.DataFrame]) -> Shown:
    """Return a result of a study in memory as pictures are made of it."""
    return Shown(command, scene.name, scene, scene.to_tree(), tables)


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
    return _branches(followed.branches, followed.special, None)


@figure_of.register
def _(found: Thresholds) -> Figure:
    """Draw the values that were looked at, with the thresholds."""
    return _drawn(_of("find", found.scene, {"scan": found.scan, "thresholds": found.thresholds}), "thresholds")


@figure_of.register
def _(found: BasinTables) -> Figure:
    """Draw the starts by the attractors that they come to, or over a key the shares of these."""
    return _drawn(_of("basins", found.scene, {"attractors": found.attractors, "starts": found.starts}), "basins")


@figure_of.register
def _(found: DesignTables, kind: str) -> Figure:
    """Draw elasticities, measures of samples, or what a search looked at."""
    return _drawn(_of("design", found.scene, found.tables), kind)


@figure_of.register
def _(orbit: Orbit) -> Figure:
    """Draw an orbit: its speed over its height, and the gap over the phase of exciter 1 where there is material."""
    with styled():
        return _orbit(orbit)


def _orbit(orbit: Orbit) -> Figure:
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
