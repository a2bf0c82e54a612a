"""Polynomials of a step: value, rate, first fall through zero, range.

A step's polynomial is Σ cₖ sᵏ in its fraction s ∈ [0, 1]. Coefficients of all unknowns stand in an array of shape
(degree + 1, unknowns), so that one power is one row; functions of one unknown take a column of it.
"""

from __future__ import annotations

import math

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, copy, fused, fused_inline
from vibroplat.kernels.lanes import Lanes, greater, lesser, select, size, some, zero

#: Halvings until a fraction of a step is found to round-off.
HALVINGS = 54
#: Step of Newton's iteration after which its square, the error, is below round-off; round-off may keep it from less.
NEWTON_TOLERANCE = 2.0**-40
#: Way to a zero that Newton's iteration with curvature goes to round-off: its cube is left.
CURVED_RANGE = 2e-6
#: Part of a step within which Taylor polynomials of degree 2 and 5 are exact nearly to round-off.
QUADRATIC_RANGE, QUINTIC_RANGE = 1e-4, 3e-3
#: Highest degree of series, and of polynomials whose zeros are searched for.
MAX_DEGREE = 32
#: One over the binomial coefficients C(n, k).
_SHARES = np.array([[1.0 / max(math.comb(n, k), 1) for k in range(MAX_DEGREE + 1)] for n in range(MAX_DEGREE + 1)])


@fused_inline
def value(c: FloatArray, degree: int, j: int, s: float) -> float:
    """Evaluate unknown j at fraction s of a step."""
    total = c[degree, j]
    for k in range(degree - 1, -1, -1):
        total = total * s + c[k, j]
    return total


@fused_inline
def slope(c: FloatArray, degree: int, j: int, s: float) -> float:
    """Differentiate unknown j with respect to s."""
    total = degree * c[degree, j]
    for k in range(degree - 1, 0, -1):
        total = total * s + k * c[k, j]
    return total


@fused_inline
def values(c: FloatArray, degree: int, s: float, out: FloatArray) -> None:
    """Fill the values of all unknowns at fraction s of a step, ``out.size`` of them."""
    for j in range(out.size):
        out[j] = c[degree, j]
    for k in range(degree - 1, -1, -1):
        for j in range(out.size):
            out[j] = out[j] * s + c[k, j]


@compiled
def stretch(c: FloatArray, degree: int, share: float) -> None:
    """Let a step end at fraction ``share`` of it, or beyond: the same polynomial in the new fraction."""
    power = 1.0
    for k in range(1, degree + 1):
        power *= share
        for j in range(c.shape[1]):
            c[k, j] *= power


@compiled
def first_downcrossing(c: FloatArray, degree: int, j: int, zeros: int) -> float:
    """Fraction of a step at which unknown j first falls through zero, or −1 if it does not.

    Nothing escapes: a polynomial has no more zeros in an interval than its Bernstein coefficients there have changes
    of sign (Descartes' rule), so intervals are halved until there is none. An unknown that begins below zero, by
    round-off or where it touched, can fall only after it has risen; where it ends lower without, it falls from its
    highest.

    ``zeros`` says how many zeros the unknown is known to have at 0, as a gap at a liftoff: what its first coefficients
    are below 0 is an error of the polynomial, and left out.
    """
    first = 0
    while first < zeros and c[first, j] <= 0.0:
        first += 1
    n = degree - first
    lowest = c[first, j]
    for k in range(max(first + 1, zeros), degree + 1):
        lowest += min(c[k, j], 0.0)
    if lowest > 0.0:
        return -1.0
    powers, bernstein = np.empty(n + 1), np.empty(n + 1)
    for k in range(n + 1):
        powers[k] = c[first + k, j] if first + k >= zeros or c[first + k, j] > 0.0 else 0.0
        bernstein[k] = _SHARES[n, k] * powers[k]
    for level in range(1, n + 1):  # the Bernstein coefficient i is Σₖ C(i, k)/C(n, k) cₖ (Pascal's triangle)
        for i in range(n, level - 1, -1):
            bernstein[i] += bernstein[i - 1]
    begin = 0.0
    if bernstein[0] < 0.0:
        begin = first_zero(powers, bernstein, -1.0, 0.0)
        if begin < 0.0:
            return -1.0 if bernstein[n] > bernstein[0] else at_highest(c, degree, j)
        begin = min(begin + 2.0**-HALVINGS, 1.0)
        for level in range(1, n + 1):  # those of the part [begin, 1] (de Casteljau)
            for i in range(n + 1 - level):
                bernstein[i] += begin * (bernstein[i + 1] - bernstein[i])
        bernstein[0] = max(bernstein[0], 0.0)  # it has just risen, up to round-off
    return first_zero(powers, bernstein, 1.0, begin)


