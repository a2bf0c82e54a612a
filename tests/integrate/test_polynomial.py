"""Polynomials of steps: guards' falls against numpy's roots, extremes, crossings."""

from fractions import Fraction
from itertools import product
from math import factorial

import numpy as np
import pytest

from vibroplat.kernels.polynomial import (
    MAX_DEGREE,
    crossing,
    first_downcrossing,
    stretch,
    turning_point,
    value,
    values,
)


def column(coefficients):
    return np.array(coefficients, dtype=float)[:, np.newaxis]


def fall(coefficients, zeros=0):
    return first_downcrossing(column(coefficients), len(coefficients) - 1, 0, zeros)


def random_polynomials(seed, count, zeros=0):
    """Polynomials as steps have them, of degrees 3 to 24: half of them nearly tangent to zero from above or below."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        degree = int(rng.integers(3, 25)) - zeros
        decay = rng.uniform(0.2, 1.5)
        c = rng.normal(size=max(degree, 1) + 1) * decay ** np.arange(max(degree, 1) + 1)
        if number % 2:
            lowest = np.polynomial.Polynomial(c)
            places = [r.real for r in lowest.deriv().roots() if abs(r.imag) < 1e-9 and 0.0 < r.real < 1.0]
            places = [s for s in places if lowest.deriv(2)(s) > 0.0] or [1.0]
            c[0] += 10.0 ** rng.uniform(-9, -2) * rng.choice((-1.0, 1.0)) - min(lowest(s) for s in places)
        c[0] = abs(c[0]) if zeros else c[0]
        yield c


def expected_fall(c, noise=1e-12):
    """First fall by numpy's roots; None where round-off decides whether there is one."""
    polynomial = np.polynomial.Polynomial(c)
    roots = polynomial.roots()
    # a double root splits by the root of round-off
    real = sorted(r.real for r in roots if abs(r.imag) < 1e-4 and -1e-4 < r.real < 1.0 + 1e-4)
    places = np.unique([0.0, *(s for s in real if 0.0 < s < 1.0), 1.0])
    middles = 0.5 * (places[1:] + places[:-1])
    signs = polynomial(middles)
    rough = noise * np.abs(c).sum()
    if (np.abs(signs) < rough).any() or any(abs(polynomial(s)) < rough for s in (0.0, 1.0)):
        return None
    if (signs < 0.0).all():  # it falls from its highest
        s = np.linspace(0.0, 1.0, 1001)
        return s[polynomial(s).argmax()] if polynomial(1.0) <= polynomial(0.0) else -1.0
    for k in range(len(signs) - 1):
        if signs[k] > 0.0 > signs[k + 1]:
            return places[k + 1]
    return -1.0


def sure(c, found, expected):
    """Whether a fall agrees with the expected one, or is as good a root of the polynomial."""
    if expected == -1.0 or found == -1.0:
        return found == expected
    polynomial, rough = np.polynomial.Polynomial(c), 1e-11 * np.abs(c).sum()
    if polynomial(expected) < -rough:
        return polynomial(found) >= polynomial(expected)
    return abs(found - expected) < 1e-6 and abs(polynomial(found)) < rough


@pytest.mark.parametrize("zeros", [0, 1, 3])
def test_no_fall_is_missed_and_none_is_false(zeros):
    """Round-off in the coefficients at the start that are known to be 0 does not show."""
    rng, found = np.random.default_rng(zeros), []
    for c in random_polynomials(seed=3 + zeros, count=600, zeros=zeros):
        expected = expected_fall(c)
        if expected is None:
            continue
        whole = np.concatenate([-1e-14 * np.abs(rng.normal(size=zeros)), c])
        assert sure(c, fall(whole, zeros), expected), (whole.tolist(), fall(whole, zeros), expected)
        found.append(expected >= 0.0)
    assert len(found) > 450
    assert 0.2 < np.mean(found) < 0.8


def test_known_zeros_that_a_coarse_polynomial_misses():
    """A gap at a liftoff, by a method of order 1: it opens as 2 s² − s³, where it should as s³."""
    assert fall([0.0, 0.0, 2.0, -1.0], 3) == -1.0
    assert fall([0.0, 0.0, -2.0, 3.0], 3) == -1.0
    assert fall([0.0, 0.0, 0.5, -1.0], 3) == pytest.approx(0.5)


