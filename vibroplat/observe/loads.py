"""Largest loads over a run: forces into the foundation, accelerations, named points.

Samples of the motion show which steps may contain a new extreme; only such steps are searched.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vibroplat.kernels.compiled import FloatArray, call_int, compiled, fused_inline, inlined
from vibroplat.kernels.lanes import load_2, some
from vibroplat.kernels.polynomial import QUADRATIC_RANGE, values
from vibroplat.model.parameters import Parameters
from vibroplat.model.springs import CURVED_FORCE, CURVED_SQUARE, add_pulls_beyond
from vibroplat.model.systems import DIFFERENTIAL
from vibroplat.observe.curves import update_motor_extremes
from vibroplat.observe.extremes import (
    ACCELERATION,
    DRIVEN_1,
    GAPS,
    HEIGHT,
    LIFT,
    MOMENT,
    POINT_ACCELERATIONS,
    POINTS,
    PULL_X,
    PULL_Y,
    REACH,
    ROTATION,
    SIDEWAYS,
    TIE,
    Span,
    margin,
    place_of,
    remember,
    vertex,
)
from vibroplat.observe.peaks import COLUMNS, EIGHT, beyond_limits, cover, largest_squares, put_quantities

#: Part of the changes of the velocity along y up to which those along x do not matter for the acceleration's size.
ALIKE = 1e-6


# -- accelerations -------------------------------------------------------------------------------------------


@compiled
def update_acceleration_extremes(
    extremes: Any, k: int, room: Any, sideways: float, spot: tuple[float, float], span: Span
) -> None:
    """Let extremes k cover the size of the acceleration of a point of the platform.

    Means between samples give the approximate place of its maximum, the polynomials give the place and whether it
    exceeds the known maximum, and the equations give the value there: they are more accurate, and take longer.

    Parameters
    ----------
    extremes, k
        Record of :data:`vibroplat.observe.extremes.EXTREMES`, and the place of the quantity in it.
    room
        Record of :data:`vibroplat.observe.room.ROOM` with the values at the samples; its squares are overwritten.
    sideways
        1, or 0 if the acceleration along y alone counts.
    spot
        The point, from the centre of mass (m).
    span
        The part of the step as the records of extremes know it.
    """
    squares, n, nodes = room.squares, DIFFERENTIAL[span.system] // 2, span.nodes
    known = (1.0 + 2.0 * TIE) * extremes.square[k]
    mean_squares(room.samples, n, sideways, spot, span, squares)
    for i in range(nodes + 1):
        before = squares[i - 1] if i > 0 else -1.0
        here, after = squares[i], squares[min(i + 1, nodes)]
        largest = here >= before and here >= after
        if largest and here + max(here - before if before >= 0.0 else 0.0, here - after) > known:
            low, s, high = middle(i - 1, span), middle(i, span), middle(i + 1, span)
            s = span.first if before < 0.0 else vertex((low, s, high), (before, here, after))
            s, square = steepest(span.c, span.degree, n, spot, sideways, s, low, high)
            square /= span.length * span.length
            if square > known:
                extremes.square[k] = known = square
                remember(extremes, k, exact_size(s, sideways, spot, room, span), s, span)


@inlined
def middle(i: int, span: Span) -> float:
    """Fraction of a step in the middle between samples i and i + 1, but the part's ends for the first and the last."""
    if 0 < i < span.nodes:
        return 0.5 * (place_of(i, span) + place_of(i + 1, span))
    return span.first if i <= 0 else span.last


@inlined
def mean_squares(
    samples: FloatArray, n: int, sideways: float, spot: tuple[float, float], span: Span, squares: FloatArray
) -> None:
    """Fill the squares of the mean accelerations of a point between samples (m²/s⁴).

    A mean is the difference of the point's velocities at both samples over the time between them: it differs from the
    acceleration in the middle by a term of second order in that time. n is the column of the first rate, ``spot`` the
    point; ``sideways`` as of :func:`update_acceleration_extremes`.
    """
    inverse = 1.0 / (span.length * (span.last - span.first))
    x, y = samples[0, n] - spot[1] * samples[0, n + 2], samples[0, n + 1] + spot[0] * samples[0, n + 2]
    for i in range(span.nodes + 1):
        turning = samples[i + 1, n + 2]
        to_x, to_y = samples[i + 1, n] - spot[1] * turning, samples[i + 1, n + 1] + spot[0] * turning
        ax, ay, share = to_x - x, to_y - y, inverse * GAPS[span.nodes, i]
        squares[i] = share * share * (sideways * ax * ax + ay * ay)
        x, y = to_x, to_y


