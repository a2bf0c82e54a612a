"""Residuals F(y, y′) and Jacobians ∂F/∂y + c_j ∂F/∂y′, one pair for each mode and number of layers.

====================  ==================================================  ========
system                unknowns                                            how many
====================  ==================================================  ========
bare                  x, y, φ, φ₁, φ₂ and rates                           10
attached, one layer   the same and F_c                                    11
attached, two layers  x, y, φ, φ₁, φ₂, y_w2 and rates, F_c                13
flight, one layer     x, y, φ, φ₁, φ₂, y_w1 and rates                     12
flight, two layers    x, y, φ, φ₁, φ₂, y_w1, y_w2 and rates               14
====================  ==================================================  ========

While attached, gap and gap rate are zero and are not integrated; the position constraint is reduced
to acceleration level, which makes F_c an index-1 algebraic unknown (paper (5), (6); there the damper
of (6b) has the wrong sign). Residuals fill ``res`` and return whether all of it is finite, which an
engine must not pass over; Jacobians fill ``jac``.
"""

from __future__ import annotations

from vibroplat.kernels.compiled import compiled, inlined
from vibroplat.model.parameters import (
    GRAVITY,
    LAYER_DAMPING,
    LAYER_STIFFNESS,
    LOWER_MASS,
    UPPER_MASS,
    FloatArray,
)
from vibroplat.model.platform import platform_jacobian, platform_residual


@compiled
def finite(values: FloatArray) -> bool:
    """Whether no value is nan or infinite."""
    total = 0.0
    for value in values:
        total += value * 0.0
    return total == 0.0


@inlined
def bare_residual(y: FloatArray, yp: FloatArray, res: FloatArray, p: FloatArray) -> bool:
    """Fill the 10 rows of a platform without material."""
    platform_residual(y, yp, res, p, 0.0)
    return finite(res)


@inlined
def bare_jacobian(y: FloatArray, yp: FloatArray, cj: float, jac: FloatArray, p: FloatArray) -> None:
    """Fill the 10×10 Jacobian of :func:`bare_residual`."""
    platform_jacobian(y, yp, cj, jac, p)


@inlined
def attached_one_residual(y: FloatArray, yp: FloatArray, res: FloatArray, p: FloatArray) -> bool:
    """Fill the 11 rows of one layer in contact; the last is F_c = m_w1(ÿ + g)."""
    force = y[10]
    platform_residual(y, yp, res, p, force)
    res[10] = force - p[LOWER_MASS] * (yp[6] + p[GRAVITY])
    return finite(res)


@inlined
def attached_one_jacobian(y: FloatArray, yp: FloatArray, cj: float, jac: FloatArray, p: FloatArray) -> None:
    """Fill the 11×11 Jacobian of :func:`attached_one_residual`."""
    platform_jacobian(y, yp, cj, jac, p)
    jac[6, 10] = 1.0
    jac[10, 10] = 1.0
    jac[10, 6] = -cj * p[LOWER_MASS]


@inlined
def attached_two_residual(y: FloatArray, yp: FloatArray, res: FloatArray, p: FloatArray) -> bool:
    """Fill the 13 rows of two layers in contact; the last is F_c = m_w1(ÿ + g) − S."""
    force = y[12]
    spring = p[LAYER_STIFFNESS] * y[5] + p[LAYER_DAMPING] * y[11]
    platform_residual(y, yp, res, p, force)
    res[11] = yp[7] + yp[11] + p[GRAVITY] + spring
    res[12] = force - p[LOWER_MASS] * (yp[7] + p[GRAVITY]) + p[UPPER_MASS] * spring
    return finite(res)


@inlined
def attached_two_jacobian(y: FloatArray, yp: FloatArray, cj: float, jac: FloatArray, p: FloatArray) -> None:
    """Fill the 13×13 Jacobian of :func:`attached_two_residual`."""
    platform_jacobian(y, yp, cj, jac, p)
    jac[7, 12] = 1.0
    jac[11, 7] = cj
    jac[11, 11] = cj + p[LAYER_DAMPING]
    jac[11, 5] = p[LAYER_STIFFNESS]
    jac[12, 12] = 1.0
    jac[12, 7] = -cj * p[LOWER_MASS]
    jac[12, 5] = p[UPPER_MASS] * p[LAYER_STIFFNESS]
    jac[12, 11] = p[UPPER_MASS] * p[LAYER_DAMPING]


@inlined
def flight_one_residual(y: FloatArray, yp: FloatArray, res: FloatArray, p: FloatArray) -> bool:
    """Fill the 12 rows of one layer in flight."""
    platform_residual(y, yp, res, p, 0.0)
    res[11] = yp[7] + yp[11] + p[GRAVITY]
    return finite(res)


@inlined
def flight_one_jacobian(y: FloatArray, yp: FloatArray, cj: float, jac: FloatArray, p: FloatArray) -> None:
    """Fill the 12×12 Jacobian of :func:`flight_one_residual`."""
    platform_jacobian(y, yp, cj, jac, p)
    jac[11, 7] = cj
    jac[11, 11] = cj


@inlined
def flight_two_residual(y: FloatArray, yp: FloatArray, res: FloatArray, p: FloatArray) -> bool:
    """Fill the 14 rows of two layers in flight."""
    spring = p[LAYER_STIFFNESS] * y[6] + p[LAYER_DAMPING] * y[13]
    platform_residual(y, yp, res, p, 0.0)
    lower = yp[8] + yp[12] + p[GRAVITY]
    res[12] = lower - p[UPPER_MASS] / p[LOWER_MASS] * spring
    res[13] = lower + yp[13] + spring
    return finite(res)


@inlined
def flight_two_jacobian(y: FloatArray, yp: FloatArray, cj: float, jac: FloatArray, p: FloatArray) -> None:
    """Fill the 14×14 Jacobian of :func:`flight_two_residual`."""
    platform_jacobian(y, yp, cj, jac, p)
    ratio = p[UPPER_MASS] / p[LOWER_MASS]
    jac[12, 8] = cj
    jac[12, 12] = cj
    jac[12, 6] = -ratio * p[LAYER_STIFFNESS]
    jac[12, 13] = -ratio * p[LAYER_DAMPING]
    jac[13, 8] = cj
    jac[13, 12] = cj
    jac[13, 13] = cj + p[LAYER_DAMPING]
    jac[13, 6] = p[LAYER_STIFFNESS]
