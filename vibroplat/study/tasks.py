"""Single tasks side by side, their results kept in stores and not computed again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from vibroplat.study.execution import Pool, WorkerLostError, run_chains
from vibroplat.study.store import Store

Record = dict[str, Any]


class Task:
    """A chain of one task.

    Parameters
    ----------
    store, number
        Where its result is kept.
    function, arguments
        What is called in a worker; it returns a record.
    """

    def __init__(self, store: Store, number: int, function: Callable[..., Record], *arguments: Any) -> None:
        self._store = store
        self._number = number
        self._work = function, arguments
        self._record: Record | None = dict(store.read(number)).get(0)

    @property
    def record(self) -> Record:
        """What the task has returned."""
        assert self._record is not None  # its chain has run to its end
        return self._record

    def task(self) -> tuple[Callable[..., Any], tuple[Any, ...]] | None:
        """Return the task, if it is still to be done."""
        return None if self._record is not None else self._work

    def take(self, result: Record | WorkerLostError) -> None:
        """Keep what came of it."""
        if isinstance(result, WorkerLostError):
            raise result
        self._record = result
        self._store.write(self._number, 0, result)


def run_tasks(tasks: Sequence[Task], workers: Pool) -> list[Record]:
    """Run the tasks that have no result yet; returns the records of all."""
    for _ in run_chains(tasks, workers):
        pass
    return [task.record for task in tasks]
