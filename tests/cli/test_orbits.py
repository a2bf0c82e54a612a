"""``vibroplat orbits``: its files and its overview, what it refuses, and going on with unfinished work."""

import contextlib
import shutil
from pathlib import Path

import pytest
from common.commands import command as run_command
from common.commands import not_a_line
from common.orbits import traced
from common.results import left

from vibroplat import load, load_config, orbit
from vibroplat.motion.run import load_kernels
from vibroplat.study.pool import Inline

MACHINE = Path(__file__).parents[1] / "continuation/machine.yaml"
HEAD = f"extends: {MACHINE}\nname: c\nsolver: {{engine: taylor}}\n"
KEY = "key: drive.supply_frequency_hz"
STEP = "step: {first: 0.4, max: 0.5}"
ORBITS = f"orbits: {{{KEY}, start: 47.0, stop: 49.0, {STEP}, grid: {{material.mass_ratio: [0.0, 0.1]}}}}\n"


@pytest.fixture(autouse=True)
def _kernels():
    load_kernels("taylor")


@pytest.fixture
def config(here):
    """Write a configuration."""

    def write(text):
        (here / "c.yaml").write_text(HEAD + text)
        return "c.yaml"

    return write


def results(directory="results/c/orbits"):
    return left(Path(directory))[0]


@pytest.fixture(scope="module")
def once(tmp_path_factory):
    """A place with the configuration and its results, and how the command ended."""
    place = tmp_path_factory.mktemp("once")
    load_kernels("taylor")
    (place / "c.yaml").write_text(HEAD + ORBITS)
    with contextlib.chdir(place):
        return place, run_command("orbits", "c.yaml")


@pytest.fixture
def followed(once, here):
    """Copy them to the working directory."""
    shutil.copytree(once[0], here, dirs_exist_ok=True)
    return once[1]


# -- what it does ------------------------------------------------------------------------------------------------------


def test_writes_tables_and_prints_an_overview(followed):
    assert (followed.code, followed.err) == (0, "")
    found = results()
    assert set(found) == {"branches.parquet", "special.parquet", "orbits.json", "provenance.json"}
    assert found["provenance.json"]["command"] == "orbits"
    assert found["provenance.json"]["engine"] == "taylor"
    assert found["orbits.json"]["failed"] == 0
    assert found["special.parquet"]["kind"].tolist() == ["liftoff"]
    answer = load("results/c").answer
    lines, points = followed.out.splitlines(), len(found["branches.parquet"])
    assert lines[0] == f"2 branches, {points} orbits over f_e 47.00 … 49.00 Hz: {points} stable"
    assert [line.split()[-1] for line in lines if "mass ratio" in line] == ["–", "48.18"]
    assert len(answer.notes) == 3
    (row,) = (line for line in answer.text if line.startswith("0.1 ") and "start" in line)
    assert row.split()[:6] == ["0.1", "0", "start", "–", "47", "49"]
    assert row.endswith("  stop of the key's range")
    (row,) = (line for line in answer.text if "liftoff" in line)
    assert row.split()[:4] == ["0.1", "0", "liftoff", "48.176451"]


def test_a_branch_that_fails_keeps_its_points(command, config, monkeypatch):
    from vibroplat.continuation.arclength import Branch

    grow = Branch.extend

    def failing(self, look):
        if len(self.points) < 3 or self.points[-1].chart.places.size < 11:  # without material
            return grow(self, look)
        self.ended = "no further orbit found: for a test"
        return False

    monkeypatch.setattr(Branch, "extend", failing)
    done = command("orbits", config(ORBITS))
    assert done.code == 1
    assert done.err.splitlines() == [
        "vibroplat: branch 0, material.mass_ratio 0.1 failed after 3 points: no further orbit found: for a test; "
        "engine taylor ended it, solver.engine = native may go on",
        "vibroplat: 1 of the branches failed",
    ]
    assert results()["branches.parquet"]["material.mass_ratio"].value_counts()[0.1] == 3
    assert [branch["failed"] for branch in results()["orbits.json"]["branches"]] == [False, True]


# -- what it refuses ---------------------------------------------------------------------------------------------------

