"""Contradictions between the paper's numbers and its figures, by formulas without simulation or unprinted numbers.

In steady antiphase the forces of both exciters add along y. A stiff layer moves with the platform as one mass, with the
amplitude A = 2 m_r r ω²/√((c_y − (M + m_w)ω²)² + b_y²ω²), and leaves it if Aω² > g. At the vertical resonance each
motor supplies half of the power that the damper b_y takes, by the mean torque (m_r r)²ω³/b_y. If that is above the
motor's critical torque, the resonance captures the motor (Sommerfeld; Blekhman 2000).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import pandas as pd
from scipy.optimize import brentq

from vibroplat.columns import Column, Columns
from vibroplat.config.scene import Scene
from vibroplat.paper.scenes import paper_scene

#: Frequencies (Hz) up to which motion is attached in the paper, by mass ratio.
LIFTOFF = {0.1: 24.5, 0.2: 24.0}
#: Lowest frequency (Hz) of the search for liftoff; the highest is the vertical resonance.
LOWEST = 10.0
#: The table ``contradictions``, a row for each quantity.
CONTRADICTIONS: Columns = {
    "what": Column("a quantity"),
    "unit": Column("its unit"),
    "figures": Column("value that the paper's figures require"),
    "machine": Column("value that the machine has"),
}


def acceleration(scene: Scene, mass_ratio: float, frequency: float) -> float:
    """Return the amplitude of the vertical acceleration of the platform with a stiff layer on it (m/s²)."""
    machine, omega = scene.machine, 2.0 * math.pi * frequency
    stiffness = machine.stiffness_y_n_per_m - (1.0 + mass_ratio) * machine.total_mass * omega**2
    resistance = math.hypot(stiffness, machine.damping_y_n_s_per_m * omega)
    return sum(scene.unbalances) * omega**4 / resistance if resistance > 0.0 else math.inf


def stiff_layer_liftoff(scene: Scene, mass_ratio: float) -> float:
    """Return the frequency (Hz) at which a stiff layer leaves the platform; nan if there is none below resonance."""
    machine, gravity = scene.machine, scene.machine.gravity_m_per_s2
    mass = (1.0 + mass_ratio) * machine.total_mass
    resonance = math.sqrt(machine.stiffness_y_n_per_m / mass) / (2.0 * math.pi)
    if not acceleration(scene, mass_ratio, LOWEST) < gravity < acceleration(scene, mass_ratio, resonance):
        return math.nan
    return float(brentq(lambda f: acceleration(scene, mass_ratio, f) - gravity, LOWEST, resonance))


def unbalance_for_liftoff(scene: Scene, mass_ratio: float, frequency: float) -> float:
    """Return the static moment m_r r (kg·m) with which a stiff layer leaves the platform at a frequency (Hz)."""
    return scene.unbalances[0] * scene.machine.gravity_m_per_s2 / acceleration(scene, mass_ratio, frequency)


def resonance_torque(scene: Scene) -> float:
    """Return the mean torque (N·m) that each motor needs at the vertical resonance."""
    machine = scene.machine
    omega = math.sqrt(machine.stiffness_y_n_per_m / machine.total_mass)
    damping = machine.damping_y_n_s_per_m
    return float(scene.unbalances[0] ** 2 * omega**3 / damping) if damping > 0.0 else math.inf


def contradictions(numbers: Mapping[str, Any]) -> pd.DataFrame:
    """Compare what the paper's figures require with what a machine has."""
    scene = paper_scene("fig2", numbers)
    rows: list[tuple[str, str, float, float]] = []
    for mu, f in LIFTOFF.items():
        rows.append((f"liftoff of a stiff layer, μ {mu:g}", "Hz", f, stiff_layer_liftoff(scene, mu)))
        what = f"m_r r for liftoff of a stiff layer at {f:g} Hz, μ {mu:g}"
        rows.append((what, "kg·m", unbalance_for_liftoff(scene, mu, f), scene.unbalances[0]))
    critical = min(exciter.critical_torque_n_m for exciter in scene.exciter_pair)
    rows.append(("torque of each motor at the vertical resonance, at most", "N·m", critical, resonance_torque(scene)))
    return pd.DataFrame(rows, columns=list(CONTRADICTIONS))
