"""Where a step of one motion ends by its series: at the fall of its guard, where an exciter stops, at an angle."""

from __future__ import annotations

from typing import Any

import numpy as np

from vibroplat.hybrid.loop import AT_GUARD, AT_TARGET, AT_TIME
from vibroplat.hybrid.modes import COUNTS, GUARDS, guard_form
from vibroplat.hybrid.state import WIDTH, Automaton
from vibroplat.kernels.compiled import FloatArray, compiled, inlined
from vibroplat.kernels.lanes import Lanes, four, join, load_8, store
from vibroplat.kernels.lines import in_lines
from vibroplat.kernels.polynomial import MAX_DEGREE, crossing, first_downcrossing
from vibroplat.kernels.rows_of_16 import sizes_16
from vibroplat.model.series import FORCE_COLUMN, FRICTION_COLUMN
from vibroplat.model.systems import ALGEBRAIC, DIFFERENTIAL, LAYERS, SERIES_COLUMNS, SLIDES, UNKNOWNS

#: Coefficients at the end of a series that choose its step. Kloss' torque has complex poles, which let pairs of them
#: vanish by turns: of the last two, an error of 1e-6 becomes 2e-5.
ERROR_COEFFICIENTS = 4

#: Truncation of a guard that is round-off beside the sum of its polynomial's terms.
_NO_TRUNCATION = 4.0 * float(np.finfo(float).eps)

#: The segment goes on.
ON = -1

#: What the engine remembers of one motion.
STATUS = np.dtype(
    [
        ("sizes", float, WIDTH),  # sums of the sizes of a step's coefficients but the first
        ("y", float, UNKNOWNS),  # unknowns, and their derivatives, at the end of a step
        ("yp", float, UNKNOWNS),
        ("ypp", float, UNKNOWNS),
        ("forms", float, (MAX_DEGREE + 1, 2)),  # the two guards of contact with friction
        ("guard", float, (MAX_DEGREE + 1, 1)),  # a guard's polynomial, and one that bounds it
        ("bound", float, (MAX_DEGREE + 1, 1)),
        ("before", float),  # duration of the step before in the segment, 0 without one (s)
        ("open", int),  # whether a segment is
        ("full", int),  # whether there is no room for more steps
        ("stop", int),  # why the segment ends with the step, or ON
        ("resting", int),  # exciter that comes to rest at the end of a step, or −1
        ("short", int),  # whether steps have become too short
    ],
    align=True,
)


def statuses(width: int) -> Any:
    """Make what the engine remembers of so many motions, each in lines of the processor's cache."""
    return in_lines((width,), STATUS)


@inlined
def is_shifted(system: int) -> bool:
    """Whether the upper layer's coordinate follows those of the platform: attached, with two layers."""
    return ALGEBRAIC[system] and LAYERS[system] == 2 and not SLIDES[system]


@inlined
def load_lane(q: FloatArray, row: int, lane: int) -> Lanes:
    """Load the eight numbers that a row has of one lane."""
    if q.shape[2] == 1:
        return load_8(q, row, 0)
    return join(
        four(q[row, 0, lane], q[row, 1, lane], q[row, 2, lane], q[row, 3, lane]),
        four(q[row, 4, lane], q[row, 5, lane], q[row, 6, lane], q[row, 7, lane]),
    )


@inlined
def put_step(q: FloatArray, lane: int, degree: int, length: float, n: int, shifted: bool, c: FloatArray) -> None:
    """Write series in powers of time as a step's polynomials in its fraction: coordinates, rates, F_c.

    Parameters
    ----------
    q, lane
        Coefficients, shape (degree + 2 or more, 8, lanes), and which lane's: seven coordinates, then F_c. The row
        after the last is 0.
    length
        Duration of the step (s).
    n, shifted
        Number of coordinates that count, and whether the seventh of them comes in place of the sixth.
    c
        Filled, shape (degree + 1, 16): coordinates, their rates from column n on, F_c in column 2n, then numbers of
        no meaning.
    """
    power, following = 1.0, load_lane(q, 0, lane)
    for k in range(degree + 1):
        row, following = following, load_lane(q, k + 1, lane)
        rate = power * (k + 1.0)
        store(row * power, c, k, 0)
        store(following * rate, c, k, n)
        if shifted:
            c[k, 5], c[k, 11] = power * q[k, 6, lane], rate * q[k + 1, 6, lane]
        if 2 * n < c.shape[1]:  # in flight with transport, all columns are coordinates and rates
            c[k, 2 * n] = power * q[k, FORCE_COLUMN, lane]
        power *= length


@inlined
def put_polynomials(q: FloatArray, lane: int, degree: int, length: float, system: int, c: FloatArray) -> None:
    """Write a lane's series as the polynomials of a step of a system."""
    n = DIFFERENTIAL[system] // 2
    put_step(q, lane, degree, length, n, is_shifted(system), c)
    if SLIDES[system]:
        put_sliding(q, lane, degree, length, system, c)


