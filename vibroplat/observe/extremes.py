"""Gauss nodes of a step, and extremes of its polynomials found from their values there."""

from __future__ import annotations

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, inlined
from vibroplat.kernels.polynomial import bend, extremes, slope, turning_value

#: Degree of polynomials up to which there are too few samples of them to find extremes by.
FEW_SAMPLES = 8
#: Gauss nodes and weights on [0, 1], by their number.
MOST_NODES = 16
NODES, WEIGHTS = np.zeros((2, MOST_NODES + 1, MOST_NODES))
for _n in range(1, MOST_NODES + 1):
    _nodes, _weights = np.polynomial.legendre.leggauss(_n)
    NODES[_n, :_n], WEIGHTS[_n, :_n] = 0.5 + 0.5 * _nodes, 0.5 * _weights


@inlined
def widened(
    least: float, largest: float, c: FloatArray, samples: FloatArray, nodes: int, j: int, since: float, last: float
) -> tuple[float, float]:
    """Return extremes that also cover unknown j in a step from fraction ``since`` of it, at whose end it is ``last``.

    Most steps cannot hold a new one, as their coefficients say. Polynomials of low degree have few samples and are
    looked through, and so is a step of which only a part counts, which happens once. Those of high degree are smooth
    between their samples, and each of these that is lower, or higher, than its neighbours may have an extreme beside
    it: beyond the sample by less than they are on this side of it.
    """
    if c.shape[0] - 1 <= FEW_SAMPLES or since > 0.0:
        return looked_through(least, largest, c, j, since, last)
    before, here, bit, lower, higher = c[0, j], c[0, j], 1, 0, 0
    for i in range(nodes + 2):  # without branches: what a step holds cannot be guessed
        after = samples[i, j] if i < nodes else last
        beside = max(abs(here - before), abs(here - after))
        lower |= bit * ((here <= before) & (here <= after) & (here - beside < least))
        higher |= bit * ((here >= before) & (here >= after) & (here + beside > largest))
        before, here, bit = here, after, 2 * bit
    if lower | higher:
        return turned(least, largest, c, samples, nodes, j, last, lower, higher)
    return least, largest


@compiled
def looked_through(
    least: float, largest: float, c: FloatArray, j: int, since: float, last: float
) -> tuple[float, float]:
    """Do as :func:`widened` for any degree and any part of a step."""
    degree = c.shape[0] - 1
    reach = bend(c, degree, j)
    if not (least < min(c[0, j], last) - reach and max(c[0, j], last) + reach < largest):
        low, high = extremes(c, degree, j, since, last)
        least, largest = min(least, low), max(largest, high)
    return least, largest


@compiled
def turned(
    least: float,
    largest: float,
    c: FloatArray,
    samples: FloatArray,
    nodes: int,
    j: int,
    last: float,
    lower: int,
    higher: int,
) -> tuple[float, float]:
    """Return extremes that also cover unknown j near samples, those of the bits that are set."""
    for i in range(nodes + 2):
        here = c[0, j] if i == 0 else (samples[i - 1, j] if i <= nodes else last)
        if lower >> i & 1:
            least = min(least, here, turning_near(c, nodes, j, i, here, -1.0))
        if higher >> i & 1:
            largest = max(largest, here, turning_near(c, nodes, j, i, here, 1.0))
    return least, largest


@compiled
def turning_near(c: FloatArray, nodes: int, j: int, at: int, here: float, sense: float) -> float:
    """Extreme value of unknown j between the neighbours of sample ``at``, where it is ``here``.

    ``sense`` is 1 for a largest value, −1 for a least. At an end that the unknown comes to straight there is no other.
    """
    degree = c.shape[0] - 1
    if (at == 0 and sense * c[1, j] <= 0.0) or (at > nodes and sense * slope(c, degree, j, 1.0) >= 0.0):
        return here
    s = 0.0 if at == 0 else (1.0 if at > nodes else NODES[nodes, at - 1])
    low = 0.0 if at <= 1 else NODES[nodes, at - 2]
    high = 1.0 if at >= nodes else NODES[nodes, at]
    return turning_value(c, degree, j, s, low, high, here)
