"""What a user reads when a configuration is not accepted, line by line; and what an accepted one becomes."""

from __future__ import annotations

import math

import pytest
from common.limits import cpu_seconds
from common.places import ROOT
from ruamel.yaml import YAML

from vibroplat import Contact, Drive, Initial, Material, Motor, Scene, load_config
from vibroplat.config.keys import configuration_schema
from vibroplat.config.reader import parse_overrides
from vibroplat.errors import ConfigError

SECTIONS = "name, machine, motor, motors, exciters, material, contact, drive, run, solver, output, sweep, orbits"
MACHINE = (
    "platform_mass_kg, platform_inertia_kg_m2, unbalance_mass_kg, unbalance_radius_m, rotor_inertia_kg_m2, "
    "exciter_distance_m, exciter_angle_deg, stiffness_x_n_per_m, stiffness_y_n_per_m, "
    "stiffness_phi_n_m_per_rad, damping_x_n_s_per_m, damping_y_n_s_per_m, damping_phi_n_m_s_per_rad, "
    "gravity_m_per_s2"
)
MOTOR = "critical_torque_n_m, critical_slip, pole_pairs, friction_radius_m, rated_frequency_hz"
INITIAL = "phase_difference_rad, phase_sum_rad, phi1_rad, speed_ratio, state, from"
CONTACT = "model, restitution, sticking_speed_m_per_s, impact_law, viscous_per_mass_per_s, added_mass_share"
NAME = "letters, digits and . _ + -, starting with a letter or digit"
THIN = "material: {mass_ratio: 0.2, layers: 1}\n"

#: The example of shared/interface.md without its last section.
EXAMPLE = """\
extends: machines/calibrated.yaml   # optional, relative to this file; deep-merged, this file wins
name: quickstart
machine:
  platform_mass_kg: 12.42           # m_0
  platform_inertia_kg_m2: 0.11      # J_0
  unbalance_mass_kg: 0.045          # m_r, each
  unbalance_radius_m: 0.09          # r
  rotor_inertia_kg_m2: 0.8e-3       # J_d
  exciter_distance_m: 0.128         # rho
  exciter_angle_deg: 22.5           # gamma_1
  stiffness_x_n_per_m: 580e3
  stiffness_y_n_per_m: 470e3
  stiffness_phi_n_m_per_rad: 1.8e3
  damping_x_n_s_per_m: 300.0
  damping_y_n_s_per_m: 400.0
  damping_phi_n_m_s_per_rad: 0.77
  gravity_m_per_s2: 9.81
motor:                              # or motors: [ {…}, {…} ] for two unequal ones
  critical_torque_n_m: 1.2
  critical_slip: 0.15
  pole_pairs: 2
  friction_radius_m: 5.0e-5         # k_R
material:
  mass_ratio: 0.2                   # mu_w; 0 = none
  layers: 2                         # 1 = thin layer
  lower_share: 0.75                 # m_w1/m_w
  natural_frequency_hz: 18.5        # sqrt(c_w/m_w2)/2pi  — or stiffness_n_per_m: …
  damping_ratio: 0.05               #                     — or damping_n_s_per_m: …
contact:
  model: impact                     # impact | non-impact
  restitution: 0.0                  # R in [0, 1]
  impact_law: conservative          # conservative | central | printed
  viscous_per_mass_per_s: 0.0       # beta of the non-impact model
drive:
  supply_frequency_hz: 51.5         # f_e
run:
  duration_s: 4.0
  initial: {phase_sum_rad: 3.141592653589793, phi1_rad: 0.0, speed_ratio: 0.98}
solver:
  tolerance: 1.0e-6                 # relative; absolute ones follow from the scales of the scene
  engine: auto                      # auto | native | sundae
output:
  sample_rate_hz: 2000
sweep:
  supply_frequency_hz: {start: 42.0, stop: 80.0, step: 0.5, direction: [up, down]}
  grid: {material.mass_ratio: [0.0, 0.1, 0.2], contact.restitution: [0.0]}
  settle_s: 6.0
  measure_s: 2.0
"""

# -- one file, one line ---------------------------------------------------------------------------------

