"""Special points of branches: which there are between two points, and where exactly.

Each has a test function that is zero there. Some are known on one side only, as the least contact force of an orbit
that does not lift off; their zeros are extrapolated from that side.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter

import numpy as np

from vibroplat.continuation.branch import Branch
from vibroplat.continuation.crossings import crossing
from vibroplat.continuation.kinds import (
    BRANCH_POINT,
    DOUBLING,
    END_OF_STICKING,
    FOLD,
    GRAZING,
    LIFTOFF,
    TORUS,
)
from vibroplat.continuation.newton import MissedError
from vibroplat.continuation.point import REAL, Point, pairs
from vibroplat.continuation.prediction import predicted
from vibroplat.kernels.compiled import FloatArray

#: Evaluations from one side, what part of the way to the extrapolated zero each goes, and the distance, in units of the
#: unknowns, at which the zero is extrapolated through three of them: two others are 20 and 400 times as far.
SIDED, APPROACH, CLOSE = 7, 0.95, 1e-6
#: Least length of the first step towards the zero.
FIRST = 1e-4
#: Distance of a known orbit from the zero at which it is interpolated; nearer to a branch point than the second, an
#: orbit cannot be told from those of the branch that crosses.
NARROW, BLURRED = 1e-4, 1e-3
#: How far beside a point that cannot be found others are tried, as a part of the way.
ASIDE = 0.1
#: How far beyond the place where the events change an orbit is looked for that has them, as a part of the way.
BEYOND = 0.01
#: Multipliers larger than the first are watched: one may move by the second between two points, over its size above 1.
WATCHED, MOVED = 0.9, 0.4
#: How often an interval in which the key seems to turn back and forth, or more happens than is seen, is divided.
DEEPEST = 3
#: How often an interval is halved in which the events change in a way that is not known yet.
HALVED = 5
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
    across
        Direction of the other branch at a branch point.
    mirrors
        Whether this branch turns back: beyond are the mirror images of the orbits before or, where it is one of doubled
        periods and has come to their end, the same orbits begun half a period later.
    """

    kind: str
    point: Point
    value: float
    direction: FloatArray
    across: FloatArray | None = None
    mirrors: bool = False


Test = Callable[[Point], float]
#: A place along a direction, a test function there, and the point.
Tried = tuple[float, float, Point]

#: Test functions that change their sign at special points between points with the same sequence of events.
TESTS: dict[str, Test] = {
    FOLD: attrgetter("fold"),
    DOUBLING: attrgetter("doubling"),
    TORUS: attrgetter("torus"),
    BRANCH_POINT: attrgetter("branching"),
}


def specials(
    branch: Branch, before: Point, after: Point, *, strictly: bool = False, depth: int = 0
) -> Iterator[Special]:
    """Find the special points between two neighbouring points in one frame, in the order of the branch.

    Where the sequence of events changes, multipliers may jump and the branch may have a corner: its parts on both sides
    are looked at one by one.

    Raises
    ------
    MissedError
        The place where the sequence changes cannot be found, and this is asked for ``strictly``.
    """
    if before.word == after.word:
        yield from smooth(branch, before, after)
        return
    there = corner(branch, before, after)
    if there is None:
        # nearer to an impact that begins or ends, its distance is known
        middle = inside(branch, before, after, 0.5) if depth < HALVED else None
        if middle is not None:
            yield from specials(branch, before, middle, strictly=strictly, depth=depth + 1)
            yield from specials(branch, middle, after, strictly=strictly, depth=depth + 1)
        elif strictly:
            raise MissedError("the sequence of events changes at an unknown place")
        elif before.fold * after.fold < 0.0:
            yield located(branch, before, after, FOLD)
        return
    forth = there.point.word == before.word
    near, far = ordered(before, after, forth)
    parts = [smooth(branch, *ordered(near, there.point, forth)), iter([there])]
    beyond = _beyond(branch, there.point, far, forth)
    if beyond is not None:
        parts.append(smooth(branch, *ordered(beyond, far, forth)))
        if there.point.fold * beyond.fold < 0.0:
            parts.insert(2, iter([_fold_beside(branch, there, beyond, forth)]))
    for part in parts if forth else reversed(parts):
        yield from part


def ordered(one: Point, other: Point, forth: bool) -> tuple[Point, Point]:
    """Return two points in the order of the branch."""
    return (one, other) if forth else (other, one)


def inside(branch: Branch, before: Point, after: Point, share: float) -> Point | None:
    """Find an orbit between two, at a part of the way; None if there is none."""
    chord = after.u - before.u
    whole = float(np.linalg.norm(chord))
    try:
        return branch.between([before, after], before, chord / whole, share * whole, whole)
    except MissedError:
        return None


