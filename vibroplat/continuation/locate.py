"""Special points of branches: which there are between two points, and where exactly.

All but branch points are found by :func:`locate`: orbits are corrected with a border, {F(u) = 0, d·u = s}, and the zero
of a test function is sought over s. At a discontinuity the function does not exist beyond the zero, which is then
extrapolated from one side.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.continuation.arclength import Branch, predict
from vibroplat.continuation.newton import NoConvergenceError, length_of
from vibroplat.continuation.special_points import (
    BRANCH_POINT,
    DOUBLING,
    FOLD,
    NEIMARK_SACKER,
    ONE_SIDED,
    SMOOTH,
    OrbitPoint,
    SpecialPoint,
    Test,
    approaching_event,
    branch_point,
)
from vibroplat.kernels.compiled import FloatArray
from vibroplat.shooting.multipliers import lost

#: Most evaluations between two points, and from one side.
MAX_EVALUATIONS, MAX_SIDED = 12, 12
#: One-sided search: each step covers the fraction APPROACH of the way to the extrapolated zero. The search ends at the
#: distance ZERO_DISTANCE (units of the unknowns) from it; the zero is then extrapolated through the last SIDES points,
#: whose distances are about 1, 20, 400, … times ZERO_DISTANCE. The function is taken to be linear up to the fraction
#: LINEAR.
APPROACH, ZERO_DISTANCE, SIDES, LINEAR = 0.95, 1e-6, 4, 0.9
#: What an evaluation from one side that has failed is shortened to, the least length of the first, and that of all,
#: over the distance at which the search ends.
RETRY_RATIO, MIN_FIRST_STEP, MIN_STEP_RATIO = 0.4, 1e-4, 0.1
#: Distance of a known orbit from the zero at which it is interpolated; nearer to a branch point than the second, an
#: orbit cannot be told from those of the branch that crosses.
INTERPOLATION_DISTANCE, BRANCH_POINT_DISTANCE = 1e-4, 1e-3
#: How far beside a point that cannot be found others are tried, as a part of the way.
TRIAL_OFFSETS = (0.0, 0.1, -0.1, 0.2, -0.2)
#: How far beyond a discontinuity an orbit with the events of the far side is searched for, as a part of the way.
FAR_SIDE_OFFSET = 0.01
#: How often an interval in which the key seems to turn back and forth, or more happens than is seen, is divided.
MAX_DEPTH = 3
#: How often an interval is halved in which the events change in a way that is not known yet.
MAX_HALVINGS = 5


class TrialOrbit(NamedTuple):
    """An orbit at a distance along a line, and the value of a test function there."""

    distance: float
    value: float
    point: OrbitPoint


#: Finds the orbit at a place, given those that are known and the width of the interval that holds the zero.
At = Callable[[float, Sequence[TrialOrbit], float], OrbitPoint]


class TwoSidedSearch:
    """How a zero is sought of a function that exists on both sides of it."""

    #: Orbits that must be known before the search ends.
    least = 2

    def root(self, known: Sequence[TrialOrbit]) -> float:
        """Where the inverse polynomial through the last three is zero; in the middle of an interval that it leaves."""
        root = inverse_zero([k.distance for k in known[-3:]], [k.value for k in known[-3:]])
        last, other = known[-1].distance, _other_side(known)
        if other is None or min(last, other) <= root <= max(last, other):
            return root
        return 0.5 * (last + other)

    def step(self, known: Sequence[TrialOrbit], root: float, close: float) -> float:
        """Where to look next, from the last orbit."""
        return root - known[-1].distance

    def take(self, known: list[TrialOrbit], trial: TrialOrbit) -> bool:
        """Add an orbit to those that are known, if it serves; return whether it does."""
        known.append(trial)
        return True


class OneSidedSearch(TwoSidedSearch):
    """The same of a function that does not exist beyond the zero, and is positive on this side.

    ``fraction`` is the part of the way to the extrapolated zero that each step goes.
    """

    least = 3

    def __init__(self, fraction: float) -> None:
        self.fraction = fraction

    def root(self, known: Sequence[TrialOrbit]) -> float:
        """Where the function is zero, as extrapolated."""
        return float(extrapolate(known, [k.distance for k in known]))

    def step(self, known: Sequence[TrialOrbit], root: float, close: float) -> float:
        """Where to look next, from the last orbit; on this side of it while two do not tell how the function falls."""
        step = self.fraction * (root - known[-1].distance)
        if len(known) == 2 and abs(step) < close:
            return 0.5 * (known[-2].distance - known[-1].distance)
        return step

    def take(self, known: list[TrialOrbit], trial: TrialOrbit) -> bool:
        """Add an orbit, the nearest to the zero last, if its value lies between the largest known one and zero."""
        if not 0.0 < trial.value < (known[0].value if len(known) > 1 else math.inf):
            return False
        known.append(trial)
        known.sort(key=lambda k: -k.value)
        return True


def locate(
    at: At,
    test: Test,
    known: list[TrialOrbit],
    close: float,
    sides: TwoSidedSearch,
    *,
    step: float = 0.0,
    most: int = MAX_EVALUATIONS,
    reach: float = math.inf,
) -> float:
    """Find the place of a zero of a test function on a line of orbits.

    Parameters
    ----------
    at, test
        Find orbits, or raise NoConvergenceError; and the function.
    known
        One orbit, from which the first step is made, or several; those that are found are added.
    close
        Distance of a known orbit from the zero at which the search ends; it also ends, with what is known, where no
        more orbits are found.
    sides
        On which sides of the zero the function exists.
    most, reach
        Number of known orbits beyond which the search ends, as after twice as many trials; farthest place of a zero.

    Raises
    ------
    NoConvergenceError
        There are not even two orbits, or the function has no zero within reach.
    """
    tries, root = 0, math.nan
    while True:
        if len(known) > 1:
            root = sides.root(known)
            near = len(known) >= sides.least and min(abs(k.distance - root) for k in known) < close
            if near or len(known) > most or tries == 2 * most:
                return root
            if abs(root) > reach:
                raise NoConvergenceError("the test function has no zero nearby")
            step = sides.step(known, root, close)
        for distance, width in itertools.islice(_trials(known, step, close), 2 * most - tries):
            tries += 1
            try:
                point = at(distance, known, width)
            except NoConvergenceError:
                continue
            if sides.take(known, TrialOrbit(distance, test(point), point)):
                break
        else:
            if len(known) < 2:
                raise NoConvergenceError("no orbit beside the special point")
            return root


def _trials(known: Sequence[TrialOrbit], step: float, close: float) -> Iterator[tuple[float, float]]:
    """Yield places a step away, one after the other until an orbit is found, and widths of the interval around.

    The tangent at a discontinuity does not tell on which side it is: the first step is tried both ways.
    """
    last, other = known[-1].distance, _other_side(known)
    if other is not None:
        low, high = sorted((last, other))
        distances = [last + step + offset * (high - low) for offset in TRIAL_OFFSETS]
        yield from ((distance, high - low) for distance in distances if low < distance < high)
        return
    while abs(step) >= MIN_STEP_RATIO * close:
        yield last + step, abs(step)
        step *= RETRY_RATIO if len(known) > 1 else -RETRY_RATIO


def _other_side(known: Sequence[TrialOrbit]) -> float | None:
    """Place of the latest whose value has not the sign of the last; None if there is none."""
    return next((k.distance for k in reversed(known[:-1]) if k.value * known[-1].value <= 0.0), None)


def extrapolate(known: Sequence[TrialOrbit], results: npt.ArrayLike) -> FloatArray:
    """Extrapolate what was found at the last places to the zero of a test function that is known on one side only.

    By a polynomial in the function. As it may fall linearly, or as a root where the orbits' slope grows without bounds,
    the polynomial has a linear term only where that makes up most of the way.
    """
    last, there = known[-SIDES:], np.asarray(results, dtype=float)[-SIDES:]
    values = np.array([k.value for k in last]) / last[-1].value
    if len(set(values.tolist())) < len(last):
        raise NoConvergenceError("the test function has no zero nearby")
    places, powers = np.array([k.distance for k in last]), np.arange(len(last))
    terms = values[:, np.newaxis] ** powers
    zero, linear = np.linalg.solve(terms, places)[:2]
    if len(last) < 3 or not 0.0 < LINEAR * (places[-1] - zero) / linear < 1.0:
        terms = values[:, np.newaxis] ** (powers + (powers > 0))
    return np.asarray(np.linalg.solve(terms, there)[0])


def inverse_zero(places: Sequence[float], values: Sequence[float]) -> float:
    """Zero of the inverse polynomial through some places and values; raises NoConvergenceError if values are equal."""
    if len(set(values)) < len(values):
        raise NoConvergenceError("the test function has no zero nearby")
    weights = [math.prod(-g / (f - g) for g in values if g != f) for f in values]
    return float(np.dot(places, weights))


def find_special_points(
    branch: Branch, before: OrbitPoint, after: OrbitPoint, *, strictly: bool = False, depth: int = 0
) -> Iterator[SpecialPoint]:
    """Find the special points between two neighbouring points in one chart, in the order of the branch.

    Where the sequence of events changes, multipliers may jump and the branch may have a corner: its parts on both sides
    are evaluated one by one.

    Raises
    ------
    NoConvergenceError
        The place where the sequence changes cannot be found, and this is asked for ``strictly``.
    """
    if before.event_sequence == after.event_sequence:
        yield from _smooth(branch, before, after)
        return
    there = find_discontinuity(branch, before, after)
    if there is None:
        # nearer to an impact that begins or ends, its distance is known
        middle = _between(branch, before, after, 0.5) if depth < MAX_HALVINGS else None
        if middle is not None:
            yield from find_special_points(branch, before, middle, strictly=strictly, depth=depth + 1)
            yield from find_special_points(branch, middle, after, strictly=strictly, depth=depth + 1)
        elif strictly:
            raise NoConvergenceError("the sequence of events changes at an unknown place")
        elif before.along_key * after.along_key < 0.0:
            yield _locate_zero(branch, before, after, FOLD)
        return
    forth = there.point.event_sequence == before.event_sequence
    near, far = (before, after) if forth else (after, before)
    parts = [_smooth(branch, near, there.point, forth=forth), iter([there])]
    beyond = _beyond(branch, there.point, far, forth)
    if beyond is not None:
        if there.point.along_key * beyond.along_key < 0.0:
            parts.append(iter([_fold_beside(branch, there, beyond, forth)]))
        parts.append(_smooth(branch, beyond, far, forth=forth))
    for part in parts if forth else reversed(parts):
        yield from part


def _between(branch: Branch, near: OrbitPoint, far: OrbitPoint, part: float, forth: bool = True) -> OrbitPoint | None:
    """Find an orbit between two, at a part of the way; None if there is none."""
    chord = (far.u - near.u) * (1.0 if forth else -1.0)
    whole = length_of(chord)
    try:
        return branch.between([near, far], near, chord / whole, (part if forth else -part) * whole, whole)
    except NoConvergenceError:
        return None


def _beyond(branch: Branch, last: OrbitPoint, far: OrbitPoint, forth: bool) -> OrbitPoint | None:
    """Find an orbit next to a discontinuity that has the events of the far side."""
    point = _between(branch, last, far, FAR_SIDE_OFFSET, forth)
    return point if point is not None and point.event_sequence == far.event_sequence else None


def _fold_beside(branch: Branch, there: SpecialPoint, beyond: OrbitPoint, forth: bool) -> SpecialPoint:
    """Find the fold between a discontinuity and an orbit next to it."""
    nearer = _beyond(branch, there.point, beyond, forth)
    if nearer is not None and nearer.along_key * beyond.along_key < 0.0:
        return _locate_zero(branch, *((nearer, beyond) if forth else (beyond, nearer)), FOLD)
    return SpecialPoint(FOLD, there.point, there.value, there.direction)


def _smooth(
    branch: Branch, before: OrbitPoint, after: OrbitPoint, depth: int = 0, *, forth: bool = True
) -> Iterator[SpecialPoint]:
    """Find the special points between two points with the same sequence of events, given in the order of the branch.

    If not ``forth``, they are given the other way round.
    """
    if not forth:
        before, after = after, before
    part, passed = find_turns(before, after), _sign_changes(before, after)
    one, other = before.multipliers, after.multipliers
    if part is None and (_has_unexplained_change(before, after, passed) or lost(one, other) or lost(other, one)):
        part = 0.5
    if part is not None and depth < MAX_DEPTH:
        middle = _between(branch, before, after, part)
        if middle is not None and middle.event_sequence == before.event_sequence:
            yield from _smooth(branch, before, middle, depth + 1)
            yield from _smooth(branch, middle, after, depth + 1)
            return
    if passed[BRANCH_POINT]:  # where this branch bends, it has a fold as well
        yield _locate_branch_point(branch, before, after)
    elif passed[FOLD]:
        yield _locate_zero(branch, before, after, FOLD)
    if passed[DOUBLING]:
        yield _locate_zero(branch, before, after, DOUBLING)
    if passed[NEIMARK_SACKER] and (before.stability.complex_pair or after.stability.complex_pair):
        special = _locate_zero(branch, before, after, NEIMARK_SACKER)
        if special.point.stability.complex_pair:
            yield special


def _sign_changes(before: OrbitPoint, after: OrbitPoint) -> dict[str, bool]:
    """Whether the test function of each kind changes its sign between two points."""
    return {kind: test(before) * test(after) < 0.0 for kind, test in SMOOTH.items()}


def _has_unexplained_change(before: OrbitPoint, after: OrbitPoint, passed: Mapping[str, bool]) -> bool:
    """Whether multipliers have left the unit circle, or entered it, where no test function has changed its sign."""
    explained = passed[FOLD] or passed[BRANCH_POINT], passed[NEIMARK_SACKER], passed[DOUBLING]
    pairs = zip(before.stability.outside, after.stability.outside, explained, strict=True)
    return any(one != other and not known for one, other, known in pairs)


def find_turns(before: OrbitPoint, after: OrbitPoint) -> float | None:
    """Return where the key turns back and forth between two points, as a part of the way; None if it does not.

    By the cubic through both with their tangents, whose slope is a parabola.
    """
    chord = after.u - before.u
    one, other = (p.along_key / float(p.tangent @ chord) for p in (before, after))
    mean = float(chord[-1]) / float(chord @ chord)
    bend, bow = -4.0 * one - 2.0 * other + 6.0 * mean, 3.0 * one + 3.0 * other - 6.0 * mean
    if one * other <= 0.0 or bow == 0.0 or not 0.0 < -0.5 * bend / bow < 1.0:
        return None
    part = -0.5 * bend / bow
    return part if one * (one + 0.5 * bend * part) < 0.0 else None


def _locate_zero(branch: Branch, before: OrbitPoint, after: OrbitPoint, kind: str) -> SpecialPoint:
    """Find the zero of the test function of a kind between two points."""
    chord, test = after.u - before.u, SMOOTH[kind]
    whole = length_of(chord)
    direction = chord / whole
    enough = INTERPOLATION_DISTANCE if kind != BRANCH_POINT else BRANCH_POINT_DISTANCE
    known = [TrialOrbit(0.0, test(before), before), TrialOrbit(whole, test(after), after)]

    def at(distance: float, known: Sequence[TrialOrbit], width: float) -> OrbitPoint:
        nearest = [k.point for k in sorted(known, key=lambda k: abs(k.distance - distance))]
        return branch.between(nearest, before, direction, distance, width)

    root = locate(at, test, known, enough, TwoSidedSearch())
    near = min(known, key=lambda k: abs(k.distance - root))
    clear = [k for k in known if kind != BRANCH_POINT or abs(k.distance - root) > enough] or known[:2]
    points = [k.point for k in sorted(clear, key=lambda k: abs(k.distance - root))]
    there, here = (predict(points, before.u, direction, distance)[0] for distance in (root, near.distance))
    point = replace(near.point, u=near.point.u + near.point.newton_step(direction) + there - here)
    return SpecialPoint(kind, point, point.value, direction)


def _locate_branch_point(branch: Branch, before: OrbitPoint, after: OrbitPoint) -> SpecialPoint:
    """Find the branch point between two points; if that fails, by the determinant, which is known less exactly."""
    chord = after.u - before.u
    whole = length_of(chord)
    direction = chord / whole
    fraction = before.branching / (before.branching - after.branching)
    nearest = (before, after) if fraction < 0.5 else (after, before)
    u, jacobian = predict(nearest, before.u, direction, fraction * whole)
    try:
        result, ways = branch_point(branch.problem, before.chart, u, jacobian)
        if not 0.0 < (result.u - before.u) @ direction < whole:
            raise NoConvergenceError("it lies elsewhere")
    except NoConvergenceError:
        rough = _locate_zero(branch, before, after, BRANCH_POINT)
        null = np.linalg.svd(rough.point.jacobian)[2][-2:]
        along = null @ direction
        across = null.T @ np.array([-along[1], along[0]])
        return replace(rough, across=across / np.linalg.norm(across))
    across, along = sorted(ways, key=lambda way: abs(float(way @ direction)))
    point = OrbitPoint.of(result, along if along @ direction > 0.0 else -along)
    mirrors = before.along_key * after.along_key < 0.0  # a pitchfork
    if branch.problem.repeats_after_half(point):
        return SpecialPoint(DOUBLING, point, point.value, direction, mirrors=mirrors)
    return SpecialPoint(BRANCH_POINT, point, point.value, direction, across, mirrors)


def find_discontinuity(branch: Branch, before: OrbitPoint, after: OrbitPoint) -> SpecialPoint | None:
    """Find where the sequence of events changes between two points, from the side that knows how far it is."""
    for near, far in ((before, after), (after, before)):
        kind = approaching_event(near, far)
        if kind is None or not 0.0 < ONE_SIDED[kind](near) < math.inf:
            continue
        known = [TrialOrbit(0.0, ONE_SIDED[kind](near), near)]

        def at(distance: float, known: Sequence[TrialOrbit], width: float) -> OrbitPoint:
            last, *others = reversed(known)
            point = branch.step_from(last.point, distance - last.distance, [k.point for k in others])
            if point.event_sequence != last.point.event_sequence:
                raise NoConvergenceError("beyond the discontinuity")
            return point

        whole = float((far.u - near.u) @ near.tangent)
        step = math.copysign(max(0.5 * abs(whole), MIN_FIRST_STEP), whole)
        try:
            locate(at, ONE_SIDED[kind], known, ZERO_DISTANCE, OneSidedSearch(APPROACH), step=step, most=MAX_SIDED)
            u = extrapolate(known, [k.point.u + k.point.newton_step(near.tangent) for k in known])
        except NoConvergenceError:
            continue
        if len(known) > 2:
            point = replace(known[-1].point, u=u)
            return SpecialPoint(kind, point, point.value, near.tangent)
    return None