@fused_inline
def steepest(
    c: FloatArray, degree: int, n: int, spot: tuple[float, float], sideways: float, s: float, low: float, high: float
) -> tuple[float, float]:
    """Fraction of a step near s at which the square of a point's acceleration is largest, and that square (1/step⁴).

    Newton's iteration from s, as far as three terms of the Taylor series hold, and inside of the interval from ``low``
    to ``high``. Accelerations are the derivatives of the rates, whose columns begin at n, by the step's fraction, which
    saves a division. If there is no maximum nearby, the largest value on the way is returned.
    """
    square, best = -1.0, s
    for _ in range(4):
        x = x1 = x2 = x3 = y = y1 = y2 = y3 = 0.0  # rates, and their derivatives over their factorials
        for k in range(degree, -1, -1):
            x3, y3 = x3 * s + x2, y3 * s + y2
            x2, y2 = x2 * s + x1, y2 * s + y1
            x1, y1 = x1 * s + x, y1 * s + y
            x, y = x * s + (c[k, n] - spot[1] * c[k, n + 2]), y * s + (c[k, n + 1] + spot[0] * c[k, n + 2])
        size = sideways * x1 * x1 + y1 * y1
        if size > square:
            square, best = size, s
        rate = 2.0 * (sideways * x1 * x2 + y1 * y2)
        half = sideways * (4.0 * x2 * x2 + 6.0 * x1 * x3) + 4.0 * y2 * y2 + 6.0 * y1 * y3
        if not half < 0.0:
            break
        following = min(max(s - rate / half, low), high)
        way = following - s
        if abs(way) <= QUADRATIC_RANGE:
            return following, size + way * (2.0 * rate + half * way)
        s = following
    return best, square


@compiled
def exact_size(s: float, sideways: float, spot: tuple[float, float], room: Any, span: Span) -> float:
    """Size of the acceleration of a point of the platform at a fraction of a step, by the equations (m/s²)."""
    y, yp, n, equations = room.y, room.yp, DIFFERENTIAL[span.system] // 2, span.equations
    values(span.c, span.degree, s, y[: 2 * n])
    addresses = (y.ctypes.data, yp.ctypes.data, room.full.ctypes.data)
    call_int(equations.start, (span.system, span.begin + s * span.length, *addresses, equations.parameters, 1))
    ax, ay = yp[n] - spot[1] * yp[n + 2], yp[n + 1] + spot[0] * yp[n + 2]
    return float(np.sqrt(sideways * ax * ax + ay * ay))


# -- a step ------------------------------------------------------------------------------------------------


#: The largest quantity of the kind of each that has a column.
GROUPS = np.arange(COLUMNS)
GROUPS[[SIDEWAYS, ROTATION, *range(POINTS, COLUMNS)]] = HEIGHT
GROUPS[[PULL_X, MOMENT]] = PULL_Y


@compiled
def put_limits(extremes: Any, room: Any, p: Parameters) -> None:
    """Fill the limits beyond which a step has new extremes, and forget those of the previous supply.

    Quantities of one kind share a margin, that of the largest of them: if x and φ are round-off relative to y, their
    extremes are not worth a search. While the supply changes, torque and power do not follow from the speed alone, and
    each step is evaluated.
    """
    limits = room.limits
    for i in range(2):
        if extremes.since != p.since or p.speed_ramp[i] != 0.0 or p.slip_ramp[i] != 0.0:
            extremes.least[DRIVEN_1 + i], extremes.largest[DRIVEN_1 + i] = np.inf, -np.inf
    extremes.since, extremes.changed = p.since, 0
    for k in range(COLUMNS):
        beyond = margin(extremes, GROUPS[k])
        limits[0, k], limits[1, k] = extremes.least[k] - beyond, extremes.largest[k] + beyond
    for which, k in enumerate((ACCELERATION, LIFT)):
        room.square_limits[which] = (1.0 + 2.0 * TIE) * extremes.square[k]
    for i in range(room.named):
        room.levers[2 * i], room.levers[2 * i + 1] = -p.point_y[i], p.point_x[i]


@compiled
def put_beyond(room: Any, span: Span, p: Parameters) -> None:
    """Add to the forces into the foundation at all samples what they are beyond the slopes."""
    for i in range(span.nodes + 2):
        add_pulls_beyond(room.samples, i, span.system, room.quantities, PULL_X, p)


