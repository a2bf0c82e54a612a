"""Platform and exciters: their mass matrix and its inverse, and where the model holds.

Their coordinates x, y, φ, φ₁, φ₂ are the first five of every system. The mass matrix is

    diag(M, M, J, J_e,1, J_e,2) with the column (c_x, c_y, c_φ) of each exciter beside the platform's rows,

c = k (−sin φᵢ, cos φᵢ, B), B = X cos φᵢ + Y sin φᵢ, with the axis (X, Y) turned to first order.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, fused_inline, inlined
from vibroplat.kernels.on_demand import written
from vibroplat.model import straight
from vibroplat.model.parameters import Parameters

#: Minimum fraction of an exciter's own inertia that the platform's yielding may leave of it.
MIN_INERTIA_RATIO = 1e-3

#: One number for each of x, y, φ.
Three = tuple[float, float, float]

#: One number for each of x, y, φ, φ₁, φ₂.
Five = tuple[float, float, float, float, float]

#: What :func:`solve_rows` finds: accelerations of platform and exciters, F_c, accelerations of the gap and of y_w2.
Solution = tuple[Five, float, float, float]


class Unbalance(NamedTuple):
    """How an unbalance couples its angle with the platform: its column of the mass matrix."""

    x: float  # kg·m, kg·m, kg·m²
    y: float
    phi: float


@compiled
def unbalance(i: int, y: FloatArray, p: Parameters) -> Unbalance:
    """Evaluate the couplings of exciter i at unknowns or a full state; numpy's sine takes complex angles as well."""
    return couplings(i, y[2], np.sin(y[3 + i]), np.cos(y[3 + i]), p)


@compiled
def unbalances(y: FloatArray, p: Parameters) -> tuple[Unbalance, Unbalance]:
    """Evaluate the couplings of both exciters."""
    return unbalance(0, y, p), unbalance(1, y, p)


@inlined
@written(straight.couplings)
def couplings(i: int, phi: float, sine: float, cosine: float, p: Parameters) -> Unbalance:  # type: ignore[empty-body]
    """Evaluate the couplings of exciter i from sine and cosine of its angle."""


@inlined
def inertial(a: FloatArray, n: int, first: Unbalance, second: Unbalance, p: Parameters) -> Five:
    """Multiply the mass matrix by five numbers that begin at place n of an array: accelerations, or rates."""
    ax, ay, aphi, a1, a2 = a[n], a[n + 1], a[n + 2], a[n + 3], a[n + 4]
    return (
        p.mass * ax + first.x * a1 + second.x * a2,
        p.mass * ay + first.y * a1 + second.y * a2,
        p.inertia * aphi + first.phi * a1 + second.phi * a2,
        p.exciter_inertia[0] * a1 + first.x * ax + first.y * ay + first.phi * aphi,
        p.exciter_inertia[1] * a2 + second.x * ax + second.y * ay + second.phi * aphi,
    )


class Compliance(NamedTuple):
    """The inverse of the mass matrix, by its parts.

    x, y, φ are diagonal among themselves; eliminating them leaves two equations for the exciters (Schur complement).
    """

    mobility: Three  # one over the inertias of x, y, φ: 0 for what cannot move
    first: Unbalance  # couplings of the exciters
    second: Unbalance
    own_1: float  # entries (11, 12, 22) of the inverse of the exciters' mass matrix after that; not finite where it is
    mutual: float  # singular
    own_2: float


@compiled
def exciter_masses(first: Unbalance, second: Unbalance, mobility: Three, p: Parameters) -> Three:
    """Entries (11, 12, 22) of the exciters' mass matrix after the platform's x, y, φ have been eliminated."""
    mx, my, mphi = mobility
    return (
        p.exciter_inertia[0] - mx * first.x * first.x - my * first.y * first.y - mphi * first.phi * first.phi,
        -mx * first.x * second.x - my * first.y * second.y - mphi * first.phi * second.phi,
        p.exciter_inertia[1] - mx * second.x * second.x - my * second.y * second.y - mphi * second.phi * second.phi,
    )


@compiled
def compliance(first: Unbalance, second: Unbalance, mobility: Three, p: Parameters) -> Compliance:
    """Invert the mass matrix in a state, from its couplings and the mobility of x, y, φ."""
    m11, m12, m22 = exciter_masses(first, second, mobility, p)
    determinant = m11 * m22 - m12 * m12
    return Compliance(mobility, first, second, m22 / determinant, -m12 / determinant, m11 / determinant)


@fused_inline
def solve_platform(b: Five, c: Compliance) -> Five:
    """Accelerations of x, y, φ, φ₁, φ₂ under five generalized forces, or jumps of rates under impulses."""
    mx, my, mphi = c.mobility
    first, second = c.first, c.second
    bx, by, bphi, b1, b2 = b
    r1 = b1 - (mx * first.x * bx + my * first.y * by + mphi * first.phi * bphi)
    r2 = b2 - (mx * second.x * bx + my * second.y * by + mphi * second.phi * bphi)
    a1 = c.own_1 * r1 + c.mutual * r2
    a2 = c.mutual * r1 + c.own_2 * r2
    return (
        mx * (bx - first.x * a1 - second.x * a2),
        my * (by - first.y * a1 - second.y * a2),
        mphi * (bphi - first.phi * a1 - second.phi * a2),
        a1,
        a2,
    )


@fused_inline
def mobility(attached: float, p: Parameters) -> Three:
    """One over the inertias of x, y, φ; attached (1, otherwise 0), the platform's y carries the lower layer."""
    return 1.0 / p.mass, 1.0 / (p.mass + attached * p.lower_mass), 1.0 / p.inertia


@fused_inline
def solve_rows(
    attached: float, lower_share: float, b: Five, lower: float, upper: float, inverse: Compliance, p: Parameters
) -> Solution:
    """Solve the dynamic rows for accelerations and F_c.

    Parameters
    ----------
    attached, lower_share
        1 if the lower layer is attached, otherwise 0; one over its mass, 0 without layers (1/kg).
    b, lower, upper
        Right-hand sides of the rows of platform and exciters, lower and upper layer.
    inverse
        That of the mass matrix of platform and exciters, with :func:`mobility`.

    Returns
    -------
    a, contact, opening, upper
        Accelerations of x, y, φ, φ₁, φ₂; F_c if attached; the gap's acceleration if not; acceleration of y_w2.
    """
    a = solve_platform((b[0], b[1] + attached * lower, b[2], b[3], b[4]), inverse)
    alone = lower * lower_share  # the lower layer's own acceleration
    carried = attached * a[1] + (1.0 - attached) * alone
    return a, p.lower_mass * a[1] - lower, alone - a[1], upper - carried


@compiled
def is_definite(y: FloatArray, p: Parameters) -> bool:
    """Whether the mass matrix is positive definite, by some margin, as every real body's is.

    With axes that turn to first order in φ it loses this where the platform has turned far; the motion would
    run away there in finite time. Up to the safe rotation it never does.
    """
    if abs(y[2]) <= p.safe_rotation:
        return True
    mobility = (1.0 / p.mass, 1.0 / p.mass, 1.0 / p.inertia)
    first, second = unbalances(y, p)
    m11, m12, m22 = exciter_masses(first, second, mobility, p)
    least_1, least_2 = MIN_INERTIA_RATIO * p.exciter_inertia[0], MIN_INERTIA_RATIO * p.exciter_inertia[1]
    return bool(m11 > least_1 and m22 > least_2 and m11 * m22 - m12 * m12 > least_1 * least_2)
