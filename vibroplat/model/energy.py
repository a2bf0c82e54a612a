"""Energies and powers, momentum and the forces that change it, for the audit of a run.

The paper's equations turn the exciter axes to first order in φ only. That truncation does not derive
from a Lagrangian: it leaves the power k Σ φ̇ᵢ φ̇² φ (Y₀ sin φᵢ + X₀ᵢ cos φᵢ), third order in φ, without
a physical source. The audit carries it as a term of its own instead of hiding it in the residual.
"""

from __future__ import annotations

import math

import numpy as np

from vibroplat.kernels.compiled import compiled, inlined
from vibroplat.model.motor import resistance
from vibroplat.model.parameters import (
    AXIS_X,
    AXIS_Y,
    DAMPING_PHI,
    DAMPING_X,
    DAMPING_Y,
    FRICTION_1,
    FRICTION_2,
    GRAVITY,
    LAYER_DAMPING,
    LAYER_STIFFNESS,
    LOWER_MASS,
    MASS,
    STIFFNESS_PHI,
    STIFFNESS_X,
    STIFFNESS_Y,
    UNBALANCE,
    UPPER_MASS,
    FloatArray,
)
from vibroplat.model.platform import add_mass_matrix, lever_arms, motor_torques

#: Powers in the order of :func:`powers`; those of motor and truncation feed the system, the dissipations
#: after them take from it.
POWERS = (
    "motor",
    "truncation",
    "damping_x",
    "damping_y",
    "damping_phi",
    "damping_layers",
    "resistance",
)

#: Places after the powers in :func:`powers`: vertical force from outside, and the sum of its terms' sizes.
FORCE, FORCE_SIZE = len(POWERS), len(POWERS) + 1


@inlined
def powers(state: FloatArray, out: FloatArray, p: FloatArray) -> None:
    """Fill the powers named in :data:`POWERS` at a full state (W), then the vertical force from outside (N)."""
    w1, w2 = state[10], state[11]
    torque_1, torque_2 = motor_torques(w1, w2, p)
    out[0] = torque_1 * w1 + torque_2 * w2
    out[1] = truncation(state, abs(out[0]), p)
    out[2] = p[DAMPING_X] * state[7] ** 2
    out[3] = p[DAMPING_Y] * state[8] ** 2
    out[4] = p[DAMPING_PHI] * state[9] ** 2
    out[5] = p[UPPER_MASS] * p[LAYER_DAMPING] * state[13] ** 2
    out[6] = w1 * resistance(w1, p[FRICTION_1]) + w2 * resistance(w2, p[FRICTION_2])
    weight = p[GRAVITY] * (p[MASS] + p[LOWER_MASS] + p[UPPER_MASS])
    spring, damper = p[STIFFNESS_Y] * state[1], p[DAMPING_Y] * state[8]
    out[FORCE] = -spring - damper - weight
    out[FORCE_SIZE] = abs(spring) + abs(damper) + weight


@compiled
def truncation(state: FloatArray, beside: float, p: FloatArray) -> float:
    """Power of the axes' turning to first order (W); 0 where it is round-off beside another power."""
    w1, w2 = state[10], state[11]
    weight = p[UNBALANCE] * state[2] * state[9] * state[9]
    arm = abs(p[AXIS_X]) + abs(p[AXIS_Y])
    if abs(weight) * arm * (abs(w1) + abs(w2)) <= 1e-16 * beside:
        return 0.0  # a platform that does not rock pays for no sines
    b1, _ = lever_arms(p[AXIS_X], p[AXIS_Y], math.sin(state[3]), math.cos(state[3]))
    b2, _ = lever_arms(-p[AXIS_X], p[AXIS_Y], math.sin(state[4]), math.cos(state[4]))
    return weight * (w1 * b1 + w2 * b2)


@compiled
def inertia_product(state: FloatArray, u: FloatArray, v: FloatArray, p: FloatArray) -> float:
    """Product u·𝓜 v of two sets of the seven rates with the mass matrix of the whole scene (J)."""
    matrix = np.zeros((5, 5))
    add_mass_matrix(matrix, 0, 1.0, state, p)
    product = 0.0
    for i in range(5):
        for j in range(5):
            product += matrix[i, j] * u[i] * v[j]
    lower_u, lower_v = u[1] + u[5], v[1] + v[5]
    product += p[LOWER_MASS] * lower_u * lower_v
    return product + p[UPPER_MASS] * (lower_u + u[6]) * (lower_v + v[6])


@compiled
def kinetic_energy(state: FloatArray, p: FloatArray) -> float:
    """Kinetic energy of platform, exciters and layers (J)."""
    return 0.5 * inertia_product(state, state[7:], state[7:], p)


@compiled
def elastic_energy(state: FloatArray, p: FloatArray) -> float:
    """Potential energy of the springs, that between the layers included (J)."""
    springs = p[STIFFNESS_X] * state[0] ** 2 + p[STIFFNESS_Y] * state[1] ** 2 + p[STIFFNESS_PHI] * state[2] ** 2
    return 0.5 * (springs + p[UPPER_MASS] * p[LAYER_STIFFNESS] * state[6] ** 2)


@compiled
def gravity_energy(state: FloatArray, p: FloatArray) -> float:
    """Potential energy in gravity of platform, unbalances and layers (J)."""
    lower = state[1] + state[5]
    heights = p[MASS] * state[1] + p[LOWER_MASS] * lower + p[UPPER_MASS] * (lower + state[6])
    return p[GRAVITY] * (heights + p[UNBALANCE] * (math.sin(state[3]) + math.sin(state[4])))


@compiled
def vertical_momentum(state: FloatArray, p: FloatArray) -> float:
    """Vertical momentum of platform, unbalances and layers (N·s); only forces from outside change it."""
    upward = np.zeros(7)
    upward[1] = 1.0
    return inertia_product(state, upward, state[7:], p)


@compiled
def unbalance_momentum(state: FloatArray, p: FloatArray) -> float:
    """Sum of the sizes of both unbalances' momenta beside their axes (N·s)."""
    return p[UNBALANCE] * (abs(state[10]) + abs(state[11]))
