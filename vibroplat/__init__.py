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
    from vibroplat.basin.study import basins as basins
    from vibroplat.check.runs import check_run as check_run
    from vibroplat.config.computation import Output as Output
    from vibroplat.config.computation import Solver as Solver
    from vibroplat.config.drive import Drive as Drive
    from vibroplat.config.loading import load_config as load_config
    from vibroplat.config.scene import Scene as Scene
    from vibroplat.config.sections import Contact as Contact
    from vibroplat.config.sections import Exciter as Exciter
    from vibroplat.config.sections import Initial as Initial
    from vibroplat.config.sections import Machine as Machine
    from vibroplat.config.sections import Material as Material
    from vibroplat.config.sections import Motor as Motor
    from vibroplat.config.sections import Run as Run
    from vibroplat.config.sections import State as State
    from vibroplat.continuation.orbit import Orbit as Orbit
    from vibroplat.continuation.orbit import orbit as orbit
    from vibroplat.continuation.study import orbits as orbits
    from vibroplat.designs.study import design as design
    from vibroplat.fitting.study import fit as fit
    from vibroplat.motion.run import simulate as simulate
    from vibroplat.motion.variation import variation as variation
    from vibroplat.results.result import Result as Result
    from vibroplat.results.run import RunResult as RunResult
    from vibroplat.results.run import load as load
    from vibroplat.study.lyapunov import lyapunov as lyapunov
    from vibroplat.study.sweep import sweep as sweep
    from vibroplat.thresholds.study import find as find

#: Public names by their modules.
_PUBLIC = {
    "check.runs": "check_run",
    "config.computation": "Output Solver",
    "config.drive": "Drive",
    "config.loading": "load_config",
    "config.scene": "Scene",
    "config.sections": "Contact Exciter Initial Machine Material Motor Run State",
    "continuation.orbit": "Orbit orbit",
    "motion.run": "simulate",
    "motion.variation": "variation",
    "results.result": "Result",
    "results.run": "RunResult load",
    "study.lyapunov": "lyapunov",
    **{kind.study: kind.name for kind in KINDS.values()},
}
_HOMES = {name: f"vibroplat.{module}" for module, names in _PUBLIC.items() for name in names.split()}
__all__ = ["__version__", *_HOMES]  # noqa: PLE0604
# lower subpackages reach higher ones only through these names
PROVIDERS |= {
    "figure_of": "vibroplat.plots.display",
    "inspect": "vibroplat.inspection.values",
    "NewtonOrbitDetector": "vibroplat.continuation.orbit_detection",
    "sensitivities": "vibroplat.designs.sensitivities",
}


def __getattr__(name: str) -> Any:
    import importlib

    if name not in _HOMES:
        raise AttributeError(f"module 'vibroplat' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