MESSAGES = {
    # unknown keys
    "unknown section": ("machin: {}", f"unknown key machin; did you mean machine? allowed: {SECTIONS}"),
    "unknown and like none": ("zzz: 1", f"unknown key zzz; allowed: {SECTIONS}"),
    "unknown in a section": (
        "machine: {platform_mass: 1}",
        f"unknown key machine.platform_mass; did you mean platform_mass_kg? allowed: {MACHINE}",
    ),
    "unknown in a section and like none": ("contact: {zzzz: 1}", f"unknown key contact.zzzz; allowed: {CONTACT}"),
    "unknown two sections deep": (
        "run: {initial: {phi1: 0}}",
        f"unknown key run.initial.phi1; did you mean phi1_rad? allowed: {INITIAL}",
    ),
    "unknown in a list": (
        "motors: [{pole_pair: 2}, {}]",
        f"unknown key motors.0.pole_pair; did you mean pole_pairs? allowed: {MOTOR}",
    ),
    "dotted key": (
        "drive.supply_frequency_hz: 50",
        f"unknown key drive.supply_frequency_hz; allowed: {SECTIONS}",
    ),
    "number as a key": ("machine: {1: 2}", "not valid YAML: a key is not text"),
    "list as a key": ("[a, b]: 1", "not valid YAML: a key is not text"),
    # duplicate keys
    "duplicate key": (
        "drive:\n  supply_frequency_hz: 50\n  supply_frequency_hz: 60\n",
        'duplicate key "supply_frequency_hz" in line 3; allowed: each key once',
    ),
    "duplicate section": (
        "drive: {}\nrun: {}\ndrive: {}\n",
        'duplicate key "drive" in line 3; allowed: each key once',
    ),
    # wrong types
    "text for a number": (
        "drive: {supply_frequency_hz: fast}",
        "drive.supply_frequency_hz = 'fast'; allowed: a number",
    ),
    "bool for a number": ("contact: {restitution: true}", "contact.restitution = True; allowed: a number"),
    "nothing for a number": ("contact: {restitution: }", "contact.restitution = None; allowed: a number"),
    "number for a text": ("name: 3", "name = 3; allowed: text"),
    "date for a text": ("name: 2020-01-01", "name = datetime.date(2020, 1, 1); allowed: text"),
    "fraction for a whole number": ("motor: {pole_pairs: 2.5}", "motor.pole_pairs = 2.5; allowed: a whole number"),
    "list for a section": ("drive: [1]", "drive = [1]; allowed: a section of keys and values"),
    "number for a section": ("drive: 50", "drive = 50; allowed: a section of keys and values"),
    "nothing for a section": ("drive:", "drive = None; allowed: a section of keys and values"),
    "number for a section in a list": ("motors: [{}, 3]", "motors.1 = 3; allowed: a section of keys and values"),
    "section for a list": ("motors: {a: 1}", "motors = {'a': 1}; allowed: a list"),
    "long text for a number": (
        f"contact: {{restitution: {'x' * 5000}}}",
        f"contact.restitution = '{'x' * 56}...; allowed: a number",
    ),
    # out of range
    "restitution above 1": ("contact: {restitution: 1.2}", "contact.restitution = 1.2; allowed: at most 1.0"),
    "restitution below 0": ("contact: {restitution: -0.1}", "contact.restitution = -0.1; allowed: at least 0.0"),
    "negative sticking speed": (
        "contact: {sticking_speed_m_per_s: -0.1}",
        "contact.sticking_speed_m_per_s = -0.1; allowed: at least 0.0",
    ),
    "sticking speed that is no number": (
        "contact: {sticking_speed_m_per_s: .nan}",
        "contact.sticking_speed_m_per_s = nan; allowed: a finite number",
    ),
    "sticking speed without its unit": (
        "contact: {sticking_speed: 0.1}",
        f"unknown key contact.sticking_speed; did you mean sticking_speed_m_per_s? allowed: {CONTACT}",
    ),
    "negative mass": (
        "machine: {platform_mass_kg: -1}",
        "machine.platform_mass_kg = -1; allowed: more than 0.0",
    ),
    "not a number": (
        "machine: {platform_mass_kg: .nan}",
        "machine.platform_mass_kg = nan; allowed: a finite number",
    ),
    "infinite": ("machine: {platform_mass_kg: -.inf}", "machine.platform_mass_kg = -inf; allowed: a finite number"),
    "beyond floats": ("machine: {platform_mass_kg: 1e999}", "machine.platform_mass_kg = inf; allowed: a finite number"),
    "tolerance 0": ("solver: {tolerance: 0}", "solver.tolerance = 0; allowed: at least 1e-14"),
    "tolerance of taylor": (
        "solver: {tolerance: 1e-13}",
        "solver: tolerance = 1e-13 with engine auto; allowed: at least 1e-12, or 1e-14 with engine taylor",
    ),
    "tolerance 1": ("solver: {tolerance: 1}", "solver.tolerance = 1; allowed: at most 0.01"),
    "beyond physics": (
        "machine: {platform_mass_kg: 1e31}",
        "machine.platform_mass_kg = 1e+31; allowed: at most 1e+30",
    ),
    "next to nothing": (
        "machine: {platform_mass_kg: 1e-31}",
        "machine.platform_mass_kg = 1e-31; allowed: at least 1e-30",
    ),
    "far below": (
        "machine: {exciter_angle_deg: -1e31}",
        "machine.exciter_angle_deg = -1e+31; allowed: at least -1e+30",
    ),
    "huge whole number": (
        f"motor: {{pole_pairs: 1{'0' * 400}}}",
        f"motor.pole_pairs = 1{'0' * 56}...; allowed: at most 1000",
    ),
    "too many rows": (
        "run: {duration_s: 1e6}",
        "output.sample_rate_hz = 2000.0 asks for 2e+09 rows in 1000000.0 s; allowed: at most 100000000 rows",
    ),
    "too many turns": (
        "drive: {supply_frequency_hz: 1e12}\nmotor: {pole_pairs: 4}",
        "run.duration_s = 4.0 takes 1e+12 turns at the synchronous speed; allowed: at most 1e+09",
    ),
    "too many turns of a point": (
        "sweep: {supply_frequency_hz: {start: 1.0, stop: 4.0e9, step: 1e9}, max_settle_s: 0.1}",
        "sweep.measure_s = 2.0 takes 4e+09 turns at the synchronous speed; allowed: at most 1e+09",
    ),
    "bool for a number of layers": ("material: {layers: true}", "material.layers = True; allowed: 1 or 2"),
    "no duration": ("run: {duration_s: 0}", "run.duration_s = 0; allowed: more than 0.0"),
    "three layers": ("material: {layers: 3}", "material.layers = 3; allowed: 1 or 2"),
    "unknown law": (
        "contact: {impact_law: elastic}",
        "contact.impact_law = 'elastic'; allowed: 'conservative', 'central' or 'printed'",
    ),
    "unknown model": ("contact: {model: Impact}", "contact.model = 'Impact'; allowed: 'impact' or 'non-impact'"),
    "name that leaves the directory": ("name: ../up", f"name = '../up'; allowed: {NAME}"),
    "name with a line break": ('name: "a\\nb"', f"name = 'a\\nb'; allowed: {NAME}"),
    "empty name": ("name: ''", "name = ''; allowed: at least 1 character"),
    "long name": (f"name: {'a' * 101}", f"name = '{'a' * 56}...; allowed: at most 100 characters"),
    "several": (
        "contact: {restitution: 1.2}\nzz: 1\ndrive: {supply_frequency_hz: 0}\n",
        "contact.restitution = 1.2; allowed: at most 1.0 (and 2 more)",
    ),
    # values that do not go together
    "two stiffnesses": (
        "material: {natural_frequency_hz: 18.5, stiffness_n_per_m: 100}",
        "material: natural_frequency_hz and stiffness_n_per_m are both given; allowed: one of the two",
    ),
    "two dampings": (
        "material: {damping_ratio: 0.1, damping_n_s_per_m: 1}",
        "material: damping_ratio and damping_n_s_per_m are both given; allowed: one of the two",
    ),
    "no upper layer": (
        "material: {mass_ratio: 0.2, layers: 2, lower_share: 1, natural_frequency_hz: 18.5}",
        "material: lower_share = 1 leaves no upper layer; allowed with layers = 2: more than 0, less than 1",
    ),
    "no spring": (
        "material: {mass_ratio: 0.2, layers: 2}",
        "material: two layers need a spring between them; give natural_frequency_hz or stiffness_n_per_m",
    ),
    "motor and motors": (
        "motor: {}\nmotors: [{}, {}]\n",
        "motor and motors are both given; allowed: one of the two",
    ),
    "one of two motors": ("motors: [{}]", "motors = [{}]; allowed: a list of 2"),
    "three motors": ("motors: [{}, {}, {}]", "motors = [{}, {}, {}]; allowed: a list of 2"),
    "state and a phase": (
        "run: {initial: {state: {y_m: 0}, phi1_rad: 0}}",
        "run.initial: state and phi1_rad are both given; allowed: one of the two",
    ),
    "state and a phase difference": (
        "run: {initial: {state: {y_m: 0}, phase_difference_rad: 0}}",
        "run.initial: state and phase_difference_rad are both given; allowed: one of the two",
    ),
    "state and a run": (
        "run: {initial: {state: {y_m: 0}, from: results/c}}",
        "run.initial: state and from are both given; allowed: one of the two",
    ),
    "run and a phase": (
        "run: {initial: {from: results/c, phi1_rad: 0}}",
        "run.initial: from and phi1_rad are both given; allowed: one of the two",
    ),
    "run and a phase difference": (
        "run: {initial: {from: results/c, phase_difference_rad: 0}}",
        "run.initial: from and phase_difference_rad are both given; allowed: one of the two",
    ),
    "run without a name": ("run: {initial: {from: ''}}", "run.initial.from = ''; allowed: at least 1 character"),
    "number for a run": ("run: {initial: {from: 3}}", "run.initial.from = 3; allowed: text"),
    "misspelt run": (
        "run: {initial: {form: results/c}}",
        f"unknown key run.initial.form; did you mean from? allowed: {INITIAL}",
    ),
    "perturbation above 1": ("run: {perturbation: 2}", "run.perturbation = 2; allowed: at most 1.0"),
    "negative seed": ("run: {seed: -1}", "run.seed = -1; allowed: at least 0"),
    "negative gap": (
        f"{THIN}run: {{initial: {{state: {{gap_m: -0.1}}}}}}",
        "run.initial.state.gap_m = -0.1; allowed: at least 0.0",
    ),
    "closing gap of 0": (
        f"{THIN}run: {{initial: {{state: {{gap_rate_m_per_s: -0.1}}}}}}",
        "run.initial.state.gap_rate_m_per_s = -0.1 closes a gap that is 0; allowed: at least 0 while gap_m is 0",
    ),
    "gap without material": (
        "run: {initial: {state: {gap_m: 0.1}}}",
        "run.initial.state.gap_m = 0.1 but this scene has no such coordinate; allowed: leave it out",
    ),
    "rate of an upper layer that is not there": (
        f"{THIN}run: {{initial: {{state: {{upper_rate_m_per_s: 0.1}}}}}}",
        "run.initial.state.upper_rate_m_per_s = 0.1 but this scene has no such coordinate; allowed: leave it out",
    ),
    # not a mapping, not YAML, not a text
    "list at the top": ("- 1\n- 2\n", "holds a list; allowed: keys and values"),
    "text at the top": ("hello", "holds a str; allowed: keys and values"),
    "open bracket": (
        "a: [1\n",
        "not valid YAML in line 2, column 1: expected ',' or ']', but got '<stream end>'",
    ),
    "colon in a value": (
        "a: b: c\n",
        "not valid YAML in line 1, column 5: mapping values are not allowed here",
    ),
    "tab for blanks": (
        "drive:\n\tsupply_frequency_hz: 50\n",
        "not valid YAML in line 2, column 1: found character '\\t' that cannot start any token",
    ),
    "unknown alias": ("a: *b\n", "not valid YAML in line 1, column 4: found undefined alias 'b'"),
    "two documents": ("a: 1\n---\nb: 2\n", "not valid YAML in line 2, column 1: but found another document"),
    "control character": (
        "a: \x01\n",
        "not valid YAML: unacceptable character #x0001: special characters are not allowed in "
        '"<unicode string>", position 3',
    ),
    "not UTF-8": (b"name: a # \xe9\n", "not UTF-8 text"),
    # tags
    "python object": (
        "name: !!python/object/apply:os.system ['touch executed']",
        "not valid YAML in line 1, column 7: could not determine a constructor for the tag …",
    ),
    # extends
    "extends a number": ("extends: 3", "extends is not text; allowed: a file name"),
    "extends itself": ("extends: c.yaml", "extends itself through c.yaml"),
}


