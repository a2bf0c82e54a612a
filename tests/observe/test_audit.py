"""Energy balance of whole runs, and the outcome of those that do not keep it."""

from __future__ import annotations

import pytest
from common.places import QUICKSTART, ROOT
from common.random_scenes import random_scene

from vibroplat import load_config, simulate
from vibroplat.observe.audit import inaccuracy

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
    scene = quickstart.replace({"contact": contact, "run.duration_s": 4.0, "solver.tolerance": 1e-8})
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
            "solver.tolerance": 1e-9,
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


# -- motions that do not keep their balances ------------------------------------------------------------


def with_angle(scene, angle):
    """Let exciter 1 begin at an angle that a configuration may not have."""
    initial = scene.run.initial.model_copy(update={"phi1_rad": angle})
    return scene.model_copy(update={"run": scene.run.model_copy(update={"initial": initial})})


def test_run_whose_angles_have_no_digits_left_is_inaccurate(quickstart):
    run = simulate(with_angle(quickstart, 1e20))
    residual = run.summary["energy_residual"]
    assert residual > 0.1
    assert run.outcome == "inaccurate"
    assert run.summary["simulated_s"] == quickstart.run.duration_s
    assert run.summary["detail"] == (
        f"energy residual {residual:.3g} is beyond 0.05, the limit at tolerance 1e-06; lower solver.tolerance, and "
        "check the scene for sizes that are far apart"
    )
    assert run.trajectory["t_s"].iloc[-1] == quickstart.run.duration_s


def test_random_scene_that_loses_its_energy_at_a_coarse_tolerance_is_ok_at_a_finer_one():
    scene = random_scene(467).replace({"run.perturbation": 0.0})
    assert simulate(scene.replace({"solver.tolerance": 1e-2}), keep="summary").outcome == "inaccurate"
    assert simulate(scene.replace({"solver.tolerance": 1e-5}), keep="summary").outcome == "ok"


@pytest.mark.parametrize(
    ("tolerance", "energy", "momentum", "named"),
    [
        (1e-2, 0.49, 0.099, ""),
        (1e-2, 0.51, 0.0, "energy"),
        (1e-2, 0.0, 0.11, "momentum"),
        (1e-3, 0.15, 0.031, ""),
        (1e-3, 0.16, 0.0, "energy"),
        (1e-12, 0.049, 0.0099, ""),
        (1e-12, 0.051, 0.011, "energy"),
        (1e-12, 0.049, 0.011, "momentum"),
        (1e-6, None, None, ""),
    ],
)
def test_limits_of_the_residuals(tolerance, energy, momentum, named, quickstart):
    scene = quickstart.replace({"solver.tolerance": tolerance})
    told = inaccuracy({"energy_residual": energy, "momentum_residual": momentum}, scene)
    assert told.partition(" ")[0] == named


def test_impact_law_that_does_not_keep_momentum_is_judged_by_energy_alone(quickstart):
    scene = quickstart.replace({"contact.impact_law": "printed"})
    assert inaccuracy({"energy_residual": 0.0, "momentum_residual": 1.0}, scene) == ""
    assert inaccuracy({"energy_residual": 0.1, "momentum_residual": 1.0}, scene).startswith("energy residual 0.1 ")


HONEST = [*sorted((ROOT / "tests/reference").glob("*.yaml")), ROOT / "configs/paper/f30.7-mu0.yaml", QUICKSTART]


@pytest.mark.parametrize("path", HONEST, ids=lambda path: path.stem)
@pytest.mark.parametrize("tolerance", [1e-2, 1e-3])
def test_honest_runs_at_coarse_tolerances_stay_well_within_the_limits(tolerance, path):
    scene = load_config(path, {"solver.tolerance": tolerance})
    summary = simulate(scene, keep="summary").summary
    assert summary["outcome"] == "ok"
    doubled = {name: 2.0 * summary[name] for name in ("energy_residual", "momentum_residual")}
    assert inaccuracy(doubled, scene) == ""


# -- the noise of the contact force ---------------------------------------------------------------------


@pytest.mark.parametrize("mass_ratio", [0.2, 1e-6])
@pytest.mark.parametrize("share", [0.75, 1e-6])
@pytest.mark.parametrize("frequency", [18.5, 1e4])
def test_contact_force_below_zero_is_within_the_noise_that_the_summary_tells(mass_ratio, share, frequency, quickstart):
    material = {"mass_ratio": mass_ratio, "lower_share": share, "natural_frequency_hz": frequency}
    changes = {f"material.{key}": value for key, value in material.items()}
    run = simulate(quickstart.replace({**changes, "run.duration_s": 0.2}))
    noise, least = run.summary["contact_force_noise_n"], run.summary["contact_force_min_n"]
    assert 0.0 < noise < 0.1 * run.scene.force_scale
    assert run.outcome == "ok"
    assert least > -noise
    force = run.trajectory["contact_force_n"]
    assert force.min() > -noise
    touching = force[(run.trajectory["mode"] == "attached") & ~run.trajectory["t_s"].isin(run.events["t_s"])]
    assert touching.min() > 0.0


def test_small_forces_are_not_clipped(runs):
    """At liftoffs F_c falls through zero; what round-off makes of it is in the table as it is."""
    table, events = runs["two layers"].trajectory, runs["two layers"].events
    falls = table[table["t_s"].isin(events["t_s"][events["kind"] == "liftoff"]) & (table["mode"] == "attached")]
    assert len(falls) > 1
    assert (falls["contact_force_n"] != 0.0).any()


def test_scene_without_contact_has_no_noise_of_its_force(runs):
    assert runs["bare"].summary["contact_force_noise_n"] is None
