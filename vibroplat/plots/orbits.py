"""Figures of branches of periodic orbits, drawn from their tables, and of one orbit."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from vibroplat.continuation.test_functions import KINDS
from vibroplat.errors import TableError
from vibroplat.plots.names import (
    COORDINATES,
    MEASURES,
    PHASE_COLUMN,
    is_number,
    key_label,
    scene_of,
    sweep_parameters,
    value_label,
)
from vibroplat.plots.reading import read_columns
from vibroplat.plots.style import CURVES, DIRECTIONS, REFERENCE, Saving, head, new_figure, save, styled
from vibroplat.plots.timelines import phase_axis, wrapped
from vibroplat.results.files import Result
from vibroplat.study.branches import EXCITATION, FREQUENCY, SUPPLY

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from vibroplat.continuation.orbit import Orbit


#: What is drawn over the key; force only where there is any.
PANELS = ("rms_y_m", "rms_x_m", PHASE_COLUMN, "motor_power_w", "contact_force_max_n")
#: Markers of kinds of special points.
MARKERS = dict(zip(KINDS, "oDsX^vP", strict=True))
#: Colours of what is behind the branches, and of lines of reference.
BEHIND = "#9a9a9a"
#: Largest real and imaginary part of multipliers that are drawn, and the least frame, just around the unit circle.
FARTHEST, NEAREST = 2.0, 1.1
#: Largest multiplier above which their axis is logarithmic.
LOGARITHMIC = 10.0
#: Least range of an axis of RMS, relative to the largest RMS of y: small quantities are drawn small.
LEAST_RANGE = 0.02
#: Points of an orbit that are drawn.
DRAWN = 2000


@dataclass(frozen=True)
class Branches:
    """Tables of branches.

    Attributes
    ----------
    name, directory
        What they are called, and where they are; None in memory.
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
    directory: Path | None
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

    @property
    def parameters(self) -> str:
        """What a reader wants to know of the scene, but for the key and the grid; nothing of tables in memory."""
        return self.parameters_without()

    def parameters_without(self, *columns: str) -> str:
        """Return the same without what varies along more columns."""
        if self.directory is None:
            return ""
        scene = scene_of(Result(self.directory, "orbits").provenance)
        return sweep_parameters(scene, [*self.grid, self.key, *columns])

    @property
    def varied(self) -> list[str]:
        """Columns of the grid that have several values."""
        return [key for key in self.grid if len(self.points[key].unique()) > 1]

    def branches(self) -> Iterator[tuple[int, str, pd.DataFrame, pd.DataFrame]]:
        """Yield the number and label of the grid's combination, the points and the special points of each branch."""
        labels: dict[str, int] = {}
        for _, rows in self.points.groupby([*self.grid, "branch"], sort=False):
            label = ", ".join(value_label(key, rows[key].iloc[0]) for key in self.varied)
            first = rows.iloc[0]
            own = self.special
            for key in (*self.grid, "branch"):
                own = own[own[key] == first[key]]
            yield labels.setdefault(label, len(labels)), label, rows.reset_index(drop=True), own

    def sweeps(self) -> Iterator[tuple[str, pd.DataFrame]]:
        """Yield points of the sweep and their colour: that of their combination, where the sweep has its keys."""
        if self.swept is None:
            return
        if not self.varied or any(key not in self.swept for key in self.varied):
            yield BEHIND, self.swept
            return
        combinations = self.points[self.varied].drop_duplicates()
        for number, (_, values) in enumerate(combinations.iterrows()):
            rows = self.swept
            for key in self.varied:
                rows = rows[rows[key] == values[key]]
            yield CURVES[number % len(CURVES)], rows


