"""Special points of branches: which there are between two points, and where exactly.

Each has a test function that is zero there. Some are known on one side only, as the least contact force of an orbit
that does not lift off; their zeros are extrapolated from that side.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from vibroplat.study.orbits.branch import NEUTRAL, Branch, Point
from vibroplat.study.orbits.newton import MissedError

#: Accuracy of the place of a special point along the branch, in units of the unknowns.
ACCURACY = 1e-10
#: Evaluations from one side, and what part of the way to the extrapolated zero each goes.
SIDED, APPROACH = 9, 0.9

FOLD, DOUBLING, TORUS, BRANCH_POINT = "fold", "period-doubling", "neimark-sacker", "branch-point"
LIFTOFF, END_OF_STICKING, GRAZING = "liftoff", "end-of-sticking", "grazing"

#: What happens at each kind, for people.
KINDS = {
    FOLD: "two orbits merge and vanish",
    DOUBLING: "an orbit of twice the period branches off",
    TORUS: "quasi-periodic motion branches off",
    BRANCH_POINT: "another branch crosses, as where symmetry breaks",
    LIFTOFF: "contact is lost for the first time",
    END_OF_STICKING: "the material no longer stays on the platform after it lands",
    GRAZING: "an impact appears or vanishes with zero speed",
}


@dataclass
class Special:
    """A special point.

    Attributes
    ----------
    kind
        One of KINDS.
    point
        The orbit there, or next to it.
    value
        Of the key there.
    """

    kind: str
    point: Point
    value: float


Test = Callable[[Point], float]


def fold(point: Point) -> float:
    """Component of the tangent along the key."""
    return float(point.tangent[-1])


def doubling(point: Point) -> float:
    """Product of 1 + multipliers."""
    return float(np.prod(1.0 + point.multipliers).real)


def branching(point: Point) -> float:
    """Determinant of the Jacobian with the tangent, which changes its sign where branches cross."""
    sign, size = np.linalg.slogdet(np.vstack([point.found.jacobian, point.tangent]))
    return float(sign * math.exp(min(size, 700.0)))


def torus(point: Point) -> float:
    """How far the largest pair of complex multipliers is outside the unit circle."""
    pairs = np.abs(point.multipliers[np.abs(point.multipliers.imag) > 1e-9])
    return float(pairs.max() - 1.0) if pairs.size else math.nan


def specials(branch: Branch, before: Point, after: Point) -> Iterator[Special]:
    """Find the special points between two neighbouring points in one frame."""
    if before.word != after.word:
        found = corner(branch, before, after)
        if found is not None:
            yield found
    if before.tangent[-1] * after.tangent[-1] < 0.0:
        yield located(branch, before, after, FOLD, fold)
    if before.word != after.word:
        return  # multipliers may jump there, and pass infinity
    if doubling(before) * doubling(after) < 0.0:
        yield located(branch, before, after, DOUBLING, doubling)
    if branching(before) * branching(after) < 0.0:
        yield located(branch, before, after, BRANCH_POINT, branching)
    if outside(before) != outside(after) and torus(before) * torus(after) < 0.0:
        yield located(branch, before, after, TORUS, torus)


def outside(point: Point) -> int:
    """Number of complex multipliers outside the unit circle."""
    complex_ones = np.abs(point.multipliers.imag) > 1e-9
    return int((complex_ones & (np.abs(point.multipliers) > 1.0 + NEUTRAL)).sum())


def located(branch: Branch, before: Point, after: Point, kind: str, test: Test) -> Special:
    """Find the zero of a test function between two points."""
    last = [after]

    def at(length: float) -> float:
        if length == 0.0:
            return test(before)
        last[0] = branch.beyond(before, length)
        return test(last[0])

    try:
        length = float((after.u - before.u) @ before.tangent)
        root = brentq(at, 0.0, length, xtol=ACCURACY, rtol=4.0 * np.finfo(float).eps, maxiter=60)
        point = branch.beyond(before, root)
    except (MissedError, ValueError):
        point = last[0]
    return Special(kind, point, point.value)


def corner(branch: Branch, before: Point, after: Point) -> Special | None:
    """Find where the sequence of events changes between two points, from the side that knows how far it is."""
    for kind, measure, known in (
        (LIFTOFF, lambda p: p.shot.least_force, lambda p, other: not p.word and other.word),
        (END_OF_STICKING, lambda p: p.shot.landing_force, lambda p, other: p.word.count("S") > other.word.count("S")),
        (GRAZING, lambda p: p.shot.least_gap, lambda p, other: len(p.word) < len(other.word)),
        (GRAZING, lambda p: p.shot.least_force, lambda p, other: len(p.word) < len(other.word)),
    ):
        for near, far in ((before, after), (after, before)):
            if known(near, far) and math.isfinite(measure(near)):
                found = approached(branch, before, near, far, measure)
                if found is not None:
                    kind_here = LIFTOFF if kind == GRAZING and measure(near) == near.shot.least_force else kind
                    return Special(kind_here, *found)
    return None


def approached(branch: Branch, origin: Point, near: Point, far: Point, measure: Test) -> tuple[Point, float] | None:
    """Approach the zero of a test function from the side of a point; the last orbit on the way, and the key there."""
    place = {id(p): float((p.u - origin.u) @ origin.tangent) for p in (near, far)}
    here, limit = place[id(near)], place[id(far)]
    places, tests, values = [here], [measure(near)], [near.value]
    last, target, reached = near, 0.5 * (here + limit), limit
    for _ in range(SIDED + 8):
        try:
            tried = branch.beyond(origin, target) if target != 0.0 else origin
            valid = tried.word == near.word and math.isfinite(measure(tried))
        except MissedError:
            valid = False
        if not valid:
            limit = target
            target = places[-1] + 0.5 * (limit - places[-1])
        else:
            last = tried
            places.append(target)
            tests.append(measure(tried))
            values.append(tried.value)
            root = extrapolated(places[-3:], tests[-3:])
            if root is None:
                return None
            if abs(root - reached) < ACCURACY * 10.0 or len(places) > SIDED:
                reached = root
                break
            reached = root
            target = places[-1] + APPROACH * (root - places[-1])
        if abs(target - places[-1]) < ACCURACY:
            break
    if len(places) < 3:
        return None
    value = float(np.polyval(np.polyfit(np.array(places[-3:]) - places[-1], values[-3:], 2), reached - places[-1]))
    return last, value


def extrapolated(places: list[float], tests: list[float]) -> float | None:
    """Zero of the inverse polynomial through up to three points."""
    x, f = np.array(places), np.array(tests)
    if np.unique(f).size < f.size:
        return None
    total = 0.0
    for i in range(x.size):
        weight = 1.0
        for j in range(x.size):
            if j != i:
                weight *= -f[j] / (f[i] - f[j])
        total += x[i] * weight
    return float(total) if math.isfinite(total) else None
