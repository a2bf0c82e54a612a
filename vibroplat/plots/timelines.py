"""Panels over time: each function draws into an axis what a table of a run holds, and returns the axis.

Also units and names of any axis.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from vibroplat.columns import COORDINATES, FORCES, PHASE, PHASE_COLUMN, describe_sync, quantity_of
from vibroplat.config import digits
from vibroplat.config.scene import Scene
from vibroplat.plots.style import CONTACT, PLATFORM
from vibroplat.results.labels import phase_label
from vibroplat.results.picture import BLACK, CURVES, REFERENCE, SYNC

FloatArray = np.ndarray[Any, np.dtype[np.float64]]

_SHOWN = COORDINATES | FORCES

#: Name of the axis of y where it is counted from the static rest.
FROM_REST = "$y$ from rest (mm)"
TURN = 2.0 * np.pi
#: Phase differences are shown from here on, so that 0 and π, near which exciters synchronize, are well inside.
LOWEST_PHASE = -0.5 * np.pi
#: Most wraps of a line of common width; of more, nothing but a drift is to be seen.
MOST_WRAPS = 60
#: Opacity of ranges, and distance of curves that coincide, over their size.
PALE, SAME = 0.25, 0.015
#: Distance from 0 and from π up to which phase differences are shaded as those of a synchronization (rad).
NEAR = np.pi / 3.0
#: A step of the phase difference that is a wrap, not a motion (rad).
WRAP = np.pi


def draw_coordinate(axis: Axes, table: pd.DataFrame, column: str, **look: Any) -> Axes:
    """Draw a column of a trajectory over time, in mm, mrad or N.

    Parameters
    ----------
    axis
        Where to draw.
    table
        A trajectory, or some rows of one.
    column
        ``x_m``, ``y_m``, ``phi_rad``, ``gap_m`` or ``contact_force_n``.
    look
        Options of matplotlib's lines.

    Returns
    -------
    Axes
        The same axis.
    """
    axis.plot(table["t_s"], in_units(table[column], column), **{"color": PLATFORM} | look)
    return name_axis(axis, column)


def draw_envelope(
    axis: Axes, envelope: pd.DataFrame, column: str, *, color: str = PLATFORM, label: str | None = None,
    filled: bool = True,
) -> Axes:  # fmt: skip
    """Draw the range of a column over time between its least and largest values in short intervals.

    ``envelope`` has times (``t_s``) and the columns ``column:min`` and ``column:max``. Without ``filled`` its outlines
    are drawn, so that several do not hide each other.
    """
    low, high = (in_units(envelope[f"{column}:{end}"], column) for end in ("min", "max"))
    if filled:
        axis.fill_between(envelope["t_s"], low, high, color=color, lw=0.0, alpha=PALE)
    axis.plot(envelope["t_s"], low, lw=0.7, color=color, label=label)
    axis.plot(envelope["t_s"], high, lw=0.7, color=color)
    return name_axis(axis, column)


def mark_peak(axis: Axes, envelope: pd.DataFrame, column: str, value: float, time: float, pace: float | None) -> Axes:
    """Mark the largest size of a force, or where a stroke was complete, with its time (s) and the speed then (Hz)."""
    speed = "" if pace is None else f", {digits.quantity(pace, 'Hz', digits=3)}"
    least, largest = envelope[f"{column}:min"], envelope[f"{column}:max"]
    if column in FORCES:
        place, told = (-value if -least.min() > largest.max() else value), digits.quantity(value, "N")
    else:
        place = least.min() if least.argmin() > largest.argmax() else largest.max()
        place, told = float(in_units(place, column)), f"stroke {digits.quantity(value, 'm')}"
    axis.plot(time, place, "o", ms=4.5, mfc="white", mec=BLACK, clip_on=False, zorder=5)
    axis.annotate(
        f"{told} at {digits.quantity(time, 's')}{speed}", (time, place), (7.0, 0.0), textcoords="offset points",
        fontsize=8, va="center", bbox={"fc": "white", "ec": "none", "alpha": 0.7, "pad": 0.5},
    )  # fmt: skip
    return axis


def draw_contact(axis: Axes, table: pd.DataFrame) -> Axes:
    """Shade the times in contact."""
    attached = (~table["mode"].isin(["flight", "bare"])).to_numpy()
    t = table["t_s"].to_numpy()
    edges = np.flatnonzero(np.diff(np.concatenate(([0], attached.astype(int), [0]))))
    for number, (first, after) in enumerate(zip(edges[::2], edges[1::2], strict=True)):
        axis.axvspan(t[first], t[after - 1], color=CONTACT, lw=0, zorder=0, label="attached" if number == 0 else None)
    return axis


def draw_impacts(axis: Axes, events: pd.DataFrame) -> Axes:
    """Mark the times of impacts on the line of zero gap."""
    impacts = events[events["kind"] == "impact"]
    if impacts.empty:  # an empty line that is not clipped would take all the room
        return axis
    size = 5.0 if len(impacts) <= 60 else 2.5
    look: dict[str, Any] = {"ms": size, "mew": 0, "clip_on": False, "label": "impact"}
    axis.plot(impacts["t_s"], np.zeros(len(impacts)), "v", color=BLACK, **look)
    return axis


def draw_impulses(axis: Axes, events: pd.DataFrame, color: str = BLACK, label: str | None = None) -> Axes:
    """Draw the impulses of impacts as stems, over time."""
    strikes = events[events["impulse_n_s"] > 0.0]
    times, impulses = strikes["t_s"].to_numpy(), strikes["impulse_n_s"].to_numpy()
    stems = np.stack([np.column_stack([times, np.zeros_like(times)]), np.column_stack([times, impulses])], axis=1)
    axis.add_collection(LineCollection(list(stems), colors=color, lw=0.9))
    axis.set_autoscaley_on(True)  # the limit below has ended it where another run's were drawn before
    axis.plot(times, impulses, "o", color=color, ms=3.0 if len(times) <= 60 else 1.5, label=label)
    axis.set_ylim(bottom=0.0)
    axis.set_ylabel("impulse $P$ (N·s)")
    return axis


def draw_speeds(
    axis: Axes, table: pd.DataFrame, colours: tuple[str, str] = (CURVES[0], CURVES[1]), name: str = ""
) -> Axes:
    """Draw the speeds of both exciters (Hz) over time; that of exciter 2 is dashed. Those that coincide are one line.

    Each is positive in the direction in which the exciter turns on the whole: one that swings at last passes 0.
    """
    rates = [table[f"phi{number}_rate_rad_per_s"].to_numpy(dtype=float) for number in (1, 2)]
    first, second = (rate * (-1.0 if np.nansum(rate) < 0.0 else 1.0) / TURN for rate in rates)
    if coincide(first, second):
        axis.plot(table["t_s"], 0.5 * (first + second), color=colours[0], label=f"{name}exciter 1 = 2")
    else:
        for number, style, speed in ((1, "-", first), (2, "--", second)):
            axis.plot(table["t_s"], speed, style, color=colours[number - 1], label=f"{name}exciter {number}")
    axis.set_ylabel("speed (Hz)")
    return axis


def coincide(first: Any, second: Any) -> bool:
    """Whether two curves are the same up to :data:`SAME` of what they reach."""
    pair = np.array([first, second], dtype=float)
    apart, size = (np.nanmax(np.abs(values), initial=0.0) for values in (pair[0] - pair[1], pair))
    return bool(apart <= SAME * size)


def draw_synchronous_speed(axis: Axes, scene: Scene, times: pd.Series) -> Axes:
    """Draw the synchronous speeds of both motors (Hz) over time, where they are on."""
    t = np.linspace(float(times.min()), float(times.max()), 1001)
    found = [scene.drive.at(time) for time in t]
    speeds = []
    for number, exciter in enumerate(scene.exciter_pair):
        now = [i.frequency_at(time) if i.driven[number] else np.nan for i, time in zip(found, t, strict=True)]
        speeds.append(np.array(now) / exciter.pole_pairs)
    first, second = speeds
    if np.isnan(speeds).all():
        return axis
    same = np.isnan(first) | np.isnan(second) | (first == second)
    if same.all():
        axis.plot(t, np.where(np.isnan(first), second, first), ":", lw=1.0, color=REFERENCE, label="synchronous speed")
        return axis
    for number, (speed, style) in enumerate(zip(speeds, (":", "-."), strict=True), start=1):
        axis.plot(t, speed, style, lw=1.0, color=REFERENCE, label=f"synchronous speed, motor {number}")
    return axis


def draw_phase_difference(
    axis: Axes, table: pd.DataFrame, *, co_rotating: bool = False, color: str = PLATFORM, label: str | None = None
) -> Axes:
    """Draw the phase difference of the exciters over time; wraps are left out."""
    phase = phase_of(table, co_rotating=co_rotating)
    times, wraps = table["t_s"].to_numpy(dtype=float), np.flatnonzero(np.abs(np.diff(phase)) > WRAP) + 1
    line = np.insert(times, wraps, times[wraps]), np.insert(phase, wraps, np.nan)
    axis.plot(*line, lw=1.0 if len(wraps) <= MOST_WRAPS else 0.25, color=color, label=label)
    phase_axis(axis, phase_label(co_rotating))
    tell_shaking(axis, "co-rotating" if co_rotating else "counter-rotating")
    return axis


def phase_of(table: pd.DataFrame, *, co_rotating: bool) -> FloatArray:
    """Return the phase differences of a trajectory on their axis."""
    sign = -1.0 if co_rotating else 1.0
    return wrapped((table["phi1_rad"] + sign * table["phi2_rad"]).to_numpy(dtype=float))


def wrapped(phase: FloatArray) -> FloatArray:
    """Put angles into [−π/2, 3π/2)."""
    return np.mod(phase - LOWEST_PHASE, TURN) + LOWEST_PHASE


def in_units(values: Any, column: str) -> FloatArray:
    """Return values of a column in the unit of its axis; phase differences lie on their axis."""
    found = np.asarray(values, dtype=float)
    if column == PHASE_COLUMN:
        return wrapped(found)
    return (_SHOWN.get(column) or quantity_of(column)).factor * found


def name_axis(axis: Axes, column: str) -> Axes:
    """Label the vertical axis of a column with its name and unit."""
    if column == PHASE_COLUMN:
        phase_axis(axis)
    else:
        axis.set_ylabel((_SHOWN.get(column) or quantity_of(column)).label)
    return axis


def phase_axis(axis: Axes, label: str = PHASE) -> None:
    """Label an axis of phase differences: a circle that is cut at −π/2, with values in (−π, π] as in the tables."""
    axis.set_ylim(LOWEST_PHASE - 0.1, LOWEST_PHASE + TURN + 0.1)
    ticks = {-0.5: "−90°", 0.0: "0°", 0.5: "90°", 1.0: "±180°", 1.5: "−90°"}
    axis.set_yticks([np.pi * tick for tick in ticks], list(ticks.values()))
    axis.set_ylabel(label)
    for angle, name in () if axis.texts else ((0.0, "in-phase"), (np.pi, "antiphase")):
        axis.axhspan(angle - NEAR, angle + NEAR, color=SYNC[name], alpha=0.1, lw=0.0, zorder=0.4)
        axis.annotate(
            name, (1.0, angle + NEAR), (-2.0, -2.0), axis.get_yaxis_transform(), "offset points",
            fontsize=7.5, color=REFERENCE, ha="right", va="top",
        )  # fmt: skip


def tell_shaking(axis: Axes, rotation: str) -> None:
    """Say on an axis of phase differences what a machine does in phase and in antiphase, if its rotation is known."""
    for text in axis.texts:
        text.set_text(describe_sync(text.get_text(), rotation))
