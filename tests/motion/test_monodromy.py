"""The derivative of a run's end as it is asked for and told."""

import numpy as np
import pytest

from vibroplat import simulate, variation
from vibroplat.errors import ConfigError, MotionError

KEY = "drive.supply_frequency_hz"


@pytest.fixture
def scene(quickstart):
    return quickstart.replace({"run.duration_s": 0.2, "run.perturbation": 0.0})


def test_rows_and_columns_are_those_of_the_trajectory(scene):
    found = variation(scene, keys=KEY)
    names = [n for n in simulate(scene).trajectory.columns if n not in ("t_s", "mode", "contact_force_n")]
    states = [n for n in names if n in found.state.index]
    assert list(found.state.index) == list(found.derivative.index) == states
    assert list(found.derivative.columns) == [*states, KEY]
    assert len(states) == 14


def test_a_run_tells_the_same(scene):
    run, found = simulate(scene, variation=(KEY,)), variation(scene, keys=[KEY])
    np.testing.assert_allclose(run.variation, found.derivative, rtol=1e-6, atol=1e-9)
    assert run.monodromy.equals(run.variation.drop(columns=KEY))
    assert run.final_state == pytest.approx(found.state.to_numpy(), rel=1e-9, abs=1e-12)
    for asked in (True, ()):
        assert simulate(scene, variation=asked).variation.equals(run.monodromy)


def test_a_motion_goes_on_from_where_another_ended(scene):
    """The chain rule: derivatives of two parts multiply to that of the whole."""
    whole = variation(scene, seconds=0.2).derivative
    first = variation(scene, seconds=0.13)
    second = variation(scene, first.state, 0.07).derivative
    product = second @ first.derivative
    assert np.abs(product - whole).to_numpy().max() <= 1e-4 * whole.abs().to_numpy().max()


def test_a_run_that_was_not_asked_says_what_to_ask_for(scene):
    run = simulate(scene)
    for name in ("monodromy", "variation"):
        with pytest.raises(
            ConfigError, match=r"^this run carried no derivative; simulate with variation=True, or with keys"
        ):
            getattr(run, name)


def test_a_motion_that_ended_early_has_none(scene):
    storm = scene.replace({"solver.max_events_per_period": 1, "drive.supply_frequency_hz": 51.0, "run.duration_s": 1.0})
    with pytest.raises(
        ConfigError, match=r"^this run ended early \(too-many-events\); the derivative of its end is not known"
    ):
        _ = simulate(storm, variation=True).monodromy
    with pytest.raises(MotionError, match=r"^engines taylor and native: the motion ended early \(too-many-events\): "):
        variation(storm)


def test_keys_of_the_supply_cannot_be_varied_under_a_program(scene):
    key = "motor.critical_torque_n_m"
    moved = scene.replace(drive={"program": [{"t_s": 0.0, "supply_frequency_hz": 50.0}]})
    with pytest.raises(
        ConfigError, match=f"^{key} cannot be varied under a drive.program; allowed: a key in machine, "
    ):
        variation(moved, keys=key)
    assert variation(moved, keys="machine.gravity_m_per_s2").derivative.shape == (14, 15)


def test_a_state_of_another_scene_is_refused(scene):
    bare = variation(scene.replace({"material.mass_ratio": 0.0})).state
    with pytest.raises(ConfigError, match=r"^state has the names x_m, "):
        variation(scene, bare)
    with pytest.raises(ConfigError, match=r"^state has the shape \(3,\); allowed: \(14,\)"):
        variation(scene, [1.0, 2.0, 3.0])
