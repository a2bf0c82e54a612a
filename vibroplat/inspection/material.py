"""Material on a machine whose exciters turn at a constant speed: how it changes the vibration along y.

Platform, lower and upper layer are followed along y by time stepping with projection (Moreau 1988): steps of free
motion, the platform's exact one, and an impulse with restitution R wherever the lower layer would sink into the
platform. The fundamental of the platform's motion gives the dynamic mass of the material: that of a body on the
platform which changes amplitude and phase alike. Its real part over m_w is the fraction of the material that moves
along, its imaginary part damps. With it the formulas of :mod:`vibroplat.inspection.linear` hold for the loaded machine
(a describing function). Range: exciters that turn evenly; means over turns where the material jumps irregularly;
springs that hardly couple y with φ, whose answer to the material's impacts is left out.

How fast material moves along the deck, by formulas of practice, and up to which friction its contact is unique.

The platform moves along a line, or an ellipse, whose longer axis is inclined by β to the deck, with the amplitude
a cos β along it. On a deck that declines by α the formulas give

    v = k_v a ω cos β (1 + tan β tan α) = k_v ω (a cos β + a sin β tan α),

with k_v from 0.75 to 0.95 (makers of linear screens, after whom δ = β), and from 0.49 to 0.56 (70 to 80 % of
v [m/min] = 3.81 N S of feeders with β = 30°, S the amplitude in m and N vibrations a minute: 0.70 a ω cos β). Range:
straight paths. Compared with a simulated feeder (30°, one layer, mass ratio 0.2, friction 0.4) the first one holds at
throw indices from 2.2 to 2.8 and the second one from 0.9 to 1.8. Neither knows friction, mass ratio, layers or impacts:
of 11 other machines 5 were in these ranges, the others up to :data:`ERROR` away.
Sources: TSX, *Vibrating screen calculation formula*; Daesung, *Vibratory conveyors*. Ellipse: Re(a exp(iωt)) of two
complex amplitudes.

Stick, slip and flight exclude each other, without Painlevé's paradox, as long as μ_s |D_nt| < D_nn at all angles
(:mod:`vibroplat.model.sliding`). To first order in k_i²/(J_e,i M), |D_nt| ≤ Σ k_i²/(J_e,i M²) (½ + |h| |P_i| M/J) and
D_nn ≥ 1/m_w1 + 1/M. Source: Painlevé 1895, *Sur les lois du frottement de glissement*.
"""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np

from vibroplat.config.coordinates import TURN
from vibroplat.config.digits import NEGLIGIBLE
from vibroplat.config.scene import Scene
from vibroplat.frames import pd
from vibroplat.inspection.linear import ComplexArray, FloatArray, amplitudes, receptances

#: Lags of the exciters at which the motion is followed, all once; steps of a turn.
FOLLOWED, STEPS = np.linspace(-math.pi, math.pi, 36, endpoint=False), 80
#: Turns to settle with the springs critically damped, turns of a block that is measured, and most blocks.
SETTLING, BLOCK, BLOCKS = 60, 32, 10
#: Relative difference of the ranges of two blocks up to which the motion has settled.
SETTLED = 0.01
#: Parts of a step in which its free motion is summed up.
PARTS = 1024
#: Ratio of the upper layer's natural frequency to the speed above which it is taken as rigid.
RIGID = 10.0
#: Approach speed below which an impact is contact, over g/ω.
CONTACT = 0.1
#: Throw indices, normal to the deck, between which a range of k_v holds, and that range.
BANDS = (((0.9, 1.8), (0.49, 0.56)), ((2.2, 2.8), (0.75, 0.95)))
#: Relative distance from these ranges at which conveying speeds of simulated machines were found.
ERROR = 0.4
#: Ratio of the axes of an ellipse up to which it counts as a line.
STRAIGHT = 0.25


def loaded_motion(scene: Scene, speed: float, steady: ComplexArray, *, settle: bool = False) -> dict[str, Any]:
    """Follow the motion along y at a speed (rad/s) at which the empty machine has complex amplitudes ``steady`` (m).

    Returns, of the shape of these, the dynamic mass ``carried`` of the material (kg); and in the mean of turns the
    ``stroke`` (m), the largest accelerations ``upward`` and ``downward`` between impacts (m/s²), and half the range of
    the ``force`` into the foundation (N). Material that stays on the platform moves as an oscillator on it. Where it
    jumps, ranges of turns are compared if the motion is to ``settle``; ``change`` is their last relative difference.
    """
    _, damping, stiffness = scene.oscillators[:, 1].tolist()
    lower, upper = scene.layer_masses
    square, rate = scene.layer_spring
    pull = complex(square, speed * rate)
    carried = np.full(steady.size, lower + (upper * pull / (pull - speed**2) if upper else 0.0))
    amplitude = np.abs(steady * _yielding(scene, speed, carried))
    stays = np.abs(carried) * amplitude * speed**2 < (lower + upper) * scene.gravity[1]
    acceleration, force = amplitude * speed**2, np.abs(stiffness + 1j * speed * damping) * amplitude
    linear = (2.0 * amplitude, acceleration, acceleration, force)
    change = np.zeros(steady.size)
    if not stays.all():
        jumps = _follow(scene, speed, steady, settle=settle)
        carried = np.where(stays, carried, jumps[0])
        linear = tuple(np.where(stays, *pair) for pair in zip(linear, jumps[1], strict=True))
        change = np.where(stays, 0.0, jumps[2])
    means = zip(("stroke", "upward", "downward", "force"), linear, strict=True)
    return {"carried": carried, **dict(means), "change": change}


