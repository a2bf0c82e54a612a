"""The section ``sweep``: what it makes of a user's values, and the line that a wrong one is answered with."""

from __future__ import annotations

import pytest
from common.places import FLYING, LOADED

from vibroplat import Scene, load_config
from vibroplat.config.plans import Frequencies
from vibroplat.errors import ConfigError
from vibroplat.study.branches import branches

from .helpers import planned

SECTIONS = "name, machine, motor, motors, exciters, material, contact, drive, run, solver, output, sweep, orbits"
PLAN = (
    "supply_frequency_hz, grid, kind, settle_s, max_settle_s, settle_tolerance, measure_s, period_tolerance, "
    "perturbation, seed, lyapunov, confirm"
)
MATERIAL = "mass_ratio, layers, lower_share, natural_frequency_hz, stiffness_n_per_m, damping_ratio, damping_n_s_per_m"


def upward(start, stop, step):
    return Frequencies(start=start, stop=stop, step=step).upward


# -- frequencies ----------------------------------------------------------------------------------------


def test_frequencies_are_as_a_user_would_write_them():
    assert upward(42.0, 42.6, 0.1) == [42.0, 42.1, 42.2, 42.3, 42.4, 42.5, 42.6]
    assert list(map(str, upward(42.0, 80.0, 0.05))) == [
        f"{4200 + 5 * i}"[:2] + _cents(4200 + 5 * i) for i in range(761)
    ]


def _cents(hundredths):
    return f".{hundredths % 100:02d}".removesuffix("0") if hundredths % 10 == 0 else f".{hundredths % 100:02d}"


@pytest.mark.parametrize(
    ("start", "stop", "step", "last", "count"),
    [
        (42.0, 80.0, 0.5, 80.0, 77),
        (42.0, 42.3, 0.1, 42.3, 4),
        (42.0, 42.29, 0.1, 42.2, 3),
        (42.0, 43.0, 0.3, 42.9, 4),
        (42.0, 42.0, 0.5, 42.0, 1),
        (42.0, 42.4, 0.5, 42.0, 1),
        (0.1, 0.7, 0.1, 0.7, 7),
        (50.0, 51.0, 1.0 / 3.0, 51.0, 4),
        (1.0, 1000.0, 0.01, 1000.0, 99_901),
    ],
)
def test_stop_is_taken_where_whole_steps_reach_it(start, stop, step, last, count):
    found = upward(start, stop, step)
    assert (found[0], found[-1], len(found)) == (start, last, count)
    assert max(found) <= stop


def test_step_is_half_a_hertz_and_direction_up_unless_given():
    scene = Scene().replace({"sweep.supply_frequency_hz": {"start": 42.0, "stop": 43.0}})
    (branch,) = branches(scene)
    assert (branch.direction, branch.frequencies) == ("up", (42.0, 42.5, 43.0))


# -- branches -------------------------------------------------------------------------------------------


def test_branches_are_combinations_times_directions_the_first_key_slowest():
    grid = {"material.mass_ratio": [0.2, 0.1], "contact.restitution": [0.5, 0.0]}
    found = branches(planned(LOADED, 50.0, 51.0, step=0.5, direction=["down", "up"], grid=grid))
    places = [(0.2, 0.5), (0.2, 0.0), (0.1, 0.5), (0.1, 0.0)]
    assert [b.number for b in found] == list(range(8))
    assert [b.direction for b in found] == ["down", "up"] * 4
    assert [tuple(b.grid.values()) for b in found] == [place for place in places for _ in range(2)]
    assert [list(b.grid) for b in found] == [list(grid)] * 8
    assert {b.frequencies for b in found[::2]} == {(51.0, 50.5, 50.0)}
    assert {b.frequencies for b in found[1::2]} == {(50.0, 50.5, 51.0)}


def test_scenes_of_a_branch_have_its_values_and_frequencies():
    grid = {"material.mass_ratio": [0.1, 0.3], "solver.tolerance": [1e-5]}
    branch = branches(planned(LOADED, 50.0, 51.0, direction="down", grid=grid))[1]
    for point, frequency in enumerate((51.0, 50.5, 50.0)):
        scene = branch.at(point)
        assert scene.drive.supply_frequency_hz == frequency
        assert (scene.material.mass_ratio, scene.solver.tolerance) == (0.3, 1e-5)
        assert scene.machine == load_config(LOADED).machine


