"""Boundaries: curves of special points over two keys, and their check by settled motion on both sides.

Orbits at two keys make a surface. On it a curve is followed on which a test function stays zero: a step along the
curve, then a search across it. Orbits are corrected with the directions along and across as borders, so that neither a
fold of the orbits nor a turn of the curve does any harm. Branch points are followed by steps of the second key.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from vibroplat.config.plans import UNITS, OrbitsPlan, SweepPlan
from vibroplat.config.scene import Scene
from vibroplat.continuation.locate import BothSides, OneSide, Tried, at_zero, locate
from vibroplat.continuation.newton import Chart, MissedError, NewtonResult, Problem, correct
from vibroplat.continuation.shooting import Shooter, rotated, spelled
from vibroplat.continuation.special_points import (
    BRANCH_POINT,
    DOUBLING,
    IN_TWO_KEYS,
    NEIMARK_SACKER,
    ONE_SIDED,
    Point,
    branch_point,
    others_outside,
)
from vibroplat.errors import ConfigError
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.sensitivity import value_of
from vibroplat.study.point import measure_point
from vibroplat.study.pool import Task, Tasks
from vibroplat.study.store import Record

#: Accuracy across the curve, in units of the unknowns, and most trials. From one side the zero is extrapolated when it
#: is as near as the third number, and each trial goes a part of the way.
ACROSS, TRIALS, CLOSE, APPROACH = 1e-7, 14, 1e-4, 0.9
#: First trial beside a point of the curve, and the farthest.
BESIDE, FARTHEST = 2e-3, 0.2
#: Steps grow and shrink by these. Where the second key hardly changes, the direction's part along it counts as no less
#: than the third number.
LONGER, SHORTER, FLAT = 1.4, 0.5, 0.05
#: Least cosine between neighbouring directions of the curve.
STRAIGHT = 0.9

#: Distances from the curve, across it, over the ranges of the keys, one after the other until both sides differ as they
#: should: nearer ones, where settling takes longer, only where another boundary is as near.
DISTANCES = (1.0 / 400.0, 1.0 / 2000.0, 1.0 / 10000.0)
#: Motion that does not repeat settles this long (s); a sweep gives motion that draws together some times as much.
LONGEST = 20.0
#: A motion that stays by an orbit is nearer to it than one that has left it by this factor.
NEARER = 3.0
AGREES, DIFFERS, UNDECIDED, UNSTABLE, FAILED = "agrees", "differs", "undecided", "unstable", "failed"


class Curve:
    """A boundary of a kind, in one sense of the second key, 1 or −1.

    Its word is the sequence of events on the side where the test function is known; ``low`` and ``high`` are the ends
    of the keys' ranges, in units of the unknowns, shape (2,).
    """

    def __init__(self, problem: Problem, kind: str, word: str, sense: float, low: FloatArray, high: FloatArray) -> None:
        self.problem, self.kind, self.word, self.sense, self.low, self.high = problem, kind, word, sense, low, high
        self._across = np.zeros(0)  # in which the test function grows, at the last point
        # an orbit beside the last point: nearer to a discontinuity a multiplier may grow without bounds
        self.beside: Point | None = None

    def follow(self, chart: Chart, u: FloatArray, first: float, longest: float, least: float) -> Iterator[Point]:
        """Follow the curve from unknowns near it to the end of a key's range; yield its points with their tangents.

        The steps are changes of the second key, in units of the unknowns.

        Raises
        ------
        MissedError
            The curve cannot be followed farther; the message says why.
        """
        point, step = self._begun(chart, u), first
        yield point
        while True:
            try:
                found = self._on_curve(point, point.u + step * point.tangent, point.tangent)
                way = found.u - point.u
                if way @ point.tangent < STRAIGHT * np.linalg.norm(way) * np.linalg.norm(point.tangent):
                    raise MissedError("the boundary turns too sharply")
            except MissedError:
                step *= SHORTER
                if step < least:
                    raise
                continue
            inside = np.clip(found.u[-2:], self.low, self.high)
            for place in np.flatnonzero(inside != found.u[-2:])[:1] - 2:
                if abs(point.u[place] - inside[place]) > ACROSS:  # not there already
                    yield self._at_end(point, found, place, inside[place])
                return
            yield found
            tangent = self._tangent(found, way)
            scale = 1.0 if self.kind == BRANCH_POINT else max(abs(float(way[-1])) / float(np.linalg.norm(way)), FLAT)
            step = min(step * LONGER, longest / scale)
            point = self._far_from_events(replace(found, tangent=tangent))

    def _tangent(self, near: NewtonResult, way: FloatArray) -> FloatArray:
        """Direction of the curve: of length 1 in the surface of orbits, or of branch points over the second key."""
        if self.kind == BRANCH_POINT:
            return np.asarray(way / abs(way[-1]))
        surface = _surface(near)
        along = surface.T @ (surface @ way)
        return np.asarray(along / np.linalg.norm(along))

    def _begun(self, chart: Chart, u: FloatArray) -> Point:
        """Find the point of the curve near unknowns, with the tangent in the sense of the second key."""
        keys = np.eye(u.size)[-2:]
        if self.kind == BRANCH_POINT:
            jacobian = self.problem.jacobian(chart, self.problem.shoot(chart, u, full=True)[1])
            point, beside = (
                branch_point(self.problem, chart, u + length * keys[1], jacobian, keys[1:])[0]
                for length in (0.0, BESIDE * self.sense)
            )
            return Point.of(point, self._tangent(point, beside.u - point.u))
        begun = self._beside(chart, u, keys)
        surface, slopes, test = _surface(begun), np.zeros(2), IN_TWO_KEYS[self.kind]
        for i, direction in enumerate(surface):
            for length in (0.5 * BESIDE, -0.5 * BESIDE):
                with suppress(MissedError):
                    beside = self._orbit(chart, begun.u + length * direction, surface, begun.jacobian)
                    slopes[i] = (test(beside) - test(begun)) / length
                    break
        if not slopes.any():
            raise MissedError("the test function has no slope")
        self._across = surface.T @ slopes / np.linalg.norm(slopes)
        along = surface.T @ np.array([-slopes[1], slopes[0]]) / np.linalg.norm(slopes)
        along *= math.copysign(1.0, along[-1] * self.sense)
        point = self._on_curve(begun, u, along)
        return replace(point, tangent=self._tangent(point, along))

    def _beside(self, chart: Chart, u: FloatArray, keys: FloatArray) -> Point:
        """Find an orbit at the keys of unknowns, or beside them on the side where the test function is known."""
        missed = MissedError("no orbit beside the special point")
        for beside in (0.0, BESIDE, -BESIDE, 5.0 * BESIDE, -5.0 * BESIDE):
            try:
                return self._orbit(chart, u + beside * keys[0], keys)
            except MissedError as error:
                missed = error
        raise missed

    def _orbit(self, chart: Chart, u: FloatArray, border: FloatArray, jacobian: FloatArray | None = None) -> Point:
        """Find the orbit near unknowns, orthogonally to both rows of a border; one whose test function is known."""
        point = Point.of(correct(self.problem, chart, u, border, jacobian), border[0])
        if self.kind in ONE_SIDED and point.word != self.word:
            raise MissedError("beyond the boundary")
        if not math.isfinite(IN_TWO_KEYS[self.kind](point)):
            raise MissedError("the test function is not known")
        return point

    def _on_curve(self, near: Point, u: FloatArray, along: FloatArray) -> Point:
        """Find the point of the curve from unknowns beside it, near another one, orthogonally to the curve.

        Its unknowns are those of the zero; its shot may be that of an orbit next to it.

        Raises
        ------
        MissedError
            It is not found.
        """
        if self.kind == BRANCH_POINT:
            held = np.eye(u.size)[-1:]
            return Point.of(branch_point(self.problem, near.chart, u, near.jacobian, held)[0], along)
        surface, test = _surface(near), IN_TWO_KEYS[self.kind]
        within = surface @ along
        across = surface.T @ np.array([-within[1], within[0]])
        across *= math.copysign(1.0, across @ self._across) / np.linalg.norm(across)
        border = np.vstack([along, across])

        def at(place: float, known: Sequence[Tried] = (), width: float = 0.0) -> Point:
            return self._orbit(near.chart, u + place * across, border, near.jacobian)

        known, place = list[Tried](), 0.0
        while not known:
            try:
                point = at(place)
                known.append(Tried(place, test(point), point))
            except MissedError:
                place = max(2.5 * place, BESIDE)
                if place > FARTHEST:
                    raise
        close, sides = (CLOSE, OneSide(APPROACH)) if self.kind in ONE_SIDED else (ACROSS, BothSides())
        root = locate(at, test, known, close, sides, step=BESIDE, most=TRIALS, reach=2.0 * FARTHEST)
        last = min(known, key=lambda k: abs(k.place - root))
        if abs(last.place - root) >= close:
            raise MissedError("the search across the curve does not converge")
        self._across = across
        self.beside = known[0].point if self.kind in ONE_SIDED else last.point
        if self.kind in ONE_SIDED:
            return replace(last.point, u=at_zero(known, [k.point.u + k.point.newton_step(border) for k in known]))
        return replace(last.point, u=last.point.u + last.point.newton_step(border) + (root - last.place) * across)

    def _at_end(self, before: Point, after: Point, place: int, end: float) -> Point:
        """Find the point of the curve at the end of a key's range, between two in one chart."""
        one, other, key = before, after, np.eye(before.u.size)[place]
        for _ in range(TRIALS):
            apart = other.u - one.u
            guess = one.u + (end - one.u[place]) / apart[place] * apart
            one, other = other, self._on_curve(after, guess, key)
            if abs(other.u[place] - end) < ACROSS:
                return other
        raise MissedError("the end of the range is not met")

    def _far_from_events(self, point: Point) -> Point:
        """Move the section away from events, if it is near one."""
        across = point.tangent if self.kind == BRANCH_POINT else self._across
        moved = self.problem.far_from_events(point, point.tangent, across)
        if moved is None:
            return point
        chart, u, (along, across) = moved
        try:
            if self.kind == BRANCH_POINT:
                jacobian = self.problem.jacobian(chart, self.problem.shoot(chart, u, full=True)[1])
                found = branch_point(self.problem, chart, u, jacobian, np.eye(u.size)[-1:])[0]
            else:
                found = correct(self.problem, chart, u, np.vstack([along, across]))
        except MissedError:
            return point
        self._across = across
        return Point.of(found, self._tangent(found, along))


