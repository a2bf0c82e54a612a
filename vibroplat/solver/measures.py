"""What is summed over a run while it goes: energies for the audit, statistics of the measured part.

All integrals use three-point Gauss quadrature of the dense output, step by step, so nothing of the
trajectory need be stored.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from vibroplat.physics.compiled import compiled
from vibroplat.physics.energy import POWERS, powers
from vibroplat.physics.parameters import FloatArray
from vibroplat.physics.systems import GAP
from vibroplat.solver.interpolation import hermite, interpolate

N_POWERS = len(POWERS)

# Places in the sums of the measured part.
TIME, X, XX, Y, YY, PHI, PHI_PHI, COS, SIN, FLIGHT = range(10)
SUMS = 10

# Places in the marks: what must be remembered from step to step.
WINDOW, STARTED, FIRST_TIME, FIRST_1, FIRST_2, LAST_TIME, LAST_1, LAST_2 = range(8)
FORCE_MIN, FORCE_MAX, EXCHANGED, GAP_MAX = range(8, 12)
MARKS = 12

_GAUSS = np.array([0.5 - math.sqrt(0.15), 0.5, 0.5 + math.sqrt(0.15)])
_WEIGHTS = np.array([5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0])
_TURN = 2.0 * math.pi


@compiled
def crossing(step: float, a0: float, a1: float, rate_0: float, rate_1: float, level: float) -> float:
    """Fraction of a step at which an angle passes a level between its ends, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(54):
        middle = 0.5 * (low + high)
        if (hermite(middle, step, a0, a1, rate_0, rate_1) < level) == (a0 < level):
            low = middle
        else:
            high = middle
    return high


@compiled
def extremes(step: float, f0: float, f1: float, rate_0: float, rate_1: float) -> tuple[float, float]:
    """Least and largest value of the interpolant within a step."""
    least, largest = min(f0, f1), max(f0, f1)
    # roots of the slope, a quadratic in s
    a = 3.0 * (step * (rate_0 + rate_1) - 2.0 * (f1 - f0))
    b = 2.0 * (3.0 * (f1 - f0) - step * (2.0 * rate_0 + rate_1))
    c = step * rate_0
    root = b * b - 4.0 * a * c
    if root >= 0.0:
        q = -0.5 * (b + math.copysign(math.sqrt(root), b))
        for numerator, denominator in ((q, a), (c, q)):
            if denominator != 0.0:
                s = numerator / denominator
                if 0.0 < s < 1.0:
                    value = hermite(s, step, f0, f1, rate_0, rate_1)
                    least, largest = min(least, value), max(largest, value)
    return least, largest


@compiled
def integrate(
    start: float,
    end: float,
    step: float,
    y0: FloatArray,
    y1: FloatArray,
    yp0: FloatArray,
    yp1: FloatArray,
    places: npt.NDArray[np.int64],
    phase: float,
    p: FloatArray,
    work: FloatArray,
    sums: FloatArray,
) -> float:
    """Add the powers over the part [start, end] of a step to ``work`` and set ``sums`` to its statistics.

    ``start`` and ``end`` are fractions of the step, ``phase`` the whole turns taken off φ₁ + φ₂. Returns
    the energy that motors and dampers exchanged, all of it counted positive.
    """
    full, power = np.zeros(14), np.empty(N_POWERS)
    unknowns, slopes = np.empty(y0.size), np.empty(y0.size)
    exchanged = 0.0
    sums[:] = 0.0
    for i in range(3):
        share = start + (end - start) * _GAUSS[i]
        weight = (end - start) * step * _WEIGHTS[i]
        interpolate(share, step, y0, y1, yp0, yp1, unknowns, slopes)
        for j in range(places.size):
            full[places[j]] = unknowns[j]
        powers(full, power, p)
        work += weight * power
        exchanged += weight * (abs(power[0]) + power[3:].sum())
        difference = full[3] + full[4] + phase
        sums[TIME] += weight
        sums[X] += weight * full[0]
        sums[XX] += weight * full[0] * full[0]
        sums[Y] += weight * full[1]
        sums[YY] += weight * full[1] * full[1]
        sums[PHI] += weight * full[2]
        sums[PHI_PHI] += weight * full[2] * full[2]
        sums[COS] += weight * math.cos(difference)
        sums[SIN] += weight * math.sin(difference)
    return exchanged


