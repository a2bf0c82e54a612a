"""Statistics and the Poincaré section of a run."""

from __future__ import annotations

from contextlib import closing

import numpy as np
import pytest

from vibroplat import simulate
from vibroplat.flow.motion import Motion
from vibroplat.integrate.choice import make_engine
from vibroplat.model.parameters import parameters
from vibroplat.observe.statistics import Statistics


def test_statistics_agree_with_the_tables(quickstart):
    run = simulate(quickstart.replace({"run.duration_s": 2.0, "output.sample_rate_hz": 20_000.0}))
    summary, table = run.summary, run.trajectory
    turns = np.floor(table["phi1_rad"] / (2.0 * np.pi))
    crossings = table["t_s"][1:][np.diff(turns) > 0]
    window = crossings[crossings >= 1.0]
    part = table[table["t_s"].between(window.iloc[0], window.iloc[-1])]
    assert summary["rms_y_m"] == pytest.approx(part["y_m"].std(ddof=0), rel=1e-3)
    assert summary["excitation_frequency_hz"] == pytest.approx(
        (len(window) - 1) / (window.iloc[-1] - window.iloc[0]), rel=1e-4
    )
    assert summary["contact_force_max_n"] == pytest.approx(table["contact_force_n"].max(), rel=1e-4)
    assert summary["gap_max_m"] == pytest.approx(table["gap_m"].max(), rel=1e-3)
    assert summary["flight_fraction"] == pytest.approx((part["mode"] == "flight").mean(), abs=2e-3)


def test_an_exciter_that_swings_completes_no_turn(printed):
    idle = {"critical_torque_n_m": 0.0, "friction_radius_m": 0.0}
    state = {"phi1_rad": 0.5, "phi2_rad": 0.2}
    scene = printed.replace({"motor": idle, "run.duration_s": 4.0, "run.initial": {"state": state}})
    run = simulate(scene)
    assert run.summary["excitation_frequency_hz"] is None
    assert run.summary["measured_s"] == pytest.approx(2.0, abs=0.01)
    assert len(run.section) <= 1


def test_poincare_section_is_the_motion_at_whole_turns(quickstart):
    run = simulate(quickstart.replace({"run.duration_s": 2.0}))
    section = run.section
    assert len(section) == pytest.approx(1.0 * run.summary["excitation_frequency_hz"], abs=1.5)
    turns = section["phi1_rad"] / (2.0 * np.pi)
    assert np.allclose(turns, np.round(turns), atol=1e-12)
    dense = run(section["t_s"])
    for column in ("y_m", "gap_rate_m_per_s", "contact_force_n"):
        assert np.allclose(section[column], dense[column], rtol=0.0, atol=1e-9 * dense[column].abs().max())


def test_a_turn_completed_in_the_first_step_is_counted(quickstart):
    scene = quickstart.replace({"run.duration_s": 0.01, "run.initial.phi1_rad": 2.0 * np.pi - 1e-9})
    marks = simulate(scene).measures.marks
    assert marks["passed"] == 1.0
    p = parameters(scene)
    with closing(make_engine(scene, p)) as engine:
        motion, whole = Motion(scene, p, engine), Statistics(0.0)
        motion.to_time(1e-4, [whole])
    assert whole.measures.marks["turns"] == 1
    assert whole.measures.marks["first_time"] == pytest.approx(1e-9 / scene.synchronous_speeds[0], rel=0.1)


def test_an_absurd_speed_ends_with_an_outcome_and_not_with_endless_turns(quickstart):
    state = {"phi1_rate_rad_per_s": 1e30}
    run = simulate(quickstart.replace({"run.initial": {"state": state}, "run.duration_s": 0.01}), keep="summary")
    assert run.outcome in {"ok", "solver-failure", "non-finite", "event-storm", "beyond-model"}
