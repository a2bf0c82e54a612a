"""Notes on numbers of a scene that are unusual or taken by default."""

import pickle

import pytest
from common.places import QUICKSTART

from vibroplat import Machine, Scene, load_config
from vibroplat.config.plausibility import HINT, WARNING, notes_on_input, notes_on_inputs, notes_on_plan, set_in_vain
from vibroplat.errors import ConfigError
from vibroplat.study.sweep import SweepStudy

SECTIONS = {"machine": load_config(QUICKSTART).machine, "motor": load_config(QUICKSTART).motor}


# -- unusual numbers ------------------------------------------------------------------------------------


MOTOR = SECTIONS["motor"].model_dump()
MASSES = "machine.platform_mass_kg = 12.42, machine.unbalance_mass_kg = 0.045"
ACCELERATION = "of the platform far above resonance; usual: up to 30 g"

#: What is noted of one changed number of the quickstart: a situation for each quantity.
NUMBERS = {
    "machine.stiffness_x_n_per_m = 58000000000": ": natural frequency 10800 Hz in x; usual: 1 to 150 Hz",
    "machine.stiffness_phi_n_m_per_rad = 1.8": ": natural frequency 0.640 Hz in phi; usual: 1 to 150 Hz",
    "machine.damping_x_n_s_per_m = 30000": ": damping ratio 5.57 in x; usual: up to 1",
    "machine.damping_phi_n_m_s_per_rad = 77": ": damping ratio 2.72 in phi; usual: up to 1",
    "machine.rotor_inertia_kg_m2 = 500": "; usual: up to 100 kg·m²",
    "material.mass_ratio = 20": "; usual: up to 5",
    "material.damping_ratio = 2": ": damping ratio 2.00 of the layers; usual: up to 1",
    "material.damping_n_s_per_m = 500": ": damping ratio 2.89 of the layers; usual: up to 1",
    "motor.critical_slip = 15": "; usual: up to 1",
    "motor.critical_torque_n_m = 20000": "; usual: up to 10000 N·m",
    "exciters.0.friction_radius_m = 0.02": "; usual: up to 0.01 m",
    "run.initial.speed_ratio = -2": "; usual: -1.5 to 1.5",
}
#: The same where there are several notes, or one on several numbers.
UNUSUAL = [
    (
        {"machine.stiffness_y_n_per_m": 470.0},
        [
            "machine.stiffness_y_n_per_m = 470: natural frequency 0.976 Hz in y; usual: 1 to 150 Hz",
            "machine.stiffness_y_n_per_m = 470: static sag 0.313 m; usual: up to 0.05 m",
        ],
    ),
    (
        {"contact": {"model": "non-impact", "viscous_per_mass_per_s": 3e3}},
        [
            "machine.damping_y_n_s_per_m = 40, contact.viscous_per_mass_per_s = 3000: damping ratio 1.56 in y; "
            "usual: up to 1",
            f"{HINT}no effect of contact.restitution_threshold_m_per_s, material.damping_ratio, "
            "material.natural_frequency_hz: contact.model is non-impact",
        ],
    ),
    (
        {"drive.supply_frequency_hz": 3000.0},
        [
            "drive.supply_frequency_hz = 3000; usual: up to 400 Hz",
            f"{MASSES}, machine.unbalance_radius_m = 0.03, drive.supply_frequency_hz = "
            f"3000: acceleration 1950 g {ACCELERATION}",
            "hint: output.sample_rate_hz = 2000: 1.3 samples per turn miss the extremes",
        ],
    ),
    (
        {"drive.program": [{"t_s": 0.0, "supply_frequency_hz": 20.0}, {"t_s": 2.0, "supply_frequency_hz": 500.0}]},
        [
            "drive.program: supply frequency 500 Hz; usual: up to 400 Hz",
            f"{MASSES}, machine.unbalance_radius_m = 0.03: acceleration 54.3 g {ACCELERATION}",
            "hint: output.sample_rate_hz = 2000: 8.0 samples per turn miss the extremes",
        ],
    ),
    (
        {
            "drive.program": [{"t_s": 0.0, "supply_frequency_hz": 50.0}, {"t_s": 2.0, "exciter_2": "off"}],
            "run.duration_s": 1.5,
        },
        [
            "drive.program.1.t_s = 2: the run ends before, at 1.5 s, and does not get there; times are in seconds, and "
            "a longer run.duration_s helps"
        ],
    ),
    (
        {"exciters": [MOTOR | {"rotor_inertia_kg_m2": 8e-4, "unbalance_radius_m": r} for r in (10.0, 0.03)]},
        [
            f"{MASSES}, drive.supply_frequency_hz = 51.5, exciters.0.unbalance_radius_m = 10, "
            f"exciters.1.unbalance_radius_m = 0.03: acceleration 96.3 g {ACCELERATION}",
        ],
    ),
    ({"machine.damping_y_n_s_per_m": 0.0}, []),
    (
        {"machine.damping_y_n_s_per_m": 0.0, "material.mass_ratio": 0.0},
        [
            "machine.damping_y_n_s_per_m = 0: free vibrations never decay, so every run contains what its start "
            "leaves; 48.5 would be 1 % of critical damping"
        ],
    ),
    (dict.fromkeys(("machine.damping_x_n_s_per_m", "machine.stiffness_x_n_per_m"), 0.0), []),
    (
        {"machine.damping_y_n_s_per_m": 5.0, "material.mass_ratio": 0.0, "run.duration_s": 45.0},
        [
            "machine.damping_y_n_s_per_m = 5: free vibrations decay by e in 5.00 s, so a run below 46 s contains what "
            "its start leaves; 48.5 would be 1 % of critical damping"
        ],
    ),
    ({"machine.damping_y_n_s_per_m": 5.0, "material.mass_ratio": 0.0, "run.duration_s": 47.0}, []),
    ({"run.initial.phase_difference_rad": 180.0}, ["run.initial.phase_difference_rad = 180; usual: -6.3 to 6.3 rad"]),
    (
        {"run.initial": {"state": {"x_m": 2.0, "y_m": 1e9}}},
        ["run.initial.state.x_m = 2; usual: -1 to 1 m", "run.initial.state.y_m = 1000000000; usual: -1 to 1 m"],
    ),
    ({"run.initial": {"state": {"gap_m": 0.0}}}, []),
]


