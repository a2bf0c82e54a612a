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

from vibroplat.continuation.newton import Chart, MissedError, Problem, bordered, correct
from vibroplat.continuation.special_points import Point, tangent_of
from vibroplat.hybrid.modes import IMPACT
from vibroplat.kernels.compiled import FloatArray

#: Points that a prediction rests on, at most; the least cosine between the tangent at one of them and the direction in
#: which its place is measured; and the least distance of two, as a part of the way that is predicted.
KNOWN, ALIGNED, APART = 3, 0.3, 0.05
#: Iterations after which the next step is longer, as long, or else shorter.
EASY, HARD = 3, 5
LONGER, SHORTER = 1.5, 0.7
#: Part of the first step below which steps are perhaps so short because of grazing.
GRAZING = 0.3
#: Where impacts accumulate the sequence changes infinitely often: a step over changes that cannot be located is taken
#: after all when steps down to this part of it did no better.
SKIPPED = 1e-2
#: Largest change of the period in a step, over the period: curves are drawn over the excitation frequency. Where the
#: key hardly changes, the tangent's part along it counts as no less than the second number.
PERIOD, FLAT = 1.0 / 120.0, 0.03
#: Minimum cosine between the tangents of points with one sequence of events.
STRAIGHT = 0.6
#: Most that a point may lie beside its prediction, over the length of the step; the second where a step shorter than
#: ANGULAR changes the sequence of events, at which a branch may have a corner.
BESIDE, ANGULAR = (0.5, 5.0), 1e-3
#: Most that a point between two others may lie beside its prediction, over their distance.
ASIDE = 0.2
#: How near an impact must be, as a part of its speed, to that below which impacts stick, for an end to be due to it.
NEARLY, LAW_JUMPS = 1e-4, "an impact reaches contact.sticking_speed_m_per_s, where rebounds begin"
#: Farthest that grazing may be ahead (units of the unknowns), and distances beyond it at which an orbit is looked for,
#: over how far ahead it is, one after the other; the least of them.
AHEAD, AWAY, LEAST = 0.3, (1.0, 0.1, 10.0), 1e-5
#: Most that an orbit may lie beside where it is expected, over how far grazing is ahead, and what is always allowed.
ASIDE_GRAZING = 10.0, 1e-3

