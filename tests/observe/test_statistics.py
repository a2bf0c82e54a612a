"""Statistics and the Poincaré section of a run."""

from __future__ import annotations

import numpy as np
import pytest

from vibroplat import simulate


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