def test_unusual_numbers_are_noted():
    for text, note in NUMBERS.items():
        key, _, number = text.partition(" = ")
        assert notes_on_input(load_config(QUICKSTART, {key: float(number)})) == [WARNING + text + note]
    for changes, notes in UNUSUAL:
        expected = [note if note.startswith(HINT) else WARNING + note for note in notes]
        assert notes_on_input(load_config(QUICKSTART, changes)) == expected


def test_what_concerns_one_run_is_not_noted_of_a_study():
    scene = load_config(QUICKSTART, {"output.sample_rate_hz": 100.0})
    assert len(notes_on_input(scene)) == 1
    assert notes_on_inputs([scene]) == []


def test_what_a_scene_does_not_have_is_not_unusual():
    for changes in (
        {"machine.stiffness_x_n_per_m": 0.0, "machine.damping_x_n_s_per_m": 0.0},
        {"machine.stiffness_phi_n_m_per_rad": 0.0},
        {"machine.gravity_m_per_s2": 0.0},
        {"material.mass_ratio": 0.0, "material.damping_ratio": 5.0},
    ):
        assert notes_on_input(load_config(QUICKSTART).replace(changes)) == []


def test_a_motor_too_weak_to_lift_its_unbalance_is_noted():
    """Held level the unbalance needs 0.045 · 0.03 · 9.81 = 0.01324 N·m, 0.0096 to swing over the top at once."""
    rest = {"run.initial.speed_ratio": 0.0, "motor.critical_slip": 0.15}
    note = (
        "each motor gives 5.87 mN·m at standstill, 20.0 mN·m at most, where 9.60 mN·m carry its unbalance over the top "
        "in one swing: it may start late or not at all, and more torque or run.initial.speed_ratio helps"
    )
    weak = load_config(QUICKSTART, rest | {"motor.critical_torque_n_m": 0.02})
    assert notes_on_input(weak) == [note]
    ramp = [{"t_s": 0.0, "supply_frequency_hz": 0.0}, {"t_s": 3.0, "supply_frequency_hz": 50.0}]
    for changes in (
        {"motor.critical_torque_n_m": 0.04},
        {"run.initial.speed_ratio": 0.98},
        {"motor.rated_frequency_hz": 50.0, "drive.program": ramp},  # the critical torque at a low frequency
        {"motor.critical_torque_n_m": 0.0},
    ):
        assert notes_on_input(weak.replace(changes)) == []
    ends = [weak, weak.replace({"motor.critical_torque_n_m": 20.0})]
    assert notes_on_inputs(ends, ["torque 0.02", "torque 20"]) == [f"at torque 0.02: {note}"]
    assert notes_on_inputs([weak, weak], ["one", "other"]) == [note], "what holds at both ends has no place"
    heavy = load_config(QUICKSTART, {"material.mass_ratio": 20.0})
    (note,) = notes_on_inputs([heavy, load_config(QUICKSTART)], ["one", "other"])
    assert note == f"{WARNING}at one: material.mass_ratio = 20; usual: up to 5"


