"""Gauss nodes of a step, and extremes of polynomials over a run, found step by step from their values there."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.config.coordinates import MAX_NAMED_POINTS
from vibroplat.kernels.compiled import FloatArray, compiled, inlined, quick_call

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

#: Quantities that have extremes. The first ones have columns (:mod:`vibroplat.observe.peaks`); places without a name,
#: and quantities whose extremes are found otherwise, have no number there. Speeds occur twice, the second time since
#: the last change of the supply; the impulse is that of events. From POINTS on follow x and y of each named point, from
#: POINT_ACCELERATIONS on their accelerations. Integers of numpy, so that functions are compiled once.
POINT_ACCELERATIONS = 35
_PLACES: Any = np.arange(POINT_ACCELERATIONS)
SIDEWAYS, HEIGHT, ROTATION, OPENING, CONTACT_FORCE, DRIVEN_1, _, IMPULSE = _PLACES[:8]
PULL_X, PULL_Y, MOMENT, SPEED_1, _, TORQUE_1, _, LIFT, POINTS = _PLACES[8:17]
POWER_1, _, ACCELERATION = _PLACES[32:]
_SIZE = POINT_ACCELERATIONS + MAX_NAMED_POINTS

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
    """Make records before their first step; the gap is 0 unless a layer flies, an impulse without impacts."""
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
    """Merge the extremes of some records into one record; nan is no extreme.

    An extreme that exceeds the known one by round-off only was reached before: time and pace stay those of the first.
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


_merge = quick_call(merge)


class Equations(NamedTuple):
    """Where the equations are: addresses of :func:`vibroplat.hybrid.starts.start_callback` and of the parameters."""

    start: int
    parameters: int


class Span(NamedTuple):
    """A step or a part of it.

    When the step begins, how long it takes (s), and its polynomials; between which fractions of it the part is; the
    system of equations, how many nodes the part has, and where the equations are.
    """

    begin: float
    length: float
    c: FloatArray
    degree: int
    first: float
    last: float
    system: int
    nodes: int
    equations: Equations


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


@inlined
def place_of(i: int, span: Span) -> float:
    """Fraction of a step at sample i of a part of it: its beginning, its nodes, its end."""
    if 0 < i <= span.nodes:
        return span.first + (span.last - span.first) * NODES[span.nodes, i - 1]
    return span.first if i <= 0 else span.last


@inlined
def vertex(places: tuple[float, float, float], values: tuple[float, float, float]) -> float:
    """Place where the parabola through three values has its extreme; the middle one where there are only two."""
    low, s, high = places
    before, after = (values[1] - values[0]) * (high - s), (values[2] - values[1]) * (s - low)
    if not low < s < high or before == after:
        return s
    return 0.5 * (low + s + (high - low) * before / (before - after))
