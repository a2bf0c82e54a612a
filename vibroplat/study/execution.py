"""Run chains of tasks side by side: in this process, in worker processes or on many machines.

The next task of a chain is known when the one before it has finished, as each point of a sweep begins with the state
of the last. The result of a task depends on its arguments alone, so results do not depend on how chains are spread
over workers.
"""

from __future__ import annotations

import logging
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import contextmanager, nullcontext
from multiprocessing import resource_tracker
from typing import Any, Protocol, TypeVar

from vibroplat.errors import VibroplatError
from vibroplat.study import WAIT
from vibroplat.study.cluster import Cluster
from vibroplat.system.interrupts import stop_if_asked, unheard, unwinding, watching

#: Environment of workers: without it numerical libraries would start a pool of threads in each process.
PINNED = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
#: Seconds without a result after which the pool is checked for workers.
PATIENCE = 1.0
#: Longest time (s) until Ctrl-C is noticed while workers run.
TICK = 0.1
#: Seconds without a task after which a worker process exits.
IDLE = 20
#: How many times a task that runs alone may lose its worker before it is given up.
LIVES = 2

_LOG = logging.getLogger("vibroplat")


class WorkerLostError(VibroplatError):
    """A task's worker died more than once."""

    exit_code = 1


class Chain(Protocol):
    """A sequence of tasks, each of which follows from the result of the one before."""

    def task(self) -> tuple[Callable[..., Any], tuple[Any, ...]] | None:
        """Return the next task as function and arguments, or None at the end of the chain."""
        ...

    def take(self, result: Any) -> None:
        """Take the result of the task, or a :class:`WorkerLostError` if it was given up."""
        ...


C = TypeVar("C", bound=Chain)