@pytest.mark.parametrize("case", MESSAGES)
def test_message(case, complaint):
    text, line = MESSAGES[case]
    assert complaint(text) == f"c.yaml: {line}"


def test_tags_run_nothing(complaint, here):
    complaint("name: !!python/object/apply:os.system ['touch executed']")
    assert [p.name for p in here.iterdir()] == ["c.yaml"]


@pytest.mark.parametrize(
    ("path", "line"),
    [
        ("nothing.yaml", "nothing.yaml: no such file"),
        ("no/such/place.yaml", "no/such/place.yaml: no such file"),
        (".", ".: cannot be read (Is a directory)"),
        ("file/c.yaml", "file/c.yaml: cannot be read (Not a directory)"),
    ],
)
def test_message_about_a_file_that_is_not_there(path, line, here):
    (here / "file").write_text("")
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    assert str(caught.value) == line


@pytest.mark.parametrize(
    ("files", "line"),
    [
        ({"c": "extends: sub/nothing.yaml"}, "c.yaml: extends = 'sub/nothing.yaml': no such file"),
        (
            {"c": "extends: a.yaml", "a": "extends: b.yaml", "b": "extends: a.yaml"},
            "a.yaml: extends itself through b.yaml",
        ),
        (
            {"c": "extends: a.yaml", "a": "drive: {x: 1}"},
            "c.yaml: unknown key drive.x; allowed: supply_frequency_hz, program",
        ),
        ({"c": "extends: a.yaml", "a": "- 1"}, "a.yaml: holds a list; allowed: keys and values"),
        (
            {"c": "extends: a.yaml", "a": "a: [1"},
            "a.yaml: not valid YAML in line 1, column 6: expected ',' or ']', but got '<stream end>'",
        ),
        ({"c": "extends: ."}, "c.yaml: extends = '.': cannot be read (Is a directory)"),
    ],
    ids=["missing", "loop of two", "unknown key below", "list below", "not YAML below", "directory"],
)
def test_message_about_an_extended_file(files, line, here):
    for name, text in files.items():
        (here / f"{name}.yaml").write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_config("c.yaml")
    assert str(caught.value) == line


