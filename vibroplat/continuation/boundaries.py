"""Boundaries: curves of special points over two keys.

Orbits at two keys make a surface. On it a curve is followed on which a test function stays zero: a step along the
curve, then a search across it. Orbits are corrected with the directions along and across as borders, so that neither a
fold of the orbits nor a turn of the curve does any harm.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vibroplat.continuation.branch import to_middle
from vibroplat.continuation.crossings import Window
from vibroplat.continuation.event_sequence import turned
from vibroplat.continuation.kinds import (
    DOUBLING,
    END_OF_STICKING,
    FOLD,
    GRAZING,
    LIFTOFF,
    TORUS,
)
from vibroplat.continuation.newton import Found, Frame, MissedError, Problem, correct
from vibroplat.continuation.shooting import Shot
from vibroplat.continuation.special import extrapolated
from vibroplat.kernels.compiled import FloatArray

#: Accuracy across the curve, in units of the unknowns, and most trials.
ACROSS, TRIALS = 1e-7, 14
#: First trial beside a point of the curve, and the farthest.
BESIDE, FARTHEST = 2e-3, 0.2
#: Steps grow and shrink by these.
LONGER, SHORTER = 1.4, 0.5
#: Least cosine between neighbouring directions of the curve.
STRAIGHT = 0.9


@dataclass
class Spot:
    """An orbit at two keys.

    Attributes
    ----------
    frame, found, multipliers
        As of a point of a branch.
    tested
        Value of the test function.
    """

    frame: Frame
    found: Found
    multipliers: npt.NDArray[np.complex128]
    tested: float = math.nan

    @property
    def shot(self) -> Shot:
        """Over the period."""
        return self.found.shot

    @property
    def word(self) -> str:
        """Sequence of events."""
        return turned(self.shot.word)


def _torus(spot: Spot) -> float:
    pairs = np.abs(spot.multipliers[np.abs(spot.multipliers.imag) > 1e-9])
    return float(pairs[np.argmin(np.abs(pairs - 1.0))] - 1.0) if pairs.size else math.nan


def _finite(value: float) -> float:
    return value if math.isfinite(value) else math.nan


#: Test functions by kind. The last three are known on the side of the curve where the event is not there yet.
TESTS: dict[str, Callable[[Spot], float]] = {
    FOLD: lambda spot: float(np.prod(1.0 - spot.multipliers).real),
    DOUBLING: lambda spot: float(np.prod(1.0 + spot.multipliers).real),
    TORUS: _torus,
    LIFTOFF: lambda spot: _finite(spot.shot.least_force),
    END_OF_STICKING: lambda spot: _finite(spot.shot.landing_force),
    GRAZING: lambda spot: _finite(spot.shot.least_gap),
}
ONE_SIDED = (LIFTOFF, END_OF_STICKING, GRAZING)


@dataclass
class Curve:
    """A boundary while it grows, in one direction.

    Attributes
    ----------
    problem
        Of two keys.
    kind
        Of special points.
    word
        Sequence of events on the side where the test function is known.
    longest, least
        Steps along it, in units of the unknowns.
    """

    problem: Problem
    kind: str
    word: str
    longest: float
    least: float

    def spot(self, frame: Frame, u: FloatArray, border: FloatArray, jacobian: FloatArray | None) -> Spot:
        """Find the orbit near unknowns, orthogonally to both rows of a border.

        Raises
        ------
        MissedError
            There is none on which the test function is known.
        """
        found = correct(self.problem, frame, u, border, jacobian)
        spot = Spot(frame, found, self.problem.multipliers(frame, found.shot))
        if self.kind in ONE_SIDED and spot.word != self.word:
            raise MissedError("beyond the boundary")
        spot.tested = TESTS[self.kind](spot)
        if not math.isfinite(spot.tested):
            raise MissedError("the test function is not known")
        return spot

    def on_curve(self, frame: Frame, u: FloatArray, along: FloatArray, across: FloatArray, near: Spot) -> Spot:
        """Search across the curve for the zero of the test function, from unknowns beside it.

        The unknowns of what is returned are those of the zero; its orbit may lie next to it.

        Raises
        ------
        MissedError
            It is not found.
        """
        border = np.vstack([along, across])
        places: list[float] = []
        spots: list[Spot] = []
        place = 0.0
        for _ in range(TRIALS):
            try:
                spots.append(self.spot(frame, u + place * across, border, near.found.jacobian))
                places.append(place)
            except MissedError:
                if not places:  # the test function grows along ``across``
                    place = max(2.5 * place, BESIDE)
                    if place > FARTHEST:
                        raise
                else:
                    place = 0.5 * (place + places[-1])
                continue
            if len(places) == 1:
                place += BESIDE
                continue
            root = extrapolated(places[-3:], [s.tested for s in spots[-3:]])
            if root is None or abs(root) > 2.0 * FARTHEST:
                raise MissedError("the test function has no zero nearby")
            if abs(root - places[-1]) < ACROSS or spots[-1].tested == 0.0:
                last = spots[-1]
                last.found.u = last.found.u + (root - places[-1]) * across
                return last
            side = 1.0 if self.kind not in ONE_SIDED else 0.9
            place = places[-1] + side * (root - places[-1])
            if self.kind in ONE_SIDED and abs(root - places[-1]) < 1e-4:
                last = spots[-1]
                last.found.u = last.found.u + (root - places[-1]) * across
                return last
        raise MissedError("the search across the curve does not converge")


def plane(jacobian: FloatArray) -> FloatArray:
    """Directions of the surface of orbits, shape (2, m + 2)."""
    found: FloatArray = np.linalg.svd(jacobian)[2][-2:]
    return found


def follow(curve: Curve, frame: Frame, u: FloatArray, sense: float, first: float, window: Window) -> Iterator[Spot]:
    """Follow a curve from unknowns near it, in the sense of the second key, and yield its points up to a range's end.

    Raises
    ------
    MissedError
        The curve cannot be followed farther; the message says why.
    """
    keys = np.zeros((2, u.size))
    keys[0, -2], keys[1, -1] = 1.0, 1.0
    begun = _beside(curve, frame, u, keys)
    along, across = directions(curve, begun, sense)
    spot = curve.on_curve(frame, u, along, across, begun)
    yield spot
    step = first
    while True:
        surface = plane(spot.found.jacobian)
        along = surface.T @ (surface @ along)
        along /= np.linalg.norm(along)
        across = _orthogonal(surface, along, across)
        try:
            found = curve.on_curve(spot.frame, spot.found.u + step * along, along, across, spot)
            way = found.found.u - spot.found.u
            if way @ along < STRAIGHT * np.linalg.norm(way):
                raise MissedError("the boundary turns too sharply")
        except MissedError:
            step *= SHORTER
            if step < curve.least:
                raise
            continue
        along = way / np.linalg.norm(way)
        out = window.passed(found.found.u)
        if out is not None:
            if abs(spot.found.u[out[0]] - out[1]) > ACROSS:  # not there already
                yield _at_end(curve, spot, found, across, *out)
            return
        spot = found
        yield spot
        step = min(step * LONGER, curve.longest / max(abs(float(along[-1])), 0.05))
        spot, along, across = _on_section(curve, spot, along, across)


def _at_end(curve: Curve, before: Spot, after: Spot, across: FloatArray, place: int, end: float) -> Spot:
    """Find the point of a curve at the end of a key's range, between two in one frame."""
    one, other = before.found.u, after.found.u
    u = one + (end - one[place]) / (other[place] - one[place]) * (other - one)
    key = np.zeros(u.size)
    key[place] = 1.0
    surface = plane(after.found.jacobian)
    first, second = surface[:, place]
    level = surface.T @ np.array([second, -first])
    level *= math.copysign(1.0, level @ across) / np.linalg.norm(level)
    return curve.on_curve(before.frame, u, key, level, before)


