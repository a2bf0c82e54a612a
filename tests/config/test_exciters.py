"""Exciters with numbers and rotation of their own: what is told about them, and how they are merged and written."""

from __future__ import annotations

import math

import pytest

from vibroplat import Exciter, Machine, Motor, Scene, load_config
from vibroplat.config.reader import parse_overrides
from vibroplat.errors import ConfigError
from vibroplat.study.branches import branches

MOTOR = "critical_torque_n_m, critical_slip, pole_pairs, friction_radius_m, rated_frequency_hz"
EXCITER = f"{MOTOR}, unbalance_radius_m, rotor_inertia_kg_m2, rotation"

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

MESSAGES = {
    "one": ("exciters: [{}]", "exciters = [{}]; allowed: a list of 2"),
    "none": ("exciters: []", "exciters = []; allowed: a list of 2"),
    "no list": ("exciters: {a: 1}", "exciters = {'a': 1}; allowed: a list"),
    "a number among them": ("exciters: [{}, 3]", "exciters.1 = 3; allowed: a section of keys and values"),
    "key without its unit": (
        "exciters: [{unbalance_radius: 0.1}, {}]",
        f"unknown key exciters.0.unbalance_radius; did you mean unbalance_radius_m? allowed: {EXCITER}",
    ),
    "key that is like none": ("exciters: [{}, {zzz: 1}]", f"unknown key exciters.1.zzz; allowed: {EXCITER}"),
    "rotation": (
        "exciters: [{}, {rotation: left}]",
        "exciters.1.rotation = 'left'; allowed: 'counter-clockwise' or 'clockwise'",
    ),
    "radius 0": (
        "exciters: [{unbalance_radius_m: 0}, {}]",
        "exciters.0.unbalance_radius_m = 0; allowed: more than 0.0",
    ),
    "negative rated frequency": (
        "exciters: [{}, {rated_frequency_hz: -50}]",
        "exciters.1.rated_frequency_hz = -50; allowed: more than 0.0",
    ),
    "rated frequency 0": ("motor: {rated_frequency_hz: 0}", "motor.rated_frequency_hz = 0; allowed: more than 0.0"),
    # both ways of giving a motor
    "motor beside": ("exciters: [{}, {}]\nmotor: {}", "motor and exciters are both given; allowed: one of the two"),
    "motors beside": (
        "exciters: [{}, {}]\nmotors: [{}, {}]",
        "motors and exciters are both given; allowed: one of the two",
    ),
    "common radius beside": (
        "exciters: [{}, {}]\nmachine: {unbalance_radius_m: 0.1}",
        "exciters and machine.unbalance_radius_m are both given; allowed: one of the two",
    ),
    "common rotor inertia beside": (
        "machine: {rotor_inertia_kg_m2: 0.1}\nexciters: [{}, {}]",
        "exciters and machine.rotor_inertia_kg_m2 are both given; allowed: one of the two",
    ),
    # phases
    "sum of phases of co-rotating exciters": (
        "exciters: [{}, {rotation: counter-clockwise}]\nrun: {initial: {phase_sum_rad: 1}}",
        "run.initial.phase_sum_rad = 1.0 but these exciters turn the same way; allowed: phase_difference_rad",
    ),
    "two phases": (
        "run: {initial: {phase_difference_rad: 0, phase_sum_rad: 0}}",
        "run.initial: phase_difference_rad and phase_sum_rad are both given; allowed: one of the two",
    ),
}


@pytest.mark.parametrize("case", MESSAGES)
def test_message(case, complaint):
    text, line = MESSAGES[case]
    assert complaint(text) == f"c.yaml: {line}"


