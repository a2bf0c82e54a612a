"""What a user reads when a configuration is not accepted: each kind of mistake once, word by word.

Types, ranges and defaults of all keys are in results/configuration.md, which is compared elsewhere.
"""

import ast
import re
from pathlib import Path

import pytest

import vibroplat
from vibroplat import Scene, load_config
from vibroplat.config.drive import MAX_ENTRIES
from vibroplat.config.keys import in_lists
from vibroplat.config.reader import parse_overrides
from vibroplat.config.schema import nodes
from vibroplat.errors import ConfigError

SECTIONS = ", ".join(Scene.model_fields)
MOTOR = (
    "critical_torque_n_m, critical_slip, rated_power_w, rated_speed_rpm, breakdown_ratio, pole_pairs, "
    "friction_radius_m, rated_frequency_hz"
)
EXCITER = (
    f"{MOTOR}, unbalance_mass_kg, unbalance_radius_m, static_moment_kg_m, position_m, rotor_inertia_kg_m2, "
    "mounted_on, rotation"
)
PLATE = "rated_power_w: 1500, breakdown_ratio: 2.6, rated_frequency_hz: 50"
INITIAL = "phase_difference_rad, phi1_rad, speed_ratio, state, from"
NAME = "letters, digits and . _ + -, starting with a letter or digit"
SECTION = "a section of keys and values"
THIN = "material: {mass_ratio: 0.2, layers: 1}\n"
START = "t_s: 0, supply_frequency_hz: 50"
GRID = "sweep: {supply_frequency_hz: {start: 40, stop: 50}, grid: "


def program(*entries):
    """Text of a configuration with these entries."""
    return f"drive: {{program: [{', '.join(f'{{{entry}}}' for entry in entries)}]}}"


def both(first, second):
    """What is told of two keys that say the same."""
    return f"{first} and {second} are both given; allowed: one of the two"


