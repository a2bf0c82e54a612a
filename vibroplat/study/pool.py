"""Chains of tasks that run side by side in a pool of workers, each result stored: the way in which studies simulate.

A study is planned as generators. Each yields its next :class:`Task` and is sent the record of the result, so that the
next task may depend on all results so far; what the generator returns is the result of its chain. A resumed chain is
sent the stored records first: it repeats its decisions without computing anything, and continues where it was
interrupted. A stored record is sent only for the very task that it belongs to, so that any records may be lost.

A pool is this process, worker processes, or an executor of :mod:`concurrent.futures`, such as that of dask. The result
of a task depends on its arguments alone, so results do not depend on how chains are spread over workers.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import ExitStack, contextmanager, nullcontext
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

from pydantic import BaseModel

from vibroplat.study.executors import Executors, WorkerLostError, scheduler_executor
from vibroplat.study.store import Record, Store, digest
from vibroplat.system.interrupts import stop_if_asked, unwinding, watching
from vibroplat.system.memory import is_short_of_memory
from vibroplat.system.workers import Workers, core_count, one_thread, worker_processes

#: Longest time (s) until Ctrl-C is noticed while workers run.
TICK_S = 0.1
#: How many times a task that runs alone may lose its worker before it is given up.
MAX_LOSSES = 2

T = TypeVar("T")


class Task(NamedTuple):
    """A function that a worker calls.

    Attributes
    ----------
    function, arguments
        What is called. It returns a record, or an object whose attributes are one.
    on_worker_loss
        Makes the record of a task whose worker died more than once, from the reason. Without it the error is raised.
    """

    function: Callable[..., Any]
    arguments: tuple[Any, ...] = ()
    on_worker_loss: Callable[[str], Record] | None = None

    @property
    def digest(self) -> str:
        """What identifies the task: a digest of the function's name and of all arguments."""
        name = f"{self.function.__module__}.{getattr(self.function, '__qualname__', type(self.function).__name__)}"
        plain = [_json(a) if isinstance(a, BaseModel) else a for a in self.arguments]
        return digest(name, *plain)


#: The last models that were turned into text, and their texts: the tasks of a chain have the same scene.
_TEXTS: deque[tuple[BaseModel, str]] = deque(maxlen=64)


def _json(model: BaseModel) -> str:
    """Return a model as text, without writing it again for each task."""
    for known, text in [*_TEXTS]:  # another thread may add one
        if known is model:
            return text
    _TEXTS.append((model, model.model_dump_json()))
    return _TEXTS[-1][1]


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

    Attributes
    ----------
    next
        The next task; None if the chain is done.
    """

    def __init__(self, tasks: Tasks[T], records: Store, name: int | str) -> None:
        self._tasks = tasks
        self._records = records
        self._name = name
        self._place = -1
        self._result: T
        self.next: Task | None = None
        self._send(None)

    @property
    def done(self) -> bool:
        """Whether no task is left."""
        return self.next is None

    @property
    def result(self) -> T:
        """What the generator has returned; only of a chain that is done."""
        assert self.done
        return self._result

    def accept(self, result: Any) -> None:
        """Store the result of the next task and move on to the one after it.

        Raises
        ------
        WorkerLostError
            It is given in place of a result, and the task has no record for this case.
        """
        assert self.next is not None
        if isinstance(result, WorkerLostError):
            if self.next.on_worker_loss is None:
                raise result
            result = self.next.on_worker_loss(str(result))
        record = result if isinstance(result, dict) else vars(result)
        self._records.write(self._name, self._place, record, self._digest)
        self._send(record)

    def _send(self, record: Record | None) -> None:
        """Send the record of the last task, and go on to the next one whose record is not stored."""
        while True:
            try:
                self.next = next(self._tasks) if record is None else self._tasks.send(record)
            except StopIteration as end:
                self.next, self._result = None, end.value
                return
            self._place += 1
            self._digest = self.next.digest
            record = self._records.get(self._name, self._place, self._digest)
            if record is None:
                return


def _alone(task: Task) -> Tasks[Record]:
    """Do a single task, and return its record."""
    return (yield task)


def run_tasks(
    tasks: Sequence[Task] | Mapping[Any, Task],
    store: Store,
    workers: Pool,
    progress: Callable[[int], object] = lambda done: None,
) -> list[Record]:
    """Run tasks side by side and return their records; each is stored under its name, or its number."""
    named = tasks.items() if isinstance(tasks, Mapping) else enumerate(tasks)
    return run_stored([StoredChain(_alone(task), store, name) for name, task in named], workers, progress)


def run_stored(
    chains: Iterable[StoredChain[T]], workers: Pool, progress: Callable[[int], object] = lambda done: None
) -> list[T]:
    """Run chains side by side and return their results in the order of the chains.

    ``progress`` is called before the first task and after each with the number of finished chains.
    """
    chains = list(chains)
    left = {id(chain) for chain in chains if not chain.done}
    progress(len(chains) - len(left))
    for chain in run_chains(chains, workers):
        if chain.done:
            left.discard(id(chain))
        progress(len(chains) - len(left))
    return [chain.result for chain in chains]


def run_chains(chains: Iterable[StoredChain[T]], workers: Pool) -> Iterator[StoredChain[T]]:
    """Run all chains to their ends; yield the chain of each task after it has taken the result.

    Chains take turns, so that all end at about the same time.

    When a worker dies, one of the tasks that were running has killed it. From then on each of them runs alone, until
    it has a result or has killed its worker :data:`MAX_LOSSES` times and is given up. A task that dask has given up
    runs alone too before it is lost: dask counts the death of a worker against every task that the worker held.
    """
    waiting = deque(chain for chain in chains if not chain.done)
    suspects: deque[StoredChain[T]] = deque()
    deaths: Counter[int] = Counter()
    running: dict[Future[Any], StoredChain[T]] = {}

    def taken(chain: StoredChain[T], result: Any) -> StoredChain[T]:
        del deaths[id(chain)]
        if suspects and suspects[0] is chain:
            suspects.popleft()
        chain.accept(result)
        waiting.extend([] if chain.done else [chain])
        return chain

    with nullcontext() if isinstance(workers, Inline) else watching():
        while waiting or suspects or running:
            while (waiting or suspects) and len(running) < (1 if suspects else workers.slots):
                chain = suspects[0] if suspects else waiting.popleft()
                assert chain.next is not None
                running[workers.submit(chain.next.function, *chain.next.arguments)] = chain
            lost, killed = [], False
            for future in _wait_for_task(running):
                chain = running.pop(future)
                try:
                    result = future.result()
                except (BrokenExecutor, CancelledError) as error:
                    lost.append(chain)
                    killed = killed or isinstance(error, BrokenExecutor)  # rather than lost with the connection
                    continue
                except WorkerLostError as error:
                    if chain not in suspects:  # it was not alone
                        suspects.append(chain)
                        continue
                    result = error
                yield taken(chain, result)
            if lost:
                lost += running.values()
                running.clear()
                workers.renew()
                chain, *others = lost
                deaths[id(chain)] += killed and not others
                if deaths[id(chain)] == MAX_LOSSES:
                    yield taken(chain, WorkerLostError(f"its worker died {MAX_LOSSES} times"))
                else:
                    suspects.extend(chain for chain in lost if chain not in suspects)


def _wait_for_task(running: Iterable[Future[Any]]) -> set[Future[Any]]:
    """Wait until a task has finished; end if a signal asks for it."""
    while True:
        done = wait(running, timeout=TICK_S, return_when=FIRST_COMPLETED).done
        stop_if_asked()
        if done:
            return done


# -- where tasks run --------------------------------------------------------------------------------------


class Pool(Protocol):
    """Where tasks run; by itself it replaces and stops nothing.

    Attributes
    ----------
    slots
        How many tasks it is given at a time.
    """

    slots: int

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Start a task; its error is :class:`WorkerLostError` if its worker died too often."""

    def renew(self) -> None:
        """Replace workers that have died."""
        return

    def close(self) -> None:
        """Stop the workers, even in the middle of a task."""
        return


