"""Energies and powers, momentum and the forces that change it, for the audit of a run.

The paper's equations turn the exciter axes to first order in φ only. That truncation does not derive
from a Lagrangian: it leaves the power k Σ φ̇ᵢ φ̇² φ (Y₀ sin φᵢ + X₀ᵢ cos φᵢ), third order in φ, without
a physical source. The audit carries it as a term of its own instead of hiding it in the residual.
"""

from __future__ import annotations

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, inlined
from vibroplat.kernels.lanes import sines
from vibroplat.model.motor import motor_torque, resistance
from vibroplat.model.parameters import Parameters
from vibroplat.model.platform import couplings, inertial, unbalance

#: Powers in the order of :func:`powers`; those of motor and truncation feed the system, the dissipations
#: after them take from it.
POWERS = ("motor", "truncation", "damping_x", "damping_y", "damping_phi", "damping_layers", "resistance")

#: Places after the powers in :func:`powers`: vertical force from outside, and the sum of its terms' sizes.
FORCE, FORCE_SIZE = len(POWERS), len(POWERS) + 1


@inlined
def powers(t: float, state: FloatArray, out: FloatArray, p: Parameters) -> None:
    """Fill the powers named in :data:`POWERS` at a full state (W), then the vertical force from outside (N)."""
    w1, w2 = state[10], state[11]
    out[0] = motor_torque(0, t, w1, p) * w1 + motor_torque(1, t, w2, p) * w2
    out[1] = truncation(state, abs(out[0]), p)
    out[2] = p.damping_x * state[7] ** 2
    out[3] = p.damping_y * state[8] ** 2
    out[4] = p.damping_phi * state[9] ** 2
    out[5] = p.upper_mass * p.layer_damping * state[13] ** 2
    out[6] = w1 * resistance(w1, p.friction[0]) + w2 * resistance(w2, p.friction[1])
    weight = p.gravity * (p.mass + p.lower_mass + p.upper_mass)
    spring, damper = p.stiffness_y * state[1], p.damping_y * state[8]
    out[FORCE] = -spring - damper - weight
    out[FORCE_SIZE] = abs(spring) + abs(damper) + weight


@compiled
def truncation(state: FloatArray, beside: float, p: Parameters) -> float:
    """Power of the axes' turning to first order (W); 0 where it is round-off beside another power."""
    turning, largest = state[2] * state[9] * state[9], 0.0
    for i in range(2):
        largest += p.unbalance[i] * (abs(p.axis_x[i]) + abs(p.axis_y[i])) * abs(state[10 + i])
    if abs(turning) * largest <= 1e-16 * beside:
        return 0.0  # a platform that does not rock pays for no sines
    s1, c1, s2, c2 = sines(state[3], state[4])
    phi = state[2]
    return turning * (
        state[10] * couplings(0, phi, s1, c1, p).phi_still + state[11] * couplings(1, phi, s2, c2, p).phi_still
    )


@compiled
def inertia_product(state: FloatArray, u: FloatArray, v: FloatArray, p: Parameters) -> float:
    """Product u·𝓜 v of two sets of the seven rates with the mass matrix of the whole scene (J)."""
    momenta = inertial(v, 0, unbalance(0, state, p), unbalance(1, state, p), p)
    lower_u, lower_v = u[1] + u[5], v[1] + v[5]
    product = p.lower_mass * lower_u * lower_v + p.upper_mass * (lower_u + u[6]) * (lower_v + v[6])
    for i in range(5):
        product += u[i] * momenta[i]
    return product


@compiled
def energies(state: FloatArray, p: Parameters) -> tuple[float, float, float, float, float]:
    """Return kinetic and elastic energy, that in gravity (J), vertical momentum and the unbalances' momenta (N·s).

    Elastic energy includes that of the spring between the layers. The last number is the sum of the sizes of both
    unbalances' momenta beside their axes; only forces from outside change the vertical momentum.
    """
    springs = p.stiffness_x * state[0] ** 2 + p.stiffness_y * state[1] ** 2 + p.stiffness_phi * state[2] ** 2
    lower, upward = state[1] + state[5], np.zeros(7)
    heights = p.mass * state[1] + p.lower_mass * lower + p.upper_mass * (lower + state[6])
    upward[1] = 1.0
    return (
        0.5 * inertia_product(state, state[7:], state[7:], p),
        0.5 * (springs + p.upper_mass * p.layer_stiffness * state[6] ** 2),
        p.gravity * (heights - unbalance(0, state, p).x - unbalance(1, state, p).x),
        inertia_product(state, upward, state[7:], p),
        p.unbalance[0] * abs(state[10]) + p.unbalance[1] * abs(state[11]),
    )
