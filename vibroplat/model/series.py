"""Taylor series of a motion: the rows of the equations, order by order.

The coefficients of order k of all accelerations and of F_c solve the dynamic rows of
:mod:`vibroplat.model.equations` with the mass matrix of the state, which is inverted once; what the rows hold besides
comes from lower orders. This is the index-reduced DAE itself with F_c as an unknown of every order. Recurrences of
linear forces are the forces themselves; those of motors and resistance stand beside their formulas in
:mod:`vibroplat.model.motor`.

With s, c = sin φᵢ, cos φᵢ the platform's rows hold k c″ and k s″, and k (X s″ − Y c″) for the rotation. Exciter i's
row holds k (c aʸ − s aˣ), with the acceleration a of its axis (X, Y) = (X₀ − φY₀, Y₀ + φX₀), turned to first order:

    aˣ = ẍ − Y₀ φ̈ − X₀ (φφ̈ + φ̇²) + Y₀ φφ̇²,    aʸ = ÿ + g + X₀ φ̈ − Y₀ (φφ̈ + φ̇²) − X₀ φφ̇².

Products of series are sums over two lists of coefficients (Cauchy). Of a sum at order k :func:`middle_terms` has the
middle terms; those with the newest coefficients are added by themselves, from numbers that have not been stored yet.

One source serves one motion and several side by side (:mod:`vibroplat.kernels.vectors`). The mode is data, not a
branch, so that motions in contact and in flight may stand beside each other. What is computed for each exciter is
computed for both at once.

Literature: Jorba and Zou, A software package for the numerical integration of ODEs by means of high-order Taylor
methods, 2005; Pryce, Solving high-index DAEs by Taylor series, 1998.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vibroplat.kernels.compiled import fused, fused_inline, inlined
from vibroplat.kernels.polynomial import MAX_DEGREE
from vibroplat.kernels.sines import sincos_pair
from vibroplat.kernels.vectors import (
    Lanes,
    Pair,
    align_stack,
    at,
    four,
    join,
    lanes_record,
    part,
    select,
    some,
    total,
    zero,
)
from vibroplat.model.motor import MotorTerms, kloss_term, motor_at, resistance_term, square_term
from vibroplat.model.parameters import PARAMETERS, Parameters
from vibroplat.model.platform import Compliance, Five, Unbalance, compliance, couplings, mobility, solve_rows
from vibroplat.model.sliding import Law, Response, law, response, under_contact
from vibroplat.model.springs import restoring

#: Column of F_c among the coefficients; before it stand the seven coordinates of the full state.
FORCE = 7

_ROWS = MAX_DEGREE + 2

#: 1/k; of k = 0 nothing is asked.
_SHARE = np.concatenate([[0.0], 1.0 / np.arange(1.0, MAX_DEGREE + 2.0)])

#: A motion: coordinates and rates, then 0; the time (s); its mode by three factors, each 0 or 1: whether the layer is
#: attached, whether it flies, whether there are two layers; one over the lower layer's mass, 0 without it (1/kg).
MOTION = {"y": (8, 1), "v": (8, 1), "t": (1,), "attached": (1,), "flying": (1,), "two": (1,), "lower_share": (1,)}

#: Where a series is formed. ``q`` has the coefficients in powers of time (SI units), coordinates and F_c, which has two
#: orders less. Then the factors of products: of both exciters c, s, φ̇ᵢ, slip speeds u, aˣ, aʸ, Δ² + u² and torques; of
#: the platform φ, φ̇, Σ k (Y₀ s″ + X₀ c″), φ̈ and φ̇².
ROOM = (
    {"q": (_ROWS, 8, 1)}
    | dict.fromkeys(("c", "s", "w", "u", "ax", "ay", "square", "torque"), (_ROWS, 2))
    | dict.fromkeys(("phi", "turning", "unbalances", "centre", "lifted"), (_ROWS, 1))
)
#: Coefficients of four coordinates side by side.
QUADS = {"quads": ("q", (_ROWS, 2, 4))}

#: The same with transport: the mode has besides whether the material sticks and μ_k σ where it slips, g_x, h, and one
#: over m_w; column 8 is that of s, column 9 that of F_t, with two orders less, and two more make whole vectors.
MOVING = MOTION | {"y": (12, 1), "v": (12, 1)} | dict.fromkeys(("stuck", "sliding", "slope", "height", "share"), (1,))
MOVING_ROOM, MOVING_QUADS = ROOM | {"q": (_ROWS, 12, 1)}, {"quads": ("q", (_ROWS, 3, 4))}

#: Columns of s and F_t.
ALONG, FRICTION = 8, 9

#: The parameters of a series, the first of :data:`vibroplat.model.parameters.PARAMETERS`, and all of them as rows.
_NAMES = (PARAMETERS.names or ())[: (PARAMETERS.names or ()).index("restitution")]
PARAMETER_ROWS = {name: (*PARAMETERS[name].shape, 1) for name in _NAMES}
WORDS = sum(PARAMETERS[name].itemsize for name in _NAMES) // 8


def room(width: int = 1, *, moving: bool = False) -> Any:
    """Make room for the series of so many motions, with transport or without."""
    return lanes_record(width, MOVING_ROOM if moving else ROOM, MOVING_QUADS if moving else QUADS)


def parameter_rows(width: int = 1) -> Any:
    """Make room for the parameters of so many motions."""
    return lanes_record(width, PARAMETER_ROWS, {"words": (_NAMES[0], (WORDS, 1))})


class Constants(NamedTuple):
    """What of an exciter, or of both side by side, is the same in all orders; σ, k_R k and M_c are the parameters'."""

    x0: Pair  # its axis in the platform, not turned and turned (m)
    y0: Pair
    x: Pair
    y: Pair
    sine: Pair  # of its angle now
    cosine: Pair
    speed: Pair  # φ̇ᵢ now (rad/s)
    direction: Pair  # σ
    friction: Pair  # k_R k
    deck_direction: Pair  # σ and k_R k of a motor on the platform, otherwise 0. Products of their own: one that the
    deck_friction: Pair  # moment shared with the platform would be rounded where it is not
    critical_torque: Pair  # M_c
    unbalance: Pair  # k (kg·m)
    couplings: Unbalance  # how it pulls at the platform
    motor: MotorTerms


