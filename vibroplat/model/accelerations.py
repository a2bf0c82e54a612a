"""Accelerations and contact force by a direct solve, their derivatives along the motion and by the state.

The dynamic rows of F are linear in z, the n accelerations and, attached, F_c. What multiplies z is constant in a state,
so that most of this is a solve with :func:`vibroplat.model.platform.solve_rows`, whose right-hand sides come from the
rows of :mod:`vibroplat.model.equations` and their Jacobian.
"""

from __future__ import annotations

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, inlined
from vibroplat.model.equations import dynamic_jacobian, finite, loads, mass_matrix, rates_of_rows
from vibroplat.model.parameters import Parameters
from vibroplat.model.platform import compliance, is_definite, mobility, solve_rows, unbalances
from vibroplat.model.sliding import add_friction, law, response
from vibroplat.model.systems import ALGEBRAIC, DIFFERENTIAL, GAP, LAYERS, SENSE, SIZES, SLIDES, STICKS, UPPER, gather


@inlined
def solve(system: int, y: FloatArray, z: FloatArray, p: Parameters) -> None:
    """Solve (∂F/∂z) z = b for accelerations and forces of contact.

    In contact, the lower layer's row m_w1 ÿ − F_c = b is added to the platform's row of y, which leaves a platform
    whose mass there is M + m_w1; with transport friction is added to that. Of the unknowns ``y`` coordinates are read.
    From place n on ``z``, shape (size,), holds the right-hand sides of the dynamic rows, in the order of the rows, and
    is left with accelerations and forces.
    """
    n, layers, attached = DIFFERENTIAL[system] // 2, LAYERS[system], ALGEBRAIC[system]
    first, second = unbalances(y, p)
    lower = upper = 0.0 * z[n]
    if layers > 0:
        lower = z[2 * n] if attached else z[n + GAP]
    if layers == 2:
        upper = z[n + UPPER[system]]
    b = (z[n], z[n + 1], z[n + 2], z[n + 3], z[n + 4])
    held = 1.0 if attached else 0.0
    inverse = compliance(first, second, mobility(held, p), p)
    share = 1.0 / p.lower_mass if layers > 0 else 0.0 * p.lower_mass
    solution = solve_rows(held, share, b, lower, upper, inverse, p)
    if SLIDES[system]:
        r = response(inverse, p.deck_height, held * p.lower_mass, p.material_share)
        friction_law = law(1.0 if STICKS[system] else 0.0, p.kinetic_friction * SENSE[system], r)
        along = z[2 * n - 1] * p.material_share
        solution, slip, friction = add_friction(solution, along, p.deck_height, held, r, friction_law)
        z[2 * n - 1] = 0.0 if STICKS[system] else slip
        if attached:
            z[2 * n + 1] = friction
    a, contact, opening, upper = solution
    for i in range(5):
        z[n + i] = a[i]
    if layers == 2:
        z[n + UPPER[system]] = upper
    if attached:
        z[2 * n] = contact
    elif layers > 0:
        z[n + GAP] = opening


@compiled
def accelerations(system: int, t: float, y: FloatArray, yp: FloatArray, p: Parameters) -> bool:
    """Make (y, y′) consistent: find accelerations and forces of contact of a state.

    The differential unknowns in ``y`` are read; y′ and, in contact, forces in ``y`` are filled, and their rates in
    ``yp`` are set to 0. Returns False if anything is not finite, or the mass matrix is not positive definite.
    """
    accelerate(system, t, y, yp, p)
    return finite(yp) and finite(y) and is_definite(y, p)


@inlined
def accelerate(system: int, t: float, y: FloatArray, yp: FloatArray, p: Parameters) -> None:
    """Do as :func:`accelerations`, without a look at the result."""
    n = DIFFERENTIAL[system] // 2
    for i in range(n):
        yp[i] = y[n + i]
    loads(system, t, y, yp, p)
    solve(system, y, yp, p)
    for i in range(2 * n, y.size):
        y[i], yp[i] = yp[i], 0.0


@compiled
def second_derivatives(system: int, t: float, y: FloatArray, yp: FloatArray, ypp: FloatArray, p: Parameters) -> bool:
    """Find y″ and the rates of contact forces of a consistent (y, y′), by A z′ = −(∂F/∂y) y′ − ∂F/∂t, A = ∂F/∂z.

    This is F = 0 differentiated along the motion; ∂F/∂t is the rate of the motors' torques under a changing supply.
    Rates of forces in ``yp`` and y″ are filled; second rates of forces are set to 0. Returns False if anything is not
    finite.
    """
    n = DIFFERENTIAL[system] // 2
    for i in range(n):
        ypp[i] = yp[n + i]
    rates_of_rows(system, t, y, yp, ypp, p)
    solve(system, y, ypp, p)
    for i in range(2 * n, y.size):
        yp[i], ypp[i] = ypp[i], 0.0
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
    accelerate(system, t, y, yp, p)
    dynamic_jacobian(system, t, y, yp, 0.0, jac, p)
    mass_matrix(system, y, mass, p)
    if ALGEBRAIC[system]:
        for j in range(2 * n):
            jac[n + 1, j] += jac[2 * n, j]
        mass[1, 1] += p.lower_mass


@compiled
def platform_accelerations(system: int, times: FloatArray, states: FloatArray, p: Parameters) -> FloatArray:
    """Accelerations of x, y, φ at times (s) and full states of a system, shape (n, 3); nan where there are none."""
    found, n = np.empty((times.size, 3)), DIFFERENTIAL[system] // 2
    y, yp = np.empty(SIZES[system]), np.empty(SIZES[system])
    for k in range(times.size):
        gather(system, states[k], y)
        found[k] = np.nan
        if accelerations(system, times[k], y, yp, p):
            found[k] = yp[n : n + 3]
    return found
