"""Special points of branches: which there are between two points, and where exactly.

Each has a test function that is zero there. Some are known on one side only, as the least contact force of an orbit
that does not lift off; their zeros are extrapolated from that side.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from vibroplat.kernels.compiled import FloatArray
from vibroplat.study.orbits.branch import NEUTRAL, Branch, Point, hermite
from vibroplat.study.orbits.kinds import (
    BRANCH_POINT,
    DOUBLING,
    END_OF_STICKING,
    FOLD,
    GRAZING,
    LIFTOFF,
    TORUS,
)
from vibroplat.study.orbits.newton import MissedError

#: Accuracy of the place of a special point along the branch, in units of the unknowns.
ACCURACY = 1e-10
#: Evaluations from one side, and what part of the way to the extrapolated zero each goes.
SIDED, APPROACH = 7, 0.95
#: Distance of a known orbit from the zero at which it is interpolated; nearer to a branch point than the second, an
#: orbit cannot be told from those of the branch that crosses.
NARROW, BLURRED = 1e-4, 1e-3
#: How far beside a point that cannot be found others are tried, as a part of the way.
ASIDE = 0.1
#: Most evaluations between two points.
LOCATING = 12


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
    direction
        Of the branch there, from neighbour to neighbour: where branches cross, a point has no single tangent.
    """

    kind: str
    point: Point
    value: float
    direction: FloatArray


Test = Callable[[Point], float]


def fold(point: Point) -> float:
    """Component of the tangent along the key."""
    return float(point.tangent[-1])


def doubling(point: Point) -> float:
    """Product of 1 + multipliers."""
    return float(np.prod(1.0 + point.multipliers).real)


def branching(point: Point) -> float:
    """Return the determinant of the Jacobian with the tangent, which changes its sign where branches cross."""
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
    folds = before.tangent[-1] * after.tangent[-1] < 0.0
    if before.word != after.word:
        if folds:
            yield located(branch, before, after, FOLD, fold)
        return  # multipliers may jump there, and pass infinity
    crosses = branching(before) * branching(after) < 0.0
    if folds:  # at a pitchfork the branch that bends crosses the straight one
        yield located(branch, before, after, BRANCH_POINT if crosses else FOLD, fold)
    elif crosses:
        yield located(branch, before, after, BRANCH_POINT, branching)
    if doubling(before) * doubling(after) < 0.0:
        yield located(branch, before, after, DOUBLING, doubling)
    if outside(before) != outside(after) and torus(before) * torus(after) < 0.0:
        yield located(branch, before, after, TORUS, torus)


def outside(point: Point) -> int:
    """Count the complex multipliers outside the unit circle."""
    complex_ones = np.abs(point.multipliers.imag) > 1e-9
    return int((complex_ones & (np.abs(point.multipliers) > 1.0 + NEUTRAL)).sum())


def located(branch: Branch, before: Point, after: Point, kind: str, test: Test) -> Special:
    """Find the zero of a test function between two points, by inverse interpolation through up to three of them."""
    chord = after.u - before.u
    whole = float(np.linalg.norm(chord))
    direction = chord / whole
    known = [(0.0, test(before), before), (whole, test(after), after)]
    while True:
        low = max((k for k in known if k[1] * known[0][1] > 0.0), key=lambda k: k[0])
        high = min((k for k in known if k[1] * known[0][1] <= 0.0), key=lambda k: k[0])
        nearest = sorted(known, key=lambda k: abs(k[1]))[:3]
        root = extrapolated([k[0] for k in nearest], [k[1] for k in nearest])
        if root is None or not low[0] < root < high[0]:
            root = low[0] + (high[0] - low[0]) * low[1] / (low[1] - high[1])
        share = (root - low[0]) / (high[0] - low[0])
        near = min(low, high, key=lambda k: abs(k[0] - root))
        if abs(near[0] - root) < (BLURRED if kind == BRANCH_POINT else NARROW) or len(known) > LOCATING:
            break
        found = _near(branch, low[2], high[2], share)
        tested = math.nan if found is None else test(found)
        if found is None or not math.isfinite(tested):
            break
        known.append((float((found.u - before.u) @ direction), tested, found))
    way = high[0] - low[0]
    ahead = hermite(low[2], high[2], share) - hermite(low[2], high[2], (near[0] - low[0]) / way)
    return Special(kind, near[2], near[2].value + float(ahead[-1]) * branch.problem.units[0], direction)


def _near(branch: Branch, low: Point, high: Point, share: float) -> Point | None:
    """Find an orbit near a fraction of the way between two points; beside it where branches cross, if need be."""
    for beside in (share, share + ASIDE, share - ASIDE, share + 2.0 * ASIDE, share - 2.0 * ASIDE):
        if 0.0 < beside < 1.0:
            try:
                return branch.between(low, high, beside)
            except MissedError:
                continue
    return None


def corner(branch: Branch, before: Point, after: Point) -> Special | None:
    """Find where the sequence of events changes between two points, from the side that knows how far it is."""
    for near, far in ((before, after), (after, before)):
        kind, test = coming(near, far)
        if kind and 0.0 < test(near) < math.inf:
            found = approached(branch, near, far, test)
            if found is not None:
                return Special(kind, *found, near.tangent)
    return None


def coming(near: Point, far: Point) -> tuple[str, Test]:
    """Tell what happens on the way from one orbit to another, and by what its distance is known; "" if by nothing."""
    if near.word.count("S") > far.word.count("S") and far.word:
        return END_OF_STICKING, landing_force
    if len(near.word) >= len(far.word):
        return "", landing_force
    if far.word.count("L") > near.word.count("L"):
        return LIFTOFF, least_force
    return GRAZING, least_gap


def least_force(point: Point) -> float:
    """Return the least contact force, at a turning point (N)."""
    return point.shot.least_force


def landing_force(point: Point) -> float:
    """Return the least contact force with which contact begins (N)."""
    return point.shot.landing_force


def least_gap(point: Point) -> float:
    """Return the least gap in flight, at a turning point (m)."""
    return point.shot.least_gap


def approached(branch: Branch, near: Point, far: Point, measure: Test) -> tuple[Point, float] | None:
    """Approach the zero of a test function from the side of a point; the last orbit on the way, and the key there."""
    whole = float((far.u - near.u) @ near.tangent)
    points = [near]
    step = 0.5 * whole
    for _ in range(2 * SIDED):
        last = points[-1]
        try:
            tried = branch.beyond(last, step)
            valid = tried.word == near.word and 0.0 < measure(tried) < measure(last)
        except MissedError:
            valid = False
        if not valid:
            step *= 0.4
            if abs(step) < ACCURACY:
                break
            continue
        points.append(tried)
        left = -measure(tried) * step / (measure(tried) - measure(last))
        if abs(left) < ACCURACY or len(points) > SIDED:
            break
        step = APPROACH * left
    if len(points) < 3:
        return None
    value = extrapolated([p.value for p in points[-3:]], [measure(p) for p in points[-3:]])
    return None if value is None else (points[-1], value)


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
