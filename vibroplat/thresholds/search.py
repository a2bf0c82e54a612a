"""Thresholds of a key: a scan shows where the outcome changes, and each change is narrowed in a chain of its own.

Where motion on one side repeats, its orbit is followed over the key first: where it loses its stability inside the
interval, and motion comes to it up to there, that point is the threshold. Elsewhere the interval is bisected.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple

import numpy as np
import pandas as pd

from vibroplat.config.keys import number_of
from vibroplat.config.plans import OrbitsPlan, StepPlan
from vibroplat.config.questions import FindPlan
from vibroplat.config.scene import Scene
from vibroplat.continuation.orbit import accurate, beginning_at
from vibroplat.continuation.special_points import BRANCH_POINT, DOUBLING, FOLD, NEIMARK_SACKER
from vibroplat.continuation.worker import Known, part
from vibroplat.errors import ConfigError
from vibroplat.model.sensitivity import parameter_direction, value_of
from vibroplat.results.files import Command
from vibroplat.study.bands import jumps
from vibroplat.study.branches import carried, column_of
from vibroplat.study.point import lost
from vibroplat.study.pool import Pool, StoredChain, Task, Tasks, run_stored
from vibroplat.study.question import Progress
from vibroplat.study.store import Store
from vibroplat.thresholds.values import Value, apart, constant, evaluate

#: Where the motion beside the end of an orbit's stability is measured, over the distance to the end of the interval.
BESIDE = 0.02
#: Change of the measures across a threshold that is a jump, over that between the scan's values, by how much narrower
#: it is: more than the root of it, as beside a fold, times this.
STEEP = 2.0
#: Pairs of values beside a threshold, over which part of the range they lie, and their distances.
PAIRS, AROUND, DISTANCES = 12, 0.1, (1e-2, 1e-3, 1e-4)
#: Fewest pairs that differ at the smallest distance where the border is fractal, and their least share of those that
#: do at the largest.
FRACTAL, LASTING = 2, 0.25


class Threshold(NamedTuple):
    """A value of the key at which the outcome changes.

    Attributes
    ----------
    low, high
        What was found below and above.
    value
        The threshold: the special point, or the middle.
    kind
        See the table.
    special
        Kind of the special point, or "".
    """

    low: Value
    high: Value
    value: float
    kind: str
    special: str


@dataclass
class Search:
    """A section ``find`` and its answer; see :class:`vibroplat.study.question.Question`."""

    scene: Scene
    plan: FindPlan
    continuous: bool

    command: ClassVar[Command] = "find"
    counted: ClassVar[str] = "values"

    def __post_init__(self) -> None:
        self.seen: list[Value] = []
        frequency = round(1e6 * self.scene.drive.largest_frequency)
        self._key = (self.scene.run.seed, 0, frequency)  # as of a run
        self._tasks = self._done = 0

    @property
    def chains(self) -> int:
        """The most chains side by side."""
        return self.plan.scan if self.plan.from_ == "initial" else 2

    def at(self, value: float) -> Scene:
        """Return the scene at a value of the key."""
        return self.scene.replace({self.plan.key: value})

    # -- chains --------------------------------------------------------------------------------------------------------

    def found(self, store: Store, workers: Pool, progress: Progress) -> tuple[list[Value], list[Threshold]]:
        """Return the values of the scan in ascending order, and the thresholds between them."""
        self._run = lambda name, chains: run_stored(
            [StoredChain(chain, store, f"{name}-{i}") for i, chain in enumerate(chains)], workers, progress_of(progress)
        )

        def progress_of(told: Progress) -> Any:
            return lambda done: told(done, 0)

        if self.plan.from_ == "neighbour":
            return self._outward()
        scan = self._run("scan", [self._value(at, "scan") for at in self.plan.over.upward])
        return scan, [t for t in self._run("border", [self._border(*ends) for ends in self._changes(scan)]) if t]
