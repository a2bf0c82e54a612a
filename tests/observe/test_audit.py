"""Energy balance of whole runs, and the outcome of those that do not keep it."""

from itertools import product

import pytest
from common.places import QUICKSTART, ROOT

from vibroplat import load_config, simulate
from vibroplat.report.summary import inaccuracy


@pytest.mark.parametrize("sticking", [0.0, 0.15])
@pytest.mark.parametrize(
    ("restitution", "law"), [(0.0, "conservative"), (0.5, "central"), (0.9, "printed"), (1.0, "conservative")]
)
def test_residuals_with_impacts(quickstart, restitution, law, sticking):
    contact = {"restitution": restitution, "restitution_threshold_m_per_s": sticking, "impact_law": law}
    scene = quickstart.replace({"contact": contact, "run.duration_s": 4.0, "solver.tolerance": 1e-8})
    run = simulate(scene, keep="events")
    stuck = (run.events["kind"] == "impact") & (run.events["gap_rate_after_m_per_s"] == 0.0)
    assert run.outcome == "ok"
    assert run.summary["impacts"] > 40
    assert stuck.any() == (sticking > 0.0 or restitution == 0.0)
    assert run.summary["energy_residual"] <= 1e-6
    if law != "printed":
        assert run.summary["momentum_residual"] <= 1e-7


def test_energy_residual_needs_the_truncation_term(printed):
    """In-phase rotation rocks the platform: the first-order axes feed energy, which the audit names."""
    scene = printed.replace(
        {
            "drive.supply_frequency_hz": 38.0,
            "run.duration_s": 4.0,
            "run.initial": {"phase_difference_rad": 0.3},
            "solver.tolerance": 1e-9,
        }
    )
    summary = simulate(scene, keep="summary").summary
    assert summary["energy_residual"] <= 1e-6
    assert abs(summary["truncation_work_j"]) > 1e3 * abs(summary["energy_residual_j"])


def test_printed_law_loses_the_upper_layers_momentum(quickstart):
    changes = {"contact.impact_law": "printed", "contact.restitution": 0.5}
    summary = simulate(quickstart.replace(changes), keep="summary").summary
    assert summary["momentum_residual"] > 1e-4


def with_angle(scene, angle):
    """Let exciter 1 begin at an angle that a configuration may not have."""
    initial = scene.run.initial.model_copy(update={"phi1_rad": angle})
    return scene.model_copy(update={"run": scene.run.model_copy(update={"initial": initial})})


def test_run_whose_angles_have_no_digits_left_is_inaccurate(quickstart):
    run = simulate(with_angle(quickstart, 1e20).replace({"solver.engine": "native"}))
    residual = run.summary["energy_residual"]
    assert residual > 0.1
    assert run.outcome == "inaccurate"
    assert run.summary["simulated_s"] == quickstart.run.duration_s
    assert run.summary["detail"] == (
        f"energy residual {residual:.3g} exceeds 0.05, the limit at tolerance 1e-06; lower solver.tolerance, and "
        "check the orders of magnitude in the scene; solver.engine = taylor may succeed"
    )
    assert run.trajectory["t_s"].iloc[-1] == quickstart.run.duration_s


def test_limits_of_the_residuals(quickstart):
    for tolerance, energy, momentum, named in (
        (1e-2, 0.49, 0.099, ""),
        (1e-2, 0.51, 0.0, "energy"),
        (1e-2, 0.0, 0.11, "momentum"),
        (1e-3, 0.15, 0.031, ""),
        (1e-3, 0.16, 0.0, "energy"),
        (1e-12, 0.049, 0.0099, ""),
        (1e-12, 0.051, 0.011, "energy"),
        (1e-12, 0.049, 0.011, "momentum"),
        (1e-6, None, None, ""),
    ):
        scene = quickstart.replace({"solver.tolerance": tolerance})
        told = inaccuracy({"energy_residual": energy, "momentum_residual": momentum}, scene)
        assert told.partition(" ")[0] == named


def test_impact_law_that_does_not_keep_momentum_is_judged_by_energy_alone(quickstart):
    scene = quickstart.replace({"contact.impact_law": "printed"})
    assert inaccuracy({"energy_residual": 0.0, "momentum_residual": 1.0}, scene) == ""
    assert inaccuracy({"energy_residual": 0.1, "momentum_residual": 1.0}, scene).startswith("energy residual 0.1 ")


HONEST = [*sorted((ROOT / "tests/reference").glob("*.yaml")), ROOT / "configs/paper/f30.7-mu0.yaml", QUICKSTART]


def test_honest_runs_at_coarse_tolerances_stay_well_within_the_limits():
    for path, tolerance in product(HONEST, (1e-2, 1e-3)):
        scene = load_config(path, {"solver.tolerance": tolerance})
        summary = simulate(scene, keep="summary").summary
        assert summary["outcome"] == "ok", path.stem
        doubled = {name: 2.0 * summary[name] for name in ("energy_residual", "momentum_residual")}
        assert inaccuracy(doubled, scene) == "", path.stem


@pytest.mark.parametrize(
    ("mass_ratio", "share", "frequency"), [(0.2, 0.75, 18.5), (1e-6, 1e-6, 1e4), (0.2, 1e-6, 18.5)]
)
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