def _surface(orbit: NewtonResult) -> FloatArray:
    """Directions of the surface of orbits, shape (2, m + 2)."""
    return np.asarray(np.linalg.svd(orbit.jacobian)[2][-2:])


@dataclass
class Boundary:
    """A boundary that has been followed from a special point of a branch: its points, and why it ended at both ends."""

    grid: Mapping[str, Any]
    branch: int
    kind: str
    rows: list[Record] = field(default_factory=list)
    ended: list[str] = field(default_factory=list)


def follow_boundary(scene: Scene, plan: OrbitsPlan, special: Record, boundary: Boundary) -> Tasks[None]:
    """Follow a boundary both ways from a special point, then check it."""
    for sense in (-1, 1):
        record = yield Task(_one_way, (scene, plan, special, sense), lambda reason: {"rows": [], "ended": reason})
        rows = record["rows"]
        boundary.rows = [*reversed(rows), *boundary.rows] if sense < 0 else [*boundary.rows, *rows[1:]]
        boundary.ended.append(record["ended"])
    for place, way in chosen(boundary.rows, plan).items():
        row = boundary.rows[place]
        found = yield Task(check, (scene, plan, boundary.kind, row, way), lambda _reason: {"check": FAILED})
        boundary.rows[place] = row | found


def _one_way(scene: Scene, plan: OrbitsPlan, special: Record, sense: int) -> Record:
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
        curve = Curve(problem, special["kind"], special["word"], sense, low, high)
        try:
            for point in curve.follow(chart, chart.pack(state, special["period_s"], values), first, largest, least):
                row = problem.describe(point) | {"second": float(point.u[-1]) * wanted.unit}
                row["word"] = rotated(point.word, point.shot.restitution)
                rows.append(row | {"others_outside": others_outside(curve.kind, (curve.beside or point).multipliers)})
                if len(rows) >= wanted.max_points:
                    return {"rows": rows, "ended": f"max_points = {wanted.max_points} reached"}
        except MissedError as error:
            return {"rows": rows, "ended": f"no point beyond: {error}"}
    return {"rows": rows, "ended": "end of a key's range"}


