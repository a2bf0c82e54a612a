"""Runs single tasks in parallel; results are stored and not computed again."""

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
        Where its result is stored.
    function, arguments
        Called in a worker; returns a record.
    """

    def __init__(self, store: Store, number: int, function: Callable[..., Record], *arguments: Any) -> None:
        self._store = store
        self._number = number
        self._work = function, arguments
        self._record: Record | None = dict(store.read(number)).get(0)

    @property
    def record(self) -> Record:
        """The result of the task."""
        assert self._record is not None  # the chain has finished
        return self._record

    def task(self) -> tuple[Callable[..., Any], tuple[Any, ...]] | None:
        """Return the task if it is not done yet."""
        return None if self._record is not None else self._work

    def take(self, result: Record | WorkerLostError) -> None:
        """Store the result."""
        if isinstance(result, WorkerLostError):
            raise result
        self._record = result
        self._store.write(self._number, 0, result)


def run_tasks(tasks: Sequence[Task], workers: Pool) -> list[Record]:
    """Run the tasks that have no result yet; return the records of all tasks."""
    for _ in run_chains(tasks, workers):
        pass
    return [task.record for task in tasks]