#: Orbits over the supply frequency, with more keys.
NEAR = f"{KEY}, start: 47, stop: 48"
REFUSED = {
    "": "c.yaml: this configuration has no orbits section; add orbits: {key: …, start: …, stop: …}",
    "key: contact.impact_law, start: 1, stop: 2": "c.yaml: orbits.key = contact.impact_law does not vary continu",
    "key: material.layers, start: 1, stop: 2": "c.yaml: orbits.key = material.layers does not vary continu",
    "key: machine, start: 1, stop: 2": "c.yaml: orbits.key = machine does not vary continu",
    "key: material.mas_ratio, start: 0, stop: 1": "c.yaml: orbits.key: unknown key material.mas_ratio; did you mean",
    f"{NEAR}, period: 2": "orbits.period = 2 but the motion repeats after 1; allowed: 1",
    f"{NEAR}, step: {{first: 0}}": "c.yaml: orbits.step.first = 0; allowed: ",
    f"{KEY}, start: 47, stop: 47": "c.yaml: orbits: stop = 47.0 is start; allowed: another value",
    f"{NEAR}, from: nowhere": "c.yaml: orbits.from = 'nowhere': nowhere holds no finished result",
    f"{NEAR}, from: state": "c.yaml: orbits.from = state but run.initial.state is not given; ",
    f"{NEAR}, grid: {{material.mass_ratio: [-1.0]}}": "c.yaml: orbits.grid: material.mass_ratio = -1.0; "
    "allowed: at least 0.0",
    f"{NEAR}, grid: {{material.mass_ratio: [0.1, 0.1]}}": "c.yaml: orbits.grid: material.mass_ratio = [0.1, 0.1]; "
    "allowed: each value once",
}


def test_bad_input_is_one_line(command, config):
    for keys, line in REFUSED.items():
        done = command("orbits", config(f"orbits: {{{keys}}}\n" if keys else ""))
        assert not_a_line(done) == ""
        assert done.err.startswith(f"vibroplat: {line}")
        assert not results()
    done = command("orbits", config(ORBITS + "drive: {program: [{t_s: 0, supply_frequency_hz: 50}]}\n"))
    assert not_a_line(done) == ""
    assert done.err.startswith("vibroplat: c.yaml: drive.program is given; orbits and basins need a constant")
    assert command("orbits", config(ORBITS)).code == 0  # nothing is unfinished


def test_start_that_is_not_periodic_is_refused(command, config):
    """Exciters of different numbers of poles turn at different speeds, with no common period of one turn."""
    text = f"motors: [{{pole_pairs: 2}}, {{pole_pairs: 3}}]\norbits: {{{KEY}, start: 60, stop: 61}}\n"
    done = command("orbits", config(text))
    assert not_a_line(done) == ""
    assert done.err.startswith(
        "vibroplat: no orbit of period 1 near the guess: exciters are not synchronized: exciter 2 makes 0.66"
    )
    assert " turns in 1 of exciter 1; allowed: whole turns; their motors have 2 and 3 pole pairs; " in done.err


def test_exciters_nearly_in_step_are_told_apart_from_those_in_step(command, config):
    """With half as many poles an exciter turns nearly twice as fast, but for what both need against friction."""
    motors = "[{friction_radius_m: 1.0e-5}, {friction_radius_m: 1.0e-5, pole_pairs: 1, critical_torque_n_m: 0.6}]"
    text = f"machine: {{unbalance_radius_m: 0.03}}\nmotors: {motors}\norbits: {{{KEY}, start: 50, stop: 51}}\n"
    assert " exciters are not synchronized: exciter 2 makes 1.99" in command("orbits", config(text)).err


def test_unbalances_that_hang_are_no_orbit(command, config):
    """An equilibrium closes after any time, but exciter 1 makes no turn."""
    weak = "motor: {critical_torque_n_m: 1.0e-4}\nrun: {initial: {speed_ratio: 0.0}}\n"
    done = command("orbits", config(f"{weak}orbits: {{{KEY}, start: 50, stop: 51}}\n"))
    assert not_a_line(done) == ""
    assert "exciter 1 makes no turn" in done.err


class Elsewhere(Inline):
    """Works in another directory, as workers of a scheduler do."""

    def submit(self, function, *arguments):
        Path("elsewhere").mkdir(exist_ok=True)
        with contextlib.chdir("elsewhere"):
            return super().submit(function, *arguments)


def test_run_to_begin_from_is_relative_to_the_directory_of_the_command(command, config):
    assert command("run", config("run: {duration_s: 2}\n"), "--out", "runs").code == 0
    plan = f"orbits: {{{KEY}, start: 51.5, stop: 58.0, from: runs/c, max_points: 3}}\n"
    scene = load_config(config(plan))
    (branch,) = traced(scene, Elsewhere())
    assert (len(branch.rows), branch.ended) == (3, "max_points = 3 reached")
    settled = orbit(scene.replace({"drive.supply_frequency_hz": 51.5}))
    assert branch.rows[0]["rms_y_m"] == pytest.approx(settled.measures["rms_y_m"], rel=1e-6)
