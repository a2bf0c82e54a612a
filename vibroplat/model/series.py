"""Taylor series of a motion: the rows of the equations, order by order.

The coefficients of order k of all accelerations and of F_c solve the dynamic rows of
:mod:`vibroplat.model.equations` with the mass matrix of the state, which is inverted once; what the rows hold besides
comes from lower orders. This is the index-reduced DAE itself with F_c as an unknown of every order. Recurrences of
linear forces are the forces themselves; those of motors and resistance stand beside their formulas in
:mod:`vibroplat.model.motor`.

With s, c = sin φᵢ, cos φᵢ the platform's rows hold k c″ and k s″, and k (X s″ − Y c″) for the rotation. Exciter i's
row holds k (c aʸ − s aˣ), with the acceleration a of its axis (X, Y) = (X₀ − φY₀, Y₀ + φX₀), turned to first order:

    aˣ = ẍ − Y₀ φ̈ − X₀ (φφ̈ + φ̇²) + Y₀ φφ̇²,    aʸ = ÿ + g + X₀ φ̈ − Y₀ (φφ̈ + φ̇²) − X₀ φφ̇².

Products of series are sums over two lists of coefficients (Cauchy). All of them are formed at once, as vectors of 16
numbers: :data:`ROOM` says which. Of a sum at order k the rows have the middle terms; those with the newest
coefficients are added by themselves, from numbers that have not been stored yet. What is computed for each exciter is
computed for both at once, in pairs (:mod:`vibroplat.kernels.pairs`).

Literature: Jorba and Zou, A software package for the numerical integration of ODEs by means of high-order Taylor
methods, 2005; Pryce, Solving high-index DAEs by Taylor series, 1998.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vibroplat.kernels.compiled import FloatArray, fused, inlined
from vibroplat.kernels.lanes import in_lines, products_2, products_16, put_row
from vibroplat.kernels.pairs import Pair, pack_pair, unpack_pair
from vibroplat.kernels.polynomial import MAX_DEGREE
from vibroplat.kernels.sines import sincos_pair
from vibroplat.model.accelerations import mobility, solve_rows
from vibroplat.model.motor import MotorTerms, kloss_term, motor_at, resistance_term, square_term
from vibroplat.model.parameters import Parameters
from vibroplat.model.platform import Five, Unbalance, compliance, couplings
from vibroplat.model.springs import relative, restoring
from vibroplat.model.systems import ALGEBRAIC, DIFFERENTIAL, LAYERS

#: Column of F_c among the coefficients; coordinates stand before it in the order of the system's unknowns.
FORCE = 7

_ROWS = MAX_DEGREE + 2

Four = tuple[float, float, float, float]

#: 1/k; of k = 0 nothing is asked.
_SHARE = np.concatenate([[0.0], 1.0 / np.arange(1.0, MAX_DEGREE + 2.0)])


#: Where a series is formed. Row k + 2 of ``early`` and row k of ``late`` hold what is known after order k. Columns 0–1:
#: c and φ̇ᵢ, their product is s′. 2–3: s and φ̇ᵢ, −c′. 4–5: s and aˣ. 6–7: c and aʸ. 8–9: slip speed u with itself, one
#: order later; 10–11: the same of φ̇ᵢ. 12: φ and Σ k (Y₀ s″ + X₀ c″). 13: φ and φ̈. 14: φ and φ̇². 15: φ̇ with itself, one
#: order later. Pairs are of exciters 1 and 2.
ROOM = np.dtype(
    [
        ("early", float, (_ROWS, 16)),
        ("late", float, (_ROWS, 16)),
        # coefficients in powers of time (SI units): coordinates in the order of the system's unknowns, F_c in column
        # FORCE, which has two orders less; 0 in the columns between
        ("q", float, (_ROWS, 8)),
        ("squares", float, (_ROWS, 2)),  # terms of both motors' Δ² + u², and of their torques
        ("torques", float, (_ROWS, 2)),
    ],
    align=True,
)


def room() -> Any:
    """Make room for a series: a record of :data:`ROOM` that begins with a line of the processor's cache."""
    return in_lines((ROOM.itemsize // 8,)).view(ROOM)[0]


class Constants(NamedTuple):
    """What of an exciter, or in pairs, is the same in all orders; σ, k_R k and M_c are those of the parameters."""

    x0: Pair  # its axis in the platform, not turned and turned (m)
    y0: Pair
    x: Pair
    y: Pair
    sine: Pair  # of its angle now
    cosine: Pair
    speed: Pair  # φ̇ᵢ now (rad/s)
    direction: Pair  # σ
    friction: Pair  # k_R k
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
    square: Pair  # Δ² + u² (rad²/s²)
    torque: Pair  # of the motors, in their own directions (N·m)


class Rotation(NamedTuple):
    """Terms of order k of what the platform's turning adds to the accelerations of the axes: φφ̈ + φ̇², φφ̇², and g."""

    centre: float
    lifted: float
    weight: float


@fused
def expand(system: int, t: float, y: FloatArray, degree: int, room: Any, p: Parameters) -> None:
    """Fill ``room.q`` with the coefficients of a motion at a state, coordinates to this degree and F_c to degree − 2.

    The degree is from 2 to MAX_DEGREE; of the unknowns the differential ones are read. Where an exciter is at rest, its
    resistance is that of the sense in which it is about to turn.
    """
    n = DIFFERENTIAL[system] // 2
    attached, layers = ALGEBRAIC[system], LAYERS[system]
    s1, c1, s2, c2 = sincos_pair(y[3], y[4])
    fixed_1, fixed_2 = constants_of(0, t, y, n, s1, c1, p), constants_of(1, t, y, n, s2, c2, p)
    inverse = compliance(fixed_1.couplings, fixed_2.couplings, mobility(attached, p), p)
    f = pack_pair(fixed_1, fixed_2)
    e, sense = at_order_0(f), pack_pair(sense_of(y[n + 3]), sense_of(y[n + 4]))
    at_rest = y[n + 3] == 0.0 or y[n + 4] == 0.0
    q, rate = relative(system, y, 0, n), relative(system, y, n, n)
    phi_1, unbalances, turning, square = 0.0, 0.0, 0.0, 0.0
    for i in range(FORCE):
        room.q[0, i], room.q[1, i] = (y[i], y[n + i]) if i < n else (0.0, 0.0)
    for k in range(degree - 1):
        sums = products_16(room.early, room.late, k, k)
        torques = products_2(room.squares, room.torques, k, k - 1)[0]
        weight, twice = (p.gravity, 1.0) if k == 0 else (0.0, 2.0)
        (moment, centre), (lifted, squares) = unpack_pair(sums[6]), unpack_pair(sums[7])
        moment, centre, lifted = moment + phi_1 * unbalances, centre + phi_1 * turning, lifted + phi_1 * square
        square = squares + twice * y[n + 2] * rate[2]
        rotation = Rotation(centre + square, lifted + y[2] * square, weight)
        known = from_lower_orders(k, twice, rotation, e, sense, f, sums, torques)
        held, (moment_1, moment_2) = restoring(q, rate, p), unpack_pair(known.moment)
        b = (
            -held[0] - total(f.unbalance * known.cosine),
            -(held[1] - held[3]) - total(f.unbalance * known.sine) - p.mass * weight,
            -held[2] - total(f.unbalance * (f.x * known.sine - f.y * known.cosine)) + moment,  # k (X s″ − Y c″)
            moment_1,
            moment_2,
        )
        lower = p.upper_mass * held[4] - p.lower_mass * weight - held[3]
        a, contact, above = solve_rows(attached, b, lower, -weight - held[4], inverse, p)
        share = _SHARE[k + 1]
        twofold = share * _SHARE[k + 2]
        opening, above = (contact if layers > 0 and not attached else 0.0), (above if layers == 2 else 0.0)
        q = (rate[0] * share, rate[1] * share, rate[2] * share, rate[3] * share, rate[4] * share)
        rate = (a[0] * share, a[1] * share, a[2] * share, opening * share, above * share)
        material = (above * twofold, 0.0) if attached else (opening * twofold, above * twofold)
        moved = (a[0] * twofold, a[1] * twofold, a[2] * twofold, a[3] * twofold, a[4] * twofold)
        put_row(room.q, k + 2, (*moved, *material, 0.0))
        room.q[k, FORCE] = contact if attached else 0.0
        if k == 0:
            phi_1 = y[n + 2]
        own = pack_pair(a[3], a[4])
        unbalances, turning = total(curvature(own, known, f)), a[2]
        e = advance(k, share, a, own, known, e, f)
        if at_rest:
            sense = about_to_turn(sense, e.speed)
        put_factors(room, k, e, a[2] * twofold, (unbalances, turning, square, rate[2]))
        put_row(room.squares, k, (known.square,))
        put_row(room.torques, k, (known.torque,))


@inlined
def put_factors(room: Any, k: int, e: Coefficients, phi: float, turned: Four) -> None:
    """Store what is known after order k for products to come; ``turned`` is columns 12 to 15 of ``late``."""
    c, s, u, w = e.cosine, e.sine, e.slip, e.speed
    put_row(room.early, k + 2, (c, s, s, c, u, w, phi, phi, phi, turned[3]))
    put_row(room.late, k, (w, w, e.ax, e.ay, u, w, *turned))


@inlined
def total(both: Pair) -> float:
    """Add up what both exciters contribute."""
    first, second = unpack_pair(both)
    return first + second


@inlined
def sense_of(speed: float) -> float:
    """Sense of a speed, ±1; 0 for none."""
    return 1.0 if speed > 0.0 else (-1.0 if speed < 0.0 else 0.0)


@inlined
def about_to_turn(sense: Pair, speed: Pair) -> Pair:
    """Senses in which exciters turn, where all lower coefficients of φ̇ᵢ are 0 by the sign of this one."""
    (first, second), (first_speed, second_speed) = unpack_pair(sense), unpack_pair(speed)
    return pack_pair(
        first if first != 0.0 else sense_of(first_speed), second if second != 0.0 else sense_of(second_speed)
    )


@inlined
def constants_of(i: int, t: float, y: FloatArray, n: int, sine: float, cosine: float, p: Parameters) -> Constants:
    """Gather what of an exciter is the same in all orders."""
    phi, speed, x0, y0 = y[2], y[n + 3 + i], p.axis_x[i], p.axis_y[i]
    axis = (x0, y0, x0 - phi * y0, y0 + phi * x0)
    own = (p.direction[i], p.friction[i], p.torque[i], p.unbalance[i])
    coupled, motor = couplings(i, phi, sine, cosine, p), motor_at(i, t, speed, p)
    return Constants(*axis, sine, cosine, speed, *own, coupled, motor)


@inlined
def at_order_0(f: Constants) -> Coefficients:
    """Begin both exciters' series."""
    w, none = f.speed, pack_pair(0.0, 0.0)
    return Coefficients(
        f.cosine * w, -1.0 * f.sine * w, none, none, w, f.motor.slip, none, none, none, none, none, none
    )


@inlined
def from_lower_orders(
    k: int,
    twice: float,
    rotation: Rotation,
    e: Coefficients,
    sense: Pair,
    f: Constants,
    sums: tuple[Pair, ...],
    torques: Pair,
) -> Terms:
    """Terms of order k of the exciters, without those of the accelerations of order k.

    ``twice`` is how often a product of a series with itself has its first and last term: 1 if they are the same.
    ``sums`` are those of products, ``torques`` that of Δ² + u² and the torque.
    """
    order = k + 1.0
    sine = order * (sums[0] + e.cosine_1 * e.speed + e.cosine * f.speed)
    cosine = -order * (sums[1] + e.sine_1 * e.speed + e.sine * f.speed)
    ax = f.y0 * rotation.lifted - f.x0 * rotation.centre
    ay = rotation.weight - f.x0 * rotation.lifted - f.y0 * rotation.centre
    pulled = sums[3] - sums[2] + e.cosine_1 * e.ay - e.sine_1 * e.ax
    square = square_term(k, sums[4] + twice * f.motor.slip * e.slip, f.motor)
    products = torques + square * e.torque_0 + e.square_1 * e.torque
    torque = kloss_term(e.slip, e.slip_before, products, f.motor, f.critical_torque)
    resistance = resistance_term(sums[5] + twice * f.speed * e.speed, sense, f.friction)
    # what is known last is added last: all waits for it
    moment = f.direction * torque - (resistance + f.couplings.x * ax + f.couplings.y * ay) - f.unbalance * pulled
    return Terms(sine, cosine, ax, ay, moment, square, torque)


@inlined
def curvature(a: Pair, known: Terms, f: Constants) -> Pair:
    """Terms of k (Y₀ s″ + X₀ c″) under accelerations φ̈ᵢ."""
    return f.unbalance * (f.y0 * (known.sine + f.cosine * a) + f.x0 * (known.cosine - f.sine * a))


@inlined
def advance(k: int, share: float, a: Five, own: Pair, known: Terms, e: Coefficients, f: Constants) -> Coefficients:
    """Newest coefficients of the exciters at the beginning of order k + 1, under accelerations of order k."""
    twofold = share * _SHARE[k + 2]
    speed = own * share
    slip = -1.0 * f.direction * speed
    sine_1, cosine_1, torque_0, square_1 = e.sine_1, e.cosine_1, e.torque_0, e.square_1
    if k == 0:
        sine_1, cosine_1, torque_0 = e.sine, e.cosine, known.torque
        slip = slip + f.motor.slip_ramp
    elif k == 1:
        square_1 = known.square
    unit = (known.sine + f.cosine * own) * twofold, (known.cosine - f.sine * own) * twofold
    ax, ay = known.ax + a[0] - f.y * a[2], known.ay + a[1] + f.x * a[2]
    return Coefficients(*unit, sine_1, cosine_1, speed, slip, e.slip, ax, ay, known.torque, torque_0, square_1)
