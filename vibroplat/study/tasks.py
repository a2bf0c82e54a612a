"""Chains of tasks whose results are stored: the way in which every study simulates.

A study is planned as generators. Each yields its next :class:`Task` and is sent the record of the result, so that the
task after it may depend on all results so far; what the generator returns is the result of its chain. Chains run side
by side in a pool, and each record is stored as soon as it is there. A resumed chain is sent the stored records first:
it repeats its decisions without computing anything, and goes on where it was interrupted.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from typing import Any, Generic, NamedTuple, TypeVar

from vibroplat.study.execution import Pool, WorkerLostError, run_chains
from vibroplat.study.store import Record, Records

T = TypeVar("T")


class Task(NamedTuple):
    """A function that a worker calls.

    Attributes
    ----------
    function, arguments
        What is called. It returns a record, or an object whose attributes are one.
    if_lost
        Makes the record of a task whose worker died more than once, from the reason. Without it the error is raised.
    """

    function: Callable[..., Any]
    arguments: tuple[Any, ...] = ()
    if_lost: Callable[[str], Record] | None = None


#: A generator of tasks that is sent their records.
Tasks = Generator[Task, Record, T]


class StoredChain(Generic[T]):
    """A chain that stores its records, and begins with those that are stored.

    Parameters
    ----------
    tasks
        What is to be done; it must yield the same tasks when it is sent the same records.
    records
        Where the records are stored.
    name
        Of the chain, under which they are.
    """

    def __init__(self, tasks: Tasks[T], records: Records, name: int | str) -> None:
        self._tasks = tasks
        self._records = records
        self._name = name
        self._next: Task | None = None
        self._result: T
        self._stored = -1
        self._send(None)
        for _, record in records.read(name):
            if self.done:
                break
            self._send(record)

    @property
    def done(self) -> bool:
        """Whether no task is left."""
        return self._next is None

    @property
    def result(self) -> T:
        """What the generator has returned; only of a chain that is done."""
        assert self.done
        return self._result

    def task(self) -> tuple[Callable[..., Any], tuple[Any, ...]] | None:
        """Return the next task as function and arguments; None if the chain is done."""
        return None if self._next is None else (self._next.function, self._next.arguments)

    def take(self, result: Any) -> None:
        """Store the result of the task and move on to the next one.

        Raises
        ------
        WorkerLostError
            It is given in place of a result, and the task has no record for this case.
        """
        if isinstance(result, WorkerLostError):
            if self._next is None or self._next.if_lost is None:
                raise result
            result = self._next.if_lost(str(result))
        record = result if isinstance(result, dict) else vars(result)
        self._records.write(self._name, self._stored, record)
        self._send(record)

    def _send(self, record: Record | None) -> None:
        self._stored += 1
        try:
            self._next = next(self._tasks) if record is None else self._tasks.send(record)
        except StopIteration as end:
            self._next, self._result = None, end.value


def run_stored(chains: Iterable[StoredChain[T]], workers: Pool) -> list[T]:
    """Run chains side by side and return their results in the order of the chains."""
    chains = list(chains)
    for _ in run_chains(chains, workers):
        pass
    return [chain.result for chain in chains]