SECRET = "hunter2"


@pytest.mark.parametrize(
    "text",
    [
        f"root:{SECRET}:19000:0:99999:7:::\ndaemon:*:19000::::::\n",
        f"user:{SECRET}@host: x\n",
        f"drive: {{'{SECRET}!': 1}}\n",
        SECRET,
        f"- {SECRET}\n",
        f"*{SECRET}",
        f"'{SECRET}",
        f"!{SECRET} x",
        f"!!int {SECRET}",
        f"a: !!float {SECRET}",
        f"!!bool {SECRET}",
        f'!!timestamp "{SECRET}"',
        f"&a *{SECRET}",
        f"%{SECRET}\n",
        f"a: 1\na: {SECRET}\n",
        f"? [{SECRET}, b]\n: x\n",
        f"extends: [{SECRET}]\n",
        f"<<: {SECRET}\n",
        f"a: [{SECRET}\nb: {SECRET}\n",
    ],
)
def test_contents_of_a_file_that_is_no_configuration_are_not_quoted(text, here, command):
    """``extends: /etc/shadow`` says what is wrong there and in which line, not what is written there."""
    (here / "secrets").write_text(text)
    (here / "c.yaml").write_text("extends: secrets\n")
    done = command("run", "c.yaml")
    assert (done.code, done.out, len(done.err.splitlines())) == (2, "", 1)
    assert done.err.startswith("vibroplat: secrets: ")
    assert SECRET not in done.err


