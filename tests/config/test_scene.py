"""Scenes: what they are made of, how they are changed and written, and the schema of their files."""

from __future__ import annotations

import math

import pytest

from vibroplat import Drive, Exciter, Machine, Material, Motor, Scene
from vibroplat.config.keys import configuration_schema
from vibroplat.errors import ConfigError
from vibroplat.study.branches import branches

SCENE = Scene(material=Material(mass_ratio=0.1, natural_frequency_hz=18.5, damping_ratio=0.05))

#: The keys of exciters, each with a value unlike its default.
UNLIKE = {
    "critical_torque_n_m": 0.9,
    "critical_slip": 0.21,
    "pole_pairs": 3,
    "friction_radius_m": 8e-5,
    "rated_frequency_hz": 60.0,
    "unbalance_radius_m": 0.07,
    "rotor_inertia_kg_m2": 1.7e-3,
    "rotation": "clockwise",
}

# -- replace --------------------------------------------------------------------------------------------


def test_replace_takes_dotted_keys_and_sections():
    dotted = SCENE.replace({"drive.supply_frequency_hz": 46.0, "material.mass_ratio": 0.2})
    nested = SCENE.replace(drive={"supply_frequency_hz": 46.0}, material={"mass_ratio": 0.2})
    models = SCENE.replace(drive=Drive(supply_frequency_hz=46.0), material={"mass_ratio": 0.2})
    assert dotted == nested == models
    assert dotted.material == Material(mass_ratio=0.2, natural_frequency_hz=18.5, damping_ratio=0.05)
    assert SCENE.replace({"name": "b"}, name="a").name == "b"
    original = Scene(motors=[Motor(pole_pairs=1), Motor()])
    before = original.to_tree()
    assert original.replace({"motors.1.pole_pairs": 3}).motors == [Motor(pole_pairs=1), Motor(pole_pairs=3)]
    assert (original.replace(), original.to_tree()) == (original, before)


def test_replace_takes_a_row_of_a_trajectory():
    """What else the row tells is accepted and not used."""
    row = {"t_s": 1.0, "mode": "attached", "phi1_rad": 2.0, "phi1_rate_rad_per_s": 150.0, "contact_force_n": 1.0}
    row |= {"supply_frequency_hz": 50.0, "motor_power_1_w": 1.0, "motor_power_2_w": 2.0, "gap_m": 0.0, "upper_m": 0.0}
    assert SCENE.replace({"run.initial.state": row}).run.initial.state.phi1_rad == 2.0


# -- exciters and starts --------------------------------------------------------------------------------


def test_exciters_take_all_keys_and_the_defaults_of_the_paper():
    scene = Scene(exciters=[Exciter(), Exciter(**UNLIKE)])
    assert scene.exciter_pair == (Exciter(rotation="counter-clockwise"), Exciter(**UNLIKE))
    assert Scene(exciters=[Exciter(), Exciter()]).exciter_pair == Scene().exciter_pair
    assert [exciter.rotation for exciter in Scene().exciter_pair] == ["counter-clockwise", "clockwise"]


@pytest.mark.parametrize("first", [None, "counter-clockwise", "clockwise"])
@pytest.mark.parametrize("second", [None, "counter-clockwise", "clockwise"])
def test_rotations(first, second):
    scene = Scene(exciters=[Exciter(rotation=first), Exciter(rotation=second)])
    signs = (-1.0 if first == "clockwise" else 1.0, 1.0 if second == "counter-clockwise" else -1.0)
    assert tuple(exciter.direction for exciter in scene.exciter_pair) == signs
    assert scene.co_rotating == (signs[0] == signs[1])
    assert scene.rotation == ("co-rotating" if scene.co_rotating else "counter-rotating")
    assert scene.phase_weights == (1.0, -1.0 if scene.co_rotating else 1.0)


