"""Runs chains of tasks in parallel: in this process, in worker processes, or on many machines.

The next task of a chain is known only when the one before has finished: the next point of a sweep starts from the
state of the last. The result of a task depends only on its arguments, so results are the same however chains are
distributed over workers.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import contextmanager, nullcontext
from multiprocessing import resource_tracker
from typing import Any, Protocol, TypeVar

from vibroplat.errors import ConfigError, VibroplatError
from vibroplat.interrupts import stop_if_asked, unheard, unwinding, watching

#: Keeps numerical libraries from starting a pool of threads in each worker process.
PINNED = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
#: Seconds without a result after which workers are checked.
PATIENCE = 5.0
#: Longest time (s) until Ctrl-C is noticed while workers run.
TICK = 0.1
#: Seconds without a task after which a worker process exits.
IDLE = 20
#: A task that runs alone is given up when it has lost this many workers.
LIVES = 2

_ADDRESS = re.compile(r"^(tcp|tls|ws|wss|ucx|inproc)://.+:\d+")


class LostError(VibroplatError):
    """All workers are gone."""

    exit_code = 1


class WorkerLostError(Exception):
    """A task's worker died, more than once."""


class Chain(Protocol):
    """A sequence of tasks, each of which follows from the result of the one before."""

    def task(self) -> tuple[Callable[..., Any], tuple[Any, ...]] | None:
        """Return the next task as function and arguments, or None at the end of the chain."""
        ...

    def take(self, result: Any) -> None:
        """Receive the result of the task, or a :class:`WorkerLostError` instead."""
        ...


C = TypeVar("C", bound=Chain)


class Pool(Protocol):
    """Where tasks run."""

    #: Number of tasks submitted at a time.
    slots: int
    #: Exceptions for a task that was given up because its workers died.
    given_up: tuple[type[Exception], ...]

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Start a task."""
        ...

    def renew(self) -> None:
        """Replace workers that have died."""
        ...

    def check(self) -> None:
        """Raise if no worker can answer any more."""
        ...

    def close(self) -> None:
        """Stop the workers, even in the middle of a task."""
        ...


def run_chains(chains: Iterable[C], workers: Pool) -> Iterator[C]:
    """Run all chains to their ends; yield the chain of each finished task after it has received the result."""
    with nullcontext() if isinstance(workers, Inline) else watching():
        yield from _run(chains, workers)


def _run(chains: Iterable[C], workers: Pool) -> Iterator[C]:
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
        done = _finished(running, workers)
        for future in done:
            chain = running.pop(future)
            try:
                chain.take(future.result())
            except (BrokenExecutor, CancelledError):
                lost.append(chain)
                continue
            except workers.given_up as error:
                chain.take(WorkerLostError(" ".join(str(error).split())))
            losses.pop(id(chain), None)
            waiting.append(chain)
            yield chain
        if lost:
            yield from _deal_with(lost, running, suspects, losses, waiting, workers)


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
) -> Iterator[C]:
    """Renew the pool after a worker has died; give up a task that ran alone and has lost too many workers."""
    alone = len(lost) == 1 and not running
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
    """Worker processes on this machine (loky); numerical libraries use one thread in each."""

    given_up: tuple[type[Exception], ...] = ()

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        self.slots = jobs + 1  # one task waits while results are received
        self.renew()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Start a task; if the workers have just died, it fails like the tasks they had."""
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

        self._executor: Executor = get_reusable_executor(self._jobs, timeout=IDLE, env=PINNED)

    def check(self) -> None:
        """Do nothing: the futures of dead workers fail by themselves."""

    def close(self) -> None:
        """Stop the workers."""
        self._executor.shutdown(wait=True, kill_workers=True)  # type: ignore[call-arg]


class Cluster:
    """Workers of a dask scheduler, possibly on many machines; vibroplat must be installed there.

    Raises
    ------
    ConfigError
        dask.distributed is not installed, or the scheduler does not answer.
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client, KilledWorker  # noqa: PLC0415  (optional)
        except ImportError:
            raise ConfigError("--scheduler needs dask.distributed; pip install 'vibroplat[cluster]' has it") from None
        if not _ADDRESS.match(address):
            raise ConfigError(f"--scheduler {address}: not an address; allowed: tcp://host:port")
        self._address = address
        try:
            self._client = Client(address, timeout=10, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            raise ConfigError(f"--scheduler {address}: no scheduler answers there ({reason})") from None
        self._executor: Executor = self._client.get_executor(pure=False)
        self.given_up: tuple[type[Exception], ...] = (KilledWorker,)
        self.slots = 2 * max(1, sum(self._client.nthreads().values()))

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Start a task; if its worker dies, dask repeats it a few times before giving up."""
        future: Future[Any] = self._executor.submit(function, *arguments)
        return future

    def renew(self) -> None:
        """Do nothing: the scheduler manages its workers."""

    def check(self) -> None:
        """Raise if the scheduler is gone."""
        if self._client.status not in ("running", "connecting"):
            raise LostError(
                f"the scheduler at {self._address} is gone; finished points are kept, continue with --resume"
            )

    def close(self) -> None:
        """Disconnect from the cluster."""
        if self._client.status == "running":  # if the scheduler is gone, there is nothing to cancel
            self._executor.shutdown(wait=False)
        self._client.close()


@contextmanager
def pool(jobs: int = 1, scheduler: str | None = None) -> Iterator[Pool]:
    """Open a pool of workers: this process, several processes, or the workers of a dask scheduler."""
    if scheduler is None and jobs == 1:
        yield Inline()
        return
    with unwinding():
        opened = Processes(jobs) if scheduler is None else Cluster(scheduler)
        try:
            yield opened
        finally:
            opened.close()
