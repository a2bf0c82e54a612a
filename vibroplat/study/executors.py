"""Executors of :mod:`concurrent.futures`, whose workers may be on many machines: any, and that of a dask scheduler."""

from __future__ import annotations

import asyncio
import logging
import pickle
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from typing import Any

from vibroplat.errors import ConfigError, VibroplatError
from vibroplat.system.interrupts import records_kept

#: Seconds in which a scheduler must answer, a lost connection must be there again, and a worker must have joined.
ANSWER_S, RECONNECT_S, WORKER_S = 5.0, 10.0, 60.0
#: Tasks that an executor is given at a time, more than most have workers.
MAX_SENT = 1000
#: Libraries that report in tracebacks what is said here in one line.
_SILENCED = ("distributed", "tornado", "asyncio")


class WorkerLostError(VibroplatError):
    """A task's worker died more than once."""

    exit_code = 1


class NoWorkersError(VibroplatError):
    """An executor can do no more tasks."""

    exit_code = 1


class IncompatibleWorkerError(VibroplatError):
    """A worker would give other bits than this process."""

    exit_code = 1

    def __init__(self, difference: str) -> None:
        super().__init__(f"worker {difference}; all workers need the versions of this process{records_kept()}")


class Executors:
    """A pool: the workers of an executor, on which vibroplat must be installed as it is here.

    A worker is sent bytes, which it unpickles as the task: what it lacks is an error of that task, where executors
    would break, or wait for ever.

    Parameters
    ----------
    executor
        Who does the tasks; it is not shut down.
    name
        What messages call it.
    lost
        Types of its errors for tasks whose worker died too often.
    """

    slots = MAX_SENT

    def __init__(self, executor: Executor, name: str = "the executor", lost: tuple[type[Exception], ...] = ()) -> None:
        from vibroplat.study import fingerprint  # noqa: PLC0415  (machine code is loaded for it)

        self._executor, self._name, self._lost = executor, name, lost
        self._run_checked, self._expected = fingerprint.run_checked, fingerprint.fingerprint()
        self._sent = set[Future[Any]]()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Start a task on a worker with the fingerprint of this process."""
        work = pickle.dumps(_Call(self._run_checked, self._expected, pickle.dumps((function, arguments))))
        try:
            sent = self._executor.submit(pickle.loads, work)
        except Exception as error:
            raise self._gone(error) from None
        answer: Future[Any] = Future()
        self._sent.add(sent)
        sent.add_done_callback(lambda done: self._deliver(done, answer))
        return answer

    def _deliver(self, done: Future[Any], answer: Future[Any]) -> None:
        """Pass on how a task ended; this runs in a thread of the executor."""
        self._sent.discard(done)
        error = CancelledError() if done.cancelled() else done.exception()
        reply: dict[str, Any] = done.result() if error is None else {"error": error}
        if "refused" in reply:
            error = IncompatibleWorkerError(reply["refused"])
        elif isinstance(error, self._lost):
            error = WorkerLostError(" ".join(str(error).split()))
        elif isinstance(error, (BrokenExecutor, CancelledError)):
            error = self._gone(error)
        elif isinstance(error, (ImportError, AttributeError)):
            error = IncompatibleWorkerError(f"cannot load this vibroplat ({error})")
        error = error or reply.get("error")
        if error is None:
            answer.set_result(reply["result"])
        else:
            answer.set_exception(error)

    def _gone(self, error: BaseException) -> NoWorkersError:
        reason = " ".join(str(error).split())
        return NoWorkersError(f"{self._name} is gone{reason and f' ({reason})'}{records_kept()}")

    def renew(self) -> None:
        """Nothing to replace: an executor looks after its workers, or is gone."""

    def close(self) -> None:
        """Cancel the tasks that have not begun."""
        for future in [*self._sent]:
            future.cancel()


class _Call:
    """A function that is called where it is unpickled."""

    def __init__(self, function: Callable[..., Any], *arguments: Any) -> None:
        self._parts = function, arguments

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return self._parts


@contextmanager
def scheduler_executor(address: str) -> Iterator[tuple[Executor, type[Exception]]]:
    """Yield the executor of the scheduler at an address, and the error of tasks whose worker died too often.

    Raises
    ------
    ConfigError
        dask.distributed is not installed, or no scheduler with a worker answers there.
    """
    require_scheduler(address)
    from distributed import Client, KilledWorker  # noqa: PLC0415  (optional)

    with _silence():
        try:
            client = Client(address, timeout=RECONNECT_S, set_as_default=False)
        except Exception as error:
            raise _no_scheduler(address, error) from None
        try:
            client.wait_for_workers(1, timeout=WORKER_S)
        except TimeoutError:
            client.close(timeout=ANSWER_S)
            raise ConfigError(f"--scheduler {address}: it has no worker after {WORKER_S:g} s") from None
        try:
            yield client.get_executor(pure=False), KilledWorker
        finally:
            with suppress(Exception):  # a scheduler that does not answer is left silently
                client.close(timeout=ANSWER_S)


def require_scheduler(address: str) -> None:
    """Refuse an address at which no scheduler answers within :data:`ANSWER_S` seconds (ConfigError)."""
    try:
        import distributed  # noqa: F401, PLC0415  (optional)
    except ImportError:
        raise ConfigError("--scheduler needs dask.distributed; pip install 'vibroplat[cluster]' has it") from None
    with _silence(), ThreadPoolExecutor(1) as thread:  # a notebook has a loop running in its own
        try:
            kind = thread.submit(asyncio.run, _kind(address)).result()
        except Exception as error:
            raise _no_scheduler(address, error) from None
    if kind != "Scheduler":
        raise ConfigError(f"--scheduler {address}: a dask {kind.lower()} answers there; allowed: a scheduler")


async def _kind(address: str) -> str:
    """Return what a dask process calls itself."""
    from distributed.core import rpc  # noqa: PLC0415  (optional)
    from distributed.security import Security  # noqa: PLC0415

    options = Security().get_connection_args("client")
    async with rpc(address, timeout=ANSWER_S, connection_args=options) as remote:
        identity = await asyncio.wait_for(remote.identity(), ANSWER_S)
    return str(identity["type"])


def _no_scheduler(address: str, error: Exception) -> ConfigError:
    reason = " ".join(str(error).split()) or f"no answer within {ANSWER_S:g} s"
    return ConfigError(f"--scheduler {address}: no scheduler answers there ({reason}); allowed: tcp://host:port")


@contextmanager
def _silence() -> Iterator[None]:
    """Silence dask, which reports in tracebacks what is said here in one line."""
    warnings.filterwarnings("ignore", module="distributed")  # what changes results is compared by fingerprints
    names = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] in _SILENCED]
    speaking = [logger for logger in map(logging.getLogger, names) if not logger.disabled]
    for logger in speaking:
        logger.disabled = True
    try:
        yield
    finally:
        for logger in speaking:
            logger.disabled = False