def _yielding(scene: Scene, speed: float, carried: ComplexArray) -> ComplexArray:
    """Return the ratio of the amplitudes along y with a dynamic mass (kg) to those without."""
    at = np.full(carried.size, speed)
    return np.asarray(receptances(scene, at, carried)[:, 1, 1] / receptances(scene, at)[:, 1, 1])


def _follow(
    scene: Scene, speed: float, steady: ComplexArray, *, settle: bool
) -> tuple[ComplexArray, FloatArray, FloatArray]:
    """Return dynamic mass, means over turns, and their last relative change, of material that jumps."""
    mass, _, stiffness = scene.oscillators[:, 1].tolist()
    step, gravity = TURN / speed / STEPS, scene.gravity[1]
    lower, upper = scene.layer_masses
    load, square = (lower + upper) * gravity, scene.layer_spring[0]
    if square > (RIGID * speed) ** 2:
        lower, upper = lower + upper, 0.0
    # what the material adds to the steady motion, and first the sag under its weight; lower layer; upper one from there
    state = np.zeros((7, steady.size))
    state[0], state[4], state[6] = -load / stiffness, -gravity / square if upper else 0.0, 1.0
    state[2], state[3] = steady.real + state[0], (1j * speed * steady).real
    damped = _free_motion(scene, upper / lower, step, least_damping=2.0 * math.sqrt(stiffness * mass))
    _turns(scene, speed, steady, state, damped, (lower, SETTLING))
    motion = _free_motion(scene, upper / lower, step)
    _turns(scene, speed, steady, state, motion, (lower, BLOCK))
    fundamental, sums = _turns(scene, speed, steady, state, motion, (lower, BLOCK))
    change = np.full(steady.size, np.nan)
    for _ in range(BLOCKS if settle else 0):
        before = sums
        fundamental, sums = _turns(scene, speed, steady, state, motion, (lower, BLOCK))
        change = np.abs(sums / before - 1.0)[[0, 3]].max(axis=0)
        if change.max() <= SETTLED:
            break
    return _dynamic_mass(scene, speed, steady, fundamental), sums, change


def _turns(
    scene: Scene, speed: float, steady: ComplexArray, state: FloatArray, motion: FloatArray, of: tuple[float, int]
) -> tuple[ComplexArray, FloatArray]:
    """Move the state of the layers, the lower one of a mass (kg), by turns; return fundamental and means over turns."""
    lower, turns = of
    mass, damping, stiffness = scene.oscillators[:, 1].tolist()
    step, gravity = TURN / speed / STEPS, scene.gravity[1]
    together = mass * lower / (mass + lower)
    slow = max(CONTACT * gravity / speed, scene.contact.restitution_threshold_m_per_s)
    y, rate, height, height_rate, _, above_rate, _ = state
    ends, sums = np.full((3, 2, steady.size), -np.inf), np.zeros((4, steady.size))
    fundamental: ComplexArray = np.zeros(steady.size, complex)
    for number in range(1, turns * STEPS + 1):
        turn = cmath.exp(2j * math.pi * number / STEPS)
        now = steady * turn
        before = rate.copy()
        state[:] = motion @ state
        floor, floor_rate = now.real + y, (1j * speed * now).real + rate
        approach = np.where(height <= floor, floor_rate - height_rate, 0.0)
        bounce = np.where(approach > slow, 1.0 + scene.contact.restitution, 1.0)
        impulse = together * bounce * np.maximum(approach, 0.0)
        height_rate += impulse / lower
        above_rate -= impulse / lower
        rate -= impulse / mass
        np.maximum(height, floor, out=height)
        fundamental += floor / turn
        pushed = np.where(approach > slow, 0.0, (rate - before) / step - speed**2 * now.real)
        force = stiffness * floor + damping * (floor_rate - impulse / mass)
        for pair, value in zip(ends, (floor, pushed, force), strict=True):
            np.maximum(pair, np.stack([value, -value]), out=pair)
        if number % STEPS == 0:
            sums += [ends[0].sum(axis=0), *ends[1], 0.5 * ends[2].sum(axis=0)]
            ends[:] = -np.inf
    return fundamental / (0.5 * turns * STEPS), sums / turns