MESSAGES = {
    "unknown keys": {
        "machin: {}": f"unknown key machin in line 1; did you mean machine? allowed: {SECTIONS}",
        "drive.supply_frequency_hz: 50": f"unknown key drive.supply_frequency_hz; allowed: {SECTIONS}",
        "run: {initial: {phi1: 0}}": "unknown key run.initial.phi1 in line 1; did you mean phi1_rad? "
        f"allowed: {INITIAL}",
        "exciters: [{}, {zzz: 1}]": f"unknown key exciters.1.zzz in line 1; allowed: {EXCITER}",
        "name: a\nplatform_mass_kg: 12": "unknown key platform_mass_kg in line 2; did you mean "
        f"machine.platform_mass_kg? allowed: {SECTIONS}",
        "# machine:\nname: a\nmachine:": f"machine = None in line 3; allowed: {SECTION}",
    },
    "types": {
        "drive: {supply_frequency_hz: fast}": "drive.supply_frequency_hz = 'fast'; allowed: a number",
        "machine: {platform_mass_kg: 1'168.5}": 'machine.platform_mass_kg = "1\'168.5"; allowed: a number, as 1168.5',
        "name: 12": 'name = 12; allowed: text, as "12" in quotation marks',
        "machine: {platform_mass_kg: 2024-05-03}": "machine.platform_mass_kg = '2024-05-03'; allowed: a number",
        "find: {from: neighbour, key: x, start: 0, stop: 1, compare: regime}": "find.from = 'neighbour'; "
        "allowed: 'initial' or 'previous'",
        f"contact: {{restitution: {'x' * 5000}}}": f"contact.restitution = '{'x' * 56}...; allowed: a number",
        "motor: {pole_pairs: 2.5}": "motor.pole_pairs = 2.5; allowed: a whole number",
        "material: {layers: true}": "material.layers = True; allowed: 1 or 2",
        "contact: {model: Impact}": "contact.model = 'Impact'; allowed: 'impact' or 'non-impact'",
        program(f"{START}, off: off"): "drive.program.0.off = 'off'; allowed: true or false",
        program("off: true"): "drive.program.0.t_s is missing; allowed: a value",
        "motors: {a: 1}": "motors = {'a': 1}; allowed: a list",
        "motors: [{}]": "motors = [{}]; allowed: entries, at least 2",
    },
    "ranges": {
        "contact: {restitution: 1.2}": "contact.restitution = 1.2; allowed: at most 1.0",
        "run: {duration_s: 0}": "run.duration_s = 0; allowed: more than 0.0",
        "machine: {platform_mass_kg: .nan}": "machine.platform_mass_kg = nan; allowed: a finite number",
        "machine: {platform_mass_kg: 1e31}": "machine.platform_mass_kg = 1e+31; allowed: at most 1e+30",
        f"motor: {{pole_pairs: 1{'0' * 400}}}": f"motor.pole_pairs = 1{'0' * 56}...; allowed: at most 1000",
        program(START, "t_s: 1, supply_frequency_hz: 5e-4"): "drive.program.1: supply_frequency_hz = 0.0005; "
        "allowed: 0, or at least 0.001",
        program(START, "t_s: 1", "t_s: 1.0000000000000002"): "drive: program.2.t_s = 1.0000000000000002 is 2.2e-16 s "
        "after 1.0; allowed: the same time, for a jump, or at least 1e-06 s later",
        "solver: {tolerance: 1e-13}": "solver: tolerance = 1e-13 with engine auto; allowed: at least 1e-12, or 1e-14 "
        "with engine taylor",
        "drive: {supply_frequency_hz: 1e12}\nmotor: {pole_pairs: 4}": "run.duration_s = 4.0 takes 1e+12 turns at the "
        "synchronous speed; allowed: at most 1e+09",
        f"{GRID}{{contact.restitution: [.nan]}}}}": "sweep.grid: contact.restitution = [nan]; "
        "allowed: numbers up to 1e+30",
        "name: ../up": f"name = '../up'; allowed: {NAME}, as name: up",
        'name: "a\\nb"': f"name = 'a\\nb'; allowed: {NAME}, as name: a-b",
        "output: {points: {two words: [0, 0]}}": "output.points.two words.[key] = 'two words'; allowed: at most 40 "
        "letters of English, digits and _, starting with a letter, as two_words",
        "output: {points: {Förderer: [0, 0]}}": "output.points.Förderer.[key] = 'Förderer'; allowed: at most 40 "
        "letters of English, digits and _, starting with a letter, as Foerderer",
        f"output: {{points: {{{'a' * 41}: [0, 0]}}}}": f"output.points.{'a' * 41}.[key] = '{'a' * 41}'; allowed: at "
        f"most 40 letters of English, digits and _, starting with a letter, as {'a' * 40}",
        "output: {points: {питатель: [0, 0]}}": "output.points.питатель.[key] = 'питатель'; allowed: at most 40 "
        "letters of English, digits and _, starting with a letter",
        "design: {parameter_tolerances: {machine.platform_mass_kg: 5}}": "design.parameter_tolerances."
        "machine.platform_mass_kg = 5; allowed: at most 1.0; 5 % is 0.05",
        "name: ''": "name = ''; allowed: at least 1 character",
        f"name: {'a' * 101}": f"name = '{'a' * 56}...; allowed: at most 100 characters",
        "contact: {restitution: 1.2}\nzz: 1\nrun: {seed: -1}": "contact.restitution = 1.2; allowed: at most 1.0 "
        "(and 2 more)",
    },
    "keys that exclude each other": {
        "material: {natural_frequency_hz: 18.5, stiffness_n_per_m: 100}": "material: "
        + both("natural_frequency_hz", "stiffness_n_per_m"),
        "motor: {}\nmotors: [{}, {}]": both("motor", "motors"),
        "exciters: [{}, {}]\nmachine: {unbalance_radius_m: 0.1}": both("exciters", "machine.unbalance_radius_m"),
        "exciters: [{unbalance_radius_m: 0.1, static_moment_kg_m: 1}, {}]": "exciters.0: "
        + both("unbalance_radius_m", "static_moment_kg_m"),
        f"motor: {{{PLATE}, rated_speed_rpm: 1425, critical_slip: 0.1}}": "motor: "
        + both("rated_power_w", "critical_slip"),
        "run: {initial: {state: {y_m: 0}, phi1_rad: 0}}": "run.initial: " + both("state", "phi1_rad"),
        program(f"{START}, exciter_1: off, off: true"): "drive.program.0: " + both("off", "exciter_1"),
    },
    "values that do not go together": {
        f"motor: {{{PLATE[PLATE.index(',') + 2 :]}, rated_speed_rpm: 1425, critical_slip: 0.1}}": "motor: "
        "critical_torque_n_m or critical_slip is given over a nameplate, which has both; allowed: another "
        "rated_power_w or breakdown_ratio, or both of them with rated_speed_rpm and breakdown_ratio = null",
        f"motor: {{{PLATE}}}": "motor: rated_power_w is given without rated_speed_rpm; allowed: rated_power_w, "
        "rated_speed_rpm, breakdown_ratio together with rated_frequency_hz, or none of them",
        f"motor: {{{PLATE}, rated_speed_rpm: 1500}}": "motor: rated_speed_rpm = 1500; allowed: less than the "
        "synchronous speed, 1500",
        "material: {mass_ratio: 0.2, lower_share: 1, natural_frequency_hz: 18.5}": "material: lower_share = 1 leaves "
        "no upper layer; allowed with layers = 2: more than 0, less than 1",
        "material: {mass_ratio: 0.2, layers: 2}": "material: two layers need a spring between them; give "
        "natural_frequency_hz or stiffness_n_per_m",
        f"{THIN}run: {{initial: {{state: {{gap_rate_m_per_s: -0.1}}}}}}": "run.initial.state.gap_rate_m_per_s = -0.1 "
        "closes a gap that is 0; allowed: at least 0 while gap_m is 0",
        "run: {initial: {state: {gap_m: 0.1}}}": "run.initial.state.gap_m = 0.1 but this scene has no such coordinate; "
        "allowed: leave it out",
    },
    "programs": {
        program(): "drive: program is empty; allowed: one entry or more",
        program(START, "t_s: 2", "t_s: 1"): "drive: program.2.t_s = 1.0 lies before 2.0; allowed: times in ascending "
        "order",
        program(
            START, "t_s: 2", "t_s: 2", "t_s: 2"
        ): "drive: program.3.t_s = 2.0 is given three times; allowed: twice, for a jump",
        program("t_s: 0", START): "drive: program.0: supply_frequency_hz is required in the first entry",
        program("t_s: 0, supply_frequency_hz: 0"): "drive: program has no supply_frequency_hz above 0; allowed: at "
        "least one, the scales follow it",
        "drive: {supply_frequency_hz: }": "drive: supply_frequency_hz = None; allowed: a number, or a program instead",
        f"{GRID}{{drive.program.1.t_s: [2]}}}}": "sweep: grid.drive.program.1.t_s cannot be swept by the grid; "
        "allowed: keys of machine, material, …",
    },
    "files": {
        "- 1\n- 2\n": "holds a list; allowed: keys and values",
        "machine": "holds text; allowed: keys and values",
        "machine:\n  platform_mass_kg: 1_000\n": "1_000 in line 2; allowed: 1000",
        "machine: {1: 2}": "not valid YAML: a key is not text",
        "drive:\n  supply_frequency_hz: 51,5": "a decimal comma in line 2; allowed: a point, as in 51.5",
        "drive:\n  a$b: 1\n": "the key in line 2 is no name; allowed: letters, digits and _ . -",
        "drive: {}\nrun: {}\ndrive: {}\n": 'duplicate key "drive" in line 3; allowed: each key once',
        "a: [1\n": "not valid YAML in line 2, column 1: expected ',' or ']', but got '<stream end>'",
        "a: 1\n---\nb: 2\n": "not valid YAML in line 2, column 1: but found another document",
        "a: \x01\n": "not valid YAML: unacceptable character #x0001: special characters are not allowed in "
        '"<unicode string>", position 3',
        b"name: a # \xe9\n": "not UTF-8 text",
        "name: !!python/object/apply:os.system ['touch executed']": "not valid YAML in line 1, column 7: could not "
        "determine a constructor for the tag …",
        "extends: 3": "extends is not text; allowed: a file name",
        "extends: c.yaml": "extends itself through c.yaml",
        "extends: a.yaml": "extends = 'a.yaml': no such file",
        "extends: .": "extends = '.': cannot be read (Is a directory)",
    },
}