def test_key_that_is_no_name_is_told_by_its_line(complaint):
    line = "c.yaml: the key in line 2 is no name; allowed: letters, digits and _ . -"
    assert complaint("drive:\n  a$b: 1\n") == line


def test_long_path_does_not_hide_what_is_wrong(here):
    place = here / ("d" * 200) / ("e" * 200)
    place.mkdir(parents=True)
    (place / "c.yaml").write_text("drive: {hertz: 50}")
    with pytest.raises(ConfigError, match=r"c\.yaml: unknown key drive\.hertz"):
        load_config(place / "c.yaml")


@pytest.mark.parametrize(
    ("setting", "line"),
    [
        ("drive", "--set 'drive'; allowed: key.sub=value"),
        ("=3", "--set '=3'; allowed: key.sub=value"),
        ("a..b=3", "--set 'a..b=3'; allowed: key.sub=value"),
        (".a=3", "--set '.a=3'; allowed: key.sub=value"),
        ("a=[1", "--set a: not valid YAML in line 1, column 3: expected ',' or ']', but got '<stream end>'"),
        (
            "a=!!python/name:os.system",
            "--set a: not valid YAML in line 1, column 1: could not determine a constructor for the tag …",
        ),
    ],
)
def test_message_about_a_setting(setting, line):
    with pytest.raises(ConfigError) as caught:
        parse_overrides([setting])
    assert str(caught.value) == line


@pytest.mark.parametrize(
    ("overrides", "line"),
    [
        ({"drive.supply_frequency_hz": "fast"}, "c.yaml: drive.supply_frequency_hz = 'fast'; allowed: a number"),
        (
            {"drive.frequency": 50.0},
            "c.yaml: unknown key drive.frequency; did you mean supply_frequency_hz? "
            "allowed: supply_frequency_hz, program",
        ),
        (
            {"drive": 3, "drive.supply_frequency_hz": 50.0},
            "drive.supply_frequency_hz lies inside drive, which already has a value",
        ),
        ({"motors.0.pole_pairs": "3"}, "c.yaml: motors.0.pole_pairs = '3'; allowed: a whole number"),
    ],
    ids=["value", "key", "inside a value", "inside a list"],
)
def test_message_about_an_override(overrides, line, complaint):
    assert complaint("", overrides) == line


# -- hostile files end in one line, soon ---------------------------------------------------------------

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
        pytest.param("{a: " * 5000 + "1" + "}" * 5000, BYTES, id="nested sections"),
        pytest.param("- " * 5000 + "1", DEEP, id="nested block lists"),
        pytest.param("? " * 5000 + "1", DEEP, id="nested keys"),
        pytest.param("".join(" " * i + "a:\n" for i in range(220)), "unknown key a; allowed: " + SECTIONS, id="stairs"),
        pytest.param("a: [" + "1," * 490_000 + "]", BYTES, id="wide list of 980 kB"),
        pytest.param("#" * 25_001, BYTES, id="long comment"),
        pytest.param("a: " + "x" * 24_000, "unknown key a; allowed: " + SECTIONS, id="long text"),
    ],
)
def test_hostile_file_is_refused_in_a_second(text, line, complaint):
    with cpu_seconds(1.0):
        assert complaint(text) == f"c.yaml: {line}"


@pytest.mark.parametrize(
    "text",
    [
        pytest.param('"a\\nb": 1', id="line break in a key"),
        pytest.param('"a\\u2028b": 1', id="line separator in a key"),
        pytest.param('"a\\x1b[31mb": 1', id="escape sequence in a key"),
        pytest.param('extends: "a\\nb"', id="line break in extends"),
        pytest.param(f"? {'k' * 2000}\n: 1", id="long key"),
        pytest.param(f"extends: {'k' * 2000}", id="long extends"),
        pytest.param('extends: "a\\0b"', id="NUL in extends"),
        pytest.param("%YAML 1.3\n---\nname: a\n", id="YAML of the future"),
        pytest.param("motor: {pole_pairs: !!int }", id="empty whole number"),
        pytest.param("drive: {supply_frequency_hz: !!float }", id="empty number"),
    ],
)
def test_odd_file_is_refused_in_one_short_printable_line(text, complaint):
    line = complaint(text)
    assert line.isprintable()
    assert len(line) < 500


