"""Peaks of a start and of a stop with further seeds."""

import pytest
from common.places import ROOT

from vibroplat import load_config, simulate
from vibroplat.motion.seeds import MORE_SEEDS, peaks_of_seeds


@pytest.fixture(scope="module")
def screen():
    return load_config(ROOT / "configs" / "templates" / "screen.yaml", {"solver.engine": "taylor"})


def test_peaks_of_a_start_have_ranges_over_seeds(screen):
    """Each end is the peak of a whole run with its seed, though the further runs are shorter."""
    whole = [simulate(screen.replace({"run.seed": k}), keep="summary") for k in range(MORE_SEEDS + 1)]
    found = peaks_of_seeds(whole[0])
    assert found["seeds"] == len(whole)
    for name in ("whole_stroke_x_m", "whole_stroke_y_m", "whole_foundation_force_x_max_n"):
        peaks = [run.summary[name] for run in whole]
        assert found[name] == pytest.approx([min(peaks), max(peaks)], rel=1e-9)
    assert found["whole_stroke_x_m"][1] > 3.0 * found["whole_stroke_x_m"][0]
    assert found["captured"] == 0


def test_a_run_that_still_changes_has_ranges_although_its_measured_part_has_the_peaks(screen):
    """Its measured part is no steady operation; and where some starts are captured, it is told."""
    short = screen.replace({"run.duration_s": 0.7})
    run = simulate(short, keep="summary")
    assert run.summary["whole_stroke_y_m"] < 1.05 * run.summary["stroke_y_m"]
    assert "whole_stroke_y_m" in peaks_of_seeds(run)
    stiff = screen.replace({"machine.stiffness_phi_n_m_per_rad": 9.3e6})
    runs = [simulate(stiff.replace({"run.seed": k}), keep="summary") for k in range(MORE_SEEDS + 1)]
    captured = sum(run.summary["excitation_frequency_hz"] < 20.0 for run in runs)
    assert 1 < peaks_of_seeds(runs[0])["captured"] <= captured < MORE_SEEDS


@pytest.mark.parametrize("engine", ["taylor", "native"])
def test_all_runs_of_a_range_count_with_either_engine(screen, engine):
    """However long they are."""
    slow = {"drive.supply_frequency_hz": 14.0, "run.duration_s": 1.5, "solver.engine": engine}
    run = simulate(screen.replace(slow), keep="summary")
    assert (run.summary["engine"], peaks_of_seeds(run)["seeds"]) == (engine, 20)


def test_a_motor_that_is_switched_off_is_so_in_other_phases(screen):
    """The start has settled by then, and seeds no longer matter: when it is switched off does."""
    program = [{"t_s": 0.0, "supply_frequency_hz": 50.0}, {"t_s": 12.0, "off": True}]
    run = simulate(screen.replace({"drive.program": program, "run.duration_s": 30.0}), keep="summary")
    low, high = peaks_of_seeds(run)["whole_stroke_y_m"]
    assert high > 1.001 * low


def test_steady_motion_and_one_that_shall_not_be_disturbed_have_no_further_seeds(screen):
    steady = simulate(screen.replace({"run.initial.speed_ratio": 0.98, "material.mass_ratio": 0.0}), keep="summary")
    assert "whole_motor_power_1_max_w" in peaks_of_seeds(steady)
    assert peaks_of_seeds(simulate(screen.replace({"run.perturbation": 0.0}), keep="summary"))["seeds"] == 1


def test_a_run_that_continues_undisturbed_has_no_further_seeds_but_other_times_of_switching(screen, tmp_path):
    """A stop within it is in other phases; one at its beginning is where it is."""
    simulate(screen.replace({"run.duration_s": 0.5}), keep="table").save(tmp_path / "first")
    on, off = {"t_s": 0.0, "supply_frequency_hz": 50.0}, {"supply_frequency_hz": 50.0, "off": True}
    run = {"run": {"duration_s": 0.5, "initial": {"from": str(tmp_path / "first")}}}
    for program, count in (([on], 1), ([off | {"t_s": 0.0}], 1), ([on, off | {"t_s": 0.6}], MORE_SEEDS + 1)):
        assert peaks_of_seeds(simulate(screen.replace({"drive.program": program} | run)))["seeds"] == count
