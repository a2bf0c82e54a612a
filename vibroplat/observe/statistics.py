"""What is summed over a run while it goes: energies for the audit, statistics of the measured part.

All integrals use Gauss quadrature of the dense output, step by step, so nothing of the trajectory need
be stored. The measured part is cut to whole turns of exciter 1 where there is one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vibroplat.integrate.interpolation import hermite, turning_points
from vibroplat.integrate.tape import FIRST, ROWS, Tape
from vibroplat.kernels.compiled import compiled, copy, inlined
from vibroplat.model.energy import FORCE_SIZE, POWERS, powers
from vibroplat.model.parameters import FloatArray, Parameters
from vibroplat.model.systems import DIFFERENTIAL, FULL_SIZE, GAP, PLACES, SIZES

N_POWERS = len(POWERS)
N_WORK = FORCE_SIZE + 1
DISSIPATIONS = 2  # first of the powers that take energy

# Places in the sums of the measured part.
TIME, X, XX, Y, YY, PHI, PHI_PHI, COS, SIN, FLYING, MOTOR = range(11)
SUMS = 11
# Places in the marks: what must be remembered from step to step.
WINDOW, TURNS, FIRST_TIME, FIRST_1, FIRST_2, LAST_TIME, LAST_1, LAST_2 = range(8)
FORCE_MIN, FORCE_MAX, GAP_MIN, GAP_MAX, Y_MIN, Y_MAX, EXCHANGED, WAY, FIRST_IMPACTS, LAST_IMPACTS = range(8, 18)
MARKS = 18

# Places in the totals of events; the first three are counts by kind.
LIFTOFFS, IMPACTS, LATCHES, IMPACT_LOSS, IMPULSE_SUM, IMPULSE_MAX, MEASURED_IMPACTS = range(7)
TOTALS = 7

#: Points of the Poincaré section that are kept, the last ones.
SECTION_ROWS = 1024
# Columns of the section: time, full state, contact force.
SECTION_TIME, SECTION_STATE, SECTION_FORCE = 0, 1, 1 + FULL_SIZE

_GAUSS = np.array([0.5 - math.sqrt(1.0 / 12.0), 0.5 + math.sqrt(1.0 / 12.0)])
_TURN = 2.0 * math.pi


class Measures(NamedTuple):
    """Sums over a run.

    Attributes
    ----------
    work
        Integrals of the powers (J) and of the vertical force from outside and its size (N·s), shape (N_WORK,).
    plain, open_turn, whole
        Sums of the measured part: before the first whole turn of exciter 1, since the last one, over whole turns.
    marks, totals
        Extremes and what is remembered from step to step; counts and sums of events.
    section
        Poincaré section: motion at the whole turns of exciter 1 in the measured part, the last
        SECTION_ROWS of them, turn n in row n modulo that.
    """

    work: FloatArray
    plain: FloatArray
    open_turn: FloatArray
    whole: FloatArray
    marks: FloatArray
    totals: FloatArray
    section: FloatArray


def no_measures(window: float) -> Measures:
    """Make empty sums whose measured part begins at a time (s)."""
    marks = np.zeros(MARKS)
    marks[WINDOW] = window
    for least, largest in ((FORCE_MIN, FORCE_MAX), (Y_MIN, Y_MAX)):
        marks[least], marks[largest] = math.inf, -math.inf
    section = np.zeros((SECTION_ROWS, SECTION_FORCE + 1))
    plain, open_turn, whole = np.zeros((3, SUMS))
    return Measures(np.zeros(N_WORK), plain, open_turn, whole, marks, np.zeros(TOTALS), section)


def copied(ms: Measures) -> Measures:
    """Copy what changes from turn to turn of the sums over whole turns."""
    return ms._replace(whole=ms.whole.copy(), marks=ms.marks.copy())


def between(earlier: Measures, later: Measures) -> Measures:
    """Subtract two copies: sums over the whole turns of exciter 1 between them; extremes are of all before."""
    marks = later.marks.copy()
    marks[TURNS] += 1.0 - earlier.marks[TURNS]  # the last turn before is the first mark
    for first, last in ((FIRST_TIME, LAST_TIME), (FIRST_1, LAST_1), (FIRST_2, LAST_2), (FIRST_IMPACTS, LAST_IMPACTS)):
        marks[first] = earlier.marks[last]
    nothing = np.zeros(SUMS)
    return later._replace(plain=nothing, open_turn=nothing, whole=later.whole - earlier.whole, marks=marks)


def section_rows(ms: Measures) -> FloatArray:
    """Time, full state and contact force at whole turns of exciter 1, in the order of time."""
    turns = int(ms.marks[TURNS])
    return ms.section[np.arange(max(turns - SECTION_ROWS, 0), turns) % SECTION_ROWS]


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
    for s in turning_points(step, f0, f1, rate_0, rate_1):
        value = hermite(s, step, f0, f1, rate_0, rate_1)
        least, largest = min(least, value), max(largest, value)
    return least, largest


@inlined
def spread_between(
    s: float,
    step: float,
    y: FloatArray,
    yp: FloatArray,
    k: int,
    system: int,
    full: FloatArray,
) -> None:
    """Fill a full state at fraction s of the step that begins in row k of a tape."""
    r = 1.0 - s
    w0, w1 = r * r * (1.0 + 2.0 * s), s * s * (1.0 + 2.0 * r)
    v0, v1 = r * r * s * step, -s * s * r * step
    for j in range(DIFFERENTIAL[system]):
        full[PLACES[system, j]] = w0 * y[k, j] + w1 * y[k + 1, j] + v0 * yp[k, j] + v1 * yp[k + 1, j]


@inlined
def integrate(
    start: float,
    end: float,
    step: float,
    y: FloatArray,
    yp: FloatArray,
    k: int,
    system: int,
    measured: bool,
    flying: bool,
    full: FloatArray,
    power: FloatArray,
    p: Parameters,
    work: FloatArray,
    sums: FloatArray,
) -> float:
    """Add the work over the part [start, end] of a step and, if measured, its statistics to ``sums``.

    ``start`` and ``end`` are fractions of the step that begins in row k; ``full`` and ``power`` are
    overwritten. Returns the energy that motors and dampers exchanged, all of it counted positive.
    """
    total = 0.0
    duration = (end - start) * step
    weight = 0.5 * duration
    for i in range(_GAUSS.size):
        spread_between(start + (end - start) * _GAUSS[i], step, y, yp, k, system, full)
        powers(0.0, full, power, p)
        exchanged = abs(power[0])
        for j in range(N_WORK):
            work[j] += weight * power[j]
        for j in range(DISSIPATIONS, N_POWERS):
            exchanged += power[j]
        total += weight * exchanged
        if measured:
            for j in range(3):
                sums[X + 2 * j] += weight * full[j]
                sums[XX + 2 * j] += weight * full[j] * full[j]
            sums[MOTOR] += weight * power[0]
    if measured:
        sums[TIME] += duration
        sums[FLYING] += duration if flying else 0.0
        # where exciters run in step the phase varies slowly: the middle says it
        middle, phase = 0.5 * (start + end), 0.0
        for j in range(3, 5):
            phase += hermite(middle, step, y[k, j], y[k + 1, j], yp[k, j], yp[k + 1, j])
        sums[COS] += duration * math.cos(phase)
        sums[SIN] += duration * math.sin(phase)
    return total


@compiled
def turn_share(step: float, a0: float, a1: float, rate_0: float, rate_1: float, offset: float) -> float:
    """Fraction of a step at which exciter 1 completes a turn, or 1 if it does not."""
    before, after = math.floor((a0 + offset) / _TURN), math.floor((a1 + offset) / _TURN)
    if before == after:
        return 1.0
    return crossing(step, a0, a1, rate_0, rate_1, _TURN * max(before, after) - offset)


@compiled
def goes_on(marks: FloatArray, rate: float) -> bool:
    """Whether exciter 1 passes angle 0 the same way as the last time: one that swings completes no turn."""
    way = math.copysign(1.0, rate)
    same = bool(marks[WAY] != -way)
    marks[WAY] = way
    return same


@inlined
def add(terms: FloatArray, sums: FloatArray) -> None:
    """Add terms to sums."""
    for j in range(sums.size):
        sums[j] += terms[j]


@compiled
def close_turn(
    now: float,
    turns: FloatArray,
    full: FloatArray,
    force: float,
    plain: FloatArray,
    open_turn: FloatArray,
    whole: FloatArray,
    marks: FloatArray,
    section: FloatArray,
    impacts: float,
) -> None:
    """Exciter 1 has completed a turn in the measured part: what was open since the last one is whole."""
    row = section[int(marks[TURNS]) % SECTION_ROWS]
    row[SECTION_TIME], row[SECTION_FORCE] = now, force
    copy(full, row[SECTION_STATE:])
    row[SECTION_STATE + 3] += turns[0]
    row[SECTION_STATE + 4] += turns[1]
    add(open_turn, plain if marks[TURNS] == 0.0 else whole)
    if marks[TURNS] == 0.0:
        marks[FIRST_TIME], marks[FIRST_1], marks[FIRST_2] = now, full[3] + turns[0], full[4] + turns[1]
        marks[FIRST_IMPACTS] = impacts
    for j in range(SUMS):
        open_turn[j] = 0.0
    marks[TURNS] += 1.0
    marks[LAST_TIME], marks[LAST_1], marks[LAST_2] = now, full[3] + turns[0], full[4] + turns[1]
    marks[LAST_IMPACTS] = impacts


@inlined
def widen(marks: FloatArray, low: int, step: float, y: FloatArray, yp: FloatArray, k: int, j: int) -> None:
    """Let an extreme's two marks, from ``low`` on, cover unknown j within the step that begins in row k."""
    f0, f1, rate_0, rate_1 = y[k, j], y[k + 1, j], yp[k, j], yp[k + 1, j]
    # the slopes' share in the interpolant is at most 4/27 of theirs: most steps cannot hold an extreme
    reach = 4.0 / 27.0 * step * (abs(rate_0) + abs(rate_1))
    if marks[low] < min(f0, f1) - reach and max(f0, f1) + reach < marks[low + 1]:
        return
    least, largest = extremes(step, f0, f1, rate_0, rate_1)
    marks[low] = min(marks[low], least)
    marks[low + 1] = max(marks[low + 1], largest)


