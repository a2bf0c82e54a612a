"""Files and settings: what is read, how files lie over each other, and what hostile files cannot do."""

import os
import signal
import socket

import pytest
from common.limits import cpu_seconds
from common.places import ROOT

from vibroplat import Contact, Drive, Exciter, Initial, Material, Motor, Scene, load_config
from vibroplat.config.plausibility import HINT, notes_on_input, notes_on_inputs
from vibroplat.config.reader import load_tree, parse_overrides
from vibroplat.study.sweep import SweepStudy

# -- what is read ---------------------------------------------------------------------------------------


def test_empty_file_is_all_defaults(scene_of):
    for text in ("", "# only a comment\n", "---\n", "{}"):
        assert scene_of(text) == Scene(name="c")


def test_name_is_that_given_or_the_stem_of_the_file(here, scene_of):
    (here / "f25.75-R0.3.yaml").write_text("")
    assert load_config("f25.75-R0.3.yaml").name == "f25.75-R0.3"
    assert scene_of("name: given").name == "given"
    assert scene_of("name: Förderer-2").name == "Förderer-2"
    assert scene_of("name: given", {"name": "set"}).name == "set"
    # anchors may be reused (YAML 1.2, section 3.2.2.2), and no warning may reach the user's terminal
    assert scene_of("motor: &m {pole_pairs: &m 2}\n").motor.pole_pairs == 2


#: What is told of machines, whose files say how material is that others put on them.
BARE = "there is no material, as its mass is 0"
#: Said of a conveyor that another laboratory built so: its start is short, and its springs hardly damp.
RINGS = "free vibrations decay by e in 14.8 s"


@pytest.mark.parametrize("room", ["", "machines", "templates", "paper", "examples"])
def test_shipped_configurations_load_and_those_of_machines_are_usual(room):
    scenes = [load_config(file) for file in sorted((ROOT / "configs" / room).glob("*.yaml"))]
    assert scenes
    for scene in scenes if room != "examples" else ():
        notes = notes_on_input(scene)
        notes += notes_on_inputs(SweepStudy(scene).scenes()) if scene.sweep is not None else []
        known = (BARE, RINGS) if room == "machines" else ()
        assert [note for note in notes if not note.startswith(HINT) and not any(one in note for one in known)] == []


def test_numbers_of_yaml_are_numbers(scene_of, complaint):
    for text, value in (("580e3", 580e3), ("1.E+2", 100.0), (".5", 0.5), ("0x10", 16.0), ("0o10", 8.0)):
        assert scene_of(f"machine: {{gravity_m_per_s2: {text}}}").machine.gravity_m_per_s2 == value
    for text, meant in (("yes", ""), ("1:30", ""), ("'5'", ", as 5"), ("5 kg", " in Hz, not in kg")):
        assert complaint(f"drive:\n  supply_frequency_hz: {text}\n").endswith(f"allowed: a number{meant}")


def test_settings_are_typed_as_in_yaml():
    values = {"1e-6": 1e-6, "3": 3, "true": True, "[0.0, 0.1]": [0.0, 0.1], "{x: {y: 1}}": {"x": {"y": 1}}}
    values |= {"impact": "impact", "'3'": "3", "a=b": "a=b", "yes": "yes", "": None, "null": None}
    found = {text: parse_overrides([f"a.b={text}"])["a.b"] for text in values}
    assert found == values
    assert [type(value) for value in found.values()] == [type(value) for value in values.values()]
    assert parse_overrides(["a=1", "b.c=2", "a=3"]) == {"a": 3, "b.c": 2}


# -- how files lie over each other ------------------------------------------------------------------------