class Inline(Pool):
    """Runs tasks in this process."""

    slots = 1

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Run a task."""
        future: Future[Any] = Future()
        try:
            future.set_result(function(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future


class Processes(Pool):
    """Worker processes of this machine; numerical libraries use one thread in each."""

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        self.slots = jobs + 1  # one task waits while results are received
        self._workers = _start_workers(jobs)

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Start a task; if the workers have just died it fails like the tasks that they had."""
        return self._workers.submit(function, *arguments)

    def renew(self) -> None:
        """Start new workers, as one of the old ones has died."""
        self._workers.close()
        self._workers = _start_workers(self._jobs)

    def close(self) -> None:
        """Stop the workers."""
        self._workers.close()


def _start_workers(jobs: int) -> Workers:
    """Start worker processes; an error of the system says that it is about them."""
    try:
        return worker_processes(jobs)
    except OSError as error:
        if is_short_of_memory(error):
            raise
        raise OSError(f"worker processes cannot be started: {error.strerror or error}; one job needs none") from None


@contextmanager
def pool(
    jobs: int | None = 1, scheduler: str | None = None, executor: Executor | None = None, *, chains: int | None = None
) -> Iterator[Pool]:
    """Open a pool: this process for one job, worker processes for more, or an executor.

    While it is open, linear algebra has one thread in this process, as in workers.

    Parameters
    ----------
    jobs
        Worker processes; None for as many as there are cores. There are at most as many as chains and as cores.
    scheduler
        Address of a dask scheduler, whose workers are used instead.
    executor
        An executor of :mod:`concurrent.futures`, whose workers are used instead.
    chains
        The most chains that are run side by side, if that is known.

    Raises
    ------
    ConfigError
        The scheduler does not answer, or dask.distributed is not installed.
    """
    processes = 1 if jobs == 1 else min(count for count in (jobs, chains, core_count()) if count is not None)
    if scheduler is None and executor is None and processes <= 1:
        with one_thread():
            yield Inline()
        return
    with unwinding(), one_thread(), ExitStack() as stack:
        opened: Pool
        if scheduler is not None:
            of_dask, killed = stack.enter_context(scheduler_executor(scheduler))
            opened = Executors(of_dask, f"the scheduler at {scheduler}", (killed,))
        else:
            opened = Processes(processes) if executor is None else Executors(executor)
        stack.callback(opened.close)
        yield opened
