"""How far the platform may turn before a model of first order in φ breaks down."""

import math
from itertools import product

import numpy as np

from vibroplat import Machine, Scene
from vibroplat.model.accelerations import accelerations
from vibroplat.model.equations import residual as evaluate_residual
from vibroplat.model.parameters import parameters
from vibroplat.model.systems import SYSTEMS

from .helpers import mass_matrix, scene_of, settled

BARE = SYSTEMS[0]

#: Machines whose exciters are heavy and far out beside the platform's own inertia: they break down soon.
SEEDS = range(40)


def drawn(seed):
    rng = np.random.default_rng(seed)
    return Machine(
        platform_mass_kg=10.0 ** rng.uniform(0.0, 1.0),
        platform_inertia_kg_m2=10.0 ** rng.uniform(-3.0, -1.0),
        unbalance_mass_kg=10.0 ** rng.uniform(-1.0, 0.5),
        exciter_distance_m=10.0 ** rng.uniform(-1.0, 0.0),
        exciter_angle_deg=rng.uniform(-180.0, 180.0),
        rotor_inertia_kg_m2=10.0 ** rng.uniform(-6.0, -3.0),
    )


def least_eigenvalue(machine, phi):
    """Least eigenvalue of the mass matrix, its diagonal scaled to 1, over all exciter angles."""
    scene, least = Scene(machine=machine), math.inf
    for angles in product(np.linspace(0.0, 2.0 * math.pi, 25), repeat=2):
        matrix = mass_matrix(np.array([0.0, 0.0, phi, *angles]), scene)
        scale = np.sqrt(np.diag(matrix))
        least = min(least, np.linalg.eigvalsh(matrix / np.outer(scale, scale))[0])
    return least


def test_mass_matrix_is_positive_definite_up_to_the_safe_rotation():
    """The bound is no exaggeration: with small rotors nothing else is left to make up for what J lacks."""
    machines = [drawn(seed) for seed in range(12)]
    safe = [Scene(machine=machine).body.safe_rotation for machine in machines]
    least = {s: [least_eigenvalue(m, s * most) for m, most in zip(machines, safe, strict=True)] for s in (-1, 1, 1.5)}
    assert min(least[-1] + least[1]) > 0.0 > min(least[1.5])


def test_model_holds_where_the_mass_matrix_is_well_definite_and_nowhere_else():
    """At rest, by the residual and by the accelerations."""
    assert Scene(machine=Machine(exciter_distance_m=0.0)).body.safe_rotation == math.inf
    for seed in SEEDS:
        machine = drawn(seed)
        p = parameters(scene_of(0).replace({"machine": machine.model_dump()}))
        scene, rng = Scene(machine=machine), np.random.default_rng(seed)
        for _ in range(25):
            phi = scene.body.safe_rotation * rng.uniform(-4.0, 4.0)
            y, yp = np.zeros(10), np.zeros(10)
            y[2:5] = phi, *rng.uniform(0.0, 2.0 * math.pi, 2)
            definite = np.linalg.eigvalsh(mass_matrix(y[:5], scene))[0] > 0.0
            if not definite or abs(phi) <= scene.body.safe_rotation:
                assert evaluate_residual(BARE.index, 0.0, y, yp, np.empty(10), p) == definite
                assert accelerations(BARE.index, 0.0, y, yp, p) == definite


def test_accelerations_of_a_small_rotor_keep_their_digits_beside_a_strong_motor():
    """An inertia of 1e-8 kg m² is lost in the slope of the motor's torque where both stand in one number."""
    scene = scene_of(0).replace(
        {
            "machine": {"unbalance_mass_kg": 1e-5, "unbalance_radius_m": 0.01, "rotor_inertia_kg_m2": 1e-8},
            "motors": None,
            "motor": {"critical_torque_n_m": 20.0, "critical_slip": 0.03},
        }
    )
    state = np.zeros(10)
    state[8:] = 60.0, -70.0
    p, res = parameters(scene), np.empty(10)
    y, yp, *_ = settled(BARE, state, p)
    evaluate_residual(BARE.index, 0.0, y, yp, res, p)
    torque = max(abs(p.exciter_inertia * yp[8:]))
    assert abs(res[8:]).max() <= 1e-15 * torque