class Coefficients(NamedTuple):
    """The newest coefficients of both exciters' series at the beginning of order k."""

    sine: Pair  # of order k + 1
    cosine: Pair
    sine_1: Pair  # of order 1, 0 while k = 0
    cosine_1: Pair
    speed: Pair  # φ̇ᵢ, of order k
    slip: Pair  # u of order k and k − 1
    slip_before: Pair
    ax: Pair  # a of order k − 1
    ay: Pair
    torque: Pair  # of order k − 1
    torque_0: Pair  # of order 0, 0 while k = 0
    square_1: Pair  # Δ² + u² of order 1, 0 while k < 2


class Terms(NamedTuple):
    """What lower orders say of both exciters' terms of order k."""

    sine: Pair  # s″ and c″ without φ̈ᵢ
    cosine: Pair
    ax: Pair  # a without ẍ, ÿ, φ̈
    ay: Pair
    moment: Pair  # right-hand sides of their rows (N·m)
    reaction: Pair  # of their motors and bearings on the platform, as far as it takes it (N·m)
    square: Pair  # Δ² + u² (rad²/s²)
    torque: Pair  # of the motors, in their own directions (N·m)


class Sums(NamedTuple):
    """Middle terms of the products of order k, for both exciters and for the platform."""

    cosine_speed: Pair  # c and φ̇ᵢ, one order later: s′
    sine_speed: Pair  # s and φ̇ᵢ, one order later: −c′
    sine_ax: Pair
    cosine_ay: Pair
    slip_slip: Pair
    speed_speed: Pair
    square_torque: Pair
    moment: Lanes  # φ and Σ k (Y₀ s″ + X₀ c″)
    centre: Lanes  # φ and φ̈
    lifted: Lanes  # φ and φ̇²
    turning: Lanes  # φ̇ with itself


class Rotation(NamedTuple):
    """Terms of order k of what the platform's turning adds to the accelerations of the axes: φφ̈ + φ̇², φφ̇², and g."""

    centre: Lanes
    lifted: Lanes
    weight: Lanes