def plot_orbits(
    directory: Path, kinds: Sequence[str] = (), *, x: str | None = None, saving: Saving | None = None
) -> list[Path]:
    """Draw figures of branches of orbits and save them in their directory.

    Parameters
    ----------
    directory
        Result directory of ``vibroplat orbits``.
    kinds
        ``branches`` (amplitudes, phase difference, power and force: stable solid, unstable dashed, special points
        marked, points of a sweep in the same directory behind them), ``multipliers`` (on the plane, and the largest
        over the key), ``boundaries`` (over two keys). Default: all that there are tables of.
    x
        Column of the horizontal axis. Default: the excitation frequency if the key is the supply frequency, else the
        key.
    saving
        Format, resolution and place of the files.

    Raises
    ------
    TableError
        Tables are missing, have another schema version, or lack data that a figure needs.
    """
    found = read_branches(directory)
    column = x or found.abscissa
    has_curves = any(directory.glob("boundaries.*"))
    if "boundaries" in kinds and not has_curves:
        raise TableError(f"{directory} holds no boundaries; add orbits.boundaries to its configuration")
    drawn = kinds or [kind for kind in FIGURES if has_curves or kind != "boundaries"]
    with styled():
        return [save(FIGURES[kind](found, column), directory, kind, saving) for kind in drawn]


def read_branches(directory: Path) -> Branches:
    """Read the tables of branches, and that of a sweep if it lies in the same directory."""
    if not directory.is_dir():
        raise TableError(f"{directory} is not a directory; allowed: a result directory of vibroplat")
    if (directory / "orbits.sqlite").exists() and not any(directory.glob("branches.*")):
        raise TableError(f"{directory} holds unfinished branches; continue them with `vibroplat orbits --resume`")
    result = Result(directory, "orbits")
    try:
        plan = result.provenance["configuration"]["orbits"]
        named = str(plan["key"]), str((plan.get("boundaries") or {}).get("key", ""))
    except (AttributeError, KeyError, TypeError):
        raise TableError(f"{directory}/provenance.json is not the provenance of branches of orbits") from None
    key, second = (SUPPLY if name == FREQUENCY else name for name in named)
    numbers = (key, EXCITATION, "branch", "rms_x_m", "rms_y_m", PHASE_COLUMN, "motor_power_w", "multiplier_1_re")
    points = read_columns(result, "branches", "sequence", numbers, ("contact_force_max_n",))
    if "stable" not in points:
        raise TableError(f"the branches table in {directory} has no column stable")
    special = read_columns(result, "special", "kind", (key, EXCITATION, "branch", "point"))
    if points.empty:
        raise TableError(f"{directory} holds an empty table of branches; there is nothing to plot")
    swept = Result(directory, "sweep").table("sweep") if any(directory.glob("sweep.*")) else None
    grid = list(points.columns[: list(points.columns).index(key)])
    return Branches(directory.resolve().name, directory, points, special, swept, key, grid, second)


def branches_of(points: pd.DataFrame, special: pd.DataFrame | None = None) -> Branches:
    """Prepare tables in memory, those of special points if there are any; the key stands before ``branch``."""
    *grid, key = (str(column) for column in points.columns[: list(points.columns).index("branch")])
    none = pd.DataFrame({name: [] for name in (*grid, "branch", "kind", "point", EXCITATION)})
    return Branches("orbits", None, points, none if special is None else special, None, key, grid)


# -- branches ----------------------------------------------------------------------------------------------------------


