"""Values at the ends of what a configuration takes: a run, or a named outcome, never a traceback."""

import pytest
from common.limits import cpu_seconds
from common.places import QUICKSTART

from vibroplat import load_config, simulate

FINISHED = {"ok", "inaccurate"}
OUTCOMES = FINISHED | {"solver-failure", "non-finite", "too-many-events", "outside-model-validity"}

RISE = {"t_s": 0.0, "supply_frequency_hz": 0.0}
PROGRAMS = {
    "of 1e-3 Hz": [{"t_s": 0.0, "supply_frequency_hz": 1e-3}],
    "that rises within 1e-6 s": [RISE, {"t_s": 1e-6, "supply_frequency_hz": 50.0}],
    "that rises for 1e30 s": [RISE, {"t_s": 1e30, "supply_frequency_hz": 50.0}],
    "that rises to 1e6 Hz": [RISE, {"t_s": 0.01, "supply_frequency_hz": 1e6}],
    "that rises to 1e-3 Hz": [RISE, {"t_s": 0.01, "supply_frequency_hz": 1e-3}],
    "of entries 1e-6 s apart": [RISE, {"t_s": 0.01, "supply_frequency_hz": 50.0}, {"t_s": 0.010001, "off": True}],
    "of 400 corners": [{"t_s": 5e-5 * i, "supply_frequency_hz": i % 2, "off": i % 3 == 0} for i in range(400)],
}


EXTREMES = {
    "machine.platform_mass_kg": [1e-30, 1e30],
    "machine.unbalance_mass_kg": [1e30],
    "machine.rotor_inertia_kg_m2": [1e-30],
    "machine.exciter_distance_m": [0.0, 1e30],
    "machine.stiffness_y_n_per_m": [1e30],
    "machine.gravity_m_per_s2": [0.0, 1e6],
    "motor.critical_torque_n_m": [0.0, 1e30],
    "motor.critical_slip": [1e-30, 1e30],
    "motor.rated_frequency_hz": [1e-30],
    "motor.friction_radius_m": [1e30],
    "exciters.0.unbalance_radius_m": [1e30],
    "material.mass_ratio": [5e-324, 1e30],
    "material.lower_share": [5e-324, 1.0 - 2e-16],
    "material.natural_frequency_hz": [1e-30, 1e30],
    "material.damping_ratio": [1e30],
    "contact.restitution": [1.0, 5e-324],
    "drive.supply_frequency_hz": [1e-30],
    "drive.program": list(PROGRAMS.values()),
    "run.initial.speed_ratio": [0.0, 1e-9, 1e30],
    "run.initial.phi1_rad": [1e10],
    "run.initial.state.y_m": [1e30],
    "run.initial.state.gap_m": [5e-324, 1e30],
    "run.initial.state.gap_rate_m_per_s": [1e30],
    "solver.tolerance": [1e-12, 1e-2],
    "output.sample_rate_hz": [1e-30],
}


@pytest.mark.parametrize("key", EXTREMES)
def test_extreme_value_ends_without_a_traceback(key, tmp_path):
    for value in EXTREMES[key]:
        scene = load_config(QUICKSTART, {"run.duration_s": 0.02, key: value})
        with cpu_seconds(30.0):
            run = simulate(scene)
        assert run.outcome in OUTCOMES
        assert (run.outcome in FINISHED) == (run.summary["simulated_s"] == scene.run.duration_s)
        undecided = run.outcome == "ok" and run.summary["detail"].startswith("undecided: ")
        assert len(run.summary["detail"].splitlines()) == (run.outcome != "ok" or undecided)
        run.save(tmp_path / "saved")


def test_solver_failure_prints_nothing_of_its_own(capfd):
    damped = {"material.damping_ratio": 0.05, "machine.damping_y_n_s_per_m": 400.0}
    # each of its swings has some chance to fail by round-off
    run = simulate(
        load_config(
            QUICKSTART, {"run.duration_s": 2.0, "run.initial.state.upper_m": 1e9, "solver.engine": "native", **damped}
        )
    )
    assert run.outcome == "solver-failure"
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("layers", [1, 2])
def test_everything_may_be_released_from_unstressed_springs(layers):
    zeros = {"y_m": 0.0} | ({"upper_m": 0.0} if layers == 2 else {})
    release = {"run.initial.state": zeros, "material.layers": layers, "solver.max_events_per_period": 50}
    run = simulate(load_config(QUICKSTART, {"run.duration_s": 0.02, **release}))
    assert run.outcome == "ok", run.summary["detail"]


@pytest.mark.long
def test_engine_of_callbacks_gives_up_at_absurd_speeds():
    absurd = {"run.duration_s": 0.1, "run.initial.speed_ratio": 1e6, "solver.engine": "sundae"}
    scene = load_config(QUICKSTART, absurd)
    with cpu_seconds(30.0):
        run = simulate(scene)
    assert run.outcome == "solver-failure"
    assert "more than 100000 residual calls within a period" in run.summary["detail"]
    assert run.summary["steps"] < 100_000