# -- numbers taken by default ---------------------------------------------------------------------------


def test_a_scene_without_a_machine_says_which_it_takes():
    expected = [f"{WARNING}machine and motor: no key given; taken from the paper's test rig"]
    assert notes_on_input(Scene()) == expected
    assert notes_on_input(Scene().replace({"material": {"mass_ratio": 0.1, "layers": 1}})) == expected
    assert notes_on_input(pickle.loads(pickle.dumps(Scene()))) == expected  # as workers get it


@pytest.mark.parametrize(
    ("left_out", "notes"),
    [
        ("damping_x_n_s_per_m", ["machine: damping_x_n_s_per_m not given"]),
        ("damping_x_n_s_per_m damping_y_n_s_per_m", ["machine: damping_x_n_s_per_m and damping_y_n_s_per_m not given"]),
        ("gravity_m_per_s2", []),
    ],
)
def test_keys_of_a_machine_that_are_left_out_are_noted(left_out, notes, tmp_path):
    given = SECTIONS["machine"].model_dump(exclude={*left_out.split()})
    expected = [f"{WARNING}{note}; taken from the paper's test rig" for note in notes]
    scene = Scene(machine=Machine(**given), motor=SECTIONS["motor"])
    assert notes_on_input(scene) == notes_on_input(scene.replace({"drive.supply_frequency_hz": 46.0})) == expected
    file = tmp_path / "own.yaml"
    file.write_text(f"machine: {given}\nmotor: {SECTIONS['motor'].model_dump(exclude_none=True)}\n")
    assert notes_on_input(load_config(file)) == expected


@pytest.mark.parametrize(
    ("text", "begun", "missing"),
    [
        ("exciters: [{static_moment_kg_m: 4.8}, {}]", "exciters", "exciters.1.static_moment_kg_m"),
        ("motors: [{}, {}]", "motors", "machine.unbalance_mass_kg"),
        (
            "machine: {platform_mass_kg: 2200, unbalance_mass_kg: 5, unbalance_radius_m: 0.1}",
            "machine.platform_mass_kg",
            "",
        ),
    ],
)
def test_a_machine_of_ones_own_is_whole_or_refused(text, begun, missing, tmp_path):
    """No machine of 2.4 t has the springs of a test rig."""
    file = tmp_path / "own.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_config(file)
    line = str(caught.value)
    assert line.startswith(f"{file}: {begun} is given without machine.platform_")
    assert line.endswith(f"{missing}; allowed: all of a machine of one's own, or extends with the file of one")
    file.write_text(f"extends: {QUICKSTART}\n{text}")
    load_config(file)
    load_config(QUICKSTART, {"machine.platform_mass_kg": 13.0})


def test_keys_of_the_machine_that_each_exciter_gives_have_no_effect_and_are_not_written():
    own = [
        MOTOR | {"rotor_inertia_kg_m2": 8e-4, "unbalance_radius_m": 0.03, "unbalance_mass_kg": m} for m in (0.1, 0.2)
    ]
    scene = load_config(QUICKSTART, {"exciters": own})
    (note,) = notes_on_input(scene)
    assert note.startswith(f"{WARNING}no effect of machine.unbalance_mass_kg = 0.045: ")
    assert notes_on_input(Scene.from_tree(scene.to_tree())) == []
    del own[1]["unbalance_mass_kg"]
    assert notes_on_input(load_config(QUICKSTART, {"exciters": own})) == []


