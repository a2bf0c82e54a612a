"""Derivatives by parameters against differences of scenes, and against known ones."""

import math

import numpy as np
import pytest

from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError
from vibroplat.model.accelerations import accelerations
from vibroplat.model.equations import rows
from vibroplat.model.impact import impact, latch
from vibroplat.model.parameters import blank, parameters
from vibroplat.model.sensitivity import (
    acceleration_derivative,
    impact_derivative,
    latch_derivative,
    parameter_direction,
    residual_derivative,
)
from vibroplat.model.systems import SYSTEMS

from .helpers import SIZES, central_difference, random_states, scene_of

#: Keys that a continuation may follow, and steps that keep sixth-order differences at round-off.
KEYS = {
    "drive.supply_frequency_hz": 0.1,
    "material.mass_ratio": 1e-3,
    "material.lower_share": 1e-2,
    "material.natural_frequency_hz": 0.1,
    "material.damping_ratio": 1e-3,
    "machine.damping_y_n_s_per_m": 1.0,
    "machine.stiffness_phi_n_m_per_rad": 10.0,
    "machine.unbalance_mass_kg": 1e-3,
    "machine.unbalance_radius_m": 1e-3,
    "machine.exciter_angle_deg": 0.5,
    "machine.gravity_m_per_s2": 0.1,
    "motors.1.critical_slip": 1e-3,
    "motors.0.friction_radius_m": 1e-6,
    "exciters.0.unbalance_radius_m": 1e-3,
    "exciters.1.rotor_inertia_kg_m2": 1e-4,
    "exciters.1.critical_slip": 1e-3,
}


def varies(system, key):
    """Whether a system has what a key is of."""
    return not key.startswith("material") or system.layers >= (1 if key.endswith("mass_ratio") else 2)


EACH_SYSTEM_AND_KEY = pytest.mark.parametrize(
    ("system", "key"),
    [
        pytest.param(system, key, id=f"{system.mode.label}-{system.layers}-{key}")
        for system in SYSTEMS
        for key in KEYS
        if varies(system, key)
    ],
)


def scene_with(layers, key):
    """Return a lopsided scene that has a key."""
    return scene_of(layers, "co-rotating" if key.startswith("exciters") else "lopsided")


def value_of(scene, key):
    tree = scene.to_tree()
    for name in key.split("."):
        tree = tree[int(name)] if name.isdecimal() else tree.get(name, 0.0)
    return tree


def by_difference(function, scene, key):
    """Differentiate a function of parameters by a key, through scenes."""
    value = value_of(scene, key)
    return central_difference(lambda s: function(parameters(scene.replace({key: value + s}))), KEYS[key])