#: What is shown the last point and a new one, in one chart. If it is to be strict, it raises MissedError where it
#: cannot tell what happens between them.
Look = Callable[[Point, Point, bool], None]


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
    points: list[Point] = field(default_factory=list)
    ended: str = ""

    def corrected(
        self, chart: Chart, u: FloatArray, direction: FloatArray, jacobian: FloatArray | None = None, most: int = 12
    ) -> Point:
        """Find a point near unknowns, orthogonally to a direction, with its tangent on the side of that direction."""
        found = correct(self.problem, chart, u, direction[np.newaxis], jacobian, most)
        return Point.of(found, tangent_of(found.jacobian, direction))

    def beyond(self, last: Point, length: float, known: Sequence[Point] = ()) -> Point:
        """Find the point so far along the tangent at another one, which others precede, the nearest first."""
        u, jacobian = predicted([last, *known], last.u, last.tangent, length)
        point = self.corrected(last.chart, u, last.tangent, jacobian)
        angular = point.word != last.word and abs(length) < ANGULAR
        if np.linalg.norm(point.u - u) > (BESIDE[1] if angular else BESIDE[0]) * abs(length):
            raise MissedError("another branch was found")
        if self.problem.halves(point):
            raise MissedError("an orbit of half the period was found")
        return point

    def between(
        self, known: Sequence[Point], origin: Point, direction: FloatArray, place: float, width: float
    ) -> Point:
        """Find the point at a place along a direction from an origin, between two that are so far apart.

        The points that are known are given the nearest first.
        """
        u, jacobian = predicted(known, origin.u, direction, place)
        point = self.corrected(origin.chart, u, direction, jacobian)
        if np.linalg.norm(point.u - u) > ASIDE * width:
            raise MissedError("another branch was found")
        return point

    def grow(self, look: Look) -> bool:
        """Add a point that has been looked at, or say in ``ended`` why there is none; return whether there is."""
        try:
            point = self._next(look)
        except MissedError as error:
            self.ended = f"no point beyond: {LAW_JUMPS if self._law_jumps() else error.why}"
            return False
        iterations = len(point.residuals)
        self.step = point.step * (LONGER if iterations <= EASY else 1.0 if iterations <= HARD else SHORTER)
        self.points.append(self.in_middle(point))
        return True

    def _next(self, look: Look) -> Point:
        """Find the next point and have it looked at, with ever shorter steps; from a part of the first over grazing.

        Where impacts accumulate, a step is taken in the end over changes that cannot be located.
        """
        last, across, leapt = self.points[-1], None, False
        begun = self.step = min(self.step, self._longest(last))
        while True:
            try:
                point = self._stepped(last)
                across = across or point
                look(last, point, True)
                return point
            except MissedError as error:
                missed = error
            self.step *= 0.5
            if across is not None and self.step < across.step * SKIPPED:
                look(last, across, False)
                return across
            if not leapt and self.step < GRAZING * begun and len(self.points) > 1:
                leapt = True
                with contextlib.suppress(MissedError):
                    point = over_grazing(self.problem, self.points[-2], last)
                    point = oriented(point, last, float(np.linalg.norm(point.u - last.u)))
                    look(last, point, True)
                    return point
            if self.step < self.least:
                raise missed

    def _longest(self, point: Point) -> float:
        """Longest step that changes the key by at most the largest change, and the period by at most a part."""
        tangent, phase = point.tangent, point.chart.phase
        period = PERIOD * float(point.u[phase]) / max(abs(float(tangent[phase])), 1e-9)
        return min(self.largest / max(abs(point.along_key), FLAT), period)

    def _stepped(self, last: Point) -> Point:
        """Find the point that is a step away from the last one."""
        point = self.beyond(last, self.step, self.points[-2 : -2 - KNOWN : -1])
        turns = point.tangent @ last.tangent < STRAIGHT and point.word == last.word
        if turns and self.step > 20.0 * self.least:
            raise MissedError("the branch turns too sharply")
        return oriented(point, last, self.step)

    def in_middle(self, point: Point) -> Point:
        """Move the section to the middle of the longest piece of contact, or of flight, if it is near an end."""
        moved = self.problem.far_from_events(point, point.tangent)
        if moved is None:
            return point
        chart, u, (tangent,) = moved
        try:
            return replace(self.corrected(chart, u, tangent), step=point.step)
        except MissedError:
            return point

    def _law_jumps(self) -> bool:
        """Whether an impact of the last orbit is just as fast as those below which there is no rebound."""
        contact, events = self.problem.shooter.scene.contact, self.points[-1].shot.events
        bound, speeds = contact.sticking_speed_m_per_s, -events["rate_before"][events["kind"] == IMPACT]
        return bool((np.abs(speeds - bound) < NEARLY * bound).any()) and contact.restitution > 0.0


def oriented(point: Point, before: Point, step: float) -> Point:
    """Let the tangent of a point lead on from the point before, also where the sequence of events changes and it jumps.

    The determinant of Jacobian and tangent changes its sign at branch points only: not at folds, nor at corners, where
    the residual is continuous (Allgower and Georg 1990).
    """
    turned_round = point.word != before.word and point.branching * before.branching < 0.0
    return replace(point, tangent=-point.tangent if turned_round else point.tangent, step=step)


def predicted(
    points: Sequence[Point], origin: FloatArray, direction: FloatArray, place: float
) -> tuple[FloatArray, FloatArray]:
    """Predict the orbit at a place along a direction from an origin.

    Parameters
    ----------
    points
        Of one branch, the nearest first; those in another chart or with other events than the first are left out.
    origin, direction, place
        Unknowns, a direction of length 1, and the distance along it, which the prediction has exactly.

    Returns
    -------
    u, jacobian
        The polynomial through the points with their tangents (Hermite), and that through their Jacobians (Lagrange).
    """
    first = points[0]
    used, places = [first], [float((first.u - origin) @ direction)]
    apart = APART * abs(place - places[0])
    for point in points[1:]:
        alike = point.chart is first.chart and point.word == first.word
        if len(used) == KNOWN or not alike or point.tangent @ direction < ALIGNED:
            break
        here = float((point.u - origin) @ direction)
        if min(abs(here - p) for p in places) > apart:
            used.append(point)
            places.append(here)
    u, jacobian = np.zeros(first.u.size), np.zeros(first.jacobian.shape)
    for point, here in zip(used, places, strict=True):
        away, weight, steepness = place - here, 1.0, 0.0
        for other in places:
            if other != here:
                weight *= (place - other) / (here - other)
                steepness += 1.0 / (here - other)
        u += (weight**2 * (1.0 - 2.0 * away * steepness)) * point.u
        u += (weight**2 * away / float(point.tangent @ direction)) * point.tangent
        jacobian += weight * point.jacobian
    return u, jacobian


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
            near = np.linalg.norm(point.u - guess) < max(ASIDE_GRAZING[0] * ahead, ASIDE_GRAZING[1])
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