def test_each_exciter_has_its_own_moment_and_inertia():
    scene = Scene(machine=Machine(unbalance_mass_kg=0.5), exciters=[Exciter(), Exciter(**UNLIKE)])
    assert scene.unbalances == pytest.approx((0.5 * 0.09, 0.5 * 0.07), rel=1e-15)
    assert scene.exciter_inertias == pytest.approx((0.8e-3 + 0.5 * 0.09**2, 1.7e-3 + 0.5 * 0.07**2), rel=1e-15)


def test_exciters_are_swept_by_a_grid_but_not_their_common_radius():
    sweep = {"supply_frequency_hz": {"start": 40, "stop": 40}, "grid": {"exciters.1.unbalance_radius_m": [0.08, 0.09]}}
    found = branches(Scene(sweep=sweep))
    assert [branch.scene.exciter_pair[1].unbalance_radius_m for branch in found] == [0.08, 0.09]
    assert {branch.scene.exciter_pair[0].unbalance_radius_m for branch in found} == {0.09}
    sweep["grid"] = {"machine.unbalance_radius_m": [0.08, 0.09]}
    with pytest.raises(ConfigError) as caught:
        branches(Scene(exciters=[Exciter(), Exciter()], sweep=sweep))
    line = "sweep.grid: exciters and machine.unbalance_radius_m are both given; allowed: one of the two"
    assert str(caught.value) == line


def test_phase_sum_is_the_difference_of_counter_rotating_exciters():
    assert Scene(run={"initial": {"phase_sum_rad": 0.3}}).run.initial.phase_difference == 0.3
    assert Scene(run={"initial": {"phase_difference_rad": 0.3}}).run.initial.phase_difference == 0.3
    assert Scene().run.initial.phase_difference == math.pi


def test_start_is_perturbed_unless_it_is_given_as_a_state_or_a_run():
    state, source = {"state": {"y_m": 0}}, {"from": "results/a"}
    runs = [{}, {"initial": state}, {"initial": source}, {"perturbation": 0}, {"perturbation": 0.2, "initial": source}]
    assert [Scene(run=run).run.start_perturbation for run in runs] == [0.01, 0.0, 0.0, 0.0, 0.2]


def test_an_open_gap_may_close():
    state = {"gap_m": 0.1, "gap_rate_m_per_s": -0.1}
    assert SCENE.replace({"run.initial.state": state}).run.initial.state.gap_rate_m_per_s == -0.1


def test_fastest_decay_is_that_of_the_strongest_damper_or_motor():
    free = dict.fromkeys(("damping_x_n_s_per_m", "damping_y_n_s_per_m", "damping_phi_n_m_s_per_rad"), 0.0)
    scene = Scene(machine=free, motor={"critical_torque_n_m": 0.0})
    mass = scene.machine.total_mass
    assert scene.fastest_decay == 0.0
    critical = {"machine.damping_y_n_s_per_m": 2.0 * math.sqrt(470e3 * mass)}
    assert scene.replace(critical).fastest_decay == pytest.approx(math.sqrt(470e3 / mass), rel=1e-6)
    slope = 2.0 * 1.2 / (0.15 * math.pi * 50.0)
    driven = scene.replace({"motor.critical_torque_n_m": 1.2})
    assert driven.fastest_decay == pytest.approx(slope / scene.exciter_inertias[0], rel=1e-12)


def test_schema_refuses_other_keys_and_says_what_is_allowed():
    schema = configuration_schema()
    assert (schema["title"], schema["type"]) == ("vibroplat configuration", "object")
    assert schema["properties"]["extends"]["type"] == "string"
    assert [s for s in (schema, *schema["$defs"].values()) if s["additionalProperties"]] == []
    restitution = schema["$defs"]["Contact"]["properties"]["restitution"]
    assert restitution | {"default": 0.0, "minimum": 0.0, "maximum": 1.0, "type": "number"} == restitution
    assert schema["$defs"]["Contact"]["properties"]["model"]["enum"] == ["impact", "non-impact"]
