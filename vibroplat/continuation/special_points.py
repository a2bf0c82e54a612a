"""Special points by kind: functions of an orbit that are zero there, and branches that begin there (Kuznetsov 2004).

Those of smooth bifurcations change their sign on a branch. The contact force and the gap are known on one side only: an
orbit that has lifted off no longer has the turning point of F_c that fell to zero.

Orbits next to a branch point are hard to correct, as the Jacobian is singular there. With some of a fixed vector in the
residual, r(u) + b v = 0, the problem is regular, and b is a smooth function on a plane through the branch point. There
it is 0 without a slope, and the directions in which it does not bend are those of the branches (Moore 1980).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter
from typing import Self

import numpy as np
import numpy.typing as npt

from vibroplat.continuation.newton import (
    NewtonResult,
    NoConvergenceError,
    Problem,
    add_border,
    correct,
    length_of,
    solve_determined,
)
from vibroplat.continuation.orbit import measures_of_orbit
from vibroplat.kernels.compiled import FloatArray
from vibroplat.kernels.linear import bordered_determinant
from vibroplat.results.labels import SPECIAL_POINTS
from vibroplat.shooting.multipliers import Stability
from vibroplat.shooting.orbits import Chart

#: What happens at each kind, for people.
KINDS = SPECIAL_POINTS
FOLD, DOUBLING, NEIMARK_SACKER, BRANCH_POINT, LIFTOFF, END_OF_STICKING, GRAZING = KINDS
#: Those at which an orbit loses its stability.
SMOOTH_LOSSES = (FOLD, DOUBLING, NEIMARK_SACKER, BRANCH_POINT)

#: Distance of a multiplier from the unit circle that counts, beside the one that passes it.
UNIT_CIRCLE_MARGIN = 1e-3
#: Length of the new tangent over its part along the old one, beyond which it is checked as a step is.
MAX_TANGENT_RATIO = 1e3
#: Branch points: distance at which slopes are compared to find how b bends, the longest step, in units of the unknowns,
#: and most steps.
SLOPE_DISTANCE, MAX_STEP, MAX_CORRECTIONS = 1e-3, 1.0, 10
#: Largest last step to a branch point, after which no shot is taken: in units of the unknowns, and over the tolerance;
#: and the largest b, in scaled units.
STEP_TOLERANCE, STEP_TOLERANCE_RATIO, MAX_BRANCHING = 1e-6, 100.0, 1e-6
#: First steps along a new branch, over the largest step, one after the other.
FIRST_STEP_RATIOS = (0.5, 1.0, 0.2, 0.05)
#: Minimum part of the way along a branch that must be covered across it by a point that has left it.
MIN_TRANSVERSE_PART = 0.3
#: Measures of an orbit that are the same for its mirror image, besides key and period.
MIRROR_INVARIANTS = ("rms_x_m", "rms_y_m", "rms_phi_rad", "motor_power_w")


@dataclass
class OrbitPoint(NewtonResult):
    """A point of a branch, or of a curve in two keys, with its tangent, its test functions, and the step to here."""

    tangent: FloatArray
    step: float = 0.0

    @classmethod
    def of(cls, orbit: NewtonResult, tangent: FloatArray) -> Self:
        """Give an orbit a tangent."""
        return cls(
            orbit.chart, orbit.u, orbit.shot, orbit.jacobian, orbit.residual, orbit.residuals, orbit.slack, tangent
        )

    @property
    def along_key(self) -> float:
        """Component of the tangent along the key, 0 at a fold of the branch."""
        return float(self.tangent[-1])

    @cached_property
    def branching(self) -> float:
        """Determinant of the Jacobian with the tangent, which changes its sign where branches cross."""
        return bordered_determinant(self.jacobian, self.tangent, np.empty(self.u.size))


#: Functions of points.
Test = Callable[[OrbitPoint], float]
#: Those that change their sign on a branch between points with the same sequence of events.
SMOOTH: dict[str, Test] = {
    FOLD: attrgetter("along_key"),
    DOUBLING: attrgetter("stability.doubling"),
    NEIMARK_SACKER: attrgetter("stability.neimark_sacker"),
    BRANCH_POINT: attrgetter("branching"),
}
#: Those that are positive on the side where the event is not there yet, and unknown on the other.
ONE_SIDED: dict[str, Test] = {
    LIFTOFF: attrgetter("shot.least_force"),
    END_OF_STICKING: attrgetter("shot.landing_force"),
    GRAZING: attrgetter("shot.least_gap"),
}


def _product_of_pairs(of: Stability) -> float:
    return of.neimark_sacker if of.complex_pair and of.one_pair else math.nan


#: Those of curves in two keys.
IN_TWO_KEYS: dict[str, Test] = {
    FOLD: attrgetter("stability.fold"),
    DOUBLING: attrgetter("stability.doubling"),
    NEIMARK_SACKER: lambda point: _product_of_pairs(point.stability),
    **ONE_SIDED,
}


@dataclass
class SpecialPoint:
    """A special point of a kind, at a value of the key.

    Attributes
    ----------
    point
        The orbit there, or next to it.
    direction
        Of the branch there, from neighbour to neighbour: where branches cross, a point has no single tangent.
    across
        Direction of the other branch at a branch point.
    mirrors
        Whether this branch turns back: beyond are the mirror images of the orbits before or, where it is one of doubled
        periods and has come to their end, the same orbits begun half a period later.
    """

    kind: str
    point: OrbitPoint
    value: float
    direction: FloatArray
    across: FloatArray | None = None
    mirrors: bool = False


def tangent_of(jacobian: FloatArray, near: FloatArray) -> FloatArray:
    """Direction of length 1 in which the residual does not change, on the side of a given one."""
    tangent = np.empty(near.size)
    if not abs(bordered_determinant(jacobian, near, tangent)) > 0.0 or length_of(tangent) > MAX_TANGENT_RATIO:
        tangent = solve_determined(add_border(jacobian, near), np.eye(near.size)[-1])
    return np.asarray(tangent / length_of(tangent))


def approaching_event(near: OrbitPoint, far: OrbitPoint) -> str | None:
    """Tell which discontinuity is on the way from one orbit to another, if its distance is known; None if it is not."""
    if near.event_sequence.count("S") > far.event_sequence.count("S") and far.event_sequence:
        return END_OF_STICKING
    if len(near.event_sequence) >= len(far.event_sequence):
        return None
    return LIFTOFF if far.event_sequence.count("L") > near.event_sequence.count("L") else GRAZING


def others_outside(kind: str, multipliers: npt.NDArray[np.complex128]) -> int:
    """Count the multipliers outside the unit circle but those that pass it at a special point of a kind."""
    critical, rest = {FOLD: 1.0, BRANCH_POINT: 1.0, DOUBLING: -1.0}, multipliers
    if kind in critical and rest.size:
        rest = np.delete(rest, np.argmin(np.abs(rest - critical[kind])))
    elif kind == NEIMARK_SACKER:
        pairs = np.flatnonzero(np.abs(rest.imag) > 0.0)
        rest = np.delete(rest, pairs[np.argsort(np.abs(np.abs(rest[pairs]) - 1.0))[:2]])
    return int((np.abs(rest) > 1.0 + UNIT_CIRCLE_MARGIN).sum())


def branch_point(
    problem: Problem, chart: Chart, u: FloatArray, jacobian: FloatArray, fixed: FloatArray | None = None
) -> tuple[NewtonResult, tuple[FloatArray, FloatArray]]:
    """Find the branch point over the first key near some unknowns, from nearly the Jacobian there.

    Directions are held in which the unknowns stay, one for each other key. The orbit's unknowns are a last step ahead
    of its shot; with it come the directions of both branches, of length 1.
    """
    m = chart.places.size
    left, _, right = np.linalg.svd(jacobian[:, : m + 1])
    slack, plane = left[:, -1], np.zeros((2, u.size))
    plane[:, : m + 1] = right[-2:]
    border = plane if fixed is None else np.vstack([plane, fixed])

    def at(offset: FloatArray, near: FloatArray) -> tuple[NewtonResult, FloatArray]:
        result = correct(problem, chart, u + offset @ plane, border, near, slack=slack)
        return result, _slopes(result, border, slack)

    offset = np.zeros(2)
    result, slopes = at(offset, jacobian)
    nearby = [at(offset + SLOPE_DISTANCE * way, result.jacobian)[1] for way in np.eye(2)]
    bends = np.array([slope - slopes for slope in nearby]) / SLOPE_DISTANCE
    for _ in range(MAX_CORRECTIONS):
        step = np.linalg.lstsq(bends, -slopes, rcond=None)[0]
        way = float(np.linalg.norm(step))
        if not way < MAX_STEP:
            break
        if way < min(STEP_TOLERANCE, STEP_TOLERANCE_RATIO * problem.tolerance):
            if abs(result.slack) > MAX_BRANCHING:
                raise NoConvergenceError("branches pass each other without crossing")
            return replace(result, u=result.u + step @ plane), _directions(bends, plane)
        offset, before = offset + step, slopes
        result, slopes = at(offset, result.jacobian)
        bends += np.outer(slopes - before - bends @ step, step) / (step @ step)
    raise NoConvergenceError("no branch point nearby")


def _slopes(result: NewtonResult, border: FloatArray, slack: FloatArray) -> FloatArray:
    """Differentiate b by the place in the plane, shape (2,)."""
    m, free = result.jacobian.shape
    last = np.zeros(free + 1)
    last[-1] = 1.0
    try:
        return np.asarray(np.linalg.solve(add_border(result.jacobian, border, slack).T, last)[m : m + 2])
    except np.linalg.LinAlgError:
        raise NoConvergenceError("the bordered Jacobian is singular") from None


def _directions(bends: FloatArray, plane: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Directions of length 1 in which b does not bend."""
    sizes, ways = np.linalg.eigh(0.5 * (bends + bends.T))
    if not sizes[0] < 0.0 < sizes[1]:
        raise NoConvergenceError("a single orbit, at which no branches cross")
    one, other = np.sqrt(sizes[1]) * ways[:, 0], np.sqrt(-sizes[0]) * ways[:, 1]
    first, second = ((one + sign * other) @ plane / np.linalg.norm(one + sign * other) for sign in (1.0, -1.0))
    return first, second


