"""Benchmark scenes: one for each kind that the solver treats differently, and the paper's regimes."""

from __future__ import annotations

from typing import Any

from vibroplat.config.scene import Scene
from vibroplat.config.sections import Material
from vibroplat.model.systems import systems

#: Supply frequencies (Hz) that give the machine below the excitation frequencies of the paper's time histories.
PAPER_SUPPLY = {"25.75": 51.5, "30.7": 62.5, "38.75": 78.0}


def base(tolerance: float, seconds: float) -> Scene:
    """Return the paper's machine with ten times the printed b_y and a tenth of its mass in two layers."""
    return Scene().replace(
        {
            "machine.damping_y_n_s_per_m": 400.0,
            "material": {"mass_ratio": 0.1, "natural_frequency_hz": 18.5, "damping_ratio": 0.05},
            "run": {"duration_s": seconds, "perturbation": 0.0},
            "solver.tolerance": tolerance,
        }
    )


def kinds(tolerance: float, seconds: float) -> dict[str, Scene]:
    """Return one scene of each kind, by name."""
    changes: dict[str, dict[str, Any]] = {
        "attached, f_e 46": {"drive.supply_frequency_hz": 46.0},
        "impacts, f_e 50": {"drive.supply_frequency_hz": 50.0},
        "impacts, R 0.5, f_e 52": {"drive.supply_frequency_hz": 52.0, "contact.restitution": 0.5},
        "one layer, f_e 50": {
            "drive.supply_frequency_hz": 50.0,
            "material": Material(mass_ratio=0.1, layers=1).model_dump(exclude_unset=True),
        },
        "non-impact, f_e 50": {"drive.supply_frequency_hz": 50.0, "contact.model": "non-impact"},
        "bare, f_e 50": {"drive.supply_frequency_hz": 50.0, "material.mass_ratio": 0.0},
    }
    scene = base(tolerance, seconds)
    return {name: scene.replace(change) for name, change in changes.items()}


def regimes(seconds: float) -> dict[str, Scene]:
    """Return the regimes of the paper's time histories without material and with a tenth of the mass, R 0."""
    return {
        f"f {f}, mu {mass_ratio:g}": base(1e-6, seconds).replace(
            {"drive.supply_frequency_hz": supply, "material.mass_ratio": mass_ratio}
        )
        for mass_ratio in (0.0, 0.1)
        for f, supply in PAPER_SUPPLY.items()
    }


def unknowns(scene: Scene) -> str:
    """Return the number of unknowns in each mode of a scene, as text."""
    return ", ".join(f"{system.size} {mode.label}" for mode, system in systems(scene).items())
