"""Largest loads over a run: forces into the foundation, accelerations, torques and powers of the motors, named points.

Springs and dampers, accelerations and named points are linear in the unknowns, and so have polynomials of their own in
each step, *forms*.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vibroplat.hybrid.modes import FLIGHT, MODES
from vibroplat.kernels.compiled import FloatArray, call_int, compiled, fused, inlined
from vibroplat.kernels.lanes import horner_pair_8, put_row
from vibroplat.kernels.polynomial import COVERED, crossing, extremes, value, values
from vibroplat.model.motor import motor_torque, slip_speeds
from vibroplat.model.parameters import Parameters
from vibroplat.model.platform import suspension
from vibroplat.model.systems import DIFFERENTIAL, GAP, SIZES
from vibroplat.observe.extremes import (
    ACCELERATION,
    FORCE,
    HEIGHT,
    LIFT,
    MOMENT,
    NODES,
    OPENING,
    POINTS,
    POWER_1,
    PULL_X,
    PULL_Y,
    ROTATION,
    SIDEWAYS,
    SPEED_1,
    TORQUE_1,
    Span,
    cover,
    place_of,
    remember,
)

#: Places of x, y, φ and the gap among the unknowns. Integers of numpy, so that functions are compiled once for all.
_X, _Y, _PHI, _GAP = np.array([0, 1, 2, GAP])

#: Forms that are looked at side by side: three forces and two accelerations, or x, y and both accelerations of two
#: points.
FORMS = 8
_FORCES, _ACCELERATIONS, _A_POINT = 0, 3, 4
#: What varies less in a step than this part of y, of the force along y or of the speed is not looked at more closely.
FINE = 1e-9


# -- forms ------------------------------------------------------------------------------------------------


@inlined
def fill_forms(c: FloatArray, degree: int, n: int, length: float, block: int, forms: FloatArray, p: Parameters) -> None:
    """Fill the polynomials of a block of forms: forces and accelerations, or two named points."""
    inverse = 1.0 / length
    for k in range(degree + 1):
        share = (k + 1) * inverse if k < degree else 0.0
        above = min(k + 1, degree)
        ax, ay = share * c[above, n], share * c[above, n + 1]
        if block == 0:
            fx, fy, moment = suspension((c[k, 0], c[k, 1], c[k, 2]), (c[k, n], c[k, n + 1], c[k, n + 2]), p)
            put_row(forms, k, (-fx, -fy, -moment, ax, ay, 0.0, 0.0, 0.0))
        else:
            i, phi, aphi = 2 * (block - 1), c[k, 2], share * c[above, n + 2]
            x, y, other_x, other_y = p.point_x[i], p.point_y[i], p.point_x[i + 1], p.point_y[i + 1]
            first = (c[k, 0] - y * phi, c[k, 1] + x * phi, ax - y * aphi, ay + x * aphi)
            second = (c[k, 0] - other_y * phi, c[k, 1] + other_x * phi, ax - other_y * aphi, ay + other_x * aphi)
            put_row(forms, k, first + second)


class Equations(NamedTuple):
    """Where the equations are: addresses of :func:`vibroplat.hybrid.jumps.start_callback` and of the parameters."""

    start: int
    parameters: int


@inlined
def shaken(
    peaks: Any,
    k: int,
    c: FloatArray,
    degree: int,
    room: Any,
    nodes: int,
    j: int,
    sideways: float,
    since: float,
    system: int,
    spot: tuple[float, float],
    span: Span,
    equations: Equations,
) -> None:
    """Let extremes k cover the size of an acceleration, whose forms are j along x and j + 1 along y.

    ``sideways`` is 1, or 0 if that along y alone counts; ``spot`` is the point of the platform. The polynomials say
    whether and where it is larger than before, and the equations how large it is there: these are more accurate, and
    take longer. The samples are of the part of the step from ``since`` on.
    """
    samples, width = room.form_samples, 1.0 - since
    before = here = size_at(samples, 0, j, sideways)
    for i in range(nodes + 2):
        after = size_at(samples, min(i + 1, nodes + 1), j, sideways)
        if here >= before and here >= after and here + max(here - before, here - after) > peaks.square[k]:
            s, low, high = place_of(i, nodes), place_of(i - 1, nodes), place_of(i + 1, nodes)
            s, square = steepest(
                room.forms, degree, j, sideways, since + width * s, since + width * low, since + width * high
            )
            if square > peaks.square[k]:
                peaks.square[k] = square
                remember(peaks, k, exact_size(c, degree, s, system, sideways, spot, room, span, equations), s, span)
        before, here = here, after


@inlined
def size_at(samples: FloatArray, i: int, j: int, sideways: float) -> float:
    """Square of an acceleration at a sample."""
    return sideways * samples[i, j] * samples[i, j] + samples[i, j + 1] * samples[i, j + 1]


@fused
def steepest(
    forms: FloatArray, degree: int, j: int, sideways: float, s: float, low: float, high: float
) -> tuple[float, float]:
    """Fraction of a step near s at which the square of an acceleration is largest, and that square.

    By Newton's iteration, up to a way that three terms of its Taylor series cover.
    """
    square, begun = -1.0, s
    for _ in range(4):
        x, x1, x2 = forms[degree, j], 0.0, 0.0  # derivatives over their factorials
        y, y1, y2 = forms[degree, j + 1], 0.0, 0.0
        for k in range(degree - 1, -1, -1):
            x2, y2 = x2 * s + x1, y2 * s + y1
            x1, y1 = x1 * s + x, y1 * s + y
            x, y = x * s + forms[k, j], y * s + forms[k, j + 1]
        found = sideways * x * x + y * y
        if found > square:
            square, begun = found, s
        rate = sideways * x * x1 + y * y1
        half = sideways * (x1 * x1 + 2.0 * x * x2) + y1 * y1 + 2.0 * y * y2
        if not half < 0.0:
            break
        following = min(max(s - rate / half, low), high)
        way = following - s
        if abs(way) <= COVERED:
            return following, found + way * (2.0 * rate + half * way)
        s = following
    return begun, square


@compiled
def exact_size(
    c: FloatArray,
    degree: int,
    s: float,
    system: int,
    sideways: float,
    spot: tuple[float, float],
    room: Any,
    span: Span,
    equations: Equations,
) -> float:
    """Size of the acceleration of a point of the platform at a fraction of a step, by the equations (m/s²)."""
    y, yp, n = room.y, room.yp, DIFFERENTIAL[system] // 2
    values(c, degree, s, y[: 2 * n])
    addresses = (y.ctypes.data, yp.ctypes.data, room.full.ctypes.data)
    call_int(equations.start, (system, span.begin + s * span.length, *addresses, equations.parameters, 1))
    ax, ay = yp[n] - spot[1] * yp[n + 2], yp[n + 1] + spot[0] * yp[n + 2]
    return float(np.sqrt(sideways * ax * ax + ay * ay))


# -- motors -----------------------------------------------------------------------------------------------


@inlined
def drive_at(peaks: Any, i: int, speed: float, s: float, span: Span, p: Parameters) -> None:
    """Let the extremes of torque, in the direction of the drive, and power cover those of motor i at a speed."""
    torque = motor_torque(i, span.begin + s * span.length, speed, p)
    remember(peaks, TORQUE_1 + i, p.direction[i] * torque, s, span)
    remember(peaks, POWER_1 + i, torque * speed, s, span)


@inlined
def cover_motor(
    peaks: Any,
    i: int,
    c: FloatArray,
    degree: int,
    samples: FloatArray,
    nodes: int,
    n: int,
    since: float,
    last: float,
    fresh: bool,
    span: Span,
    p: Parameters,
) -> None:
    """Let the extremes of speed, torque and power of motor i cover a step from fraction ``since`` of it.

    At a constant supply torque and power depend on the speed alone: they have extremes at new extremes of the speed, at
    the critical slip, and for the power where u² + 2uΔ²/ω₀ = Δ², with slip speed u and critical slip speed Δ. ``fresh``
    says that the step is the first of a piece.
    """
    k, j = SPEED_1 + i, n + 3 + i
    least, largest = peaks.least[k], peaks.largest[k]
    cover(peaks, k, c, degree, samples, nodes, j, since, last, span, FINE * abs(last), False)
    if peaks.least[k] < least:
        drive_at(peaks, i, peaks.least[k], (peaks.at_least[k] - span.begin) / span.length, span, p)
    if peaks.largest[k] > largest:
        drive_at(peaks, i, peaks.largest[k], (peaks.at_largest[k] - span.begin) / span.length, span, p)
    drive_at(peaks, i, last, 1.0, span, p)
    begun = c[0, j] if since == 0.0 else value(c, degree, j, since)
    if fresh or since > 0.0:
        drive_at(peaks, i, begun, since, span, p)
    if p.since > 0.0 or p.speed_ramp[i] != 0.0 or p.slip_ramp[i] != 0.0:  # the supply changes
        low, high, at_low, at_high = extremes(c, degree, j, since, last)
        drive_at(peaks, i, low, at_low, span, p)
        drive_at(peaks, i, high, at_high, span, p)
    before, critical = slip_speeds(i, span.begin, begun, p)
    after = slip_speeds(i, span.begin + span.length, last, p)[0]
    synchronous = after + p.direction[i] * last
    if max(abs(before), abs(after)) * (abs(synchronous) + 2.0 * critical) >= critical * abs(synchronous):
        pass_levels(peaks, i, c, degree, j, since, synchronous, critical, span, p)


@compiled
def pass_levels(
    peaks: Any,
    i: int,
    c: FloatArray,
    degree: int,
    j: int,
    since: float,
    synchronous: float,
    critical: float,
    span: Span,
    p: Parameters,
) -> None:
    """Let the extremes of motor i cover the slips of largest torque and power that a step passes."""
    ratio = critical / synchronous if synchronous != 0.0 else 0.0
    root = np.sqrt(1.0 + ratio * ratio)
    for slip in (critical, -critical, critical * (root - ratio), -critical * (root + ratio)):
        level = p.direction[i] * (synchronous - slip)
        if (c[0, j] - level) * (value(c, degree, j, 1.0) - level) < 0.0:
            s = crossing(c, degree, j, level)
            if s >= since:
                drive_at(peaks, i, level, s, span, p)


# -- a step ------------------------------------------------------------------------------------------------


@inlined
def widen(
    peaks: Any,
    c: FloatArray,
    degree: int,
    room: Any,
    nodes: int,
    system: int,
    since: float,
    end: FloatArray,
    fresh: bool,
    span: Span,
    equations: Equations,
    p: Parameters,
) -> None:
    """Let the extremes cover a step from fraction ``since`` of it; ``fresh``: it is the first of its piece."""
    samples, force, n = room.samples, DIFFERENTIAL[system], DIFFERENTIAL[system] // 2
    fine = FINE * abs(end[1])
    for k, j in ((SIDEWAYS, _X), (HEIGHT, _Y), (ROTATION, _PHI)):
        cover(peaks, k, c, degree, samples, nodes, j, since, end[j], span, fine, False)
    if MODES[system] == FLIGHT:
        cover(peaks, OPENING, c, degree, samples, nodes, _GAP, since, end[_GAP], span, 0.0, False)
    if SIZES[system] > force:
        cover(peaks, FORCE, c, degree, samples, nodes, force, since, end[force], span, 0.0, False)
    for i in range(2):
        cover_motor(peaks, i, c, degree, samples, nodes, n, since, end[n + 3 + i], fresh, span, p)
    fill_forms(c, degree, n, span.length, 0, room.forms, p)
    sample_forms(degree, since, nodes, room)
    inside, last = room.form_samples[1:], nodes + 1
    fine = FINE * abs(room.form_samples[last, _FORCES + 1])
    for k, j in ((PULL_X, _FORCES), (PULL_Y, _FORCES + 1), (MOMENT, _FORCES + 2)):
        cover(peaks, k, room.forms, degree, inside, nodes, j, since, room.form_samples[last, j], span, fine, True)
    spot = (0.0, 0.0)
    for k, sideways in ((LIFT, 0.0), (ACCELERATION, 1.0)):
        shaken(peaks, k, c, degree, room, nodes, _ACCELERATIONS, sideways, since, system, spot, span, equations)
    if room.named > 0:
        cover_points(peaks, c, degree, room, nodes, system, since, span, equations, p)


@compiled
def cover_points(
    peaks: Any,
    c: FloatArray,
    degree: int,
    room: Any,
    nodes: int,
    system: int,
    since: float,
    span: Span,
    equations: Equations,
    p: Parameters,
) -> None:
    """Let the extremes of named points cover a step from fraction ``since`` of it."""
    inside, last, fine = room.form_samples[1:], nodes + 1, FINE * abs(c[0, 1])
    for i in range(room.named):
        if i % 2 == 0:
            fill_forms(c, degree, DIFFERENTIAL[system] // 2, span.length, 1 + i // 2, room.forms, p)
            sample_forms(degree, since, nodes, room)
        for axis in range(2):
            k, j = POINTS + 3 * i + axis, _A_POINT * (i % 2) + axis
            cover(peaks, k, room.forms, degree, inside, nodes, j, since, room.form_samples[last, j], span, fine, False)
        k, j, spot = POINTS + 3 * i + 2, _A_POINT * (i % 2) + 2, (p.point_x[i], p.point_y[i])
        shaken(peaks, k, c, degree, room, nodes, j, 1.0, since, system, spot, span, equations)


@inlined
def sample_forms(degree: int, since: float, nodes: int, room: Any) -> None:
    """Fill the values of the forms at both ends and the nodes of the part of a step from fraction ``since`` on."""
    forms, samples, width = room.forms, room.form_samples, 1.0 - since
    for i in range(1, nodes + 1, 2):
        first, second = since + width * NODES[nodes, i - 1], since + width * NODES[nodes, i]
        horner_pair_8(forms, degree, first, second, samples[i : i + 2])
    horner_pair_8(forms, degree, 1.0, since, samples[nodes + 1 : nodes + 3])
    for j in range(FORMS):
        samples[0, j] = samples[nodes + 2, j]
