"""Material on a machine whose exciters turn at a constant speed: how it changes the vibration along y.

Platform, lower and upper layer are followed along y by time stepping with projection (Moreau 1988): steps of free
motion, the platform's exact one, and an impulse with restitution R wherever the lower layer would sink into the
platform. The fundamental of the platform's motion gives the dynamic mass of the material: that of a body on the
platform which changes amplitude and phase alike. Its real part over m_w is the fraction of the material that moves
along, its imaginary part damps. With it the formulas of :mod:`vibroplat.inspection.linear` hold for the loaded machine
(a describing function). Range: exciters that turn evenly; means over turns where the material jumps irregularly.
"""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np

from vibroplat.config.scene import Scene
from vibroplat.inspection.linear import ComplexArray, FloatArray, receptances

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
        jumps = _followed(scene, speed, steady, settle=settle)
        carried = np.where(stays, carried, jumps[0])
        linear = tuple(np.where(stays, *pair) for pair in zip(linear, jumps[1], strict=True))
        change = np.where(stays, 0.0, jumps[2])
    means = zip(("stroke", "upward", "downward", "force"), linear, strict=True)
    return {"carried": carried, **dict(means), "change": change}


def _yielding(scene: Scene, speed: float, carried: ComplexArray) -> ComplexArray:
    """Return the ratio of the amplitudes along y with a dynamic mass (kg) to those without."""
    at = np.full(carried.size, speed)
    return np.asarray(receptances(scene, at, carried)[:, 1] / receptances(scene, at)[:, 1])


def _followed(
    scene: Scene, speed: float, steady: ComplexArray, *, settle: bool
) -> tuple[ComplexArray, FloatArray, FloatArray]:
    """Return dynamic mass, means over turns, and their last relative change, of material that jumps."""
    mass, _, stiffness = scene.oscillators[:, 1].tolist()
    step, gravity = 2.0 * math.pi / speed / STEPS, scene.gravity[1]
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
    step, gravity = 2.0 * math.pi / speed / STEPS, scene.gravity[1]
    together = mass * lower / (mass + lower)
    slow = max(CONTACT * gravity / speed, scene.contact.sticking_speed_m_per_s)
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
    dynamic = 1.0 / receptances(scene, np.array([speed]))[0, 1]
    ratio = steady / np.where(still, 1.0, loaded)
    return np.asarray(np.where(still, sum(scene.layer_masses), dynamic * (1.0 - ratio) / speed**2))
