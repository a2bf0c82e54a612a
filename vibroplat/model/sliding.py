"""Material that moves along the deck with Coulomb friction: the response to F_t, impacts and chatter with it.

The material's place s along the deck is one more coordinate, of all its layers together; F_t is the force of friction
on it, towards +x, at the height h of the deck. It comes last: accelerations and F_c are first found without it, from
the rows that all scenes have. With the mass matrix 𝓜 of (x, y, φ, φ₁, φ₂), which in contact carries the lower layer
along y, and t = (1, 0, −h, 0, 0), a unit of F_t takes 𝓜⁻¹t off the platform's accelerations and κ off F_c, and adds d
to that of s:

    κ = m_w1 (𝓜⁻¹t)_y in contact,    d = 1/m_w + t·𝓜⁻¹t.

What a mode holds gives F_t: in stick s̈ = 0, in slip of the sense σ F_t = −μ_k σ F_c, in flight F_t = 0. The same holds
for impulses. Slip is unique as long as μ_s |κ| < 1. With 𝓜 of the platform alone and n = (0, 1, 0, 0, 0), Delassus'
matrix of contact is D_nn = 1/m_w1 + n·𝓜⁻¹n, D_nt = n·𝓜⁻¹t, D_tt = 1/m_w + t·𝓜⁻¹t, and κ = D_nt/D_nn. An inclined
deck adds g_x: the platform and the exciters feel ẍ − g_x, as they feel ÿ + g along y.

Literature: Glocker, Set-Valued Force Laws, 2001; Pfeiffer and Glocker, Multibody Dynamics with Unilateral Contacts,
1996; Kane, Impact of rods: an apparent paradox, 1984.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, copy, fused_inline
from vibroplat.kernels.lanes import Lanes
from vibroplat.model.impact import chatter_map, impact, impulse_response
from vibroplat.model.parameters import Parameters
from vibroplat.model.platform import Compliance, Five, Solution, compliance, mobility, solve_platform, unbalances
from vibroplat.model.systems import ALONG, ALONG_RATE, GAP, GAP_RATE

#: Speed of the impacts that are left of a chatter, over that of the first.
NO_REBOUND = float(np.finfo(float).eps)


class Response(NamedTuple):
    """What a unit of F_t changes: accelerations of the platform and F_c, both taken off, and that of s."""

    platform: Five
    contact: Lanes
    along: Lanes


class Law(NamedTuple):
    """Friction as a linear law of s̈ and F_c without it: F_t = −(``by_slip`` s̈ + ``by_force`` F_c)."""

    by_slip: Lanes
    by_force: Lanes


@fused_inline
def response(inverse: Compliance, height: Lanes, carried: Lanes, material_share: Lanes) -> Response:
    """Find the response to F_t, from h (m), the layer's mass that the platform carries (kg) and 1/m_w (1/kg)."""
    platform = solve_platform((1.0, 0.0, -height, 0.0, 0.0), inverse)
    return Response(platform, carried * platform[1], material_share + platform[0] - height * platform[2])


@fused_inline
def law(stuck: Lanes, friction: Lanes, r: Response) -> Law:
    """Find the law of a mode: whether the material sticks (1, otherwise 0); μ_k σ in slip, otherwise 0."""
    return Law(stuck / r.along, friction / (1.0 - friction * r.contact))


@fused_inline
def add_friction(
    free: Solution, along: Lanes, height: Lanes, attached: Lanes, r: Response, friction_law: Law
) -> tuple[Solution, Lanes, Lanes]:
    """Add friction to what :func:`vibroplat.model.platform.solve_rows` finds: that, s̈ and F_t.

    ``along`` is the acceleration of the material over ground.
    """
    a, contact, opening, upper = free
    slip = along - (a[0] - height * a[2])
    force = -(friction_law.by_slip * slip + friction_law.by_force * contact)
    changed = (
        a[0] - r.platform[0] * force,
        a[1] - r.platform[1] * force,
        a[2] - r.platform[2] * force,
        a[3] - r.platform[3] * force,
        a[4] - r.platform[4] * force,
    )
    solution = (changed, contact - r.contact * force, opening, upper + attached * r.platform[1] * force)
    return solution, slip + r.along * force, force


# -- impact ----------------------------------------------------------------------------------------------------


