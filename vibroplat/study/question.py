"""Questions about a scene that many motions answer: basins, thresholds, designs; and what answers them in a pool."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np
import pandas as pd

from vibroplat.config.scene import Scene
from vibroplat.results.files import Command
from vibroplat.study import WAIT
from vibroplat.study.pool import Pool, Task, pool
from vibroplat.study.store import Record, Store

#: Difference of a measure over the larger of it and its scale that is allowed: ten times what settling leaves. Of 214
#: points of Figs. 3 and 6 the orbits that ``taylor`` and ``native`` find differ by 2e-7 at most.
ALLOWED = 1e-3
#: Motions that are repeated at most to check an answer: some from all over it show what an engine does wrong.
CHECKED = 20
#: Columns in which a repeated motion must be as it was; what does not repeat has the first of them alone.
COMPARED = ("sync", "motion", "period", "excitation_frequency_hz", "rms_x_m", "rms_y_m", "motor_power_w")

#: Called with the numbers of tasks that are done, and of all that are known.
Progress = Callable[[int, int], object]


class Answer(NamedTuple):
    """What was found.

    Attributes
    ----------
    tables
        By name; those that a question may have and this one has not are not in it.
    lines
        Labels and texts of an overview.
    text
        Further lines that are printed below it.
    notes
        What deserves a second look.
    failures
        A line for each motion that failed.
    configurations
        Contents of YAML files, by name.
    """

    tables: Mapping[str, pd.DataFrame]
    lines: Mapping[str, str]
    text: Sequence[str] = ()
    notes: Sequence[str] = ()
    failures: Sequence[str] = ()
    configurations: Mapping[str, str] = {}

    @property
    def told(self) -> dict[str, object]:
        """What is printed, for provenance."""
        parts = (self.text, self.notes, self.failures)
        return {"lines": dict(self.lines), **dict(zip(("text", "notes", "failures"), map(list, parts), strict=True))}


class Repeat(NamedTuple):
    """A motion of an answer that is repeated by another engine.

    Attributes
    ----------
    place
        Where it is, as "at μ = 0.1": no two have the same.
    task
        What repeats it; its record has a ``row``.
    row
        What its row must have.
    allowed
        Difference of a measure, over the larger of it and its scale, that is allowed.
    """

    place: str
    task: Task
    row: Record
    allowed: float = ALLOWED


class Question(Protocol):
    """A question that has been read from a section of a scene, and validated.

    Attributes
    ----------
    command, scene
        The command that asks it, whose section the scene has.
    chains
        The most chains of tasks that run side by side.
    counted
        What progress counts: ``starts``, ``values``, …
    absent
        Names of tables that an answer need not have.
    """

    command: Command
    scene: Scene
    chains: int
    counted: str
    absent: frozenset[str]

    def scenes(self) -> Iterable[Scene]:
        """Yield the scenes on whose input there may be notes."""

    def answer(self, store: Store, workers: Pool, progress: Progress) -> Answer:
        """Run what it takes in chains of stored tasks (:func:`vibroplat.study.pool.run_stored`), and make the tables.

        The answer depends neither on the order in which workers finish nor on how many there are.
        """

    def repeats(self, answer: Answer, other: Callable[[Scene], Scene]) -> Sequence[Repeat]:
        """Choose motions of the answer that are repeated with other scenes, as by another engine."""


def spread(places: Sequence[int], most: int = CHECKED) -> list[int]:
    """Choose some of the places of a table, as far from each other as they can be."""
    chosen = np.linspace(0, max(len(places) - 1, 0), min(most, len(places))).round().astype(int)
    return [places[place] for place in np.unique(chosen).tolist()]


def ask(
    question: Question,
    jobs: int = 1,
    scheduler: str | None = None,
    wait: float = WAIT,
    progress: Progress = lambda done, known: None,
) -> Answer:
    """Answer a question and store nothing; parameters as those of :func:`vibroplat.study.sweep.sweep`."""
    with Store(None, {}) as store, pool(jobs, scheduler, wait=wait, chains=question.chains) as workers:
        return question.answer(store, workers, progress)
