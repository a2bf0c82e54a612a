"""Answers of questions are checked: another engine repeats some of the motions that they come from.

Which these are, and what each must give, the question itself says. Motions that repeat are compared by their measures
too, others by their class alone: of those two engines have no more in common.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

from vibroplat.check import Other, by_other_engine
from vibroplat.check.sweeps import scales_of
from vibroplat.columns import PHASE_COLUMN
from vibroplat.integrate import engine_name
from vibroplat.study.classification import same_phase
from vibroplat.study.pool import Pool, StoredChain, Tasks, run_stored
from vibroplat.study.question import Answer, Progress, Question, Repeat
from vibroplat.study.store import Record, Store

#: Difference of a measure over the larger of it and its scale that is allowed: ten times what settling leaves.
ALLOWED: Final = 1e-3


class AnswerCheck(NamedTuple):
    """What the check of an answer has found.

    Attributes
    ----------
    other
        Name of the engine that checked it.
    checked
        How many motions were repeated.
    largest
        The largest difference that is within what is allowed, over the larger of the measure and its scale.
    disagreements
        A line for each motion that differs.
    """

    other: str
    checked: int
    largest: float
    disagreements: list[str]

    @property
    def agrees(self) -> bool:
        """Whether no motion differs."""
        return not self.disagreements

    def lines(self) -> Iterator[tuple[str, str]]:
        """Yield lines that summarize it: label and text."""
        motions = f"{self.checked} motion{'s' * (self.checked != 1)}"
        told = f"{motions}, measures within {self.largest:.1g}" if self.checked else "no motion to repeat"
        yield "checked by", f"engine {self.other}, {told}"

    def to_tree(self) -> dict[str, Any]:
        """Return it as plain values."""
        return self._asdict()


def check_answer(
    question: Question,
    answer: Answer,
    store: Store,
    workers: Pool,
    progress: Progress = lambda done, known: None,
    other: Other = by_other_engine,
) -> AnswerCheck:
    """Repeat motions of an answer with another engine.

    Parameters
    ----------
    question, answer
        What was asked, and its answer.
    store, workers
        As the question had them; repetitions are stored in a part of their own.
    progress
        Called with the numbers of motions that are done, and of all.
    other
        Makes the scene that checks a scene; by default the same one with another engine.
    """
    repeats = question.repeats(answer, other)

    def chain(repeat: Repeat) -> Tasks[Record]:
        return (yield repeat.task)

    chains = [StoredChain(chain(repeat), store.part("check"), repeat.place) for repeat in repeats]
    found = run_stored(chains, workers, lambda done: progress(done, len(repeats)))
    engines, scales = (engine_name(question.scene), engine_name(other(question.scene))), scales_of(question.scene)
    largest, disagreements = 0.0, list[str]()
    for repeat, record in zip(repeats, found, strict=True):
        names = [name for name in repeat.row if name != PHASE_COLUMN]
        if not repeat.row.get("period", 1):
            names = ["period"] if same_phase(repeat.row, record["row"]) else ["period", "sync"]
        apart = {name: _apart(repeat.row[name], record["row"].get(name), scales.get(name, 0.0)) for name in names}
        worst = max((size, name) for name, size in apart.items())
        if worst[0] <= ALLOWED:
            largest = max(largest, worst[0])
            continue
        one, two = (_told(row.get(worst[1])) for row in (repeat.row, record["row"]))
        disagreements.append(
            f"engines disagree {repeat.place}: {worst[1]} = {one} ({engines[0]}) and {two} ({engines[1]})"
        )
    return AnswerCheck(engines[1], len(repeats), largest, disagreements)


def _apart(one: Any, two: Any, scale: float) -> float:
    """Return how far two values are apart, over the larger of the first and its scale; 1 if they are no numbers."""
    if isinstance(one, float) and isinstance(two, float):
        return abs(one - two) / (max(abs(one), scale) or 1.0)
    return float(one != two)


def _told(value: Any) -> str:
    return f"{value:.9g}" if isinstance(value, float) else str(value)
