"""The branches of a sweep and the scenes of their points."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

from vibroplat.errors import ConfigError
from vibroplat.scene import Scene
from vibroplat.sweep_plan import SweepPlan

#: Key of a scene that a sweep goes through, its column in tables, and the column of what the exciters make of it.
FREQUENCY = "drive.supply_frequency_hz"
SUPPLY, EXCITATION = "supply_frequency_hz", "excitation_frequency_hz"


@dataclass(frozen=True)
class Branch:
    """One continued sweep.

    Attributes
    ----------
    number
        Its place in the sweep.
    direction
        ``up`` or ``down``.
    grid
        Dotted keys of the grid and their values here.
    scene
        What moves, at the first frequency.
    frequencies
        Supply frequencies (Hz) in the order in which the branch goes through them.
    """

    number: int
    direction: str
    grid: dict[str, Any]
    scene: Scene
    frequencies: tuple[float, ...]

    def key(self, frequency: float) -> tuple[int, ...]:
        """Return what the perturbation at a supply frequency (Hz) follows from, besides the seed.

        It does not depend on the branch's place in its sweep, so a curve that two sweeps share is the same in both.
        """
        return int(self.direction == "down"), round(1e6 * frequency)

    def at(self, point: int) -> Scene:
        """Return the scene of a point."""
        return self.scene.replace({FREQUENCY: self.frequencies[point]})


def sweep_plan(scene: Scene) -> SweepPlan:
    """Return the plan of a scene that is to be swept.

    Raises
    ------
    ConfigError
        It has none.
    """
    if scene.sweep is None:
        raise ConfigError("this configuration has no section sweep; allowed: sweep: {supply_frequency_hz: …}")
    return scene.sweep


def branches(scene: Scene) -> list[Branch]:
    """List the branches of a scene's sweep: the grid's combinations, the first key slowest, times directions.

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