@inlined
def update_step_extremes(extremes: Any, room: Any, span: Span, p: Parameters) -> None:
    """Let the extremes cover a step or a part of it.

    Steps are screened, and most of them pass without a search. The limits are filled anew where there are none, after
    a step of another record, and while the supply changes.

    Parameters
    ----------
    extremes
        The record; ``room.limited`` is 0 if the step before was one of another.
    room, span
        As in :func:`vibroplat.observe.peaks.cover`.
    """
    ramps = p.speed_ramp[0] != 0.0 or p.speed_ramp[1] != 0.0 or p.slip_ramp[0] != 0.0 or p.slip_ramp[1] != 0.0
    if room.limited == 0 or ramps:
        put_limits(extremes, room, p)
        room.limited = 1
    above = below = 0
    for i in range(span.nodes + 2):
        put_quantities(room.samples, i, span.system, room)
    if room.beyond != 0:
        put_beyond(room, span, p)
    for first in range(0, COLUMNS if room.named > 0 else POINTS, EIGHT):
        over, under = beyond_limits(room.quantities, span.nodes, REACH[span.nodes], room.limits, first)
        above, below = above | over << first, below | under << first
    shaken = some(largest_squares(room.samples, span) > load_2(room.square_limits, 0, 0))
    if above | below != 0 or shaken or room.named > 0:
        update_columns(extremes, room, span, (above, below, shaken), p)


@compiled
def update_columns(extremes: Any, room: Any, span: Span, found: tuple[int, int, bool], p: Parameters) -> None:
    """Let the extremes cover a step where some may be new: the bits of those above and below limits, and accelerations.

    Accelerations of named points are evaluated in any case.
    """
    known, (above, below, shaken) = room.driven, found
    for i in range(2):
        known[0, i], known[1, i] = extremes.least[DRIVEN_1 + i], extremes.largest[DRIVEN_1 + i]
    if above | below != 0:
        cover(extremes, above, below, room, span, p)
    for i in range(2):
        if (above | below) >> (DRIVEN_1 + i) & 1:
            update_motor_extremes(extremes, i, (known[0, i], known[1, i]), room, span, p)
    if shaken:
        update_vibration(extremes, room, span)
    for i in range(room.named):
        spot = p.point_x[i], p.point_y[i]
        update_acceleration_extremes(extremes, POINT_ACCELERATIONS + i, room, 1.0, spot, span)
    if extremes.changed != 0:
        put_limits(extremes, room, p)


@compiled
def update_vibration(extremes: Any, room: Any, span: Span) -> None:
    """Let the extremes of the acceleration of the centre of mass cover a step.

    In antiphase the platform moves along y alone but for round-off. Its acceleration is then that along y, found once:
    two searches would differ in the last digits.
    """
    across, along, n = 0.0, 0.0, DIFFERENTIAL[span.system] // 2
    for i in range(1, span.nodes + 1):
        across = max(across, abs(room.samples[i, n] - room.samples[0, n]))
        along = max(along, abs(room.samples[i, n + 1] - room.samples[0, n + 1]))
    for which in range(2 if across > ALIKE * along else 1):  # along y, then both
        k = ACCELERATION if which else LIFT
        update_acceleration_extremes(extremes, k, room, float(which), (0.0, 0.0), span)
    if across <= ALIKE * along and extremes.square[LIFT] > extremes.square[ACCELERATION]:
        extremes.square[ACCELERATION] = extremes.square[LIFT]
        s = (extremes.at_largest[LIFT] - span.begin) / span.length
        remember(extremes, ACCELERATION, extremes.largest[LIFT], s, span)


@inlined
def add_forces(sums: FloatArray, means: FloatArray, springs: FloatArray, n: int, duration: float) -> None:
    """Add forces into the foundation, and then their squares, over a part of a step (s), from the unknowns' means.

    With stiffness k and damping d a force is kq + dq̇, and its square k²q² + 2kd qq̇ + d²q̇²; the means of all these are
    in the four rows of :func:`vibroplat.kernels.rows_of_16.means_16`. Behind them is what is not linear, see
    :func:`vibroplat.model.springs.curved_means`.
    """
    for i in range(3):
        k, d = springs[0, i], springs[1, i]
        sums[i] += duration * (k * means[0, i] + d * means[0, n + i] + means[4, CURVED_FORCE + i])
        square = k * k * means[1, i] + 2.0 * k * d * means[3, i] + d * d * means[1, n + i]
        sums[3 + i] += duration * (square + means[4, CURVED_SQUARE + i])
