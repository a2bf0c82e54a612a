"""Where runs begin: where another one ended, and slightly off a start that is symmetric."""

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from common.commands import not_a_line
from common.results import unproven

from vibroplat import simulate
from vibroplat.config.coordinates import COORDINATES, RATES
from vibroplat.hybrid.state import initial_state, perturb_state, state_scales
from vibroplat.motion.initial_condition import initial_condition
from vibroplat.results.provenance import configuration_hash
from vibroplat.results.tables import read_json, read_table
from vibroplat.study.branches import branches

#: Starts, ramps, a jump and switching; 1 s lies in the middle of a ramp.
PROGRAM = [
    {"t_s": 0.0, "supply_frequency_hz": 40.0},
    {"t_s": 0.7, "supply_frequency_hz": 44.0},
    {"t_s": 1.3, "supply_frequency_hz": 50.0},
    {"t_s": 1.5, "exciter_2": "off"},
    {"t_s": 1.7, "exciter_2": "on", "supply_frequency_hz": 52.0},
    {"t_s": 1.7, "supply_frequency_hz": 48.0},
]

#: Changes of the quickstart, and the mode in which its first second ends.
SCENES = {
    "flight": ({}, "flight"),
    "one layer": ({"material": {"mass_ratio": 0.1, "layers": 1}}, "flight"),
    "program": ({"drive.program": PROGRAM}, None),
}


def write(scene, name):
    Path(f"{name}.yaml").write_text(json.dumps(scene.to_tree() | {"name": name}))


@pytest.fixture
def first(here, command, quickstart, kernels):
    """Make a command leave a run of one second in results/first; return its scene."""

    def run(changes, form="parquet", seconds=1.0):
        scene = quickstart.replace({**changes, "solver.tolerance": 1e-9, "run.perturbation": 0.01})
        scene = scene.replace({"run.duration_s": seconds})
        write(scene, "first")
        done = command("run", "first.yaml", "--format", form)
        assert (done.code, done.err) == (0, "")
        return scene

    return run


def going_on(scene, **changes):
    """Return a scene that goes on where results/first ended."""
    return scene.replace({"run.initial": {"from": "results/first"}, "run.perturbation": None, **changes})


@pytest.mark.parametrize(("name", "form"), [("flight", "parquet"), ("one layer", "csv"), ("program", "parquet")])
def test_two_runs_of_a_second_are_one_of_two(name, form, first):
    changes, mode = SCENES[name]
    scene = first(changes, form)
    rest = simulate(going_on(scene)).trajectory
    whole = simulate(scene.replace({"run.duration_s": 2.0})).trajectory
    last = read_table(Path("results/first/run"), "trajectory").iloc[-1]
    assert mode in (last["mode"], None)
    # it begins with the same numbers, whole turns of the exciters included
    names = [c for c in rest.columns if c in (*COORDINATES, *RATES)]
    assert rest.loc[0, names].to_list() == last[names].to_list()
    assert (rest.loc[0, "t_s"], rest.loc[0, "mode"]) == (1.0, last["mode"])
    assert abs(rest.loc[0, "phi1_rad"]) > 100.0
    # and is what follows in the whole, at the same times
    assert rest["t_s"].iloc[-1] == 2.0
    both = whole[whole["t_s"] > 1.0].merge(rest, on=["t_s", "mode"], suffixes=("", "_of_rest"))
    both = both.drop_duplicates("t_s", keep=False)
    assert len(both) > 1900
    scales = dict(zip((*COORDINATES, *RATES), state_scales(scene), strict=True))
    for column in names:
        error = np.abs(both[column] - both[f"{column}_of_rest"]).max()
        assert error <= 1e-6 * scales[column], column  # tolerance 1e-9; amplified by up to 200


def test_a_flight_that_has_just_begun_goes_on(first, quickstart):
    changes = {"drive.supply_frequency_hz": 50.5, "run.perturbation": 0.01, "solver.tolerance": 1e-9}
    events = simulate(quickstart.replace({**changes, "run.duration_s": 1.0})).events
    liftoff = events.loc[events["kind"] == "liftoff", "t_s"].iloc[3]
    impact = events.loc[events["kind"] == "impact", "t_s"].iloc[3]
    for after in (1e-12, 1e-9, 1e-6):
        scene = first({"drive.supply_frequency_hz": 50.5}, seconds=float(liftoff + after))
        assert read_table(Path("results/first/run"), "trajectory")["mode"].iloc[-1] == "flight"
        found = simulate(going_on(scene, **{"run.duration_s": 0.1})).events
        assert found["kind"].iloc[0] == "impact"
        assert found["t_s"].iloc[0] == pytest.approx(impact, abs=1e-6)


def test_bare_platform_goes_on_with_material_on_it(first):
    scene = first({"material.mass_ratio": 0.0})
    material = scene.replace({"material.mass_ratio": 0.2})
    state = initial_condition(going_on(material)).state
    static = initial_state(going_on(material))
    assert state[6] == static[6] < 0.0
    assert state[3] > 100.0


def test_provenance_says_where_a_run_begins(first, command):
    scene = first({})
    write(going_on(scene), "second")
    done = command("run", "second.yaml")
    assert (done.code, done.err) == (0, "")
    origin = read_json(Path("results/second/run"), "provenance")
    found = origin["begins_from"]
    assert found["directory"] == "results/first"
    assert found["t_s"] == 1.0
    assert found["configuration_sha256"] == configuration_hash(scene.replace(name="first"))
    assert "begins_from" not in read_json(Path("results/first/run"), "provenance")


