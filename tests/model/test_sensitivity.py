"""Derivatives of the parameters by keys of a scene, and kernels that follow them by a complex step."""

import numpy as np
import pytest

from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError
from vibroplat.model.equations import rows
from vibroplat.model.impact import chatter_map, impact
from vibroplat.model.parameters import IMPACT_LAWS, parameters
from vibroplat.model.sensitivity import CHOICES, COMPLEX, IMAGINARY, flat, parameter_direction
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


def complex_record(p, dp):
    found = np.zeros(1, COMPLEX)
    flat(found)[:] = flat(p) + 1j * IMAGINARY * flat(dp)
    for name in CHOICES:
        found[name] = p[name]
    return found[0]


def value_of(scene, key):
    tree = scene.to_tree()
    for name in key.split("."):
        tree = tree[int(name)] if name.isdecimal() else tree.get(name, 0.0)
    return tree


@pytest.mark.parametrize("key", KEYS)
def test_rows_by_a_key(key):
    """With two layers, by turns in contact and in flight."""
    system = SYSTEMS[2 if list(KEYS).index(key) % 2 else 4]
    scene = scene_of(2, "co-rotating" if key.startswith("exciters") else "lopsided")
    p, value = parameters(scene), value_of(scene, key)
    moved = complex_record(p, parameter_direction(scene, key))
    for state, other in random_states(seed=40, count=6).reshape(3, 2, 14):
        y, yp = system.unknowns(state), system.unknowns(other)
        yp[system.differential // 2 :] *= 100.0
        y[system.differential :] = 30.0

        def residual(p, y=y, yp=yp, kind=float):
            res = np.empty(system.size, kind)
            rows(system.index, 0.0, y, yp, res, p)
            return res

        found = residual(moved, kind=complex).imag / IMAGINARY
        expected = central_difference(lambda s: residual(parameters(scene.replace({key: value + s}))), KEYS[key])
        assert found.any()
        round_off = 1e-14 * np.abs(residual(p)).max() / KEYS[key]
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=round_off)


@pytest.mark.parametrize("law", IMPACT_LAWS)
def test_impact_and_latch_along_state_accelerations_and_restitution(law):
    scene = scene_of(2, "lopsided", restitution=0.6, restitution_threshold_m_per_s=0.006, impact_law=law)
    p, dp = parameters(scene), parameter_direction(scene, "contact.restitution")
    rng = np.random.default_rng(45)
    (state,) = random_states(seed=45, count=1)
    pulled = np.array([30.0, 20.0, 150.0, 900.0, -700.0, -35.0, 15.0])
    direction, turning = rng.normal(size=14) * SIZES, rng.normal(size=7) * pulled
    state[5] = direction[5] = 0.0
    direction[12] *= 0.01

    def after(step, p=p, kind=float):
        struck, closed = np.empty((2, 14), kind)
        moved, rates = state + step * direction, pulled + step * turning
        moved[12] = -0.3 + step * direction[12]
        impulse, loss = impact(moved, struck, p["restitution"], p)
        moved[12] = 0.02 + step * direction[12]
        duration, *_ = chatter_map(moved, rates, closed, p)
        return np.concatenate([struck, closed, [impulse, loss, duration]])

    def shifted(step):
        moved = p.copy()
        moved.restitution += step
        return after(step, moved)

    found = after(1j * IMAGINARY, complex_record(p, dp), complex).imag / IMAGINARY
    np.testing.assert_allclose(found, central_difference(shifted, 1e-3), rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("restitution", [0.0, 1.0])
def test_restitution_may_be_varied_at_the_ends_of_its_range(restitution):
    dp = parameter_direction(scene_of(2, restitution=restitution), "contact.restitution")
    assert dp.restitution == pytest.approx(1.0, rel=1e-13)


@pytest.mark.parametrize("key", ["drive.frequency", "motors.7.critical_slip", "contact.impact_law", "motor.pole_pairs"])
def test_key_that_cannot_be_varied_is_refused(key):
    with pytest.raises(ConfigError, match="cannot be varied; allowed: a key of this scene with a continuous value"):
        parameter_direction(Scene(), key)


def test_mass_ratio_cannot_be_varied_where_the_material_vanishes():
    scene = scene_of(1).replace({"material.mass_ratio": 0.0})
    with pytest.raises(ConfigError, match=r"material.mass_ratio = 0.0 cannot be varied"):
        parameter_direction(scene, "material.mass_ratio")
