"""Exciters with numbers of their own: equal ones as with the older keys; and motors that are bolted to the platform."""

import pytest
from common.places import QUICKSTART
from common.results import bits

from vibroplat import Scene, load_config, simulate

ENGINES = ("native", "taylor")
TURNING = {"native": 1e-10, "taylor": 1e-12}


def with_newer_keys(scene):
    tree = scene.to_tree()
    motor, machine = tree.pop("motor"), tree["machine"]
    own = {name: machine.pop(name) for name in ("unbalance_radius_m", "rotor_inertia_kg_m2")}
    tree["exciters"] = [motor | own | {"rotation": "counter-clockwise"}, own | motor]
    return Scene.from_tree(tree)


def test_runs_of_equal_exciters_are_bit_for_bit_the_same(quickstart):
    contact = {"material": {"mass_ratio": 0.1, "layers": 1}, "contact.restitution": 0.5}
    old = quickstart.replace({**contact, "run.duration_s": 0.5, "run.perturbation": 0.01})
    new = with_newer_keys(old)
    assert (old.exciters, new.motor, new.motors) == (None, None, None)
    first, second = simulate(old), simulate(new)
    assert len(first.events) > 10
    assert bits(first.trajectory) == bits(second.trajectory)
    assert bits(first.events) == bits(second.events)
    assert first.summary | {"wall_s": 0} == second.summary | {"wall_s": 0}


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


def scene_of(engine, mounts, torques=(1.2, 0.9), exciter=None, **changes):
    """A scene of the quickstart without material, whose motors have these torques and stand there."""
    same = {"rotation": "counter-clockwise"} | (exciter or {})
    exciters = [same | {"mounted_on": m, "critical_torque_n_m": t} for m, t in zip(mounts, torques, strict=True)]
    bare = {"exciters": exciters, "material.mass_ratio": 0.0, "run.duration_s": 0.4, "run.perturbation": 0.0}
    solver = {"solver.engine": engine, "solver.tolerance": TURNING[engine]}
    return load_config(QUICKSTART, bare | solver | changes)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("mounts", [("deck", "deck"), ("ground", "deck"), ("ground", "ground")], ids=" ".join)
def test_a_free_platform_turns_against_its_rotors(mounts, engine):
    """Rotors without unbalance to speak of, on the platform's centre, without springs against rotation.

    The angular momentum of the platform and of all rotors whose motors it bears stays 0; from rest it is exact.
    """
    rotor = {"position_m": [0.0, 0.0], "unbalance_radius_m": 1e-9, "rotor_inertia_kg_m2": 0.8e-3}
    free = {"machine.stiffness_phi_n_m_per_rad": 0.0, "machine.damping_phi_n_m_s_per_rad": 0.0}
    scene = scene_of(engine, mounts, (0.2, 0.4), rotor, **free, **{"run.initial": {"speed_ratio": 0.0}})
    run = simulate(scene)
    state, begun = run.final_state, run.trajectory[["phi1_rad", "phi2_rad"]].iloc[0].to_numpy()
    inertias = [0.8e-3 * (mount == "deck") for mount in mounts]
    turned = scene.body.inertia * state[[2, 9]]
    against = [inertias @ (state[[3, 4]] - begun), inertias @ state[[10, 11]]]
    assert turned == pytest.approx([-one for one in against], rel=1e-8, abs=1e-14)
    assert abs(state[9]) > 0.3 if "deck" in mounts else state[9] == 0.0