@compiled
def turn_share(step: float, a0: float, a1: float, rate_0: float, rate_1: float, offset: float) -> float:
    """Fraction of a step at which exciter 1 completes a turn, or 1 if it does not."""
    before, after = math.floor((a0 + offset) / _TURN), math.floor((a1 + offset) / _TURN)
    if before == after:
        return 1.0
    return crossing(step, a0, a1, rate_0, rate_1, _TURN * max(before, after) - offset)


@compiled
def close_turn(
    now: float, angle_1: float, angle_2: float, open_turn: FloatArray, whole: FloatArray, marks: FloatArray
) -> None:
    """Exciter 1 has completed a turn in the measured part: what was open since the last one is whole."""
    if marks[STARTED] == 0.0:
        marks[STARTED] = 1.0
        marks[FIRST_TIME], marks[FIRST_1], marks[FIRST_2] = now, angle_1, angle_2
    else:
        whole += open_turn
    open_turn[:] = 0.0
    marks[LAST_TIME], marks[LAST_1], marks[LAST_2] = now, angle_1, angle_2


@compiled
def accumulate(
    t: FloatArray,
    y: FloatArray,
    yp: FloatArray,
    places: npt.NDArray[np.int64],
    start: float,
    turns: FloatArray,
    p: FloatArray,
    flying: float,
    work: FloatArray,
    plain: FloatArray,
    open_turn: FloatArray,
    whole: FloatArray,
    marks: FloatArray,
) -> None:
    """Add one stretch of steps to the sums.

    Parameters
    ----------
    t, y, yp
        Ends of the steps: times since the stretch's start, unknowns, derivatives.
    places, start, turns
        Places of the unknowns in the full state; start of the stretch (s); whole turns (rad) taken off
        both exciter angles before it.
    flying
        1 in flight, else 0.
    work
        Integrals of the powers, shape (N_POWERS,).
    plain, open_turn, whole
        Sums of the measured part: all of it, since the last whole turn of exciter 1, and over whole turns.
    marks
        What is remembered from step to step.
    """
    sums = np.empty(SUMS)
    force = places.size
    angles, slopes = np.empty(y.shape[1]), np.empty(y.shape[1])
    for k in range(t.size - 1):
        step = t[k + 1] - t[k]
        if step <= 0.0:
            continue
        if y.shape[1] > force:
            least, largest = extremes(step, y[k, force], y[k + 1, force], yp[k, force], yp[k + 1, force])
            marks[FORCE_MIN] = min(marks[FORCE_MIN], least)
            marks[FORCE_MAX] = max(marks[FORCE_MAX], largest)
        if flying > 0.0:
            _, highest = extremes(step, y[k, GAP], y[k + 1, GAP], yp[k, GAP], yp[k + 1, GAP])
            marks[GAP_MAX] = max(marks[GAP_MAX], highest)
        cut = turn_share(step, y[k, 3], y[k + 1, 3], yp[k, 3], yp[k + 1, 3], turns[0])
        for a, b in ((0.0, cut), (cut, 1.0)):
            if b <= a:
                continue
            ends = (y[k], y[k + 1], yp[k], yp[k + 1])
            marks[EXCHANGED] += integrate(a, b, step, *ends, places, turns[0] + turns[1], p, work, sums)
            sums[FLIGHT] = flying * sums[TIME]
            if start + t[k] + a * step >= marks[WINDOW]:
                plain += sums
                open_turn += sums
            now = start + t[k] + b * step
            if b < 1.0 and now >= marks[WINDOW]:
                interpolate(b, step, *ends, angles, slopes)
                close_turn(now, angles[3] + turns[0], angles[4] + turns[1], open_turn, whole, marks)
