"""Leaving a branch: where others cross it, where periods double, and over grazing.

Orbits next to a branch point are hard to correct, as the Jacobian is singular there. With some of a fixed vector in the
residual, r(u) + b v = 0, the problem is regular, and b is a smooth function on a plane through the branch point. There
it is 0 without a slope, and the directions in which it does not bend are those of the branches (Moore 1980).

Next to grazing the residual of the orbits without the impact is smooth, with the Jacobian A. An impact of speed w adds
b w to it, and w² grows linearly, κ g·(u_c − u), with the distance from the grazing orbit u_c (Nordmark 1991). So the
Jacobian A − (κ / 2 w) b gᵀ grows without bounds, steps along the branch become ever smaller, and no tangent leads from
one side to the other. But both are known from either side: A t = 0 without the impact, and with it A t + b ω = 0 and
g·t = 0, where w = ω s at a small distance s from u_c.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from vibroplat.continuation.newton import Chart, MissedError, NewtonResult, Problem, bordered, correct
from vibroplat.continuation.orbit import measures_of_orbit
from vibroplat.continuation.test_functions import DOUBLING, Point, Special, tangent_of
from vibroplat.kernels.compiled import FloatArray

#: Branch points: distance at which slopes are compared to find how b bends, the longest step, in units of the unknowns,
#: and most steps.
BESIDE, FARTHEST, MOST = 1e-3, 1.0, 10
#: Largest last step to a branch point, after which no shot is taken: in units of the unknowns, and over the tolerance;
#: and the largest b, in the scales of the scene.
CLOSE, CLOSER, CROSSING = 1e-6, 100.0, 1e-6
#: First steps along a new branch, over the largest step, one after the other.
FIRST = (0.5, 1.0, 0.2, 0.05)
#: Least part of the way along a branch that must be covered across it by a point that has left it.
LEFT = 0.3
#: Measures of an orbit that are the same for its mirror image, besides key and period.
MIRRORED = ("rms_x_m", "rms_y_m", "rms_phi_rad", "motor_power_w")
#: Farthest that grazing may be ahead (units of the unknowns), and distances beyond it at which an orbit is looked for,
#: over how far ahead it is, one after the other; the least of them.
AHEAD, AWAY, LEAST = 0.3, (1.0, 0.1, 10.0), 1e-5
#: Most that an orbit may lie beside where it is expected, over how far grazing is ahead, and what is always allowed.
ASIDE, ASIDE_LEAST = 10.0, 1e-3


def branch_point(
    problem: Problem, chart: Chart, u: FloatArray, jacobian: FloatArray, held: FloatArray | None = None
) -> tuple[NewtonResult, tuple[FloatArray, FloatArray]]:
    """Find the branch point over the first key near some unknowns, from nearly the Jacobian there.

    Directions are held in which the unknowns stay, one for each other key. The orbit's unknowns are a last step ahead
    of its shot; with it come the directions of both branches, of length 1.
    """
    m = chart.places.size
    left, _, right = np.linalg.svd(jacobian[:, : m + 1])
    slack, plane = left[:, -1], np.zeros((2, u.size))
    plane[:, : m + 1] = right[-2:]
    border = plane if held is None else np.vstack([plane, held])

    def at(place: FloatArray, near: FloatArray) -> tuple[NewtonResult, FloatArray]:
        found = correct(problem, chart, u + place @ plane, border, near, slack=slack)
        return found, _slopes(found, border, slack)

    place = np.zeros(2)
    found, slopes = at(place, jacobian)
    beside = [at(place + BESIDE * way, found.jacobian)[1] for way in np.eye(2)]
    bends = np.array([slope - slopes for slope in beside]) / BESIDE
    for _ in range(MOST):
        step = np.linalg.lstsq(bends, -slopes, rcond=None)[0]
        way = float(np.linalg.norm(step))
        if not way < FARTHEST:
            break
        if way < min(CLOSE, CLOSER * problem.tolerance):
            if abs(found.slack) > CROSSING:
                raise MissedError("branches pass each other without crossing")
            return replace(found, u=found.u + step @ plane), _directions(bends, plane)
        place, before = place + step, slopes
        found, slopes = at(place, found.jacobian)
        bends += np.outer(slopes - before - bends @ step, step) / (step @ step)
    raise MissedError("no branch point nearby")


def _slopes(found: NewtonResult, border: FloatArray, slack: FloatArray) -> FloatArray:
    """Differentiate b by the place in the plane, shape (2,)."""
    m, free = found.jacobian.shape
    last = np.zeros(free + 1)
    last[-1] = 1.0
    try:
        return np.asarray(np.linalg.solve(bordered(found.jacobian, border, slack).T, last)[m : m + 2])
    except np.linalg.LinAlgError:
        raise MissedError("the bordered Jacobian is singular") from None


def _directions(bends: FloatArray, plane: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Directions of length 1 in which b does not bend."""
    sizes, ways = np.linalg.eigh(0.5 * (bends + bends.T))
    if not sizes[0] < 0.0 < sizes[1]:
        raise MissedError("a single orbit, at which no branches cross")
    one, other = np.sqrt(sizes[1]) * ways[:, 0], np.sqrt(-sizes[0]) * ways[:, 1]
    first, second = ((one + sign * other) @ plane / np.linalg.norm(one + sign * other) for sign in (1.0, -1.0))
    return first, second


