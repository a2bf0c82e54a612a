"""A motor that is bolted to the platform, which takes its reaction."""

import numpy as np
import pytest
from common.places import QUICKSTART

from vibroplat import load_config, simulate

ENGINES = ("native", "taylor")
TURNING = {"native": 1e-10, "taylor": 1e-12}


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


def test_engines_agree_and_the_balance_of_energy_holds_where_the_deck_rocks():
    """In a start, where torques are large; the moment into the foundation has them, and is another."""
    changes = {"run.initial": {"speed_ratio": 0.5, "phase_difference_rad": 2.0}}
    runs = [simulate(scene_of(engine, ("deck", "deck"), **changes)) for engine in ENGINES]
    first, second = (run.final_state for run in runs)
    assert first == pytest.approx(second, rel=1e-6, abs=1e-8 * np.abs(second).max())
    assert max(run.summary["energy_residual"] for run in runs) < 1e-8
    ground = simulate(scene_of("taylor", ("ground", "ground"), **changes))
    moment, other = (run.summary["whole_foundation_moment_max_n_m"] for run in (runs[1], ground))
    assert abs(moment / other - 1.0) > 0.01