def test_extends_is_relative_to_the_extending_file_and_merged_deeply(here):
    (here / "deep" / "er").mkdir(parents=True)
    (here / "deep" / "er" / "c.yaml").write_text(
        "machine: {gravity_m_per_s2: 1.0, damping_x_n_s_per_m: 1.0, damping_y_n_s_per_m: 1.0}\ndrive: {}\n"
    )
    (here / "deep" / "b.yaml").write_text(
        "extends: er/c.yaml\nmachine: {damping_x_n_s_per_m: 2.0, damping_y_n_s_per_m: 2.0}\n"
    )
    (here / "a.yaml").write_text(f"extends: {here}/deep/b.yaml\nmachine: {{damping_y_n_s_per_m: 3.0}}\n")
    machine = load_config("a.yaml").machine
    assert (machine.gravity_m_per_s2, machine.damping_x_n_s_per_m, machine.damping_y_n_s_per_m) == (1.0, 2.0, 3.0)
    assert machine.stiffness_x_n_per_m == 580e3


def chain(folder, levels):
    """Write files that extend each other, through the folder above; return the uppermost."""
    folder.mkdir()
    (folder / "0.yaml").write_text("name: lowest\ncontact: {restitution: 0.1}\n")
    for i in range(1, levels):
        (folder / f"{i}.yaml").write_text(f"extends: ../{folder.name}/{i - 1}.yaml\nmaterial: {{mass_ratio: 0.{i}}}\n")
    return folder / f"{levels - 1}.yaml"


def test_files_may_extend_many(tmp_path):
    """Their paths would become longer than a system allows."""
    found = {"contact": {"restitution": 0.1}, "material": {"mass_ratio": 0.49}}
    assert load_tree(chain(tmp_path / ("a" * 100), 50)) == found


#: A whole machine, without which motors of one's own are refused; radii and rotors are its own or the exciters'.
PLATFORM = (
    "platform_mass_kg: 12.42, platform_inertia_kg_m2: 0.11, unbalance_mass_kg: 0.045, damping_y_n_s_per_m: 7, "
    "stiffness_x_n_per_m: 580e3, stiffness_y_n_per_m: 470e3, stiffness_phi_n_m_per_rad: 1.8e3"
)
RIG = f"machine: {{{PLATFORM}, unbalance_radius_m: 0.05, rotor_inertia_kg_m2: 2e-3}}\n"
PROGRAM = "drive: {program: [{t_s: 0, supply_frequency_hz: 50}]}"
NATURAL = "material: {natural_frequency_hz: 18.5, damping_ratio: 0.05}"
#: Files, what is laid over them, and what says the same at once if that is not the upper file alone.
LAYERS = [
    (NATURAL, "material: {stiffness_n_per_m: 100}", "material: {stiffness_n_per_m: 100, damping_ratio: 0.05}"),
    ("material: {stiffness_n_per_m: 100, damping_n_s_per_m: 1}", NATURAL, ""),
    ("motor: {pole_pairs: 1}", "motors: [{}, {pole_pairs: 3}]", ""),
    ("motors: [{}, {pole_pairs: 3}]", "motor: {pole_pairs: 1}", ""),
    ("motors: [{pole_pairs: 1}, {}]", "motors: [{}, {}]", ""),
    ("drive: {supply_frequency_hz: 44}", PROGRAM, ""),
    (PROGRAM, "drive: {supply_frequency_hz: 44}", ""),
    (PROGRAM, "drive: {program: }", "drive: {}"),
]
STARTS = [
    ("phi1_rad: 1, phase_difference_rad: 2, speed_ratio: 0", "from: results/a"),
    ("state: {x_m: 0.1}", "from: results/a"),
    ("from: results/a", "speed_ratio: 0.5"),
]
SWEEP, GRID = "sweep: {supply_frequency_hz: {start: 40, stop: 50}, ", "grid: {contact.restitution: [0.0, 0.5]}"
LAYERS.append((f"{SWEEP}grid: {{material.layers: [1, 2]}}}}", f"sweep: {{{GRID}}}", f"{SWEEP}{GRID}}}"))
LAYERS += [(f"run: {{initial: {{{below}}}}}", f"run: {{initial: {{{above}}}}}", "") for below, above in STARTS]


