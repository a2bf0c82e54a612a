"""What of the paper's numbers contradicts its figures, by formulas that need no simulation and no unprinted number.

In steady antiphase the forces of both exciters add along y. A stiff layer moves with the platform as one mass, so
that its amplitude is A = 2 m_r r ω²/√((c_y − (M + m_w)ω²)² + b_y²ω²), and it leaves the platform where Aω² = g. At the
vertical resonance each motor feeds half of what the damper b_y takes, by the mean torque (m_r r)²ω³/b_y: where that is
above the motor's critical torque, the resonance captures it (Sommerfeld; Blekhman 2000).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import pandas as pd
from scipy.optimize import brentq

from vibroplat.paper.trial import paper_scene
from vibroplat.scene import Machine, Scene

#: Frequencies (Hz) up to which the paper has attached motion, by mass ratio.
LIFTOFF = {0.1: 24.5, 0.2: 24.0}
#: Lowest frequency (Hz) at which lift-off is looked for; the highest is the vertical resonance.
LOWEST = 10.0


def acceleration(machine: Machine, mass_ratio: float, frequency: float) -> float:
    """Return the amplitude of the vertical acceleration of the platform with a stiff layer on it (m/s²)."""
    omega = 2.0 * math.pi * frequency
    stiffness = machine.stiffness_y_n_per_m - (1.0 + mass_ratio) * machine.total_mass * omega**2
    resistance = math.hypot(stiffness, machine.damping_y_n_s_per_m * omega)
    return 2.0 * machine.unbalance * omega**4 / resistance if resistance > 0.0 else math.inf


def stiff_layer_liftoff(machine: Machine, mass_ratio: float) -> float:
    """Return the frequency (Hz) at which a stiff layer leaves the platform; nan if it does not below the resonance."""
    gravity = machine.gravity_m_per_s2
    mass = (1.0 + mass_ratio) * machine.total_mass
    resonance = math.sqrt(machine.stiffness_y_n_per_m / mass) / (2.0 * math.pi)
    if not acceleration(machine, mass_ratio, LOWEST) < gravity < acceleration(machine, mass_ratio, resonance):
        return math.nan
    return float(brentq(lambda f: acceleration(machine, mass_ratio, f) - gravity, LOWEST, resonance))


def unbalance_for_liftoff(machine: Machine, mass_ratio: float, frequency: float) -> float:
    """Return the static moment m_r r (kg·m) with which a stiff layer leaves the platform at a frequency (Hz)."""
    return machine.unbalance * machine.gravity_m_per_s2 / acceleration(machine, mass_ratio, frequency)


def resonance_torque(machine: Machine) -> float:
    """Return the mean torque (N·m) that the vertical resonance asks of each motor."""
    omega = math.sqrt(machine.stiffness_y_n_per_m / machine.total_mass)
    damping = machine.damping_y_n_s_per_m
    return float(machine.unbalance**2 * omega**3 / damping) if damping > 0.0 else math.inf


def contradictions(numbers: Mapping[str, Any]) -> pd.DataFrame:
    """Compare a machine with the paper's figures: what, unit, what the figures ask for, and what the machine has."""
    scene: Scene = paper_scene("fig2", numbers)
    machine = scene.machine
    rows: list[tuple[str, str, float, float]] = []
    for mass_ratio, frequency in LIFTOFF.items():
        rows += [
            (f"lift-off of a stiff layer, μ {mass_ratio:g}", "Hz", frequency, stiff_layer_liftoff(machine, mass_ratio)),
            (
                f"m_r r for lift-off of a stiff layer at {frequency:g} Hz, μ {mass_ratio:g}",
                "kg·m",
                unbalance_for_liftoff(machine, mass_ratio, frequency),
                machine.unbalance,
            ),
        ]
    critical = min(motor.critical_torque_n_m for motor in scene.motor_pair)
    rows.append(("torque of each motor at the vertical resonance, at most", "N·m", critical, resonance_torque(machine)))
    return pd.DataFrame(rows, columns=["what", "unit", "figures", "machine"])
