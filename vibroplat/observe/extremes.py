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

#: Part of the range of samples, by the number of nodes, by which a polynomial goes beyond all of them: three squares of
#: the longest distance of samples. A parabola goes one square beyond, sums of two oscillations and a straight line as
#: fast as the degree allows (3.2 rad in a step of 4 nodes, 4 of 6, 4.5 of more) two squares.
REACH = np.zeros(MAX_NODES + 1)
for _n in range(1, MAX_NODES + 1):
    REACH[_n] = 3.0 / GAPS[_n, : _n + 1].min() ** 2

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
    first = next(extremes for extremes in groups if extremes.size)[:1]
    merged = first.view(np.float64).copy().view(EXTREMES)[0]  # numpy copies numbers far faster than a record
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


#: A sum of two unknowns: column and factor of the first, then of the second. A force into the foundation is such a sum,
#: of a coordinate and its rate, and so is a coordinate of a named point.
Form = tuple[int, float, int, float]


@compiled
def update_extremes(
    extremes: Any, k: int, room: Any, nodes: int, form: Form, span: Span, beyond: float, sense: float
) -> None:
    """Let extremes k cover the largest values of a form in a part of a step, or the least.

    Samples that are larger than their neighbours, and may have a new extreme beside them, are searched: beyond the
    sample the form goes by less than they are on this side. Polynomials of low degree have few samples and are looked
    through.

    Parameters
    ----------
    extremes, k
        Record of :data:`EXTREMES`, and the place of the quantity in it.
    room, nodes
        Record of :data:`vibroplat.observe.statistics.ROOM` with the unknowns at so many Gauss nodes of the part; its
        form is overwritten.
    form
        The form of unknowns; one unknown is a form whose second factor is 0.
    span
        The part: what is remembered has a time and a pace.
    beyond
        What does not go beyond the extremes by so much is none.
    sense
        1 for the largest values, −1 for the least.
    """
    (first, share, second, other), samples, few = form, room.form_samples, span.degree <= FEW_SAMPLES
    known = (extremes.largest[k] if sense > 0.0 else -extremes.least[k]) + beyond
    one, two = sense * share, sense * other
    samples[0] = one * span.start[first] + two * span.start[second]
    for i in range(nodes):
        samples[i + 1] = one * room.samples[i, first] + two * room.samples[i, second]
    samples[nodes + 1] = one * span.end[first] + two * span.end[second]
    before, bit, near = samples[0], 1, 0
    for i in range(nodes + 2):
        here, after = samples[i], samples[min(i + 1, nodes + 1)]
        near |= bit * ((here >= before) & (here >= after) & (here + max(here - before, here - after) > known))
        before, bit = here, 2 * bit
    if not (near or few):
        return
    for i in range(span.degree + 1):
        room.form[i, 0] = one * span.c[i, first] + two * span.c[i, second]
    if few:
        search_range(extremes, k, room.form, (samples[0], samples[nodes + 1]), span, sense)
        return
    for i in range(nodes + 2):
        if near >> i & 1:
            extreme, s = extreme_near(room.form, nodes, i, samples, span)
            remember(extremes, k, sense * samples[i], place_of(i, nodes, span), span)
            remember(extremes, k, sense * extreme, s, span)


@compiled
def search_range(extremes: Any, k: int, c: FloatArray, ends: tuple[float, float], span: Span, sense: float) -> None:
    """Let extremes k cover ``sense`` times a polynomial of any degree, with its values at both ends of a part."""
    reach, known = chord_deviation_bound(c, span.degree, 0), extremes.largest[k] if sense > 0.0 else -extremes.least[k]
    if not max(ends) + reach < known:
        _, high, _, at_high = value_range(c, span.degree, 0, span.first, span.last, ends)
        remember(extremes, k, sense * high, at_high, span)


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
def extreme_near(c: FloatArray, nodes: int, at: int, samples: FloatArray, span: Span) -> tuple[float, float]:
    """Largest value of a polynomial between the neighbours of sample ``at``, and its place.

    It is looked for where the parabola through the three samples has its own. At an end that the polynomial comes to
    straight there is no other.
    """
    here, s = samples[at], place_of(at, nodes, span)
    leaving = slope(c, span.degree, 0, s) if at == 0 or at > nodes else 0.0
    if (at == 0 and leaving <= 0.0) or (at > nodes and leaving >= 0.0):
        return here, s
    low, high = place_of(at - 1, nodes, span), place_of(at + 1, nodes, span)
    around = samples[max(at - 1, 0)], here, samples[min(at + 1, nodes + 1)]
    return turning_point(c, span.degree, 0, vertex((low, s, high), around), low, high, here)


@inlined
def vertex(places: tuple[float, float, float], values: tuple[float, float, float]) -> float:
    """Place where the parabola through three values has its extreme; the middle one where there are only two."""
    low, s, high = places
    before, after = (values[1] - values[0]) * (high - s), (values[2] - values[1]) * (s - low)
    if not low < s < high or before == after:
        return s
    return 0.5 * (low + s + (high - low) * before / (before - after))
