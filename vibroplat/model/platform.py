"""Platform and exciters: forces and mass matrix, shared by every mode.

A mode's unknowns are ``n`` coordinates, the first five always x, y, φ, φ₁, φ₂, then their ``n``
rates; an attached mode ends with F_c. The functions here fill the rows of platform and exciters and
leave the material's rows to the mode.
"""

from __future__ import annotations

import math

from vibroplat.kernels.compiled import compiled
from vibroplat.model.motor import kloss_slope, kloss_torque, resistance, resistance_slope
from vibroplat.model.parameters import (
    AXIS_X,
    AXIS_Y,
    DAMPING_PHI,
    DAMPING_X,
    DAMPING_Y,
    EXCITER_INERTIA,
    FRICTION_1,
    FRICTION_2,
    GRAVITY,
    INERTIA,
    MASS,
    SAFE_ROTATION,
    SLIP_1,
    SLIP_2,
    SPEED_1,
    SPEED_2,
    STIFFNESS_PHI,
    STIFFNESS_X,
    STIFFNESS_Y,
    TORQUE_1,
    TORQUE_2,
    UNBALANCE,
    FloatArray,
)

#: Least share of an exciter's own inertia that the platform's yielding may leave of it.
DEFINITE = 1e-3


@compiled
def lever_arms(axis_x: float, axis_y: float, sine: float, cosine: float) -> tuple[float, float]:
    """Projections (B, D) of an exciter axis (X, Y): B = X cos φᵢ + Y sin φᵢ, D = X sin φᵢ − Y cos φᵢ.

    ∂B/∂φᵢ = −D and ∂D/∂φᵢ = B. With the axis turned to first order, (X, Y) = (X₀ − φY₀, Y₀ + φX₀),
    ∂B/∂φ = D₀ and ∂D/∂φ = −B₀, the projections of the axis that is not turned.
    """
    return axis_x * cosine + axis_y * sine, axis_x * sine - axis_y * cosine


@compiled
def turned_arms(phi: float, side: float, sine: float, cosine: float, p: FloatArray) -> tuple[float, float]:
    """Projections (B, D) of the axis of exciter 1 (side +1) or 2 (side −1), turned with the platform."""
    x0 = side * p[AXIS_X]
    return lever_arms(x0 - phi * p[AXIS_Y], p[AXIS_Y] + phi * x0, sine, cosine)


@compiled
def motor_torques(speed_1: float, speed_2: float, p: FloatArray) -> tuple[float, float]:
    """Motor torques L_1, L_2 (N·m); exciter 1 is driven counter-clockwise, exciter 2 clockwise."""
    return (
        kloss_torque(speed_1, 1.0, p[TORQUE_1], p[SLIP_1], p[SPEED_1]),
        kloss_torque(speed_2, -1.0, p[TORQUE_2], p[SLIP_2], p[SPEED_2]),
    )


