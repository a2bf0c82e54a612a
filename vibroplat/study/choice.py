"""Points of a sweep, and the choice of some of them."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError
from vibroplat.study.branches import SUPPLY, Branch, branches, sweep_plan

#: With the seed of a sweep, the seed of the choice of its points.
_CHOICE: Final = 0xC4EC


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


def chosen(scene: Scene, share: float) -> list[Place]:
    """Choose a share of the points of a sweep, at least one; the sweep's seed determines which."""
    places = [Place(branch, point) for branch in branches(scene) for point in range(len(branch.frequencies))]
    count = max(1, round(share * len(places)))
    random = np.random.default_rng((_CHOICE, sweep_plan(scene).seed))
    return [places[k] for k in sorted(random.choice(len(places), count, replace=False))]