def test_each_of_two_motors_is_noted():
    scene = load_config(QUICKSTART, {"motors": [{"critical_torque_n_m": 1.0}, MOTOR]})
    left_out = "critical_slip, pole_pairs and friction_radius_m"
    assert notes_on_input(scene) == [f"{WARNING}motors.0: {left_out} not given; taken from the paper's test rig"]


def test_motors_that_cannot_turn_at_the_same_speed_are_noted():
    poles = [MOTOR | {"pole_pairs": 1}, MOTOR | {"pole_pairs": 3}]
    assert notes_on_input(load_config(QUICKSTART, {"motors": poles})) == [
        "the motors have 1 and 3 pole pairs: at one supply their synchronous speeds differ 3 times, and they cannot "
        "turn at the same speed; give both the same pole_pairs"
    ]


def test_rotors_do_not_grow_with_motors_that_a_study_varies():
    find = {"key": "motor.critical_torque_n_m", "start": 1.0, "stop": 4.0}
    (note,) = notes_on_plan(Scene(find=find), "find")
    assert note.startswith("motor.critical_torque_n_m varies, but machine.rotor_inertia_kg_m2 stays 0.0008 kg·m²")
    assert notes_on_plan(Scene(find=find), "sweep") == []
    assert notes_on_plan(Scene(find=find | {"key": "machine.platform_mass_kg"}), "find") == []
    tolerances = {"parameter_tolerances": {"motor.critical_torque_n_m": 0.05}}
    assert notes_on_plan(Scene(design=tolerances), "design") == []
    both = {"keys": {"motor.critical_torque_n_m": [1.0, 2.0], "machine.rotor_inertia_kg_m2": [1e-4, 1e-3]}}
    assert notes_on_plan(Scene(design=both), "design") == []


def test_keys_that_a_study_does_not_read_are_told():
    plan = {"supply_frequency_hz": {"start": 40.0, "stop": 50.0}}
    assert notes_on_plan(Scene(run={"seed": 7}, sweep=plan), "sweep") == [
        f"{WARNING}run.seed = 7 has no effect on sweep: sweep.seed = 0 counts"
    ]
    assert notes_on_plan(Scene(sweep=plan | {"perturbation": 0.0, "seed": 3}), "sweep") == [
        f"{WARNING}sweep.seed has no effect: sweep.perturbation is 0, so nothing is random"
    ]
    orbits = {"key": "material.damping_ratio", "start": 0.1, "stop": 0.5}
    assert notes_on_plan(Scene(run={"seed": 7}, orbits=orbits), "orbits") == [
        f"{WARNING}no effect of material.damping_ratio: there is no material, as its mass is 0"
    ]
    loaded = orbits | {"grid": {"material.mass_ratio": [0.0, 0.2]}}
    assert notes_on_plan(Scene(orbits=loaded, sweep=plan), "orbits") == []


def test_keys_that_are_given_in_vain_are_told():
    two = {"mass_ratio": 0.2, "natural_frequency_hz": 22.0}
    bare = "there is no material, as its mass is 0"
    for given, told in (
        ({"run": {"seed": 3, "perturbation": 0.0}}, ["run.seed: nothing is random, as nothing disturbs the start"]),
        ({"run": {"seed": 3}}, []),
        (
            {"material": {"natural_frequency_hz": 22.0}, "contact": {"restitution": 0.3}},
            [f"contact.restitution, material.natural_frequency_hz: {bare}"],
        ),
        ({"material": {"mass_ratio": 0.0, "natural_frequency_hz": 22.0}}, []),
        ({"material": two, "contact": {"restitution": 0.3}}, []),
        ({"material": two | {"layers": 1}}, ["material.natural_frequency_hz: material.layers is 1"]),
        (
            {"material": two, "contact": {"added_mass_share": 0.2}},
            ["contact.added_mass_share: contact.model is impact"],
        ),
        (
            {"material": {"mass_ratio": 0.2, "layers": 1}, "contact": {"model": "non-impact", "restitution": 0.3}},
            ["contact.restitution, material.layers: contact.model is non-impact"],
        ),
    ):
        notes = notes_on_input(Scene().replace(given))
        begin = HINT if any("layers is" in text or "model is" in text for text in told) else WARNING
        assert [note for note in notes if "no effect" in note] == [f"{begin}no effect of {text}" for text in told]


