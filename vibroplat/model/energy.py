"""Energies and powers, momentum and the forces that change it, for the audit of a run.

The paper's equations turn the exciter axes to first order in φ only. That truncation does not derive
from a Lagrangian: it leaves the power k Σ φ̇ᵢ φ̇² φ (Y₀ sin φᵢ + X₀ᵢ cos φᵢ), third order in φ, without
a physical source. The audit carries it as a term of its own instead of hiding it in the residual.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, fused_inline, inlined
from vibroplat.kernels.lanes import Lanes, size, some, zero
from vibroplat.kernels.on_demand import written
from vibroplat.kernels.sines import sine_cosine
from vibroplat.model import balances
from vibroplat.model.motor import both, resistances
from vibroplat.model.parameters import Parameters
from vibroplat.model.platform import Three, inertial, unbalance, unbalances
from vibroplat.model.springs import CURVED_FORCE, DAMPERS, slopes
from vibroplat.model.systems import ALGEBRAIC, ALONG, ALONG_RATE, GAP, LAYERS, UPPER

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


class ExciterPowers(NamedTuple):
    """Powers of both exciters side by side, at one time or several (W)."""

    motor: Lanes
    held: Lanes  # what the platform takes of it by the reactions of motors and bearings that are bolted to it
    truncation: Lanes
    resistance: Lanes


@fused_inline
def exciter_powers(
    torque: Lanes, speed: Lanes, angle: Lanes, phi: Lanes, turning: Lanes, p: Parameters
) -> ExciterPowers:
    """Find the powers of both exciters from their motors' torques, speeds and angles, and the platform's φ and φ̇."""
    braking = resistances(speed, p)
    motor = torque * speed
    held = both(p.deck) * (torque - braking) * turning
    return ExciterPowers(motor, held, truncation(speed, angle, phi * turning * turning, motor, p), braking * speed)


@inlined
def powers(exciters: Three, means: FloatArray, n: int, system: int, out: FloatArray, p: Parameters) -> None:
    """Fill the powers named in :data:`POWERS` (W), then the vertical force from outside (N), as means over a time.

    Parameters
    ----------
    exciters
        Means of the powers of motors less what the platform takes of them, of truncation and resistance.
    means
        Means of the unknowns, of their squares, of their sizes, of products, and
        :func:`vibroplat.model.springs.curved_means`, shape (5, 2n or more).
    """
    squares, sizes, (stiffness, damping), layers = means[1], means[2], slopes(p), LAYERS[system]
    gap = damping[3] * squares[n + GAP] if layers > 0 and not ALGEBRAIC[system] else 0.0
    upper = p.upper_mass * damping[4] * squares[n + UPPER[system]] if layers == 2 else 0.0
    taken = damping[0] * squares[n], damping[1] * squares[n + 1], damping[2] * squares[n + 2], gap, upper
    shares = 1.0, 1.0, 1.0, 1.0, p.upper_mass
    out[0], out[1], out[FORCE - 1] = exciters
    for i in range(len(_DAMPED)):
        place = _DAMPED[i]
        out[DISSIPATIONS + i] = taken[place] + shares[place] * means[4, place]
    weight = p.gravity * (p.mass + p.lower_mass + p.upper_mass)
    resisting = stiffness[1] * means[0, 1] + damping[1] * means[0, n + 1] + means[4, CURVED_FORCE + 1]
    out[FORCE] = -resisting - weight
    out[FORCE_SIZE] = stiffness[1] * sizes[1] + damping[1] * sizes[n + 1] + weight


@fused_inline
def truncation(speed: Lanes, angle: Lanes, turning: Lanes, beside: Lanes, p: Parameters) -> Lanes:
    """Power of the axes' turning to first order (W), from φ φ̇²; 0 where it is round-off beside another power."""
    x0, y0 = both(p.axis_x), both(p.axis_y)
    pulled = turning * both(p.unbalance) * speed
    if not some(size(pulled) * (size(x0) + size(y0)) > 1e-16 * size(beside)):
        return zero(speed)  # a platform that does not rock pays for no sines
    sine, cosine = sine_cosine(angle)
    return pulled * (x0 * cosine + y0 * sine)


@compiled
def inertia_product(state: FloatArray, u: FloatArray, v: FloatArray, p: Parameters) -> float:
    """Product u·𝓜 v of two sets of the seven rates with the mass matrix of the whole scene (J)."""
    momenta = inertial(v, 0, unbalance(0, state, p), unbalance(1, state, p), p)
    lower_u, lower_v = u[1] + u[5], v[1] + v[5]
    product = p.lower_mass * lower_u * lower_v + p.upper_mass * (lower_u + u[6]) * (lower_v + v[6])
    for i in range(5):
        product += u[i] * momenta[i]
    return product


@inlined
@written(balances.elastic)
def elastic(state: FloatArray, p: Parameters) -> float:  # type: ignore[empty-body]
    """Evaluate the energy in the springs at a full state (J)."""


@compiled
def energies(state: FloatArray, p: Parameters) -> tuple[float, float, float, float, float, float]:
    """Return kinetic and elastic energy, that in gravity (J), vertical momentum and the unbalances' momenta (N·s).

    The fifth number is the sum of the sizes of both unbalances' momenta beside their axes; only forces from outside
    change the vertical momentum. With transport, where the full state has 16 numbers, the last one is the momentum
    along the deck of machine and material, otherwise 0.
    """
    lower, upward = state[1] + state[5], np.zeros(7)
    first, second = unbalances(state, p)
    heights = p.mass * state[1] + p.lower_mass * lower + p.upper_mass * (lower + state[6])
    upward[1] = 1.0
    kinetic, gravity = 0.5 * inertia_product(state, state[7:], state[7:], p), p.gravity * (heights - first.x - second.x)
    along = 0.0
    if p.material_mass > 0.0:
        rate = state[7] - p.deck_height * state[9] + state[ALONG_RATE]
        places = p.mass * state[0] + p.material_mass * (state[0] - p.deck_height * state[2] + state[ALONG])
        kinetic += 0.5 * p.material_mass * rate * rate
        gravity -= p.slope * (places + first.y + second.y)
        along = p.mass * state[7] + first.x * state[10] + second.x * state[11] + p.material_mass * rate
    return (
        kinetic,
        elastic(state, p),
        gravity,
        inertia_product(state, upward, state[7:], p),
        p.unbalance[0] * abs(state[10]) + p.unbalance[1] * abs(state[11]),
        along,
    )