class Side(NamedTuple):
    """What was found on one side of a boundary: events, and distance from the orbit there on φ₁ = 0, in scales."""

    period: int  # turns; 0 if the motion does not repeat
    word: str
    distance: float

    @property
    def text(self) -> str:
        """For tables."""
        return f"period {self.period}: {spelled(self.word)}" if self.period else "no period"


def chosen(rows: Sequence[Record], plan: OrbitsPlan) -> dict[int, tuple[float, float]]:
    """Choose the points of a curve that are checked: inner ones, evenly along it.

    Returns
    -------
    ways
        The direction across the curve, to where the first key is larger, in units of the keys, by the number of a row.
    """
    if len(rows) < 3:
        return {}
    assert plan.boundaries is not None
    places = np.array([[row["value"], row["second"]] for row in rows]) / (plan.unit, plan.boundaries.unit)
    lengths = np.append(0.0, np.cumsum(np.hypot(*np.diff(places, axis=0).T)))
    wanted = lengths[-1] * (np.arange(plan.boundaries.check) + 0.5) / max(plan.boundaries.check, 1)
    ways: dict[int, tuple[float, float]] = {}
    for place in sorted({int(np.abs(lengths[1:-1] - length).argmin()) + 1 for length in wanted}):
        one, other = (places[place + 1] - places[place - 1]).tolist()
        length = math.copysign(math.hypot(one, other), other) or 1.0
        ways[place] = other / length, -one / length
    return ways