def new_branches(
    problem: Problem, special: SpecialPoint, first: float, largest: float
) -> Iterator[tuple[Problem, OrbitPoint, float, bool]]:
    """Find the first points of the branches that begin at a special point, with the first and the largest step there.

    Yields problem, point and step of each, and whether the point is new, or one of another branch already.
    """
    if special.kind == DOUBLING:
        doubled = Problem(problem.shooter, [2 * n for n in problem.turns], problem.units.tolist(), problem.tolerance)
        point = _leave_branch(doubled, special, _doubling_direction(special.point), largest)
        if point is not None:
            yield doubled, point, first, True
        return
    assert special.across is not None
    ahead, back = (_leave_branch(problem, special, sign * special.across, largest) for sign in (1.0, -1.0))
    if ahead is None or back is None or _are_mirrored(problem, ahead, back):
        points = [ahead] if ahead is not None else [back]
        yield from ((problem, point, first, True) for point in points if point is not None)
    else:  # from the point behind both ways, over the special point and away from it
        yield problem, replace(back, tangent=-back.tangent), float(np.linalg.norm(ahead.u - back.u)), True
        yield problem, back, first, False


def _leave_branch(problem: Problem, origin: SpecialPoint, direction: FloatArray, largest: float) -> OrbitPoint | None:
    """Find a point of a branch that leaves another one in a direction; None if it cannot be found."""
    chart, u = origin.point.chart, origin.point.u.copy()
    if origin.kind == DOUBLING:
        u[chart.phase] *= 2.0
    for ratio in FIRST_STEP_RATIOS:
        try:
            result = correct(problem, chart, u + ratio * largest * direction, direction[np.newaxis], max_iterations=20)
            point = OrbitPoint.of(result, tangent_of(result.jacobian, direction))
        except NoConvergenceError:
            continue
        way = point.u - u
        apart = abs(way @ direction) > MIN_TRANSVERSE_PART * abs(way @ origin.direction)
        if not problem.repeats_after_half(point) if origin.kind == DOUBLING else apart:
            return point
    return None


def _doubling_direction(point: OrbitPoint) -> FloatArray:
    """Direction of the branch of twice the period: the eigenvector of the multiplier −1."""
    values, vectors = np.linalg.eig(point.chart.section_map(point.shot))
    vector = vectors[:, np.argmin(np.abs(values + 1.0))].real
    direction = np.append(np.insert(vector, point.chart.phase, 0.0), 0.0)
    return np.asarray(direction / np.linalg.norm(direction))


def _are_mirrored(problem: Problem, one: OrbitPoint, other: OrbitPoint) -> bool:
    """Whether two orbits are mirror images of each other."""
    measures = [measures_of_orbit(problem, point) for point in (one, other)]
    pairs = [(measures[0][name], measures[1][name]) for name in MIRROR_INVARIANTS]
    pairs += [(one.value, other.value), (one.shot.duration, other.shot.duration)]
    return all(abs(first - second) <= 1e-3 * abs(first) for first, second in pairs)
