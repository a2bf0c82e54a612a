"""The impact of the lower layer on the platform, and chatter: impacts that accumulate in finite time.

Both act on the full state (14 numbers) and are pure compiled functions. Three laws share them:

* ``conservative`` — impulse P on the lower layer, −P on platform and exciters, the upper layer keeps
  its velocity; momentum is kept and R = 1 keeps the energy.
* ``central`` — the same with the platform's rotation left out (its rate does not change), which is
  the paper's (7) for ẋ, ẏ, φ̇₁, φ̇₂.
* ``printed`` — ``central`` with the printed ẏ_w2⁺ = ẏ_w2⁻ + (1+R)ẏ_w1⁻, which does not keep the upper
  layer's momentum.

Real restitution falls with speed. Here it does so in one step: impacts slower than the sticking speed are inelastic.
For these the callers of :func:`impact` pass a restitution of 0; :func:`chatter_map` ends with the first of them.
"""

from __future__ import annotations

import math

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled
from vibroplat.model.energy import inertia_product
from vibroplat.model.parameters import CONSERVATIVE, PRINTED, Parameters
from vibroplat.model.platform import compliance, solve_platform, unbalance
from vibroplat.model.systems import GAP, GAP_RATE


@compiled
def impulse_response(state: FloatArray, response: FloatArray, p: Parameters) -> float:
    """Fill the change of the seven rates by a unit impulse between lower layer and platform, at a full state.

    It is (−e, 1/m_red, …) with e = 𝓜⁻¹ ê_y. What a singular 𝓜 leaves is not finite, and the restart after the impact
    fails. Returns the reduced mass m_red = k_eff m_w1 / (k_eff + m_w1), k_eff = 1/e_y (kg).
    """
    mobility = (1.0 / p.mass, 1.0 / p.mass, 1.0 / p.inertia if p.impact_law == CONSERVATIVE else 0.0 / p.inertia)
    inverse = compliance(unbalance(0, state, p), unbalance(1, state, p), mobility, p)
    jumps = solve_platform((0.0, -1.0, 0.0, 0.0, 0.0), inverse)
    for i in range(5):
        response[i] = jumps[i]
    response[5] = 1.0 / p.lower_mass - response[1]
    response[6] = -response[5] if p.impact_law == PRINTED else -1.0 / p.lower_mass
    if p.upper_mass == 0.0:  # one layer: what does not exist stays 0 in the full state
        response[6] = 0.0
    return 1.0 / response[5]


@compiled
def kinetic_change(before: FloatArray, after: FloatArray, p: Parameters) -> float:
    """Change of the kinetic energy between two states of equal coordinates (J).

    Formed as ½ (v⁺ − v⁻)·𝓜 (v⁺ + v⁻), so that a small change is not the difference of two large energies.
    """
    difference, total = np.empty(7, after.dtype), np.empty(7, after.dtype)
    for i in range(7):
        difference[i], total[i] = after[7 + i] - before[7 + i], after[7 + i] + before[7 + i]
    return 0.5 * inertia_product(before, difference, total, p)


@compiled
def impact(state: FloatArray, after: FloatArray, restitution: float, p: Parameters) -> tuple[float, float]:
    """Let the lower layer strike the platform: ẏ_w1⁺ = −R ẏ_w1⁻, from a full state to ``after``, with a gap of 0.

    The restitution R is an argument, as slow impacts have none whatever the parameters say.

    Returns
    -------
    impulse, loss
        P ≥ 0 on the lower layer (N·s) and the kinetic energy lost (J); with law ``conservative`` the
        loss is ½ m_red (1 − R²) (ẏ_w1⁻)².
    """
    response = np.empty(7, after.dtype)
    reduced = impulse_response(state, response, p)
    approach = state[GAP_RATE]
    impulse = -(1.0 + restitution) * approach * reduced
    for i in range(7):
        after[i], after[7 + i] = state[i], state[7 + i] + impulse * response[i]
    after[GAP_RATE] = -restitution * approach
    after[GAP] = 0.0
    return impulse, -kinetic_change(state, after, p)


@compiled
def remaining_impacts(rebound: float, p: Parameters) -> float:
    """Count the impacts to come after a rebound v under a constant acceleration, R < 1.

    They approach at v, Rv, R²v, …; the first below the sticking speed is the last. Without a sticking speed the
    number is infinite.
    """
    slowest, speed = p.sticking_speed.real, rebound.real  # a number of impacts has no derivative
    if slowest == 0.0:
        return np.inf
    if speed < slowest:
        return 1.0
    return 2.0 + np.floor(math.log(slowest / speed) / math.log(p.restitution.real))


@compiled
def chatter_duration(rebound: float, gap_acceleration: float, restitution: float, tail: float) -> float:
    """Duration 2v(1−Rⁿ)/((1−R)|a|) of the n impacts to come after a rebound v under a constant a < 0 (s).

    The flights last 2 v Rᵏ/|a|; the sum over k < n is geometric. ``tail`` is Rⁿ, which is 0 for infinitely many
    impacts; with R = 1 they take for ever.
    """
    return 2.0 * rebound * (1.0 - tail) / ((1.0 - restitution) * -gap_acceleration)


@compiled
def chatter_map(
    state: FloatArray, accelerations: FloatArray, after: FloatArray, p: Parameters
) -> tuple[float, float, float]:
    """Sum up impacts that accumulate: carry the state to t∞, where they end, under constant accelerations.

    With the flight's accelerations constant, the impulses left sum to P = m_red (|a|τ − v) and their moment about
    t∞ to Σ Pₖ (t∞ − tₖ) = m_red τ (|a|τ/2 − v); both follow from gap = gap rate = 0 at t∞. The code has τ inserted,
    with Rⁿ for the n impacts left, 0 without a sticking speed. A single impact (n = 1) needs no case of its own.
    With the response r of the rates to a unit impulse, the impacts change the kinetic energy by
    P r·𝓜v + ½P² r·𝓜r + Σ Pₖ (tₖ − t) r·𝓜a; law ``conservative`` makes this −½ m_red v².

    Parameters
    ----------
    state
        Full state right after an impact: gap 0, gap rate v > 0.
    accelerations
        The seven accelerations in flight at that state, shape (7,); the gap's is negative.
    after
        Filled with the full state at t∞, gap and gap rate exactly 0.

    Returns
    -------
    duration, impulse, loss
        τ = t∞ − t (s), the sum of the impulses (N·s), and the energy that they take (J).
    """
    restitution = p.restitution
    response = np.empty(7, after.dtype)
    reduced = impulse_response(state, response, p)
    rebound = state[GAP_RATE]
    remaining = remaining_impacts(rebound, p)
    tail = restitution**remaining if remaining < np.inf else 0.0 * restitution
    duration = chatter_duration(rebound, accelerations[GAP], restitution, tail)
    impulse = reduced * rebound * (1.0 + restitution - 2.0 * tail) / (1.0 - restitution)
    moment = reduced * rebound * duration * (restitution - tail) / (1.0 - restitution)
    for i in range(7):
        mean_rate = state[7 + i] + 0.5 * duration * accelerations[i]
        after[i] = state[i] + duration * mean_rate + moment * response[i]
        after[7 + i] = state[7 + i] + duration * accelerations[i] + impulse * response[i]
    after[GAP] = 0.0
    after[GAP_RATE] = 0.0
    work = (
        impulse * inertia_product(state, response, state[7:], p)
        + 0.5 * impulse * impulse * inertia_product(state, response, response, p)
        + (impulse * duration - moment) * inertia_product(state, response, accelerations, p)
    )
    return duration, impulse, -work