@fused
def expand(motion: Any, degree: int, room: Any, p: Parameters, moving: Any) -> None:
    """Fill ``room.q`` with the coefficients of motions at their states, coordinates to this degree, F_c to degree − 2.

    All records are those of lanes: a :data:`MOTION`, a :data:`ROOM` and :data:`PARAMETER_ROWS`. The degree is from 2 to
    MAX_DEGREE. Where an exciter is at rest, its resistance is that of the sense in which it is about to turn.

    With transport (``moving`` is not None) an order is first solved without contact, which the mode's law then adds.
    """
    y, v, quads = motion.y, motion.v, room.quads
    attached, flying, two, phi, turning_0 = motion.attached, motion.flying, motion.two, y[2], v[2]
    align_stack(phi)
    none = zero(phi)
    s1, c1, s2, c2 = sincos_pair(y[3], y[4])
    fixed_1, fixed_2 = constants_of(0, motion, s1, c1, p), constants_of(1, motion, s2, c2, p)
    inverse = compliance(fixed_1.couplings, fixed_2.couplings, mobility(attached, p), p)
    f = join(fixed_1, fixed_2)
    e, sense = at_order_0(f), sense_of(f.speed)
    at_rest = some(f.speed == 0.0)
    x0, x1, x2, x5, x6, v0, v1, v2, v5, v6 = y[0], y[1], y[2], y[5], y[6], v[0], v[1], v[2], v[5], v[6]
    x4, following = y[4], v[4]  # φ₂'s coefficients of order k and k + 1
    phi_1, unbalances, turning, square = none, none, none, none
    # rows are stored as they are loaded: a part of a row must else leave the processor before the whole comes back
    quads[0, 0], quads[1, 0] = four(x0, x1, x2, y[3]), four(v0, v1, v2, v[3])
    x8, v8, reply, contact_law = along_deck(motion, inverse, none, moving)
    for k in range(degree - 1):
        sums = middle_terms(k, room, f.speed, phi)
        twice = 1.0 if k == 0 else 2.0
        weight = p.gravity if k == 0 else none
        both = sums.turning + twice * turning_0 * v2
        rotation = Rotation(sums.centre + phi_1 * turning + both, sums.lifted + phi_1 * square + phi * both, weight)
        known, slope = tilted(k, from_lower_orders(k, twice, rotation, e, sense, f, sums), motion, f, none, moving)
        held = restoring((x0, x1, x2, x5, x6), (v0, v1, v2, v5, v6), p)
        b = loads_of(held, known, f, (sums.moment, phi_1 * unbalances), weight, slope, p, moving)
        lower = p.upper_mass * held[4] - p.lower_mass * weight - held[3]
        upper = -weight - held[4]
        free = solve_rows(attached, motion.lower_share, b, lower, upper, inverse, p)
        a, contact, opening, above, along, friction = touched(free, upper, slope, motion, reply, contact_law, moving)
        share = _SHARE[at(k + 1)]
        twofold = share * _SHARE[at(k + 2)]
        quads[at(k), 1] = four(x4, x5, x6, contact)
        put_along(quads, k, x8, v8 * share, friction, moving)
        quads[at(k + 2), 0] = four(a[0], a[1], a[2], a[3]) * twofold
        x0, x1, x2, x5, x6 = v0 * share, v1 * share, v2 * share, v5 * share, v6 * share
        x8, v8 = v8 * share, along * share
        v0, v1, v2, v5, v6 = a[0] * share, a[1] * share, a[2] * share, flying * opening * share, two * above * share
        x4, following = following, a[4] * twofold
        if k == 0:
            phi_1 = turning_0
        own = join(a[3], a[4])
        unbalances, turning, square = total(curvature(own, known, f)), a[2], both
        e = advance(k, share, twofold, (a[0], a[1], a[2]), own, known, e, f)
        if at_rest:
            sense = select(sense == 0.0, sense_of(e.speed), sense)
        put_factors(room, k, e, known, (a[2] * twofold, v2, unbalances, turning, square))
    share = _SHARE[at(degree)]
    quads[at(degree - 1), 1], quads[at(degree), 1] = (
        four(x4, x5, x6, none),
        four(following, v5 * share, v6 * share, none),
    )
    put_along(quads, degree - 1, x8, v8 * share, none, moving)


@fused_inline
def loads_of(
    held: Five, known: Terms, f: Constants, moments: Any, weight: Any, slope: Lanes, p: Parameters, moving: Any
) -> Five:
    """Return the right-hand sides of the rows of platform and exciters, from the forces that hold them.

    Two further moments on the platform are added one by one.
    """
    moment_1, moment_2 = part(known.moment)
    turned = f.unbalance * (f.x * known.sine - f.y * known.cosine) + known.reaction  # k (X s″ − Y c″)
    return (
        pulled(-held[0] - total(f.unbalance * known.cosine), slope, p, moving),
        -(held[1] - held[3]) - total(f.unbalance * known.sine) - p.mass * weight,
        -held[2] - total(turned) + moments[0] + moments[1],
        moment_1,
        moment_2,
    )