def test_keys_that_a_command_does_not_read_are_told():
    keys = ["run.duration_s", "output.sample_rate_hz", "sweep.seed", "run.seed", "output.points", "basins.seed"]
    told = {
        "run": ["sweep.seed", "basins.seed"],
        "inspect": ["output.sample_rate_hz", "sweep.seed", "run.seed", "basins.seed"],
        "sweep": ["run.duration_s", "output.sample_rate_hz", "basins.seed"],
        "find": ["run.duration_s", "output.sample_rate_hz", "sweep.seed", "basins.seed"],
        "basins": ["run.duration_s", "output.sample_rate_hz", "sweep.seed"],
    }
    for command, vain in told.items():
        assert set_in_vain(keys, command) == [f"{WARNING}no effect of {key} on {command}" for key in vain]


def test_a_key_that_some_points_of_a_study_read_has_an_effect():
    """Material is on some of them."""
    for section in (
        {"supply_frequency_hz": {"start": 50.0, "stop": 51.0}, "grid": {"material.mass_ratio": [0.0, 0.2]}},
        {"over": {"key": "material.mass_ratio", "values": [0.0, 0.2]}, "grid": {}},
    ):
        study = SweepStudy(load_config(QUICKSTART, {"sweep": section, "contact.restitution": 0.8}))
        assert [note for note in study.input_notes() if "no effect" in note] == []
    bare = {"material.mass_ratio": 0.0, "orbits": {"key": "contact.restitution", "start": 0.0, "stop": 0.5}}
    (note,) = notes_on_plan(load_config(QUICKSTART, bare), "orbits")
    assert note == f"{WARNING}no effect of contact.restitution: there is no material, as its mass is 0"


def test_keys_that_are_set_are_told_where_a_study_varies_them_or_a_bare_platform_is_meant():
    setting = {"drive.supply_frequency_hz": 50.0, "material.stiffness_n_per_m": 9.0, "material.mass_ratio": 0.0}
    scene = load_config(QUICKSTART, setting | {"contact.restitution": 0.0})
    bare = f"{WARNING}no effect of contact.restitution, material.stiffness_n_per_m: there is no material, as "
    assert [note for note in notes_on_input(scene) if "restitution" in note] == [f"{bare}its mass is 0"]
    for kind, section, varied in (
        ("sweep", {"supply_frequency_hz": {"start": 50.0, "stop": 51.0}, "grid": {}}, ["drive.supply_frequency_hz"]),
        ("find", {"key": "drive.supply_frequency_hz", "start": 50.0, "stop": 51.0}, ["drive.supply_frequency_hz"]),
        ("find", {"key": "drive.supply_frequency_hz", "start": 50.0, "stop": 51.0, "from": "previous"}, []),
        ("orbits", {"key": "material.natural_frequency_hz", "start": 9.0, "stop": 8.0}, ["material.stiffness_n_per_m"]),
        ("basins", {"initial_conditions": {"phi1_rad": [0.0, 1.0]}}, []),
    ):
        notes = notes_on_plan(scene.replace({kind: section, "material.mass_ratio": 0.1}), kind)
        end = "; starts only get other random numbers" * (kind == "find")
        assert notes == [
            f"{WARNING}no effect of {key} on {kind}, which gives it values of its own{end}" for key in varied
        ]


def test_keys_that_are_set_and_that_a_study_does_not_read_with_other_keys_are_told():
    scene = load_config(QUICKSTART, {"design.starts": 4, "sweep.grid": {}, "solver.tolerance": 1e-5, "run.seed": 2})
    design = scene.replace({"design.minimize": None, "design.seed": 0})
    assert notes_on_plan(design, "design") == [
        f"{WARNING}no effect of sweep.grid on design",
        f"{WARNING}run.seed = 2 has no effect on design: design.seed = 0 counts",
        f"{WARNING}no effect of design.starts: design.minimize is not given",
    ]
    orbits = {"key": "contact.restitution", "start": 0.1, "stop": 0.5}
    assert notes_on_plan(scene.replace({"orbits": orbits, "run.perturbation": 0.0}), "orbits")[2:] == [
        f"{WARNING}no effect of solver.tolerance: orbits.tolerance = 1e-08 asks for less",
        f"{WARNING}no effect of run.seed: nothing is random, as nothing disturbs the start",
    ]
