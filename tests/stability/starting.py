"""Motors that start, stop, fail or differ."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from stability.checks import Limit, row, sound, with_engine
from vibroplat.bench.scenes import base
from vibroplat.motion.run import simulate
from vibroplat.results.run import Trajectory

#: Motors strong enough to pass all three resonances.
STRONG = {"critical_torque_n_m": 3.0}
#: Frequency of the highest resonance, x (Hz), with printed stiffness.
HIGHEST = 34.269

Check = Callable[[Trajectory], dict[str, Limit]]


def starting(count: int, engine: str) -> list[dict[str, Any]]:
    """Start from standstill through three resonances, coast down, lose a motor or synchronism, reverse the phase.

    Each with two layers, with one layer and without material; at most ``count`` of these scenes are run.
    """
    materials: dict[str, dict[str, Any]] = {"two layers": {}, "one layer": {"layers": 1}, "bare": {"mass_ratio": 0.0}}
    rows: list[dict[str, Any]] = []
    for kind, material in materials.items():
        for name, (changes, check) in SITUATIONS.items():
            if len(rows) < count:
                scene = with_engine(base(1e-6, 8.0), engine)
                scene = scene.replace({f"material.{key}": value for key, value in material.items()})
                run = simulate(scene.replace(changes))
                limits = {**check(run), **sound(scene, run.summary)}
                rows.append(row(f"{name}, {kind}", run.outcome, limits))
    return rows


def _over_resonance(run: Trajectory) -> dict[str, Limit]:
    return {"below_resonance_hz": (HIGHEST - (run.summary["excitation_frequency_hz"] or 0.0), 0.0)}


def _at_rest(run: Trajectory) -> dict[str, Limit]:
    """Require platform and layers to come to rest on the static sag; the nearly frictionless exciters may swing."""
    state = run.final_state
    machine = run.scene.machine
    mass = machine.total_mass + sum(run.scene.layer_masses)
    sag = -mass * machine.gravity_m_per_s2 / machine.stiffness_y_n_per_m
    limits: dict[str, Limit] = {
        "speed_ratio": (float(abs(state[10:12]).max()) / run.scene.speed_scale, 0.02),
        "rate_m_per_s": (float(abs(state[7:9]).max()), 1e-4),
        "sag_error": (abs(float(state[1]) / sag - 1.0), 1e-3),
        "gap_m": (float(state[5]), 0.0),
        "kinetic_gain_j": (run.summary["kinetic_change_j"], 0.0),
    }
    return limits


def _synchronous(run: Trajectory) -> dict[str, Limit]:
    return {"split_hz": (abs(run.summary["frequency_split_hz"]), 1e-2)}


def _maintained(run: Trajectory) -> dict[str, Limit]:
    """Require the exciter of a dead motor to keep rotating: Blekhman's vibrational maintenance of rotation."""
    return {**_synchronous(run), "slow_hz": (20.0 - run.summary["excitation_frequency_hz"], 0.0)}


def _apart(run: Trajectory) -> dict[str, Limit]:
    return {"together_hz": (1.0 - abs(run.summary["frequency_split_hz"]), 0.0)}


def _antiphase(run: Trajectory) -> dict[str, Limit]:
    away = abs(math.remainder(run.summary["phase_difference_rad"] - math.pi, 2.0 * math.pi))
    return {**_synchronous(run), "away_from_antiphase_rad": (away, 0.05)}


#: Changes of the scene and the required results.
SITUATIONS: dict[str, tuple[dict[str, Any], Check]] = {
    "from standstill to 39 Hz": (
        {
            "drive.supply_frequency_hz": 80.0,
            "motor": STRONG,
            "run.initial": {"speed_ratio": 0.0, "phi1_rad": -1.5, "phase_sum_rad": -3.1},
        },
        _over_resonance,
    ),
    "coasting down from 39 Hz": (
        {
            "drive.supply_frequency_hz": 78.0,
            "motor": {"critical_torque_n_m": 0.0, "friction_radius_m": 5e-3},
            "run.duration_s": 60.0,
        },
        _at_rest,
    ),
    "one motor dead": (
        {"drive.supply_frequency_hz": 54.0, "motors": [{"critical_torque_n_m": 2.4}, {"critical_torque_n_m": 0.0}]},
        _maintained,
    ),
    "a motor that cannot keep step": (
        {"drive.supply_frequency_hz": 46.0, "motors": [{"critical_torque_n_m": 2.4}, {"critical_torque_n_m": 0.0}]},
        _apart,
    ),
    "motors of different poles": (
        {"drive.supply_frequency_hz": 46.0, "motors": [{"pole_pairs": 2}, {"pole_pairs": 3}]},
        _apart,
    ),
    "unequal motors": (
        {
            "drive.supply_frequency_hz": 46.0,
            "motors": [{"critical_slip": 0.1}, {"critical_slip": 0.2, "friction_radius_m": 2e-4}],
        },
        _synchronous,
    ),
    "reversed phase sum": (
        {"drive.supply_frequency_hz": 46.0, "run.initial": {"phase_sum_rad": 1e-3}, "run.duration_s": 20.0},
        _antiphase,
    ),
}
