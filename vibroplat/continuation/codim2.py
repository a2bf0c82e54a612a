"""Boundaries: curves of special points over two keys.

Orbits at two keys make a surface. On it a curve is followed on which a test function stays zero: a step along the
curve, then a search across it. Orbits are corrected with the directions along and across as borders, so that neither a
fold of the orbits nor a turn of the curve does any harm. Branch points are followed by steps of the second key.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from vibroplat.config.plans import OrbitsPlan
from vibroplat.config.scene import Scene
from vibroplat.continuation.locate import OneSidedSearch, TrialOrbit, TwoSidedSearch, extrapolate, locate
from vibroplat.continuation.newton import NewtonResult, NoConvergenceError, Problem, correct
from vibroplat.continuation.shooting import Shooter, canonical_sequence
from vibroplat.continuation.special_points import (
    BRANCH_POINT,
    IN_TWO_KEYS,
    ONE_SIDED,
    OrbitPoint,
    branch_point,
    others_outside,
)
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.sensitivity import value_of
from vibroplat.shooting.orbits import Chart
from vibroplat.study.pool import Task, Tasks
from vibroplat.study.store import Record

#: Accuracy across the curve, in units of the unknowns, and most trials. From one side the zero is extrapolated when it
#: is as near as the third number, and each trial goes a part of the way.
ACCURACY, MAX_TRIALS, ZERO_DISTANCE, APPROACH = 1e-7, 14, 1e-4, 0.9
#: First trial beside a point of the curve, and the farthest.
FIRST_OFFSET, MAX_OFFSET = 2e-3, 0.2
#: Steps grow and shrink by these. Where the second key hardly changes, the direction's part along it counts as no less
#: than the third number.
GROWTH, REDUCTION, FLAT = 1.4, 0.5, 0.05
#: Minimum cosine between neighbouring directions of the curve.
MIN_TANGENT_COSINE = 0.9


class BoundaryTracer:
    """A boundary of a kind, in one sense of the second key, 1 or −1.

    Its word is the sequence of events on the side where the test function is known; ``low`` and ``high`` are the ends
    of the keys' ranges, in units of the unknowns, shape (2,).
    """

    def __init__(self, problem: Problem, kind: str, word: str, sense: float, low: FloatArray, high: FloatArray) -> None:
        self.problem, self.kind, self.word, self.sense, self.low, self.high = problem, kind, word, sense, low, high
        self._across = np.zeros(0)  # in which the test function grows, at the last point
        # an orbit beside the last point: nearer to a discontinuity a multiplier may grow without bounds
        self.beside: OrbitPoint | None = None

    def follow(self, chart: Chart, u: FloatArray, first: float, largest: float, least: float) -> Iterator[OrbitPoint]:
        """Follow the curve from unknowns near it to the end of a key's range; yield its points with their tangents.

        The steps are changes of the second key, in units of the unknowns.

        Raises
        ------
        NoConvergenceError
            The curve cannot be followed farther; the message says why.
        """
        point, step = self._first_point(chart, u), first
        yield point
        while True:
            try:
                next_point = self._correct_on_curve(point, point.u + step * point.tangent, point.tangent)
                way = next_point.u - point.u
                if way @ point.tangent < MIN_TANGENT_COSINE * np.linalg.norm(way) * np.linalg.norm(point.tangent):
                    raise NoConvergenceError("the boundary turns too sharply")
            except NoConvergenceError:
                step *= REDUCTION
                if step < least:
                    raise
                continue
            inside = np.clip(next_point.u[-2:], self.low, self.high)
            for index in np.flatnonzero(inside != next_point.u[-2:])[:1] - 2:
                if abs(point.u[index] - inside[index]) > ACCURACY:  # not there already
                    yield self._at_end(point, next_point, index, inside[index])
                return
            yield next_point
            tangent = self._tangent(next_point, way)
            scale = 1.0 if self.kind == BRANCH_POINT else max(abs(float(way[-1])) / float(np.linalg.norm(way)), FLAT)
            step = min(step * GROWTH, largest / scale)
            point = self._far_from_events(replace(next_point, tangent=tangent))

    def _tangent(self, near: NewtonResult, way: FloatArray) -> FloatArray:
        """Direction of the curve: of length 1 in the surface of orbits, or of branch points over the second key."""
        if self.kind == BRANCH_POINT:
            return np.asarray(way / abs(way[-1]))
        surface = _surface(near)
        along = surface.T @ (surface @ way)
        return np.asarray(along / np.linalg.norm(along))

    def _first_point(self, chart: Chart, u: FloatArray) -> OrbitPoint:
        """Find the point of the curve near unknowns, with the tangent in the sense of the second key."""
        keys = np.eye(u.size)[-2:]
        if self.kind == BRANCH_POINT:
            jacobian = self.problem.shoot(chart, u).jacobian
            point, neighbour = (
                branch_point(self.problem, chart, u + length * keys[1], jacobian, keys[1:])[0]
                for length in (0.0, FIRST_OFFSET * self.sense)
            )
            return OrbitPoint.of(point, self._tangent(point, neighbour.u - point.u))
        first = self._orbit_beside(chart, u, keys)
        surface, slopes, test = _surface(first), np.zeros(2), IN_TWO_KEYS[self.kind]
        for i, direction in enumerate(surface):
            for length in (0.5 * FIRST_OFFSET, -0.5 * FIRST_OFFSET):
                with suppress(NoConvergenceError):
                    neighbour = self._orbit(chart, first.u + length * direction, surface, first.jacobian)
                    slopes[i] = (test(neighbour) - test(first)) / length
                    break
        if not slopes.any():
            raise NoConvergenceError("the test function has no slope")
        self._across = surface.T @ slopes / np.linalg.norm(slopes)
        along = surface.T @ np.array([-slopes[1], slopes[0]]) / np.linalg.norm(slopes)
        along *= math.copysign(1.0, along[-1] * self.sense)
        point = self._correct_on_curve(first, u, along)
        return replace(point, tangent=self._tangent(point, along))

    def _orbit_beside(self, chart: Chart, u: FloatArray, keys: FloatArray) -> OrbitPoint:
        """Find an orbit at the keys of unknowns, or beside them on the side where the test function is known."""
        missed = NoConvergenceError("no orbit beside the special point")
        for offset in (0.0, FIRST_OFFSET, -FIRST_OFFSET, 5.0 * FIRST_OFFSET, -5.0 * FIRST_OFFSET):
            try:
                return self._orbit(chart, u + offset * keys[0], keys)
            except NoConvergenceError as error:
                missed = error
        raise missed

    def _orbit(self, chart: Chart, u: FloatArray, border: FloatArray, jacobian: FloatArray | None = None) -> OrbitPoint:
        """Find the orbit near unknowns, orthogonally to both rows of a border; one whose test function is known."""
        point = OrbitPoint.of(correct(self.problem, chart, u, border, jacobian), border[0])
        if self.kind in ONE_SIDED and point.event_sequence != self.word:
            raise NoConvergenceError("beyond the boundary")
        if not math.isfinite(IN_TWO_KEYS[self.kind](point)):
            raise NoConvergenceError("the test function is not known")
        return point

    def _correct_on_curve(self, near: OrbitPoint, u: FloatArray, along: FloatArray) -> OrbitPoint:
        """Find the point of the curve from unknowns beside it, near another one, orthogonally to the curve.

        Its unknowns are those of the zero; its shot may be that of an orbit next to it.

        Raises
        ------
        NoConvergenceError
            It is not found.
        """
        if self.kind == BRANCH_POINT:
            key_border = np.eye(u.size)[-1:]
            return OrbitPoint.of(branch_point(self.problem, near.chart, u, near.jacobian, key_border)[0], along)
        surface, test = _surface(near), IN_TWO_KEYS[self.kind]
        within = surface @ along
        across = surface.T @ np.array([-within[1], within[0]])
        across *= math.copysign(1.0, across @ self._across) / np.linalg.norm(across)
        border = np.vstack([along, across])

        def at(offset: float, known: Sequence[TrialOrbit] = (), width: float = 0.0) -> OrbitPoint:
            return self._orbit(near.chart, u + offset * across, border, near.jacobian)

        known, offset = list[TrialOrbit](), 0.0
        while not known:
            try:
                point = at(offset)
                known.append(TrialOrbit(offset, test(point), point))
            except NoConvergenceError:
                offset = max(2.5 * offset, FIRST_OFFSET)
                if offset > MAX_OFFSET:
                    raise
        close, sides = (
            (ZERO_DISTANCE, OneSidedSearch(APPROACH)) if self.kind in ONE_SIDED else (ACCURACY, TwoSidedSearch())
        )
        root = locate(at, test, known, close, sides, step=FIRST_OFFSET, most=MAX_TRIALS, reach=2.0 * MAX_OFFSET)
        last = min(known, key=lambda k: abs(k.distance - root))
        if abs(last.distance - root) >= close:
            raise NoConvergenceError("the search across the curve does not converge")
        self._across = across
        self.beside = known[0].point if self.kind in ONE_SIDED else last.point
        if self.kind in ONE_SIDED:
            return replace(last.point, u=extrapolate(known, [k.point.u + k.point.newton_step(border) for k in known]))
        return replace(last.point, u=last.point.u + last.point.newton_step(border) + (root - last.distance) * across)

    def _at_end(self, before: OrbitPoint, after: OrbitPoint, index: int, end: float) -> OrbitPoint:
        """Find the point of the curve at the end of a key's range, between two in one chart."""
        one, other, key = before, after, np.eye(before.u.size)[index]
        for _ in range(MAX_TRIALS):
            apart = other.u - one.u
            guess = one.u + (end - one.u[index]) / apart[index] * apart
            one, other = other, self._correct_on_curve(after, guess, key)
            if abs(other.u[index] - end) < ACCURACY:
                return other
        raise NoConvergenceError("the end of the range is not met")

    def _far_from_events(self, point: OrbitPoint) -> OrbitPoint:
        """Move the section away from events, if it is near one."""
        across = point.tangent if self.kind == BRANCH_POINT else self._across
        moved = self.problem.move_from_events(point, point.tangent, across)
        if moved is None:
            return point
        chart, u, (along, across) = moved
        try:
            if self.kind == BRANCH_POINT:
                jacobian = self.problem.shoot(chart, u).jacobian
                result = branch_point(self.problem, chart, u, jacobian, np.eye(u.size)[-1:])[0]
            else:
                result = correct(self.problem, chart, u, np.vstack([along, across]))
        except NoConvergenceError:
            return point
        self._across = across
        return OrbitPoint.of(result, self._tangent(result, along))