def branches_figure(found: Branches, x: str) -> Figure:
    """Draw all quantities of branches over a column."""
    columns = [c for c in PANELS if c in found.points and found.points[c].notna().any()]
    height = (len(columns) + 1) // 2
    figure, axes = new_figure(height, 2, (11.0, 2.2 + 2.5 * height), sharex=True)
    for axis, column in zip(axes.T.ravel(), columns, strict=False):
        for color, rows in found.sweeps():
            draw_sweep(axis, rows, column, x, color=color)
        for number, _, points, special in found.branches():
            draw_branch(axis, points, special, column, x, color=CURVES[number % len(CURVES)])
        if column.startswith("rms"):
            least = LEAST_RANGE * 1e3 * float(found.points["rms_y_m"].max())
            axis.set_ylim(0.0, max(axis.get_ylim()[1], least))
    for axis in axes.T.ravel()[len(columns) :]:
        axis.set_axis_off()
    for axis in axes.T.ravel()[[height - 1, len(columns) - 1]]:
        axis.set_xlabel(key_label(x))
        axis.tick_params(labelbottom=True)
    head(figure, found.name, found.parameters)
    handles = _legend(found, x)
    if len(columns) < axes.size:  # the empty place
        axes[-1, -1].legend(handles=handles, loc="center left", borderpad=0.0)
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
    xs, ys = _at(points, places, x), _at(points, places, column)
    looks: list[bool | None] = [_segment(points, places[i : i + 2]) for i in range(places.size - 1)]
    if column == PHASE_COLUMN:  # it passes the end of its axis
        looks = [None if jump > np.pi else look for look, jump in zip(looks, np.abs(np.diff(ys)), strict=True)]
    for kind, run in itertools.groupby(range(len(looks)), looks.__getitem__):
        if kind is not None:
            part = list(run)
            shown = slice(part[0], part[-1] + 2)
            axis.plot(xs[shown], ys[shown], "-" if kind else "--", lw=1.5 if kind else 0.9, color=color)
    marks = _at(points, shares, column)
    exact = special[x].to_numpy(dtype=float) if x in special else _at(points, shares, x)
    for where, value, kind in zip(exact, marks, special["kind"], strict=True):
        axis.plot(where, value, MARKERS.get(kind, "*"), ms=5.0, mfc="white", mec=color, mew=1.1, zorder=3)
    if column == PHASE_COLUMN:
        phase_axis(axis)
    else:
        axis.set_ylabel(MEASURES[column].label)
    return axis


def places_of(points: pd.DataFrame, special: pd.DataFrame) -> Any:
    """Return where special points lie along a branch: the number of the point before and the share of the step."""
    before = np.clip(special["point"].to_numpy(dtype=int), 0, max(len(points) - 2, 0))
    if len(points) < 2:
        return before.astype(float)
    values = points[EXCITATION].to_numpy(dtype=float)
    here, there = values[before], values[before + 1]
    step = np.where(there == here, 1.0, there - here)
    return before + np.clip((special[EXCITATION].to_numpy(dtype=float) - here) / step, 0.0, 1.0)


def _at(points: pd.DataFrame, places: Any, column: str) -> Any:
    """Return a column in units of the axis at places along a branch; phase differences lie about 0 … 2π."""
    values = points[column].to_numpy(dtype=float)
    if column == PHASE_COLUMN:
        found = np.interp(places, np.arange(len(points)), np.unwrap(values))
        return wrapped(found)
    factor = MEASURES[column].factor if column in MEASURES else 1.0
    return factor * np.interp(places, np.arange(len(points)), values)


def _segment(points: pd.DataFrame, ends: Any) -> bool:
    """Whether a piece of a line is stable.

    A piece that begins or ends at a special point is as stable as the point at its other end; between two special
    points nothing is known, and it is drawn as unstable.
    """
    whole = [int(end) for end in ends if end == int(end)]
    return bool(whole) and all(bool(points["stable"].iloc[place]) for place in whole)


def draw_sweep(axis: Axes, table: pd.DataFrame, column: str, x: str, *, color: Any = BEHIND) -> None:
    """Draw the points of a sweep, pale, behind what comes later."""
    if x not in table or column not in table:
        return
    values = table[column].to_numpy(dtype=float)
    values = wrapped(values) if column == PHASE_COLUMN else MEASURES[column].factor * values
    for direction, marker in DIRECTIONS.items():
        chosen = (table["direction"] == direction).to_numpy()
        places = table[x].to_numpy(dtype=float)[chosen]
        axis.plot(places, values[chosen], marker, ls="", ms=4.0, color=color, mew=0, alpha=0.5, zorder=1.5)


