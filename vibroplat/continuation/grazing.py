"""Branches over grazing: from orbits without an impact to those with it, and back.

Next to grazing the residual of the orbits without the impact is smooth, with the Jacobian A. An impact of speed w adds
b w to it, and w² grows linearly, κ g·(u_c − u), with the distance from the grazing orbit u_c (Nordmark 1991). So the
Jacobian A − (κ / 2 w) b gᵀ grows without bounds, steps along the branch become ever smaller, and no tangent leads from
one side to the other. But both are known from either side: A t = 0 without the impact, and with it A t + b ω = 0 and
g·t = 0, where w = ω s at a small distance s from u_c.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from vibroplat.continuation.newton import MissedError, correct
from vibroplat.continuation.point import Point
from vibroplat.kernels.compiled import FloatArray

if TYPE_CHECKING:
    from vibroplat.continuation.branch import Branch

#: Farthest that grazing may be ahead (units of the unknowns), and distances beyond it at which an orbit is looked for,
#: over how far ahead it is, one after the other.
AHEAD, AWAY = 0.3, (1.0, 0.1, 10.0)
#: Least distance beyond it.
LEAST = 1e-5
#: Most that an orbit may lie beside where it is expected, over how far grazing is ahead, and what is always allowed.
BESIDE, BESIDE_LEAST = 10.0, 1e-3


def over_grazing(branch: Branch) -> Point:
    """Find an orbit on the other side of the grazing that is ahead of the last two points of a branch.

    Raises
    ------
    MissedError
        There is none, or it cannot be seen from these points.
    """
    if len(branch.points) < 2:
        raise MissedError("one point does not tell what is ahead")
    before, last = branch.points[-2:]
    if before.frame is not last.frame or before.word != last.word:
        raise MissedError("the last points cannot be compared")
    for guesses, change in ((_without, -1), (_with, 1)):
        for guess, direction, ahead in guesses(branch, before, last):
            try:
                found = correct(branch.problem, last.frame, guess, direction[np.newaxis])
                point = branch.point(last.frame, found, direction)
            except MissedError:
                continue
            near = np.linalg.norm(point.u - guess) < max(BESIDE * ahead, BESIDE_LEAST)
            if near and len(point.word) == len(last.word) + change:
                return point
    raise MissedError("no grazing is ahead")


#: What is tried: unknowns, a direction away from grazing, and how far that is ahead of the last point.
Guesses = Iterator[tuple[FloatArray, FloatArray, float]]


def _without(branch: Branch, before: Point, last: Point) -> Guesses:
    """Go on from orbits with an impact that becomes ever slower, to those without."""
    if "S" in last.word:  # slow impacts are then those that accumulate
        return
    speeds = [p.shot.slowest_impact for p in (before, last)]
    ahead = _ahead([speed**2 for speed in speeds], before, last)
    if not 0.0 < ahead < AHEAD:
        return
    # J = A + B / w at both points
    growing = (last.found.jacobian - before.found.jacobian) / (1.0 / speeds[1] - 1.0 / speeds[0])
    smooth = last.found.jacobian - growing / speeds[1]
    tangent = _null(smooth)
    grazing = last.u + ahead * last.tangent
    for share in AWAY:
        far = max(share * ahead, LEAST)
        for sense in (1.0, -1.0):
            yield grazing + sense * far * tangent, sense * tangent, ahead


def _with(branch: Branch, before: Point, last: Point) -> Guesses:
    """Go on from orbits that come ever nearer to an impact, to those with it."""
    ahead = _ahead([p.shot.least_gap for p in (before, last)], before, last)
    if not 0.0 < ahead < AHEAD:
        return
    smooth, grazing, far = last.found.jacobian, last.u + ahead * last.tangent, max(ahead, LEAST)
    try:
        residual, shot = branch.problem.shoot(last.frame, grazing + far * last.tangent, full=True)
        grown = branch.problem.jacobian(last.frame, shot) - smooth
    except MissedError:
        return
    speed = shot.slowest_impact
    if not np.isfinite(speed):
        return
    normal = np.linalg.svd(grown)[2][0]
    kappa = -(speed**2) / (far * float(normal @ last.tangent))
    push = residual / speed
    extended = _null(np.vstack([np.column_stack([smooth, push]), np.append(normal, 0.0)]))
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
