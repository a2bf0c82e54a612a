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
#: One over the distances between beginning, nodes and end.
GAPS = np.zeros((MOST_NODES + 1, MOST_NODES + 1))
for _n in range(1, MOST_NODES + 1):
    GAPS[_n, : _n + 1] = 1.0 / np.diff([0.0, *NODES[_n, :_n], 1.0])

#: What has extremes, before three numbers of each named point: its x, y and the size of its acceleration. Speeds are
#: here twice, the second time since the supply has changed. Integers of numpy, so that functions are compiled once.
QUANTITIES = 18
_PLACES: Any = np.arange(QUANTITIES + 1)
HEIGHT, ROTATION, OPENING, FORCE, SIDEWAYS, SPEED_1, _, PULL_X, PULL_Y, MOMENT = _PLACES[:10]
TORQUE_1, _, POWER_1, _, LIFT, ACCELERATION, DRIVEN_1, _, POINTS = _PLACES[10:]
_SIZE = QUANTITIES + 3 * MOST_POINTS

#: Part of an extreme by which another has to go beyond it; less is round-off, as between turns of a periodic motion.
TIE = 1e-11

#: Extremes, when they were met (s), and how fast the exciters turned then, in the mean (rad/s); of accelerations the
#: largest squares of their polynomials; from when on the supply has held (s); whether any has changed.
PEAKS = np.dtype(
    [(f"{what}{end}", float, _SIZE) for what in ("", "at_", "pace_") for end in ("least", "largest")]
    + [("square", float, _SIZE), ("since", float), ("changed", np.int64)],
    align=True,
)


def no_peaks() -> Any:
    """Make a record of PEAKS before the first step; the gap is 0 unless a layer flies."""
    peaks = np.zeros(1, PEAKS)[0]
    peaks["least"], peaks["largest"], peaks["since"] = np.inf, -np.inf, np.nan
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
        peaks.pace_least[k], peaks.changed = pace(s, span), 1
    if found > peaks.largest[k]:
        peaks.largest[k], peaks.at_largest[k] = found, span.begin + s * span.length
        peaks.pace_largest[k], peaks.changed = pace(s, span), 1


@compiled
def pace(s: float, span: Span) -> float:
    """How fast the exciters turn at a fraction of a step, in the mean (rad/s)."""
    return 0.5 * (abs(value(span.c, span.degree, span.speed, s)) + abs(value(span.c, span.degree, span.speed + 1, s)))


@inlined
def margin(peaks: Any, k: int) -> float:
    """How far a value has to go beyond the extremes of a group to be a new one, of which quantity k is the largest."""
    size = max(abs(peaks.least[k]), abs(peaks.largest[k]))
    return TIE * size if size < np.inf else 0.0


@compiled
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
    beyond: float,
    sized: bool,
) -> None:
    """Let extremes k cover polynomial j in a step from fraction ``since`` of it, at whose end it is ``last``.

    Polynomials of low degree have few samples and are looked through, and so is a step of which only a part counts,
    which happens once. Of the others see :func:`vibroplat.kernels.lanes.reaching`.

    Parameters
    ----------
    peaks, k
        Record of :data:`PEAKS`, and the place of the quantity in it.
    c, degree
        Polynomials in the step's fraction, and their degree.
    samples, nodes
        Their values at so many Gauss nodes.
    j
        The column.
    since
        Fraction of the step from which it counts.
    last
        Value at the step's end.
    span
        The step: what is remembered has a time and a pace.
    beyond
        What does not go beyond the extremes by so much is none.
    sized
        Whether only the larger of both sizes matters.
    """
    least, largest = peaks.least[k] - beyond, peaks.largest[k] + beyond
    if sized:
        largest = max(largest, -least)
        least = -largest
    if degree <= FEW_SAMPLES or since > 0.0:
        looked_through(peaks, k, c, degree, j, since, last, span)
        return
    before, here, bit, lower, higher = c[0, j], c[0, j], 1, 0, 0
    for i in range(nodes + 2):
        after = samples[i, j] if i < nodes else last
        beside = max(abs(here - before), abs(here - after))
        lower |= bit * ((here <= before) & (here <= after) & (here - beside < least))
        higher |= bit * ((here >= before) & (here >= after) & (here + beside > largest))
        before, here, bit = here, after, 2 * bit
    if lower | higher:
        turned(peaks, k, c, degree, samples, nodes, j, last, lower, higher, span)


