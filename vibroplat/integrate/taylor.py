"""Engine ``taylor``: the Taylor series of the index-reduced DAE itself, in compiled code.

A one-step method of high order: it has its full order at once after an impact, its steps are polynomials without
further work, and it takes four to six of them a turn where IDA, of order 5, takes hundreds. It is explicit: a layer or
motor that is stiff against the excitation makes its steps short even where it does not move, which the run then says.

A step is the series at its beginning, as far as its last coefficients allow (:func:`longest_step`); it ends earlier
where the guard falls, where an exciter comes to rest or reaches the angle that the run waits for. Each finished step is
checked: its polynomial's accelerations at the end against those of the equations there, which the next series begins
with. One that fails is halved.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from vibroplat.config.scene import Scene
from vibroplat.hybrid import loop
from vibroplat.hybrid.loop import AT_GUARD, AT_TARGET, AT_TIME, FAILED, NOT_FINITE
from vibroplat.hybrid.modes import GUARDS
from vibroplat.hybrid.resets import cut_piece
from vibroplat.hybrid.state import MARGIN, RUNNING, WIDTH, Automaton, rewind
from vibroplat.integrate.interface import WORK
from vibroplat.kernels.compiled import Callee, FloatArray, address_of, borrow, compiled, inlined, same_types
from vibroplat.kernels.lanes import horner_8, in_lines, put_step, sizes_16
from vibroplat.kernels.polynomial import MAX_DEGREE, crossing, first_downcrossing
from vibroplat.model.equations import finite
from vibroplat.model.parameters import Parameters
from vibroplat.model.platform import is_definite
from vibroplat.model.series import FORCE, expand, room
from vibroplat.model.systems import ALGEBRAIC, DIFFERENTIAL, FULL_SIZE

#: Degree of the series at tolerance 1e-6, and degrees more for each power of ten below it. At equal errors degrees from
#: 14 to 22 take equal times within a tenth at this tolerance, and higher ones at tighter tolerances.
DEGREE, DEGREES_PER_DECADE = 17, 1.5
MIN_DEGREE = 10

#: Steps within a period after which the integrator is taken to be stuck, and those for each event that a scene allows
#: within a period, where that is more.
MAX_STEPS, STEPS_PER_EVENT = 300_000, 60


def degree_of(tolerance: float) -> int:
    """Choose the degree of the series for a tolerance."""
    return min(max(round(DEGREE - DEGREES_PER_DECADE * (math.log10(tolerance) + 6.0)), MIN_DEGREE), MAX_DEGREE)


class TaylorEngine:
    """Taylor series of high order, driven in compiled code."""

    name = "taylor"
    #: Few enough to stay in the processor's cache (0.4 MB at tolerance 1e-6) until they are read; 512 take 8 % longer.
    rows = 192
    #: A restart costs nothing, and angles lose digits as they grow.
    turns_per_segment: float = 10

    def __init__(self, scene: Scene, p: Parameters) -> None:
        self.degree = degree_of(scene.solver.tolerance)
        self._p = p  # not a copy: a drive's program changes it in place
        self._run_loop = same_types(run_loop)
        self._e = empty_records()
        self._e.status["degree"] = self.degree
        self._e.status["max_steps"] = max(MAX_STEPS, STEPS_PER_EVENT * scene.solver.max_events_per_period)

    @property
    def work(self) -> dict[str, int | None]:
        """How much was done so far."""
        status = self._e.status
        return dict.fromkeys(WORK) | {"steps": int(status["steps"]), "error_test_failures": int(status["rejected"])}

    @property
    def detail(self) -> str:
        """Why the integrator failed."""
        status = self._e.status
        if status["counted"] > status["max_steps"]:
            return f"taylor: more than {int(status['max_steps'])} steps within a period"
        return "taylor: no step is short enough" if status["short"] else "the series is not finite"

    def advance(self, h: Automaton) -> None:
        """Go on with a run; see :class:`vibroplat.integrate.interface.Engine`."""
        self._run_loop(h, self._e)

    def compiled_loop(self, h: Automaton) -> Callee:
        """Return what :meth:`advance` calls."""
        return Callee(address_of(run_loop, h, self._e), (self._e,))

    def close(self) -> None:
        """Do nothing: Python frees what the engine holds."""


#: Coefficients at the end of a series that choose its step. Kloss' torque has complex poles, which let pairs of them
#: vanish by turns: of the last two, an error of 1e-6 becomes 2e-5.
ERROR_COEFFICIENTS = 4

#: Largest difference of accelerations at the end of a step, times its length over its degree, in tolerances of rates.
MAX_DEFECT = 5.0

#: Round-off of an acceleration over the sum of its polynomial's terms.
_NOISE = 1e3 * float(np.finfo(float).eps)
#: Truncation of a guard that is round-off beside the sum of its polynomial's terms.
_NO_TRUNCATION = 4.0 * float(np.finfo(float).eps)

#: Shortest step, as a part of a period.
MIN_STEP = 1e-13

#: Why a segment ends, besides the reasons of the loop: it does not; there is no room for more steps.
_ON, _FULL = -1, 9

#: What the engine remembers.
STATUS = np.dtype(
    [
        ("at_end", float, (3, 8)),  # coordinates, rates and accelerations at the end of a step by its polynomial
        ("sizes", float, WIDTH),  # sums of the sizes of a step's coefficients but the first
        ("y", float, FULL_SIZE),  # unknowns at the beginning of a step, and at its end
        ("ahead", float, FULL_SIZE),
        ("weights", float, 8),  # one over the tolerances of rates, then 0, and in column FORCE of F_c
        ("guard", float, (MAX_DEGREE + 1, 1)),  # a guard's polynomial, and one that bounds it
        ("bound", float, (MAX_DEGREE + 1, 1)),
        ("done", float),  # time of the segment (s)
        ("counted_from", float),  # when the counted steps began (s)
        ("open", int),  # whether a segment is
        ("degree", int),  # of the series
        ("steps", int),
        ("rejected", int),
        ("counted", int),  # steps in this period, and most of them
        ("max_steps", int),
        ("short", int),  # whether steps have become too short
        ("resting", int),  # exciter that comes to rest at the end of a step, or −1
    ],
    align=True,
)


class Expansion(NamedTuple):
    """What compiled code needs of the engine: a series' :data:`vibroplat.model.series.ROOM`, and a :data:`STATUS`."""

    room: Any
    status: Any