@pytest.mark.parametrize("kind", MESSAGES)
def test_messages(kind, complaint, here):
    told = {text: complaint(text) for text in MESSAGES[kind]}
    assert told == {text: f"c.yaml: {line}" for text, line in MESSAGES[kind].items()}
    assert [path.name for path in here.iterdir()] == ["c.yaml"]  # tags run nothing


def test_too_many_entries_are_told():
    entries = [{"t_s": i, "supply_frequency_hz": 50} for i in range(MAX_ENTRIES + 1)]
    Scene.from_tree({"drive": {"program": entries[:-1]}})
    with pytest.raises(ConfigError, match=rf"^drive\.program = .*; allowed: entries, at most {MAX_ENTRIES}$"):
        Scene.from_tree({"drive": {"program": entries}})


def test_messages_about_files_name_the_one_that_is_wrong(here):
    place = here / ("d" * 200) / ("e" * 200)
    place.mkdir(parents=True)
    texts = {"a": "extends: b.yaml", "b": "extends: a.yaml", "list": "- 1", "my scene": ""}
    for name, text in texts.items():
        (here / f"{name}.yaml").write_text(text)
    (place / "up.yaml").write_text("extends: ../../list.yaml")
    messages = {
        "nothing.yaml": "nothing.yaml: no such file",
        ".": ".: cannot be read (Is a directory)",
        "a.yaml/c.yaml": "a.yaml/c.yaml: cannot be read (Not a directory)",
        "a.yaml": "a.yaml: extends itself through b.yaml",
        "my scene.yaml": f"my scene.yaml: name = 'my scene'; allowed: {NAME}, as name: my-scene",
        place / "up.yaml": "/../../list.yaml: holds a list; allowed: keys and values",  # its path is cut
    }
    for name, line in messages.items():
        with pytest.raises(ConfigError) as caught:
            load_config(name)
        told = str(caught.value)
        assert (told[-len(line) :], len(told) < 500) == (line, True)
        assert told == line or name == place / "up.yaml"