@compiled
def first_zero(powers: FloatArray, b: FloatArray, sign: float, begin: float) -> float:
    """Least fraction from ``begin`` on behind which ``sign`` times the polynomial is below zero, −1 if that is nowhere.

    The polynomial is not below zero at ``begin``. It is given by its coefficients, and by those of Bernstein's form
    between ``begin`` and 1.
    """
    leading, changes = sign_changes(b, sign)
    if leading < 0.0:
        return begin
    if changes == 0:
        return -1.0
    if changes == 1:
        return single_zero(powers, b, sign, begin, 1.0 - begin)
    return first_of_zeros(powers, b, sign, begin)


@compiled
def first_of_zeros(powers: FloatArray, b: FloatArray, sign: float, begin: float) -> float:
    """Do as :func:`first_zero` where there may be several zeros."""
    part, waiting = b.copy(), np.empty((HALVINGS + 1, b.size))
    lows, sizes = np.empty(HALVINGS + 1), np.empty(HALVINGS + 1)
    low, size, parts = begin, 1.0 - begin, 0  # of the part [low, low + size]; parts further right are waiting
    while True:
        leading, changes = sign_changes(part, sign)
        if leading < 0.0 or (changes > 0 and size <= 2.0**-HALVINGS):
            return low
        if changes == 1:
            return single_zero(powers, part, sign, low, size)
        if changes > 1:  # halve: its left half first
            size *= 0.5
            lows[parts], sizes[parts] = low + size, size
            halve(part, waiting[parts])
            parts += 1
        elif parts == 0:
            return -1.0
        else:  # on to the next part to the right
            parts -= 1
            low, size = lows[parts], sizes[parts]
            copy(waiting[parts], part)


@compiled
def sign_changes(b: FloatArray, sign: float) -> tuple[float, int]:
    """First number that is not 0, times ``sign``, or 0 without one; how often signs change from one to the next."""
    leading, last, changes = 0.0, 0.0, 0
    for number in b:
        if number != 0.0:
            if last == 0.0:
                leading = sign * number
            elif (number > 0.0) != (last > 0.0):
                changes += 1
            last = number
    return leading, changes


@compiled
def halve(b: FloatArray, right: FloatArray) -> None:
    """Replace Bernstein coefficients by those of the left half, and fill those of the right one (de Casteljau)."""
    n = b.size
    copy(b, right)
    for level in range(1, n):
        b[level - 1] = right[0]
        for i in range(n - level):
            right[i] = 0.5 * (right[i] + right[i + 1])
    b[n - 1] = right[0]


@fused
def single_zero(powers: FloatArray, b: FloatArray, sign: float, begin: float, size: float) -> float:
    """Fraction at which ``sign`` times a polynomial falls through zero, the only one in [``begin``, ``begin + size``].

    Its Bernstein coefficients ``b`` there change their sign once. By Newton's iteration from where their polygon falls,
    and halving where it leaves the interval.
    """
    n = b.size - 1
    low, high = begin, begin + size
    i = 1
    while sign * b[i] >= 0.0:
        i += 1
    s = begin + size * (i - 1 + b[i - 1] / (b[i - 1] - b[i])) / n
    for _ in range(HALVINGS):
        here, rate = powers[n], 0.0
        for k in range(n - 1, -1, -1):
            rate = rate * s + here
            here = here * s + powers[k]
        if sign * here >= 0.0:
            low = s
        else:
            high = s
        following = s - here / rate if sign * rate < 0.0 else low
        if abs(following - s) <= NEWTON_TOLERANCE * size:
            return following
        s = following if low < following < high else 0.5 * (low + high)
    return s