def test_value_of_the_grid_replaces_its_alternative():
    (branch,) = branches(planned(LOADED, 50.0, grid={"material.stiffness_n_per_m": [8000.0]}))
    material = branch.at(0).material
    assert (material.stiffness_n_per_m, material.natural_frequency_hz) == (8000.0, None)


@pytest.mark.parametrize("direction", ["up", ["up"]])
def test_direction_may_be_one_word(direction):
    assert [b.direction for b in branches(planned(LOADED, 50.0, direction=direction))] == ["up"]


# -- one mistake, one line ------------------------------------------------------------------------------

FREQUENCIES = {
    "none": ("{}", "sweep.supply_frequency_hz.start = {}; allowed: a value is required (and 1 more)"),
    "a number": ("42", "sweep.supply_frequency_hz = 42; allowed: a section of keys and values"),
    "a list": ("[42, 43]", "sweep.supply_frequency_hz = [42, 43]; allowed: a section of keys and values"),
    "no stop": ("{start: 42.0}", "sweep.supply_frequency_hz.stop = {'start': 42.0}; allowed: a value is required"),
    "stop below start": (
        "{start: 44, stop: 42}",
        "sweep.supply_frequency_hz: stop = 42.0 is below start = 44.0; allowed: at least start; see direction",
    ),
    "step 0": ("{start: 42, stop: 44, step: 0}", "sweep.supply_frequency_hz.step = 0; allowed: more than 0.0"),
    "step down": ("{start: 42, stop: 44, step: -0.5}", "sweep.supply_frequency_hz.step = -0.5; allowed: more than 0.0"),
    "steps too many": (
        "{start: 42, stop: 44, step: 1e-6}",
        "sweep.supply_frequency_hz: step = 1e-06 gives too many points; allowed: at most 100000 per branch",
    ),
    "text": ("{start: '42', stop: 44}", "sweep.supply_frequency_hz.start = '42'; allowed: a number"),
    "start 0": ("{start: 0, stop: 44}", "sweep.supply_frequency_hz.start = 0; allowed: more than 0.0"),
    "not finite": ("{start: .nan, stop: 44}", "sweep.supply_frequency_hz.start = nan; allowed: a finite number"),
    "unknown key": (
        "{start: 42, stop: 44, stepp: 1}",
        "unknown key sweep.supply_frequency_hz.stepp; did you mean step? allowed: start, stop, step, direction",
    ),
    "sideways": (
        "{start: 42, stop: 44, direction: sideways}",
        "sweep.supply_frequency_hz.direction.0 = 'sideways'; allowed: 'up' or 'down'",
    ),
    "sideways too": (
        "{start: 42, stop: 44, direction: [up, sideways]}",
        "sweep.supply_frequency_hz.direction.1 = 'sideways'; allowed: 'up' or 'down'",
    ),
    "up twice": (
        "{start: 42, stop: 44, direction: [up, up]}",
        "sweep.supply_frequency_hz: direction = ['up', 'up']; allowed: up and down, each once",
    ),
}


@pytest.mark.parametrize(("text", "line"), FREQUENCIES.values(), ids=FREQUENCIES)
def test_mistakes_in_frequencies_are_told_in_a_line(text, line, complaint):
    assert complaint(f"sweep: {{supply_frequency_hz: {text}}}") == f"c.yaml: {line}"


@pytest.mark.parametrize("count", [0, 3])
def test_number_of_directions_is_told(count, complaint):
    given = ["up", "down", "up"][:count]
    line = complaint(f"sweep: {{supply_frequency_hz: {{start: 42, stop: 44, direction: {given}}}}}")
    assert line.startswith(f"c.yaml: sweep.supply_frequency_hz.direction = {given}; allowed: ")


