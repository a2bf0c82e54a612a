"""A trial of the paper: its sweeps with one set of numbers, for calibration and for what depends on a number."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vibroplat.config import configurations, load_config, load_list, load_tree
from vibroplat.errors import ConfigError
from vibroplat.overrides import flat
from vibroplat.paper.claims import judge
from vibroplat.paper.evidence import Evidence
from vibroplat.paper.finding import Finding
from vibroplat.paper.nonimpact import find_beta
from vibroplat.scene import Scene
from vibroplat.study.execution import Inline
from vibroplat.study.store import Store
from vibroplat.study.sweep import run_sweeps

#: Sweeps of the impact model from which claims are judged.
IMPACT = ("fig3", "fig6")
#: Mass ratio at which models and restitutions are compared.
MASS_RATIO = 0.2
#: Sweep of the non-impact model, and its key that each machine has a value of its own for.
NON_IMPACT, BETA = "fig6-nonimpact", "contact.viscous_per_mass_per_s"
#: Sweep of the impact laws.
LAWS = "laws"

#: Coarser sweeps of a trial: upward, settled and measured for a shorter time, at a looser tolerance. The step is the
#: paper's: in twice as large ones the ends of its bands cannot be reached within half a step.
QUICK: dict[str, Any] = {
    "sweep.supply_frequency_hz.direction": ["up"],
    "sweep.measure_s": 0.5,
    "sweep.max_settle_s": 8.0,
    "sweep.lyapunov": False,
    "solver.tolerance": 1e-4,
    "solver.max_events_per_period": 500,
}
#: What a sweep need not repeat where others have it: the curve of R = 0 is that of `fig3`.
SHARED: dict[str, dict[str, Any]] = {"fig6": {"sweep.grid": {"contact.restitution": [0.3, 0.5, 0.7, 1.0]}}}


def machine_numbers(name: str) -> dict[str, Any]:
    """Return the dotted keys and values of a machine by its name.

    Raises
    ------
    ConfigError
        There is no such machine; the text lists those that there are.
    """
    directory = configurations() / "machines"
    known = sorted(path.stem for path in directory.glob("*.yaml"))
    if name not in known:
        raise ConfigError(f"--machine {name}; allowed: {', '.join(known)}")
    return flat(load_tree(directory / f"{name}.yaml"))


def paper_scene(name: str, numbers: Mapping[str, Any], changes: Mapping[str, Any] | None = None) -> Scene:
    """Return a scene of the paper, by the name of its file, with a machine's numbers laid over it.

    How points of a sweep are measured matters to sweeps alone: such keys are left out of other scenes.
    """
    path = configurations() / "paper" / f"{name}.yaml"
    laid = {**numbers, **(changes or {})}
    if "sweep" not in load_tree(path):
        laid = {key: value for key, value in laid.items() if not key.startswith("sweep.")}
    return load_config(path, laid)


def claims() -> list[dict[str, Any]]:
    """Return the paper's claims."""
    return load_list(configurations() / "claims" / "claims.yaml")


def former_claims() -> list[dict[str, Any]]:
    """Return the claims as they were worded at first, without quotes."""
    return load_list(configurations() / "claims" / "former.yaml")


def quick_evidence(numbers: Mapping[str, Any]) -> Evidence:
    """Run the coarse sweeps of a trial, one after the other."""
    evidence = Evidence()
    for name in IMPACT:
        _take(evidence, paper_scene(name, numbers, QUICK | SHARED.get(name, {})))
    evidence.beta = find_beta(evidence, MASS_RATIO)
    if evidence.beta is not None:
        _take(evidence, paper_scene(NON_IMPACT, numbers, {**QUICK, BETA: evidence.beta}))
    return evidence


def quick_findings(numbers: Mapping[str, Any]) -> dict[str, Finding]:
    """Judge all claims by the coarse sweeps of a trial."""
    evidence = quick_evidence(numbers)
    return {claim["id"]: judge(claim, evidence) for claim in claims()}


def _take(evidence: Evidence, scene: Scene) -> None:
    with Store(None, {}) as store:
        run_sweeps([(scene, store)], Inline())
        evidence.add(scene, store)
