"""Scenes: what they are made of, how they are changed and written, and the schema of their files."""

import itertools
import json
import math
import re

import numpy as np
import pytest

from vibroplat import Drive, Exciter, Material, Motor, Scene
from vibroplat.config.keys import configuration_schema
from vibroplat.errors import ConfigError
from vibroplat.hybrid.state import initial_state
from vibroplat.model.motor import motor_torque
from vibroplat.model.parameters import parameters
from vibroplat.study.branches import branches

SCENE = Scene(material=Material(mass_ratio=0.1, natural_frequency_hz=18.5, damping_ratio=0.05))

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


def test_replace_keeps_what_it_does_not_change():
    """Plans of thousands of scenes share their sections, and what was found of their exciters."""
    changed = SCENE.replace({"contact.restitution": 0.1})
    assert all(getattr(changed, name) is getattr(SCENE, name) for name in ("machine", "material", "drive"))
    assert changed.exciter_pair is SCENE.exciter_pair
    assert (SCENE.body, SCENE.replace({"contact.restitution": 0.1}).body is SCENE.body) == (changed.body, True)
    stronger = SCENE.replace({"motor.critical_torque_n_m": 9.0})
    assert [exciter.critical_torque_n_m for exciter in stronger.exciter_pair] == [9.0, 9.0]
    assert stronger.replace(exciters=[Exciter(), Exciter()]).motor is None


def test_exciters_of_a_copy_are_found_anew_where_their_numbers_change():
    def with_machine(**numbers):
        return SCENE.model_copy(update={"machine": SCENE.machine.model_copy(update=numbers)})

    pair, heavier = SCENE.exciter_pair, with_machine(platform_mass_kg=20.0)
    assert heavier.exciter_pair is pair
    assert heavier.body.mass > SCENE.body.mass
    assert with_machine(unbalance_mass_kg=0.1).exciter_pair is not pair
    for name in ("unbalance_radius_m", "rotor_inertia_kg_m2"):
        own = 2.0 * getattr(SCENE.machine, name)
        assert [getattr(exciter, name) for exciter in with_machine(**{name: own}).exciter_pair] == [own, own]


# -- exciters and starts --------------------------------------------------------------------------------


def test_exciters_turn_opposite_unless_told_otherwise():
    assert Scene(exciters=[Exciter(), Exciter()]).exciter_pair == Scene().exciter_pair
    ways = {None: 0.0, "counter-clockwise": 1.0, "clockwise": -1.0}
    for first, second in itertools.product(ways, repeat=2):
        scene = Scene(exciters=[Exciter(rotation=first), Exciter(rotation=second)])
        signs = (ways[first] or 1.0, ways[second] or -1.0)
        same = signs[0] == signs[1]
        assert tuple(exciter.direction for exciter in scene.exciter_pair) == signs
        assert (scene.co_rotating, scene.phase_weights) == (same, (1.0, -1.0 if same else 1.0))
        assert scene.rotation == ("co-rotating" if same else "counter-rotating")
        rest = Scene.from_tree(scene.replace({"run.initial": {"speed_ratio": 0.0}}).to_tree())
        assert list(initial_state(rest)[3:5]) == [-0.5 * math.pi, -0.5 * math.pi]  # they hang


