"""Scenes that give each exciter its numbers: the same as with the older keys where exciters are equal, and not else."""

import numpy as np
import pytest
from common.results import bits

from vibroplat import Scene, simulate, sweep


def with_newer_keys(scene):
    """Write the exciters of a scene with the keys of section exciters."""
    tree = scene.to_tree()
    motor, machine = tree.pop("motor"), tree["machine"]
    own = {name: machine.pop(name) for name in ("unbalance_radius_m", "rotor_inertia_kg_m2")}
    tree["exciters"] = [motor | own | {"rotation": "counter-clockwise"}, own | motor]
    return Scene.from_tree(tree)


def test_runs_and_sweeps_of_equal_exciters_are_bit_for_bit_the_same(quickstart):
    plan = {"supply_frequency_hz": {"start": 50.0, "stop": 50.5, "step": 0.5, "direction": ["up"]}, "grid": {}}
    plan |= {"settle_by": "section", "max_settle_s": 0.3, "measure_s": 0.05, "lyapunov": False}
    contact = {"material": {"mass_ratio": 0.1, "layers": 1}, "contact.restitution": 0.5}
    old = quickstart.replace({**contact, "run.duration_s": 0.5, "run.perturbation": 0.01, "sweep": plan})
    new = with_newer_keys(old)
    assert (old.exciters, new.motor, new.motors) == (None, None, None)
    first, second = simulate(old), simulate(new)
    assert len(first.events) > 10
    assert bits(first.trajectory) == bits(second.trajectory)
    assert bits(first.events) == bits(second.events)
    assert first.summary | {"wall_s": 0} == second.summary | {"wall_s": 0}
    assert bits(sweep(old).sweep) == bits(sweep(new).sweep)


def test_mirrored_machine_moves_in_a_mirror(quickstart):
    """Both exciters turned the other way are the machine seen from behind: x and φ change their signs."""
    numbers = [{"unbalance_radius_m": 0.09}, {"unbalance_radius_m": 0.08, "critical_slip": 0.2}]
    rotations = ["counter-clockwise", "clockwise"]
    seen = quickstart.replace(
        exciters=[n | {"rotation": r} for n, r in zip(numbers, rotations, strict=True)],
        run={"duration_s": 0.5, "initial": {"phi1_rad": 0.3, "phase_difference_rad": 2.0}},
    ).replace({"solver.tolerance": 1e-10})
    # angles from the horizontal: φ becomes π − φ, and the exciters change places
    behind = quickstart.replace(
        exciters=[n | {"rotation": r} for n, r in zip(numbers[::-1], rotations, strict=True)],
        run={
            "duration_s": 0.5,
            "initial": {"phi1_rad": np.pi - (2.0 - 0.3), "phase_difference_rad": -2.0 + 2.0 * np.pi},
        },
    ).replace({"solver.tolerance": 1e-10})
    times = np.linspace(0.0, 0.5, 101)
    one, other = (simulate(scene)(times) for scene in (seen, behind))
    for name, sign in (("x_m", -1.0), ("y_m", 1.0), ("phi_rad", -1.0), ("gap_m", 1.0)):
        np.testing.assert_allclose(other[name], sign * one[name], atol=1e-6 * np.abs(one[name]).max(), err_msg=name)
    np.testing.assert_allclose(np.pi - other["phi1_rad"], one["phi2_rad"], atol=1e-6)
    assert np.abs(one["x_m"]).max() > 1e-5


def test_phase_difference_of_co_rotating_exciters_is_that_of_their_angles(quickstart):
    exciters = [{"rotation": "clockwise"}, {"rotation": "clockwise"}]
    initial = {"phase_difference_rad": 0.4, "phi1_rad": 1.0}
    scene = quickstart.replace(exciters=exciters, run={"duration_s": 0.05, "initial": initial})
    scene = scene.replace({"material.mass_ratio": 0.0})
    run = simulate(scene)
    first = run.trajectory.iloc[0]
    assert first["phi1_rad"] - first["phi2_rad"] == pytest.approx(0.4, abs=1e-15)
    assert first["phi1_rate_rad_per_s"] == first["phi2_rate_rad_per_s"] < 0.0
    between = run.trajectory.query("t_s > 0.025")
    mean = (between["phi1_rad"] - between["phi2_rad"]).mean()
    assert run.summary["phase_difference_rad"] == pytest.approx(mean, abs=0.02)
    assert run.summary["phase_coherence"] > 0.99
