"""Energy balance of whole runs."""

from __future__ import annotations

import pytest

from vibroplat import simulate

LAWS = ("conservative", "central", "printed")


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_energy_residual_with_impacts(quickstart, restitution, law):
    scene = quickstart.replace(
        {
            "contact.restitution": restitution,
            "contact.impact_law": law,
            "run.duration_s": 2.0,
            "solver.tolerance": 1e-8,
        }
    )
    summary = simulate(scene, keep="summary").summary
    assert summary["outcome"] == "ok"
    assert summary["impacts"] > 40
    assert summary["energy_residual"] <= 1e-6


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("restitution", [0.5, 0.9, 1.0])
def test_residuals_with_impacts_that_stick(quickstart, restitution, law):
    contact = {"restitution": restitution, "sticking_speed_m_per_s": 0.15, "impact_law": law}
    scene = quickstart.replace({"contact": contact, "run.duration_s": 2.0, "solver.tolerance": 1e-8})
    run = simulate(scene, keep="events")
    stuck = (run.events["kind"] == "impact") & (run.events["gap_rate_after_m_per_s"] == 0.0)
    assert stuck.any()
    assert run.summary["energy_residual"] <= 1e-6
    if law != "printed":
        assert run.summary["momentum_residual"] <= 1e-7


def test_energy_residual_needs_the_truncation_term(printed):
    """In-phase rotation rocks the platform: the first-order axes feed energy, which the audit names."""
    scene = printed.replace(
        {
            "drive.supply_frequency_hz": 38.0,
            "run.duration_s": 4.0,
            "run.initial": {"phase_sum_rad": 0.3},
            "solver.tolerance": 1e-8,
        }
    )
    summary = simulate(scene, keep="summary").summary
    assert summary["energy_residual"] <= 1e-6
    assert abs(summary["truncation_work_j"]) > 1e3 * abs(summary["energy_residual_j"])


def test_elastic_impacts_without_dampers_keep_the_energy(quickstart):
    scene = quickstart.replace(
        {
            "machine.damping_x_n_s_per_m": 0.0,
            "machine.damping_y_n_s_per_m": 0.0,
            "machine.damping_phi_n_m_s_per_rad": 0.0,
            "motor": {"critical_torque_n_m": 0.0, "friction_radius_m": 0.0},
            "material.damping_ratio": 0.0,
            "contact.restitution": 1.0,
            "run.duration_s": 16.0,
            "solver.tolerance": 1e-10,
        }
    )
    summary = simulate(scene, keep="summary").summary
    assert summary["impacts"] >= 100
    assert summary["impact_loss_j"] == pytest.approx(0.0, abs=1e-12)
    assert summary["energy_residual"] <= 1e-7


@pytest.mark.parametrize("layers", [1, 2])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-8])
def test_residual_falls_with_the_tolerance(damped, layers, tolerance):
    scene = damped.replace(
        {
            "material": {"mass_ratio": 0.1, "layers": layers},
            "contact.restitution": 0.3,
            "run.duration_s": 2.0,
            "solver.tolerance": tolerance,
        }
    )
    # measured 3e-6 … 2e-5 at 1e-6 and 1e-8 … 3e-7 at 1e-8 over such scenes
    assert simulate(scene, keep="summary").summary["energy_residual"] <= 100.0 * tolerance


# -- momentum --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_impacts_keep_the_vertical_momentum(quickstart, restitution):
    changes = {"contact.restitution": restitution, "run.duration_s": 2.0, "solver.tolerance": 1e-8}
    summary = simulate(quickstart.replace(changes), keep="summary").summary
    assert summary["impacts"] > 30
    assert summary["momentum_residual"] <= 1e-7


def test_printed_law_loses_the_upper_layers_momentum(quickstart):
    changes = {"contact.impact_law": "printed", "contact.restitution": 0.5}
    summary = simulate(quickstart.replace(changes), keep="summary").summary
    assert summary["momentum_residual"] > 1e-4


def test_momentum_of_a_latch_is_that_of_its_impacts(quickstart):
    """Impacts that are closed by a sum carry the momentum that they would have carried one by one."""
    changes = {"contact.restitution": 0.6, "run.duration_s": 2.0, "solver.tolerance": 1e-9}
    summary = simulate(quickstart.replace(changes), keep="summary").summary
    assert summary["latches"] > 0
    assert summary["momentum_residual"] <= 1e-7