SETTINGS = [
    ("", "drive", "--set 'drive'; allowed: key.sub=value"),
    ("", "a=[1", "--set a: not valid YAML in line 1, column 3: expected ',' or ']', but got '<stream end>'"),
    ("", "drive.supply_frequency_hz.x=3", "c.yaml: drive.supply_frequency_hz = {'x': 3}; allowed: a number"),
    (
        "",
        "exciters.2.critical_slip=0.1",
        "c.yaml: unknown key exciters.2; allowed: exciters.0 to exciters.1: exciters.0 is motor 1",
    ),
    (
        "",
        "exciters.-1.critical_slip=0.1",
        "c.yaml: unknown key exciters.-1; allowed: exciters.0 to exciters.1: exciters.0 is motor 1",
    ),
    ("motors: [{}, {}]", "motors.0.pole_pairs='3'", "c.yaml: motors.0.pole_pairs = '3'; allowed: a whole number, as 3"),
    (
        "",
        "machine.platform_mass_kg=1,168",
        "--set machine.platform_mass_kg: a decimal comma in line 1; allowed: a point, as in 1.168, or 1168 without a "
        "separator of thousands",
    ),
    *(
        ("", f"{key}={text}", f"c.yaml: {key.replace('N', '0')} = {text!r}; allowed: {instead}")
        for key, text, instead in (
            ("machine.platform_mass_kg", "12.42 kg", "a number without its unit, as 12.42; that of the key is kg"),
            ("machine.platform_mass_kg", "12.42 g", "a number in kg, not in g"),
            (
                "machine.platform_mass_kg",
                "1,168 kg",
                "a number without its unit, as 1.168, or 1168 without a separator of thousands; that of the key is kg",
            ),
            ("machine.stiffness_phi_n_m_per_rad", "–1.168,5", "a number, as -1168.5"),
            ("machine.unbalance_radius_m", "5 %", "a number in m, not in %"),
            ("material.mass_ratio", "5 %", "a number, as 0.05"),
            ("run.initial.state.x_m", "1 mm", "a number in m, not in mm"),
            ("motor.pole_pairs", "2 pairs", "a whole number without its unit, as 2"),
        )
    ),
    (
        "sweep: {supply_frequency_hz: {start: 1, stop: 2}}",
        "sweep.supply_frequency_hz.start=50Hz",
        "c.yaml: sweep.supply_frequency_hz.start = '50Hz'; allowed: a number without its unit, as 50; that of the key "
        "is Hz",
    ),
    (
        "find: {key: material.mass_ratio, start: 0, stop: 1}",
        "find.expression='rms_y_m > –1,5 m'",
        "c.yaml: find: expression = 'rms_y_m > –1,5 m'; allowed: column > number, or >=, <, <=; a number without its "
        "unit, as -1.5; that of the key is m",
    ),
    (
        "design: {keys: {motor.critical_slip: [0.1, 0.2]}, minimize: motor_power_w}",
        "design.constraints={rms_y_m: '>= 1 mm'}",
        'c.yaml: design: constraints.rms_y_m = \'>= 1 mm\' is no bound; allowed: ">= NUMBER" or "<= NUMBER"; a number '
        "in m, not in mm",
    ),
    (program(), "drive.program.1.t_s=2", "c.yaml: unknown key drive.program.1; allowed: none"),
    (program(START), "drive.program.1.t_s=2", "c.yaml: unknown key drive.program.1; allowed: drive.program.0"),
    ("exciters: [{}, {}]", "exciters=[{}]", "c.yaml: exciters = [{}]; allowed: entries, at least 2"),
    (
        "exciters: [{}, {}]",
        "motor.pole_pairs=3",
        "c.yaml: motor.pole_pairs is given, but each exciter has a "
        "motor of its own; allowed: exciters.N.pole_pairs, for both",
    ),
    ("motor: 3", "motors.0.pole_pairs=2", f"c.yaml: motors.1 = 3; allowed: {SECTION}"),
    ("motor: 3", "exciters.1.critical_slip=0.1", f"c.yaml: motor = 3; allowed: {SECTION} (and 1 more)"),
]


