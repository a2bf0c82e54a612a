"""Solves the variational equations Ṡ = (∂f/∂x) S + ∂f/∂p over a step by collocation at Radau's points.

The method is L-stable, so that a stiff layer does no harm.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, fused, fused_inline, inlined
from vibroplat.kernels.lanes import reduce_16
from vibroplat.kernels.linear import pivot_row
from vibroplat.model.parameters import Parameters
from vibroplat.model.systems import FULL_SIZE

#: Columns that are reduced at once. Right-hand sides are in whole lanes: first those of the start, then those of the
#: parameters by which the state is differentiated.
LANE = 16

#: Longest step of the collocation, as a part of a turn of the synchronous speed and times the quickest natural
#: frequency (rad/s), and its points. Beside differences, derivatives over a turn are good to 1e-9 with 16 steps in a
#: turn at 50 Hz, of 5 points, and to 3e-6 with 3 points; with 1.4 rad in a step they were good to 1e-6 only. Pieces
#: much shorter than a step, as between impacts that accumulate, take fewer points.
STEP, ANGLE = 1.0 / 10.0, 0.9
#: What decays quickly is large after an event, and matters: the first step of a piece is at most ANGLE over the
#: quickest decay rate, and each is at most so many times as long as the one before. Without, derivatives beside a
#: critically damped layer of 1000 Hz were wrong by 3 %.
GROWTH = 2.0
POINTS = ((1.0 / 40.0, 2), (1.0 / 6.0, 3), (math.inf, 5))
MOST_POINTS = POINTS[-1][1]

#: Critical slip speed below which a motor's steepness is not followed (rad/s).
_SLOWEST = 1e-3


class Radau(NamedTuple):
    """Radau IIA collocation with so many points on (0, 1], the last of them 1.

    Attributes
    ----------
    nodes
        The points, shape (n,).
    once, twice
        Integrals of the Lagrange polynomials from 0 to each point, and integrals of these, shape (n, n).
    """

    nodes: FloatArray
    once: FloatArray
    twice: FloatArray


def radau(points: int) -> Radau:
    """Find the points of Radau IIA, zeros of P_n − P_{n−1} shifted to [0, 1] (Hairer and Wanner 1996, IV.5)."""
    legendre = np.polynomial.legendre.Legendre.basis
    nodes = np.sort((legendre(points) - legendre(points - 1)).roots().real) * 0.5 + 0.5
    nodes[-1] = 1.0
    powers = np.arange(points)
    once = (nodes[:, np.newaxis] ** (powers + 1) / (powers + 1)) @ np.linalg.inv(nodes[:, np.newaxis] ** powers)
    return Radau(nodes, once, once @ once)


METHODS = tuple(radau(points) for _, points in POINTS)
#: The same with 3 points in the longest steps too, at a third of the cost.
ROUGH_METHODS = (*METHODS[:2], METHODS[1])


@compiled
def steps_of(p: Parameters, period: float) -> tuple[float, float]:
    """First and longest step of the collocation in a piece (s).

    The longest resolves turns of a period (s) and the oscillations of platform and layers, each taken alone; what is
    damped too strongly to oscillate does not shorten it.
    """
    layers = 1.0 + p.upper_mass / p.lower_mass if p.lower_mass > 0.0 else 0.0
    quickest, decay = 0.0, 0.0
    for stiffness, damping in (
        (p.stiffness_x / p.mass, p.damping_x / p.mass),
        (p.stiffness_y / p.mass, p.damping_y / p.mass),
        (p.stiffness_phi / p.inertia, p.damping_phi / p.inertia),
        (layers * p.layer_stiffness, layers * p.layer_damping),
    ):
        bend = stiffness - 0.25 * damping**2
        quickest = max(quickest, math.sqrt(max(bend, 0.0)))
        decay = max(decay, 0.5 * damping + math.sqrt(max(-bend, 0.0)))
    for i in range(2):
        decay = max(decay, 2.0 * p.torque[i] / max(p.slip_speed[i], _SLOWEST) / p.exciter_inertia[i])
    longest = min(STEP * period, ANGLE / quickest if quickest > 0.0 else math.inf)
    return min(longest, ANGLE / decay if decay > 0.0 else math.inf), longest


@inlined
def step_of(step: float, left: float, longest: float) -> float:
    """Length of a step that may grow up to the longest; from there on the time left is divided evenly (s)."""
    if step >= longest:
        return left / math.ceil(left / longest)
    return min(step, left)


@fused
def collocate(n: int, h: float, method: Radau, a: FloatArray, b: FloatArray, matrix: FloatArray, s: FloatArray) -> None:
    """Carry the derivatives of n coordinates and their rates, ``s``, over a step.

    The unknowns of the linear system are the derivatives of the accelerations at the points. The columns are taken a
    lane at a time, so that each comes out the same to the last bit, however many others there are.
    """
    points = method.nodes.size
    m = points * n
    right = behind(m)
    end = right + s.shape[1]
    for i in range(points):
        lead = h * method.nodes[i]
        for r in range(n):
            row = matrix[i * n + r]
            for j in range(points):
                twice, once = h * h * method.twice[i, j], h * method.once[i, j]
                for c in range(n):
                    row[j * n + c] = -twice * a[i, r, c] - once * a[i, r, n + c]
            row[i * n + r] += 1.0
            right_hand_sides(n, lead, a[i, r], b[i, r], row[right:end], s)
    eliminate(matrix, m, right, end)
    last = points - 1
    for j in range(0, s.shape[1], LANE):
        for c in range(n):
            for k in range(j, j + LANE):
                s[c, k] += h * s[n + c, k]
            for i in range(points):
                twice, once = h * h * method.twice[last, i], h * method.once[last, i]
                for k in range(j, j + LANE):
                    found = matrix[i * n + c, right + k]
                    s[c, k] += twice * found
                    s[n + c, k] += once * found


@fused_inline
def right_hand_sides(n: int, lead: float, a: FloatArray, b: FloatArray, row: FloatArray, s: FloatArray) -> None:
    """Fill those of an acceleration at a point: what the state at the start of the step and the parameters cause."""
    for j in range(0, row.size, LANE):
        for k in range(j, j + LANE):
            row[k] = 0.0
        for c in range(n):
            stiffness, damping = a[c], a[n + c] + lead * a[c]
            for k in range(j, j + LANE):
                row[k] += stiffness * s[c, k] + damping * s[n + c, k]
    for k in range(b.size):
        row[FULL_SIZE + k] += b[k]


@inlined
def behind(m: int) -> int:
    """Column at which the right-hand sides of m equations begin."""
    return -(-m // LANE) * LANE


@fused
def eliminate(matrix: FloatArray, m: int, right: int, end: int) -> None:
    """Solve m linear equations for the right-hand sides in these columns, which become the solutions.

    Rows are reduced in whole lanes: what that leaves before the diagonal is never read.
    """
    for k in range(m):
        first = k // LANE * LANE
        best = pivot_row(matrix[:m], k)
        if best != k:
            for j in range(first, end):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
        inverse = 1.0 / matrix[k, k]
        for i in range(k + 1, m):
            factor = matrix[i, k] * inverse
            for j in range(first, end, LANE):
                reduce_16(matrix, i, k, j, factor)
    for k in range(m - 1, -1, -1):
        inverse = 1.0 / matrix[k, k]
        for j in range(right, end):
            matrix[k, j] *= inverse
        for i in range(k):
            factor = matrix[i, k]
            for j in range(right, end, LANE):
                reduce_16(matrix, i, k, j, factor)
