"""Peaks of a start and of a stop with further seeds."""

import pytest
from common.places import ROOT

from vibroplat import load_config, simulate
from vibroplat.motion.seeds import MORE_SEEDS, peaks_of_seeds


@pytest.fixture(scope="module")
def screen():
    return load_config(ROOT / "configs" / "templates" / "screen.yaml")


def test_peaks_of_a_start_have_ranges_over_seeds(screen):
    """Each end is the peak of a whole run with its seed, though the further runs are shorter."""
    whole = [simulate(screen.replace({"run.seed": k}), keep="summary") for k in range(MORE_SEEDS + 1)]
    found = peaks_of_seeds(whole[0])
    assert found["seeds"] == len(whole)
    for name in ("whole_stroke_x_m", "whole_stroke_y_m", "whole_foundation_force_x_max_n"):
        peaks = [run.summary[name] for run in whole]
        assert found[name] == pytest.approx([min(peaks), max(peaks)], rel=1e-9)
    assert found["whole_stroke_x_m"][1] > 3.0 * found["whole_stroke_x_m"][0]


def test_a_motor_that_is_switched_off_is_so_in_other_phases(screen):
    """The start has settled by then, and seeds no longer matter: when it is switched off does."""
    program = [{"t_s": 0.0, "supply_frequency_hz": 50.0}, {"t_s": 12.0, "off": True}]
    run = simulate(screen.replace({"drive.program": program, "run.duration_s": 30.0}), keep="summary")
    low, high = peaks_of_seeds(run)["whole_stroke_y_m"]
    assert high > 1.001 * low


def test_steady_motion_and_one_that_shall_not_be_disturbed_have_no_further_seeds(screen):
    steady = simulate(screen.replace({"run.initial.speed_ratio": 0.98, "material.mass_ratio": 0.0}), keep="summary")
    assert "whole_motor_power_1_max_w" in peaks_of_seeds(steady)
    assert peaks_of_seeds(simulate(screen.replace({"run.perturbation": 0.0}), keep="summary")) == {}
