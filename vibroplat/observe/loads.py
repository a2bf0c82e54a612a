"""Largest loads over a run: forces into the foundation, accelerations, torques and powers of the motors, named points.

Springs and dampers, accelerations and named points are linear in the unknowns, and so have polynomials of their own in
each step, *forms*.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vibroplat.hybrid.modes import FLIGHT, MODES
from vibroplat.kernels.compiled import FloatArray, call_int, compiled, fused, inlined
from vibroplat.kernels.lanes import horner_four_8, put_forms, put_row
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
    OPENING,
    POINTS,
    POWER_1,
    PULL_X,
    PULL_Y,
    ROTATION,
    SIDEWAYS,
    SPEED_1,
    TORQUE_1,
    WEIGHTS,
    Span,
    cover,
    place_of,
    remember,
)

#: Places of x, y, φ and the gap among the unknowns. Integers of numpy, so that functions are compiled once for all.
_X, _Y, _PHI, _GAP = np.array([0, 1, 2, GAP])

#: Forms that are looked at side by side: three forces and, from the fifth on, three accelerations; or x, y and their
#: accelerations of two points.
FORMS = 8
_FORCES, _ACCELERATIONS, _A_POINT = 0, 4, 4
#: What varies less in a step than this part of y, of the force along y or of the speed is not looked at more closely.
FINE = 1e-9
#: Part of the acceleration along y up to which that along x does not matter for its size.
ALIKE = 1e-5


# -- forms ------------------------------------------------------------------------------------------------


@compiled
def fill_points(c: FloatArray, degree: int, first: int, room: Any, p: Parameters) -> None:
    """Fill the polynomials of two named points, from those of the unknowns and from the forms, which hold them then."""
    x_1, y_1, x_2, y_2 = p.point_x[first], p.point_y[first], p.point_x[first + 1], p.point_y[first + 1]
    for k in range(degree + 1):
        x, y, phi = c[k, 0], c[k, 1], c[k, 2]
        ax, ay, aphi = room.forms[k, 4], room.forms[k, 5], room.forms[k, 6]
        one = (x - y_1 * phi, y + x_1 * phi, ax - y_1 * aphi, ay + x_1 * aphi)
        put_row(room.forms, k, (*one, x - y_2 * phi, y + x_2 * phi, ax - y_2 * aphi, ay + x_2 * aphi))


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
    samples = room.form_samples
    before = here = size_at(samples, 0, j, sideways)
    for i in range(nodes + 2):
        after = size_at(samples, min(i + 1, nodes + 1), j, sideways)
        if here >= before and here >= after and here + max(here - before, here - after) > peaks.square[k]:
            low, s, high = between(i - 1, nodes, since), between(i, nodes, since), between(i + 1, nodes, since)
            s, square = steepest(room.forms, degree, j, sideways, s, low, high)
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
    span: Span,
    p: Parameters,
) -> None:
    """Let the extremes of speed, torque and power of motor i cover a step from fraction ``since`` of it.

    At a constant supply torque and power depend on the speed alone: they have extremes at new extremes of the speed, at
    the critical slip, and for the power where u² + 2uΔ²/ω₀ = Δ², with slip speed u and critical slip speed Δ.
    """
    k, j = SPEED_1 + i, n + 3 + i
    least, largest = peaks.least[k], peaks.largest[k]
    cover(peaks, k, c, degree, samples, nodes, j, since, last, span, FINE * abs(last), False)
    if peaks.least[k] < least:
        drive_at(peaks, i, peaks.least[k], (peaks.at_least[k] - span.begin) / span.length, span, p)
    if peaks.largest[k] > largest:
        drive_at(peaks, i, peaks.largest[k], (peaks.at_largest[k] - span.begin) / span.length, span, p)
    begun = c[0, j] if since == 0.0 else value(c, degree, j, since)
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
    span: Span,
    equations: Equations,
    p: Parameters,
) -> None:
    """Let the extremes cover a step from fraction ``since`` of it."""
    samples, force, n = room.samples, DIFFERENTIAL[system], DIFFERENTIAL[system] // 2
    fine = FINE * abs(end[1])
    for k, j in ((SIDEWAYS, _X), (HEIGHT, _Y), (ROTATION, _PHI)):
        cover(peaks, k, c, degree, samples, nodes, j, since, end[j], span, fine, False)
    if MODES[system] == FLIGHT:
        cover(peaks, OPENING, c, degree, samples, nodes, _GAP, since, end[_GAP], span, 0.0, False)
    if SIZES[system] > force:
        cover(peaks, FORCE, c, degree, samples, nodes, force, since, end[force], span, 0.0, False)
    for i in range(2):
        cover_motor(peaks, i, c, degree, samples, nodes, n, since, end[n + 3 + i], span, p)
    put_forms(c, degree, n, 1.0 / span.length, room.springs, room.forms)
    sample_forms(degree, since, nodes, room)
    inside, last = room.form_samples[1:], nodes + 1
    fine = FINE * abs(room.form_samples[last, _FORCES + 1])
    for k, j in ((PULL_X, _FORCES), (PULL_Y, _FORCES + 1), (MOMENT, _FORCES + 2)):
        cover(peaks, k, room.forms, degree, inside, nodes, j, since, room.form_samples[last, j], span, fine, True)
    spot, across, along = (0.0, 0.0), 0.0, 0.0
    for i in range(nodes + 2):
        across = max(across, abs(room.form_samples[i, _ACCELERATIONS]))
        along = max(along, abs(room.form_samples[i, _ACCELERATIONS + 1]))
    shaken(peaks, LIFT, c, degree, room, nodes, _ACCELERATIONS, 0.0, since, system, spot, span, equations)
    if across > ALIKE * along:
        shaken(peaks, ACCELERATION, c, degree, room, nodes, _ACCELERATIONS, 1.0, since, system, spot, span, equations)
    elif peaks.largest[LIFT] > peaks.largest[ACCELERATION]:
        remember(peaks, ACCELERATION, peaks.largest[LIFT], (peaks.at_largest[LIFT] - span.begin) / span.length, span)
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
            put_forms(c, degree, DIFFERENTIAL[system] // 2, 1.0 / span.length, room.springs, room.forms)
            fill_points(c, degree, i, room, p)
            sample_forms(degree, since, nodes, room)
        for axis in range(2):
            k, j = POINTS + 3 * i + axis, _A_POINT * (i % 2) + axis
            cover(peaks, k, room.forms, degree, inside, nodes, j, since, room.form_samples[last, j], span, fine, False)
        k, j, spot = POINTS + 3 * i + 2, _A_POINT * (i % 2) + 2, (p.point_x[i], p.point_y[i])
        shaken(peaks, k, c, degree, room, nodes, j, 1.0, since, system, spot, span, equations)


@inlined
def sample_forms(degree: int, since: float, nodes: int, room: Any) -> None:
    """Fill the values of the forms at both ends and the nodes of the part of a step from fraction ``since`` on."""
    for i in range(0, nodes + 2, 4):
        places = (between(i, nodes, since), between(i + 1, nodes, since), between(i + 2, nodes, since))
        horner_four_8(room.forms, degree, (*places, between(i + 3, nodes, since)), room.form_samples, i)


@inlined
def between(i: int, nodes: int, since: float) -> float:
    """Fraction of a step at sample i of the part from ``since`` on."""
    return since + (1.0 - since) * place_of(i, nodes)


@inlined
def add_forces(sums: FloatArray, samples: FloatArray, n: int, duration: float, nodes: int, p: Parameters) -> None:
    """Add forces into the foundation, and then their squares, over a part of a step (s), from the samples."""
    x = y = moment = xx = yy = moments = 0.0
    for i in range(nodes):
        q, weight = samples[i], duration * WEIGHTS[nodes, i]
        fx, fy, m = suspension((q[0], q[1], q[2]), (q[n], q[n + 1], q[n + 2]), p)
        x, y, moment = x - weight * fx, y - weight * fy, moment - weight * m
        xx, yy, moments = xx + weight * fx * fx, yy + weight * fy * fy, moments + weight * m * m
    sums[0] += x
    sums[1] += y
    sums[2] += moment
    sums[3] += xx
    sums[4] += yy
    sums[5] += moments
