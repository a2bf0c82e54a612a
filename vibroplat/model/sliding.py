"""Material that moves along the deck with Coulomb friction: the response to its contact, its impact, its energies.

The material's place s along the deck is one more coordinate, of all its layers together; F_t is the force of friction
on it, towards +x, at the height h of the deck. With the mass matrix 𝓜 of (x, y, φ, φ₁, φ₂), n = (0, 1, 0, 0, 0) and
t = (1, 0, −h, 0, 0), what the layer would do without contact, ÿ_w1 = a_n and s̈ = a_t, changes with both forces:

    ÿ_w1 = a_n + D_nn F_c + D_nt F_t,    s̈ = a_t + D_nt F_c + D_tt F_t
    D_nn = 1/m_w1 + n·𝓜⁻¹n,    D_tt = 1/m_w + t·𝓜⁻¹t,    D_nt = n·𝓜⁻¹t.

In stick both accelerations are 0, in slip of the sense σ that of the gap is and F_t = −μ_k σ F_c. The same holds for
impulses. An inclined deck adds g_x: the platform and the exciters feel ẍ − g_x, as they feel ÿ + g along y.

Literature: Glocker, Set-Valued Force Laws, 2001; Pfeiffer and Glocker, Multibody Dynamics with Unilateral Contacts,
1996; Kane, Impact of rods: an apparent paradox, 1984.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, fused_inline, inlined
from vibroplat.model.parameters import Parameters
from vibroplat.model.platform import (
    Compliance,
    Five,
    Unbalance,
    compliance,
    mobility,
    solve_platform,
    solve_rows,
    unbalances,
)
from vibroplat.model.systems import ALGEBRAIC, DIFFERENTIAL, GAP, GAP_RATE, LAYERS, SENSE, UPPER

#: Speed of the impacts that are left of a chatter, over that of the first.
NO_REBOUND = float(np.finfo(float).eps)


class Response(NamedTuple):
    """What a unit of F_c, and of F_t, changes: accelerations of the platform, taken off, and D."""

    normal: Five
    along: Five
    nn: float
    nt: float
    tt: float


class Law(NamedTuple):
    """Contact as a linear law: F_c = −(cc a_n + ct a_t), F_t = −(tc a_n + tt a_t)."""

    cc: float
    ct: float
    tc: float
    tt: float


@fused_inline
def response(inverse: Compliance, height: float, lower_share: float, material_share: float) -> Response:
    """Find the response to contact, from h (m), 1/m_w1 and 1/m_w (1/kg)."""
    normal = solve_platform((0.0, 1.0, 0.0, 0.0, 0.0), inverse)
    along = solve_platform((1.0, 0.0, -height, 0.0, 0.0), inverse)
    crossed = normal[0] - height * normal[2]
    return Response(normal, along, lower_share + normal[1], crossed, material_share + along[0] - height * along[2])


@fused_inline
def law(held: float, stuck: float, friction: float, r: Response) -> Law:
    """Find the law of a mode: whether there is contact, and stick (1, otherwise 0); μ_k σ in slip, otherwise 0."""
    sticking = stuck / (r.nn * r.tt - r.nt * r.nt)
    slipping = (held - stuck) / (r.nn - friction * r.nt)
    crossed = sticking * r.nt
    return Law(sticking * r.tt + slipping, -crossed, -crossed - friction * slipping, sticking * r.nn)


@fused_inline
def under_contact(
    a: Five, opening: float, sliding: float, r: Response, contact: Law
) -> tuple[Five, float, float, float, float]:
    """Find accelerations of the platform, of gap and material, and both forces, from those without contact."""
    normal = -(contact.cc * opening + contact.ct * sliding)
    along = -(contact.tc * opening + contact.tt * sliding)
    moved = (
        a[0] - r.normal[0] * normal - r.along[0] * along,
        a[1] - r.normal[1] * normal - r.along[1] * along,
        a[2] - r.normal[2] * normal - r.along[2] * along,
        a[3] - r.normal[3] * normal - r.along[3] * along,
        a[4] - r.normal[4] * normal - r.along[4] * along,
    )
    return (
        moved,
        opening + r.nn * normal + r.nt * along,
        sliding + r.nt * normal + r.tt * along,
        normal,
        along,
    )


@inlined
def solve_sliding(
    system: int,
    b: Five,
    lower: float,
    upper: float,
    z: FloatArray,
    first: Unbalance,
    second: Unbalance,
    p: Parameters,
) -> None:
    """Solve the dynamic rows for accelerations, from place n of ``z`` on, and both forces.

    Right-hand sides are those of the rows of platform and exciters, lower and upper layer; that of the material along
    the deck is in place 2n − 1 of ``z``.
    """
    n, held = DIFFERENTIAL[system] // 2, 1.0 if ALGEBRAIC[system] else 0.0
    stuck = held if SENSE[system] == 0.0 else 0.0
    lower_share, material_share = 1.0 / p.lower_mass, p.material_share
    inverse = compliance(first, second, mobility(0.0, p), p)
    r = response(inverse, p.deck_height, lower_share, material_share)
    contact = law(held, stuck, p.kinetic_friction * SENSE[system], r)
    free, _, opening, _ = solve_rows(0.0, lower_share, b, lower, upper, inverse, p)
    sliding = z[2 * n - 1] * material_share - (free[0] - p.deck_height * free[2])
    a, opening, sliding, normal, along = under_contact(free, opening, sliding, r, contact)
    for i in range(5):
        z[n + i] = a[i]
    if LAYERS[system] == 2:
        z[n + UPPER[system]] = upper - (a[1] + (1.0 - held) * opening)
    z[2 * n - 1] = (1.0 - stuck) * sliding
    if ALGEBRAIC[system]:
        z[2 * n], z[2 * n + 1] = normal, along
    else:
        z[n + GAP] = opening


# -- impact ----------------------------------------------------------------------------------------------------


class Blow(NamedTuple):
    """Impulses between material and platform, normal and of friction (N·s), and the energy that they take (J)."""

    normal: float
    along: float
    loss: float


@inlined
def impact_response(state: FloatArray, p: Parameters) -> Response:
    """Find the response to impulses at a full state."""
    first, second = unbalances(state, p)
    inverse = compliance(first, second, mobility(0.0, p), p)
    return response(inverse, p.deck_height, 1.0 / p.lower_mass, p.material_share)


@compiled
def strike(rates: FloatArray, restitution: float, r: Response, p: Parameters) -> Blow:
    """Let the lower layer strike the platform: change the seven rates and, behind them, ṡ.

    The gap's rate reverses by Newton's law; the impulse of friction stops the material, or is that of Coulomb's law
    with μ_k if this does not suffice. Slip does not reverse its sense in an impact.
    """
    approach, slip = rates[GAP], rates[7]
    closing = (1.0 + restitution) * approach
    determinant = r.nn * r.tt - r.nt * r.nt
    normal, along = (r.nt * slip - r.tt * closing) / determinant, (r.nt * closing - r.nn * slip) / determinant
    after = 0.0
    if abs(along) > p.kinetic_friction * normal:
        friction = -math.copysign(p.kinetic_friction, along)
        normal = -closing / (r.nn - friction * r.nt)
        along = -friction * normal
        after = slip + r.nt * normal + r.tt * along
    for i in range(5):
        rates[i] -= r.normal[i] * normal + r.along[i] * along
    rates[GAP], rates[7] = -restitution * approach, after
    if p.upper_mass > 0.0:
        rates[6] -= normal / p.lower_mass
    work = (1.0 - restitution) * normal * approach + along * (slip + after)
    return Blow(normal, along, -0.5 * work)


@compiled
def sliding_impact(state: FloatArray, along: FloatArray, restitution: float, p: Parameters) -> Blow:
    """Let the lower layer strike the platform in a full state and (s, ṡ), which are changed; the gap is then 0."""
    rates = np.empty(8)
    for i in range(7):
        rates[i] = state[7 + i]
    rates[7] = along[1]
    blow = strike(rates, restitution, impact_response(state, p), p)
    for i in range(7):
        state[7 + i] = rates[i]
    state[GAP], along[1] = 0.0, rates[7]
    return blow


@compiled
def sliding_chatter(state: FloatArray, along: FloatArray, a: FloatArray, p: Parameters) -> tuple[float, Blow]:
    """Carry a full state and (s, ṡ) through impacts that accumulate, one by one, under constant accelerations.

    There is no sum for them: slip may end among them, after which impacts stick.

    Parameters
    ----------
    state, along
        Right after an impact: gap 0, gap rate above 0. Changed to those at the end of the last impact.
    a
        The seven accelerations in flight at that state, then s̈, shape (8,); the gap's is negative.

    Returns
    -------
    duration, blow
        How long they take (s), and their sums.
    """
    r, rates, duration = impact_response(state, p), np.empty(8), 0.0
    normal = friction = loss = 0.0
    for i in range(7):
        rates[i] = state[7 + i]
    rates[7] = along[1]
    last = NO_REBOUND * rates[GAP]
    while rates[GAP] > 0.0:
        t = 2.0 * rates[GAP] / -a[GAP]
        approach = -rates[GAP]
        for i in range(7):
            state[i] += t * (rates[i] + 0.5 * t * a[i])
        along[0] += t * (rates[7] + 0.5 * t * a[7])
        for i in range(8):
            rates[i] += t * a[i]
        rates[GAP] = approach
        duration += t
        ends = -approach < p.sticking_speed or -approach <= last
        blow = strike(rates, 0.0 if ends else p.restitution, r, p)
        normal, friction, loss = normal + blow.normal, friction + blow.along, loss + blow.loss
    for i in range(7):
        state[7 + i] = rates[i]
    state[GAP] = state[GAP_RATE] = 0.0
    along[1] = rates[7]
    return duration, Blow(normal, friction, loss)


# -- balances --------------------------------------------------------------------------------------------------


@compiled
def sliding_energies(state: FloatArray, along: FloatArray, p: Parameters) -> tuple[float, float, float]:
    """Return what the material's motion along the deck and its slope add to kinetic energy and that in gravity (J).

    The third value is the momentum of machine and material along x (N·s).
    """
    first, second = unbalances(state, p)
    rate = state[7] - p.deck_height * state[9] + along[1]
    moments = p.mass * state[0] + p.material_mass * (state[0] - p.deck_height * state[2] + along[0])
    momentum = p.mass * state[7] + first.x * state[10] + second.x * state[11] + p.material_mass * rate
    return 0.5 * p.material_mass * rate * rate, -p.slope * (moments + first.y + second.y), momentum
