"""Random machines as one buys them: templates with their numbers changed; and how their motion settles."""

import math

import numpy as np

from vibroplat.config.loading import load_config
from vibroplat.config.plans import SweepPlan
from vibroplat.config.reader import configurations
from vibroplat.config.scene import Scene
from vibroplat.study.point import measure_point

#: Templates, and how far their numbers change: factors log-uniform, of exciters alike and apart.
TEMPLATES = ("screen", "feeder", "rig")
SIZES, APART = 0.7, 0.02
#: What makes a run a start from rest without material.
STARTS = {
    "material": {"mass_ratio": 0.0},
    "run": {"duration_s": 60.0, "initial": {"speed_ratio": 0.0}},
    "solver": {"engine": "taylor"},
}


def machine(number):
    """Draw a machine without material: mass, springs, dampers, unbalances, levers, motors and supply of a template."""
    rng = np.random.default_rng((43, number))
    scene = load_config(configurations() / "templates" / f"{TEMPLATES[number % 3]}.yaml")
    tree = scene.to_tree()

    def vary(section, names):
        for name in names:
            if section.get(name):
                section[name] *= math.exp(rng.uniform(-SIZES, SIZES))

    vary(tree["machine"], [name for name in tree["machine"] if name.startswith(("stiffness", "damping", "platform"))])
    alike = ("unbalance_mass_kg", "static_moment_kg_m", "unbalance_radius_m", "rated_power_w", "critical_torque_n_m")
    if "exciters" in tree:
        pair = tree["exciters"]
        vary(pair[0], alike)
        for name in alike:
            if name in pair[0]:
                pair[1][name] = pair[0][name] * math.exp(rng.uniform(-APART, APART))
        lever = rng.uniform(0.05, 0.8, 2) * rng.choice([-1.0, 1.0], 2)
        pair[0]["position_m"], pair[1]["position_m"] = lever.tolist(), [-lever[0], float(lever[1])]
    else:
        vary(tree["motor"], alike)
        vary(tree["machine"], [*alike, "exciter_distance_m"])
    supply = scene.drive.largest_frequency * math.exp(rng.uniform(-0.4, 0.2))
    tree["material"], tree["transport"] = {"mass_ratio": 0.0}, None
    tree["drive"] = {"supply_frequency_hz": supply}
    tree["run"] = {"initial": {"speed_ratio": 0.9, "phase_difference_rad": float(rng.uniform(-3.0, 3.0))}}
    tree["solver"] = {"engine": "taylor"}
    return scene.from_tree({**tree, "name": f"machine-{number}"})


def rocking(number):
    """Draw a machine of 0.4 t with motors at its ends, whose angular resonance lies at 15 to 25 Hz: some pass it."""
    rng = np.random.default_rng((44, number))
    sizes = {"stiffness_x_n_per_m": 1e6, "stiffness_y_n_per_m": 12e4, "stiffness_phi_n_m_per_rad": 1.9e6}
    sizes |= {"damping_x_n_s_per_m": 2700, "damping_y_n_s_per_m": 930, "damping_phi_n_m_s_per_rad": 1900}
    varied = {name: size * math.exp(rng.uniform(-SIZES / 2.0, SIZES / 2.0)) for name, size in sizes.items()}
    power, apart = 700.0 * math.exp(rng.uniform(-1.0, 1.0)), rng.uniform(-APART, APART)
    plate = {"rated_power_w": power, "rated_speed_rpm": 1430, "breakdown_ratio": 2.5, "rated_frequency_hz": 50}
    plate |= {"rotor_inertia_kg_m2": 0.003, "friction_radius_m": 2e-4, "unbalance_mass_kg": 4.0, "pole_pairs": 2}
    pair = [
        {**plate, "position_m": [side * 0.54, 0.055], "static_moment_kg_m": 0.237 * math.exp(larger)}
        for side, larger in ((1.0, 0.0), (-1.0, apart))
    ]
    machine_ = {"platform_mass_kg": 400, "platform_inertia_kg_m2": 100, **varied}
    return Scene.from_tree({"name": f"rocking-{number}", "machine": machine_, "exciters": pair, **STARTS})


def settled(scene, turns=4000):
    """Follow a scene until its motion has settled, at most so many turns: the row of a sweep."""
    turn = 2.0 * math.pi / scene.speed_scale
    supply = scene.drive.largest_frequency
    plan = {
        "supply_frequency_hz": {"start": supply, "stop": supply},
        "max_settle_s": turns * turn,
        "measure_s": 60 * turn,
        "lyapunov": False,
    }
    return measure_point(scene, SweepPlan.model_validate(plan), None, (0,)).row