KEYS = {
    "key like one": ("settle: 3", f"unknown key sweep.settle; did you mean settle_s? allowed: {PLAN}"),
    "key like none": ("zzzz: 3", f"unknown key sweep.zzzz; allowed: {PLAN}"),
    "max_settle_s": ("max_settle_s: 0", "sweep.max_settle_s = 0; allowed: more than 0.0"),
    "settle_tolerance": ("settle_tolerance: 0", "sweep.settle_tolerance = 0; allowed: more than 0.0"),
    "settle_tolerance too": ("settle_tolerance: 2", "sweep.settle_tolerance = 2; allowed: at most 1.0"),
    "measure_s": ("measure_s: 0", "sweep.measure_s = 0; allowed: more than 0.0"),
    "measure_s true": ("measure_s: true", "sweep.measure_s = True; allowed: a number"),
    "period_tolerance": ("period_tolerance: -1", "sweep.period_tolerance = -1; allowed: more than 0.0"),
    "perturbation": ("perturbation: 1.5", "sweep.perturbation = 1.5; allowed: at most 1.0"),
    "perturbation too": ("perturbation: -0.1", "sweep.perturbation = -0.1; allowed: at least 0.0"),
    "seed": ("seed: 1.5", "sweep.seed = 1.5; allowed: a whole number"),
    "seed too": ("seed: -1", "sweep.seed = -1; allowed: at least 0"),
    "lyapunov": ("lyapunov: maybe", "sweep.lyapunov = 'maybe'; allowed: true or false"),
    "kind": ("kind: maps", "sweep.kind = 'maps'; allowed: 'response', 'bifurcation' or 'map'"),
    "map without a key": (
        "kind: map",
        "sweep: kind = map needs exactly one grid key with several numbers",
    ),
    "map of one value": (
        "kind: map, grid: {material.mass_ratio: [0.1]}",
        "sweep: kind = map needs exactly one grid key with several numbers",
    ),
    "map of two keys": (
        "kind: map, grid: {material.mass_ratio: [0.1, 0.2], contact.restitution: [0.0, 0.1]}",
        "sweep: kind = map needs exactly one grid key with several numbers",
    ),
    "grid of no list": ("grid: {contact.restitution: 0.1}", "sweep.grid.contact.restitution = 0.1; allowed: a list"),
    "grid of sections": (
        "grid: {contact: {restitution: [0.1]}}",
        "sweep.grid.contact = {'restitution': [0.1]}; allowed: a list",
    ),
    "grid a list": ("grid: [contact]", "sweep.grid = ['contact']; allowed: a section of keys and values"),
    "grid twice": (
        "grid: {contact.restitution: [0.1, 0.1]}",
        "sweep: grid.contact.restitution = [0.1, 0.1]; allowed: each value once",
    ),
    **{
        f"grid of {key}": (
            f"grid: {{{key}: [1.0]}}",
            f"sweep: grid.{key} cannot be swept by the grid; allowed: keys of machine, material, …",
        )
        for key in ("run.duration_s", "run.initial.phi1_rad", "name", "output.sample_rate_hz", "sweep.measure_s")
    },
    "grid of frequency": (
        "grid: {drive.supply_frequency_hz: [50.0]}",
        "sweep: grid.drive.supply_frequency_hz cannot be swept by the grid; allowed: keys of machine, material, …",
    ),
}


def with_plan(text):
    return f"sweep: {{supply_frequency_hz: {{start: 42, stop: 44}}, {text}}}"


@pytest.mark.parametrize(("text", "line"), KEYS.values(), ids=KEYS)
def test_mistakes_in_other_keys_are_told_in_a_line(text, line, complaint):
    assert complaint(with_plan(text)) == f"c.yaml: {line}"


@pytest.mark.parametrize("value", ["true", "Auto", "-1", "0", "[1]", "null", ".inf"])
def test_mistakes_in_settle_s_name_the_key_and_both_that_is_allowed(value, complaint):
    given = {"true": "True", "Auto": "'Auto'", "null": "None", ".inf": "inf"}.get(value, value)
    line = complaint(with_plan(f"settle_s: {value}"))
    assert line.startswith(f"c.yaml: sweep.settle_s = {given}; allowed: ")
    allowed = line.partition("allowed: ")[2]
    assert "auto" in allowed
    assert "number" in allowed or "more than 0" in allowed


@pytest.mark.parametrize("values", ["material: [{mass_ratio: 0.1}]", "motor: [{pole_pairs: 1}, {pole_pairs: 2}]"])
def test_sections_are_no_values_of_a_grid(values, complaint):
    """A table has no place for them."""
    assert f"grid.{values.partition(':')[0]}" in complaint(with_plan(f"grid: {{{values}}}"))


def test_empty_list_of_a_grid_is_told(complaint):
    line = complaint(with_plan("grid: {contact.restitution: []}"))
    assert line.startswith("c.yaml: sweep.grid.contact.restitution = []; allowed: ")


@pytest.mark.parametrize("values", ["[0, 0.0]", "[0.5, 5e-1]"])
def test_equal_numbers_of_a_grid_are_the_same_value(values, complaint):
    line = complaint(with_plan(f"grid: {{contact.restitution: {values}}}"))
    assert "grid.contact.restitution" in line
    assert line.endswith("allowed: each value once")