@compiled
def accumulate(
    ms: Measures, tape: Tape, system: int, flying: bool, origin: float, turns: FloatArray, p: Parameters
) -> None:
    """Add the open piece of the tape to the sums.

    Parameters
    ----------
    ms, tape
        Sums, changed; tape, read.
    system, flying
        Number of the piece's system, and whether it is in flight.
    origin, turns
        Origin of the tape's times (s) and whole turns (rad) taken off both exciter angles.
    """
    t, y, yp, marks, work, open_turn = tape.t, tape.y, tape.yp, ms.marks, ms.work, ms.open_turn
    full, power = np.zeros(FULL_SIZE), np.empty(N_WORK)
    force = DIFFERENTIAL[system]
    for k in range(tape.used[FIRST], tape.used[ROWS] - 1):
        step = t[k + 1] - t[k]
        if step <= 0.0:
            continue
        if SIZES[system] > force:
            widen(marks, FORCE_MIN, step, y, yp, k, force)
        if flying:
            widen(marks, GAP_MIN, step, y, yp, k, GAP)
        cut = turn_share(step, y[k, 3], y[k + 1, 3], yp[k, 3], yp[k + 1, 3], turns[0])
        for part in range(2):
            a, b = (0.0, cut) if part == 0 else (cut, 1.0)
            if b <= a:
                continue
            measured = origin + t[k] + a * step >= marks[WINDOW]
            marks[EXCHANGED] += integrate(
                a, b, step, y, yp, k, system, measured, flying, full, power, p, work, open_turn
            )
            if measured:
                widen(marks, Y_MIN, step, y, yp, k, 1)
            now = origin + t[k] + b * step
            if b < 1.0 and goes_on(marks, yp[k, 3]) and now >= marks[WINDOW]:
                spread_between(b, step, y, yp, k, system, full)
                pressure = 0.0
                if SIZES[system] > force:
                    pressure = hermite(b, step, y[k, force], y[k + 1, force], yp[k, force], yp[k + 1, force])
                impacts = ms.totals[MEASURED_IMPACTS]
                close_turn(now, turns, full, pressure, ms.plain, open_turn, ms.whole, marks, ms.section, impacts)


@compiled
def count_event(ms: Measures, kind: int, now: float, impulse: float, loss: float) -> None:
    """Add an event to the totals; ``kind`` is its place among them."""
    ms.totals[kind] += 1.0
    ms.totals[IMPACT_LOSS] += loss
    ms.totals[IMPULSE_SUM] += impulse
    ms.totals[IMPULSE_MAX] = max(ms.totals[IMPULSE_MAX], impulse)
    if kind == IMPACTS and now >= ms.marks[WINDOW]:
        ms.totals[MEASURED_IMPACTS] += 1.0
