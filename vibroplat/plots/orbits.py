"""Figures of branches of periodic orbits, drawn from their tables, and of one orbit."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from vibroplat.columns import COORDINATES, PHASE_COLUMN
from vibroplat.continuation.special_points import KINDS
from vibroplat.errors import TableError
from vibroplat.plots.labels import (
    ABSCISSAE,
    is_number,
    key_label,
    run_parameters,
    scene_of,
    sweep_parameters,
    value_label,
)
from vibroplat.plots.reading import Curve, curves_of, read_columns, read_result
from vibroplat.plots.response import limit_size
from vibroplat.plots.style import CURVES, DIRECTIONS, REFERENCE, entry, head, new_figure, panel_grid
from vibroplat.plots.timelines import in_units, name_axis
from vibroplat.results.files import Result
from vibroplat.study.branches import EXCITATION, FREQUENCY, SUPPLY

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from vibroplat.continuation.orbit import Orbit


#: What is drawn over the key; force only where there is any.
PANELS = ("rms_y_m", "rms_x_m", PHASE_COLUMN, "motor_power_w", "contact_force_max_n")
#: Markers and meanings of kinds of special points, and colours of curves of them.
MARKERS = dict(zip(KINDS, "oDsX^vP", strict=True))
MEANINGS = KINDS
_COLOURS = dict(zip(KINDS, itertools.cycle(CURVES)))
#: Colour of what is behind the branches.
BEHIND = "#9a9a9a"
#: Largest real and imaginary part of multipliers that are drawn, and the least frame, just around the unit circle.
FARTHEST, NEAREST = 2.0, 1.1
#: Largest multiplier above which their axis is logarithmic.
LOGARITHMIC = 10.0
#: Points of an orbit that are drawn.
DRAWN = 2000

# -- tables ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Branches:
    """Tables of branches.

    Attributes
    ----------
    name, result
        What they are called, and their result; None in memory.
    points, special
        The tables.
    swept
        Table of a sweep in the same directory, or None.
    key
        Column of the key.
    grid
        Columns of the grid.
    second
        Column of the second key of boundaries, "" where there is none.
    """

    name: str
    result: Result | None
    points: pd.DataFrame
    special: pd.DataFrame
    swept: pd.DataFrame | None
    key: str
    grid: list[str]
    second: str = ""

    @property
    def abscissa(self) -> str:
        """Column that they are drawn over first."""
        return EXCITATION if self.key == SUPPLY else self.key

    @cached_property
    def varied(self) -> list[str]:
        """Columns of the grid that have several values."""
        return [key for key in self.grid if len(self.points[key].unique()) > 1]

    def parameters(self, *columns: str) -> str:
        """Return what a reader wants to know of the scene, but for the key, the grid and more columns that vary."""
        if self.result is None:
            return ""
        return sweep_parameters(scene_of(self.result.provenance), [*self.grid, self.key, *columns])

    def alike(self, table: pd.DataFrame, values: Any, keys: Sequence[str] | None = None) -> pd.DataFrame:
        """Return the rows of a table that belong to the branch of some values, or that share them in other keys."""
        for key in (*self.grid, "branch") if keys is None else keys:
            table = table[table[key] == values[key]]
        return table

    @cached_property
    def curves(self) -> list[Curve]:
        """All branches in the order of the table."""
        return curves_of(self.points, [*self.grid, "branch"], self.label)

    def label(self, values: pd.Series) -> str:
        """Return what a combination of the grid's values is called in a legend."""
        return ", ".join(value_label(key, values[key]) for key in self.varied)

    def sweeps(self) -> Iterator[tuple[str, pd.DataFrame]]:
        """Yield the colour and points of the sweep: of each combination, where the sweep has its keys."""
        if self.swept is None:
            return
        if not self.varied or any(key not in self.swept for key in self.varied):
            yield BEHIND, self.swept
            return
        for number, (_, values) in enumerate(self.points[self.varied].drop_duplicates().iterrows()):
            yield CURVES[number % len(CURVES)], self.alike(self.swept, values, self.varied)

    def boundaries(self) -> pd.DataFrame:
        """Read the table ``boundaries``; its keys must hold numbers."""
        assert self.result is not None
        table = read_columns(self.result, "boundaries", ("kind",), ("curve",))
        if not all(key in table and is_number(table[key]) for key in (self.key, self.second)):
            raise TableError(f"the boundaries table in {self.result.directory} has no numbers of two keys")
        return table


