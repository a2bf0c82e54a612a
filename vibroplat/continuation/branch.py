"""Branches of periodic orbits: pseudo-arclength continuation in one key (Keller 1977).

Each point is corrected orthogonally to the tangent of the branch at the point before. Where the mode on the section is
about to change, the section is moved along the orbit. Where the sequence of events changes, the branch may have a
corner, after which its direction is told by a determinant; over grazing it goes as :mod:`.grazing` says.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from vibroplat.config.scene import Scene
from vibroplat.continuation.grazing import over_grazing
from vibroplat.continuation.newton import ANGLE, Found, Frame, MissedError, Problem, bordered, correct, solved
from vibroplat.continuation.point import Point
from vibroplat.continuation.prediction import MOST, predicted
from vibroplat.continuation.shooting import Shot
from vibroplat.hybrid.modes import IMPACT
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.systems import GAP, GAP_RATE, SYSTEMS

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
#: Least cosine between the tangents of points with one sequence of events.
STRAIGHT = 0.6
#: Most that a point may lie beside its prediction, over the length of the step; the second where a step shorter than
#: ANGULAR changes the sequence of events, at which a branch may have a corner.
BESIDE, ANGULAR = (0.5, 5.0), 1e-3
#: Most that a point between two others may lie beside its prediction, over their distance.
ASIDE = 0.2
#: Length of the new tangent over its part along the old one, beyond which it is checked as a step is.
BENT = 1e3
#: The section is moved when the piece it lies in ends nearer to it than this part of the piece, or when it lies in
#: flight while contact takes at least a share of the period.
MARGIN, CONTACT_SHARE = 0.15, 0.06

#: How near an impact must be, as a part of its speed, to that below which impacts stick, for an end to be due to it.
NEARLY, LAW_JUMPS = 1e-4, "an impact reaches contact.sticking_speed_m_per_s, where rebounds begin"


@dataclass
class Steps:
    """Steps along a branch, in units of unknowns: the next and the least length, the largest change of the key."""

    now: float
    least: float
    largest: float

    def longest(self, point: Point) -> float:
        """Longest step that changes the key by at most the largest change, and the period by at most a part."""
        tangent, phase = point.tangent, point.frame.phase
        period = PERIOD * float(point.u[phase]) / max(abs(float(tangent[phase])), 1e-9)
        return min(self.largest / max(abs(float(tangent[-1])), FLAT), period)


class Look(Protocol):
    """What is shown a new point and the one before."""

    def __call__(self, before: Point, after: Point, *, strictly: bool) -> None:
        """Look at what happens between two points.

        Raises
        ------
        MissedError
            It cannot be told, and this is asked for ``strictly``.
        """


@dataclass
class Branch:
    """A branch while it grows.

    Attributes
    ----------
    problem
        Of one key.
    steps
        Changed as it grows.
    points
        So far.
    ended
        Why it has ended; empty while it has not.
    """

    problem: Problem
    steps: Steps
    points: list[Point] = field(default_factory=list)
    ended: str = ""

    def begin(self, frame: Frame, u: FloatArray, tangent: FloatArray, most: int = 20) -> Point:
        """Find the first point, orthogonally to a direction, in which the branch is to go.

        Raises
        ------
        MissedError
            There is no orbit.
        """
        found = correct(self.problem, frame, u, tangent[np.newaxis], most=most)
        point = self.in_middle(self.point(frame, found, tangent))
        self.points.append(point)
        return point

    def point(self, frame: Frame, found: Found, tangent: FloatArray) -> Point:
        """Make a point of an orbit, with the tangent nearest to a given one."""
        multipliers = self.problem.multipliers(frame, found.shot)
        value = float(found.u[-1]) * self.problem.units[0]
        return Point(frame, found, tangent_of(found.jacobian, tangent), multipliers, value)

    def beyond(self, point: Point, length: float, known: Sequence[Point] = ()) -> Point:
        """Find the point of the branch so far along the tangent at another one.

        Parameters
        ----------
        point, length
            Where it begins, and how far it goes.
        known
            Other points, the nearest first: the branch is expected to go on as from them to here.

        Raises
        ------
        MissedError
            There is none.
        """
        tangent = point.tangent
        u, jacobian = predicted([point, *known], point.u, tangent, length)
        found = correct(self.problem, point.frame, u, tangent[np.newaxis], jacobian)
        there = self.point(point.frame, found, tangent)
        angular = there.word != point.word and abs(length) < ANGULAR
        if np.linalg.norm(found.u - u) > (BESIDE[1] if angular else BESIDE[0]) * abs(length):
            raise MissedError("another branch was found")
        if self.problem.halves(there.frame, there.u):
            raise MissedError("an orbit of half the period was found")
        return there

    def between(
        self, points: Sequence[Point], origin: Point, direction: FloatArray, place: float, width: float
    ) -> Point:
        """Find the point at a place along a direction from an origin, between two that are so far apart.

        Parameters
        ----------
        points
            Those that are known, the nearest first.
        origin, direction, place, width
            Where it is to be.

        Raises
        ------
        MissedError
            There is none.
        """
        u, jacobian = predicted(points, origin.u, direction, place)
        found = correct(self.problem, origin.frame, u, direction[np.newaxis], jacobian)
        if np.linalg.norm(found.u - u) > ASIDE * width:
            raise MissedError("another branch was found")
        return self.point(origin.frame, found, direction)

    def grow(self, look: Look) -> bool:
        """Add a point, or say in ``ended`` why there is none; ``look`` is shown it and the one before, in one frame.

        Returns
        -------
        bool
            Whether there is one.
        """
        try:
            point = self._next(look)
        except MissedError as error:
            why = LAW_JUMPS if _law_jumps(self.points[-1].shot, self.problem.shooter.scene) else error.why
            self.ended = f"no point beyond: {why}"
            return False
        iterations = len(point.found.residuals)
        factor = LONGER if iterations <= EASY else 1.0 if iterations <= HARD else SHORTER
        self.steps.now = point.step * factor
        self.points.append(self.in_middle(point))
        return True

    def _next(self, look: Look) -> Point:
        """Find the next point and have it looked at, with ever shorter steps; from a part of the first, over grazing.

        Raises
        ------
        MissedError
            There is none.
        """
        steps, across, leapt = self.steps, None, False
        begun = steps.now = min(steps.now, steps.longest(self.points[-1]))
        while True:
            try:
                point = self._step()
                across = across or point
                return self._looked_at(point, look)
            except MissedError as error:
                missed = error
            steps.now *= 0.5
            if across is not None and steps.now < across.step * SKIPPED:
                return self._looked_at(across, look, strictly=False)
            if not leapt and steps.now < GRAZING * begun:
                leapt = True
                with contextlib.suppress(MissedError):
                    return self._looked_at(self._leap(), look)
            if steps.now < steps.least:
                raise missed

    def _step(self) -> Point:
        """Find the point that is a step away from the last one."""
        before, steps = self.points[-1], self.steps
        point = self.beyond(before, steps.now, self.points[-2 : -2 - MOST : -1])
        turns = point.tangent @ before.tangent < STRAIGHT and point.word == before.word
        if turns and steps.now > 20.0 * steps.least:
            raise MissedError("the branch turns too sharply")
        return oriented(point, before, steps.now)

    def _leap(self) -> Point:
        """Find a point beyond the grazing that is ahead."""
        before = self.points[-1]
        point = over_grazing(self)
        return oriented(point, before, float(np.linalg.norm(point.u - before.u)))

    def _looked_at(self, point: Point, look: Look, *, strictly: bool = True) -> Point:
        """Show a new point, and return it."""
        look(self.points[-1], point, strictly=strictly)
        return point

    def in_middle(self, point: Point) -> Point:
        """Move the section to the middle of the longest piece of contact, or of flight, if it is near an end."""
        there = to_middle(self.problem, point.frame, point.found, point.tangent)
        if there is None:
            return point
        frame, u, tangent = there
        try:
            moved = self.point(frame, correct(self.problem, frame, u, tangent[np.newaxis]), tangent)
        except MissedError:
            return point
        return replace(moved, step=point.step)


def _law_jumps(shot: Shot, scene: Scene) -> bool:
    """Whether an impact of an orbit is just as fast as those below which there is no rebound."""
    bound = scene.contact.sticking_speed_m_per_s
    speeds = -shot.events["rate_before"][shot.events["kind"] == IMPACT]
    return bool((np.abs(speeds - bound) < NEARLY * bound).any()) and scene.contact.restitution > 0.0


def to_middle(
    problem: Problem, frame: Frame, found: Found, direction: FloatArray
) -> tuple[Frame, FloatArray, FloatArray] | None:
    """Move the section of an orbit away from its events, if it is near one: the orbit and a direction on it."""
    when = moved_section(found.shot)
    if when <= 0.0:
        return None
    shooter = problem.shooter
    state, period, values = problem.unpack(frame, found.u)
    shooter.set(dict(zip(shooter.keys, values, strict=True)))
    way = shooter.shot(state, when, varied=True)
    if way.outcome != "ok":
        return None
    moved = way.state.copy()
    moved[3:5] -= 2.0 * np.pi * np.floor(moved[3:5] / (2.0 * np.pi))
    if GAP not in SYSTEMS[way.ends].places:
        moved[[GAP, GAP_RATE]] = 0.0
    there = Frame(moved, way.ends)
    return there, problem.pack(there, moved, period, values), _carried(problem, frame, there, way, direction)


def _carried(problem: Problem, frame: Frame, there: Frame, way: Shot, direction: FloatArray) -> FloatArray:
    """Carry a direction of unknowns along a part of an orbit, to another section."""
    assert way.derivative is not None
    assert way.rates is not None
    scales, count = problem.shooter.scales, frame.places.size
    start = np.zeros(scales.size)
    start[frame.places] = direction[:count]
    start[ANGLE] = 0.0
    change = way.derivative[:, : scales.size] @ (start * scales)
    change += way.derivative[:, scales.size :] @ (direction[count:] * np.array(problem.units))
    change -= way.rates * change[ANGLE] / way.rates[ANGLE]  # to the section
    carried = (change / scales)[there.places]
    carried[there.phase] = direction[frame.phase]
    carried = np.append(carried, direction[count:])
    return np.asarray(carried / np.linalg.norm(carried))


def tangent_of(jacobian: FloatArray, near: FloatArray) -> FloatArray:
    """Direction of length 1 in which the residual does not change, on the side of a given one."""
    right = np.zeros(near.size)
    right[-1] = 1.0
    found = solved(bordered(jacobian, near), right, BENT)
    return np.asarray(found / np.linalg.norm(found))


def oriented(point: Point, before: Point, step: float) -> Point:
    """Let the tangent of a point lead on from the point before, also where the sequence of events changes and it jumps.

    The determinant of Jacobian and tangent changes its sign at branch points only: not at folds, nor at corners, where
    the residual is continuous (Allgower and Georg 1990).
    """
    turned_round = point.word != before.word and point.branching * before.branching < 0.0
    return replace(point, tangent=-point.tangent if turned_round else point.tangent, step=step)


def moved_section(shot: Shot) -> float:
    """When to begin the period (s) so that the section is far from events; 0 if it is already."""
    pieces = joined(shot)
    if not shot.events.size:
        return 0.0
    here = pieces[0]
    contact = [p for p in pieces if SYSTEMS[p[0]].algebraic and p[2] - p[1] >= CONTACT_SHARE * shot.duration]
    best = max(contact or pieces, key=lambda p: p[2] - p[1])
    long_enough = min(-here[1], here[2]) > MARGIN * (here[2] - here[1])
    if long_enough and (SYSTEMS[here[0]].algebraic or not contact) and here[2] - here[1] > 0.5 * (best[2] - best[1]):
        return 0.0
    return float((0.5 * (best[1] + best[2])) % shot.duration)


def joined(shot: Shot) -> list[tuple[int, float, float]]:
    """Pieces of a period between events; the first begins before 0, where the last piece of the period does."""
    times = set(shot.events["t"].tolist())
    pieces: list[tuple[int, float, float]] = []
    for system, begin, end in shot.pieces:
        if pieces and pieces[-1][0] == system and begin not in times:
            pieces[-1] = (system, pieces[-1][1], end)
        else:
            pieces.append((system, begin, end))
    if len(pieces) > 1 and pieces[0][0] == pieces[-1][0] and 0.0 not in times:
        pieces[0] = (pieces[0][0], pieces[-1][1] - shot.duration, pieces[0][2])
        pieces.pop()
    return pieces