def _legend(found: Branches, x: str) -> list[Line2D]:
    """Name colours, lines and markers, and say what happens at special points."""
    labels = dict.fromkeys((number, label) for number, label, _, _ in found.branches() if label)
    handles = [Line2D([], [], color=CURVES[number % len(CURVES)], lw=2.0, label=label) for number, label in labels]
    looks: list[tuple[bool, dict[str, Any]]] = [(True, {"ls": "-", "lw": 1.5}), (False, {"ls": "--", "lw": 0.9})]
    for stable, look in looks:
        if (found.points["stable"] == stable).any():
            handles.append(Line2D([], [], color=REFERENCE, label="stable" if stable else "unstable", **look))
    if found.swept is not None and x in found.swept:
        for direction, marker in DIRECTIONS.items():
            if (found.swept["direction"] == direction).any():
                look = {"ls": "", "color": BEHIND, "mew": 0, "ms": 4.0}
                handles.append(Line2D([], [], marker=marker, label=f"sweep, {direction}", **look))
    for kind, meaning in KINDS.items():
        if (found.special["kind"] == kind).any():
            look = {"ls": "", "mfc": "white", "mec": REFERENCE, "mew": 1.1, "ms": 5.0}
            handles.append(Line2D([], [], marker=MARKERS[kind], label=f"{kind}: {meaning}", **look))
    return handles


# -- boundaries --------------------------------------------------------------------------------------------------------


def boundaries_figure(found: Branches, x: str) -> Figure:
    """Draw curves of special points over two keys: the second one over a column; a colour for each kind."""
    assert found.directory is not None
    table = Result(found.directory, "orbits").table("boundaries")
    second = boundary_keys(found, table)[1]
    combinations = table[found.varied].drop_duplicates() if found.varied else table.iloc[:1]
    figure, axes = new_figure(
        1, max(len(combinations), 1), (1.5 + 5.5 * max(len(combinations), 1), 5.2), sharex=True, sharey=True
    )
    for axis, (_, values) in zip(axes[0], combinations.iterrows(), strict=True):
        rows = table
        for key in found.varied:
            rows = rows[rows[key] == values[key]]
        draw_boundaries(axis, rows, second, x)
        axis.set_xlabel(key_label(x))
        axis.set_title(", ".join(value_label(key, values[key]) for key in found.varied), loc="left")
    axes[0, 0].set_ylabel(key_label(second))
    kinds = [kind for kind in KINDS if (table["kind"] == kind).any()]
    handles = [Line2D([], [], color=_colour(kind), lw=1.8, label=f"{kind}: {KINDS[kind]}") for kind in kinds]
    figure.legend(handles=handles, loc="outside lower center", ncols=1)
    head(figure, found.name, found.parameters_without(second))
    return figure


def boundary_keys(found: Branches, table: pd.DataFrame) -> list[str]:
    """Return the columns of both keys of the table ``boundaries``."""
    keys = [found.key, found.second]
    if not all(key in table and is_number(table[key]) for key in keys):
        raise TableError(f"the boundaries table in {found.directory} has no numbers of two keys")
    return keys


def meaning(kind: str) -> str:
    """Say what happens at a kind of special point."""
    return KINDS.get(kind, "")


def draw_boundaries(axis: Axes, table: pd.DataFrame, key: str, x: str = EXCITATION) -> Axes:
    """Draw curves of special points: a key over a column, a colour for each kind.

    Parameters
    ----------
    axis
        Where to draw.
    table
        Rows of the table ``boundaries``.
    key, x
        Columns of both axes.
    """
    for _, rows in table.groupby("curve"):
        kind = rows["kind"].iloc[0]
        mark = "o" if len(rows) == 1 else ""  # of a point that could not be followed there is no line
        axis.plot(rows[x], rows[key], color=_colour(kind), lw=1.8, marker=mark, ms=4.0)
    return axis


def _colour(kind: str) -> str:
    return CURVES[list(KINDS).index(kind) % len(CURVES)]


# -- multipliers -------------------------------------------------------------------------------------------------------