@pytest.mark.parametrize("text", ["{}", "{frequencies: 3}"])
def test_sweep_without_frequencies_is_told(text, complaint):
    assert complaint(f"sweep: {text}").startswith("c.yaml: sweep.supply_frequency_hz = ")


@pytest.mark.parametrize(("text", "value"), [("3", "3"), ("[]", "[]"), ("up", "'up'")])
def test_sweep_that_is_no_section_is_told(text, value, complaint):
    assert complaint(f"sweep: {text}") == f"c.yaml: sweep = {value}; allowed: a section of keys and values"


def test_name_of_the_section_is_guessed(complaint):
    assert complaint("swep: {}") == f"c.yaml: unknown key swep; did you mean sweep? allowed: {SECTIONS}"


VALUES = {
    "unknown key": (
        "material.mas_ratio: [0.1]",
        f"unknown key material.mas_ratio; did you mean mass_ratio? allowed: {MATERIAL}",
    ),
    "unknown section": (
        "materal.mass_ratio: [0.1]",
        f"unknown key materal; did you mean material? allowed: {SECTIONS}",
    ),
    "a key without its section": ("mass_ratio: [0.1]", f"unknown key mass_ratio; allowed: {SECTIONS}"),
    "the last value": ("contact.restitution: [0.0, 0.1, -1.0]", "contact.restitution = -1.0; allowed: at least 0.0"),
    "a text": ("material.mass_ratio: [a]", "material.mass_ratio = 'a'; allowed: a number"),
    "true": ("contact.restitution: [true]", "contact.restitution = True; allowed: a number"),
    "a word": ("contact.model: [impact, none]", "contact.model = 'none'; allowed: 'impact' or 'non-impact'"),
    "a section": ("contact: [0.1]", "contact = 0.1; allowed: a section of keys and values"),
    "inside a value": ("contact.restitution.x: [0.1]", "contact.restitution = {'x': 0.1}; allowed: a number"),
    "together": (
        "material.mass_ratio: [0.1]",
        "material: two layers need a spring between them; give natural_frequency_hz or stiffness_n_per_m",
    ),
}


@pytest.mark.parametrize(("text", "line"), VALUES.values(), ids=VALUES)
def test_values_that_scenes_do_not_take_are_told_before_anything_runs(text, line, complaint):
    assert complaint(with_plan(f"grid: {{{text}}}")).removeprefix("c.yaml: ") == f"sweep.grid: {line}"


# -- run and sweep --------------------------------------------------------------------------------------


def test_run_takes_a_configuration_with_a_sweep(command, here):
    (here / "c.yaml").write_text(f"{FLYING}{with_plan('settle_s: 1.0')}\n")
    done = command("run", "c.yaml", "--set", "run.duration_s=0.05")
    assert (done.code, done.err) == (0, "")
    assert done.out.startswith("outcome                     ok\n")


@pytest.mark.parametrize("text", ["name: c", "sweep:", "sweep: null"])
def test_sweep_of_a_configuration_without_one_says_so(text, command, here):
    (here / "c.yaml").write_text(f"{text}\n")
    line = "vibroplat: c.yaml: this configuration has no sweep section; add sweep: {supply_frequency_hz: …}\n"
    assert command("sweep", "c.yaml") == (2, "", line)
    assert [path.name for path in here.iterdir()] == ["c.yaml"]


@pytest.mark.parametrize("text", ["seed: -1", "grid: {material.mass: [0.1]}"])
def test_mistake_in_a_sweep_exits_2_with_one_line_and_writes_nothing(text, command, here):
    (here / "c.yaml").write_text(with_plan(text))
    done = command("sweep", "c.yaml")
    assert (done.code, done.out, len(done.err.splitlines())) == (2, "", 1)
    assert done.err.startswith("vibroplat: ")
    assert [path.name for path in here.iterdir()] == ["c.yaml"]


def test_settings_reach_the_plan():
    scene = load_config(LOADED, {"sweep.supply_frequency_hz.start": 42.0, "sweep.supply_frequency_hz.stop": 43.0})
    assert scene.sweep is not None
    assert scene.replace({"sweep.seed": 7}).sweep.seed == 7
    with pytest.raises(ConfigError, match=r"sweep\.seed = -7"):
        scene.replace({"sweep.seed": -7})
