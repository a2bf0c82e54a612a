"""Branches of periodic orbits: pseudo-arclength continuation in one key (Keller 1977; Allgower and Georg 1990).

The predictor is a polynomial through the last points with their tangents; the corrector moves orthogonally to the last
tangent; steps grow while Newton's method takes few iterations. Where the mode on the section is about to change, the
section is moved along the orbit. Where the sequence of events changes, the branch may have a corner, after which its
direction follows from a determinant.

Next to grazing the residual of the orbits without the impact is smooth, with the Jacobian A. An impact of speed w adds
b w to it, and w² grows linearly, κ g·(u_c − u), with the distance from the grazing orbit u_c (Nordmark 1991). So the
Jacobian A − (κ / 2 w) b gᵀ grows without bounds, steps along the branch become ever smaller, and no tangent leads from
one side to the other. But both are known from either side: A t = 0 without the impact, and with it A t + b ω = 0 and
g·t = 0, where w = ω s at a small distance s from u_c.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from vibroplat.continuation.newton import NoConvergenceError, Problem, add_border, correct, length_of
from vibroplat.continuation.special_points import OrbitPoint, tangent_of
from vibroplat.hybrid.modes import IMPACT
from vibroplat.kernels.compiled import FloatArray
from vibroplat.shooting.orbits import Chart

#: Points that a prediction rests on, at most; the least cosine between the tangent at one of them and the direction in
#: which its place is measured; and the least distance of two, as a part of the way that is predicted.
MAX_KNOWN_POINTS, MIN_COSINE, MIN_SPACING = 3, 0.3, 0.05
#: Iterations after which the next step is longer, as long, or else shorter.
EASY, HARD = 3, 5
GROWTH, REDUCTION = 1.5, 0.7
#: Part of the first step below which steps are perhaps so short because of grazing.
GRAZING_STEP_RATIO = 0.3
#: Where impacts accumulate the sequence changes infinitely often: a step over changes that cannot be located is taken
#: after all when steps down to this part of it did no better.
SKIPPED_STEP_RATIO = 1e-2
#: Largest change of the period in a step, over the period: curves are drawn over the excitation frequency. Where the
#: key hardly changes, the tangent's part along it counts as no less than the second number.
MAX_PERIOD_CHANGE, MIN_PART = 1.0 / 120.0, 0.03
#: Minimum cosine between the tangents of points with one sequence of events.
MIN_TANGENT_COSINE = 0.6
#: Most that a point may lie beside its prediction, over the length of the step; the second where a step shorter than
#: CORNER_STEP changes the sequence of events, at which a branch may have a corner.
MAX_DEVIATIONS, CORNER_STEP = (0.5, 5.0), 1e-3
#: Most that a point between two others may lie beside its prediction, over their distance.
MAX_MIDDLE_DEVIATION = 0.2
#: How near an impact must be, as a part of its speed, to that below which impacts stick, for an end to be due to it.
THRESHOLD_DISTANCE, LAW_JUMPS = 1e-4, "an impact reaches contact.restitution_threshold_m_per_s, where rebounds begin"
#: Farthest that grazing may be ahead (units of the unknowns), and distances beyond it at which an orbit is looked for,
#: over how far ahead it is, one after the other; the least of them.
MAX_GRAZING_DISTANCE, GRAZING_OFFSETS, MIN_GRAZING_OFFSET = 0.3, (1.0, 0.1, 10.0), 1e-5
#: Most that an orbit may lie beside where it is expected, over how far grazing is ahead, and what is always allowed.
MAX_GRAZING_DEVIATION = 10.0, 1e-3

#: What is shown the last point and a new one, in one chart. If it is to be strict, it raises NoConvergenceError where
#: it cannot tell what happens between them.
Look = Callable[[OrbitPoint, OrbitPoint, bool], None]


@dataclass
class Branch:
    """A branch over one key while it grows.

    Attributes
    ----------
    step, least, largest
        The next and the least step, and the largest change of the key, in units of the unknowns.
    ended
        Why it has ended; empty while it has not.
    """

    problem: Problem
    step: float
    least: float
    largest: float
    points: list[OrbitPoint] = field(default_factory=list)
    ended: str = ""

    def correct(
        self, chart: Chart, u: FloatArray, direction: FloatArray, jacobian: FloatArray | None = None, steps: int = 12
    ) -> OrbitPoint:
        """Find a point near unknowns, orthogonally to a direction, with its tangent on the side of that direction."""
        result = correct(self.problem, chart, u, direction[np.newaxis], jacobian, steps)
        return OrbitPoint.of(result, tangent_of(result.jacobian, direction))

    def step_from(self, last: OrbitPoint, length: float, known: Sequence[OrbitPoint] = ()) -> OrbitPoint:
        """Find the point so far along the tangent at another one, which others precede, the nearest first."""
        u, jacobian = predict([last, *known], last.u, last.tangent, length)
        point = self.correct(last.chart, u, last.tangent, jacobian)
        angular = point.event_sequence != last.event_sequence and abs(length) < CORNER_STEP
        if length_of(point.u - u) > (MAX_DEVIATIONS[1] if angular else MAX_DEVIATIONS[0]) * abs(length):
            raise NoConvergenceError("another branch was found")
        if self.problem.repeats_after_half(point):
            raise NoConvergenceError("an orbit of half the period was found")
        return point

    def between(
        self, known: Sequence[OrbitPoint], origin: OrbitPoint, direction: FloatArray, distance: float, width: float
    ) -> OrbitPoint:
        """Find the point at a place along a direction from an origin, between two that are so far apart.

        The points that are known are given the nearest first.
        """
        u, jacobian = predict(known, origin.u, direction, distance)
        point = self.correct(origin.chart, u, direction, jacobian)
        if length_of(point.u - u) > MAX_MIDDLE_DEVIATION * width:
            raise NoConvergenceError("another branch was found")
        return point

    def extend(self, look: Look) -> bool:
        """Add a point that has been looked at, or say in ``ended`` why there is none; return whether there is."""
        try:
            point = self._next(look)
        except NoConvergenceError as error:
            self.ended = f"no further orbit found: {LAW_JUMPS if self._law_jumps() else error.why}"
            return False
        iterations = len(point.residuals)
        self.step = point.step * (GROWTH if iterations <= EASY else 1.0 if iterations <= HARD else REDUCTION)
        self.points.append(self.centre_section(point))
        return True

    def _next(self, look: Look) -> OrbitPoint:
        """Find the next point and have it looked at, with ever shorter steps; from a part of the first over grazing.

        Where impacts accumulate, a step is taken in the end over changes that cannot be located.
        """
        last, across, leapt = self.points[-1], None, False
        first_step = self.step = min(self.step, self._max_step(last))
        while True:
            try:
                point = self._take_step(last)
                across = across or point
                look(last, point, True)
                return point
            except NoConvergenceError as error:
                missed = error
            self.step *= 0.5
            if across is not None and self.step < across.step * SKIPPED_STEP_RATIO:
                look(last, across, False)
                return across
            if not leapt and self.step < GRAZING_STEP_RATIO * first_step and len(self.points) > 1:
                leapt = True
                with contextlib.suppress(NoConvergenceError):
                    point = step_over_grazing(self.problem, self.points[-2], last)
                    point = orient_tangent(point, last, length_of(point.u - last.u))
                    look(last, point, True)
                    return point
            if self.step < self.least:
                raise missed

    def _max_step(self, point: OrbitPoint) -> float:
        """Longest step that changes the key by at most the largest change, and the period by at most a part."""
        tangent, phase = point.tangent, point.chart.phase
        period = MAX_PERIOD_CHANGE * float(point.u[phase]) / max(abs(float(tangent[phase])), 1e-9)
        return min(self.largest / max(abs(point.along_key), MIN_PART), period)

    def _take_step(self, last: OrbitPoint) -> OrbitPoint:
        """Find the point that is a step away from the last one."""
        point = self.step_from(last, self.step, self.points[-2 : -2 - MAX_KNOWN_POINTS : -1])
        turns = point.tangent @ last.tangent < MIN_TANGENT_COSINE and point.event_sequence == last.event_sequence
        if turns and self.step > 20.0 * self.least:
            raise NoConvergenceError("the branch turns too sharply")
        return orient_tangent(point, last, self.step)

    def centre_section(self, point: OrbitPoint) -> OrbitPoint:
        """Move the section to the middle of the longest piece of contact, or of flight, if it is near an end."""
        moved = self.problem.move_from_events(point, point.tangent)
        if moved is None:
            return point
        chart, u, (tangent,) = moved
        try:
            return replace(self.correct(chart, u, tangent), step=point.step)
        except NoConvergenceError:
            return point

    def _law_jumps(self) -> bool:
        """Whether an impact of the last orbit is just as fast as those below which there is no rebound."""
        contact, events = self.problem.shooter.scene.contact, self.points[-1].shot.events
        bound, speeds = contact.restitution_threshold_m_per_s, -events["rate_before"][events["kind"] == IMPACT]
        return bool((np.abs(speeds - bound) < THRESHOLD_DISTANCE * bound).any()) and contact.restitution > 0.0


def orient_tangent(point: OrbitPoint, before: OrbitPoint, step: float) -> OrbitPoint:
    """Let the tangent of a point lead on from the point before, also where the sequence of events changes and it jumps.

    The determinant of Jacobian and tangent changes its sign at branch points only: not at folds, nor at corners, where
    the residual is continuous (Allgower and Georg 1990).
    """
    if point.event_sequence != before.event_sequence and point.branching * before.branching < 0.0:
        return replace(point, tangent=-point.tangent, step=step)
    return replace(point, step=step)


def predict(
    points: Sequence[OrbitPoint], origin: FloatArray, direction: FloatArray, distance: float
) -> tuple[FloatArray, FloatArray]:
    """Predict the orbit at a place along a direction from an origin.

    Parameters
    ----------
    points
        Of one branch, the nearest first; those in another chart or with other events than the first are left out.
    origin, direction, distance
        Unknowns, a direction of length 1, and the distance along it, which the prediction has exactly.

    Returns
    -------
    u, jacobian
        The polynomial through the points with their tangents (Hermite), and that through their Jacobians (Lagrange).
    """
    first = points[0]
    here = float((first.u - origin) @ direction)
    used, apart = [(first, here, float(first.tangent @ direction))], MIN_SPACING * abs(distance - here)
    for point in points[1:]:
        alike = point.chart is first.chart and point.event_sequence == first.event_sequence
        if len(used) == MAX_KNOWN_POINTS or not alike:
            break
        cosine = float(point.tangent @ direction)
        if cosine < MIN_COSINE:
            break
        here = float((point.u - origin) @ direction)
        if all(abs(here - other) > apart for _, other, _ in used):
            used.append((point, here, cosine))
    weights, slopes = np.zeros((2, len(used)))
    jacobian = np.zeros(first.jacobian.shape)
    for i, (point, here, cosine) in enumerate(used):
        away, weight, steepness = distance - here, 1.0, 0.0
        for _, other, _ in used:
            if other != here:
                weight *= (distance - other) / (here - other)
                steepness += 1.0 / (here - other)
        weights[i] = weight**2 * (1.0 - 2.0 * away * steepness)
        slopes[i] = weight**2 * away / cosine
        jacobian += weight * point.jacobian
    states, tangents = np.array([point.u for point, _, _ in used]), np.array([point.tangent for point, _, _ in used])
    return weights @ states + slopes @ tangents, jacobian


def step_over_grazing(problem: Problem, before: OrbitPoint, last: OrbitPoint) -> OrbitPoint:
    """Find an orbit on the other side of the grazing that is ahead of the last two points of a branch."""
    if before.chart is not last.chart or before.event_sequence != last.event_sequence:
        raise NoConvergenceError("the last points cannot be compared")
    for guesses, change in ((_without_impact(before, last), -1), (_with_impact(problem, before, last), 1)):
        for guess, direction, ahead in guesses:
            try:
                result = correct(problem, last.chart, guess, direction[np.newaxis])
                point = OrbitPoint.of(result, tangent_of(result.jacobian, direction))
            except NoConvergenceError:
                continue
            near = length_of(point.u - guess) < max(MAX_GRAZING_DEVIATION[0] * ahead, MAX_GRAZING_DEVIATION[1])
            if near and len(point.event_sequence) == len(last.event_sequence) + change:
                return point
    raise NoConvergenceError("no grazing is ahead")


#: What is tried: unknowns, a direction away from grazing, and how far that is ahead of the last point.
Guesses = Iterator[tuple[FloatArray, FloatArray, float]]


def _without_impact(before: OrbitPoint, last: OrbitPoint) -> Guesses:
    """Go on from orbits with an impact that becomes ever slower, to those without."""
    if "S" in last.event_sequence:  # slow impacts are then those that accumulate
        return
    speeds = [p.shot.slowest_impact for p in (before, last)]
    ahead = _ahead([speed**2 for speed in speeds], before, last)
    if not 0.0 < ahead < MAX_GRAZING_DISTANCE:
        return
    # J = A + B / w at both points
    growing = (last.jacobian - before.jacobian) / (1.0 / speeds[1] - 1.0 / speeds[0])
    tangent = _null(last.jacobian - growing / speeds[1])
    for offset in GRAZING_OFFSETS:
        for sense in (1.0, -1.0):
            direction = sense * tangent
            yield last.u + ahead * last.tangent + max(offset * ahead, MIN_GRAZING_OFFSET) * direction, direction, ahead


def _with_impact(problem: Problem, before: OrbitPoint, last: OrbitPoint) -> Guesses:
    """Go on from orbits that come ever nearer to an impact, to those with it."""
    ahead = _ahead([p.shot.least_gap for p in (before, last)], before, last)
    if not 0.0 < ahead < MAX_GRAZING_DISTANCE:
        return
    grazing, far = last.u + ahead * last.tangent, max(ahead, MIN_GRAZING_OFFSET)
    try:
        beyond = problem.shoot(last.chart, grazing + far * last.tangent)
    except NoConvergenceError:
        return
    speed = beyond.shot.slowest_impact
    if not np.isfinite(speed):
        return
    normal = np.linalg.svd(beyond.jacobian - last.jacobian)[2][0]
    kappa = -(speed**2) / (far * float(normal @ last.tangent))
    extended = _null(add_border(last.jacobian, normal, beyond.residual / speed))
    extended *= np.copysign(1.0, extended[-1]) / np.linalg.norm(extended[:-1])
    direction, growth = extended[:-1], extended[-1]
    for offset in GRAZING_OFFSETS:
        away = max(offset * ahead, MIN_GRAZING_OFFSET)
        yield grazing + away * direction - normal * (growth * away) ** 2 / kappa, direction, ahead


def _ahead(measures: Sequence[float], before: OrbitPoint, last: OrbitPoint) -> float:
    """How far ahead of the last of two points a measure is zero, along its tangent; NaN if it is not ahead."""
    step = float((last.u - before.u) @ last.tangent)
    if not np.isfinite(measures).all() or not measures[1] < measures[0]:
        return float("nan")
    return measures[1] * step / (measures[0] - measures[1])


def _null(matrix: FloatArray) -> FloatArray:
    """Direction of length 1 that a matrix with one column more than rows turns to zero."""
    return np.asarray(np.linalg.svd(matrix)[2][-1])
