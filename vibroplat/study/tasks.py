"""Chains of tasks whose results are stored: the way in which every study simulates.

A study is planned as generators. Each yields its next :class:`Task` and is sent the record of the result, so that the
task after it may depend on all results so far; what the generator returns is the result of its chain. Chains run side
by side in a pool, and each record is stored as soon as it is there. A resumed chain is sent the stored records first:
it repeats its decisions without computing anything, and goes on where it was interrupted. A stored record is sent only
for the very task that it was the record of, so that it does not matter which records are lost.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from typing import Any, Generic, NamedTuple, TypeVar

from pydantic import BaseModel

from vibroplat.study.execution import Pool, WorkerLostError, run_chains
from vibroplat.study.store import Record, Records, digest

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

    @property
    def digest(self) -> str:
        """What identifies the task: a digest of the function's name and of all arguments."""
        name = f"{self.function.__module__}.{getattr(self.function, '__qualname__', type(self.function).__name__)}"
        return digest(name, *map(_plain, self.arguments))


#: A generator of tasks that is sent their records.
Tasks = Generator[Task, Record, T]


class StoredChain(Generic[T]):
    """A chain that stores its records, and does not repeat tasks whose records are stored.

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
        self._digest = ""
        self._place = -1
        self._result: T
        self._send(None)

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
        self._records.write(self._name, self._place, record, self._digest)
        self._send(record)

    def _send(self, record: Record | None) -> None:
        """Send the record of the last task, and go on to the next one whose record is not stored."""
        while True:
            try:
                self._next = next(self._tasks) if record is None else self._tasks.send(record)
            except StopIteration as end:
                self._next, self._result = None, end.value
                return
            self._place += 1
            self._digest = self._next.digest
            record = self._records.find(self._name, self._place, self._digest)
            if record is None:
                return


def _plain(argument: Any) -> Any:
    """Return an argument as plain values."""
    return argument.model_dump(mode="json") if isinstance(argument, BaseModel) else argument


def run_stored(chains: Iterable[StoredChain[T]], workers: Pool) -> list[T]:
    """Run chains side by side and return their results in the order of the chains."""
    chains = list(chains)
    for _ in run_chains(chains, workers):
        pass
    return [chain.result for chain in chains]
