"""The paper's scenes, sweeps and claims, and the machines that they are tried with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vibroplat.config.loading import load_config
from vibroplat.config.reader import configurations, flat, load_list, load_tree, nest
from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError

#: Sweeps of the impact model by which claims are judged.
IMPACT = ("fig3", "fig6")
#: Sweep of the non-impact model, and the key of its β, of which each machine has its own value.
NON_IMPACT, BETA = "fig6-nonimpact", "contact.viscous_per_mass_per_s"
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

#: Readings of the paper's machine, by the names of their files in ``configs/machines``.
MACHINES = ("calibrated", "damped", "printed")


def machine_numbers(name: str) -> dict[str, Any]:
    """Return the dotted keys and values of a machine by its name.

    Raises
    ------
    ConfigError
        There is no such machine; the text lists the machines.
    """
    directory = configurations() / "machines"
    if name not in MACHINES:
        raise ConfigError(f"--machine {name}; allowed: {', '.join(MACHINES)}")
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
    return load_config(path, nest(laid))


def claims() -> list[dict[str, Any]]:
    """Return the paper's claims."""
    return load_list(configurations() / "claims" / "claims.yaml")