def test_anchors_may_be_reused(scene_of):
    """YAML 1.2, section 3.2.2.2; no warning may reach the user's terminal."""
    scene_of("motor: &m {pole_pairs: &m 2}\n")


# -- files that extend files ---------------------------------------------------------------------------


def test_extends_is_relative_to_the_extending_file_and_merged_deeply(here):
    (here / "deep" / "er").mkdir(parents=True)
    (here / "deep" / "er" / "c.yaml").write_text(
        "machine: {gravity_m_per_s2: 1.0, damping_x_n_s_per_m: 1.0, damping_y_n_s_per_m: 1.0}\ndrive: {}\n"
    )
    (here / "deep" / "b.yaml").write_text(
        "extends: er/c.yaml\nmachine: {damping_x_n_s_per_m: 2.0, damping_y_n_s_per_m: 2.0}\n"
    )
    (here / "a.yaml").write_text("extends: deep/b.yaml\nmachine: {damping_y_n_s_per_m: 3.0}\n")
    machine = load_config("a.yaml").machine
    assert (machine.gravity_m_per_s2, machine.damping_x_n_s_per_m, machine.damping_y_n_s_per_m) == (1.0, 2.0, 3.0)
    assert machine.stiffness_x_n_per_m == 580e3


def test_extends_takes_an_absolute_path(here):
    (here / "base.yaml").write_text("drive: {supply_frequency_hz: 44}\n")
    (here / "top.yaml").write_text(f"extends: {here / 'base.yaml'}\n")
    assert load_config("top.yaml").drive == Drive(supply_frequency_hz=44.0)


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
        ("motor: {pole_pairs: 1}", "motor: {critical_slip: 0.2}", {"motor": Motor(pole_pairs=1, critical_slip=0.2)}),
        ("motors: [{pole_pairs: 1}, {}]", "motors: [{}, {}]", {"motors": [Motor(), Motor()]}),
        ("contact: {restitution: 0.5}", "contact: {}", {"contact": Contact(restitution=0.5)}),
    ],
    ids=["stiffness", "frequency", "motors", "motor", "same motor", "lists are replaced", "empty section"],
)
def test_upper_file_gives_one_of_two_alternatives(below, above, expected, here, scene_of):
    (here / "base.yaml").write_text(below)
    scene = scene_of(f"extends: base.yaml\n{above}\n")
    assert {key: getattr(scene, key) for key in expected} == expected


def test_state_and_phases_replace_each_other(here, scene_of):
    (here / "phases.yaml").write_text("run: {duration_s: 2, initial: {phi1_rad: 1, phase_sum_rad: 2, speed_ratio: 0}}")
    (here / "state.yaml").write_text("extends: phases.yaml\nrun: {initial: {state: {x_m: 0.1}}}")
    initial = load_config("state.yaml").run.initial
    assert initial.state is not None
    assert initial.model_fields_set == {"state"}
    scene = scene_of("extends: state.yaml\nrun: {initial: {speed_ratio: 0.5}}")
    assert scene.run.initial == Initial(speed_ratio=0.5)
    assert scene.run.duration_s == 2.0


