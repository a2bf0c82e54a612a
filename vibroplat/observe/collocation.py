"""Solves the variational equations Ṡ = (∂f/∂x) S + ∂f/∂p over a step by collocation at Radau's points.

The method is L-stable, so that a stiff layer does no harm.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, fused, fused_inline, inlined
from vibroplat.kernels.elimination import LANE, blend_8, combine_16, eliminate_lanes, whole_lanes
from vibroplat.kernels.lines import in_lines
from vibroplat.model.parameters import Parameters
from vibroplat.model.springs import slopes
from vibroplat.model.systems import FULL_SIZE

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
MAX_POINTS = POINTS[-1][1]

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
#: One point: with a step of 0 it gives the derivatives of the accelerations themselves.
POINT = radau(1)


@compiled
def steps_of(p: Parameters, period: float) -> tuple[float, float]:
    """First and longest step of the collocation in a piece (s).

    The longest resolves turns of a period (s) and the oscillations of platform and layers, each taken alone; what is
    damped too strongly to oscillate does not shorten it.
    """
    stiffnesses, dampings = slopes(p)
    lower = p.lower_mass if p.lower_mass > 0.0 else p.mass
    masses = p.mass, p.mass, p.inertia, lower, 1.0
    shares = 1.0, 1.0, 1.0, 1.0 + lower / p.mass, 1.0 + p.upper_mass / lower
    quickest, decay = 0.0, 0.0
    for i in range(5):
        stiffness, damping = shares[i] * stiffnesses[i] / masses[i], shares[i] * dampings[i] / masses[i]
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


class Linear(NamedTuple):
    """The linear system of a step of the collocation, and the derivatives that it is made of.

    The unknowns are the derivatives of the accelerations at the points.

    Attributes
    ----------
    mass
        Mass matrices at the points, shape (points, 7, 7).
    jac
        ∂F/∂y at the points: of n rows from n on, first by the coordinates, then by the rates, shape (points, 14, 16).
    forced
        −∂F/∂p of these rows by the parameters, shape (points, 7, keys).
    matrix
        Shape (points · 7, whole lanes for points · 7, then columns).
    factors, weights
        Room, shapes (2, points · 7) and (1, 16).
    """

    mass: FloatArray
    jac: FloatArray
    forced: FloatArray
    matrix: FloatArray
    factors: FloatArray
    weights: FloatArray


def linear(columns: int, keys: int) -> Linear:
    """Make room for the linear system with these whole lanes of right-hand sides."""
    n = FULL_SIZE // 2
    equations = MAX_POINTS * n
    return Linear(
        mass=np.zeros((MAX_POINTS, n, n)),
        jac=in_lines((MAX_POINTS, FULL_SIZE, LANE)),
        forced=np.zeros((MAX_POINTS, n, keys)),
        matrix=in_lines((equations, whole_lanes(equations) + columns)),
        factors=np.zeros((2, equations)),
        weights=np.zeros((1, LANE)),
    )


@fused
def collocate(n: int, h: float, method: Radau, e: Linear, s: FloatArray) -> None:
    """Carry the derivatives of n coordinates and their rates, ``s``, over a step.

    The columns are taken a lane at a time, so that each comes out the same to the last bit, however many others there
    are. What the accelerations are differentiated to at the points is left in the right-hand sides of ``e.matrix``.
    """
    points = method.nodes.size
    m = points * n
    right = whole_lanes(m)
    end = right + s.shape[1]
    for i in range(points):
        for r in range(n):
            row = i * n + r
            for j in range(points):
                # its 8 numbers reach into the next block, which is filled after it
                blend_8(e.matrix, row, j * n, h * h * method.twice[i, j], h * method.once[i, j], e.jac[i], n + r, n)
            for c in range(n):
                e.matrix[row, i * n + c] += e.mass[i, r, c]
            right_hand_sides(n, h * method.nodes[i], i, r, right, e, s)
    eliminate_lanes(e.matrix, m, right, end, e.factors)
    last = points - 1
    for j in range(0, s.shape[1], LANE):
        for c in range(n):
            for k in range(j, j + LANE):
                s[c, k] += h * s[n + c, k]
            for i in range(points):
                twice, once = h * h * method.twice[last, i], h * method.once[last, i]
                for k in range(j, j + LANE):
                    acceleration = e.matrix[i * n + c, right + k]
                    s[c, k] += twice * acceleration
                    s[n + c, k] += once * acceleration


@fused_inline
def right_hand_sides(n: int, lead: float, i: int, r: int, right: int, e: Linear, s: FloatArray) -> None:
    """Fill those of an acceleration at a point: what the state at the start of the step and the parameters cause."""
    row = i * n + r
    blend_8(e.weights, 0, 0, -1.0, 0.0, e.jac[i], n + r, n)
    blend_8(e.weights, 0, n, -lead, -1.0, e.jac[i], n + r, n)
    for j in range(0, s.shape[1], LANE):
        combine_16(e.matrix, row, right + j, e.weights, s, 2 * n - 1, j)
    for k in range(e.forced.shape[2]):
        e.matrix[row, right + FULL_SIZE + k] += e.forced[i, r, k]