def _beyond(branch: Branch, last: Point, far: Point, forth: bool, share: float = BEYOND) -> Point | None:
    """Find an orbit next to the place where the events change that has those of the far side."""
    chord = (far.u - last.u) * (1.0 if forth else -1.0)
    whole = float(np.linalg.norm(chord))
    try:
        found = branch.between([last, far], last, chord / whole, (share if forth else -share) * whole, whole)
    except MissedError:
        return None
    return found if found.word == far.word else None


def _fold_beside(branch: Branch, there: Special, beyond: Point, forth: bool) -> Special:
    """Find the fold between the place where the events change and an orbit next to it."""
    nearer = _beyond(branch, there.point, beyond, forth)
    if nearer is not None and nearer.fold * beyond.fold < 0.0:
        return located(branch, *ordered(nearer, beyond, forth), FOLD)
    return Special(FOLD, there.point, there.value, there.direction)


def smooth(branch: Branch, before: Point, after: Point, depth: int = 0) -> Iterator[Special]:
    """Find the special points between two points with the same sequence of events."""
    place = turning(before, after)
    if place is None and unexplained(before, after):
        place = 0.5
    if place is not None and depth < DEEPEST:
        middle = inside(branch, before, after, place)
        if middle is not None and middle.word == before.word:
            yield from smooth(branch, before, middle, depth + 1)
            yield from smooth(branch, middle, after, depth + 1)
            return
    if before.branching * after.branching < 0.0:  # where this branch bends, it has a fold as well
        yield crossed(branch, before, after)
    elif before.fold * after.fold < 0.0:
        yield located(branch, before, after, FOLD)
    if before.doubling * after.doubling < 0.0:
        yield located(branch, before, after, DOUBLING)
    if before.torus * after.torus < 0.0 and complex_pairs(before, after):
        found = located(branch, before, after, TORUS)
        if complex_pairs(found.point):
            yield found


def unexplained(before: Point, after: Point) -> bool:
    """Whether multipliers have left the unit circle, or entered it, where no test function has changed its sign.

    They may also have gone so far that this cannot be told.
    """
    passed = (
        before.fold * after.fold < 0.0 or before.branching * after.branching < 0.0,
        before.torus * after.torus < 0.0,
        before.doubling * after.doubling < 0.0,
    )
    changed = (one != other for one, other in zip(before.outside, after.outside, strict=True))
    unseen = any(c and not p for c, p in zip(changed, passed, strict=True))
    return unseen or _far(before, after) or _far(after, before)


def _far(one: Point, other: Point) -> bool:
    """Whether a multiplier near the unit circle, or outside, has none near it at another point."""
    m = one.multipliers[np.abs(one.multipliers) > WATCHED]
    apart = np.abs(m[:, np.newaxis] - other.multipliers).min(axis=1, initial=math.inf)
    return bool((apart > MOVED * np.maximum(1.0, np.abs(m))).any())


def turning(before: Point, after: Point) -> float | None:
    """Return where the key turns back and forth between two points, as a part of the way; None if it does not.

    By the cubic through both with their tangents, whose slope is a parabola.
    """
    chord = after.u - before.u
    one, other = (p.fold / float(p.tangent @ chord) for p in (before, after))
    mean = float(chord[-1]) / float(chord @ chord)
    bend, bow = -4.0 * one - 2.0 * other + 6.0 * mean, 3.0 * one + 3.0 * other - 6.0 * mean
    if one * other <= 0.0 or bow == 0.0 or not 0.0 < -0.5 * bend / bow < 1.0:
        return None
    place = -0.5 * bend / bow
    return place if one * (one + 0.5 * bend * place) < 0.0 else None


def complex_pairs(*points: Point) -> bool:
    """Whether at any of the points the two multipliers whose product is next to 1 are complex."""
    for point in points:
        found = point.products
        if found.size:
            nearest = pairs(point.multipliers.size)[:, np.argmin(np.abs(1.0 - found))]
            if (np.abs(point.multipliers[nearest].imag) > REAL).all():
                return True
    return False


