"""Branch points: where two branches cross, as the exciters leave symmetric motion.

Orbits next to a branch point are hard to correct, as the Jacobian is singular there. With some of a fixed vector in the
residual, r(u) + b v = 0, the problem is regular, and b is a smooth function on a plane through the branch point. There
it is 0 without a slope, and the directions in which it does not bend are those of the branches (Moore 1980).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from vibroplat.continuation.branch import to_middle
from vibroplat.continuation.newton import Found, Frame, MissedError, Problem, bordered, correct
from vibroplat.continuation.prediction import interpolated
from vibroplat.kernels.compiled import FloatArray

#: Distance at which slopes are compared to find how b bends, and the longest step, in units of the unknowns.
BESIDE, FARTHEST = 1e-3, 1.0
#: Largest last step to a branch point, after which no shot is taken: in units of the unknowns, and over the tolerance.
CLOSE, CLOSER = 1e-6, 100.0
#: Most steps, and the largest b, in the scales of the scene.
MOST, CROSSING = 10, 1e-6
#: Steps along a curve of branch points grow and shrink by these; farthest from the prediction, over the step, and from
#: the first point, in units of the unknowns.
LONGER, SHORTER, ASTRAY, ASIDE = 1.5, 0.5, 0.5, 1.0
#: Distance from the end of a range at which a curve is there, in units of the unknowns.
THERE = 1e-7
#: Points that the next one is predicted from.
KNOWN = 3


@dataclass(frozen=True)
class Window:
    """Ranges of both keys, in units of the unknowns.

    Attributes
    ----------
    low, high
        Their ends, shape (2,).
    """

    low: FloatArray
    high: FloatArray

    def passed(self, u: FloatArray) -> tuple[int, float] | None:
        """Return the place of the key that has left its range, −2 or −1, and the end that it has passed."""
        for place in (-2, -1):
            if not self.low[place] <= u[place] <= self.high[place]:
                return place, float((self.low if u[place] < self.low[place] else self.high)[place])
        return None


@dataclass
class Crossing:
    """A branch point.

    Attributes
    ----------
    frame, found
        The orbit; its unknowns are a last step ahead of its shot.
    directions
        Of both branches in the space of unknowns, of length 1.
    """

    frame: Frame
    found: Found
    directions: tuple[FloatArray, FloatArray]


def crossing(
    problem: Problem, frame: Frame, u: FloatArray, jacobian: FloatArray, held: FloatArray | None = None
) -> Crossing:
    """Find the branch point over the first key near some unknowns.

    Parameters
    ----------
    u, jacobian
        Unknowns, and nearly the Jacobian there.
    held
        Directions in which the unknowns stay, one for each other key.

    Raises
    ------
    MissedError
        There is none.
    """
    m = frame.places.size
    left, _, right = np.linalg.svd(jacobian[:, : m + 1])
    slack, plane = left[:, -1], np.zeros((2, u.size))
    plane[:, : m + 1] = right[-2:]
    border = plane if held is None else np.vstack([plane, held])

    def at(place: FloatArray, near: FloatArray) -> tuple[Found, FloatArray]:
        found = correct(problem, frame, u + place @ plane, border, near, slack=slack)
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
            return Crossing(frame, replace(found, u=found.u + step @ plane), _directions(bends, plane))
        place, before = place + step, slopes
        found, slopes = at(place, found.jacobian)
        bends += np.outer(slopes - before - bends @ step, step) / (step @ step)
    raise MissedError("no branch point nearby")


def _slopes(found: Found, border: FloatArray, slack: FloatArray) -> FloatArray:
    """Differentiate b by the place in the plane, shape (2,)."""
    m, free = found.jacobian.shape
    matrix = bordered(found.jacobian, border, columns=1)
    matrix[:m, free] = slack
    last = np.zeros(free + 1)
    last[-1] = 1.0
    try:
        return np.asarray(np.linalg.solve(matrix.T, last)[m : m + 2])
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


def follow_crossings(
    problem: Problem,
    frame: Frame,
    u: FloatArray,
    sense: float,
    steps: tuple[float, float, float],
    window: Window,
) -> Iterator[tuple[Frame, Found]]:
    """Follow a curve of branch points over both keys, by steps of the second one.

    Parameters
    ----------
    u
        Unknowns near a branch point.
    sense
        In which the second key goes, 1 or −1.
    steps
        The first, the longest and the least, in units of the unknowns.
    window
        Ranges of the keys, at whose ends the curve ends.

    Raises
    ------
    MissedError
        The curve cannot be followed farther.
    """
    held = np.zeros((1, u.size))
    held[0, -1] = 1.0
    step, longest, least = steps
    jacobian = problem.jacobian(frame, problem.shoot(frame, u, full=True)[1])
    known = [crossing(problem, frame, u, jacobian, held)]
    while True:
        last = known[-1]
        yield last.frame, last.found
        while True:
            places = [float(c.found.u[-1]) for c in known]
            second = places[-1] + sense * step
            guess: FloatArray = interpolated(places, [c.found.u for c in known], second)
            guess[-1] = second
            try:
                there = crossing(problem, last.frame, guess, last.found.jacobian, held)
                most = ASTRAY * float(np.linalg.norm(guess - last.found.u)) if len(known) > 1 else ASIDE
                if np.linalg.norm(there.found.u - guess) > most:
                    raise MissedError("another curve was found")
                break
            except MissedError:
                step *= SHORTER
                if step < least:
                    raise
        out = window.passed(there.found.u)
        if out is not None:
            if abs(last.found.u[out[0]] - out[1]) > THERE:  # not there already
                end = _at_end(problem, last, there, held, *out)
                yield end.frame, end.found
            return
        step = min(LONGER * step, longest)
        known = _moved(problem, [*known, there][-KNOWN:])


def _at_end(problem: Problem, before: Crossing, after: Crossing, held: FloatArray, place: int, end: float) -> Crossing:
    """Find the branch point at the end of a key's range, between two in one frame."""
    one, other = before, after
    for _ in range(MOST):
        apart = other.found.u - one.found.u
        guess = one.found.u + (end - one.found.u[place]) / apart[place] * apart
        one, other = other, crossing(problem, before.frame, guess, before.found.jacobian, held)
        if abs(other.found.u[place] - end) < THERE:
            return other
    raise MissedError("the end of the range is not met")


def _moved(problem: Problem, known: list[Crossing]) -> list[Crossing]:
    """Move the section of the last point away from events, if it is near one; the points before are then of no use."""
    last = known[-1]
    there = to_middle(problem, last.frame, last.found, last.directions[0])
    if there is None:
        return known
    frame, u, _ = there
    held = np.zeros((1, u.size))
    held[0, -1] = 1.0
    try:
        jacobian = problem.jacobian(frame, problem.shoot(frame, u, full=True)[1])
        return [crossing(problem, frame, u, jacobian, held)]
    except MissedError:
        return known