@compiled
def platform_residual(y: FloatArray, yp: FloatArray, res: FloatArray, p: FloatArray, load: float) -> None:
    """Fill the kinematic rows of all n coordinates and the dynamic rows of platform and exciters.

    The rows are those of the paper's (2), (3) with Lagrange's signs: mass matrix times accelerations
    minus forces. ``load`` is the vertical force with which the material presses down on the platform (N).
    Where the platform has turned beyond the model (:func:`holds`) the row of its rotation is nan.
    """
    n = y.size // 2
    for i in range(n):
        res[i] = yp[i] - y[n + i]
    k = p[UNBALANCE]
    g = p[GRAVITY]
    phi = y[2]
    vx, vy, vphi, w1, w2 = y[n], y[n + 1], y[n + 2], y[n + 3], y[n + 4]
    ax, ay, aphi, a1, a2 = yp[n], yp[n + 1], yp[n + 2], yp[n + 3], yp[n + 4]
    s1, c1 = math.sin(y[3]), math.cos(y[3])
    s2, c2 = math.sin(y[4]), math.cos(y[4])
    b1, d1 = turned_arms(phi, 1.0, s1, c1, p)
    b2, d2 = turned_arms(phi, -1.0, s2, c2, p)
    torque_1, torque_2 = motor_torques(w1, w2, p)
    q1, q2 = w1 * w1, w2 * w2
    res[n] = (
        p[MASS] * ax - k * (s1 * a1 + s2 * a2) + p[DAMPING_X] * vx + p[STIFFNESS_X] * y[0] - k * (c1 * q1 + c2 * q2)
    )
    res[n + 1] = (
        p[MASS] * (ay + g)
        + k * (c1 * a1 + c2 * a2)
        + p[DAMPING_Y] * vy
        + p[STIFFNESS_Y] * y[1]
        + load
        - k * (s1 * q1 + s2 * q2)
    )
    res[n + 2] = (
        p[INERTIA] * aphi
        + k * (b1 * a1 + b2 * a2)
        + p[DAMPING_PHI] * vphi
        + p[STIFFNESS_PHI] * phi
        - k * (d1 * q1 + d2 * q2)
    )
    res[n + 3] = (
        p[EXCITER_INERTIA] * a1
        + k * (-s1 * ax + c1 * (ay + g) + b1 * aphi + d1 * vphi * vphi)
        - torque_1
        + resistance(w1, p[FRICTION_1])
    )
    res[n + 4] = (
        p[EXCITER_INERTIA] * a2
        + k * (-s2 * ax + c2 * (ay + g) + b2 * aphi + d2 * vphi * vphi)
        - torque_2
        + resistance(w2, p[FRICTION_2])
    )
    if abs(phi) > p[SAFE_ROTATION] and not holds(b1, b2, s1 * s2 + c1 * c2, p):
        res[n + 2] = math.nan


@compiled
def holds(arm_1: float, arm_2: float, cosine: float, p: FloatArray) -> bool:
    """Whether the mass matrix is positive definite, by some margin, as every real body's is.

    With axes that turn to first order in φ it loses this where the platform has turned far; the motion would
    run away there in finite time. ``arm_1`` and ``arm_2`` are B of :func:`turned_arms`, ``cosine`` is that of
    the difference of both exciter angles.
    """
    m11, m12, m22 = exciter_masses(arm_1, arm_2, cosine, p)
    least = DEFINITE * p[EXCITER_INERTIA]
    return m11 > least and m22 > least and m11 * m22 - m12 * m12 > least * least


@compiled
def exciter_masses(arm_1: float, arm_2: float, cosine: float, p: FloatArray) -> tuple[float, float, float]:
    """Entries (11, 12, 22) of the exciters' mass matrix after the platform's x, y, φ have been eliminated."""
    k = p[UNBALANCE]
    mass, inertia = k * k / p[MASS], k * k / p[INERTIA]
    return (
        p[EXCITER_INERTIA] - mass - inertia * arm_1 * arm_1,
        -mass * cosine - inertia * arm_1 * arm_2,
        p[EXCITER_INERTIA] - mass - inertia * arm_2 * arm_2,
    )


@compiled
def add_mass_matrix(target: FloatArray, corner: int, factor: float, y: FloatArray, p: FloatArray) -> None:
    """Add ``factor`` times the 5×5 platform–exciter mass matrix to ``target`` at (corner, corner)."""
    k = p[UNBALANCE]
    target[corner, corner] += factor * p[MASS]
    target[corner + 1, corner + 1] += factor * p[MASS]
    target[corner + 2, corner + 2] += factor * p[INERTIA]
    for exciter in range(2):
        row = corner + 3 + exciter
        sine, cosine = math.sin(y[3 + exciter]), math.cos(y[3 + exciter])
        arm, _ = turned_arms(y[2], 1.0 - 2.0 * exciter, sine, cosine, p)
        target[row, row] += factor * p[EXCITER_INERTIA]
        for column, coupling in ((corner, -k * sine), (corner + 1, k * cosine), (corner + 2, k * arm)):
            target[row, column] += factor * coupling
            target[column, row] += factor * coupling


