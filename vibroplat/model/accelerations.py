"""Accelerations and contact force by a direct solve, their derivatives along the motion and by the state.

The dynamic rows of F are linear in z, the n accelerations and, attached, F_c. What multiplies z is constant in a state,
so that most of this is a solve with :func:`vibroplat.model.platform.solve_rows`, whose right-hand sides come from the
rows of :mod:`vibroplat.model.equations` and their Jacobian.
"""

from __future__ import annotations

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, inlined
from vibroplat.model.equations import (
    Coupled,
    coupled_rows,
    dynamic_jacobian,
    finite,
    jacobian,
    mass_matrix,
    rates_of_rows,
)
from vibroplat.model.parameters import Parameters
from vibroplat.model.platform import compliance, is_definite, mobility, solve_rows, unbalances
from vibroplat.model.sliding import sliding_accelerations, sliding_second_derivatives
from vibroplat.model.systems import ALGEBRAIC, DIFFERENTIAL, LAYERS, SIZES, SLIDES, gather


@compiled
def solve(system: int, y: FloatArray, z: FloatArray, p: Parameters) -> None:
    """Solve (∂F/∂z) z = b for accelerations and F_c.

    Attached, the lower layer's row m_w1 ÿ − F_c = b is added to the platform's row of y, which leaves a platform whose
    mass there is M + m_w1. Of the unknowns ``y`` coordinates are read. From place n on ``z``, shape (size,), holds the
    right-hand sides of the dynamic rows, in the order of the rows, and is left with accelerations and F_c.
    """
    solve_coupled(system, z, unbalances(y, p), p)


@inlined
def solve_coupled(system: int, z: FloatArray, coupled: Coupled, p: Parameters) -> None:
    """Do as :func:`solve`, with the couplings of both exciters in this state."""
    first, second = coupled
    n, layers, attached = z.size // 2, LAYERS[system], ALGEBRAIC[system]
    held = 1.0 if attached else 0.0
    inverse = compliance(first, second, mobility(held, p), p)
    lower = upper = 0.0 * z[n]
    if layers > 0:
        lower = z[2 * n] if attached else z[n + 5]
    if layers == 2:
        upper = z[2 * n - 1]
    share = 1.0 / p.lower_mass if layers > 0 else 0.0 * p.lower_mass
    b = (z[n], z[n + 1], z[n + 2], z[n + 3], z[n + 4])
    a, contact, opening, upper = solve_rows(held, share, b, lower, upper, inverse, p)
    for i in range(5):
        z[n + i] = a[i]
    if layers == 2:
        z[2 * n - 1] = upper
    if attached:
        z[2 * n] = contact
    elif layers > 0:
        z[n + 5] = opening


@compiled
def accelerations(system: int, t: float, y: FloatArray, yp: FloatArray, p: Parameters) -> bool:
    """Make (y, y′) consistent: find accelerations and F_c of a state.

    The differential unknowns in ``y`` are read; y′ and, attached, F_c in ``y`` are filled, and F_c′ in ``yp`` is set
    to 0. Returns False if anything is not finite, or the mass matrix is not positive definite.
    """
    if SLIDES[system]:
        sliding_accelerations(system, t, y, yp, p)
    else:
        accelerate(system, t, y, yp, unbalances(y, p), p)
    return finite(yp) and finite(y) and is_definite(y, p)


@inlined
def accelerate(system: int, t: float, y: FloatArray, yp: FloatArray, coupled: Coupled, p: Parameters) -> None:
    """Do as :func:`accelerations`, with the couplings of both exciters in this state, without a look at the result."""
    n = y.size // 2
    if ALGEBRAIC[system]:
        y[2 * n] = 0.0
    for i in range(n, y.size):
        yp[i] = 0.0
    # without accelerations and F_c, they are the forces with their signs changed
    coupled_rows(system, t, y, yp, yp, coupled, p)
    for i in range(n):
        yp[i], yp[n + i] = y[n + i], -yp[n + i]
    if ALGEBRAIC[system]:
        yp[2 * n] = -yp[2 * n]
    solve_coupled(system, yp, coupled, p)
    if ALGEBRAIC[system]:
        y[2 * n], yp[2 * n] = yp[2 * n], 0.0


@compiled
def second_derivatives(system: int, t: float, y: FloatArray, yp: FloatArray, ypp: FloatArray, p: Parameters) -> bool:
    """Find y″ and F_c′ of a consistent (y, y′), by A z′ = −(∂F/∂y) y′ − ∂F/∂t, A = ∂F/∂z.

    This is F = 0 differentiated along the motion; ∂F/∂t is the rate of the motors' torques under a changing supply.
    F_c′ in ``yp`` and y″ are filled; F_c″ is set to 0. Returns False if anything is not finite.
    """
    if SLIDES[system]:
        return sliding_second_derivatives(system, t, y, yp, ypp, p)
    size = y.size
    n = size // 2
    jac = np.empty((size, size))
    jacobian(system, t, y, yp, 0.0, jac, p)
    for i in range(n):
        ypp[i] = yp[n + i]
    rates_of_rows(t, y, yp, n, jac, ypp, p)
    solve(system, y, ypp, p)
    if ALGEBRAIC[system]:
        yp[2 * n], ypp[2 * n] = ypp[2 * n], 0.0
    return finite(yp) and finite(ypp)


@compiled
def linearize(
    system: int, t: float, y: FloatArray, yp: FloatArray, jac: FloatArray, mass: FloatArray, p: Parameters
) -> None:
    """Make (y, y′) consistent and linearize the equations of motion there, without F_c: A δq″ + (∂F/∂y) δy = 0.

    Attached, the lower layer's row is added to the platform's row of y, which then no longer contains F_c.

    Parameters
    ----------
    jac
        ∂F/∂y is filled into rows n to 2n − 1 and the first 2n columns, shape (size, size) or more.
    mass
        Filled with the mass matrix A of the n coordinates, shape (n, n) or more.
    """
    size = y.size
    n = size // 2
    coupled = unbalances(y, p)
    accelerate(system, t, y, yp, coupled, p)
    dynamic_jacobian(system, t, y, yp, 0.0, jac, coupled, p)
    mass_matrix(system, n, mass, coupled, p)
    if ALGEBRAIC[system]:
        for j in range(2 * n):
            jac[n + 1, j] += jac[2 * n, j]
        mass[1, 1] += p.lower_mass


@compiled
def platform_accelerations(system: int, times: FloatArray, states: FloatArray, p: Parameters) -> FloatArray:
    """Accelerations of x, y, φ at times (s) and full states of a system, shape (n, 3); nan where there are none."""
    found = np.empty((times.size, 3))
    y = np.empty(DIFFERENTIAL[system])
    for k in range(times.size):
        gather(system, states[k], y)
        found[k] = explicit(system, times[k], y, p)[y.size // 2 : y.size // 2 + 3]
    return found


@compiled
def explicit(system: int, t: float, y: FloatArray, p: Parameters) -> FloatArray:
    """Return y′ of the differential unknowns and, attached, F_c behind it; nan where there are none.

    This is what solvers of ordinary differential equations ask for.
    """
    size = y.size + 1 if ALGEBRAIC[system] else y.size
    unknowns, rates = np.empty(SIZES[system]), np.empty(SIZES[system])
    for i in range(y.size):
        unknowns[i] = y[i]
    if not accelerations(system, t, unknowns, rates, p):
        rates[:] = np.nan
    elif ALGEBRAIC[system]:
        rates[y.size] = unknowns[y.size]
    return rates[:size]
