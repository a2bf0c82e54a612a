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
from typing import NamedTuple

import numpy as np

from vibroplat.config.scene import Scene
from vibroplat.inspection.linear import ComplexArray, FloatArray, amplitudes, oscillators, receptances

#: Lags of the exciters at which the motion is followed, all once; steps of a turn; turns to settle and to measure.
FOLLOWED, STEPS, SETTLING, MEASURED = np.linspace(-math.pi, math.pi, 36, endpoint=False), 80, 60, 32
#: Ratio of the upper layer's natural frequency to the speed above which it is taken as rigid.
RIGID = 10.0
#: Approach speed below which an impact is contact, over g/ω.
CONTACT = 0.1


class LoadedMotion(NamedTuple):
    """The motion along y at each of some lags, shape (n,).

    Attributes
    ----------
    carried
        Dynamic mass of the material (kg).
    stroke
        Peak to peak (m), in the mean of turns.
    upward, downward
        Largest accelerations between impacts (m/s²), in the mean of turns.
    force
        Largest force into the foundation less the weight (N), in the mean of turns.
    """

    carried: ComplexArray
    stroke: FloatArray
    upward: FloatArray
    downward: FloatArray
    force: FloatArray


class _Layers:
    """Both layers at once for all lags; lengths in m."""

    def __init__(self, scene: Scene, speed: float, size: int) -> None:
        self.lower, upper = scene.layer_masses
        self.square, self.damping = scene.layer_spring
        if self.square > (RIGID * speed) ** 2:
            self.lower, upper = self.lower + upper, 0.0
        self.ratio = upper / self.lower
        self.gravity = scene.machine.gravity_m_per_s2
        sag = self.gravity / self.square if upper else 0.0
        self.height, self.rate = np.zeros(size), np.zeros(size)
        self.upper, self.upper_rate = np.full(size, -sag), np.zeros(size)

    def fall(self, step: float) -> None:
        """Move freely."""
        if self.ratio:
            pull = self.square * self.upper + self.damping * self.upper_rate
            self.rate += step * self.ratio * pull
            self.upper_rate -= step * (1.0 + self.ratio) * pull
            self.upper += step * self.upper_rate
        self.rate -= step * self.gravity
        self.height += step * self.rate


def loaded_motion(scene: Scene, speed: float) -> LoadedMotion:
    """Follow the motion along y at a speed (rad/s) and at all :data:`FOLLOWED` lags."""
    mass, damping, stiffness = oscillators(scene)[1].tolist()
    steady = amplitudes(scene, speed, FOLLOWED)[:, 1]
    step, gravity = 2.0 * math.pi / speed / STEPS, scene.machine.gravity_m_per_s2
    load = sum(scene.layer_masses) * gravity
    layers = _Layers(scene, speed, FOLLOWED.size)
    together = mass * layers.lower / (mass + layers.lower)
    slow = max(CONTACT * gravity / speed, scene.contact.sticking_speed_m_per_s)
    decay = 0.5 * damping / mass
    own = cmath.sqrt(stiffness / mass - decay**2 + 1e-12 * speed**2)
    one, other = (cmath.exp((sign * 1j * own - decay) * step) for sign in (1.0, -1.0))
    cosine, sine = (0.5 * (one + other)).real, ((one - other) / (2j * own)).real  # times exp(−decay·step)
    # what the material adds to the steady motion, and first the sag under its weight
    y, rate = np.full(FOLLOWED.size, -load / stiffness), np.zeros(FOLLOWED.size)
    layers.height, layers.rate = steady.real + y, (1j * speed * steady).real
    ends, sums = np.full((3, 2, FOLLOWED.size), -np.inf), np.zeros((4, FOLLOWED.size))
    fundamental: ComplexArray = np.zeros(FOLLOWED.size, complex)
    for number in range(1, (SETTLING + MEASURED) * STEPS + 1):
        turn = cmath.exp(2j * math.pi * number / STEPS)
        now = steady * turn
        before = rate
        y, rate = (
            y * (cosine + decay * sine) + rate * sine,
            rate * (cosine - decay * sine) - y * sine * stiffness / mass,
        )
        layers.fall(step)
        floor, floor_rate = now.real + y, (1j * speed * now).real + rate
        met = layers.height <= floor
        approach = np.where(met, floor_rate - layers.rate, 0.0)
        bounce = np.where(approach > slow, 1.0 + scene.contact.restitution, 1.0)
        impulse = together * bounce * np.maximum(approach, 0.0)
        layers.rate += impulse / layers.lower
        layers.upper_rate -= impulse / layers.lower
        rate = rate - impulse / mass
        layers.height = np.maximum(layers.height, floor)
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
    carried = _dynamic_mass(scene, speed, steady, fundamental)
    return LoadedMotion(carried, *(sums / MEASURED))


def _dynamic_mass(scene: Scene, speed: float, steady: ComplexArray, loaded: ComplexArray) -> ComplexArray:
    """Return the mass that changes the steady amplitude into the loaded one; all of it where nothing moves."""
    still = np.abs(steady) * speed**2 < 1e-2 * scene.machine.gravity_m_per_s2
    dynamic = 1.0 / receptances(scene, np.array([speed]))[0, 1]
    ratio = steady / np.where(still, 1.0, loaded)
    return np.asarray(np.where(still, sum(scene.layer_masses), dynamic * (1.0 - ratio) / speed**2))
