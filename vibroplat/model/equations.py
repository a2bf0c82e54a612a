"""The rows of the differential-algebraic equations F(t, y, y′) = 0 and their Jacobian ∂F/∂y + c_j ∂F/∂y′.

====================  ==================================================  ========
system                unknowns                                            how many
====================  ==================================================  ========
bare                  x, y, φ, φ₁, φ₂ and rates                           10
attached, one layer   the same and F_c                                    11
attached, two layers  x, y, φ, φ₁, φ₂, y_w2 and rates, F_c                13
flight, one layer     x, y, φ, φ₁, φ₂, y_w1 and rates                     12
flight, two layers    x, y, φ, φ₁, φ₂, y_w1, y_w2 and rates               14
====================  ==================================================  ========

Of n coordinates, the first n rows say that rates are their derivatives; the dynamic rows after them are inertia
times acceleration less forces. While attached, gap and gap rate are zero and are not integrated; the position
constraint is reduced to acceleration level, so that F_c is an algebraic unknown of index 1 and the lower layer's row is
its equation (paper (5), (6); there the damper of (6b) has the wrong sign).
"""

from __future__ import annotations

from vibroplat.kernels.compiled import FloatArray, compiled, inlined
from vibroplat.model.motor import net_slope, torque_rate
from vibroplat.model.parameters import Parameters
from vibroplat.model.platform import Unbalance, forces, inertial, is_definite, unbalances
from vibroplat.model.springs import relative, restoring, slopes
from vibroplat.model.systems import ALGEBRAIC, LAYERS, UPPER

#: The couplings of both exciters.
Coupled = tuple[Unbalance, Unbalance]


@compiled
def finite(values: FloatArray) -> bool:
    """Whether no value is nan or infinite."""
    total = 0.0
    for value in values:
        total += value * 0.0
    return total == 0.0


@compiled
def residual(system: int, t: float, y: FloatArray, yp: FloatArray, res: FloatArray, p: Parameters) -> bool:
    """Fill F(t, y, y′) of the system with this number.

    Returns False, which an integrator must not pass over, if anything is not finite or if the platform has turned to
    where the mass matrix is not positive definite (:func:`vibroplat.model.platform.is_definite`).
    """
    rows(system, t, y, yp, res, p)
    return finite(res) and is_definite(y, p)


@compiled
def rows(system: int, t: float, y: FloatArray, yp: FloatArray, res: FloatArray, p: Parameters) -> None:
    """Fill the rows of F(t, y, y′); ``res`` may be ``yp`` itself.

    The lower layer is accelerated with ÿ + ÿ_w1, the upper one with ÿ + ÿ_w1 + ÿ_w2, and S = c_w y_w2 + b_w ẏ_w2 acts
    between them:

        m_w1 (ÿ + ÿ_w1 + g) − S − F_c = 0,    ÿ + ÿ_w1 + ÿ_w2 + g + S/m_w2 = 0.
    """
    coupled_rows(system, t, y, yp, res, unbalances(y, p), p)


@inlined
def coupled_rows(
    system: int, t: float, y: FloatArray, yp: FloatArray, res: FloatArray, coupled: Coupled, p: Parameters
) -> None:
    """Do as :func:`rows`, with the couplings of both exciters in this state."""
    n = y.size // 2
    layers, attached = LAYERS[system], ALGEBRAIC[system]
    force = y[2 * n] if attached else 0.0
    held = restoring(relative(system, y, 0, n), relative(system, y, n, n), p)
    lower = yp[n + 1] + p.gravity
    if not attached and layers > 0:
        lower += yp[n + 5]
    upper = lower + yp[2 * n - 1]
    first, second = coupled
    inertias = inertial(yp, n, first, second, p)
    acting = forces(t, y, n, first, second, held, force, p)
    for i in range(n):
        res[i] = yp[i] - y[n + i]
    for i in range(5):
        res[n + i] = inertias[i] - acting[i]
    if layers > 0:
        if layers == 2:
            res[2 * n - 1] = upper + held[4]
        res[2 * n if attached else n + 5] = p.lower_mass * lower - (p.upper_mass * held[4] - held[3]) - force


@compiled
def jacobian(system: int, t: float, y: FloatArray, yp: FloatArray, cj: float, jac: FloatArray, p: Parameters) -> None:
    """Fill ∂F/∂y + c_j ∂F/∂y′ of the system with this number, shape (size, size)."""
    n = y.size // 2
    for i in range(n):
        for j in range(y.size):
            jac[i, j] = 0.0
        jac[i, i] = cj
        jac[i, n + i] = -1.0
    dynamic_jacobian(system, t, y, yp, cj, jac, unbalances(y, p), p)


@inlined
def dynamic_jacobian(
    system: int, t: float, y: FloatArray, yp: FloatArray, cj: float, jac: FloatArray, coupled: Coupled, p: Parameters
) -> None:
    """Fill those of its rows that are dynamic, with the couplings of both exciters in this state."""
    n = y.size // 2
    for i in range(n, y.size):
        for j in range(y.size):
            jac[i, j] = 0.0
    platform_jacobian(n, t, y, yp, cj, jac, coupled, p)
    if LAYERS[system] > 0:
        layer_jacobian(system, n, cj, jac, p)


