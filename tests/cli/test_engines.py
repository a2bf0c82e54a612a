"""``--engine`` and ``--check`` on the command line."""

import re

from common.places import QUICKSTART

from vibroplat import load_config
from vibroplat.check.runs import compare_run
from vibroplat.check.studies import cross_check
from vibroplat.results.provenance import configuration_hash
from vibroplat.results.tables import read_json

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
