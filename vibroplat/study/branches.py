"""The branches of a sweep and the scenes of their points."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

from vibroplat.config.plans import SweepPlan
from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError

#: Key of a scene that varies along a branch.
FREQUENCY = "drive.supply_frequency_hz"
#: Columns of supply and excitation frequency.
SUPPLY, EXCITATION = "supply_frequency_hz", "excitation_frequency_hz"


@dataclass(frozen=True)
class Branch:
    """One continued sweep.

    Attributes
    ----------
    number
        Its position in the sweep.
    direction
        ``up`` or ``down``.
    grid
        Dotted keys of the grid and their values on this branch.
    scene
        The scene at the first frequency.
    frequencies
        Supply frequencies (Hz) in the order of the branch.
    """

    number: int
    direction: str
    grid: dict[str, Any]
    scene: Scene
    frequencies: tuple[float, ...]

    def key(self, frequency: float) -> tuple[int, ...]:
        """Return the numbers that, with the seed, determine the perturbation at a supply frequency (Hz).

        They do not depend on the branch's place in its sweep, so that two sweeps give the same curve.
        """
        return int(self.direction == "down"), round(1e6 * frequency)

    def at(self, point: int) -> Scene:
        """Return the scene of a point."""
        return self.scene.replace({FREQUENCY: self.frequencies[point]})


def sweep_plan(scene: Scene) -> SweepPlan:
    """Return the plan of a scene's sweep.

    Raises
    ------
    ConfigError
        The scene has no section ``sweep``, or a drive program, or begins where a run ended.
    """
    if scene.sweep is None:
        raise ConfigError("this configuration has no sweep section; add sweep: {supply_frequency_hz: …}")
    if scene.drive.program is not None:
        raise ConfigError("drive.program is given, but a sweep sets the supply itself; allowed: supply_frequency_hz")
    if scene.run.initial.from_ is not None:
        raise ConfigError("run.initial.from is given, but a sweep does not begin with a run; allowed: state, or phases")
    return scene.sweep


def branches(scene: Scene) -> list[Branch]:
    """List the branches of a scene's sweep: each combination of the grid (the first key is slowest), in each direction.

    Raises
    ------
    ConfigError
        The scene has no sweep, or a value of the grid is not allowed.
    """
    plan = sweep_plan(scene)
    upward = tuple(plan.supply_frequency_hz.upward)
    found: list[Branch] = []
    for combination in itertools.product(*plan.grid.values()):
        values = dict(zip(plan.grid, combination, strict=True))
        try:
            placed = scene.replace(values)
        except ConfigError as error:
            raise ConfigError(f"sweep.grid: {error}") from None
        for direction in plan.supply_frequency_hz.direction:
            frequencies = upward if direction == "up" else upward[::-1]
            first = placed.replace({FREQUENCY: frequencies[0]})
            found.append(Branch(len(found), direction, values, first, frequencies))
    return found
