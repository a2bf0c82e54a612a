"""Stability of periodic orbits by their Floquet multipliers: test functions, counts, order."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.kernels.compiled import FloatArray, compiled

#: Imaginary part up to which a multiplier is real, but for round-off; magnitudes are equal within 1 / RESOLUTION.
MAX_IMAGINARY, RESOLUTION = 1e-9, 1e12
#: Distance of a multiplier from the unit circle that counts: its own error is far smaller.
UNIT_CIRCLE_DISTANCE = 1e-6
#: How far round-off takes the product of the two multipliers of an undamped mode from 1.
UNDAMPED_TOLERANCE = 1e-5
#: Multipliers larger than the first are watched: one may move by the second between two points, over its size above 1.
WATCHED_SIZE, MAX_MULTIPLIER_CHANGE = 0.9, 0.4


class Stability(NamedTuple):
    """Stability of an orbit by its multipliers.

    Attributes
    ----------
    fold, doubling
        Products of 1 − multipliers, 0 at a fold over any key, and of 1 + multipliers, 0 where the period doubles.
    neimark_sacker
        Product of 1 − those of two multipliers, 0 also where a real one is the inverse of another.
    complex_pair
        Whether the two multipliers whose product is next to 1 are complex.
    one_pair
        Whether at most one pair of multipliers has the product 1. That of an undamped mode has it at all values of the
        keys, where the test function then says nothing.
    outside
        How many multipliers are above 1, complex and outside the unit circle, and below −1.
    """

    fold: float
    doubling: float
    neimark_sacker: float
    complex_pair: bool
    one_pair: bool
    outside: tuple[int, int, int]


def multipliers_of(section_map: FloatArray) -> npt.NDArray[np.complex128]:
    """Find the multipliers: eigenvalues of the derivative of the map from section to section.

    The largest is first, but for round-off; of a pair that above the real axis.

    Raises
    ------
    numpy.linalg.LinAlgError
        The derivative is not finite.
    """
    found = np.linalg.eigvals(section_map).astype(complex)
    return found[np.lexsort((-found.imag, -np.rint(np.abs(found) * RESOLUTION)))]


@compiled
def n_unstable(multipliers: Any) -> int:
    """Count the multipliers outside the unit circle."""
    count = 0
    for one in multipliers:
        count += abs(one) > 1.0 + UNIT_CIRCLE_DISTANCE
    return count


@compiled
def stability(multipliers: Any) -> Stability:
    """Evaluate the stability by the multipliers, in the order of :func:`multipliers_of`."""
    fold, doubling, neimark_sacker = 1.0 + 0.0j, 1.0 + 0.0j, 1.0 + 0.0j
    above = around = below = pairs = 0
    nearest, complex_pair = math.inf, False
    for i in range(multipliers.size):
        one = multipliers[i]
        fold, doubling = fold * (1.0 - one), doubling * (1.0 + one)
        real = abs(one.imag) <= MAX_IMAGINARY
        above += real and one.real > 1.0
        below += real and one.real < -1.0
        around += not real and abs(one) > 1.0
        for j in range(i + 1, multipliers.size):
            left = 1.0 - one * multipliers[j]
            neimark_sacker *= left
            pairs += abs(left) < UNDAMPED_TOLERANCE
            if abs(left) < nearest:
                nearest, complex_pair = abs(left), not real and abs(multipliers[j].imag) > MAX_IMAGINARY
    outside = (above, around, below)
    return Stability(fold.real, doubling.real, neimark_sacker.real, complex_pair, pairs < 2, outside)


@compiled
def lost(multipliers: Any, others: Any) -> bool:
    """Whether one near the unit circle, or outside, has none of the others near it."""
    for one in multipliers:
        away = math.inf
        for other in others:
            away = min(away, abs(one - other))
        if abs(one) > WATCHED_SIZE and away > MAX_MULTIPLIER_CHANGE * max(1.0, abs(one)):
            return True
    return False
