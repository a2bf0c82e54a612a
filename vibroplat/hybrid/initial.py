"""The state a run begins with."""

from __future__ import annotations

import numpy as np

from vibroplat.config.coordinates import COORDINATES, RATES
from vibroplat.config.scene import Scene
from vibroplat.hybrid.scales import state_scales
from vibroplat.model.parameters import FloatArray
from vibroplat.model.systems import FULL_SIZE


def static_rest(scene: Scene) -> FloatArray:
    """Full state of platform and material at rest on the static sag, exciters at angle 0.

    y = −(M + m_w) g / c_y and y_w2 = −m_w2 g / c_w, springs being unstressed at 0.
    """
    state = np.zeros(FULL_SIZE)
    gravity = scene.machine.gravity_m_per_s2
    lower, upper = scene.layer_masses
    state[1] = -(scene.platform_mass + lower + upper) * gravity / scene.machine.stiffness_y_n_per_m
    if scene.layers == 2:
        state[6] = -gravity / scene.layer_spring[0]
    return state


def initial_state(scene: Scene) -> FloatArray:
    """Full state, shape (14,), that ``run.initial`` asks for; for one that goes on from another run static rest."""
    initial = scene.run.initial
    state = static_rest(scene)
    if initial.state is None:
        speeds = scene.synchronous_speeds_at(scene.drive.at(0.0).frequency_at(0.0))
        state[3] = initial.phi1_rad
        state[4] = scene.phase_weights[1] * (initial.phase_difference - initial.phi1_rad)
        for i, exciter in enumerate(scene.exciter_pair):
            state[10 + i] = initial.speed_ratio * exciter.direction * speeds[i]
        return state
    for places, names in ((range(7), COORDINATES), (range(7, FULL_SIZE), RATES)):
        for place, name in zip(places, names, strict=True):
            value = getattr(initial.state, name)
            if value is not None:
                state[place] = value
    return state


def perturbed(state: FloatArray, scene: Scene, share: float, key: tuple[int, ...]) -> FloatArray:
    """Return a state, shape (14,), with the rates of platform and exciters changed by normal random numbers.

    A symmetric motion that has lost stability would otherwise stay symmetric for ever.

    Parameters
    ----------
    share
        Standard deviation, in the scales of the scene.
    key
        Numbers that determine the random ones.
    """
    if share == 0.0:
        return state
    random = np.random.default_rng(key)
    changed = state.copy()
    changed[7:12] += share * state_scales(scene)[7:12] * random.standard_normal(5)
    return changed