@compiled
def at_highest(c: FloatArray, degree: int, j: int) -> float:
    """Fraction of a step at which unknown j is largest."""
    points = 2 * degree
    best, largest = 0.0, c[0, j]
    for i in range(1, points + 1):
        here = value(c, degree, j, i / points)
        if here > largest:
            best, largest = i / points, here
    low, high = max(best - 1.0 / points, 0.0), min(best + 1.0 / points, 1.0)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if slope(c, degree, j, middle) > 0.0:
            low = middle
        else:
            high = middle
    return low


@fused_inline
def turning_point(
    c: FloatArray, degree: int, j: int, s: Lanes, low: Lanes, high: Lanes, otherwise: Lanes
) -> tuple[Lanes, Lanes]:
    """Value of unknown j near fraction s of a step where its slope is zero, and where that is; or ``otherwise`` and s.

    By Halley's iteration between ``low`` and ``high``, up to a way that its Taylor polynomial covers to round-off; a
    step of Newton's iteration makes the slope of that 0. At the ends of the step there is nothing to look for. From the
    vertex of a parabola through three samples the first way mostly is that short. Several polynomials go side by side
    where ``c`` is made of lanes; one that has come as near stays there, so that no other has a say in what it finds.
    """
    start, way, none = s, zero(s), zero(s)
    here = rate = half = third = fourth = fifth = none
    for _ in range(4):
        s = s + select(size(way) > QUINTIC_RANGE, way, 0.0)
        here, rate, half, third, fourth, fifth = c[degree, j], none, none, none, none, none  # over factorials
        for k in range(degree - 1, -1, -1):
            fifth = fifth * s + fourth
            fourth = fourth * s + third
            third = third * s + half
            half = half * s + rate
            rate = rate * s + here
            here = here * s + c[k, j]
        bent = 2.0 * half * half - 1.5 * rate * third
        way = select(bent > half * half, -rate * half / bent, -0.5 * rate / half)
        way = lesser(greater(s + way, low), high) - s
        if not some(size(way) > QUINTIC_RANGE):
            break
    left = rate + way * (2.0 * half + way * (3.0 * third + way * (4.0 * fourth + way * (5.0 * fifth))))
    way = lesser(greater(s + way - 0.5 * left / half, low), high) - s
    value = here + way * (rate + way * (half + way * (third + way * (fourth + way * fifth))))
    s = s + way
    inside = (size(way) <= 2.0 * QUINTIC_RANGE) & (s > 0.0) & (s < 1.0)
    return select(inside, value, otherwise), select(inside, s, start)


@fused
def crossing(c: FloatArray, degree: int, j: int, level: float, end: float) -> float:
    """Fraction of a step at which unknown j passes a level between its values at both ends, or next to one of them.

    ``end`` is its value at the end. By Newton's iteration with a term for the curvature, and halving where it leaves
    the interval.
    """
    low, high, begin = 0.0, 1.0, c[0, j]
    rising = begin < end
    s = min(max((level - begin) / (end - begin), 0.0), 1.0) if begin != end else 0.5
    for _ in range(HALVINGS):
        here, rate, half = c[degree, j], 0.0, 0.0  # derivatives over factorials
        for k in range(degree - 1, -1, -1):
            half = half * s + rate
            rate = rate * s + here
            here = here * s + c[k, j]
        here -= level
        if (here < 0.0) == rising:
            low = s
        else:
            high = s
        way = -here / rate
        following = s + way * (1.0 - way * half / rate)
        if abs(way) <= CURVED_RANGE:
            return min(max(following, 0.0), 1.0)
        s = following if low < following < high else 0.5 * (low + high)
    return s