def new_branches(
    problem: Problem, special: Special, first: float, largest: float
) -> Iterator[tuple[Problem, Point, float, bool]]:
    """Find the first points of the branches that begin at a special point, with the first and the largest step there.

    Yields problem, point and step of each, and whether the point is new, or one of another branch already.
    """
    if special.kind == DOUBLING:
        doubled = Problem(problem.shooter, [2 * turns for turns in problem.turns], problem.units, problem.tolerance)
        point = _first_away(doubled, special, _doubling_direction(special.point), largest)
        if point is not None:
            yield doubled, point, first, True
        return
    assert special.across is not None
    ahead, back = (_first_away(problem, special, sign * special.across, largest) for sign in (1.0, -1.0))
    if ahead is None or back is None or _mirrors(problem, ahead, back):
        found = [ahead] if ahead is not None else [back]
        yield from ((problem, point, first, True) for point in found if point is not None)
    else:  # from the point behind both ways, over the special point and away from it
        yield problem, replace(back, tangent=-back.tangent), float(np.linalg.norm(ahead.u - back.u)), True
        yield problem, back, first, False


def _first_away(problem: Problem, origin: Special, direction: FloatArray, largest: float) -> Point | None:
    """Find a point of a branch that leaves another one in a direction; None if it cannot be found."""
    chart, u = origin.point.chart, origin.point.u.copy()
    if origin.kind == DOUBLING:
        u[chart.phase] *= 2.0
    for share in FIRST:
        try:
            found = correct(problem, chart, u + share * largest * direction, direction[np.newaxis], most=20)
            point = Point.of(found, tangent_of(found.jacobian, direction))
        except MissedError:
            continue
        way = point.u - u
        apart = abs(way @ direction) > LEFT * abs(way @ origin.direction)
        if not problem.halves(point) if origin.kind == DOUBLING else apart:
            return point
    return None


def _doubling_direction(point: Point) -> FloatArray:
    """Direction of the branch of twice the period: the eigenvector of the multiplier −1."""
    values, vectors = np.linalg.eig(point.chart.section_map(point.shot))
    vector = vectors[:, np.argmin(np.abs(values + 1.0))].real
    direction = np.append(np.insert(vector, point.chart.phase, 0.0), 0.0)
    return np.asarray(direction / np.linalg.norm(direction))


