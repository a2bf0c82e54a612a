"""Gauss nodes of a step, and extremes of polynomials over a run, found step by step from their values there."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vibroplat.config.coordinates import MOST_POINTS
from vibroplat.kernels.compiled import FloatArray, compiled, inlined
from vibroplat.kernels.polynomial import bend, extremes, slope, turning_point, value

#: Degree of polynomials up to which there are too few samples of them to find extremes by.
FEW_SAMPLES = 8
#: Gauss nodes and weights on [0, 1], by their number.
MOST_NODES = 16
NODES, WEIGHTS = np.zeros((2, MOST_NODES + 1, MOST_NODES))
for _n in range(1, MOST_NODES + 1):
    _nodes, _weights = np.polynomial.legendre.leggauss(_n)
    NODES[_n, :_n], WEIGHTS[_n, :_n] = 0.5 + 0.5 * _nodes, 0.5 * _weights

#: What has extremes, before three numbers of each named point: its x, y and the size of its acceleration. Integers of
#: numpy, so that functions are compiled once for all.
QUANTITIES = 16
_PLACES: Any = np.arange(QUANTITIES + 1)
HEIGHT, ROTATION, OPENING, FORCE, SIDEWAYS, SPEED_1, _, PULL_X, PULL_Y, MOMENT = _PLACES[:10]
TORQUE_1, _, POWER_1, _, LIFT, ACCELERATION, POINTS = _PLACES[10:]
_SIZE = QUANTITIES + 3 * MOST_POINTS

#: Extremes, when they were met (s), and how fast the exciters turned then, in the mean (rad/s); of accelerations the
#: largest squares of their polynomials.
PEAKS = np.dtype(
    [(f"{what}{end}", float, _SIZE) for what in ("", "at_", "pace_") for end in ("least", "largest")]
    + [("square", float, _SIZE)],
    align=True,
)


def no_peaks() -> Any:
    """Make a record of PEAKS before the first step; the gap is 0 unless a layer flies."""
    peaks = np.zeros(1, PEAKS)[0]
    peaks["least"], peaks["largest"] = np.inf, -np.inf
    peaks["least"][OPENING] = peaks["largest"][OPENING] = 0.0
    return peaks


def widen_peaks(peaks: Any, other: Any) -> None:
    """Let the extremes, with when they are and at which pace, be those of another record too."""
    for end, sign in (("least", -1.0), ("largest", 1.0)):
        farther = sign * other[end] > sign * peaks[end]
        for name in (end, f"at_{end}", f"pace_{end}"):
            peaks[name] = np.where(farther, other[name], peaks[name])


class Span(NamedTuple):
    """A step: when it begins, how long it takes (s), its polynomials, and the column of the speed of exciter 1."""

    begin: float
    length: float
    c: FloatArray
    degree: int
    speed: int


@inlined
def remember(peaks: Any, k: int, found: float, s: float, span: Span) -> None:
    """Let extremes k cover a value at a fraction of a step."""
    if found < peaks.least[k]:
        peaks.least[k], peaks.at_least[k] = found, span.begin + s * span.length
        peaks.pace_least[k] = pace(s, span)
    if found > peaks.largest[k]:
        peaks.largest[k], peaks.at_largest[k] = found, span.begin + s * span.length
        peaks.pace_largest[k] = pace(s, span)


@compiled
def pace(s: float, span: Span) -> float:
    """How fast the exciters turn at a fraction of a step, in the mean (rad/s)."""
    return 0.5 * (abs(value(span.c, span.degree, span.speed, s)) + abs(value(span.c, span.degree, span.speed + 1, s)))


@inlined
def cover(
    peaks: Any,
    k: int,
    c: FloatArray,
    degree: int,
    samples: FloatArray,
    nodes: int,
    j: int,
    since: float,
    last: float,
    span: Span,
    fine: float,
    sized: bool,
) -> None:
    """Let extremes k cover polynomial j in a step from fraction ``since`` of it, at whose end it is ``last``.

    Most steps cannot hold a new one, as their coefficients say. Polynomials of low degree have few samples and are
    looked through, and so is a step of which only a part counts, which happens once. Those of high degree are smooth
    between their samples, and each of these that is lower, or higher, than its neighbours may have an extreme beside
    it: beyond the sample by less than they are on this side of it. One
    whose samples vary by no more than ``fine`` is not looked at more closely. ``sized``: only the larger of both sizes
    matters.
    """
    least, largest = peaks.least[k], peaks.largest[k]
    if sized:
        largest = max(largest, -least)
        least = -largest
    if degree <= FEW_SAMPLES or since > 0.0:
        looked_through(peaks, k, c, degree, j, since, last, span)
        return
    before, here, bit, lower, higher, most = c[0, j], c[0, j], 1, 0, 0, 0.0
    for i in range(nodes + 2):  # without branches: what a step holds cannot be guessed
        after = samples[i, j] if i < nodes else last
        beside = max(abs(here - before), abs(here - after))
        lower |= bit * ((here <= before) & (here <= after) & (here - beside < least))
        higher |= bit * ((here >= before) & (here >= after) & (here + beside > largest))
        before, here, bit, most = here, after, 2 * bit, max(most, beside)
    if most <= fine:
        remember(peaks, k, last, 1.0, span)
    elif lower | higher:
        turned(peaks, k, c, degree, samples, nodes, j, last, lower, higher, span)


@compiled
def looked_through(
    peaks: Any, k: int, c: FloatArray, degree: int, j: int, since: float, last: float, span: Span
) -> None:
    """Do as :func:`cover` for any degree and any part of a step."""
    reach = bend(c, degree, j)
    if not (peaks.least[k] < min(c[0, j], last) - reach and max(c[0, j], last) + reach < peaks.largest[k]):
        low, high, at_low, at_high = extremes(c, degree, j, since, last)
        remember(peaks, k, low, at_low, span)
        remember(peaks, k, high, at_high, span)


@compiled
def turned(
    peaks: Any,
    k: int,
    c: FloatArray,
    degree: int,
    samples: FloatArray,
    nodes: int,
    j: int,
    last: float,
    lower: int,
    higher: int,
    span: Span,
) -> None:
    """Let extremes k also cover the polynomial near samples, those of the bits that are set."""
    for i in range(nodes + 2):
        if (lower | higher) >> i & 1:
            here = c[0, j] if i == 0 else (samples[i - 1, j] if i <= nodes else last)
            found, s = turning_near(c, degree, nodes, j, i, here, -1.0 if lower >> i & 1 else 1.0)
            remember(peaks, k, here, place_of(i, nodes), span)
            remember(peaks, k, found, s, span)


@inlined
def place_of(i: int, nodes: int) -> float:
    """Fraction of a step at sample i: its beginning, its nodes, its end."""
    return 0.0 if i <= 0 else (1.0 if i > nodes else NODES[nodes, i - 1])


@compiled
def turning_near(
    c: FloatArray, degree: int, nodes: int, j: int, at: int, here: float, sense: float
) -> tuple[float, float]:
    """Extreme value of polynomial j between the neighbours of sample ``at``, where it is ``here``, and its place.

    ``sense`` is 1 for a largest value, −1 for a least. At an end that it comes to straight there is no other.
    """
    s = place_of(at, nodes)
    if (at == 0 and sense * c[1, j] <= 0.0) or (at > nodes and sense * slope(c, degree, j, 1.0) >= 0.0):
        return here, s
    return turning_point(c, degree, j, s, place_of(at - 1, nodes), place_of(at + 1, nodes), here)
