"""Hybrid DAE simulation of a vibrating platform with self-synchronizing exciters and material.

The public names are loaded when first used, so that ``import vibroplat`` and ``vibroplat --help``
stay quick.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from vibroplat.config import load_config
    from vibroplat.drive import Drive
    from vibroplat.exciters import Exciter, Motor
    from vibroplat.flow.run import simulate
    from vibroplat.flow.variation import variation
    from vibroplat.loading import load
    from vibroplat.observe.trajectory import Trajectory
    from vibroplat.scene import (
        Contact,
        Initial,
        Machine,
        Material,
        Output,
        Run,
        Scene,
        Solver,
        State,
    )
    from vibroplat.study.checking.runs import check_run
    from vibroplat.study.checking.sweeps import check_sweep
    from vibroplat.study.lyapunov import lyapunov
    from vibroplat.study.orbits.orbit import Orbit, orbit
    from vibroplat.study.orbits.tables import orbits
    from vibroplat.study.sweep import sweep

_HOMES = {
    "load_config": "vibroplat.config",
    "Drive": "vibroplat.drive",
    "Exciter": "vibroplat.exciters",
    "Motor": "vibroplat.exciters",
    "simulate": "vibroplat.flow.run",
    "variation": "vibroplat.flow.variation",
    "load": "vibroplat.loading",
    "Trajectory": "vibroplat.observe.trajectory",
    "check_run": "vibroplat.study.checking.runs",
    "check_sweep": "vibroplat.study.checking.sweeps",
    "lyapunov": "vibroplat.study.lyapunov",
    "Orbit": "vibroplat.study.orbits.orbit",
    "orbit": "vibroplat.study.orbits.orbit",
    "orbits": "vibroplat.study.orbits.tables",
    "sweep": "vibroplat.study.sweep",
    **dict.fromkeys(
        (
            "Contact",
            "Initial",
            "Machine",
            "Material",
            "Output",
            "Run",
            "Scene",
            "Solver",
            "State",
        ),
        "vibroplat.scene",
    ),
}

__all__ = [
    "Contact",
    "Drive",
    "Exciter",
    "Initial",
    "Machine",
    "Material",
    "Motor",
    "Orbit",
    "Output",
    "Run",
    "Scene",
    "Solver",
    "State",
    "Trajectory",
    "__version__",
    "check_run",
    "check_sweep",
    "load",
    "load_config",
    "lyapunov",
    "orbit",
    "orbits",
    "simulate",
    "sweep",
    "variation",
]


def __getattr__(name: str) -> Any:
    import importlib

    if name not in _HOMES:
        raise AttributeError(f"module 'vibroplat' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