def empty_records() -> Expansion:
    """Make what compiled code needs of the engine, empty."""
    return Expansion(room(), in_lines((STATUS.itemsize // 8,)).view(STATUS)[0])


@compiled
def run_loop(owned_h: Automaton, owned_e: Expansion) -> None:
    """Go through segments and resets until there is no room for more steps or the run has ended."""
    h, e = borrow(owned_h), borrow(owned_e)
    rewind(h.steps)
    while h.run.outcome == RUNNING:
        if e.status.open == 0:
            full = h.steps.used.steps + 1 + MARGIN > h.steps.start.size or h.run.events + 2 > h.events.size
            if full or not loop.begin_segment(h):
                return
            start(h, e)
        stop = _ON
        while stop == _ON:
            stop = _FULL if h.steps.used.steps + MARGIN >= h.steps.start.size else step(h, e)
        if stop == _FULL:
            cut_piece(h)
            return
        e.status.open = 0
        loop.end_segment(h, stop)


@compiled
def start(h: Automaton, e: Expansion) -> None:
    """Begin a segment: its unknowns, the tolerances of its rates, its series."""
    run, status = h.run, e.status
    system = run.systems[run.mode]
    n = DIFFERENTIAL[system] // 2
    for i in range(2 * n):
        status.y[i] = run.y[run.mode, i]
    for i in range(FORCE):
        status.weights[i] = 1.0 / run.atol[n + i] if i < n else 0.0
    status.weights[FORCE] = 1.0 / run.atol[2 * n] if ALGEBRAIC[system] else 0.0
    status.open, status.done = 1, 0.0
    if run.origin <= status.counted_from:  # the motion has begun, or begun again
        status.counted, status.counted_from = 0, run.origin
    expand(system, run.origin, status.y, status.degree, e.room, h.p)


@inlined
def step(h: Automaton, e: Expansion) -> int:
    """Take a step by the series at its beginning, and move to its end; why the segment ends with it, or _ON."""
    run, steps, status = h.run, h.steps, e.status
    system, row, degree = run.systems[run.mode], steps.used.steps, status.degree
    c = steps.c[row]
    length = longest_step(e.room.q, degree, status.weights)
    while True:
        if not length >= MIN_STEP * run.period:
            status.short = 1 if length > 0.0 else 0
            return FAILED if length > 0.0 else NOT_FINITE
        stop, length = end_of_step(h, e, c, min(length, run.until - status.done))
        status.steps += 1
        horner_8(e.room.q, degree, length, status.at_end)
        if accept_step(h, e, system, stop, length):
            break
        status.rejected += 1
        expand(system, run.origin + status.done, status.y, degree, e.room, h.p)
        length *= 0.5
    n = DIFFERENTIAL[system] // 2
    steps.start[row], steps.length[row] = status.done, length
    for i in range(2 * n):
        steps.ends[row, i] = status.y[i] = status.ahead[i]
    if ALGEBRAIC[system]:
        steps.ends[row, 2 * n] = status.at_end[0, FORCE]
    if stop == AT_TARGET:
        steps.ends[row, 3] = run.target - run.turns[0]
    steps.used.steps = row + 1
    status.done += length
    run.zeros = 0  # they were of the segment's start
    if stop != _ON:
        return stop
    status.counted += 1
    now = run.origin + status.done
    if now - status.counted_from >= run.period:
        status.counted, status.counted_from = 0, now
    return FAILED if status.counted > status.max_steps else _ON


@inlined
def longest_step(q: FloatArray, degree: int, weights: FloatArray) -> float:
    """Longest step with which none of the last coefficients of rates, and of F_c, is above its tolerance (s)."""
    least = -np.inf
    for m in range(ERROR_COEFFICIENTS + 1):
        k = degree - m  # rates have k times the coefficient of their coordinate, and the exponent of F_c before it
        largest = 0.0
        if m < ERROR_COEFFICIENTS:
            for i in range(FORCE):
                largest = max(largest, abs(q[k, i]) * weights[i])
            largest *= k
        if m > 0:
            largest = max(largest, abs(q[k - 1, FORCE]) * weights[FORCE])
        if largest > 0.0:
            least = max(least, math.log(largest) / (k - 1))
    return math.exp(-least)


@inlined
def end_of_step(h: Automaton, e: Expansion, c: FloatArray, length: float) -> tuple[int, float]:
    """Write the series as a step's polynomials, and find where the step ends: why the segment does, and its length."""
    run, status, degree = h.run, e.status, e.status.degree
    system = run.systems[run.mode]
    n, guard = DIFFERENTIAL[system] // 2, GUARDS[system]
    stop, share = AT_TIME if length >= run.until - status.done else _ON, 1.0
    while True:
        put_step(e.room.q, degree, length, n, c)
        sizes_16(c, 1, degree, status.sizes)
        fall, sure = guard_fall(c, degree, guard, run.zeros, ALGEBRAIC[system], e) if guard >= 0 else (-1.0, True)
        if sure:
            break
        stop, length = _ON, 0.5 * length
    if fall >= 0.0:
        stop, share = AT_GUARD, fall
    status.resting = -1
    for i in range(2):
        j = n + 3 + i
        if abs(c[0, j]) <= status.sizes[j]:
            rest = find_standstill(c, degree, j, status.guard)
            if 0.0 <= rest < share:
                stop, share, status.resting = _ON, rest, i
    if share < 1.0:
        length *= share
        put_step(e.room.q, degree, length, n, c)
    target = run.target - run.turns[0]
    # the last steps before it alone, as sizes of coefficients say with room for round-off; none without one, nan
    if c[0, 3] + 2.0 * status.sizes[3] >= target:
        angle = c[degree, 3]  # of exciter 1 at the end
        for k in range(degree - 1, -1, -1):
            angle += c[k, 3]
        if angle >= target:
            stop, status.resting = AT_TARGET, -1
            length *= crossing(c, degree, 3, target)
            put_step(e.room.q, degree, length, n, c)
    return stop, length


@inlined
def guard_fall(c: FloatArray, degree: int, guard: int, zeros: int, algebraic: bool, e: Expansion) -> tuple[float, bool]:
    """Fraction of a step at which its guard falls through zero, −1 if it does not, and whether that is sure.

    A guard is its polynomial of degree d and a remainder, which is taken to be within T sᵈ at fraction s of the step; T
    is the sum of the sizes of the last four coefficients, as much as is left where coefficients halve every four. No
    fall of the polynomial is missed (:func:`vibroplat.kernels.polynomial.first_downcrossing`). Whether the guard falls
    in the step is sure, within these bounds, if polynomial − T sᵈ does not fall, or polynomial + T sᵈ does as well. If
    it is not, as near a touch, a shorter step will be, for T shrinks with sᵈ; where T is round-off the polynomial
    decides. Where a step holds a touch and then a fall, the polynomial alone says which is first: T sᵈ is least there.
    """
    used = degree - 2 if algebraic else degree
    rest, first = 0.0, 0
    for k in range(used - ERROR_COEFFICIENTS + 1, used + 1):
        rest += abs(c[k, guard])
    if c[0, guard] > e.status.sizes[guard] + rest:
        return -1.0, True
    while first < zeros and c[first, guard] <= 0.0:
        first += 1
    lowest, at_end = c[first, guard] - rest, c[first, guard]
    for k in range(max(first + 1, zeros), used + 1):
        lowest += min(c[k, guard], 0.0)
        at_end += c[k, guard]
    if lowest > 0.0:
        return -1.0, True
    for k in range(used + 1):
        e.status.guard[k, 0] = e.status.bound[k, 0] = c[k, guard]
    fall = first_downcrossing(e.status.guard, used, 0, zeros)
    if rest <= _NO_TRUNCATION * (abs(c[0, guard]) + e.status.sizes[guard]) or (fall >= 0.0 and at_end < -rest):
        return fall, True
    e.status.bound[used, 0] += rest if fall >= 0.0 else -rest
    return fall, (first_downcrossing(e.status.bound, used, 0, zeros) >= 0.0) == (fall >= 0.0)


@compiled
def find_standstill(c: FloatArray, degree: int, j: int, room: FloatArray) -> float:
    """Fraction of a step at which the rate in column j passes zero, −1 if it does not; not at the step's beginning."""
    first = 0
    while first < degree and c[first, j] == 0.0:
        first += 1
    sense = 1.0 if c[first, j] > 0.0 else -1.0
    for k in range(degree + 1):
        room[k, 0] = sense * c[k, j]
    return first_downcrossing(room, degree, 0, first)


@inlined
def accept_step(h: Automaton, e: Expansion, system: int, stop: int, length: float) -> bool:
    """Whether a step ends where the model holds, with the accelerations and the contact force of the equations there.

    Leaves the unknowns there in ``ahead``, and their series.
    """
    run, n, ahead, at_end = h.run, DIFFERENTIAL[system] // 2, e.status.ahead, e.status.at_end
    for i in range(n):
        ahead[i], ahead[n + i] = at_end[0, i], at_end[1, i]
    if e.status.resting >= 0:
        ahead[n + 3 + e.status.resting] = 0.0
    if not (finite(ahead[: 2 * n]) and is_definite(ahead, h.p)):
        return False
    degree = e.status.degree
    force = at_end[0, FORCE]
    expand(system, run.origin + e.status.done + length, ahead, degree if stop == _ON else 2, e.room, h.p)
    q, weights, worst = e.room.q, e.status.weights, abs(force - e.room.q[0, FORCE]) * e.status.weights[FORCE]
    for i in range(n):
        difference = abs(at_end[2, i] - 2.0 * q[2, i])
        worst = max(worst, difference * length / degree * weights[i])
        if not difference < np.inf:
            return False
    return worst <= MAX_DEFECT or is_round_off(h.steps.c[h.steps.used.steps], n, worst, e)


@compiled
def is_round_off(c: FloatArray, n: int, worst: float, e: Expansion) -> bool:
    """Whether a difference at the end of a step is round-off of the sums that made it."""
    size = 0.0
    for i in range(n):
        terms = 0.0
        for k in range(1, e.status.degree + 1):
            terms += k * abs(c[k, n + i])
        size = max(size, terms / e.status.degree * e.status.weights[i])
    force = 0.0
    for k in range(e.status.degree + 1):
        force += abs(c[k, 2 * n])
    return worst <= _NOISE * max(size, force * e.status.weights[FORCE])