@fused_inline
def along_deck(motion: Any, inverse: Compliance, none: Lanes, moving: Any) -> tuple[Lanes, Lanes, Response, Law]:
    """Begin the series of s: its coefficients of order 0 and 1, and the response to contact with its law."""
    if moving is not None:
        reply = response(inverse, motion.height, motion.lower_share, motion.share)
        contact_law = law(1.0 - motion.flying, motion.stuck, motion.sliding, reply)
        return motion.y[ALONG], motion.v[ALONG], reply, contact_law
    nothing = (none, none, none, none, none)
    return none, none, Response(nothing, nothing, none, none, none), Law(none, none, none, none)


@fused_inline
def tilted(k: int, known: Terms, motion: Any, f: Constants, none: Lanes, moving: Any) -> tuple[Terms, Lanes]:
    """Let the axes feel gravity along an inclined deck, at order 0, as they feel that normal to it; it comes second."""
    if moving is not None:
        slope = motion.slope if k == 0 else none
        ax, moment = known.ax - slope, known.moment + f.couplings.x * slope
        return Terms(known.sine, known.cosine, ax, known.ay, moment, known.reaction, known.square, known.torque), slope
    return known, none


@fused_inline
def pulled(force: Lanes, slope: Lanes, p: Parameters, moving: Any) -> Lanes:
    """Add the pull of gravity along an inclined deck to the force on the platform along x."""
    if moving is not None:
        return force + p.mass * slope
    return force


@fused_inline
def touched(
    free: tuple[Five, Lanes, Lanes, Lanes],
    upper: Lanes,
    slope: Lanes,
    motion: Any,
    reply: Response,
    contact_law: Law,
    moving: Any,
) -> tuple[Five, Lanes, Lanes, Lanes, Lanes, Lanes]:
    """Find accelerations, F_c, those of gap, upper layer and s, and F_t, from what :func:`solve_rows` gives."""
    a, contact, opening, above = free
    if moving is not None:
        along = slope - (a[0] - motion.height * a[2])
        a, opening, along, contact, friction = under_contact(a, opening, along, reply, contact_law)
        above = upper - a[1] - motion.flying * opening
        return a, contact, opening, above, (1.0 - motion.stuck) * along, friction
    return a, motion.attached * contact, opening, above, slope, slope


@fused_inline
def put_along(quads: Any, k: int, along: Lanes, following: Lanes, friction: Lanes, moving: Any) -> None:
    """Store the coefficients of order k of s and F_t, and that of order k + 1 of s, as long as it is the last."""
    if moving is not None:
        none = zero(along)
        quads[at(k), 2], quads[at(k + 1), 2] = four(along, friction, none, none), four(following, none, none, none)