def test_numbers_of_yaml_and_of_our_prints_are_read_and_dates_are_text(scene_of):
    """Signs may be those of printed numbers, U+2212, also in bounds."""
    numbers = {".1168e4": 1168.0, "+.5": 0.5, "−15": -15.0, "−1.5e−3": -1.5e-3}
    for text, number in numbers.items():
        assert parse_overrides([f"a.b={text}"]) == {"a.b": number}
    scene = scene_of("name: 2024-05-03\nfind: {key: material.mass_ratio, start: 0, stop: 1, expression: x_m > −2.5}")
    assert (scene.name, scene.find.compared) == ("2024-05-03", ("x_m", ">", -2.5))


def test_messages_about_settings(scene_of, complaint):
    told = []
    for text, setting, _ in SETTINGS:
        with pytest.raises(ConfigError) as caught:
            scene_of(text, parse_overrides([setting]))
        told.append(str(caught.value))
    assert told == [line for _, _, line in SETTINGS]
    line = "c.yaml: drive.supply_frequency_hz lies inside drive, which already has a value"
    assert complaint("", {"drive": 3, "drive.supply_frequency_hz": 50.0}) == line


def texts():
    """All texts of the package but docstrings."""
    for path in Path(vibroplat.__file__).parent.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        docstrings = {node.value for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in docstrings:
                yield node.value


def test_keys_that_are_named_anywhere_exist():
    known = set(nodes(Scene))
    sections = "|".join({name.partition(".")[0] for name in known if "." in name})
    named = re.findall(rf"(?<![\w./-])(?:{sections})\.[a-z]\w*(?:\.\w+)*", "\n".join(texts()))
    assert len(set(named)) > 60
    unknown = {name for name in named if in_lists(name.split(".")) not in known}
    assert unknown == {"machine.gif", "orbits.json"}
