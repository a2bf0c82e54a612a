"""Figures of branches of periodic orbits, drawn from their tables, and of one orbit."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator

from vibroplat.columns import COORDINATES, PHASE_COLUMN
from vibroplat.continuation.special_points import KINDS, LIFTOFF
from vibroplat.errors import TableError
from vibroplat.hybrid.state import static_rest
from vibroplat.plots.labels import ABSCISSAE, key_label, run_parameters
from vibroplat.plots.reading import Curve, has_table
from vibroplat.plots.response import limit_size
from vibroplat.plots.studies import BEHIND, UNREACHED, Study, reached, read_branches
from vibroplat.plots.style import (
    CURVES,
    DIRECTIONS,
    REFERENCE,
    begin_at_zero,
    entry,
    few,
    head,
    legend_below,
    new_figure,
    panel_grid,
    widen_ticks,
)
from vibroplat.plots.timelines import FROM_REST, in_units, name_axis, tell_shaking
from vibroplat.study.branches import EXCITATION

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from vibroplat.continuation.orbit import Orbit


#: What is drawn over the key; force only where there is any.
PANELS = ("rms_y_m", "rms_x_m", PHASE_COLUMN, "motor_power_w", "contact_force_max_n")
#: Markers and meanings of kinds of special points, and colours of curves of them.
MARKERS = dict(zip(KINDS, "oDsX^vP", strict=True))
MEANINGS = KINDS
_COLOURS = dict(zip(KINDS, itertools.cycle(CURVES)))
#: Lines of boundaries by whether motion comes to their orbits.
_REACHED: dict[bool, dict[str, Any]] = {True: {"lw": 1.8}, False: {"lw": 0.8, "ls": ":"}}
#: What is 0 without flight.
_OF_FLIGHT = ("flight_fraction", "gap_max_m", "impulse_max_n_s")
#: Largest real and imaginary part of multipliers that are drawn, and the least frame, just around the unit circle.
FARTHEST, NEAREST = 2.0, 1.1
#: The axis of sizes of multipliers is linear up to this distance from 1, and logarithmic farther away.
NEAR_ONE = 1e-3
_SIZE_TICKS = (1.0, 0.9, 1.1, 0.99, 1.01, 0.0, 2.0, 0.999, 1.001, *(10.0**power for power in range(1, 32)))
#: Points of an orbit that are drawn.
DRAWN = 2000


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
        column = found.x if x is None else ABSCISSAE[x]
        has_curves = has_table(directory, "boundaries")
        if column not in found.points:
            raise TableError(f"--x {x}: the branches table in {directory} has no column {column}")
        if "boundaries" in kinds and not has_curves:
            raise TableError(f"{directory} holds no boundaries; add orbits.boundaries to its configuration")
        for kind in kinds or [kind for kind in FIGURES if has_curves or kind != "boundaries"]:
            yield directory, kind, FIGURES[kind](found, column)


# -- branches ----------------------------------------------------------------------------------------------------------


def branches_figure(found: Study, x: str) -> Figure:
    """Draw all quantities of branches over a column."""
    columns = [c for c in PANELS if c in found.points and found.points[c].notna().any()] or [PANELS[0]]
    figure, panels = panel_grid(len(columns), 2, (11.0, 2.2 + 2.5 * -(-len(columns) // 2)), key_label(x))
    for axis, column in zip(panels, columns, strict=False):
        for color, rows in found.sweeps():
            draw_sweep(axis, rows, column, x, color=color)
        for _, number, points in found.curves:
            special = found.alike(found.special, points.iloc[0])
            draw_branch(axis, points, special, column, x, color=CURVES[number % len(CURVES)])
        if column.startswith("rms"):
            limit_size(axis, found.points)
        if column == PHASE_COLUMN:
            tell_shaking(axis, found.rotation)
    _head(figure, found)
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

    A branch of one point is a dot, full if it is stable.

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
    if len(points) == 1:  # no line
        axis.plot(xs[:1], ys[:1], "o", ms=3.0, color=color, mfc=color if points["stable"].iloc[0] else "white")
    marks = in_units(at_special(points, special, shares, column), column)
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


def at_special(points: pd.DataFrame, special: pd.DataFrame, shares: Any, column: str) -> Any:
    """Return a column at special points, whose places along a branch are given; a liftoff begins the flight."""
    found = between(points, shares, column)
    return np.where(special["kind"] == LIFTOFF, 0.0, found) if column in _OF_FLIGHT else found


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


def _legend(found: Study, x: str) -> list[Line2D]:
    """Name colours, lines and markers, and say what happens at special points."""
    numbers = {label: number for label, number, _ in found.curves if label}
    handles = few([entry(label, color=CURVES[number % len(CURVES)], lw=2.0) for label, number in numbers.items()])
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


def _head(figure: Figure, found: Study, *more: str) -> None:
    """Put their name above a figure, and parameters but for the key, the grid and more columns that vary."""
    head(figure, found.names[0], found.parameters([*found.grid, found.key, *more]))


# -- boundaries --------------------------------------------------------------------------------------------------------


def boundaries_figure(found: Study, x: str) -> Figure:
    """Draw curves of special points over two keys: the second one over a column; a colour for each kind."""
    table, varied = found.boundaries(), found.varied
    combinations = table[varied].drop_duplicates() if varied else table.iloc[:1]
    count = max(len(combinations), 1)
    figure, axes = new_figure(1, count, (1.5 + 5.5 * count, 5.2), sharex=True, sharey=True)
    for axis in axes[0]:
        axis.set_xlabel(key_label(x))
    for axis, (_, values) in zip(axes[0], combinations.iterrows(), strict=False):  # an empty table has none
        own = found.alike(table, values, varied)
        for (_, is_reached), rows in own.groupby(["curve", reached(own)]) if len(own) else ():
            marker = {"marker": "o" if len(rows) == 1 else "", "ms": 4.0}  # a lone point is no line
            look = {"color": _COLOURS[rows["kind"].iloc[0]], **marker, **_REACHED[bool(is_reached)]}
            axis.plot(rows[x], rows[found.second], **look)
        axis.set_title(found.label(values), loc="left")
    axes[0, 0].set_ylabel(key_label(found.second))
    kinds = [kind for kind in KINDS if (table["kind"] == kind).any()]
    handles = [entry(f"{kind}: {KINDS[kind]}", color=_COLOURS[kind], lw=1.8) for kind in kinds]
    handles += [] if reached(table).all() else [entry(f"thin: {UNREACHED}", color=REFERENCE, **_REACHED[False])]
    figure.legend(handles=handles, loc="outside lower center", ncols=1)
    _head(figure, found, found.second)
    return figure


# -- multipliers -------------------------------------------------------------------------------------------------------


def multipliers_figure(found: Study, x: str) -> Figure:
    """Draw the leading multipliers on the plane, and the largest one over a column, for each grid combination."""
    combinations: dict[int, list[Curve]] = {}
    for curve in found.curves:
        combinations.setdefault(curve.number, []).append(curve)
    values = found.points[x]
    norm = Normalize(float(values.min()), float(values.max()))
    farthest = found.points.filter(regex=r"^multiplier_\d+_(re|im)$").abs().max().max()
    frame = float(np.clip(np.nan_to_num(1.05 * farthest), NEAREST, FARTHEST))
    size = (1.5 + 4.3 * len(combinations), 8.2)
    figure, axes = new_figure(2, len(combinations), size, sharey="row", height_ratios=(1.35, 1.0))
    axes[1, 0].set_yscale("function", functions=(_place, _size))
    for curves, (plane, largest) in zip(combinations.values(), axes.T, strict=True):
        _draw_plane(plane, pd.concat([points for _, _, points in curves]), x, norm, frame)
        plane.set_title(curves[0].label, loc="left")
        largest.update_datalim([(0.0, 1.0)], updatex=False)
        for _, number, points in curves:
            sizes = np.hypot(points["multiplier_1_re"], points["multiplier_1_im"])
            color = CURVES[number % len(CURVES)]
            largest.plot(points[x], sizes, "-", lw=0.6, color=color)
            for stable, filling in ((True, color), (False, "white")):
                chosen = points["stable"] == stable
                largest.plot(points[x][chosen], sizes[chosen], "o", ms=2.8, mew=0.7, color=color, mfc=filling)
        largest.axhline(1.0, color=REFERENCE, lw=0.8)
        plane.set_xlabel("real part")
        largest.set_xlabel(key_label(x))
    axes[0, 0].set_ylabel("imaginary part")
    axes[1, 0].set_ylabel("largest |multiplier|")
    axes[1, 0].yaxis.set_major_locator(FixedLocator(_size_ticks(*axes[1, 0].get_ylim())))
    axes[1, 0].yaxis.set_major_formatter("{x:g}")
    looks = {"marker": "o", "ls": "", "ms": 4.0, "mew": 0.9, "color": REFERENCE}
    legend_below(figure, [entry("stable", **looks), entry("unstable", **looks, mfc="white")])
    figure.colorbar(ScalarMappable(norm, "viridis"), ax=list(axes[0]), pad=0.01).set_label(key_label(x))
    _head(figure, found)
    return figure


def _place(size: Any) -> Any:
    """Return where a multiplier's size is on its axis, on which those near 1, which decide on stability, have room."""
    return np.arcsinh((size - 1.0) / NEAR_ONE)


def _size(place: Any) -> Any:
    """Return the size of a multiplier at a place of its axis, the inverse of :func:`_place`."""
    return 1.0 + NEAR_ONE * np.sinh(place)


def _size_ticks(low: float, high: float) -> list[float]:
    """Return ticks of sizes between two, those near 1 first, as many as there is room for."""
    kept: list[float] = []
    for tick in _SIZE_TICKS:
        distances = [abs(_place(tick) - _place(other)) for other in kept]
        if low <= tick <= high and min(distances, default=np.inf) > 0.05 * (_place(high) - _place(low)):
            kept.append(tick)
    return kept


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


FIGURES: Mapping[str, Callable[[Study, str], Figure]] = {
    "branches": branches_figure,
    "multipliers": multipliers_figure,
    "boundaries": boundaries_figure,
}