@pytest.mark.parametrize(
    ("below", "above"),
    [
        ("phi1_rad: 1, phase_sum_rad: 2, speed_ratio: 0", "from: results/a"),
        ("state: {x_m: 0.1}", "from: results/a"),
        ("from: results/a", "state: {x_m: 0.1}"),
        ("from: results/a", "from: results/b"),
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


@pytest.mark.parametrize(
    ("run", "perturbation"),
    [
        ("{}", 0.01),
        ("{initial: {phase_difference_rad: 1, speed_ratio: 0}}", 0.01),
        ("{initial: {state: {y_m: 0}}}", 0.0),
        ("{initial: {from: results/a}}", 0.0),
        ("{perturbation: 0}", 0.0),
        ("{perturbation: 0.2, initial: {from: results/a}}", 0.2),
    ],
)
def test_start_is_perturbed_unless_it_is_given_as_a_state_or_a_run(run, perturbation, scene_of):
    assert scene_of(f"run: {run}").run.start_perturbation == perturbation


# -- defaults, names, the repository's own files -------------------------------------------------------


@pytest.mark.parametrize("text", ["", "# only a comment\n", "---\n", "{}"])
def test_empty_file_is_all_defaults(text, scene_of):
    assert scene_of(text) == Scene(name="c")


@pytest.mark.parametrize(("file", "name"), [("scene.yaml", "scene"), ("f25.75-R0.3.yaml", "f25.75-R0.3"), ("7", "7")])
def test_name_is_the_stem_of_the_file(file, name, here):
    (here / file).write_text("")
    assert load_config(file).name == name


def test_name_given_in_the_file_wins_over_its_stem(scene_of):
    assert scene_of("name: given").name == "given"
    assert scene_of("name: given", {"name": "set"}).name == "set"


def test_stem_that_cannot_be_a_name_is_refused(here):
    (here / "my scene.yaml").write_text("")
    with pytest.raises(ConfigError) as caught:
        load_config("my scene.yaml")
    assert str(caught.value) == f"my scene.yaml: name = 'my scene'; allowed: {NAME}"


SCENES = [
    path for room in ("", "machines", "paper", "examples") for path in sorted((ROOT / "configs" / room).glob("*.yaml"))
]


@pytest.mark.parametrize("path", SCENES, ids=lambda p: p.stem)
def test_configuration_of_the_repository_loads(path):
    assert isinstance(load_config(path), Scene)


def test_example_of_the_interface_loads(scene_of, here):
    (here / "machines").symlink_to(ROOT / "configs/machines")
    scene = scene_of(EXAMPLE)
    assert scene.sweep.settle_s == 6.0
    calibrated = {"machine.unbalance_radius_m": 0.09, "machine.damping_y_n_s_per_m": 400.0}
    calibrated |= {"motor.friction_radius_m": 5e-5, "run.initial.phase_sum_rad": math.pi}
    calibrated |= {"material.natural_frequency_hz": 18.5, "material.damping_ratio": 0.05}
    assert scene.replace(name="x", sweep=None) == load_config(ROOT / "configs/quickstart.yaml", calibrated).replace(
        {
            "name": "x",
            "sweep": None,
            "contact": {"model": "impact", "impact_law": "conservative", "viscous_per_mass_per_s": 0.0},
        }
    )
    assert scene.machine.rotor_inertia_kg_m2 == 0.8e-3


@pytest.mark.parametrize(
    ("text", "value"),
    [("580e3", 580e3), ("1e-6", 1e-6), ("1.E+2", 100.0), (".5", 0.5), ("5", 5.0), ("0x10", 16.0), ("0o10", 8.0)],
)
def test_numbers_of_yaml_are_numbers(text, value, scene_of):
    assert scene_of(f"machine: {{platform_mass_kg: {text}}}").machine.platform_mass_kg == value


@pytest.mark.parametrize("text", ["yes", "1:30", "'5'", "5 kg", "5,0"])
def test_texts_are_not_numbers(text, complaint):
    assert complaint(f"drive:\n  supply_frequency_hz: {text}\n").endswith("allowed: a number")


# -- --set ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-6", 1e-6),
        ("3", 3),
        ("-0.5", -0.5),
        ("true", True),
        ("[0.0, 0.1]", [0.0, 0.1]),
        ("{phi1_rad: 0.5, state: {x_m: 1}}", {"phi1_rad": 0.5, "state": {"x_m": 1}}),
        ("impact", "impact"),
        ("'3'", "3"),
        ("a=b", "a=b"),
        ("yes", "yes"),
        ("", None),
        ("null", None),
    ],
)
def test_setting_is_typed_as_in_yaml(text, value):
    (key, parsed), *_ = parse_overrides([f"a.b={text}"]).items()
    assert key == "a.b"
    assert type(parsed) is type(value)
    assert parsed == value


def test_later_setting_wins():
    assert parse_overrides(["a=1", "b.c=2", "a=3"]) == {"a": 3, "b.c": 2}


def test_settings_are_laid_over_the_file(scene_of):
    text = (
        "contact: {restitution: 0.5}\nmaterial: {mass_ratio: 0.1, natural_frequency_hz: 18.5}\nmotor: {pole_pairs: 1}"
    )
    settings = [
        "solver.tolerance=1e-6",
        "contact={impact_law: central}",
        "material.stiffness_n_per_m=200",
        "motors=[{}, {pole_pairs: 3}]",
        "run.initial.state.x_m=0.1",
    ]
    scene = scene_of(text, parse_overrides(settings))
    assert scene.solver.tolerance == 1e-6
    assert scene.contact == Contact(restitution=0.5, impact_law="central")
    assert scene.material == Material(mass_ratio=0.1, stiffness_n_per_m=200.0)
    assert [exciter.pole_pairs for exciter in scene.exciter_pair] == [2, 3]
    assert scene.run.initial.state.x_m == 0.1


# -- Scene.replace --------------------------------------------------------------------------------------

SCENE = Scene(material=Material(mass_ratio=0.1, natural_frequency_hz=18.5, damping_ratio=0.05))


def test_replace_takes_dotted_keys_and_sections():
    dotted = SCENE.replace({"drive.supply_frequency_hz": 46.0, "material.mass_ratio": 0.2})
    nested = SCENE.replace(drive={"supply_frequency_hz": 46.0}, material={"mass_ratio": 0.2})
    models = SCENE.replace(drive=Drive(supply_frequency_hz=46.0), material={"mass_ratio": 0.2})
    assert dotted == nested == models
    assert dotted.material == Material(mass_ratio=0.2, natural_frequency_hz=18.5, damping_ratio=0.05)
    assert SCENE.replace({"name": "b"}, name="a").name == "b"


