"""Hybrid DAE simulation of a vibrating platform with self-synchronizing exciters and material.

The public names are loaded when first used, so that ``import vibroplat`` and ``vibroplat --help``
stay quick.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from vibroplat.config.kinds import KINDS
from vibroplat.extensions import PROVIDERS

__version__ = "0.1.0"

if TYPE_CHECKING:
    from vibroplat.basin.study import basins
    from vibroplat.check.runs import check_run
    from vibroplat.config.computation import Output, Solver
    from vibroplat.config.drive import Drive
    from vibroplat.config.loading import load_config
    from vibroplat.config.scene import Scene
    from vibroplat.config.sections import (
        Contact,
        Exciter,
        Initial,
        Machine,
        Material,
        Motor,
        Run,
        State,
    )
    from vibroplat.continuation.orbit import Orbit, orbit
    from vibroplat.continuation.study import orbits
    from vibroplat.designs.study import design
    from vibroplat.motion.run import simulate
    from vibroplat.motion.variation import variation
    from vibroplat.results.result import Result
    from vibroplat.results.run import RunResult, load
    from vibroplat.study.lyapunov import lyapunov
    from vibroplat.study.sweep import sweep
    from vibroplat.thresholds.study import find

_HOMES = {
    "load_config": "vibroplat.config.loading",
    "Scene": "vibroplat.config.scene",
    "Drive": "vibroplat.config.drive",
    **dict.fromkeys(("Output", "Solver"), "vibroplat.config.computation"),
    **dict.fromkeys(
        ("Contact", "Exciter", "Initial", "Machine", "Material", "Motor", "Run", "State"),
        "vibroplat.config.sections",
    ),
    "simulate": "vibroplat.motion.run",
    "variation": "vibroplat.motion.variation",
    "load": "vibroplat.results.run",
    "Result": "vibroplat.results.result",
    "RunResult": "vibroplat.results.run",
    "check_run": "vibroplat.check.runs",
    "lyapunov": "vibroplat.study.lyapunov",
    "Orbit": "vibroplat.continuation.orbit",
    "orbit": "vibroplat.continuation.orbit",
    **{kind.name: f"vibroplat.{kind.study}" for kind in KINDS.values()},
}
# lower subpackages reach higher ones only through these names
PROVIDERS |= {
    "figure_of": "vibroplat.plots.display",
    "inspect": "vibroplat.inspection.values",
    "NewtonOrbitDetector": "vibroplat.continuation.orbit_detection",
    "sensitivities": "vibroplat.designs.sensitivities",
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
    "Result",
    "Run",
    "RunResult",
    "Scene",
    "Solver",
    "State",
    "__version__",
    "basins",
    "check_run",
    "design",
    "find",
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
