"""Files and settings: what is read, how files lie over each other, and what hostile files cannot do."""

import pytest
from common.limits import cpu_seconds
from common.places import QUICKSTART, ROOT

from vibroplat import Contact, Drive, Exciter, Initial, Material, Motor, Scene, load_config
from vibroplat.config.drive import FREQUENCY
from vibroplat.config.plausibility import notes_on_input, notes_on_inputs
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
    assert scene_of("name: given", {"name": "set"}).name == "set"


@pytest.mark.parametrize("room", ["", "machines", "templates", "paper", "examples"])
def test_shipped_configurations_load_and_those_of_machines_are_usual(room):
    scenes = [load_config(file) for file in sorted((ROOT / "configs" / room).glob("*.yaml"))]
    assert scenes
    for scene in scenes if room != "examples" else ():
        assert notes_on_input(scene) == []
        assert scene.sweep is None or notes_on_inputs(SweepStudy(scene).scenes()) == []


def test_numbers_of_yaml_are_numbers(scene_of, complaint):
    for text, value in (("580e3", 580e3), ("1.E+2", 100.0), (".5", 0.5), ("0x10", 16.0), ("0o10", 8.0)):
        assert scene_of(f"machine: {{platform_mass_kg: {text}}}").machine.platform_mass_kg == value
    for text in ("yes", "1:30", "'5'", "5 kg"):
        assert complaint(f"drive:\n  supply_frequency_hz: {text}\n").endswith("allowed: a number")


def test_anchors_may_be_reused(scene_of):
    """YAML 1.2, section 3.2.2.2; no warning may reach the user's terminal."""
    scene_of("motor: &m {pole_pairs: &m 2}\n")


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


@pytest.mark.long
def test_files_that_extend_each_other_take_time_in_proportion_to_their_number(tmp_path):
    top = chain(tmp_path / "many", 2000)
    with cpu_seconds(4.0):  # 1.4 s
        assert load_tree(top)["material"] == {"mass_ratio": 0.1999}


START = "[{t_s: 0, supply_frequency_hz: 50}]"
ONE_ENTRY = Drive(program=[{"t_s": 0, "supply_frequency_hz": 50}])


@pytest.mark.parametrize(
    ("below", "above", "expected"),
    [
        (
            "material: {natural_frequency_hz: 18.5, damping_ratio: 0.05}",
            "material: {stiffness_n_per_m: 100}",
            {"material": Material(stiffness_n_per_m=100.0, damping_ratio=0.05)},
        ),
        (
            "material: {stiffness_n_per_m: 100, damping_n_s_per_m: 1}",
            "material: {natural_frequency_hz: 18.5, damping_ratio: 0.05}",
            {"material": Material(natural_frequency_hz=18.5, damping_ratio=0.05)},
        ),
        (
            "motor: {pole_pairs: 1}",
            "motors: [{}, {pole_pairs: 3}]",
            {"motor": None, "motors": [Motor(), Motor(pole_pairs=3)]},
        ),
        ("motors: [{}, {pole_pairs: 3}]", "motor: {pole_pairs: 1}", {"motor": Motor(pole_pairs=1), "motors": None}),
        ("motors: [{pole_pairs: 1}, {}]", "motors: [{}, {}]", {"motors": [Motor(), Motor()]}),
        ("drive: {supply_frequency_hz: 44}", f"drive: {{program: {START}}}", {"drive": ONE_ENTRY}),
        (f"drive: {{program: {START}}}", "drive: {supply_frequency_hz: 44}", {"drive": Drive(supply_frequency_hz=44)}),
        (f"drive: {{program: {START}}}", "drive: {program: }", {"drive": Drive(supply_frequency_hz=FREQUENCY)}),
    ],
)
def test_upper_file_gives_one_of_two_alternatives(below, above, expected, here, scene_of):
    (here / "base.yaml").write_text(below)
    scene = scene_of(f"extends: base.yaml\n{above}\n")
    assert {key: getattr(scene, key) for key in expected} == expected


@pytest.mark.parametrize(
    ("below", "above"),
    [
        ("phi1_rad: 1, phase_sum_rad: 2, speed_ratio: 0", "from: results/a"),
        ("state: {x_m: 0.1}", "from: results/a"),
        ("from: results/a", "speed_ratio: 0.5"),
        ("phase_sum_rad: 1", "phase_difference_rad: 2"),
        ("phase_difference_rad: 1", "phase_sum_rad: 2"),
    ],
)
def test_ways_to_begin_replace_each_other(below, above, here, scene_of):
    (here / "base.yaml").write_text(f"run: {{duration_s: 2, initial: {{{below}}}}}")
    scene = scene_of(f"extends: base.yaml\nrun: {{initial: {{{above}}}}}")
    assert scene.run.initial == scene_of(f"run: {{initial: {{{above}}}}}").run.initial
    assert scene.run.duration_s == 2.0
    assert Scene.from_tree(scene.to_tree()) == scene == scene.replace()


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