@compiled
def cover_form(
    peaks: Any,
    k: int,
    c: FloatArray,
    degree: int,
    room: Any,
    nodes: int,
    form: tuple[int, float, int, float],
    since: float,
    end: FloatArray,
    span: Span,
    beyond: float,
    sized: bool,
) -> None:
    """Do as :func:`cover` for a sum of two unknowns, a form: the first one's column and factor, then the second's.

    A force into the foundation is such a sum, of a coordinate and its rate, and so is a coordinate of a named point, of
    that of the centre of mass and the rotation. Its polynomial and samples are made where a step is searched, in the
    first columns of ``room.form`` and ``room.form_samples``, which are overwritten; the unknowns' samples at the nodes
    and at the end are in ``room`` and ``end``.
    """
    first, share, second, other = form
    for i in range(degree + 1):
        room.form[i, 0] = share * c[i, first] + other * c[i, second]
    for i in range(nodes):
        room.form_samples[i, 0] = share * room.samples[i, first] + other * room.samples[i, second]
    last = share * end[first] + other * end[second]
    cover(peaks, k, room.form, degree, room.form_samples, nodes, 0, since, last, span, beyond, sized)


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


@inlined
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
            here = sample(c, samples, nodes, last, i, j)
            around = sample(c, samples, nodes, last, max(i - 1, 0), j), sample(c, samples, nodes, last, i + 1, j)
            found, s = turning_near(c, degree, nodes, j, i, here, around, -1.0 if lower >> i & 1 else 1.0)
            remember(peaks, k, here, place_of(i, nodes), span)
            remember(peaks, k, found, s, span)


@inlined
def sample(c: FloatArray, samples: FloatArray, nodes: int, last: float, i: int, j: int) -> float:
    """Value of polynomial j at sample i: the step's beginning, its nodes, its end, where it is ``last``."""
    return c[0, j] if i == 0 else (samples[i - 1, j] if i <= nodes else last)


@inlined
def place_of(i: int, nodes: int) -> float:
    """Fraction of a step at sample i: its beginning, its nodes, its end."""
    return 0.0 if i <= 0 else (1.0 if i > nodes else NODES[nodes, i - 1])


@inlined
def turning_near(
    c: FloatArray, degree: int, nodes: int, j: int, at: int, here: float, around: tuple[float, float], sense: float
) -> tuple[float, float]:
    """Extreme value of polynomial j between the neighbours of sample ``at``, where it is ``here``, and its place.

    ``sense`` is 1 for a largest value, −1 for a least; looked for where the parabola through the three has its own. At
    an end that the polynomial comes to straight there is no other.
    """
    s, low, high = place_of(at, nodes), place_of(at - 1, nodes), place_of(at + 1, nodes)
    if (at == 0 and sense * c[1, j] <= 0.0) or (at > nodes and sense * slope(c, degree, j, 1.0) >= 0.0):
        return here, s
    return turning_point(c, degree, j, vertex((low, s, high), (around[0], here, around[1])), low, high, here)


@inlined
def vertex(places: tuple[float, float, float], found: tuple[float, float, float]) -> float:
    """Place where the parabola through three values has its extreme; the middle one where there are only two."""
    low, s, high = places
    before, after = (found[1] - found[0]) * (high - s), (found[2] - found[1]) * (s - low)
    if not low < s < high or before == after:
        return s
    return 0.5 * (low + s + (high - low) * before / (before - after))