def test_upper_file_gives_one_of_several_alternatives(here, scene_of):
    for below, above, at_once in LAYERS:
        (here / "base.yaml").write_text(RIG + below)
        scene = scene_of(f"extends: base.yaml\n{above}\n")
        assert scene == scene_of(RIG + (at_once or above))
        assert Scene.from_tree(scene.to_tree()) == scene == scene.replace()


def test_a_setting_stands_in_no_line_of_the_file(complaint):
    told = complaint("run:\n  duration_s: 2.0\n", {"run.duration_s": None})
    assert told == "c.yaml: run.duration_s = None; allowed: a number"


def test_settings_are_laid_over_the_file(scene_of):
    text = (
        "contact: {restitution: 0.5}\nmaterial: {mass_ratio: 0.1, natural_frequency_hz: 18.5}\nmotor: {pole_pairs: 1}\n"
        "drive: {program: [{t_s: 0, supply_frequency_hz: 50}, {t_s: 1, supply_frequency_hz: 60}]}"
    )
    settings = [
        "contact={impact_law: central}",
        "material.stiffness_n_per_m=200",
        "motors=[{}, {pole_pairs: 3}]",
        "run.initial.state.x_m=0.1",
        "drive.program.1.t_s=2",
        "drive.program.0.exciter_2=off",
    ]
    scene = scene_of(text, parse_overrides(settings))
    assert scene.contact == Contact(restitution=0.5, impact_law="central")
    assert scene.material == Material(mass_ratio=0.1, stiffness_n_per_m=200.0)
    assert scene.motors == [Motor(), Motor(pole_pairs=3)]
    assert scene.run.initial == Initial(state={"x_m": 0.1})
    entries = [{"t_s": 0, "supply_frequency_hz": 50, "exciter_2": "off"}, {"t_s": 2, "supply_frequency_hz": 60}]
    assert scene.drive == Drive(program=entries)


#: A machine, given by each kind of keys.
BELOW = {
    "motor": f"{RIG}motor: {{critical_slip: 0.3, pole_pairs: 3}}\n",
    "motors": f"{RIG}motors: [{{critical_slip: 0.3}}, {{pole_pairs: 3}}]\n",
    "exciters": f"machine: {{{PLATFORM}}}\n"
    "exciters: [{unbalance_radius_m: 0.05}, {pole_pairs: 3, unbalance_radius_m: 0.09}]\n",
    "nothing": f"machine: {{{PLATFORM}, unbalance_radius_m: 0.09}}\n",
}


@pytest.mark.parametrize("kind", BELOW)
def test_exciters_are_overridden_one_by_one(kind, here, scene_of):
    (here / "base.yaml").write_text(BELOW[kind])
    below = load_config("base.yaml")

    def differing(first, second):
        return tuple(e.model_copy(update=c) for e, c in zip(below.exciter_pair, (first, second), strict=True))

    assert scene_of("extends: base.yaml\nexciters: [{}, {}]\n").exciter_pair == below.exciter_pair
    scene = scene_of("extends: base.yaml\nexciters: [{}, {unbalance_radius_m: 0.06, rotation: counter-clockwise}]\n")
    assert scene.exciter_pair == differing({}, {"unbalance_radius_m": 0.06, "rotation": "counter-clockwise"})
    assert scene.machine.damping_y_n_s_per_m == 7.0
    assert scene.motor is scene.motors is None
    settings = parse_overrides(["exciters.1.unbalance_radius_m=0.06", "exciters.0.critical_slip=0.4"])
    set_ = load_config("base.yaml", settings)
    assert set_.exciter_pair == differing({"critical_slip": 0.4}, {"unbalance_radius_m": 0.06})
    for changed in (
        below.replace({"exciters.1.rotor_inertia_kg_m2": 3e-3}),
        below.replace(exciters=[{}, {"rotor_inertia_kg_m2": 3e-3}]),
        below.replace(exciters=[Exciter(), Exciter(rotor_inertia_kg_m2=3e-3)]),
    ):
        assert changed.exciter_pair == differing({}, {"rotor_inertia_kg_m2": 3e-3})
    for scene in (below, set_):
        again = Scene.from_tree(scene.to_tree())
        assert (again, again.to_tree()) == (scene, scene.to_tree())


