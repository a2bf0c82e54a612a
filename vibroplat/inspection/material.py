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
from vibroplat.inspection.linear import ComplexArray, FloatArray, amplitudes, receptances

#: Lags of the exciters at which the motion is followed, all once; steps of a turn; turns to settle and to measure.
FOLLOWED, STEPS, SETTLING, MEASURED = np.linspace(-math.pi, math.pi, 36, endpoint=False), 80, 60, 32
#: Parts of a step in which its free motion is summed up.
PARTS = 1024
#: Ratio of the upper layer's natural frequency to the speed above which it is taken as rigid.
RIGID = 10.0
#: Approach speed below which an impact is contact, over g/ω.
CONTACT = 0.1


def loaded_motion(scene: Scene, speed: float) -> dict[str, Any]:
    """Follow the motion along y at a speed (rad/s) and at all :data:`FOLLOWED` lags.

    Returns, of the shape of these, the dynamic mass ``carried`` of the material (kg); and in the mean of turns the
    ``stroke`` (m), the largest accelerations ``upward`` and ``downward`` between impacts (m/s²), and the largest
    ``force`` into the foundation less the weight (N).
    """
    mass, damping, stiffness = scene.oscillators[:, 1].tolist()
    steady = amplitudes(scene, speed, FOLLOWED)[:, 1]
    step, gravity = 2.0 * math.pi / speed / STEPS, scene.machine.gravity_m_per_s2
    lower, upper = scene.layer_masses
    load, square = (lower + upper) * gravity, scene.layer_spring[0]
    if square > (RIGID * speed) ** 2:
        lower, upper = lower + upper, 0.0
    motion = _free_motion(scene, upper / lower, step)
    together = mass * lower / (mass + lower)
    slow = max(CONTACT * gravity / speed, scene.contact.sticking_speed_m_per_s)
    # what the material adds to the steady motion, and first the sag under its weight; lower layer; upper one from there
    state = np.zeros((7, FOLLOWED.size))
    y, rate, height, height_rate, above, above_rate, one = state
    y[:], above[:], one[:] = -load / stiffness, -gravity / square if upper else 0.0, 1.0
    height[:], height_rate[:] = steady.real + y, (1j * speed * steady).real
    ends, sums = np.full((3, 2, FOLLOWED.size), -np.inf), np.zeros((4, FOLLOWED.size))
    fundamental: ComplexArray = np.zeros(FOLLOWED.size, complex)
    for number in range(1, (SETTLING + MEASURED) * STEPS + 1):
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
        if number > SETTLING * STEPS:
            fundamental += floor / turn
            pushed = np.where(approach > slow, 0.0, (rate - before) / step - speed**2 * now.real)
            force = stiffness * floor + damping * (floor_rate - impulse / mass)
            for pair, value in zip(ends, (floor, pushed, force), strict=True):
                np.maximum(pair, np.stack([value, -value]), out=pair)
            if number % STEPS == 0:  # means over turns, because slow oscillations still decay
                sums += [ends[0].sum(axis=0), *ends[1], ends[2, 1] - load]
                ends[:] = -np.inf
    fundamental /= 0.5 * MEASURED * STEPS
    means = zip(("stroke", "upward", "downward", "force"), sums / MEASURED, strict=True)
    return {"carried": _dynamic_mass(scene, speed, steady, fundamental), **dict(means)}


def _free_motion(scene: Scene, ratio: float, step: float) -> FloatArray:
    """Return the change in a step (s) of y, lower layer, upper layer from there, each with its rate, and 1.

    ``ratio`` is the mass of the upper layer over that of the lower one.
    """
    mass, damping, stiffness = scene.oscillators[:, 1].tolist()
    pull = np.array(scene.layer_spring) if ratio else np.zeros(2)
    rates = np.zeros((7, 7))
    rates[[0, 2, 4], [1, 3, 5]] = 1.0
    rates[1, :2] = -stiffness / mass, -damping / mass
    rates[3, 4:] = *(ratio * pull), -scene.machine.gravity_m_per_s2
    rates[5, 4:6] = -(1.0 + ratio) * pull
    part = rates * step / PARTS
    return np.linalg.matrix_power(np.eye(7) + part + part @ part / 2.0, PARTS)


def _dynamic_mass(scene: Scene, speed: float, steady: ComplexArray, loaded: ComplexArray) -> ComplexArray:
    """Return the mass that changes the steady amplitude into the loaded one; all of it where nothing moves."""
    still = np.abs(steady) * speed**2 < 1e-2 * scene.machine.gravity_m_per_s2
    dynamic = 1.0 / receptances(scene, np.array([speed]))[0, 1]
    ratio = steady / np.where(still, 1.0, loaded)
    return np.asarray(np.where(still, sum(scene.layer_masses), dynamic * (1.0 - ratio) / speed**2))
