"""The explicit equations y′ = f(t, y) of each mode, F_c eliminated, as a user of an ODE solver needs them."""

from __future__ import annotations

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled
from vibroplat.model.accelerations import accelerations, linearize
from vibroplat.model.parameters import Parameters
from vibroplat.model.systems import GUARDS, SIZES


@compiled
def settled(system: int, t: float, y: FloatArray, p: Parameters) -> tuple[FloatArray, FloatArray]:
    """Return all unknowns and derivatives of a system, from its differential unknowns."""
    unknowns, slopes = np.zeros(SIZES[system]), np.empty(SIZES[system])
    for i in range(y.size):
        unknowns[i] = y[i]
    accelerations(system, t, unknowns, slopes, p)
    return unknowns, slopes


@compiled
def flow(system: int, t: float, y: FloatArray, p: Parameters) -> FloatArray:
    """Return y′ of a system's differential unknowns, shape (2n,)."""
    return settled(system, t, y, p)[1][: y.size]


@compiled
def guard(system: int, t: float, y: FloatArray, p: Parameters) -> float:
    """Return what ends a mode by its fall through zero: F_c (N) or the gap (m)."""
    return settled(system, t, y, p)[0][GUARDS[system]]


@compiled
def jacobian(system: int, t: float, y: FloatArray, p: Parameters) -> FloatArray:
    """Return ∂f/∂y, shape (2n, 2n)."""
    unknowns, yp = settled(system, t, y, p)
    slopes = np.empty((y.size, yp.size))
    linearize(system, t, unknowns, yp, slopes, p)
    return slopes[:, : y.size].T
