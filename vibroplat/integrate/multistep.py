"""What a multistep method needs beside its steps: their polynomials, its first step, tolerances in low flights.

The library's own interpolant would take a call for each power of its polynomial. The cubic through values and rates at
both ends of a step is as accurate as those ends (``python -m pytest tests/integrate -k between``).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vibroplat.hybrid.loop import AT_GUARD, AT_TARGET
from vibroplat.hybrid.modes import COUNTS, FLIGHT, guard_form
from vibroplat.hybrid.starts import derivatives, prepare_consistent_start
from vibroplat.hybrid.state import CUBIC, CUT, DIFFERENTIATED, ROUND_OFF, Automaton, end_at, halvings
from vibroplat.kernels.compiled import FloatArray, compiled, copy, inlined
from vibroplat.kernels.polynomial import crossing, first_downcrossing, slope, values
from vibroplat.model.systems import ALONG_RATE, DIFFERENTIAL, GAP, SENSE, SIZES, SLIDES, UNKNOWNS

#: First step over the time until the gap closes again, by its Taylor polynomial.
FIRST_STEP_RATIO = 0.05

#: Largest relative change of the gap's acceleration in a flight that is known from its first terms.
MAX_ACCELERATION_CHANGE = 0.1


class PreviousStep(NamedTuple):
    """The last end of a step."""

    t: FloatArray  # time in the segment (s), shape (1,)
    y: FloatArray  # unknowns and derivatives, shape (UNKNOWNS,)
    yp: FloatArray


def empty_step() -> PreviousStep:
    """Make room for an end."""
    return PreviousStep(np.zeros(1), np.zeros(UNKNOWNS), np.zeros(UNKNOWNS))


@compiled
def begin_steps(past: PreviousStep, y: FloatArray, yp: FloatArray) -> None:
    """Begin a segment at time 0."""
    past.t[0] = 0.0
    copy(y, past.y)
    copy(yp, past.yp)


@inlined
def add_step(
    t: float,
    y: FloatArray,
    yp: FloatArray,
    row: int,
    starts: FloatArray,
    lengths: FloatArray,
    c: FloatArray,
    ends: FloatArray,
    past_t: FloatArray,
    past_y: FloatArray,
    past_yp: FloatArray,
) -> None:
    """Fill a row with the step that ends at a time of the segment with the unknowns and derivatives there.

    All have UNKNOWNS columns: arrays that are taken from their tuples once, and loops of a length that the compiler
    knows, halve the time.
    """
    start = past_t[0]
    length = t - start
    starts[row], lengths[row] = start, length
    for j in range(UNKNOWNS):  # the cubic of fill_cubic
        y0, rate_0, rate_1 = past_y[j], length * past_yp[j], length * yp[j]
        rise = y[j] - y0
        c[row, 0, j] = y0
        c[row, 1, j] = rate_0
        c[row, 2, j] = 3.0 * rise - 2.0 * rate_0 - rate_1
        c[row, 3, j] = rate_0 + rate_1 - 2.0 * rise
    for j in range(UNKNOWNS):
        ends[row, j] = y[j]
        past_y[j] = y[j]
        past_yp[j] = yp[j]
    past_t[0] = t


@compiled
def transcribe(
    h: Automaton,
    past: PreviousStep,
    t: FloatArray,
    y: FloatArray,
    yp: FloatArray,
    at_guard: bool,
    target: float,
) -> int:
    """Add steps by their ends, up to where a guard first falls through zero or exciter 1 has an angle.

    ``at_guard`` says whether the integrator has found a fall itself, at the last end. The angle (rad) is nan for none.
    Returns AT_GUARD for a fall that the integrator has not found, AT_TARGET for the angle, −1 if all ends were added.
    """
    steps, end, full, slopes = h.steps, np.empty(y.shape[1]), np.zeros(UNKNOWNS), np.zeros(UNKNOWNS)
    for k in range(t.size):
        copy(y[k], full)
        copy(yp[k], slopes)
        row = steps.used.steps
        add_step(t[k], full, slopes, row, steps.start, steps.length, steps.c, steps.ends, past.t, past.y, past.yp)
        steps.used.steps = row + 1
        root_found = at_guard and k == t.size - 1
        stop, share = stop_within(h, root_found, target, y[k])
        if stop == AT_TARGET or (stop == AT_GUARD and not root_found):
            values(steps.c[row], CUBIC, share, end)
            if stop == AT_TARGET:
                end[3] = target
            end_at(steps, row, share, end)
            return stop
    return -1


@compiled
def stop_within(h: Automaton, root_found: bool, target: float, y: FloatArray) -> tuple[int, float]:
    """Why a segment ends within its last step, AT_GUARD or AT_TARGET, and at which fraction; −1 if it does not.

    ``root_found`` says whether the integrator has found a guard's fall itself, at the end of the step with unknowns y;
    ``run.fallen`` says which guard it is. Steps are short against the guards' changes, and rates of F_c carry the
    errors of a stiff layer: a step is looked into where a guard ends below zero, or falls at its beginning and rises at
    its end.

    A rate of slip begins with 0, and may be below it by an error: with transport a guard can fall only after it has
    risen, be that in the segment's first step.
    """
    run, steps, row = h.run, h.steps, h.steps.used.steps - 1
    c, system, begins = steps.c[row], run.systems[run.mode], steps.start[row] == 0.0
    form, fall, least, slides = np.empty((CUBIC + 1, 1)), np.inf, np.inf, SLIDES[system]
    passed = crossing(c, CUBIC, 3, target, y[3]) if y[3] >= target else np.inf
    for which in range(COUNTS[system]):
        first, weight, second, other = guard_form(system, which, h.p)
        for k in range(CUBIC + 1):
            form[k, 0] = weight * c[k, first] + other * c[k, second]
        end = weight * y[first] + other * y[second]
        if root_found:
            size = abs(end) / (abs(form[0, 0]) + abs(form[1, 0]) + abs(form[2, 0]))
            if not size >= least:
                least, fall, run.fallen = size, 1.0, which
        elif end < 0.0 or form[1, 0] < 0.0 < slope(form, CUBIC, 0, 1.0):
            if slides and not (form[0, 0] > 0.0 or begins):
                continue
            zeros = run.zeros if which == 0 else run.other_zeros
            share = first_downcrossing(form, CUBIC, 0, zeros if slides and begins else 0)
            if 0.0 <= share < fall and not (slides and share == 0.0):
                fall, run.fallen = share, which
    if passed < fall:
        return AT_TARGET, passed
    return (AT_GUARD, fall) if fall <= 1.0 else (-1, 1.0)


@compiled
def limit_force_slopes(h: Automaton, cut: bool) -> None:
    """Limit the slopes of F_c in the open segment so that its interpolant does not overshoot (Schmidt and Hess 1988).

    F_c is not integrated: a stiff layer or motor turns errors of rates, which the tolerance allows, into larger
    ones of F_c and much larger ones of its slope. A slope that belongs to the values is at most about the
    larger of the secants beside it. What is 0 or more at both ends of a step stays so within it where slopes
    are at least −3 F_c/h at its beginning and at most 3 F_c/h at its end (Schmidt and Hess 1988).

    Where a piece is only ``cut``, or goes on from one that was, the secant on the other side is not known.
    """
    steps = h.steps
    system = h.run.systems[h.run.mode]
    force = DIFFERENTIAL[system]
    first, end = steps.used.first, steps.used.steps
    for row in range(first, end):
        c, length = steps.c[row], steps.length[row]
        if length <= 0.0:
            continue
        f0, f1 = c[0, force], steps.ends[row, force]
        rate_0, rate_1 = c[1, force], slope(c, CUBIC, force, 1.0)  # over the fraction of the step, as all rates here
        here = f1 - f0
        limit_0 = limit_1 = 3.0 * abs(here)
        min_0, max_0 = -3.0 * max(f0, 0.0), np.inf
        min_1, max_1 = -np.inf, 3.0 * max(f1, 0.0)
        if row > first and steps.length[row - 1] > 0.0:
            ratio = length / steps.length[row - 1]
            limit_0 = max(limit_0, 3.0 * ratio * abs(f0 - steps.c[row - 1, 0, force]))
            max_0 = 3.0 * ratio * max(f0, 0.0)
        elif h.run.joined == CUT:
            limit_0 = np.inf
        if row + 1 < end and steps.length[row + 1] > 0.0:
            ratio = length / steps.length[row + 1]
            limit_1 = max(limit_1, 3.0 * ratio * abs(steps.ends[row + 1, force] - f1))
            min_1 = -3.0 * ratio * max(f1, 0.0)
        elif cut:
            limit_1 = np.inf
        limited_0 = max(min(rate_0, max_0, limit_0), -limit_0, min_0)
        limited_1 = min(max(rate_1, min_1, -limit_1), limit_1, max_1)
        if limited_0 != rate_0 or limited_1 != rate_1:
            c[1, force] = limited_0
            c[2, force] = 3.0 * here - 2.0 * limited_0 - limited_1
            c[3, force] = limited_0 + limited_1 - 2.0 * here


@compiled
def prepare_first_step(h: Automaton) -> float:
    """Choose the first step of a segment (s), and tighten its tolerances where a flight is low.

    The step follows from the curvature, and ends well before the gap can have closed again. Returns −1 where there
    are no second derivatives.
    """
    run = h.run
    mode = run.mode
    if not prepare_consistent_start(h, mode, DIFFERENTIATED):
        return -1.0
    size = SIZES[run.systems[mode]]
    step = min(0.1 * run.period, curvature_step(run.ypp[mode, :size], run.atol[:size]))
    if mode == FLIGHT:
        duration, height, sure = expected_flight(h, 1e-3 * step)
        step = min(step, FIRST_STEP_RATIO * duration)
        tighter = 2.0 ** -halvings(run.tolerance, height, run.gap_scale, sure)
        run.atol[GAP] *= tighter * tighter
        run.atol[size // 2 + GAP] *= tighter
    elif SENSE[run.systems[mode]] != 0.0 and run.state[ALONG_RATE] == 0.0:
        step = min(step, FIRST_STEP_RATIO * expected_slip(h, 1e-3 * step))
    step = min(step, curvature_step(run.ypp[mode, :size], run.atol[:size]))
    return max(step, ROUND_OFF * run.period)


@inlined
def expected_flight(h: Automaton, small: float) -> tuple[float, float, bool]:
    """Duration (s) and height (m) of the flight that begins, inf where its first terms do not end it.

    The third value says whether that is sure: a rebound under an acceleration that hardly changes. ``small`` is
    a time (s) over which derivatives change little, also those of a stiff layer.
    """
    run = h.run
    rates = SIZES[run.systems[FLIGHT]] // 2
    gap, rate = run.y[FLIGHT, GAP], run.y[FLIGHT, rates + GAP]
    acceleration, jerk = run.yp[FLIGHT, rates + GAP], run.ypp[FLIGHT, rates + GAP]
    if gap > 0.0:  # begun in the air, not at a contact
        if acceleration >= 0.0:
            return np.inf, np.inf, False
        return math.sqrt(2.0 * gap / -acceleration), gap + 0.5 * rate * rate / -acceleration, False
    fourth = snap(h, FLIGHT, rates + GAP, small) if rate == 0.0 else 0.0  # a rebound does not need it
    duration, height = estimate_flight(rate, acceleration, jerk, fourth)
    return duration, height, rate > 0.0 and abs(jerk) * duration <= MAX_ACCELERATION_CHANGE * -acceleration


@inlined
def expected_slip(h: Automaton, small: float) -> float:
    """Duration (s) of the slip that begins from rest, about, by the first terms of s; inf where they do not end it."""
    run = h.run
    system = run.systems[run.mode]
    place, sense = DIFFERENTIAL[system] - 1, SENSE[system]
    acceleration, jerk = sense * run.yp[run.mode, place], sense * run.ypp[run.mode, place]
    return estimate_flight(0.0, acceleration, jerk, sense * snap(h, run.mode, place, small))[0]


@inlined
def snap(h: Automaton, mode: int, place: int, small: float) -> float:
    """Fourth derivative of a coordinate whose rate has a place, as the difference of jerks a small step along."""
    run = h.run
    system = run.systems[mode]
    size = SIZES[system]
    ahead, yp, ypp = np.empty(size), np.empty(size), np.empty(size)
    for i in range(size):
        ahead[i] = run.y[mode, i] + small * run.yp[mode, i] + 0.5 * small * small * run.ypp[mode, i]
    derivatives(h, system, ahead, yp, ypp, DIFFERENTIATED)
    return (ypp[place] - run.ypp[mode, place]) / small


@compiled
def curvature_step(ypp: FloatArray, atol: FloatArray) -> float:
    """First step 2/√‖y″‖ of an order-1 start, ‖·‖ the root mean square weighted by 1/atol (inf if y″ = 0)."""
    total = 0.0
    for i in range(ypp.size):
        total += (ypp[i] / atol[i]) ** 2
    return 2.0 / math.sqrt(math.sqrt(total / ypp.size)) if total > 0.0 else np.inf


@compiled
def estimate_flight(rate: float, acceleration: float, jerk: float, snap: float) -> tuple[float, float]:
    """Duration and height of a flight that begins now, by the gap's leading Taylor terms.

    After a rebound gap ≈ vt + at²/2; where a > 0 drives the layer off but falls, gap ≈ vt + at²/2 + jt³/6;
    at release v = a = 0 and gap ≈ jt³/6 + st⁴/24. Both are inf where these terms do not bring the gap back.
    """
    if rate > 0.0 and acceleration < 0.0:
        return 2.0 * rate / -acceleration, 0.5 * rate * rate / -acceleration
    if rate >= 0.0 and acceleration > 0.0 and jerk < 0.0:
        duration = (1.5 * acceleration + math.sqrt(2.25 * acceleration * acceleration - 6.0 * rate * jerk)) / -jerk
        top = 2.0 / 3.0 * duration
        return duration, top * (rate + top * (0.5 * acceleration + top * jerk / 6.0))
    if rate == 0.0 and jerk > 0.0 and snap < 0.0:
        ratio = jerk / -snap
        return 4.0 * ratio, 1.125 * jerk * ratio * ratio * ratio
    return np.inf, np.inf