def _surface(orbit: NewtonResult) -> FloatArray:
    """Directions of the surface of orbits, shape (2, m + 2)."""
    return np.asarray(np.linalg.svd(orbit.jacobian)[2][-2:])


@dataclass
class ComputedBoundary:
    """A boundary that has been followed from a special point of a branch: its points, and why it ended at both ends."""

    grid: Mapping[str, Any]
    branch: int
    kind: str
    rows: list[Record] = field(default_factory=list)
    ended: list[str] = field(default_factory=list)


def follow_boundary(scene: Scene, plan: OrbitsPlan, special: Record, boundary: ComputedBoundary) -> Tasks[None]:
    """Follow a boundary both ways from a special point."""
    for sense in (-1, 1):
        record = yield Task(_follow, (scene, plan, special, sense), lambda reason: {"rows": [], "ended": reason})
        rows = record["rows"]
        boundary.rows = [*reversed(rows), *boundary.rows] if sense < 0 else [*boundary.rows, *rows[1:]]
        boundary.ended.append(record["ended"])


def _follow(scene: Scene, plan: OrbitsPlan, special: Record, sense: int) -> Record:
    """Follow a boundary from a special point in one sense of the second key."""
    wanted = plan.boundaries
    assert wanted is not None
    units = np.array([plan.unit, wanted.unit])
    low, high = np.sort([[plan.start, wanted.start], [plan.stop, wanted.stop]], axis=0) / units
    first, largest, least = (length / wanted.unit for length in wanted.step.lengths(abs(wanted.stop - wanted.start)))
    rows: list[Record] = []
    with closing(Shooter(scene, [plan.key, wanted.key])) as shooter:
        state, values = np.array(special["state"]), [special["value"], value_of(scene, wanted.key)]
        shooter.set(values)
        problem = Problem(shooter, special["turns"], units.tolist(), plan.tolerance)
        chart = problem.chart(state)
        curve = BoundaryTracer(problem, special["kind"], special["word"], sense, low, high)
        try:
            for point in curve.follow(chart, chart.pack(state, special["period_s"], values), first, largest, least):
                row = problem.describe(point) | {"second": float(point.u[-1]) * wanted.unit}
                row["word"] = canonical_sequence(point.event_sequence, point.shot.restitution)
                rows.append(row | {"others_outside": others_outside(curve.kind, (curve.beside or point).multipliers)})
                if len(rows) >= wanted.max_points:
                    return {"rows": rows, "ended": f"max_points = {wanted.max_points} reached"}
        except NoConvergenceError as error:
            return {"rows": rows, "ended": f"no further orbit found: {error}"}
    return {"rows": rows, "ended": "end of a key's range"}
