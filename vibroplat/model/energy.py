"""Energies and powers, momentum and the forces that change it, for the audit of a run.

The paper's equations turn the exciter axes to first order in φ only. That truncation does not derive
from a Lagrangian: it leaves the power k Σ φ̇ᵢ φ̇² φ (Y₀ sin φᵢ + X₀ᵢ cos φᵢ), third order in φ, without
a physical source. The audit carries it as a term of its own instead of hiding it in the residual.
"""

from __future__ import annotations

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, inlined
from vibroplat.kernels.sines import sincos_pair
from vibroplat.model.motor import resistance
from vibroplat.model.parameters import Parameters
from vibroplat.model.platform import Three, couplings, inertial, unbalance
from vibroplat.model.springs import DAMPERS, slopes
from vibroplat.model.systems import ALGEBRAIC, GAP, LAYERS, UPPER

#: Powers in the order of :func:`powers`; those of motor and truncation feed the system, the dissipations
#: after them take from it.
POWERS = ("motor", "truncation", *DAMPERS, "resistance")

#: Places of the dampers' coordinates among the relative ones, and of the first damper among the powers.
_DAMPED, DISSIPATIONS = tuple(place for place, _ in DAMPERS.values()), 2

#: Places after the powers in :func:`powers`: vertical force from outside, and the sum of its terms' sizes.
FORCE, FORCE_SIZE = len(POWERS), len(POWERS) + 1

#: Places behind them of what transport has: power of friction (W), force from outside along the deck, and the sum of
#: its terms' sizes (N).
FRICTION, ALONG_FORCE, ALONG_SIZE = (FORCE_SIZE + i for i in (1, 2, 3))


@inlined
def exciter_powers(motor_1: float, motor_2: float, y: FloatArray, n: int, p: Parameters) -> Three:
    """Powers of both motors, truncation and resistance (W), from those of the motors.

    The rates begin at place n of the unknowns.
    """
    w1, w2, motor = y[n + 3], y[n + 4], motor_1 + motor_2
    resisted = w1 * resistance(w1, p.friction[0]) + w2 * resistance(w2, p.friction[1])
    return motor, truncation(y, n, abs(motor), p), resisted


@inlined
def deck_power(torque_1: float, torque_2: float, y: FloatArray, n: int, p: Parameters) -> float:
    """Power that the platform takes by the reactions of motors and bearings that are bolted to it (W).

    The torques are those of the motors (N·m); the rates begin at place n of the unknowns.
    """
    net_1 = torque_1 - resistance(y[n + 3], p.friction[0])
    net_2 = torque_2 - resistance(y[n + 4], p.friction[1])
    return (p.deck[0] * net_1 + p.deck[1] * net_2) * y[n + 2]


@inlined
def powers(exciters: Three, means: FloatArray, n: int, system: int, out: FloatArray, p: Parameters) -> None:
    """Fill the powers named in :data:`POWERS` (W), then the vertical force from outside (N), as means over a time.

    Parameters
    ----------
    exciters
        Means of :func:`exciter_powers`.
    means
        Means of the unknowns, of their squares and of their sizes, shape (3, 2n or more).
    """
    squares, sizes, (stiffness, damping), layers = means[1], means[2], slopes(p), LAYERS[system]
    gap = damping[3] * squares[n + GAP] if layers > 0 and not ALGEBRAIC[system] else 0.0
    upper = p.upper_mass * damping[4] * squares[n + UPPER[system]] if layers == 2 else 0.0
    taken = damping[0] * squares[n], damping[1] * squares[n + 1], damping[2] * squares[n + 2], gap, upper
    out[0], out[1], out[FORCE - 1] = exciters
    for i in range(len(_DAMPED)):
        out[DISSIPATIONS + i] = taken[_DAMPED[i]]
    weight = p.gravity * (p.mass + p.lower_mass + p.upper_mass)
    out[FORCE] = -stiffness[1] * means[0, 1] - damping[1] * means[0, n + 1] - weight
    out[FORCE_SIZE] = stiffness[1] * sizes[1] + damping[1] * sizes[n + 1] + weight


@inlined
def truncation(y: FloatArray, n: int, beside: float, p: Parameters) -> float:
    """Power of the axes' turning to first order (W); 0 where it is round-off beside another power."""
    phi, w1, w2 = y[2], y[n + 3], y[n + 4]
    turning, largest = phi * y[n + 2] * y[n + 2], 0.0
    for i in range(2):
        largest += p.unbalance[i] * (abs(p.axis_x[i]) + abs(p.axis_y[i])) * abs(y[n + 3 + i])
    if abs(turning) * largest <= 1e-16 * beside:
        return 0.0  # a platform that does not rock pays for no sines
    s1, c1, s2, c2 = sincos_pair(y[3], y[4])
    return turning * (w1 * couplings(0, phi, s1, c1, p).phi_still + w2 * couplings(1, phi, s2, c2, p).phi_still)


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

    The last number is the sum of the sizes of both unbalances' momenta beside their axes; only forces from outside
    change the vertical momentum.
    """
    stiffness, elastic = slopes(p)[0], 0.0
    for i in range(3):
        elastic += stiffness[i] * state[i] ** 2
    elastic += stiffness[3] * state[GAP] ** 2 + p.upper_mass * stiffness[4] * state[6] ** 2
    lower, upward = state[1] + state[5], np.zeros(7)
    heights = p.mass * state[1] + p.lower_mass * lower + p.upper_mass * (lower + state[6])
    upward[1] = 1.0
    return (
        0.5 * inertia_product(state, state[7:], state[7:], p),
        0.5 * elastic,
        p.gravity * (heights - unbalance(0, state, p).x - unbalance(1, state, p).x),
        inertia_product(state, upward, state[7:], p),
        p.unbalance[0] * abs(state[10]) + p.unbalance[1] * abs(state[11]),
    )