def multipliers_figure(found: Branches, x: str) -> Figure:
    """Draw the leading multipliers on the plane, and the largest one over a column, for each grid combination."""
    combinations: dict[tuple[int, str], list[pd.DataFrame]] = {}
    for number, label, points, _ in found.branches():
        combinations.setdefault((number, label), []).append(points)
    values = found.points[x]
    norm = Normalize(float(values.min()), float(values.max()))
    farthest = found.points.filter(regex=r"^multiplier_\d+_(re|im)$").abs().max().max()
    frame = float(np.clip(1.05 * farthest, NEAREST, FARTHEST))
    size = (1.5 + 4.3 * len(combinations), 8.2)
    figure, axes = new_figure(2, len(combinations), size, sharey="row", height_ratios=(1.35, 1.0))
    for (number, label), (plane, largest) in zip(combinations, axes.T, strict=True):
        parts = combinations[number, label]
        _draw_plane(plane, pd.concat(parts), x, norm, frame)
        plane.set_title(label, loc="left")
        for points in parts:
            _draw_largest(largest, points, x, CURVES[number % len(CURVES)])
        largest.axhline(1.0, color=REFERENCE, lw=0.8)
        plane.set_xlabel("real part")
        largest.set_xlabel(key_label(x))
    axes[0, 0].set_ylabel("imaginary part")
    axes[1, 0].set_ylabel("largest |multiplier|")
    if np.hypot(found.points["multiplier_1_re"], found.points["multiplier_1_im"]).max() > LOGARITHMIC:
        axes[1, 0].set_yscale("log")
    figure.colorbar(ScalarMappable(norm, "viridis"), ax=list(axes[0]), pad=0.01).set_label(key_label(x))
    head(figure, found.name, found.parameters)
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


def _draw_largest(axis: Axes, points: pd.DataFrame, x: str, color: Any) -> None:
    largest = np.hypot(points["multiplier_1_re"], points["multiplier_1_im"])
    axis.plot(points[x], largest, ".-", ms=2.5, lw=0.8, color=color)


# -- one orbit ---------------------------------------------------------------------------------------------------------


def plot_orbit(orbit: Orbit, axes: Sequence[Axes]) -> Sequence[Axes]:
    """Draw an orbit: its speed over its height, and, in the second of two axes, the gap over the phase of exciter 1.

    Parameters
    ----------
    orbit
        Of :func:`vibroplat.orbit`.
    axes
        One or two axes; without material the second one says that there is no gap.
    """
    run = orbit.run
    table = run(np.linspace(0.0, run.segments[-1].end, DRAWN))
    first = axes[0]
    height = COORDINATES["y_m"]
    first.plot(height.factor * table["y_m"], table["y_rate_m_per_s"], color=CURVES[0])
    first.set_xlabel(height.label)
    first.set_ylabel(r"$\dot y$ (m/s)")
    first.set_title(f"period {orbit.period}, {'stable' if orbit.stable else 'unstable'}, {orbit.sequence}", loc="left")
    if len(axes) > 1:
        _draw_gap(axes[1], table)
    return axes


def _draw_gap(axis: Axes, table: pd.DataFrame) -> None:
    turns = (table["phi1_rad"] - table["phi1_rad"].iloc[0]).abs() / (2.0 * np.pi)
    axis.set_xlabel("phase of exciter 1 (turns)")
    gap = COORDINATES["gap_m"]
    axis.set_ylabel(gap.label)
    if "gap_m" in table:
        axis.plot(turns, gap.factor * table["gap_m"], color=CURVES[1])
        axis.set_ylim(bottom=0.0)
    else:
        axis.text(0.5, 0.5, "no material", transform=axis.transAxes, ha="center", color=REFERENCE)


FIGURES: Mapping[str, Callable[[Branches, str], Figure]] = {
    "branches": branches_figure,
    "multipliers": multipliers_figure,
    "boundaries": boundaries_figure,
}