class Pool(Protocol):
    """Where tasks run."""

    #: How many tasks it is given at a time.
    slots: int
    #: Errors with which it gives up a task whose workers died.
    given_up: tuple[type[Exception], ...]

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Start a task."""
        ...

    def renew(self) -> None:
        """Replace workers that have died."""
        ...

    def check(self) -> None:
        """Raise :class:`.LostError` if no worker can answer any more."""
        ...

    def close(self) -> None:
        """Stop the workers, even in the middle of a task."""
        ...


def run_chains(chains: Iterable[C], workers: Pool, *, in_turn: bool = True) -> Iterator[C]:
    """Run all chains to their ends; yield the chain of each task after it has taken the result.

    Chains take turns, so that all end at about the same time. Otherwise the first ones are finished first.
    """
    with nullcontext() if isinstance(workers, Inline) else watching():
        yield from _run(chains, workers, in_turn=in_turn)


def _run(chains: Iterable[C], workers: Pool, *, in_turn: bool) -> Iterator[C]:
    waiting: deque[C] = deque(chains)
    suspects: deque[C] = deque()  # one of them has killed its worker: each runs alone
    losses: dict[int, int] = {}
    running: dict[Future[Any], C] = {}
    alone = False
    while waiting or suspects or running:
        alone = alone and bool(running)
        while (waiting or suspects) and not alone and len(running) < (1 if suspects else workers.slots):
            alone = bool(suspects)
            chain = (suspects or waiting).popleft()
            work = chain.task()
            if work is not None:
                running[workers.submit(work[0], *work[1])] = chain
            else:
                alone = False
        if not running:
            continue
        lost: list[C] = []
        killed = False
        done = _finished(running, workers)
        for future in done:
            chain = running.pop(future)
            try:
                chain.take(future.result())
            except (BrokenExecutor, CancelledError) as error:
                lost.append(chain)
                killed = killed or isinstance(error, BrokenExecutor)  # rather than lost with the connection
                continue
            except workers.given_up as error:
                chain.take(WorkerLostError(" ".join(str(error).split())))
            losses.pop(id(chain), None)
            (waiting.append if in_turn else waiting.appendleft)(chain)
            yield chain
        if lost:
            yield from _deal_with(lost, running, suspects, losses, waiting, workers, killed=killed)


def _finished(running: dict[Future[Any], C], workers: Pool) -> set[Future[Any]]:
    """Wait until a task has finished; end if a signal asks for it, and raise if all workers are gone."""
    while True:
        for _ in range(round(PATIENCE / TICK)):
            done = wait(running, timeout=TICK, return_when=FIRST_COMPLETED).done
            stop_if_asked()
            if done:
                return done
        workers.check()


def _deal_with(
    lost: list[C],
    running: dict[Future[Any], C],
    suspects: deque[C],
    losses: dict[int, int],
    waiting: deque[C],
    workers: Pool,
    *,
    killed: bool,
) -> Iterator[C]:
    """Renew the pool after a worker has died; give up a task that ran alone and has no life left."""
    alone = killed and len(lost) == 1 and not running
    lost += running.values()
    running.clear()
    workers.renew()
    for chain in lost:
        losses[id(chain)] = losses.get(id(chain), 0) + alone
        if losses[id(chain)] < LIVES:
            suspects.append(chain)
        else:
            del losses[id(chain)]
            chain.take(WorkerLostError(f"its worker died {LIVES} times"))
            waiting.append(chain)
            yield chain


class Inline:
    """Runs tasks in this process."""

    slots = 1
    given_up: tuple[type[Exception], ...] = ()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Run a task."""
        future: Future[Any] = Future()
        try:
            future.set_result(function(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future

    def renew(self) -> None:
        """Nothing to replace."""

    def check(self) -> None:
        """Do nothing: a task has finished when it is submitted."""

    def close(self) -> None:
        """Nothing to stop."""


class Processes:
    """Worker processes of this machine, started by loky; numerical libraries use one thread in each."""

    given_up: tuple[type[Exception], ...] = ()

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        self.slots = jobs + 1  # one task waits while results are received
        self.renew()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Start a task; if the workers have just died it fails like the tasks that they had."""
        try:
            resource_tracker.ensure_running()  # started later, it would unblock Ctrl-C (CPython < 3.14)
            with unheard():
                future: Future[Any] = self._executor.submit(function, *arguments)
        except BrokenExecutor as error:
            future = Future()
            future.set_exception(error)
        return future

    def renew(self) -> None:
        """Start new workers if the old ones are broken."""
        from loky import get_reusable_executor  # noqa: PLC0415  (not needed for one job)

        # a worker that has been idle for long ends, and is replaced when there is work
        warnings.filterwarnings("ignore", message="A worker stopped while some jobs were given", category=UserWarning)
        self._executor: Executor = get_reusable_executor(self._jobs, timeout=IDLE, env=PINNED)

    def check(self) -> None:
        """Do nothing: the futures of workers that die fail by themselves."""

    def close(self) -> None:
        """Stop the workers."""
        self._executor.shutdown(wait=True, kill_workers=True)  # type: ignore[call-arg]


@contextmanager
def pool(
    jobs: int | None = 1, scheduler: str | None = None, *, wait: float = WAIT, chains: int | None = None
) -> Iterator[Pool]:
    """Open a pool: this process for one job, worker processes for more, or the workers of a dask scheduler.

    Parameters
    ----------
    jobs
        Worker processes; None for as many as there are cores. Processes without a chain or a core are not started.
    scheduler
        Address of a dask scheduler, whose workers are used instead.
    wait
        Seconds after which a scheduler without workers is given up.
    chains
        The most chains that are run side by side, if that is known.

    Raises
    ------
    ConfigError
        The scheduler does not answer, or dask.distributed is not installed.
    """
    processes = 1 if scheduler is not None else _useful(jobs, chains)
    if scheduler is None and processes == 1:
        yield Inline()
        return
    with unwinding():
        opened = Processes(processes) if scheduler is None else Cluster(scheduler, wait)
        try:
            yield opened
        finally:
            opened.close()


def _useful(jobs: int | None, chains: int | None) -> int:
    """Return how many of the processes have something to do and a core to do it on; say so where not all have."""
    if jobs == 1:
        return 1
    from loky import cpu_count  # noqa: PLC0415  (not needed for one job)

    cores = int(cpu_count())
    wanted = cores if jobs is None else jobs
    useful = max(1, min(wanted, cores, wanted if chains is None else chains))
    if jobs is not None and useful < jobs and chains != 0:
        used = f"{useful} processes are" if useful > 1 else "one process is"
        why = "there are no more cores" if useful == cores else "there is no work for more at a time"
        _LOG.warning("--jobs %d: %s used, as %s", jobs, used, why)
    return useful
