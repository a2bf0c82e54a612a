"""Accelerations as columns of the trajectory."""

import numpy as np
import pytest

from vibroplat import simulate


@pytest.mark.parametrize("engine", ["native", "taylor"])
def test_columns_of_accelerations_are_derivatives_of_the_velocities(quickstart, engine):
    """Of both modes, in free flight and in contact, while the supply changes; of a point, of first order in phi."""
    program = [{"t_s": 0.0, "supply_frequency_hz": 45.0}, {"t_s": 0.2, "supply_frequency_hz": 55.0}]
    asked = {"output": {"accelerations": True, "points": {"tip": [0.3, 0.4]}}, "run.duration_s": 0.3}
    changes = {"drive": {"program": program}, "run.initial": {"speed_ratio": 0.9, "phase_difference_rad": 1.0}}
    scene = quickstart.replace(asked | changes | {"solver.engine": engine, "solver.tolerance": 1e-9})
    run = simulate(scene)
    events, step = run.events["t_s"].to_numpy(), 1e-5
    times = np.arange(0.02, 0.28, 0.0037)
    times = times[np.abs(times[:, np.newaxis] - events).min(axis=1) > 3.0 * step]
    at, after, before = run(times), run(times + step), run(times - step)
    assert {*at["mode"]} == {"attached", "flight"}
    rate = {n: (after[f"{n}_rate_{u}"] - before[f"{n}_rate_{u}"]) / (2.0 * step) for n, u in UNITS.items()}
    x, y = scene.named_points["tip"]
    for axis, more in (("x", -y), ("y", x)):
        largest = at[f"acceleration_{axis}_m_per_s2"].abs().max()
        close = {"rel": 1e-4, "abs": 1e-4 * largest}
        assert at[f"acceleration_{axis}_m_per_s2"].tolist() == pytest.approx(rate[axis].tolist(), **close)
        tip = rate[axis] + more * rate["phi"]
        assert at[f"acceleration_{axis}_tip_m_per_s2"].tolist() == pytest.approx(tip.tolist(), **close)
    machine, mass = scene.machine, scene.platform_mass + scene.material_mass
    force = machine.stiffness_y_n_per_m * at["y_m"] + machine.damping_y_n_s_per_m * at["y_rate_m_per_s"]
    assert at["foundation_force_y_n"].tolist() == pytest.approx(force.tolist(), rel=1e-12)
    assert at["foundation_force_y_n"].mean() == pytest.approx(-mass * machine.gravity_m_per_s2, rel=0.3)
    last = run.trajectory.iloc[-1].to_dict()
    simulate(quickstart.replace({"run.initial": {"state": last}, "run.duration_s": 0.01}))


UNITS = {"x": "m_per_s", "y": "m_per_s", "phi": "rad_per_s"}