def test_a_run_that_goes_on_does_not_replace_the_one_before(first, command):
    scene = first({}, seconds=0.05)
    write(going_on(scene), "first")
    done = command("run", "first.yaml")
    line = "first.yaml: run.initial.from = 'results/first' is also the directory of the new run; allowed: another name"
    assert (done.code, done.err) == (2, f"vibroplat: {line}\n")
    assert read_table(Path("results/first/run"), "trajectory")["t_s"].iloc[-1] == 0.05


def test_a_run_that_goes_on_is_not_perturbed_unless_asked(first):
    scene = first({})
    assert simulate(going_on(scene), keep="summary").summary["perturbation"] == 0.0
    asked = initial_condition(going_on(scene, **{"run.perturbation": 0.01}))
    plain = initial_condition(going_on(scene))
    assert (asked.state[:7] == plain.state[:7]).all()
    assert (asked.state[7:12] != plain.state[7:12]).all()


def lines_of(scene, command, here):
    """Run a scene that cannot begin; return what the user is told, without the key."""
    write(scene, "second")
    before = sorted(path.name for path in here.rglob("*"))
    done = command("run", "second.yaml")
    assert not_a_line(done) == ""
    assert sorted(path.name for path in here.rglob("*")) == before
    return done.err.removeprefix("vibroplat: second.yaml: ").strip().removeprefix("run.initial.from = 'results/first'")


FINISHED = "; allowed: the directory of a finished run"


def ended_early(directory):
    file = directory / "summary.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"outcome": "too-many-events"}))


def rewritten(change):
    def spoil(directory):
        file = directory / "trajectory.parquet"
        change(pd.read_parquet(file)).to_parquet(file)

    return spoil


def ending(column, value):
    return rewritten(lambda table: table.assign(**{column: [*table[column][:-1], value]}))


SPOILT = {
    "no directory": (shutil.rmtree, f": results/first holds no finished result: it has no provenance.json{FINISHED}"),
    "no trajectory": (
        lambda directory: (directory / "trajectory.parquet").unlink(),
        f": results/first/run holds no trajectory table{FINISHED}",
    ),
    "ended early": (ended_early, f": the run ended early (too-many-events){FINISHED}"),
    "no time": (rewritten(lambda table: table.drop(columns="t_s")), ": its trajectory is not as vibroplat writes it"),
    "not finite": (ending("y_m", np.nan), ": its trajectory is not as vibroplat writes it"),
    "far too fast": (
        ending("phi1_rate_rad_per_s", 3e8),
        " ends with phi1_rate_rad_per_s = 3e+08; allowed for this scene: up to 1.62e+06",
    ),
    "in the platform": (ending("gap_m", -1.0), " ends with gap_m = -1; allowed for this scene: at least -6.47e-06"),
    "far too late": (ending("t_s", 1e12), " ends with t_s = 1e+12; allowed for this scene: up to 2.78e+07"),
    "no rows": (rewritten(lambda table: table.iloc[:0]), ": its trajectory is not as vibroplat writes it"),
}


def test_run_that_cannot_be_gone_on_from(first, command, here):
    scene = first({}, seconds=0.05)
    unproven(here / "results/first/run").rename(here / "proper")
    for case, (spoil, line) in SPOILT.items():
        shutil.copytree(here / "proper", here / "results/first/run")
        spoil(here / "results/first/run")
        assert lines_of(going_on(scene), command, here) == line, case
        shutil.rmtree(here / "results/first/run", ignore_errors=True)


def test_coordinates_that_the_scene_does_not_have(first, command, here):
    scene = first({}, seconds=0.05)
    line = lines_of(going_on(scene, **{"material.mass_ratio": 0.0}), command, here)
    assert line.startswith(" ends with ")
    assert line.endswith(" but this scene has no such coordinate; allowed: a run with the same layers")


def test_program_that_begins_later(first, command, here):
    scene = first({}, seconds=0.05)
    late = {"drive.program": [{"t_s": 0.1, "supply_frequency_hz": 50.0}]}
    line = "drive.program.0.t_s = 0.1 but the run starts at 0.05 s; allowed: an entry at or before its start"
    assert lines_of(going_on(scene, **late), command, here) == line
    assert lines_of(scene.replace(late), command, here) == line.replace("0.05", "0")


def test_start_is_perturbed_as_a_first_point_of_a_sweep(quickstart):
    plan = {"supply_frequency_hz": {"start": 65, "stop": 66}, "grid": {}, "seed": 3, "perturbation": 0.02}
    scene = quickstart.replace(
        {"drive.supply_frequency_hz": 65.0, "run.perturbation": 0.02, "run.seed": 3, "sweep": plan}
    )
    (branch,) = branches(scene.replace({"sweep.supply_frequency_hz.direction": "up"}))
    key = (scene.sweep.seed, *branch.perturbation_key(branch.key_values[0]))
    of_sweep = perturb_state(initial_state(branch.scene), branch.scene, scene.sweep.perturbation, key)
    assert (initial_condition(scene).state == of_sweep).all()


def test_0_is_the_start_as_it_is_given_and_a_state_is_not_perturbed(quickstart):
    for perturbation, initial in ((0, {}), (0, {"phase_difference_rad": 1.0}), (None, {"state": {"y_m": -3e-4}})):
        scene = quickstart.replace({"run": {"perturbation": perturbation, "initial": initial, "duration_s": 0.01}})
        assert (initial_condition(scene).state == initial_state(scene)).all()
        assert simulate(scene).summary["perturbation"] == 0.0
