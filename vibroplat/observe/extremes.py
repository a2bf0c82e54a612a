"""Gauss nodes of a step, and extremes of polynomials over a run, found step by step from their values there."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.config.coordinates import MAX_NAMED_POINTS
from vibroplat.kernels.compiled import FloatArray, compiled, inlined, same_types
from vibroplat.kernels.polynomial import chord_deviation_bound, slope, turning_point, value_range

#: Degree of polynomials up to which there are too few samples of them to find extremes by.
FEW_SAMPLES = 8
#: Gauss nodes and weights on [0, 1], by their number.
MAX_NODES = 16
NODES, WEIGHTS = np.zeros((2, MAX_NODES + 1, MAX_NODES))
for _n in range(1, MAX_NODES + 1):
    _nodes, _weights = np.polynomial.legendre.leggauss(_n)
    NODES[_n, :_n], WEIGHTS[_n, :_n] = 0.5 + 0.5 * _nodes, 0.5 * _weights
#: One over the distances between beginning, nodes and end.
GAPS = np.zeros((MAX_NODES + 1, MAX_NODES + 1))
for _n in range(1, MAX_NODES + 1):
    GAPS[_n, : _n + 1] = 1.0 / np.diff([0.0, *NODES[_n, :_n], 1.0])

#: What has extremes, before three numbers of each named point: its x, y and the size of its acceleration. Speeds are
#: here twice, the second time since the supply has changed; the impulse is that of events. Integers of numpy, so that
#: functions are compiled once.
QUANTITIES = 19
_PLACES: Any = np.arange(QUANTITIES + 1)
HEIGHT, ROTATION, OPENING, FORCE, SIDEWAYS, SPEED_1, _, PULL_X, PULL_Y, MOMENT = _PLACES[:10]
TORQUE_1, _, POWER_1, _, LIFT, ACCELERATION, DRIVEN_1, _, IMPULSE, POINTS = _PLACES[10:]
_SIZE = QUANTITIES + 3 * MAX_NAMED_POINTS

#: Relative amount by which a value must exceed an extreme to replace it; smaller differences are round-off.
TIE = 1e-11

#: Extremes, when they were first met (s), and the mean speed of both exciters over the turn around that (rad/s), once
#: that is complete; of accelerations the largest squares of their polynomials; from when on the supply has held (s);
#: whether any has changed; when the last new one was met (s).
EXTREMES = np.dtype(
    [(f"{what}{end}", float, _SIZE) for what in ("", "at_", "pace_") for end in ("least", "largest")]
    + [("square", float, _SIZE), ("since", float), ("changed", np.int64), ("latest", float)],
    align=True,
)


def empty_extremes(count: int) -> npt.NDArray[np.void]:
    """Make records of PEAKS before their first step; the gap is 0 unless a layer flies, an impulse without impacts."""
    extremes = np.zeros(count, EXTREMES)
    extremes["least"], extremes["largest"], extremes["since"], extremes["latest"] = np.inf, -np.inf, np.nan, -np.inf
    for quantity in (OPENING, IMPULSE):
        extremes["least"][:, quantity] = extremes["largest"][:, quantity] = 0.0
    return extremes


def merge_extremes(*groups: npt.NDArray[np.void]) -> Any:
    """Return the extremes over all of some records, with when they are and at which pace: one record."""
    merged = next(extremes[0] for extremes in groups if extremes.size).copy()
    for extremes in groups:
        _merge(extremes, merged)
    return merged


@compiled
def merge(extremes: Any, merged: Any) -> None:
    """Let a record have the extremes of some records where these go beyond its own; nan is no extreme.

    One that goes beyond it by round-off was reached before: its time and pace stay those of the first.
    """
    for row in range(extremes.size):
        other = extremes[row]
        for k in range(_SIZE):
            beyond = margin(merged, k)
            if other.least[k] < merged.least[k] - beyond:
                merged.at_least[k], merged.pace_least[k] = other.at_least[k], other.pace_least[k]
            if other.largest[k] > merged.largest[k] + beyond:
                merged.at_largest[k], merged.pace_largest[k] = other.at_largest[k], other.pace_largest[k]
            merged.least[k] = min(merged.least[k], other.least[k])
            merged.largest[k] = max(merged.largest[k], other.largest[k])


_merge = same_types(merge)


class Span(NamedTuple):
    """A step or a part of it.

    When the step begins, how long it takes (s), and its polynomials; between which fractions of it the part is, and the
    unknowns at its beginning and end.
    """

    begin: float
    length: float
    c: FloatArray
    degree: int
    first: float
    last: float
    start: FloatArray
    end: FloatArray


@inlined
def remember(extremes: Any, k: int, value: float, s: float, span: Span) -> None:
    """Let extremes k cover a value at a fraction of a step."""
    at = span.begin + s * span.length
    if value < extremes.least[k]:
        extremes.least[k], extremes.at_least[k], extremes.latest, extremes.changed = value, at, at, 1
    if value > extremes.largest[k]:
        extremes.largest[k], extremes.at_largest[k], extremes.latest, extremes.changed = value, at, at, 1


@compiled
def pace(since: FloatArray, until: FloatArray) -> float:
    """Mean speed of both exciters between two marks, each a time (s) and both angles with all turns (rad/s).

    An exciter that swings comes back to where it was: it has no mean speed.
    """
    return 0.5 * (abs(until[1] - since[1]) + abs(until[2] - since[2])) / (until[0] - since[0])


@compiled
def set_pace(extremes: Any, since: FloatArray, until: FloatArray) -> None:
    """Give the extremes that were met between two marks their pace."""
    if extremes.latest < since[0]:
        return
    speed = pace(since, until)
    for k in range(_SIZE):
        if since[0] <= extremes.at_least[k] <= until[0]:
            extremes.pace_least[k] = speed
        if since[0] <= extremes.at_largest[k] <= until[0]:
            extremes.pace_largest[k] = speed


@inlined
def margin(extremes: Any, k: int) -> float:
    """How far a value has to go beyond the extremes of a group to be a new one, of which quantity k is the largest."""
    size = max(abs(extremes.least[k]), abs(extremes.largest[k]))
    return TIE * size if size < np.inf else 0.0


@compiled
def update_extremes(
    extremes: Any,
    k: int,
    c: FloatArray,
    degree: int,
    samples: FloatArray,
    nodes: int,
    j: int,
    ends: tuple[float, float],
    span: Span,
    beyond: float,
    sized: bool,
) -> None:
    """Let extremes k cover polynomial j in a part of a step.

    Polynomials of low degree have few samples and are looked through. Of the others see
    :func:`vibroplat.kernels.lanes.exceeds_limits`.

    Parameters
    ----------
    extremes, k
        Record of :data:`EXTREMES`, and the place of the quantity in it.
    c, degree
        Polynomials in the step's fraction, and their degree.
    samples, nodes
        Their values at so many Gauss nodes of the part.
    j
        The column.
    ends
        Values at both ends of the part.
    span
        The part: what is remembered has a time and a pace.
    beyond
        What does not go beyond the extremes by so much is none.
    sized
        Whether only the larger of both sizes matters.
    """
    least, largest = extremes.least[k] - beyond, extremes.largest[k] + beyond
    if sized:
        largest = max(largest, -least)
        least = -largest
    if degree <= FEW_SAMPLES:
        search_range(extremes, k, c, degree, j, ends, span)
        return
    before, here, bit, lower, higher = ends[0], ends[0], 1, 0, 0
    for i in range(nodes + 2):
        after = samples[i, j] if i < nodes else ends[1]
        beside = max(abs(here - before), abs(here - after))
        lower |= bit * ((here <= before) & (here <= after) & (here - beside < least))
        higher |= bit * ((here >= before) & (here >= after) & (here + beside > largest))
        before, here, bit = here, after, 2 * bit
    if lower | higher:
        search_samples(extremes, k, c, degree, samples, nodes, j, ends, lower, higher, span)


@compiled
def update_form_extremes(
    extremes: Any,
    k: int,
    room: Any,
    nodes: int,
    form: tuple[int, float, int, float],
    span: Span,
    beyond: float,
    sized: bool,
) -> None:
    """Do as :func:`update_extremes` for a sum of two unknowns, a form: column and factor of the first, then the second.

    A force into the foundation is such a sum, of a coordinate and its rate, and so is a coordinate of a named point, of
    that of the centre of mass and the rotation. Its polynomial and samples are made where a step is searched, in the
    first columns of ``room.form`` and ``room.form_samples``, which are overwritten; the unknowns' samples at the nodes
    are in ``room``.
    """
    c, degree, (first, share, second, other) = span.c, span.degree, form
    for i in range(degree + 1):
        room.form[i, 0] = share * c[i, first] + other * c[i, second]
    for i in range(nodes):
        room.form_samples[i, 0] = share * room.samples[i, first] + other * room.samples[i, second]
    ends = share * span.start[first] + other * span.start[second], share * span.end[first] + other * span.end[second]
    update_extremes(extremes, k, room.form, degree, room.form_samples, nodes, 0, ends, span, beyond, sized)


@compiled
def search_range(
    extremes: Any, k: int, c: FloatArray, degree: int, j: int, ends: tuple[float, float], span: Span
) -> None:
    """Do as :func:`update_extremes` for any degree."""
    reach = chord_deviation_bound(c, degree, j)
    if not (extremes.least[k] < min(ends) - reach and max(ends) + reach < extremes.largest[k]):
        low, high, at_low, at_high = value_range(c, degree, j, span.first, span.last, ends)
        remember(extremes, k, low, at_low, span)
        remember(extremes, k, high, at_high, span)


@inlined
def search_samples(
    extremes: Any,
    k: int,
    c: FloatArray,
    degree: int,
    samples: FloatArray,
    nodes: int,
    j: int,
    ends: tuple[float, float],
    lower: int,
    higher: int,
    span: Span,
) -> None:
    """Let extremes k also cover the polynomial near samples, those of the bits that are set."""
    for i in range(nodes + 2):
        if (lower | higher) >> i & 1:
            here = sample(samples, nodes, ends, i, j)
            around = sample(samples, nodes, ends, max(i - 1, 0), j), sample(samples, nodes, ends, i + 1, j)
            extreme, s = extreme_near(c, degree, nodes, j, i, here, around, -1.0 if lower >> i & 1 else 1.0, span)
            remember(extremes, k, here, place_of(i, nodes, span), span)
            remember(extremes, k, extreme, s, span)


@inlined
def sample(samples: FloatArray, nodes: int, ends: tuple[float, float], i: int, j: int) -> float:
    """Value of polynomial j at sample i of a part of a step: its beginning, its nodes, its end."""
    return ends[0] if i == 0 else (samples[i - 1, j] if i <= nodes else ends[1])


@inlined
def place_of(i: int, nodes: int, span: Span) -> float:
    """Fraction of a step at sample i of a part of it: its beginning, its nodes, its end."""
    if 0 < i <= nodes:
        return span.first + (span.last - span.first) * NODES[nodes, i - 1]
    return span.first if i <= 0 else span.last


@inlined
def extreme_near(
    c: FloatArray,
    degree: int,
    nodes: int,
    j: int,
    at: int,
    here: float,
    around: tuple[float, float],
    sense: float,
    span: Span,
) -> tuple[float, float]:
    """Extreme value of polynomial j between the neighbours of sample ``at``, where it is ``here``, and its place.

    ``sense`` is 1 for a largest value, −1 for a least; looked for where the parabola through the three has its own. At
    an end that the polynomial comes to straight there is no other.
    """
    s, low, high = place_of(at, nodes, span), place_of(at - 1, nodes, span), place_of(at + 1, nodes, span)
    leaving = sense * slope(c, degree, j, s) if at == 0 or at > nodes else 0.0
    if (at == 0 and leaving <= 0.0) or (at > nodes and leaving >= 0.0):
        return here, s
    return turning_point(c, degree, j, vertex((low, s, high), (around[0], here, around[1])), low, high, here)


@inlined
def vertex(places: tuple[float, float, float], values: tuple[float, float, float]) -> float:
    """Place where the parabola through three values has its extreme; the middle one where there are only two."""
    low, s, high = places
    before, after = (values[1] - values[0]) * (high - s), (values[2] - values[1]) * (s - low)
    if not low < s < high or before == after:
        return s
    return 0.5 * (low + s + (high - low) * before / (before - after))