def _mirrors(problem: Problem, one: Point, other: Point) -> bool:
    """Whether two orbits are mirror images of each other."""
    measures = [measures_of_orbit(problem, point) for point in (one, other)]
    pairs = [(measures[0][name], measures[1][name]) for name in MIRRORED]
    pairs += [(one.value, other.value), (one.shot.duration, other.shot.duration)]
    return all(abs(first - second) <= 1e-3 * abs(first) for first, second in pairs)


def over_grazing(problem: Problem, before: Point, last: Point) -> Point:
    """Find an orbit on the other side of the grazing that is ahead of the last two points of a branch."""
    if before.chart is not last.chart or before.word != last.word:
        raise MissedError("the last points cannot be compared")
    for guesses, change in ((_without_impact(before, last), -1), (_with_impact(problem, before, last), 1)):
        for guess, direction, ahead in guesses:
            try:
                found = correct(problem, last.chart, guess, direction[np.newaxis])
                point = Point.of(found, tangent_of(found.jacobian, direction))
            except MissedError:
                continue
            near = np.linalg.norm(point.u - guess) < max(ASIDE * ahead, ASIDE_LEAST)
            if near and len(point.word) == len(last.word) + change:
                return point
    raise MissedError("no grazing is ahead")


#: What is tried: unknowns, a direction away from grazing, and how far that is ahead of the last point.
Guesses = Iterator[tuple[FloatArray, FloatArray, float]]


def _without_impact(before: Point, last: Point) -> Guesses:
    """Go on from orbits with an impact that becomes ever slower, to those without."""
    if "S" in last.word:  # slow impacts are then those that accumulate
        return
    speeds = [p.shot.slowest_impact for p in (before, last)]
    ahead = _ahead([speed**2 for speed in speeds], before, last)
    if not 0.0 < ahead < AHEAD:
        return
    # J = A + B / w at both points
    growing = (last.jacobian - before.jacobian) / (1.0 / speeds[1] - 1.0 / speeds[0])
    tangent = _null(last.jacobian - growing / speeds[1])
    for share in AWAY:
        for sense in (1.0, -1.0):
            direction = sense * tangent
            yield last.u + ahead * last.tangent + max(share * ahead, LEAST) * direction, direction, ahead


def _with_impact(problem: Problem, before: Point, last: Point) -> Guesses:
    """Go on from orbits that come ever nearer to an impact, to those with it."""
    ahead = _ahead([p.shot.least_gap for p in (before, last)], before, last)
    if not 0.0 < ahead < AHEAD:
        return
    grazing, far = last.u + ahead * last.tangent, max(ahead, LEAST)
    try:
        residual, shot = problem.shoot(last.chart, grazing + far * last.tangent, full=True)
    except MissedError:
        return
    speed = shot.slowest_impact
    if not np.isfinite(speed):
        return
    normal = np.linalg.svd(problem.jacobian(last.chart, shot) - last.jacobian)[2][0]
    kappa = -(speed**2) / (far * float(normal @ last.tangent))
    extended = _null(bordered(last.jacobian, normal, residual / speed))
    extended *= np.copysign(1.0, extended[-1]) / np.linalg.norm(extended[:-1])
    direction, growth = extended[:-1], extended[-1]
    for share in AWAY:
        away = max(share * ahead, LEAST)
        yield grazing + away * direction - normal * (growth * away) ** 2 / kappa, direction, ahead


def _ahead(measures: Sequence[float], before: Point, last: Point) -> float:
    """How far ahead of the last of two points a measure is zero, along its tangent; NaN if it is not ahead."""
    step = float((last.u - before.u) @ last.tangent)
    if not np.isfinite(measures).all() or not measures[1] < measures[0]:
        return float("nan")
    return measures[1] * step / (measures[0] - measures[1])


def _null(matrix: FloatArray) -> FloatArray:
    """Direction of length 1 that a matrix with one column more than rows turns to zero."""
    return np.asarray(np.linalg.svd(matrix)[2][-1])
