"""The paper's scenes, sweeps and claims, and a trial: what these give with one set of numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vibroplat.config.overrides import flat
from vibroplat.config.reader import configurations, load_config, load_list, load_tree
from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError
from vibroplat.paper.evidence import Evidence
from vibroplat.paper.nonimpact import match_beta
from vibroplat.study.branches import branches
from vibroplat.study.pool import Tasks
from vibroplat.study.store import Record
from vibroplat.study.sweep import branch_points

#: Sweeps of the impact model by which claims are judged.
IMPACT = ("fig3", "fig6")
#: Mass ratio at which contact models and restitutions are compared.
MASS_RATIO = 0.2
#: Sweep of the non-impact model, and the key of its β, of which each machine has its own value.
NON_IMPACT, BETA = "fig6-nonimpact", "contact.viscous_per_mass_per_s"
#: Sweep of the impact laws.
LAWS = "laws"
#: Key of the seed of the perturbations.
SEED = "sweep.seed"

#: Settings of coarse sweeps: upward only, with shorter settling and measuring and a looser tolerance. The step is that
#: of the paper: with one twice as large, the ends of its bands would not be known to half a step.
QUICK: dict[str, Any] = {
    "sweep.supply_frequency_hz.direction": ["up"],
    "sweep.measure_s": 0.5,
    "sweep.max_settle_s": 8.0,
    "sweep.lyapunov": False,
    "solver.tolerance": 1e-4,
    "solver.max_events_per_period": 500,
}
#: Settings of sweeps without the curves that other sweeps have: that of R = 0 is in `fig3`.
SHARED: dict[str, dict[str, Any]] = {"fig6": {"sweep.grid": {"contact.restitution": [0.3, 0.5, 0.7, 1.0]}}}


def machine_numbers(name: str) -> dict[str, Any]:
    """Return the dotted keys and values of a machine by its name.

    Raises
    ------
    ConfigError
        There is no such machine; the text lists the machines.
    """
    directory = configurations() / "machines"
    known = sorted(path.stem for path in directory.glob("*.yaml"))
    if name not in known:
        raise ConfigError(f"--machine {name}; allowed: {', '.join(known)}")
    return flat(load_tree(directory / f"{name}.yaml"))


def paper_scene(name: str, numbers: Mapping[str, Any], changes: Mapping[str, Any] | None = None) -> Scene:
    """Return a scene of the paper by the name of its file, with a machine's numbers and then changes laid over it.

    Keys of section ``sweep`` are left out if the scene has no such section.

    Raises
    ------
    ConfigError
        There is no such key, or a value is not allowed.
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
    """Return the claims in their first wording, without quotes."""
    return load_list(configurations() / "claims" / "former.yaml")


def quick_trial(numbers: Mapping[str, Any]) -> Tasks[Evidence]:
    """Run the coarse sweeps with a machine's numbers, one point after the other; the result is the evidence."""
    evidence = Evidence()
    for name in IMPACT:
        yield from _swept(evidence, paper_scene(name, numbers, QUICK | SHARED.get(name, {})))
    evidence.beta = yield from match_beta(evidence, MASS_RATIO)
    if evidence.beta is not None:
        yield from _swept(evidence, paper_scene(NON_IMPACT, numbers, {**QUICK, BETA: evidence.beta}))
    return evidence


def _swept(evidence: Evidence, scene: Scene) -> Tasks[None]:
    """Run a sweep and add its branches to the evidence."""
    for branch in branches(scene):
        records: list[Record] = []
        yield from branch_points(branch, records.append)
        evidence.add_branch(branch, records)