@pytest.mark.parametrize(
    ("text", "setting", "line"),
    [
        ("", "exciters.2.critical_slip=0.1", "unknown key exciters.2; allowed: exciters.0 to exciters.1"),
        ("", "exciters.x.critical_slip=0.1", "unknown key exciters.x; allowed: exciters.0 to exciters.1"),
        ("", "exciters.-1.critical_slip=0.1", "unknown key exciters.-1; allowed: exciters.0 to exciters.1"),
        ("motors: [{}, {}]", "motors.2.pole_pairs=1", "unknown key motors.2; allowed: motors.0 to motors.1"),
        ("", "exciters.1=3", "c.yaml: exciters.1 = 3; allowed: a section of keys and values"),
        ("exciters: [{}, {}]", "exciters=[{}]", "c.yaml: exciters = [{}]; allowed: a list of 2"),
        (
            "",
            "exciters.1.unbalance_radius=3",
            f"c.yaml: unknown key exciters.1.unbalance_radius; did you mean unbalance_radius_m? allowed: {EXCITER}",
        ),
        (
            "exciters: [{}, {}]",
            "motor.pole_pairs=3",
            "c.yaml: motor and exciters are both given; allowed: one of the two",
        ),
        ("motor: 3", "exciters.1.critical_slip=0.1", "c.yaml: motor = 3; allowed: a section of keys and values"),
    ],
)
def test_message_about_a_setting(text, setting, line, complaint):
    assert complaint(text, parse_overrides([setting])).removesuffix(" (and 1 more)") == line


# -- what they become -------------------------------------------------------------------------------------


def test_defaults_are_those_of_the_paper(scene_of):
    scene = scene_of("exciters: [{}, {}]")
    assert scene.exciter_pair == scene_of("").exciter_pair
    assert [exciter.rotation for exciter in scene.exciter_pair] == ["counter-clockwise", "clockwise"]
    assert not scene.co_rotating


def test_all_keys_are_taken(scene_of):
    first, second = scene_of(f"exciters: [{{}}, {UNLIKE}]").exciter_pair
    assert first == Exciter(rotation="counter-clockwise")
    assert second == Exciter(**UNLIKE)


@pytest.mark.parametrize(
    ("rotations", "directions", "co_rotating"),
    [
        (("counter-clockwise", "clockwise"), (1.0, -1.0), False),
        (("clockwise", "counter-clockwise"), (-1.0, 1.0), False),
        (("clockwise", "clockwise"), (-1.0, -1.0), True),
        (("counter-clockwise", "counter-clockwise"), (1.0, 1.0), True),
        ((None, "counter-clockwise"), (1.0, 1.0), True),
        (("clockwise", None), (-1.0, -1.0), True),
    ],
)
def test_rotations(rotations, directions, co_rotating):
    scene = Scene(exciters=[Exciter(rotation=rotation) for rotation in rotations])
    assert tuple(exciter.direction for exciter in scene.exciter_pair) == directions
    assert scene.co_rotating == co_rotating
    assert scene.phase_weights == (1.0, -1.0 if co_rotating else 1.0)


def test_phase_sum_is_the_difference_of_counter_rotating_exciters():
    assert Scene(run={"initial": {"phase_sum_rad": 0.3}}).run.initial.phase_difference == 0.3
    assert Scene(run={"initial": {"phase_difference_rad": 0.3}}).run.initial.phase_difference == 0.3
    assert Scene().run.initial.phase_difference == math.pi


def test_each_exciter_has_its_own_moment_and_inertia():
    scene = Scene(machine=Machine(unbalance_mass_kg=0.5), exciters=[Exciter(), Exciter(**UNLIKE)])
    assert scene.unbalances == pytest.approx((0.5 * 0.09, 0.5 * 0.07), rel=1e-15)
    assert scene.exciter_inertias == pytest.approx((0.8e-3 + 0.5 * 0.09**2, 1.7e-3 + 0.5 * 0.07**2), rel=1e-15)


# -- differences from a machine given by other keys -------------------------------------------------------