@compiled
def solve_mass_matrix(b: FloatArray, y: FloatArray, p: FloatArray) -> None:
    """Replace five generalized forces by the accelerations of platform and exciters.

    The mass matrix of :func:`add_mass_matrix` couples the platform's x, y, φ, which are diagonal among
    themselves, with the exciters alone; eliminating them leaves two equations for the exciters.
    """
    k = p[UNBALANCE]
    s1, c1, s2, c2 = math.sin(y[3]), math.cos(y[3]), math.sin(y[4]), math.cos(y[4])
    arm_1, _ = turned_arms(y[2], 1.0, s1, c1, p)
    arm_2, _ = turned_arms(y[2], -1.0, s2, c2, p)
    x1, y1, f1 = -k * s1, k * c1, k * arm_1
    x2, y2, f2 = -k * s2, k * c2, k * arm_2
    mass, inertia = 1.0 / p[MASS], 1.0 / p[INERTIA]
    m11, m12, m22 = exciter_masses(arm_1, arm_2, s1 * s2 + c1 * c2, p)
    b1 = b[3] - mass * (x1 * b[0] + y1 * b[1]) - inertia * f1 * b[2]
    b2 = b[4] - mass * (x2 * b[0] + y2 * b[1]) - inertia * f2 * b[2]
    determinant = m11 * m22 - m12 * m12
    a1 = (m22 * b1 - m12 * b2) / determinant
    a2 = (m11 * b2 - m12 * b1) / determinant
    b[0] = mass * (b[0] - x1 * a1 - x2 * a2)
    b[1] = mass * (b[1] - y1 * a1 - y2 * a2)
    b[2] = inertia * (b[2] - f1 * a1 - f2 * a2)
    b[3], b[4] = a1, a2


@compiled
def platform_jacobian(y: FloatArray, yp: FloatArray, cj: float, jac: FloatArray, p: FloatArray) -> None:
    """Fill ∂F/∂y + c_j ∂F/∂y′ of the rows of :func:`platform_residual`, without the load's columns.

    ``jac`` is cleared first, so a mode adds its own rows afterwards.
    """
    n = y.size // 2
    for i in range(jac.shape[0]):
        for j in range(jac.shape[1]):
            jac[i, j] = 0.0
    for i in range(n):
        jac[i, i] = cj
        jac[i, n + i] = -1.0
    add_mass_matrix(jac, n, cj, y, p)
    k = p[UNBALANCE]
    g = p[GRAVITY]
    phi, vphi = y[2], y[n + 2]
    ax, ay, aphi = yp[n], yp[n + 1], yp[n + 2]
    jac[n, 0] += p[STIFFNESS_X]
    jac[n, n] += p[DAMPING_X]
    jac[n + 1, 1] += p[STIFFNESS_Y]
    jac[n + 1, n + 1] += p[DAMPING_Y]
    jac[n + 2, 2] += p[STIFFNESS_PHI]
    jac[n + 2, n + 2] += p[DAMPING_PHI]
    for exciter in range(2):
        angle = 3 + exciter
        side = 1.0 - 2.0 * exciter
        row = n + angle
        w, a = y[row], yp[row]
        sine, cosine = math.sin(y[angle]), math.cos(y[angle])
        b, d = turned_arms(phi, side, sine, cosine, p)
        b0, d0 = lever_arms(side * p[AXIS_X], p[AXIS_Y], sine, cosine)
        jac[n, angle] += k * (-cosine * a + sine * w * w)
        jac[n, row] += -2.0 * k * cosine * w
        jac[n + 1, angle] += k * (-sine * a - cosine * w * w)
        jac[n + 1, row] += -2.0 * k * sine * w
        jac[n + 2, 2] += k * (d0 * a + b0 * w * w)
        jac[n + 2, angle] += k * (-d * a - b * w * w)
        jac[n + 2, row] += -2.0 * k * d * w
        jac[row, 2] += k * (d0 * aphi - b0 * vphi * vphi)
        jac[row, angle] += k * (-cosine * ax - sine * (ay + g) - d * aphi + b * vphi * vphi)
        jac[row, n + 2] += 2.0 * k * d * vphi
    jac[n + 3, n + 3] += resistance_slope(y[n + 3], p[FRICTION_1]) - kloss_slope(
        y[n + 3], 1.0, p[TORQUE_1], p[SLIP_1], p[SPEED_1]
    )
    jac[n + 4, n + 4] += resistance_slope(y[n + 4], p[FRICTION_2]) - kloss_slope(
        y[n + 4], -1.0, p[TORQUE_2], p[SLIP_2], p[SPEED_2]
    )
