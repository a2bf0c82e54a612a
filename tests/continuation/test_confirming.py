"""Sweeps whose points are confirmed by orbits."""

import numpy as np
import pytest

from continuation.helpers import MACHINE
from vibroplat import load_config, sweep


def swept(**changes):
    """Sweep the test machine over a few frequencies."""
    plan = {"supply_frequency_hz": {"start": 46.0, "stop": 50.0, "step": 1.0}, "confirm": "orbits"}
    scene = load_config(MACHINE, {"solver.engine": "taylor", "material.mass_ratio": 0.2, "sweep": plan | changes})
    return sweep(scene)


def test_periodic_points_are_those_of_their_orbits():
    """Settled to 1e-7, the motion is the orbit: frequency and RMS of the whole turns that were measured."""
    table = swept(settle_tolerance=1e-7, max_settle_s=60.0)
    assert (table["confirmation"] == "").all()
    assert table["orbit_residual"].max() < 1e-8
    assert table["orbit_distance"].max() < 1e-5
    apart = (table["orbit_excitation_frequency_hz"] - table["excitation_frequency_hz"]).abs()
    assert apart.max() < 1e-5
    for name in ("rms_x_m", "rms_y_m"):
        assert table[f"orbit_{name}"].to_numpy() == pytest.approx(table[name].to_numpy(), rel=1e-5, abs=1e-11)
    assert (table["orbit_unstable"] == 0).all()
    size = np.hypot(table["multiplier_1_re"], table["multiplier_1_im"])
    assert ((size > 0.8) & (size < 1.0)).all()
    assert table["exponent_1_per_s"].isna().all()


@pytest.mark.long
def test_points_without_a_period_get_exponents():
    frequencies = {"start": 60.0, "stop": 60.0, "step": 1.0}
    (row,) = swept(supply_frequency_hz=frequencies, max_settle_s=5.0).to_dict("records")
    assert row["period"] == 0
    assert np.isnan(row["orbit_residual"])
    assert row["exponent_1_per_s"] >= row["exponent_2_per_s"] >= row["exponent_3_per_s"]


def test_sweeps_without_confirmation_have_no_such_columns():
    assert "orbit_residual" not in swept(confirm=None)