# -- hostile files end in one line, soon ------------------------------------------------------------------

SECRET = "hunter2"


@pytest.mark.parametrize(
    "text",
    [
        f"root:{SECRET}:19000:0:99999:7:::\ndaemon:*:19000::::::\n",
        f"drive: {{'{SECRET}!': 1}}\n",
        f"!!bool {SECRET}",
        f"%{SECRET}\n",
        f"a: 1\na: {SECRET}\n",
        f"a: [{SECRET}\nb: {SECRET}\n",
    ],
)
def test_contents_of_a_file_that_is_no_configuration_are_not_quoted(text, here, complaint):
    """``extends: /etc/shadow`` says what is wrong there and in which line, not what is written there."""
    (here / "secrets").write_text(text)
    told = complaint("extends: secrets\n")
    assert told.startswith("secrets: ")
    assert SECRET not in told


@pytest.mark.parametrize("file", ["fifo", "/dev/zero", "socket"])
def test_file_that_may_never_end_is_not_read(file, here, complaint):
    os.mkfifo("fifo")
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind("socket")
        signal.alarm(10)  # which would end the tests
        assert complaint(f"extends: {file}\n") == f"c.yaml: extends = '{file}': not a file"
        signal.alarm(0)


ALIASES = "a0: &a0 [x, x]\n" + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 12))
MERGES = "a0: &a0 {x0: 1}\n" + "".join(
    f"a{i}: &a{i} {{<<: [{', '.join([f'*a{i - 1}'] * 10)}], x{i}: 2}}\n" for i in range(1, 12)
)
VALUES, BYTES, DEEP = (
    "more than 5000 values; not a configuration",
    "larger than 25000 bytes; not a configuration",
    "nested too deeply",
)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        pytest.param(ALIASES, VALUES, id="alias bomb"),
        pytest.param(MERGES, VALUES, id="merge bomb"),
        pytest.param("a: [" + "1," * 12_000 + "]", VALUES, id="wide list", marks=pytest.mark.long),
        pytest.param("a: &a [*a]", VALUES, id="list inside itself"),
        pytest.param("a: &a {<<: *a}", VALUES, id="section merged into itself"),
        pytest.param("[" * 5000 + "]" * 5000, DEEP, id="nested lists", marks=pytest.mark.long),
        pytest.param("- " * 5000 + "1", DEEP, id="nested block lists"),
        pytest.param("".join(" " * i + "a:\n" for i in range(220)), "unknown key a; ", id="stairs"),
        pytest.param("#" * 25_001, BYTES, id="long comment"),
    ],
)
def test_hostile_file_is_refused_soon(text, line, complaint):
    with cpu_seconds(5.0):
        assert complaint(text).startswith(f"c.yaml: {line}")


def test_short_names_of_initial_conditions_are_whole_ones_and_both_ways_have_one_word(scene_of):
    plans = [
        f"basins: {{initial_conditions: {{{beginning}speed_ratio: [0, 1], {beginning}state.y_m: [0, 1e-3]}}}}"
        for beginning in ("", "initial.", "run.initial.")
    ]
    assert len({scene_of(plan).basins.model_dump_json() for plan in plans}) == 1
    assert [*scene_of(plans[0]).basins.initial_conditions] == ["run.initial.speed_ratio", "run.initial.state.y_m"]
    ways = scene_of("sweep: {supply_frequency_hz: {start: 50, stop: 51, direction: both}}").sweep.swept.direction
    assert ways == ["up", "down"]