def check(scene: Scene, plan: OrbitsPlan, kind: str, row: Record, way: tuple[float, float]) -> Record:
    """Settle on both sides of a point of a curve, and compare with what its kind says.

    A stable orbit leads to the motion on its own side; beyond the boundary the motion goes elsewhere, or has other
    events. Where branches cross, only how far it goes may tell the sides apart.

    Parameters
    ----------
    kind, row
        Of the curve, and its point with the orbit there.
    way
        Direction across the curve, in units of the keys, from below to above.

    Returns
    -------
    record
        The columns ``below``, ``above`` and ``check`` of the table of boundaries.
    """
    if row["others_outside"]:
        return {"check": UNSTABLE}
    assert plan.boundaries is not None
    keys, units = (plan.key, plan.boundaries.key), (plan.unit, plan.boundaries.unit)
    place = np.array([row["value"], row["second"]])
    found: Record = {"check": FAILED}
    with closing(Shooter(scene, keys)) as shooter:
        shooter.set(place.tolist())
        shooter.motion.reset(np.array(row["state"]))
        crossings = []  # of the section φ₁ = 0
        for _ in range(row["period"]):
            shooter.motion.to_section(1, 2.0 * row["period_s"])
            crossings.append(_in_scales(shooter.motion.state, shooter))
        orbit = np.array(crossings)
        for share in DISTANCES:
            change = share * UNITS * np.array(way) * units
            below, above = (_settled(shooter, (place + sense * change).tolist(), row, orbit) for sense in (-1.0, 1.0))
            if below is None or above is None:
                continue
            told = {"below": below.text, "above": above.text}
            if differ(kind, row, below, above):
                return told | {"check": AGREES}
            if found["check"] != DIFFERS:
                found = told | {"check": DIFFERS if below.period or above.period else UNDECIDED}
    return found


def differ(kind: str, row: Record, below: Side, above: Side) -> bool:
    """Whether what was found on both sides of a boundary differs as its kind says."""
    turns: int = row["period"]
    repeats = [side.period == turns for side in (below, above)]
    stays = [again and side.word == row["word"] for again, side in zip(repeats, (below, above), strict=True)]
    if kind in ONE_SIDED:
        return stays[0] != stays[1]
    if kind in (DOUBLING, NEIMARK_SACKER):
        return repeats[0] != repeats[1] and any(stays)
    near, far = sorted((below.distance, above.distance))
    return repeats[0] != repeats[1] or NEARER * near < far


def _settled(shooter: Shooter, values: list[float], row: Record, orbit: FloatArray) -> Side | None:
    """Let the motion settle from an orbit nearby; None if the values of the keys are not allowed or it ends early."""
    try:
        scene = shooter.scene.replace(dict(zip(shooter.keys, values, strict=True)))
    except ConfigError:
        return None
    supply = scene.drive.at(0.0).frequency_at(0.0)
    settle = {"max_settle_s": LONGEST, "measure_s": row["period_s"], "lyapunov": False, "settle": "motion"}
    plan = SweepPlan.model_validate({"supply_frequency_hz": {"start": supply, "stop": supply}} | settle)
    point = measure_point(scene, plan, row["state"], (0,))
    if point.state is None:
        return None
    period, state, word = int(point.row["period"]), np.array(point.state), ""
    if period:
        shooter.set(values)
        shot = shooter.shot(state, period / abs(point.row["excitation_frequency_hz"]))
        word = rotated(shot.word, scene.contact.restitution)
    distance = np.abs(orbit - _in_scales(state, shooter)).max(axis=1).min()
    return Side(period, word, float(distance))


def _in_scales(state: FloatArray, shooter: Shooter) -> FloatArray:
    """Return a state on the section in the scales of the scene, with the phase difference instead of the angles."""
    found = state / shooter.scales
    phase = state[3:5] @ shooter.scene.phase_weights
    found[3:5] = math.cos(phase), math.sin(phase)
    return found