def test_grid_of_a_sweep_is_replaced_as_a_whole(here):
    frequencies = "supply_frequency_hz: {start: 40.0, stop: 50.0}"
    (here / "base.yaml").write_text(f"sweep: {{{frequencies}, grid: {{material.layers: [1, 2]}}}}\n")
    (here / "c.yaml").write_text(
        "extends: base.yaml\nsweep: {grid: {contact.restitution: [0.0, 0.5]}, measure_s: 1.0}\n"
    )
    scene = load_config("c.yaml")
    assert scene.sweep.grid == {"contact.restitution": [0.0, 0.5]}
    assert scene.sweep.supply_frequency_hz.stop == 50.0
    assert scene.replace({"sweep.grid": {}}).sweep.grid == {}


#: A machine, given by each kind of keys.
MACHINE = "machine: {unbalance_radius_m: 0.05, rotor_inertia_kg_m2: 2e-3, damping_y_n_s_per_m: 7}\n"
BELOW = {
    "motor": f"{MACHINE}motor: {{critical_slip: 0.3, pole_pairs: 3}}\n",
    "motors": f"{MACHINE}motors: [{{critical_slip: 0.3}}, {{pole_pairs: 3}}]\n",
    "exciters": "machine: {damping_y_n_s_per_m: 7}\nexciters: [{unbalance_radius_m: 0.05}, {pole_pairs: 3}]\n",
    "nothing": "machine: {damping_y_n_s_per_m: 7}\n",
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
        SECRET,
        f"'{SECRET}",
        f"!{SECRET} x",
        f"!!bool {SECRET}",
        f"%{SECRET}\n",
        f"a: 1\na: {SECRET}\n",
        f"extends: [{SECRET}]\n",
        f"a: [{SECRET}\nb: {SECRET}\n",
    ],
)
def test_contents_of_a_file_that_is_no_configuration_are_not_quoted(text, here, complaint):
    """``extends: /etc/shadow`` says what is wrong there and in which line, not what is written there."""
    (here / "secrets").write_text(text)
    told = complaint("extends: secrets\n")
    assert told.startswith("secrets: ")
    assert SECRET not in told


ALIASES = "a0: &a0 [x, x]\n" + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 12))
MERGES = "a0: &a0 {x0: 1}\n" + "".join(
    f"a{i}: &a{i} {{<<: [{', '.join([f'*a{i - 1}'] * 10)}], x{i}: 2}}\n" for i in range(1, 12)
)
VALUES, BRACKETS, BYTES, DEEP = (
    "more than 5000 values; not a configuration",
    "more than 200 brackets; not a configuration",
    "larger than 25000 bytes; not a configuration",
    "nested too deeply",
)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        pytest.param(ALIASES, VALUES, id="alias bomb"),
        pytest.param(MERGES, VALUES, id="merge bomb"),
        pytest.param("a: [" + "1," * 12_000 + "]", VALUES, id="wide list"),
        pytest.param("a: &a [*a]", VALUES, id="list inside itself"),
        pytest.param("a: &a {<<: *a}", VALUES, id="section merged into itself"),
        pytest.param("[" * 5000 + "]" * 5000, BRACKETS, id="nested lists"),
        pytest.param("- " * 5000 + "1", DEEP, id="nested block lists"),
        pytest.param("".join(" " * i + "a:\n" for i in range(220)), "unknown key a; ", id="stairs"),
        pytest.param("#" * 25_001, BYTES, id="long comment"),
    ],
)
def test_hostile_file_is_refused_in_a_second(text, line, complaint):
    with cpu_seconds(1.0):
        assert complaint(text).startswith(f"c.yaml: {line}")


def test_odd_file_is_refused_in_one_short_printable_line(complaint):
    for text in (
        '"a\\nb": 1',
        '"a\\x1b[31mb": 1',
        'extends: "a\\nb"',
        f"? {'k' * 2000}\n: 1",
        f"extends: {'k' * 2000}",
        'extends: "a\\0b"',
        "%YAML 1.3\n---\nname: a\n",
        "name: 0x" + "f" * 5000,  # read without end, but not written by Python, of more than 4300 decimal digits
    ):
        line = complaint(text)
        assert line.isprintable()
        assert len(line) < 500


@pytest.mark.parametrize("files", [50, pytest.param(3000, marks=pytest.mark.long)])
def test_long_chain_of_files_is_read_or_refused(files, here, complaint):
    """Each file lies over the next: far more than anybody has."""
    for k in range(files):
        (here / f"{k}.yaml").write_text(f"extends: {k + 1}.yaml\n")
    (here / f"{files}.yaml").write_text(f"extends: {QUICKSTART}\nrun: {{duration_s: -1}}\n")
    with cpu_seconds(5.0):
        assert len(complaint("extends: 0.yaml")) < 500