@EACH_SYSTEM_AND_KEY
def test_residual_by_a_key(system, key):
    scene = scene_with(system.layers, key)
    p, dp = parameters(scene), parameter_direction(scene, key)
    for state, other in random_states(seed=40, count=6).reshape(3, 2, 14):
        y, yp = system.unknowns(state), system.unknowns(other)
        yp[system.differential // 2 :] *= 100.0
        y[system.differential :] = 30.0

        def residual(p, y=y, yp=yp):
            res = np.empty(system.size)
            rows(system.index, 0.0, y, yp, res, p)
            return res

        found = residual_derivative(system.index, 0.0, y, yp, p, dp)
        assert found.any()
        round_off = 1e-14 * np.abs(residual(p)).max() / KEYS[key]
        np.testing.assert_allclose(found, by_difference(residual, scene, key), rtol=1e-10, atol=round_off)


@EACH_SYSTEM_AND_KEY
def test_accelerations_by_a_key(system, key):
    scene = scene_with(system.layers, key)
    p, dp = parameters(scene), parameter_direction(scene, key)
    for state in random_states(seed=41, count=3):

        def settled(p, state=state):
            y, yp = system.unknowns(state), np.empty(system.size)
            assert accelerations(system.index, 0.0, y, yp, p)
            return y, yp

        def rates_and_force(p, settled=settled):
            y, yp = settled(p)
            return np.append(yp[: system.differential], y[system.differential :])

        found = acceleration_derivative(system.index, 0.0, *settled(p), p, dp)
        round_off = 1e-13 * np.abs(rates_and_force(p)).max() / KEYS[key]
        np.testing.assert_allclose(found, by_difference(rates_and_force, scene, key), rtol=1e-8, atol=round_off)


def test_supply_frequency_changes_synchronous_and_critical_slip_speeds_alone():
    scene = scene_of(2).replace({"motors.1.rated_frequency_hz": 60.0})
    dp = parameter_direction(scene, "drive.supply_frequency_hz")
    speeds = [2.0 * math.pi / motor.pole_pairs for motor in scene.motors]
    assert dp.speed == pytest.approx(speeds, rel=1e-13)
    assert dp.slip_speed == pytest.approx([scene.motors[0].critical_slip * speeds[0], 0.0], rel=1e-13)
    dp.speed = dp.slip_speed = 0.0
    assert dp == blank()


def test_restitution_may_be_varied_at_the_ends_of_its_range():
    for restitution in (0.0, 0.5, 1.0):
        dp = parameter_direction(scene_of(2, restitution=restitution), "contact.restitution")
        assert dp.restitution == pytest.approx(1.0, rel=1e-13)


@pytest.mark.parametrize("restitution", [0.0, 0.6, 1.0])
def test_impact_by_restitution(restitution):
    scene = scene_of(2, restitution=restitution)
    p, dp = parameters(scene), parameter_direction(scene, "contact.restitution")
    (state,) = random_states(seed=42, count=1)
    state[5], state[12] = 0.0, -0.3
    after = np.empty(14)
    impulse, _ = impact(state, after, p)
    found, by_impulse, by_loss = impact_derivative(state, np.zeros(14), p, dp)
    # all jumps have the factor 1 + R; the loss of the reduced mass has 1 − R²
    np.testing.assert_allclose(found, (after - state) / (1.0 + restitution), rtol=1e-10, atol=1e-13)
    assert found[12] == pytest.approx(0.3, rel=1e-13)
    assert by_impulse == pytest.approx(impulse / (1.0 + restitution), rel=1e-12)
    reduced = impulse / ((1.0 + restitution) * 0.3)
    assert by_loss == pytest.approx(-reduced * restitution * 0.3**2, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("law", ["conservative", "central", "printed"])
@pytest.mark.parametrize("key", ["material.mass_ratio", "machine.unbalance_mass_kg", "machine.exciter_angle_deg"])
def test_impact_by_a_key(key, law):
    scene = scene_of(2, "lopsided", restitution=0.4, impact_law=law)
    p, dp = parameters(scene), parameter_direction(scene, key)
    (state,) = random_states(seed=43, count=1)
    state[5], state[12] = 0.0, -0.3

    def struck(p):
        after = np.empty(14)
        impact(state, after, p)
        return after[7:]

    found, *_ = impact_derivative(state, np.zeros(14), p, dp)
    np.testing.assert_allclose(found[7:], by_difference(struck, scene, key), rtol=1e-9, atol=1e-12 / KEYS[key])


def test_impact_by_the_state():
    p, dp = parameters(scene_of(2, "lopsided", restitution=0.4)), blank()
    (state,) = random_states(seed=44, count=1)
    state[5], state[12] = 0.0, -0.3
    for direction in np.eye(14):

        def struck(step, direction=direction):
            after = np.empty(14)
            impact(state + step * direction, after, p)
            return after

        found, *_ = impact_derivative(state, direction, p, dp)
        np.testing.assert_allclose(found, central_difference(struck, 1e-2), rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("sticking_speed", [0.0, 0.006])
@pytest.mark.parametrize("restitution", [0.0, 0.6])
def test_latch_along_state_accelerations_and_restitution(restitution, sticking_speed):
    scene = scene_of(2, "lopsided", restitution=restitution, sticking_speed_m_per_s=sticking_speed)
    p, dp = parameters(scene), parameter_direction(scene, "contact.restitution")
    rng = np.random.default_rng(45)
    (state,) = random_states(seed=45, count=1)
    state[5], state[12] = 0.0, 0.02
    if sticking_speed and restitution == 0.0:
        state[12] = 0.004  # it sticks at once
    pulled = np.array([30.0, 20.0, 150.0, 900.0, -700.0, -35.0, 15.0])
    direction, turning = rng.normal(size=14) * SIZES, rng.normal(size=7) * pulled
    direction[5] = 0.0
    direction[12] *= 0.01

    def closed(step):
        moved = p.copy()
        moved.restitution += step
        after = np.empty(14)
        duration, *_ = latch(state + step * direction, pulled + step * turning, after, moved)
        return np.append(after, duration)

    after, duration = latch_derivative(state, pulled, direction, turning, p, dp)
    np.testing.assert_allclose(np.append(after, duration), central_difference(closed, 1e-3), rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("key", ["drive.frequency", "motors.7.critical_slip", "contact.impact_law", "motor.pole_pairs"])
def test_key_that_cannot_be_varied_is_refused(key):
    with pytest.raises(ConfigError, match="cannot be varied; allowed: a key of this scene with a continuous value"):
        parameter_direction(Scene(), key)


def test_mass_ratio_cannot_be_varied_where_the_material_vanishes():
    scene = scene_of(1).replace({"material.mass_ratio": 0.0})
    with pytest.raises(ConfigError, match=r"material.mass_ratio = 0.0 cannot be varied"):
        parameter_direction(scene, "material.mass_ratio")
