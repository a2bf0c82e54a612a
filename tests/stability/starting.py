"""Motors that start, stop, fail or differ."""

import math

from stability.checks import row, sound, with_engine
from vibroplat.bench.scenes import base
from vibroplat.motion.run import simulate

#: Frequency of the highest resonance, x (Hz), with printed stiffness.
HIGHEST = 34.269
#: A motor that is dead, and one strong enough for both exciters.
DEAD = [{"critical_torque_n_m": 2.4}, {"critical_torque_n_m": 0.0}]


def starting(count, engine):
    """Start from standstill through three resonances, coast down, lose a motor or synchronism, reverse the phase.

    Each with two layers, with one layer and without material; at most ``count`` of these scenes are run.
    """
    materials = {
        "two layers": {},
        "one layer": {"material.layers": 1},
        "bare": {"material.mass_ratio": 0.0},
    }
    cases = [(kind, name) for kind in materials for name in SITUATIONS]
    rows = []
    for kind, name in cases[:count]:
        changes, limits = SITUATIONS[name]
        scene = with_engine(base(1e-6, 8.0), engine).replace(materials[kind] | changes)
        run = simulate(scene)
        rows.append(row(f"{name}, {kind}", run.outcome, limits(run) | sound(scene, run.summary)))
    return rows


def over_resonance(run):
    return {"below_resonance_hz": (HIGHEST - (run.summary["excitation_frequency_hz"] or 0.0), 0.0)}


def at_rest(run):
    """Require platform and layers to come to rest on the static sag; the nearly frictionless exciters may swing."""
    state, machine = run.final_state, run.scene.machine
    mass = machine.total_mass + sum(run.scene.layer_masses)
    sag = -mass * machine.gravity_m_per_s2 / machine.stiffness_y_n_per_m
    return {
        "speed_ratio": (float(abs(state[10:12]).max()) / run.scene.speed_scale, 0.02),
        "rate_m_per_s": (float(abs(state[7:9]).max()), 1e-4),
        "sag_error": (abs(float(state[1]) / sag - 1.0), 1e-3),
        "gap_m": (float(state[5]), 0.0),
        "kinetic_gain_j": (run.summary["kinetic_change_j"], 0.0),
    }


def synchronous(run):
    return {"split_hz": (abs(run.summary["frequency_split_hz"]), 1e-2)}


def maintained(run):
    """Require the exciter of a dead motor to keep rotating: Blekhman's vibrational maintenance of rotation."""
    return synchronous(run) | {"slow_hz": (20.0 - run.summary["excitation_frequency_hz"], 0.0)}


def apart(run):
    return {"together_hz": (1.0 - abs(run.summary["frequency_split_hz"]), 0.0)}


def antiphase(run):
    away = abs(math.remainder(run.summary["phase_difference_rad"] - math.pi, 2.0 * math.pi))
    return synchronous(run) | {"away_from_antiphase_rad": (away, 0.05)}


SUPPLY = "drive.supply_frequency_hz"
STANDSTILL = {"speed_ratio": 0.0, "phi1_rad": -1.5, "phase_sum_rad": -3.1}
COASTING = {"critical_torque_n_m": 0.0, "friction_radius_m": 5e-3}
UNEQUAL = [{"critical_slip": 0.1}, {"critical_slip": 0.2, "friction_radius_m": 2e-4}]
#: Changes of the scene and the required results.
SITUATIONS = {
    "from standstill to 39 Hz": (
        {SUPPLY: 80.0, "motor": {"critical_torque_n_m": 3.0}, "run.initial": STANDSTILL},  # past three resonances
        over_resonance,
    ),
    "coasting down from 39 Hz": ({SUPPLY: 78.0, "motor": COASTING, "run.duration_s": 60.0}, at_rest),
    "one motor dead": ({SUPPLY: 54.0, "motors": DEAD}, maintained),
    "a motor that cannot keep step": ({SUPPLY: 46.0, "motors": DEAD}, apart),
    "motors of different poles": ({SUPPLY: 46.0, "motors": [{"pole_pairs": 2}, {"pole_pairs": 3}]}, apart),
    "unequal motors": ({SUPPLY: 46.0, "motors": UNEQUAL}, synchronous),
    "reversed phase sum": ({SUPPLY: 46.0, "run.initial": {"phase_sum_rad": 1e-3}, "run.duration_s": 20.0}, antiphase),
}