def test_first_of_several_falls():
    sets = (0.2, 0.4, 0.6, 0.8), (0.3, 0.3001, 0.9), (0.01, 0.02, 0.03, 0.99)
    for roots, sign in product(sets, (1.0, -1.0)):
        c = np.polynomial.Polynomial.fromroots(roots).coef
        c *= sign * np.sign(c[0])
        assert fall(c) == pytest.approx(roots[0 if sign > 0.0 else 1], abs=1e-11)


@pytest.mark.parametrize("degree", [4, 17, MAX_DEGREE])
def test_falls_are_as_exact_as_the_coefficients(degree):
    """One zero, the others away from the step, up to the highest degree: against exact sums of fractions."""
    rng = np.random.default_rng(degree)
    for root in rng.uniform(0.01, 0.99, 25):
        away = np.polynomial.Polynomial(rng.uniform(0.1, 1.0, degree) * 0.7 ** np.arange(degree))
        c = (away * np.polynomial.Polynomial([root, -1.0])).coef
        found = Fraction(fall(c))
        value = sum(Fraction(number) * found**k for k, number in enumerate(c))
        slope = sum(k * Fraction(number) * found ** (k - 1) for k, number in enumerate(c) if k)
        assert abs(found - Fraction(root)) < 1e-13
        assert abs(value / slope) < 4e-16 * np.abs(c * root ** np.arange(len(c))).sum() / abs(float(slope)) + 2e-16


def test_low_flight_lands():
    """A rebound so slow that the step is long against the flight: gap = v t − a t², then far away up again."""
    for ratio in (1e-3, 1e-9, 1e-15):
        c = np.array([0.0, ratio, -1.0, 0.3, 2.0, 0.0, 1.0])
        assert fall(c, 1) == pytest.approx(ratio, rel=1e-2, abs=3e-16)


def test_flat_touch_takes_no_time():
    """A root of high order: round-off has many signs there; none of them is looked into by itself."""
    for power, lift in product((2, 4, 6, 12), (0.0, 1e-19, 1e-16, 1e-13)):
        c = np.polynomial.Polynomial.fromroots([0.37] * power).coef
        c[0] += lift
        found = fall(c)
        assert found == -1.0 or abs(found - 0.37) < 0.2


def test_falling_from_the_start_falls_there():
    assert 0.0 <= fall([0.0, -1.0, 0.0, 0.5]) < 1e-15
    assert fall([-1e-15, -1.0, 0.0, 0.5]) == 0.0
    assert fall([-1e-15, 1.0, 0.0, 0.0]) == -1.0
    assert fall([-1e-3, 1.0, -2.0, 0.0]) == pytest.approx(0.25 + np.sqrt(0.0625 - 5e-4))


@pytest.mark.parametrize("turn", [2.0, 3.0])
def test_extremes_of_an_oscillation_are_exact_to_round_off(turn):
    """From a place within 0.1 of each."""
    for phase in np.linspace(0.01, 2.0 * np.pi, 60):
        c = column([turn**k * np.cos(phase + k * np.pi / 2.0) / factorial(k) for k in range(25)])
        for top, sense in ((np.pi, -1.0), (2.0 * np.pi, 1.0)):
            place = (top - phase) / turn
            near = min(max(round(place, 1), 0.0), 1.0)
            found, s = turning_point(c, 24, 0, near, near - 0.1, near + 0.1, 7.0)
            if 1e-9 < place < 1.0 - 1e-9:
                assert (found, s) == (pytest.approx(sense, abs=5e-14), pytest.approx(place, abs=1e-7))


def test_crossing_of_a_level():
    c = np.array([1.0, 2.0, 0.3, 0.2])
    for level in (1.0 + 1e-12, 2.0, 3.4999):
        for sign in (1.0, -1.0):
            s = crossing(column(sign * c), 3, 0, sign * level, sign * c.sum())
            assert np.polynomial.Polynomial(c)(s) == pytest.approx(level, abs=1e-14)


def test_stretched_step_is_the_same_motion():
    c = np.random.default_rng(0).normal(size=(8, 3))
    end = np.empty(3)
    values(c, 7, 0.6, end)
    longer = c.copy()
    stretch(longer, 7, 1.5)
    for j in range(3):
        assert value(longer, 7, j, 0.4) == pytest.approx(end[j], rel=1e-13)