def test_replace_leaves_the_original_alone():
    motors = [Motor(pole_pairs=1), Motor()]
    original = SCENE.replace(motors=motors)
    before = original.model_dump()
    changed = original.replace({"motors": [{}, {}], "material.stiffness_n_per_m": 3.0, "run.initial.state.y_m": 0.0})
    assert original.model_dump() == before
    assert changed != original
    assert original.replace() == original


def test_replace_takes_the_last_row_of_a_trajectory(runs):
    for run in runs.values():
        last = run.trajectory.iloc[-1].to_dict()
        state = run.scene.replace({"run.initial.state": last}).run.initial.state
        assert state.phi1_rad == last["phi1_rad"]


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"material.mass_ratio": -1.0}, "material.mass_ratio = -1.0; allowed: at least 0.0"),
        ({"foo": 3}, f"unknown key foo; did you mean motor? allowed: {SECTIONS}"),
        ({"drive.supply_frequency_hz.x": 3}, "drive.supply_frequency_hz = {'x': 3}; allowed: a number"),
        ({"material": None}, "material = None; allowed: a section of keys and values"),
        (
            {"material": {"natural_frequency_hz": 1.0, "stiffness_n_per_m": 1.0}},
            "material: natural_frequency_hz and stiffness_n_per_m are both given; allowed: one of the two",
        ),
    ],
    ids=["value", "key", "inside a value", "nothing", "both"],
)
def test_replace_refuses_with_a_line(changes, line):
    with pytest.raises(ConfigError) as caught:
        SCENE.replace(changes)
    assert str(caught.value) == line


# -- schema ---------------------------------------------------------------------------------------------


def resolved(schema, node):
    """Follow a reference, or the section among alternatives."""
    for option in node.get("anyOf", [node]):
        if "$ref" in option:
            return schema["$defs"][option["$ref"].rpartition("/")[2]]
    return node


def missing(schema, node, tree, path=""):
    """Dotted keys of a tree that a JSON schema does not know."""
    if "properties" not in node:  # its keys are free
        return
    for key, value in tree.items():
        if key not in node["properties"]:
            yield f"{path}{key}"
            continue
        inside = resolved(schema, node["properties"][key])
        for entry in value if isinstance(value, list) else [value]:
            if isinstance(entry, dict):
                yield from missing(schema, of_entries(schema, inside), entry, f"{path}{key}.")


def of_entries(schema, node):
    """Schema of the entries of a list, among alternatives too; or the node itself."""
    lists = [option for option in node.get("anyOf", [node]) if option.get("type") == "array"]
    return resolved(schema, lists[0]["items"]) if lists else node


def test_schema_has_every_key_of_the_example():
    schema = configuration_schema()
    example = YAML(typ="safe").load(EXAMPLE)
    assert list(missing(schema, schema, example)) == []
    assert list(missing(schema, schema, {"run": {"initial": {"state": {"y_m": 0}}}, "motors": []})) == []
    assert list(missing(schema, schema, {"drive": {"hertz": 1}})) == ["drive.hertz"]


def test_schema_refuses_other_keys_and_says_what_is_allowed():
    schema = configuration_schema()
    assert schema["title"] == "vibroplat configuration"
    assert schema["type"] == "object"
    assert [s for s in (schema, *schema["$defs"].values()) if s["additionalProperties"]] == []
    restitution = schema["$defs"]["Contact"]["properties"]["restitution"]
    assert restitution | {"default": 0.0, "minimum": 0.0, "maximum": 1.0, "type": "number"} == restitution
    sticking = schema["$defs"]["Contact"]["properties"]["sticking_speed_m_per_s"]
    assert sticking | {"default": 0.0, "minimum": 0.0, "type": "number"} == sticking
    assert schema["$defs"]["Contact"]["properties"]["model"]["enum"] == ["impact", "non-impact"]


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
    assert scene.replace({"sweep.grid": {}}).sweep.measure_s == 1.0


#: Exciters of their own, and a supply over time.
NEWER = """\
exciters:
  - {unbalance_radius_m: 0.09, rotor_inertia_kg_m2: 0.8e-3, rated_frequency_hz: 50}
  - {critical_torque_n_m: 1.2, critical_slip: 0.15, pole_pairs: 2, friction_radius_m: 5.0e-5, rotation: clockwise}
drive:
  program: [{t_s: 0, supply_frequency_hz: 0}, {t_s: 3, supply_frequency_hz: 50, exciter_2: off}, {t_s: 8, off: true}]
run:
  initial: {from: results/other}
  perturbation: 0
  seed: 3
"""


def test_schema_has_the_keys_of_exciters_program_and_start(scene_of):
    schema, example = configuration_schema(), YAML(typ="safe").load(NEWER)
    assert list(missing(schema, schema, example)) == []
    assert list(missing(schema, schema, example | {"exciters": [{"radius": 1}]})) == ["exciters.radius"]
    assert list(missing(schema, schema, example | {"drive": {"program": [{"t": 1}]}})) == ["drive.program.t"]
    assert scene_of(NEWER).run.initial.from_ == "results/other"
