"""Scenes of the benchmarks: one for each kind that the solver treats differently, and some of growing difficulty."""

from __future__ import annotations

from typing import Any

from vibroplat.config.scene import Scene

_SUPPLY, _MASS = "drive.supply_frequency_hz", "material.mass_ratio"
_RESTITUTION, _SECONDS = "contact.restitution", "run.duration_s"
_KINDS: dict[str, dict[str, Any]] = {
    "attached, f_e 46": {_SUPPLY: 46.0},
    "impacts, f_e 50": {_SUPPLY: 50.0},
    "impacts, R 0.5, f_e 52": {_SUPPLY: 52.0, _RESTITUTION: 0.5},
    "one layer, f_e 50": {_SUPPLY: 50.0, "material": {"mass_ratio": 0.1, "layers": 1}},
    "non-impact, f_e 50": {_SUPPLY: 50.0, "contact.model": "non-impact"},
    "bare, f_e 50": {_SUPPLY: 50.0, _MASS: 0.0},
}
_CASES: dict[str, dict[str, Any]] = {
    "bare run-up": {_MASS: 0.0, _SUPPLY: 60.0, "run.initial.speed_ratio": 0.2, _SECONDS: 2.0},
    "attached": {_SUPPLY: 46.0},
    "one impact a period": {_MASS: 0.2, _SUPPLY: 51.5, _SECONDS: 1.5},
    "chatters, R 0.5": {_MASS: 0.2, _SUPPLY: 51.5, _RESTITUTION: 0.5, _SECONDS: 0.6},
    "flights of many periods": {_SUPPLY: 78.0, _RESTITUTION: 0.3, _SECONDS: 0.6},
}


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
    return {name: base(tolerance, seconds).replace(changes) for name, changes in _KINDS.items()}


def cases() -> dict[str, Scene]:
    """Return the scenes on which solvers are compared, by name; the last two amplify errors most."""
    return {name: base(1e-8, 1.0).replace(changes) for name, changes in _CASES.items()}