def _free_motion(scene: Scene, ratio: float, step: float, least_damping: float = 0.0) -> FloatArray:
    """Return the change in a step (s) of y, lower layer, upper layer from there, each with its rate, and 1.

    ``ratio`` is the mass of the upper layer over that of the lower one.
    """
    mass, damping, stiffness = scene.oscillators[:, 1].tolist()
    damping = max(damping, least_damping)
    pull = np.array(scene.layer_spring) if ratio else np.zeros(2)
    rates = np.zeros((7, 7))
    rates[[0, 2, 4], [1, 3, 5]] = 1.0
    rates[1, :2] = -stiffness / mass, -damping / mass
    rates[3, 4:] = *(ratio * pull), -scene.gravity[1]
    rates[5, 4:6] = -(1.0 + ratio) * pull
    part = rates * step / PARTS
    return np.linalg.matrix_power(np.eye(7) + part + part @ part / 2.0, PARTS)


def _dynamic_mass(scene: Scene, speed: float, steady: ComplexArray, loaded: ComplexArray) -> ComplexArray:
    """Return the mass that changes the steady amplitude into the loaded one; all of it where nothing moves."""
    still = np.abs(steady) * speed**2 < 1e-2 * scene.gravity[1]
    dynamic = 1.0 / receptances(scene, np.array([speed]))[0, 1, 1]
    ratio = steady / np.where(still, 1.0, loaded)
    return np.asarray(np.where(still, sum(scene.layer_masses), dynamic * (1.0 - ratio) / speed**2))


def range_of_speed(throw: float) -> tuple[float, float]:
    """Return the range of k_v at a throw index; NaN where no formula holds."""
    return next((factors for (low, high), factors in BANDS if low <= throw <= high), (math.nan, math.nan))


def path(along: complex, normal: complex) -> tuple[float, float]:
    """Return the angle of an ellipse's longer axis to the deck (rad, −π/2 … π/2) and the ratio of both axes.

    A force that is negligible along the deck counts as 0.
    """
    if abs(along) <= NEGLIGIBLE * abs(normal):
        return 0.5 * math.pi, 0.0
    squares, crossed = (abs(along) ** 2, abs(normal) ** 2), along * normal.conjugate()
    total = sum(squares)
    root = math.hypot(squares[0] - squares[1], 2.0 * crossed.real)
    angle = 0.5 * math.atan2(2.0 * crossed.real, squares[0] - squares[1])
    return angle, math.sqrt(max(total - root, 0.0) / (total + root))


def expected_conveying(scene: Scene, speed: float, along: complex, normal: complex, throw: float) -> dict[str, float]:
    """Find throw angle and conveying speeds from the speed of the exciters (rad/s), complex amplitudes and throw index.

    ``along`` is that of x − hφ, of the deck's surface, ``normal`` that of y (m).
    """
    assert scene.transport is not None
    angle, ratio = path(along, normal)
    moved = math.copysign(abs(along), angle) + abs(normal) * math.tan(scene.transport.angle)
    straight = ratio <= STRAIGHT
    low, high = sorted(factor * speed * moved if straight else math.nan for factor in range_of_speed(throw))
    return {
        "throw_angle_rad": angle,
        "path_ratio": ratio,
        "conveying_speed_low_m_per_s": low,
        "conveying_speed_high_m_per_s": high,
    }


def conveying_of(scene: Scene, speed: float, amplitudes: ComplexArray, stroke: float, throw: float) -> dict[str, float]:
    """Find the same from amplitudes of x, y, φ of the empty machine at a speed, and the stroke along y (m)."""
    assert scene.transport is not None
    x, y, phi = amplitudes
    along, normal = x - scene.transport.deck_height_m * phi, y / (abs(y) or 1.0) * 0.5 * stroke
    return expected_conveying(scene, speed, along, normal, throw)


def range_of_row(scene: Scene, row: pd.Series) -> tuple[float, float]:
    """Return the range of the conveying speed of a row of a sweep by the formulas; NaN where none holds.

    The exciters turn as in the row, and stroke and throw index are its own.
    """
    names = ["excitation_frequency_hz", "phase_difference_rad", "stroke_y_m", "gamma"]
    frequency, phase, stroke, throw = row[names].to_numpy(dtype=float, na_value=np.nan).tolist()
    if not math.isfinite(frequency + phase + stroke + throw):
        return math.nan, math.nan
    speed, lag = TURN * frequency, scene.exciter_pair[0].direction * phase
    values = conveying_of(scene, speed, amplitudes(scene, speed, np.array([lag]))[0], stroke, throw)
    return values["conveying_speed_low_m_per_s"], values["conveying_speed_high_m_per_s"]


def unique_friction(scene: Scene) -> float:
    """Return the coefficient of static friction up to which there is no paradox of Painlevé."""
    assert scene.transport is not None
    body, height = scene.body, abs(scene.transport.deck_height_m)
    levers = (0.5 + height * math.hypot(*axis) * body.mass / body.inertia for axis in body.axes)
    crossed = (
        moment**2 / inertia * lever
        for moment, inertia, lever in zip(scene.unbalances, scene.exciter_inertias, levers, strict=True)
    )
    return (body.mass**2 / scene.layer_masses[0] + body.mass) / (sum(crossed) or math.nan)