def test_exciters_have_own_masses_moments_and_positions():
    """Two of them beside the closed form, also after a round trip; what an exciter does not give is the machine's."""
    machine = {"platform_mass_kg": 10.0, "unbalance_mass_kg": 2.0}
    first = {"unbalance_mass_kg": 3.0, "static_moment_kg_m": 0.6, "position_m": [0.4, -0.1]}
    second = {"position_m": [-0.2, 0.5], "unbalance_radius_m": 0.07, "rotor_inertia_kg_m2": 1.7e-3}
    scene = Scene(machine=machine, exciters=[first, second])
    assert Scene.from_tree(scene.to_tree()) == scene
    assert scene.body.mass == 15.0
    assert scene.unbalances == pytest.approx((0.6, 0.14))
    assert scene.exciter_inertias == pytest.approx((0.8e-3 + 0.6 * 0.2, 1.7e-3 + 0.14 * 0.07))
    c = np.array([3.0 * 0.4 - 2.0 * 0.2, -3.0 * 0.1 + 2.0 * 0.5]) / 15.0
    arms = np.array([[0.4, -0.1], [-0.2, 0.5]]) - c
    assert np.array(scene.body.axes) == pytest.approx(arms)
    inertia = 0.11 + 10.0 * c @ c + 3.0 * arms[0] @ arms[0] + 2.0 * arms[1] @ arms[1]
    assert scene.body.inertia == pytest.approx(inertia, rel=1e-14)
    # a later layer gives the moment otherwise, or moves an axis by its place
    assert scene.replace({"exciters.0.unbalance_radius_m": 0.3}).unbalances[0] == pytest.approx(0.9)
    assert scene.replace({"exciters.1.position_m.0": 0.0}).exciter_pair[1].position_m == [0.0, 0.5]
    assert not scene.has_mirrored_exciters
    mirrored = [{"position_m": [x, 0.3], "static_moment_kg_m": 0.6} for x in (0.2, -0.2)]
    assert Scene(exciters=mirrored).has_mirrored_exciters
    assert not Scene(exciters=[mirrored[0], mirrored[1] | {"static_moment_kg_m": 0.5}]).has_mirrored_exciters


def test_axes_and_inertia_of_equal_exciters_are_those_of_the_paper():
    scene = Scene()
    m, m_0, gamma, rho = 0.045, 12.42, math.radians(22.5), 0.128
    x, y = rho * math.cos(gamma), m_0 / (m_0 + 2 * m) * rho * math.sin(gamma)
    assert np.array(scene.body.axes) == pytest.approx(np.array([[x, y], [-x, y]]), rel=1e-14)
    inertia = 0.11 + 2 * m * rho**2 * (m_0 + 2 * m * math.cos(gamma) ** 2) / (m_0 + 2 * m)
    assert scene.body.inertia == pytest.approx(inertia, rel=1e-14)


PLATE = {"rated_power_w": 1500.0, "rated_speed_rpm": 1425.0, "breakdown_ratio": 2.6, "rated_frequency_hz": 50.0}


def test_motor_by_its_nameplate_has_its_rated_and_its_critical_torque():
    """At the rated speed it has the rated torque P/ω, and at no slip more than breakdown_ratio times that."""
    base = Scene(motor={"critical_torque_n_m": 3.0, "critical_slip": 0.3}, drive={"supply_frequency_hz": 50.0})
    scene = base.replace(motor=PLATE)
    assert Scene.from_tree(scene.to_tree()) == scene
    motor, p = scene.exciter_pair[0], parameters(scene)
    speed = 2.0 * math.pi * 1425.0 / 60.0
    assert motor_torque(0, 0.0, speed, p) == pytest.approx(1500.0 / speed, rel=1e-14)
    speeds = (1.0 - motor.critical_slip * np.array([0.99, 1.0, 1.01])) * 50.0 * math.pi
    below, most, above = (motor_torque(0, 0.0, one, p) for one in speeds)
    assert most == pytest.approx(2.6 * 1500.0 / speed, rel=1e-14)
    assert max(below, above) < most


def test_exciters_are_swept_by_a_grid_but_not_their_common_radius():
    assert [one.critical_slip for one in Scene().replace({"exciters.N.critical_slip": 0.2}).exciter_pair] == [0.2, 0.2]
    sweep = {"supply_frequency_hz": {"start": 40, "stop": 40}, "grid": {"exciters.1.unbalance_radius_m": [0.08, 0.09]}}
    found = branches(Scene(sweep=sweep))
    assert [branch.scene.exciter_pair[1].unbalance_radius_m for branch in found] == [0.08, 0.09]
    assert {branch.scene.exciter_pair[0].unbalance_radius_m for branch in found} == {0.09}
    sweep["grid"] = {"machine.unbalance_radius_m": [0.08, 0.09]}
    with pytest.raises(ConfigError) as caught:
        branches(Scene(exciters=[Exciter(), Exciter()], sweep=sweep))
    line = "sweep.grid: exciters and machine.unbalance_radius_m are both given; allowed: one of the two"
    assert str(caught.value) == line