def _beside(curve: Curve, frame: Frame, u: FloatArray, keys: FloatArray) -> Spot:
    """Find an orbit at the keys of given unknowns, or beside them on the side where the test function is known."""
    why = MissedError("no orbit beside the special point")
    for beside in (0.0, BESIDE, -BESIDE, 5.0 * BESIDE, -5.0 * BESIDE):
        try:
            return curve.spot(frame, u + beside * keys[0], keys, None)
        except MissedError as error:
            why = error
    raise why


def directions(curve: Curve, spot: Spot, sense: float) -> tuple[FloatArray, FloatArray]:
    """Find the directions along the curve, with the second key in a sense, and across it, up the test function."""
    surface = plane(spot.found.jacobian)
    slopes = np.zeros(2)
    for i, direction in enumerate(surface):
        for length in (0.5 * BESIDE, -0.5 * BESIDE):
            try:
                beside = curve.spot(spot.frame, spot.found.u + length * direction, surface, spot.found.jacobian)
            except MissedError:
                continue
            slopes[i] = (beside.tested - spot.tested) / length
            break
    if not slopes.any():
        raise MissedError("the test function has no slope")
    across = surface.T @ slopes / np.linalg.norm(slopes)
    along = surface.T @ np.array([-slopes[1], slopes[0]]) / np.linalg.norm(slopes)
    return along if along[-1] * sense > 0.0 else -along, across


def _orthogonal(surface: FloatArray, along: FloatArray, near: FloatArray) -> FloatArray:
    """Direction of the surface orthogonal to the one along the curve, on the side of the one before."""
    within = surface @ along
    across = surface.T @ np.array([-within[1], within[0]])
    across /= np.linalg.norm(across)
    return np.asarray(across if across @ near > 0.0 else -across)


def _on_section(curve: Curve, spot: Spot, along: FloatArray, across: FloatArray) -> tuple[Spot, FloatArray, FloatArray]:
    """Move the section away from events, if it is near one."""
    moved = to_middle(curve.problem, spot.frame, spot.found, along)
    turned_across = to_middle(curve.problem, spot.frame, spot.found, across)
    if moved is None or turned_across is None:
        return spot, along, across
    frame, u, there = moved
    try:
        border = np.vstack([there, turned_across[2]])
        found = correct(curve.problem, frame, u, border)
    except MissedError:
        return spot, along, across
    return Spot(frame, found, curve.problem.multipliers(frame, found.shot), spot.tested), there, turned_across[2]