@fused_inline
def middle_terms(k: int, r: Any, pair: Pair, single: Lanes) -> Sums:
    """Sum up the middle terms of the products of order k; of a product with itself half of them are formed."""
    cw, sw, sx, cy, tt, uu, ww = zero(pair), zero(pair), zero(pair), zero(pair), zero(pair), zero(pair), zero(pair)
    moment, centre, lifted, turning = zero(single), zero(single), zero(single), zero(single)
    for j in range(2, k + 1):
        i, m, n = at(j), at(k - j), at(k - j + 1)
        c, s, w, phi = r.c[i], r.s[i], r.w[n], r.phi[i]
        cw, sw, sx, cy = cw + c * w, sw + s * w, sx + s * r.ax[m], cy + c * r.ay[m]
        moment, centre, lifted = moment + phi * r.unbalances[m], centre + phi * r.centre[m], lifted + phi * r.lifted[m]
    for j in range(2, k):
        tt += r.square[at(j)] * r.torque[at(k - j)]
    for j in range(1, (k + 1) // 2):
        i, m = at(j), at(k - j)
        uu, ww, turning = uu + r.u[i] * r.u[m], ww + r.w[i] * r.w[m], turning + r.turning[i] * r.turning[m]
    uu, ww, turning = uu + uu, ww + ww, turning + turning
    if k > 1 and k % 2 == 0:
        i = at(k // 2)
        uu, ww, turning = uu + r.u[i] * r.u[i], ww + r.w[i] * r.w[i], turning + r.turning[i] * r.turning[i]
    return Sums(cw, sw, sx, cy, uu, ww, tt, moment, centre, lifted, turning)


@fused_inline
def put_factors(
    room: Any, k: int, e: Coefficients, known: Terms, turned: tuple[Lanes, Lanes, Lanes, Lanes, Lanes]
) -> None:
    """Store what is known after order k for products to come; ``turned`` is of the platform's turning."""
    i, m, r = at(k), at(k + 1), at(k + 2)
    room.c[r], room.s[r], room.w[m], room.u[m], room.ax[i], room.ay[i] = e.cosine, e.sine, e.speed, e.slip, e.ax, e.ay
    room.square[i], room.torque[i] = known.square, known.torque
    room.phi[r], room.turning[m], room.unbalances[i], room.centre[i], room.lifted[i] = turned


@inlined
def sense_of(speed: Pair) -> Pair:
    """Sense of a speed, ±1; 0 for none."""
    return select(speed > 0.0, 1.0, select(speed < 0.0, -1.0, 0.0))


@fused_inline
def constants_of(i: int, motion: Any, sine: Lanes, cosine: Lanes, p: Parameters) -> Constants:
    """Gather what of an exciter is the same in all orders."""
    phi, speed, x0, y0 = motion.y[2], motion.v[at(3 + i)], p.axis_x[i], p.axis_y[i]
    axis = (x0, y0, x0 - phi * y0, y0 + phi * x0)
    deck = (p.deck[i] * p.direction[i], p.deck[i] * p.friction[i])
    own = (p.direction[i], p.friction[i], *deck, p.torque[i], p.unbalance[i])
    coupled, motor = couplings(i, phi, sine, cosine, p), motor_at(i, motion.t, speed, p)
    return Constants(*axis, sine, cosine, speed, *own, coupled, motor)


@inlined
def at_order_0(f: Constants) -> Coefficients:
    """Begin both exciters' series."""
    w, none = f.speed, zero(f.speed)
    return Coefficients(f.cosine * w, -(f.sine * w), none, none, w, f.motor.slip, none, none, none, none, none, none)


@fused_inline
def from_lower_orders(
    k: int, twice: float, rotation: Rotation, e: Coefficients, sense: Pair, f: Constants, sums: Sums
) -> Terms:
    """Terms of order k of the exciters, without those of the accelerations of order k.

    ``twice`` is how often a product of a series with itself has its first and last term: 1 if they are the same.
    """
    order = k + 1.0
    sine = order * (sums.cosine_speed + e.cosine_1 * e.speed + e.cosine * f.speed)
    cosine = -order * (sums.sine_speed + e.sine_1 * e.speed + e.sine * f.speed)
    ax = f.y0 * rotation.lifted - f.x0 * rotation.centre
    ay = rotation.weight - f.x0 * rotation.lifted - f.y0 * rotation.centre
    pulled = sums.cosine_ay - sums.sine_ax + e.cosine_1 * e.ay - e.sine_1 * e.ax
    square = square_term(k, sums.slip_slip + twice * f.motor.slip * e.slip, f.motor)
    products = sums.square_torque + square * e.torque_0 + e.square_1 * e.torque
    torque = kloss_term(e.slip, e.slip_before, products, f.motor, f.critical_torque)
    speed_speed = sums.speed_speed + twice * f.speed * e.speed
    resistance = resistance_term(speed_speed, sense, f.friction)
    # what is known last is added last: all waits for it
    moment = f.direction * torque - (resistance + f.couplings.x * ax + f.couplings.y * ay) - f.unbalance * pulled
    reaction = f.deck_direction * torque - resistance_term(speed_speed, sense, f.deck_friction)
    return Terms(sine, cosine, ax, ay, moment, reaction, square, torque)


@fused_inline
def curvature(a: Pair, known: Terms, f: Constants) -> Pair:
    """Terms of k (Y₀ s″ + X₀ c″) under accelerations φ̈ᵢ."""
    return f.unbalance * (f.y0 * (known.sine + f.cosine * a) + f.x0 * (known.cosine - f.sine * a))


@fused_inline
def advance(
    k: int,
    share: float,
    twofold: float,
    a: tuple[Lanes, Lanes, Lanes],
    own: Pair,
    known: Terms,
    e: Coefficients,
    f: Constants,
) -> Coefficients:
    """Newest coefficients of the exciters at the beginning of order k + 1, under accelerations of order k."""
    speed = own * share
    slip = -(f.direction * speed)
    sine_1, cosine_1, torque_0, square_1 = e.sine_1, e.cosine_1, e.torque_0, e.square_1
    if k == 0:
        sine_1, cosine_1, torque_0 = e.sine, e.cosine, known.torque
        slip = slip + f.motor.slip_ramp
    elif k == 1:
        square_1 = known.square
    unit = (known.sine + f.cosine * own) * twofold, (known.cosine - f.sine * own) * twofold
    ax, ay = known.ax + a[0] - f.y * a[2], known.ay + a[1] + f.x * a[2]
    return Coefficients(*unit, sine_1, cosine_1, speed, slip, e.slip, ax, ay, known.torque, torque_0, square_1)