def read_branches(directory: Path) -> Branches:
    """Read the tables of branches, and that of a sweep if it lies in the same directory."""
    result = read_result(directory, "orbits")
    try:
        plan = result.provenance["configuration"]["orbits"]
        named = str(plan["key"]), str((plan.get("boundaries") or {}).get("key", ""))
    except (AttributeError, KeyError, TypeError):
        raise TableError(f"{directory}/provenance.json is not the provenance of branches of orbits") from None
    key, second = (SUPPLY if name == FREQUENCY else name for name in named)
    numbers = (key, EXCITATION, "branch", "rms_x_m", "rms_y_m", PHASE_COLUMN, "motor_power_w", "multiplier_1_re")
    points = read_columns(result, "branches", ("sequence",), numbers, ("contact_force_max_n",))
    if "stable" not in points:
        raise TableError(f"the branches table in {directory} has no column stable")
    special = read_columns(result, "special", ("kind",), (key, EXCITATION, "branch", "point"))
    if points.empty:
        raise TableError(f"{directory} holds an empty table of branches; there is nothing to plot")
    swept = Result(directory, "sweep").table("sweep") if any(directory.glob("sweep.*")) else None
    grid = list(points.columns[: list(points.columns).index(key)])
    return Branches(directory.resolve().name, result, points, special, swept, key, grid, second)


def branches_of(points: pd.DataFrame, special: pd.DataFrame | None = None) -> Branches:
    """Prepare tables in memory, those of special points if there are any; the key stands before ``branch``."""
    *grid, key = (str(column) for column in points.columns[: list(points.columns).index("branch")])
    if special is None:
        special = pd.DataFrame({name: [] for name in (*grid, "branch", "kind", "point", EXCITATION)})
    return Branches("orbits", None, points, special, None, key, grid)


def orbit_figures(
    directories: Sequence[Path], kinds: Sequence[str] = (), *, x: str | None = None
) -> Iterator[tuple[Path, str, Figure]]:
    """Draw figures of branches of orbits; yield the directory and the name of each.

    Parameters
    ----------
    directories
        Result directories of ``vibroplat orbits``; each has figures of its own.
    kinds
        ``branches`` (amplitudes, phase difference, power and force: stable solid, unstable dashed, special points
        marked, points of a sweep in the same directory behind them), ``multipliers`` (on the plane, and the largest
        over the key), ``boundaries`` (over two keys). Default: all that there are tables of.
    x
        Horizontal axis: ``excitation`` or ``supply`` frequency. Default: the excitation frequency if the key is the
        supply frequency, else the key.

    Raises
    ------
    TableError
        Tables are missing, have another schema version, or lack data that a figure needs.
    """
    for directory in directories:
        found = read_branches(directory)
        column = found.abscissa if x is None else ABSCISSAE[x]
        has_curves = any(directory.glob("boundaries.*"))
        if column not in found.points:
            raise TableError(f"--x {x}: the branches table in {directory} has no column {column}")
        if "boundaries" in kinds and not has_curves:
            raise TableError(f"{directory} holds no boundaries; add orbits.boundaries to its configuration")
        for kind in kinds or [kind for kind in FIGURES if has_curves or kind != "boundaries"]:
            yield directory, kind, FIGURES[kind](found, column)


# -- branches ----------------------------------------------------------------------------------------------------------