@compiled
def put_sliding(q: FloatArray, lane: int, degree: int, length: float, system: int, c: FloatArray) -> None:
    """Write what follows the platform's coordinates with transport: layers, s, their rates, and forces."""
    n, power = DIFFERENTIAL[system] // 2, 1.0
    for k in range(degree + 1):
        rate = power * (k + 1.0)
        for i in range(5, n):
            column = SERIES_COLUMNS[system, i]
            c[k, i], c[k, n + i] = power * q[k, column, lane], rate * q[k + 1, column, lane]
        for i in range(5):
            c[k, n + i] = rate * q[k + 1, i, lane]
        if ALGEBRAIC[system]:
            c[k, 2 * n], c[k, 2 * n + 1] = power * q[k, FORCE_COLUMN, lane], power * q[k, FRICTION_COLUMN, lane]
        power *= length


@compiled
def sliding_fall(h: Automaton, c: FloatArray, degree: int, system: int, status: Any) -> tuple[float, bool]:
    """Do as :func:`guard_fall` for the first of a system's guards that falls, which ``run.fallen`` then says."""
    run, forms, n = h.run, status.forms, DIFFERENTIAL[system]
    first, all_sure = -1.0, True
    for which in range(COUNTS[system]):
        column, weight, other, share = guard_form(system, which, h.p)
        size = 0.0
        for k in range(degree + 1):
            forms[k, which] = weight * c[k, column] + share * c[k, other]
            size += abs(forms[k, which])
        size -= abs(forms[0, which])
        algebraic = column >= n
        zeros = run.zeros if which == 0 else run.other_zeros
        fall, sure = guard_fall(forms, degree, which, zeros, algebraic, status, size)
        all_sure = all_sure and sure
        if fall >= 0.0 and (first < 0.0 or fall < first):
            first, run.fallen = fall, which
    return first, all_sure


@compiled
def end_of_step(
    h: Automaton, status: Any, q: FloatArray, lane: int, degree: int, done: float, longest: float, c: FloatArray
) -> float:
    """Write the series of a lane as a step's polynomials, and find where the step ends: its length (s).

    The step begins at a time of the segment. Why the segment ends with it is left in ``status.stop``.
    """
    run, length = h.run, longest
    system = run.systems[run.mode]
    n = DIFFERENTIAL[system] // 2
    stop, share = AT_TIME if length >= run.until - done else ON, 1.0
    while True:
        put_polynomials(q, lane, degree, length, system, c)
        sizes_16(c, 1, degree, status.sizes)
        fall, sure = fall_in_step(h, c, degree, system, status)
        if sure:
            break
        stop, length = ON, 0.5 * length
    if fall >= 0.0:
        stop, share = AT_GUARD, fall
    status.resting = -1
    for i in range(2):
        j = n + 3 + i
        if abs(c[0, j]) <= status.sizes[j]:
            rest = find_standstill(c, degree, j, status.guard)
            if 0.0 <= rest < share:
                stop, share, status.resting = ON, rest, i
    if share < 1.0:
        length *= share
        put_polynomials(q, lane, degree, length, system, c)
    target = run.target - run.turns[0]
    # the last steps before it alone, as sizes of coefficients say with room for round-off; none without one, nan
    if c[0, 3] + 2.0 * status.sizes[3] >= target:
        angle = c[degree, 3]  # of exciter 1 at the end
        for k in range(degree - 1, -1, -1):
            angle += c[k, 3]
        if angle >= target:
            stop, status.resting = AT_TARGET, -1
            length *= crossing(c, degree, 3, target, angle)
            put_polynomials(q, lane, degree, length, system, c)
    status.stop = stop
    return length


@inlined
def fall_in_step(h: Automaton, c: FloatArray, degree: int, system: int, status: Any) -> tuple[float, bool]:
    """Do as :func:`guard_fall` for the guards of a system, whatever their number."""
    guard = GUARDS[system]
    if SLIDES[system]:
        return sliding_fall(h, c, degree, system, status)
    if guard < 0:
        return -1.0, True
    return guard_fall(c, degree, guard, h.run.zeros, ALGEBRAIC[system], status, status.sizes[guard])


@inlined
def guard_fall(
    c: FloatArray, degree: int, guard: int, zeros: int, algebraic: bool, status: Any, size: float
) -> tuple[float, bool]:
    """Fraction of a step at which its guard falls through zero, −1 if it does not, and whether that is sure.

    ``size`` is the sum of the sizes of its coefficients but the first.

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
    if c[0, guard] > size + rest:
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
        status.guard[k, 0] = status.bound[k, 0] = c[k, guard]
    fall = first_downcrossing(status.guard, used, 0, zeros)
    if rest <= _NO_TRUNCATION * (abs(c[0, guard]) + size) or (fall >= 0.0 and at_end < -rest):
        return fall, True
    status.bound[used, 0] += rest if fall >= 0.0 else -rest
    return fall, (first_downcrossing(status.bound, used, 0, zeros) >= 0.0) == (fall >= 0.0)


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