class Blow(NamedTuple):
    """Impulses between material and platform, normal and of friction (N·s), and the energy that they take (J)."""

    normal: float
    along: float
    loss: float


class ImpactResponse(NamedTuple):
    """What unit impulses change: the normal one the seven rates, with the reduced mass (kg), and that of friction."""

    normal: FloatArray
    reduced: float
    friction: Response


@compiled
def impact_response(state: FloatArray, p: Parameters) -> ImpactResponse:
    """Find the response to impulses at a full state."""
    normal = np.empty(7)
    reduced = impulse_response(state, normal, p)
    first, second = unbalances(state, p)
    inverse = compliance(first, second, mobility(1.0, p), p)
    return ImpactResponse(normal, reduced, response(inverse, p.deck_height, p.lower_mass, p.material_share))


@compiled
def strike_sliding(state: FloatArray, restitution: float, r: ImpactResponse, p: Parameters) -> Blow:
    """Let the lower layer strike the platform: change the rates of a full state.

    The gap's rate reverses by Newton's law; the impulse of friction stops the material, or is that of Coulomb's law
    with μ_k if this does not suffice. Slip does not reverse its sense in an impact.
    """
    approach, slip, yielding = state[GAP_RATE], state[ALONG_RATE], r.friction.contact
    alone = -(1.0 + restitution) * approach * r.reduced
    loose = slip - alone * (r.normal[0] - p.deck_height * r.normal[2])
    along, after = -loose / r.friction.along, 0.0
    if abs(along) > p.kinetic_friction * (alone - yielding * along):
        friction = -math.copysign(p.kinetic_friction, along)
        along = -friction * alone / (1.0 - friction * yielding)
        after = loose + r.friction.along * along
    normal = alone - yielding * along
    for i in range(5):
        state[7 + i] += r.normal[i] * alone - r.friction.platform[i] * along
    state[GAP_RATE], state[ALONG_RATE] = -restitution * approach, after
    state[GAP_RATE + 1] += r.normal[6] * normal
    work = (1.0 - restitution) * normal * approach + along * (slip + after)
    return Blow(normal, along, -0.5 * work)


@compiled
def strike(state: FloatArray, after: FloatArray, restitution: float, p: Parameters) -> Blow:
    """Let the lower layer strike the platform, from a full state of 16 numbers to ``after``; the gap is then 0."""
    if p.material_mass == 0.0:
        impulse, loss = impact(state, after, restitution, p)
        return Blow(impulse, 0.0, loss)
    copy(state, after)
    after[GAP] = 0.0
    return strike_sliding(after, restitution, impact_response(state, p), p)


@compiled
def chatter(state: FloatArray, rates: FloatArray, after: FloatArray, p: Parameters) -> tuple[float, Blow]:
    """Carry a full state of 16 numbers through impacts that accumulate, under constant accelerations, to ``after``.

    With transport there is no sum for them: slip may end among them, after which impacts stick. They are followed one
    by one.

    Parameters
    ----------
    state
        Right after an impact: gap 0, gap rate above 0.
    rates
        Rates of the full state in flight there; that of the gap's rate is negative.

    Returns
    -------
    duration, blow
        How long they take (s), and their sums.
    """
    copy(state, after)
    if p.material_mass == 0.0:
        duration, impulse, loss = chatter_map(state, rates[7:], after, p)
        return duration, Blow(impulse, 0.0, loss)
    r, duration = impact_response(state, p), 0.0
    normal = friction = loss = 0.0
    last = NO_REBOUND * state[GAP_RATE]
    while after[GAP_RATE] > 0.0:
        t = 2.0 * after[GAP_RATE] / -rates[GAP_RATE]
        approach = -after[GAP_RATE]
        for i in range(8):
            place, rate = (i, 7 + i) if i < 7 else (ALONG, ALONG_RATE)
            after[place] += t * (after[rate] + 0.5 * t * rates[rate])
            after[rate] += t * rates[rate]
        after[GAP_RATE] = approach
        duration += t
        ends = -approach < p.sticking_speed or -approach <= last
        blow = strike_sliding(after, 0.0 if ends else p.restitution, r, p)
        normal, friction, loss = normal + blow.normal, friction + blow.along, loss + blow.loss
    after[GAP] = after[GAP_RATE] = 0.0
    return duration, Blow(normal, friction, loss)
