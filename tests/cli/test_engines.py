"""``--engine`` and ``--check`` on the command line."""

import itertools
import re

import pytest
from common.commands import not_a_line
from common.places import QUICKSTART

from vibroplat import load_config
from vibroplat.check.runs import compare_run
from vibroplat.check.studies import cross_check
from vibroplat.paper import reproduction
from vibroplat.results.provenance import configuration_hash
from vibroplat.results.tables import read_json
from vibroplat.study.study import conditions

SHORT = ("--set", "run.duration_s=0.1")
FREQUENCIES = "{start: 44.0, stop: 46.0, step: 1.0, direction: up}"
PLAN = f"{{supply_frequency_hz: {FREQUENCIES}, measure_s: 0.2, lyapunov: false, grid: {{}}}}"
SWEEP = ("--set", f"sweep={PLAN}", "--engine", "native")


def wrong(scene):
    return scene.replace({"motor.friction_radius_m": 1.0001 * scene.motor.friction_radius_m})


def softer(scene):
    return scene.replace({"machine.stiffness_y_n_per_m": 0.99 * scene.machine.stiffness_y_n_per_m})


def test_engine_is_short_for_the_key(command, kernels, here):
    done = command("run", QUICKSTART, *SHORT, "--engine", "taylor", "--set", "solver.engine=taylor")
    assert (done.code, done.err) == (0, "")
    proof = read_json(here / "results/quickstart/run", "provenance")
    same = load_config(QUICKSTART, {"run.duration_s": 0.1, "solver.engine": "taylor"})
    assert (proof["engine"], proof["configuration_sha256"]) == ("taylor", configuration_hash(same))


@pytest.mark.parametrize("name", ["run", "sweep", "paper"])
def test_a_bad_engine_is_told_as_a_bad_key_is(command, kernels, here, name):
    arguments = (name, QUICKSTART) if name in ("run", "sweep") else (name,)
    bad = command(*arguments, "--engine", "heun")
    assert not_a_line(bad) == ""
    assert "solver.engine = 'heun'; allowed: 'auto', 'native'" in bad.err
    assert bad.err == command(*arguments, "--set", "solver.engine=heun").err
    done = command(*arguments, "--engine", "native", "--set", "solver.engine=sundae")
    assert not_a_line(done) == ""
    assert "--engine native and --set solver.engine=sundae differ; allowed: one of the two" in done.err


class _Caught(BaseException):
    """Ends a command where it would begin its work."""


def test_engine_reaches_the_paper(command, kernels, here, monkeypatch):
    found = []

    def caught(study, *_, **__):
        for trial in itertools.chain(*study.trials()):
            found.extend(trial.scene(name) for name in (*trial.names, reproduction.NON_IMPACT))
        raise _Caught

    monkeypatch.setattr("vibroplat.cli.studies.run_and_print", caught)
    with pytest.raises(_Caught):
        command("paper", "--machine", "calibrated", "--engine", "sundae", "--jobs", "1", "--seeds", "2")
    assert {conditions(scene)["engine"] for scene in found} == {"sundae"}
    assert {scene.solver.engine for scene in found} == {"sundae"}


def test_a_checked_run_is_the_run(command, kernels, here):
    assert command("run", QUICKSTART, *SHORT, "--engine", "native", "--out", "plain").code == 0
    done = command("run", QUICKSTART, *SHORT, "--engine", "native", "--check")
    assert (done.code, done.err) == (0, "")
    lines = done.out.splitlines()
    (start,) = (n for n, line in enumerate(lines) if line.startswith("  checked by: "))
    assert len(lines) - start <= 5
    summary = read_json(here / "results/quickstart/run", "summary")
    plain = read_json(here / "plain/quickstart/run", "summary")
    assert summary["check"]["agrees"] is True
    assert {k: v for k, v in summary.items() if k not in ("check", "wall_s")} == {
        k: v for k, v in plain.items() if k != "wall_s"
    }
    proof, before = (
        read_json(here / place / "quickstart/run", "provenance")["files"] for place in ("results", "plain")
    )
    for name in ("trajectory.parquet", "events.parquet"):
        assert proof[name] == before[name]


def test_a_run_that_engines_disagree_on_has_exit_code_1(command, kernels, here, monkeypatch):
    monkeypatch.setitem(compare_run.__kwdefaults__, "other", wrong)
    done = command("run", QUICKSTART, *SHORT, "--engine", "native", "--check", "--set", "solver.tolerance=1e-10")
    assert done.code == 1
    assert done.err.startswith("vibroplat: engines disagree at 0.0")
    assert len(done.err.splitlines()) == 1
    check = read_json(here / "results/quickstart/run", "summary")["check"]
    assert (check["agrees"], check["disagreement"] in done.err) == (False, True)


def test_a_sweep_is_checked_and_resumed(command, kernels, here):
    done = command("sweep", QUICKSTART, *SWEEP)
    assert (done.code, done.err) == (0, "")
    assert "checked by" not in done.out
    done = command("sweep", QUICKSTART, *SWEEP, "--check", "--resume")
    assert (done.code, done.err) == (0, "")
    assert "3 tasks from before" in done.out
    assert ", 3 of 3 motions agree, measures within " in done.out
    check = read_json(here / "results/quickstart/sweep", "provenance")["check"]
    assert (check["checked"], check["disagreements"]) == (3, [])


def test_a_study_that_engines_disagree_on_has_exit_code_1(command, kernels, here, monkeypatch):
    monkeypatch.setitem(cross_check.__kwdefaults__, "other", softer)
    done = command("sweep", QUICKSTART, *SWEEP, "--check")
    assert done.code == 1
    first, *_, last = done.err.splitlines()
    assert first.startswith("vibroplat: engines disagree at supply_frequency_hz = 4")
    assert "branch 0" in first
    assert ": rms_y_m = " in first
    assert re.fullmatch(r"vibroplat: engines disagree at (\d+) of \1 motions", last)
    assert read_json(here / "results/quickstart/sweep", "provenance")["check"]["disagreements"][0] in first