def located(branch: Branch, before: Point, after: Point, kind: str) -> Special:
    """Find the zero of the test function of a kind between two points (Chandrupatla 1997)."""
    test = TESTS[kind]
    chord = after.u - before.u
    whole = float(np.linalg.norm(chord))
    direction = chord / whole
    enough = NARROW if kind != BRANCH_POINT else BLURRED
    known: list[Tried] = [(0.0, test(before), before), (whole, test(after), after)]
    last, other = known[1], known[0]
    share = last[1] / (last[1] - other[1])
    while True:
        root = last[0] + share * (other[0] - last[0])
        near = min(last, other, key=lambda k: abs(k[0] - root))
        if abs(near[0] - root) < enough or len(known) > LOCATING:
            break
        found = _near(branch, known, min(last[0], other[0]), max(last[0], other[0]), root, direction)
        tested = math.nan if found is None else test(found)
        if found is None or not math.isfinite(tested):
            break
        known.append((float((found.u - before.u) @ direction), tested, found))
        if tested * last[1] > 0.0:
            dropped = last
        else:
            dropped, other = other, last
        last = known[-1]
        share = _share(last, other, dropped)
    clear = [k for k in known if kind != BRANCH_POINT or abs(k[0] - root) > enough] or known[:2]
    there, here = (predicted(_nearest(clear, root), before.u, direction, place)[0] for place in (root, near[0]))
    ahead = float(there[-1] - here[-1]) * branch.problem.units[0]
    return Special(kind, near[2], near[2].value + ahead, direction)


def crossed(branch: Branch, before: Point, after: Point) -> Special:
    """Find the branch point between two points; if that fails, by the determinant, which is known less exactly."""
    chord = after.u - before.u
    whole = float(np.linalg.norm(chord))
    direction = chord / whole
    share = before.branching / (before.branching - after.branching)
    u, jacobian = predicted(ordered(before, after, share < 0.5), before.u, direction, share * whole)
    try:
        found = crossing(branch.problem, before.frame, u, jacobian)
        if not 0.0 < (found.found.u - before.u) @ direction < whole:
            raise MissedError("it lies elsewhere")
    except MissedError:
        rough = located(branch, before, after, BRANCH_POINT)
        null = np.linalg.svd(rough.point.found.jacobian)[2][-2:]
        along = null @ direction
        across = null.T @ np.array([-along[1], along[0]])
        rough.across = across / np.linalg.norm(across)
        return rough
    across, along = sorted(found.directions, key=lambda way: abs(float(way @ direction)))
    along = along if along @ direction > 0.0 else -along
    point = replace(branch.point(before.frame, found.found, along), tangent=along)
    mirrors = before.fold * after.fold < 0.0  # a pitchfork
    if branch.problem.halves(point.frame, point.u):
        return Special(DOUBLING, point, point.value, direction, mirrors=mirrors)
    return Special(BRANCH_POINT, point, point.value, direction, across, mirrors)


def _share(last: Tried, other: Tried, dropped: Tried) -> float:
    """Where to look next, as a part of the way from the last place to the other end of the bracket.

    By the inverse parabola through both and the place before, where that one is monotonic, else in the middle.
    """
    (a, fa, _), (b, fb, _), (c, fc, _) = last, other, dropped
    if c == b or fc in (fb, fa):
        return 0.5
    place, height = (a - b) / (c - b), (fa - fb) / (fc - fb)
    if not (height**2 < place and (1.0 - height) ** 2 < 1.0 - place):
        return 0.5
    return fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)


def _near(
    branch: Branch, known: Sequence[Tried], low: float, high: float, place: float, direction: FloatArray
) -> Point | None:
    """Find an orbit near a place between two others; beside it where branches cross, if need be."""
    for beside in (0.0, ASIDE, -ASIDE, 2.0 * ASIDE, -2.0 * ASIDE):
        there = place + beside * (high - low)
        if low < there < high:
            try:
                return branch.between(_nearest(known, there), known[0][2], direction, there, high - low)
            except MissedError:
                continue
    return None


def _nearest(known: Sequence[Tried], place: float) -> list[Point]:
    """Points by their distance from a place."""
    return [point for _, _, point in sorted(known, key=lambda k: abs(k[0] - place))]


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
    """Approach the zero of a test function from the side of a point; the last orbit on the way, and the key there.

    At a corner the tangent does not tell on which side of the point the zero is: the first step is tried both ways.
    """
    whole = float((far.u - near.u) @ near.tangent)
    points = [near]
    step = math.copysign(max(0.5 * abs(whole), FIRST), whole)
    for _ in range(2 * SIDED):
        last = points[-1]
        try:
            tried = branch.beyond(last, step, points[-2::-1])
            valid = tried.word == near.word and 0.0 < measure(tried) < (measure(last) if points[1:] else math.inf)
        except MissedError:
            valid = False
        if not valid:
            step *= 0.4 if points[1:] else -0.4
            if abs(step) < CLOSE:
                break
            continue
        points.append(tried)
        left = -measure(tried) * step / (measure(tried) - measure(last))
        if abs(left) < CLOSE or len(points) > SIDED:
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