#: A machine with one motor, and with two; unlike the defaults.
MACHINE = "machine: {unbalance_radius_m: 0.05, rotor_inertia_kg_m2: 2e-3, damping_y_n_s_per_m: 7}\n"
BELOW = {
    "motor": f"{MACHINE}motor: {{critical_slip: 0.3, pole_pairs: 3}}\n",
    "motors": f"{MACHINE}motors: [{{critical_slip: 0.3}}, {{pole_pairs: 3}}]\n",
    "exciters": "machine: {damping_y_n_s_per_m: 7}\nexciters: [{unbalance_radius_m: 0.05}, {pole_pairs: 3}]\n",
    "nothing": "machine: {damping_y_n_s_per_m: 7}\n",
}


@pytest.fixture(params=BELOW)
def below(request, here):
    """A machine, given by one kind of keys, in a file base.yaml."""
    (here / "base.yaml").write_text(BELOW[request.param])
    return load_config("base.yaml")


def differing(below, *changes):
    """Exciters of a scene, with changes."""
    return [exciter.model_copy(update=change) for exciter, change in zip(below.exciter_pair, changes, strict=True)]


def test_file_gives_exciters_for_differences_alone(below, scene_of):
    scene = scene_of("extends: base.yaml\nexciters: [{}, {unbalance_radius_m: 0.06, rotation: counter-clockwise}]\n")
    changes = {"unbalance_radius_m": 0.06, "rotation": "counter-clockwise"}
    assert list(scene.exciter_pair) == differing(below, {}, changes)
    assert scene.machine.damping_y_n_s_per_m == 7.0
    assert scene.motor is scene.motors is None


def test_empty_exciters_change_nothing(below, scene_of):
    assert scene_of("extends: base.yaml\nexciters: [{}, {}]\n").exciter_pair == below.exciter_pair


def test_setting_changes_one_number(below):
    settings = parse_overrides(["exciters.1.unbalance_radius_m=0.06", "exciters.0.critical_slip=0.4"])
    found = load_config("base.yaml", settings)
    assert list(found.exciter_pair) == differing(below, {"critical_slip": 0.4}, {"unbalance_radius_m": 0.06})


def test_replace_changes_one_number(below):
    for changed in (
        below.replace({"exciters.1.rotor_inertia_kg_m2": 3e-3}),
        below.replace(exciters=[{}, {"rotor_inertia_kg_m2": 3e-3}]),
        below.replace(exciters=[Exciter(), Exciter(rotor_inertia_kg_m2=3e-3)]),
    ):
        assert list(changed.exciter_pair) == differing(below, {}, {"rotor_inertia_kg_m2": 3e-3})


def test_setting_changes_one_of_two_motors():
    scene = Scene(motors=[Motor(pole_pairs=1), Motor(critical_slip=0.3)])
    assert scene.replace({"motors.1.pole_pairs": 3}).motors == [
        Motor(pole_pairs=1),
        Motor(critical_slip=0.3, pole_pairs=3),
    ]


def test_nothing_more_is_changed_by_writing_and_reading(below):
    for scene in (below, below.replace({"exciters.1.rotation": "counter-clockwise"})):
        again = Scene.from_tree(scene.to_tree())
        assert again == scene
        assert again.to_tree() == scene.to_tree()
        assert again.replace() == scene.replace() == scene


def test_exciters_are_swept_by_a_grid():
    plan = {"supply_frequency_hz": {"start": 40, "stop": 40}, "grid": {"exciters.1.unbalance_radius_m": [0.08, 0.09]}}
    found = branches(Scene(sweep=plan))
    assert [branch.scene.exciter_pair[1].unbalance_radius_m for branch in found] == [0.08, 0.09]
    assert {branch.scene.exciter_pair[0].unbalance_radius_m for branch in found} == {0.09}


def test_grid_cannot_sweep_the_common_radius_of_own_exciters():
    plan = {"supply_frequency_hz": {"start": 40, "stop": 40}, "grid": {"machine.unbalance_radius_m": [0.08, 0.09]}}
    with pytest.raises(ConfigError) as caught:
        branches(Scene(exciters=[Exciter(), Exciter()], sweep=plan))
    assert str(caught.value) == (
        "sweep.grid: exciters and machine.unbalance_radius_m are both given; allowed: one of the two"
    )
