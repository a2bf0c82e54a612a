"""Whole runs: repeatability, scenes that need less, outcomes, memory, continuation."""

import math
from pathlib import Path

import pytest
from common.known import ball_on_table

from vibroplat import load_config, simulate
from vibroplat.model.parameters import parameters


def test_means_are_of_whole_periods_wherever_a_run_ends(quickstart):
    """Of a motion that repeats after 4 turns, whose RMS over an odd number of turns is off by up to 3e-4."""
    scene = load_config(Path(__file__).parents[1] / "continuation" / "machine.yaml")
    scene = scene.replace({"material.mass_ratio": 0.2, "drive.supply_frequency_hz": 57.2, "solver.engine": "taylor"})
    found = [simulate(scene.replace({"run.duration_s": s}), keep="summary").summary for s in (20.0, 20.04, 20.07)]
    assert {(one["period"], one["measured_turns"] % 4) for one in found} == {(4, 0)}
    names = ("rms_y_m", "motor_power_w", "foundation_force_y_rms_n", "slip_1", "excitation_frequency_hz")
    for name in names:
        assert [one[name] for one in found] == pytest.approx([found[0][name]] * 3, rel=1e-10)
    assert {one["impacts_per_period"] for one in found} == {0.75}
    restless = simulate(quickstart.replace({"run.duration_s": 0.2}), keep="summary").summary
    assert restless["period"] == 0


def test_state_without_finite_accelerations_is_named(quickstart, monkeypatch):
    def broken(scene):
        p = parameters(scene)
        p.gravity = math.nan
        return p

    monkeypatch.setattr("vibroplat.motion.run.parameters", broken)
    parts = []
    run = simulate(quickstart, sink=(parts.append, parts.append))
    assert run.outcome == "non-finite"
    assert [len(part) for part in parts] == [0, 0]
    assert run.trajectory.empty
    assert run.summary["detail"].startswith("there are no finite accelerations; mode attached, ")
    assert "t = 0 s, state [0, " in run.summary["detail"]


def test_a_long_bare_run_is_restarted_seldom(printed):
    scene = printed.replace({"run.duration_s": 20.0, "solver.engine": "native"})
    assert simulate(scene, keep="summary").summary["restarts"] == 1


def test_period_of_the_storm_bound_is_the_synchronous_turn():
    run = simulate(ball_on_table(1.5, periods=3).replace({"solver.max_events_per_period": 1}))
    assert run.outcome == "too-many-events"


@pytest.mark.parametrize("name", ["two layers", "bare"])
def test_the_machine_vibrates_about_its_static_sag(name, runs):
    """There its springs carry its weight and that of the material."""
    run, machine = runs[name], runs[name].scene.machine
    weight = machine.gravity_m_per_s2 * (run.scene.platform_mass + sum(run.scene.layer_masses))
    sag = run.summary["static_sag_m"]
    assert sag == pytest.approx(weight / machine.stiffness_y_n_per_m)
    assert run.trajectory["y_m"].mean() == pytest.approx(-sag, abs=0.2 * run.summary["amplitude_y_m"])