def branches_figure(found: Branches, x: str) -> Figure:
    """Draw all quantities of branches over a column."""
    columns = [c for c in PANELS if c in found.points and found.points[c].notna().any()]
    figure, panels = panel_grid(len(columns), 2, (11.0, 2.2 + 2.5 * -(-len(columns) // 2)), key_label(x))
    for axis, column in zip(panels, columns, strict=False):
        for color, rows in found.sweeps():
            draw_sweep(axis, rows, column, x, color=color)
        for _, number, points in found.curves:
            special = found.alike(found.special, points.iloc[0])
            draw_branch(axis, points, special, column, x, color=CURVES[number % len(CURVES)])
        if column.startswith("rms"):
            limit_size(axis, found.points)
    head(figure, found.name, found.parameters())
    handles = _legend(found, x)
    if len(columns) < len(panels):  # the empty place
        panels[-1].legend(handles=handles, loc="center left", borderpad=0.0)
    else:
        figure.legend(handles=handles, loc="outside lower center", ncols=2 if len(found.special) else len(handles))
    return figure


def draw_branch(
    axis: Axes, points: pd.DataFrame, special: pd.DataFrame, column: str, x: str = EXCITATION, *, color: Any = CURVES[0]
) -> Axes:
    """Draw a quantity along one branch: stable parts solid, unstable ones dashed, special points with their markers.

    Parameters
    ----------
    axis
        Where to draw.
    points, special
        Rows of one branch in the tables ``branches`` and ``special``.
    column, x
        Columns of both axes.
    color
        Of the line.
    """
    shares = places_of(points, special)
    places = np.sort(np.concatenate([np.arange(len(points)), shares]))
    xs, ys = (in_units(between(points, places, name), name) for name in (x, column))
    looks: list[bool | None] = _stable(points, places)
    if column == PHASE_COLUMN:  # it passes the end of its axis
        looks = [None if jump > np.pi else look for look, jump in zip(looks, np.abs(np.diff(ys)), strict=True)]
    for kind, run in itertools.groupby(range(len(looks)), looks.__getitem__):
        if kind is not None:
            part = list(run)
            shown = slice(part[0], part[-1] + 2)
            axis.plot(xs[shown], ys[shown], "-" if kind else "--", lw=1.5 if kind else 0.9, color=color)
    marks = in_units(between(points, shares, column), column)
    exact = special[x].to_numpy(dtype=float) if x in special else between(points, shares, x)
    for where, value, kind in zip(exact, marks, special["kind"], strict=True):
        axis.plot(where, value, MARKERS.get(kind, "*"), ms=5.0, mfc="white", mec=color, mew=1.1, zorder=3)
    return name_axis(axis, column)


def places_of(points: pd.DataFrame, special: pd.DataFrame) -> Any:
    """Return where special points lie along a branch: the number of the point before and the share of the step."""
    before = np.clip(special["point"].to_numpy(dtype=int), 0, max(len(points) - 2, 0))
    if len(points) < 2:
        return before.astype(float)
    values = points[EXCITATION].to_numpy(dtype=float)
    here, there = values[before], values[before + 1]
    step = np.where(there == here, 1.0, there - here)
    return before + np.clip((special[EXCITATION].to_numpy(dtype=float) - here) / step, 0.0, 1.0)


def between(points: pd.DataFrame, places: Any, column: str) -> Any:
    """Return a column at places along a branch; phase differences are followed beyond their range."""
    values = points[column].to_numpy(dtype=float)
    values = np.unwrap(values) if column == PHASE_COLUMN else values
    return np.interp(places, np.arange(len(points)), values)


def _stable(points: pd.DataFrame, places: Any) -> list[bool | None]:
    """Return whether the pieces of a line between places along a branch are stable.

    A piece that begins or ends at a special point is as stable as the point at its other end; between two special
    points nothing is known, and it is drawn as unstable.
    """
    stable = points["stable"].to_numpy(dtype=bool)
    whole = places == places.astype(int)
    known = np.where(whole, stable[places.astype(int)], True)  # special points say nothing
    return list((whole[:-1] | whole[1:]) & known[:-1] & known[1:])


def draw_sweep(axis: Axes, table: pd.DataFrame, column: str, x: str, *, color: Any = BEHIND) -> None:
    """Draw the points of a sweep, pale, behind what comes later."""
    if x not in table or column not in table:
        return
    values = in_units(table[column].to_numpy(dtype=float, na_value=np.nan), column)
    places = table[x].to_numpy(dtype=float)
    for direction, marker in DIRECTIONS.items():
        chosen = (table["direction"] == direction).to_numpy()
        axis.plot(places[chosen], values[chosen], marker, ls="", ms=4.0, color=color, mew=0, alpha=0.5, zorder=1.5)


def _legend(found: Branches, x: str) -> list[Line2D]:
    """Name colours, lines and markers, and say what happens at special points."""
    numbers = {label: number for label, number, _ in found.curves if label}
    handles = [entry(label, color=CURVES[number % len(CURVES)], lw=2.0) for label, number in numbers.items()]
    for stable, label, line, width in ((True, "stable", "-", 1.5), (False, "unstable", "--", 0.9)):
        if (found.points["stable"] == stable).any():
            handles.append(entry(label, color=REFERENCE, ls=line, lw=width))
    if found.swept is not None and x in found.swept:
        for direction, marker in DIRECTIONS.items():
            if (found.swept["direction"] == direction).any():
                handles.append(entry(f"sweep, {direction}", marker=marker, ls="", color=BEHIND, mew=0, ms=4.0))
    for kind, meaning in KINDS.items():
        if (found.special["kind"] == kind).any():
            look = {"ls": "", "mfc": "white", "mec": REFERENCE, "mew": 1.1, "ms": 5.0}
            handles.append(entry(f"{kind}: {meaning}", marker=MARKERS[kind], **look))
    return handles


# -- boundaries --------------------------------------------------------------------------------------------------------


def boundaries_figure(found: Branches, x: str) -> Figure:
    """Draw curves of special points over two keys: the second one over a column; a colour for each kind."""
    table, varied = found.boundaries(), found.varied
    combinations = table[varied].drop_duplicates() if varied else table.iloc[:1]
    count = max(len(combinations), 1)
    figure, axes = new_figure(1, count, (1.5 + 5.5 * count, 5.2), sharex=True, sharey=True)
    for axis, (_, values) in zip(axes[0], combinations.iterrows(), strict=True):
        for _, rows in found.alike(table, values, varied).groupby("curve"):
            look = {"lw": 1.8, "marker": "o" if len(rows) == 1 else "", "ms": 4.0}  # a lone point is no line
            axis.plot(rows[x], rows[found.second], color=_COLOURS[rows["kind"].iloc[0]], **look)
        axis.set_xlabel(key_label(x))
        axis.set_title(found.label(values), loc="left")
    axes[0, 0].set_ylabel(key_label(found.second))
    kinds = [kind for kind in KINDS if (table["kind"] == kind).any()]
    handles = [entry(f"{kind}: {KINDS[kind]}", color=_COLOURS[kind], lw=1.8) for kind in kinds]
    figure.legend(handles=handles, loc="outside lower center", ncols=1)
    head(figure, found.name, found.parameters(found.second))
    return figure


# -- multipliers -------------------------------------------------------------------------------------------------------


def multipliers_figure(found: Branches, x: str) -> Figure:
    """Draw the leading multipliers on the plane, and the largest one over a column, for each grid combination."""
    combinations: dict[int, list[Curve]] = {}
    for curve in found.curves:
        combinations.setdefault(curve.number, []).append(curve)
    values = found.points[x]
    norm = Normalize(float(values.min()), float(values.max()))
    farthest = found.points.filter(regex=r"^multiplier_\d+_(re|im)$").abs().max().max()
    frame = float(np.clip(1.05 * farthest, NEAREST, FARTHEST))
    size = (1.5 + 4.3 * len(combinations), 8.2)
    figure, axes = new_figure(2, len(combinations), size, sharey="row", height_ratios=(1.35, 1.0))
    for curves, (plane, largest) in zip(combinations.values(), axes.T, strict=True):
        _draw_plane(plane, pd.concat([points for _, _, points in curves]), x, norm, frame)
        plane.set_title(curves[0].label, loc="left")
        for _, number, points in curves:
            sizes = np.hypot(points["multiplier_1_re"], points["multiplier_1_im"])
            largest.plot(points[x], sizes, ".-", ms=2.5, lw=0.8, color=CURVES[number % len(CURVES)])
        largest.axhline(1.0, color=REFERENCE, lw=0.8)
        plane.set_xlabel("real part")
        largest.set_xlabel(key_label(x))
    axes[0, 0].set_ylabel("imaginary part")
    axes[1, 0].set_ylabel("largest |multiplier|")
    if np.hypot(found.points["multiplier_1_re"], found.points["multiplier_1_im"]).max() > LOGARITHMIC:
        axes[1, 0].set_yscale("log")
    figure.colorbar(ScalarMappable(norm, "viridis"), ax=list(axes[0]), pad=0.01).set_label(key_label(x))
    head(figure, found.name, found.parameters())
    return figure


def _draw_plane(axis: Axes, points: pd.DataFrame, x: str, norm: Normalize, frame: float) -> None:
    """Draw multipliers and the unit circle; say how many lie farther away than the frame."""
    angle = np.linspace(0.0, 2.0 * np.pi, 361)
    axis.plot(np.cos(angle), np.sin(angle), color=REFERENCE, lw=1.0)
    outside = 0
    for i in itertools.count(1):
        if f"multiplier_{i}_re" not in points:
            break
        real, imaginary = (points[f"multiplier_{i}_{part}"].to_numpy(dtype=float) for part in ("re", "im"))
        far = (np.abs(real) > frame) | (np.abs(imaginary) > frame)
        outside += int(far.sum())
        shown = points[x].to_numpy(dtype=float)[~far]
        for sign in (1.0, -1.0):  # of a pair the table may have one only
            axis.scatter(real[~far], sign * imaginary[~far], s=7.0, c=shown, cmap="viridis", norm=norm, linewidths=0.0)
    if outside:
        axis.text(0.02, 0.02, f"{outside} farther away", transform=axis.transAxes, fontsize=8, color=REFERENCE)
    axis.set_aspect("equal")
    axis.set_xlim(-frame, frame)
    axis.set_ylim(-frame, frame)


# -- one orbit ---------------------------------------------------------------------------------------------------------


def orbit_figure(orbit: Orbit) -> Figure:
    """Draw an orbit: its speed over its height, and the gap over the phase of exciter 1 where there is material."""
    count = 2 if orbit.scene.has_contact else 1
    figure, axes = new_figure(1, count, (1.0 + 4.2 * count, 4.0))
    table = orbit.run(np.linspace(0.0, orbit.run.segments[-1].end, DRAWN))
    first, height = axes[0, 0], COORDINATES["y_m"]
    first.plot(height.factor * table["y_m"], table["y_rate_m_per_s"], color=CURVES[0])
    first.set(xlabel=height.label, ylabel=r"$\dot y$ (m/s)")
    first.set_title(f"period {orbit.period}, {'stable' if orbit.stable else 'unstable'}, {orbit.sequence}", loc="left")
    if count == 2:
        second, gap = axes[0, 1], COORDINATES["gap_m"]
        turns = (table["phi1_rad"] - table["phi1_rad"].iloc[0]).abs() / (2.0 * np.pi)
        second.plot(turns, gap.factor * table["gap_m"], color=CURVES[1])
        second.set(xlabel="phase of exciter 1 (turns)", ylabel=gap.label)
        second.set_ylim(bottom=0.0)
    head(figure, orbit.scene.name, run_parameters(orbit.scene))
    return figure


FIGURES: Mapping[str, Callable[[Branches, str], Figure]] = {
    "branches": branches_figure,
    "multipliers": multipliers_figure,
    "boundaries": boundaries_figure,
}