@inlined
def platform_jacobian(
    n: int, t: float, y: FloatArray, yp: FloatArray, cj: float, jac: FloatArray, coupled: Coupled, p: Parameters
) -> None:
    """Fill the rows of platform and exciters of a system with n coordinates, without the layers."""
    stiffness, damping = slopes(p)
    inertia = p.mass, p.mass, p.inertia
    for i in range(3):
        jac[n + i, i], jac[n + i, n + i] = stiffness[i], damping[i] + cj * inertia[i]
    for i in range(2):
        exciter_jacobian(i, n, t, y, yp, cj, jac, coupled[i], p)


@inlined
def rates_of_rows(
    t: float, y: FloatArray, yp: FloatArray, n: int, jac: FloatArray, b: FloatArray, p: Parameters
) -> None:
    """Fill ``b`` from place n on with minus the rates of the dynamic rows at constant y″.

    ``jac`` is the Jacobian with c_j = 0. The torques of the motors also have rates of their own.
    """
    for i in range(n, y.size):
        b[i] = 0.0
        for j in range(2 * n):
            b[i] -= jac[i, j] * yp[j]
    for i in range(2):
        rate = torque_rate(i, t, y[n + 3 + i], p)
        b[n + 3 + i] += rate
        b[n + 2] -= p.deck[i] * rate


@compiled
def exciter_jacobian(
    i: int, n: int, t: float, y: FloatArray, yp: FloatArray, cj: float, jac: FloatArray, u: Unbalance, p: Parameters
) -> None:
    """Fill the columns of φᵢ and φ̇ᵢ in the platform's rows, and exciter i's row."""
    angle, row = 3 + i, n + 3 + i
    w, a = y[row], yp[row]
    q, vphi = w * w, y[n + 2]
    ax, ay, aphi = yp[n], yp[n + 1] + p.gravity, yp[n + 2]
    # the platform's rows hold c φ̈ᵢ − d φ̇ᵢ², and ∂c/∂φᵢ = −d, ∂d/∂φᵢ = c
    jac[n, angle], jac[n, row] = -u.y * a - u.x * q, cj * u.x - 2.0 * u.y * w
    jac[n + 1, angle], jac[n + 1, row] = u.x * a - u.y * q, cj * u.y + 2.0 * u.x * w
    jac[n + 2, angle], jac[n + 2, row] = -u.lever * a - u.phi * q, cj * u.phi - 2.0 * u.lever * w
    jac[n + 2, 2] += u.lever_still * a + u.phi_still * q
    # the exciter's holds c·(ẍ, ÿ + g, φ̈) + d_φ φ̇²
    jac[row, 2] = u.lever_still * aphi - u.phi_still * vphi * vphi
    jac[row, angle] = u.x * ay - u.y * ax - u.lever * aphi + u.phi * vphi * vphi
    jac[row, n], jac[row, n + 1], jac[row, n + 2] = cj * u.x, cj * u.y, cj * u.phi + 2.0 * u.lever * vphi
    slope = net_slope(i, t, w, p)
    jac[row, row] = cj * p.exciter_inertia[i] - slope
    jac[n + 2, row] += p.deck[i] * slope


@compiled
def mass_matrix(system: int, n: int, mass: FloatArray, coupled: Coupled, p: Parameters) -> None:
    """Fill what multiplies the n accelerations in the dynamic rows without that of F_c, shape (n, n) or more."""
    for i in range(n):
        for j in range(n):
            mass[i, j] = 0.0
    mass[0, 0], mass[1, 1], mass[2, 2] = p.mass, p.mass, p.inertia
    for i in range(2):
        u, k = coupled[i], 3 + i
        mass[0, k], mass[1, k], mass[2, k] = u.x, u.y, u.phi
        mass[k, 0], mass[k, 1], mass[k, 2], mass[k, k] = u.x, u.y, u.phi, p.exciter_inertia[i]
    free = LAYERS[system] > 0 and not ALGEBRAIC[system]
    if free:
        mass[5, 1] = mass[5, 5] = p.lower_mass
    if LAYERS[system] == 2:
        mass[n - 1, 1] = mass[n - 1, n - 1] = 1.0
        if free:
            mass[n - 1, 5] = 1.0


@compiled
def layer_jacobian(system: int, n: int, cj: float, jac: FloatArray, p: Parameters) -> None:
    """Fill the layers' rows, the column of F_c, and what the gap's spring and damper do to the platform."""
    attached, (stiffness, damping) = ALGEBRAIC[system], slopes(p)
    lower, own = 2 * n if attached else n + 5, UPPER[system]
    upper = n + own
    jac[lower, n + 1] = cj * p.lower_mass
    if attached:
        jac[lower, 2 * n], jac[n + 1, 2 * n] = -1.0, 1.0
    else:
        jac[lower, 5], jac[lower, n + 5] = stiffness[3], damping[3] + cj * p.lower_mass
        jac[n + 1, 5], jac[n + 1, n + 5] = 0.0 - stiffness[3], 0.0 - damping[3]
    if LAYERS[system] == 2:
        jac[lower, own], jac[lower, upper] = -p.upper_mass * stiffness[4], -p.upper_mass * damping[4]
        jac[upper, own], jac[upper, upper] = stiffness[4], damping[4] + cj
        jac[upper, n + 1] = cj
        if not attached:
            jac[upper, n + 5] = cj