def test_phase_difference_of_counter_rotating_exciters_is_a_sum():
    for initial, angles in (
        ({"phase_difference_rad": 0.3}, (0.0, 0.3)),
        ({"phase_difference_rad": 0.3, "phi1_rad": 0.1}, (0.1, 0.2)),
        ({}, (0.0, math.pi)),
        ({"speed_ratio": 0.0, "phi1_rad": 0.0}, (0.0, math.pi)),
        ({"speed_ratio": 0.0}, (-1.5, -1.5)),
    ):
        assert Scene(run={"initial": initial}).run.initial.angles(1.0, -1.5) == pytest.approx(angles)


def test_nothing_disturbs_a_machine_whose_motors_are_off_during_the_run():
    """A supply that comes later, within the run, is one: the motion it drives may be unstable by symmetry."""
    off, on = {"t_s": 0, "supply_frequency_hz": 50, "off": True}, {"t_s": 2, "off": False}
    cases = [
        ({"motor.critical_torque_n_m": 0.0}, 0.0),
        ({"drive": {"program": [off]}}, 0.0),
        ({"drive": {"program": [off, on]}}, 0.01),
        ({"drive": {"program": [off, on]}, "run.duration_s": 1.0}, 0.0),
        ({"drive": {"program": [{**off, "off": False}, {"t_s": 1, "off": True}]}}, 0.01),
        ({"drive": {"program": [{"t_s": 0, "supply_frequency_hz": 0}, {"t_s": 2, "supply_frequency_hz": 50}]}}, 0.01),
        ({"drive": {"program": [off]}, "run.perturbation": 0.02}, 0.02),
    ]
    assert [SCENE.replace(changes).start_perturbation for changes, _ in cases] == [share for _, share in cases]


def test_start_is_perturbed_unless_it_is_given_as_a_state_or_a_run():
    state, source = {"state": {"y_m": 0}}, {"from": "results/a"}
    runs = [{}, {"initial": state}, {"initial": source}, {"perturbation": 0}, {"perturbation": 0.2, "initial": source}]
    assert [Scene(run=run).start_perturbation for run in runs] == [0.01, 0.0, 0.0, 0.0, 0.2]


def test_an_open_gap_may_close():
    state = {"gap_m": 0.1, "gap_rate_m_per_s": -0.1}
    assert SCENE.replace({"run.initial.state": state}).run.initial.state.gap_rate_m_per_s == -0.1


def test_fastest_decay_is_that_of_the_strongest_damper_or_motor():
    free = dict.fromkeys(("damping_x_n_s_per_m", "damping_y_n_s_per_m", "damping_phi_n_m_s_per_rad"), 0.0)
    scene = Scene(machine=free, motor={"critical_torque_n_m": 0.0})
    mass = scene.body.mass
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
    assert schema["$schema"].endswith("2020-12/schema")
    patterns = re.findall(r'"pattern": "(.*?)"[,}]', json.dumps(schema))
    assert len(patterns) > 0
    for pattern in patterns:
        assert re.compile(json.loads(f'"{pattern}"')), "classes of letters are not known everywhere"
    assert [s for s in (schema, *schema["$defs"].values()) if s["additionalProperties"]] == []
    assert schema["$defs"]["Output"]["properties"]["points"]["additionalProperties"] is False
    restitution = schema["$defs"]["Contact"]["properties"]["restitution"]
    assert restitution | {"default": 0.0, "minimum": 0.0, "maximum": 1.0, "type": "number"} == restitution
    assert schema["$defs"]["Contact"]["properties"]["model"]["enum"] == ["impact", "non-impact"]
