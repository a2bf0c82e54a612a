"""The explicit equations y′ = f(y) of each mode, F_c eliminated, as a careful user of an ODE solver writes them.

Attached, the lower layer moves with the platform: its mass adds to the platform's in the row of y, and
what it carries is a load. F_c then follows from the accelerations.
"""

from __future__ import annotations

import numpy as np

from vibroplat.kernels.compiled import compiled
from vibroplat.kernels.linear import factorize, substitute
from vibroplat.model.parameters import (
    GRAVITY,
    LAYER_DAMPING,
    LAYER_STIFFNESS,
    LOWER_MASS,
    UPPER_MASS,
    FloatArray,
)
from vibroplat.model.platform import add_mass_matrix, platform_residual
from vibroplat.model.systems import ATTACHED_ONE, ATTACHED_TWO, GAP, explicit


@compiled
def flow(system: int, y: FloatArray, p: FloatArray) -> FloatArray:
    """Return y′ of a system's differential unknowns, shape (2n,)."""
    yp, room = np.empty(y.size), np.empty(y.size)
    if system in (ATTACHED_ONE, ATTACHED_TWO):
        attached_flow(y, yp, room, p)
    else:
        explicit(system, y, yp, room, p)
    return yp


@compiled
def attached_flow(y: FloatArray, yp: FloatArray, forces: FloatArray, p: FloatArray) -> None:
    """Fill y′ where the lower layer moves with the platform."""
    n = y.size // 2
    for i in range(n):
        yp[i], yp[n + i] = y[n + i], 0.0
    platform_residual(y, yp, forces, p, p[LOWER_MASS] * p[GRAVITY] - p[UPPER_MASS] * layer_spring(y, p))
    matrix, rows = np.zeros((5, 5)), np.empty(5, dtype=np.int64)
    add_mass_matrix(matrix, 0, 1.0, y, p)
    matrix[1, 1] += p[LOWER_MASS]
    for i in range(5):
        yp[n + i] = -forces[n + i]
    factorize(matrix, rows)
    substitute(matrix, rows, yp[n : n + 5])
    if n > 5:
        yp[n + 5] = -yp[n + 1] - p[GRAVITY] - layer_spring(y, p)


@compiled
def layer_spring(y: FloatArray, p: FloatArray) -> float:
    """Force S/m_w2 between the layers, attached (m/s²); 0 with one layer."""
    n = y.size // 2
    return p[LAYER_STIFFNESS] * y[5] + p[LAYER_DAMPING] * y[n + 5] if n > 5 else 0.0


@compiled
def guard(system: int, y: FloatArray, p: FloatArray) -> float:
    """Return what ends a mode by its fall through zero: F_c (N) or the gap (m)."""
    if system in (ATTACHED_ONE, ATTACHED_TWO):
        acceleration = flow(system, y, p)[y.size // 2 + 1]
        return p[LOWER_MASS] * (acceleration + p[GRAVITY]) - p[UPPER_MASS] * layer_spring(y, p)
    return y[GAP]


@compiled
def jacobian(system: int, y: FloatArray, p: FloatArray) -> FloatArray:
    """Return ∂f/∂y by central differences, shape (2n, 2n)."""
    jac = np.empty((y.size, y.size))
    moved = y.copy()
    for j in range(y.size):
        step = 1e-6 * max(abs(y[j]), 1e-4)
        moved[j] = y[j] + step
        ahead = flow(system, moved, p)
        moved[j] = y[j] - step
        jac[:, j] = (ahead - flow(system, moved, p)) / (2.0 * step)
        moved[j] = y[j]
    return jac
