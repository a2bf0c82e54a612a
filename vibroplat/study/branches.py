"""The branches of a sweep, the scenes of their points, and tables over swept keys."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from vibroplat.columns import Column, Columns
from vibroplat.config.keys import key_of
from vibroplat.config.plans import SweepPlan
from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError
from vibroplat.frames import labelled

#: Key of a scene that varies along a branch.
FREQUENCY = "drive.supply_frequency_hz"
#: Columns of supply and excitation frequency.
SUPPLY, EXCITATION = "supply_frequency_hz", "excitation_frequency_hz"

#: With the seed of a sweep, the seed of the choice of its points.
_CHOICE = 0xC4EC

#: Columns of text, of whole numbers, and of yes and no, in tables of studies; all others hold floating-point numbers.
TEXTS = {
    "direction",
    "rotation",
    "sync",
    "motion",
    "outcome",
    "detail",
    "notes",
    "confirmation",
    "kind",
    "name",
    "coexists",
} | {*("sequence", "below", "above", "check")}
COUNTS = {"branch", "parent", "curve", "point", "points", "period", "steps", "residual_calls", "events"} | {
    *("unstable", "orbit_unstable")
}
ANSWERS = {"stable"}


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

    @property
    def plan(self) -> SweepPlan:
        """How its points settle and are measured."""
        assert self.scene.sweep is not None
        return self.scene.sweep

    def key(self, frequency: float) -> tuple[int, ...]:
        """Return the numbers that, with the seed, determine the perturbation at a supply frequency (Hz).

        They do not depend on the branch's place in its sweep, so that two sweeps give the same curve.
        """
        return int(self.direction == "down"), round(1e6 * frequency)

    def at(self, point: int) -> Scene:
        """Return the scene of a point."""
        return self.scene.replace({FREQUENCY: self.frequencies[point]})


def branches(scene: Scene) -> list[Branch]:
    """List the branches of a scene's sweep: each combination of the grid (the first key is slowest), in each direction.

    Raises
    ------
    ConfigError
        The scene has no section ``sweep``, or a drive program, or begins where a run ended; or a value of the grid is
        not allowed.
    """
    plan = scene.sweep
    if plan is None:
        raise ConfigError("this configuration has no sweep section; add sweep: {supply_frequency_hz: …}")
    if scene.drive.program is not None:
        raise ConfigError("drive.program is given, but a sweep sets the supply itself; allowed: supply_frequency_hz")
    if scene.run.initial.from_ is not None:
        raise ConfigError("run.initial.from is given, but a sweep does not begin with a run; allowed: state, or phases")
    upward = tuple(plan.supply_frequency_hz.upward)
    along = {"up": upward, "down": upward[::-1]}  # all branches share them
    found: list[Branch] = []
    for combination in itertools.product(*plan.grid.values()):
        values = dict(zip(plan.grid, combination, strict=True))
        try:
            placed = scene.replace(values)
        except ConfigError as error:
            raise ConfigError(f"sweep.grid: {error}") from None
        for direction in plan.supply_frequency_hz.direction:
            first = placed.replace({FREQUENCY: along[direction][0]})
            found.append(Branch(len(found), direction, values, first, along[direction]))
    return found


class Place(NamedTuple):
    """A point of a sweep: its branch, and its place in the branch."""

    branch: Branch
    point: int

    @property
    def text(self) -> str:
        """The swept keys and their values, and the branch."""
        keys = {SUPPLY: self.branch.frequencies[self.point], **self.branch.grid}
        swept = ", ".join(f"{key} = {value}" for key, value in keys.items())
        return f"{swept}, branch {self.branch.number} ({self.branch.direction})"


def require_share(share: float) -> None:
    """Refuse a share of points that is none (ConfigError)."""
    if not 0.0 < share <= 1.0:
        raise ConfigError(f"--check {share:g}; allowed: more than 0, at most 1")


def chosen(planned: Sequence[Branch], share: float) -> list[Place]:
    """Choose a share of the points of a sweep, at least one; the sweep's seed determines which."""
    places = [Place(branch, point) for branch in planned for point in range(len(branch.frequencies))]
    count = max(1, round(share * len(places)))
    random = np.random.default_rng((_CHOICE, planned[0].plan.seed))
    return [places[k] for k in sorted(random.choice(len(places), count, replace=False))]


def study_table(
    rows: Sequence[Mapping[str, Any]], columns: Sequence[str], grid: Mapping[str, Any], meant: Columns
) -> pd.DataFrame:
    """Make a table whose types do not depend on what was found.

    ``grid`` holds the values of those columns that are swept keys, which have the type of these values.
    """
    kinds = ((TEXTS, "str"), (COUNTS, "Int64"), (ANSWERS, "bool"))
    types: dict[Any, Any] = {c: next((kind for names, kind in kinds if c in names), "float64") for c in columns}
    types |= {key: pd.Series(values).dtype for key, values in grid.items()}
    keys = {key: Column(key_of(key).meaning) for key in grid if "." in key}
    return labelled(pd.DataFrame(rows, columns=list(columns)).astype(types), {**keys, **meant})
