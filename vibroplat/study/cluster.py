"""Workers of a dask scheduler, possibly on many machines."""

from __future__ import annotations

import asyncio
import logging
import math
import pickle
import re
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

from vibroplat.errors import ConfigError, VibroplatError
from vibroplat.system.interrupts import records_kept

#: Seconds without a worker after which the user is told what is waited for, and after which it is given up.
NOTICE_S, MAX_WAIT_S = 5.0, 60.0
#: Seconds in which a scheduler must answer when it is first called, and when it is asked for its workers.
FIRST_ANSWER_S, ANSWER_S = 5.0, 2.0
#: Seconds after which workers are counted again.
RECOUNT_S = 5.0
#: Seconds in which a lost connection to the scheduler must be there again, and in which workers say what they have.
RECONNECT_S, REPORT_S = 10.0, 10.0

_ADDRESS = re.compile(r"^(tcp|tls|ws|wss|ucx|inproc)://.+:\d+")
_LOG = logging.getLogger("vibroplat")
#: Libraries that report in tracebacks what is said here in one line.
_SILENCED = ("distributed", "tornado", "asyncio")
#: States of a client that may go on.
_ALIVE = ("running", "connecting")


class WorkerLostError(VibroplatError):
    """A task's worker died more than once."""

    exit_code = 1


class NoWorkersError(VibroplatError):
    """All workers are gone."""

    exit_code = 1


class IncompatibleWorkerError(VibroplatError):
    """A worker would give other bits than this process."""

    exit_code = 1

    def __init__(self, difference: str) -> None:
        super().__init__(f"worker {difference}; all workers need the versions of this process{records_kept()}")


class _Call:
    """A function that is called where it is unpickled."""

    def __init__(self, function: Callable[..., Any], *arguments: Any) -> None:
        self._parts = function, arguments

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return self._parts


class Cluster:
    """Workers of a dask scheduler; vibroplat must be installed there as it is here.

    Parameters
    ----------
    address
        Of the scheduler.

    Raises
    ------
    ConfigError
        dask.distributed is not installed, or no scheduler answers.
    """

    def __init__(self, address: str) -> None:
        require_scheduler(address)
        from distributed import Client, KilledWorker  # noqa: PLC0415  (optional)

        from vibroplat.study import fingerprint  # noqa: PLC0415  (machine code is loaded for it)

        self._address = address
        self._fingerprint, self._expected = fingerprint, fingerprint.fingerprint()
        self._killed = KilledWorker
        self._since: float | None = None
        self._notified = False
        self.slots, self._counted = 2, -math.inf
        with ExitStack() as stack:
            stack.enter_context(_silence())
            try:
                self._client: Any = Client(address, timeout=RECONNECT_S, set_as_default=False)
                self._executor: Executor = self._client.get_executor(pure=False)
                self._count()
            except Exception as error:
                raise _no_scheduler(address, error) from None
            self._stack = stack.pop_all()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Start a task; dask repeats it if its worker dies, and gives it up after some times.

        Dask is given bytes, which the worker unpickles as the task: what the worker lacks is an error of that task.
        Objects that dask itself cannot unpickle there are lost silently, and the task never ends.
        """
        from distributed.protocol.pickle import dumps  # noqa: PLC0415  (optional)

        self._since = None
        work = pickle.dumps(_Call(self._fingerprint.run_checked, self._expected, dumps((function, arguments))))
        answer: Future[Any] = Future()
        try:
            self._count()
            sent = self._executor.submit(pickle.loads, work)
        except Exception:
            if self._client.status not in _ALIVE:
                raise self._gone() from None
            raise
        sent.add_done_callback(lambda done: self._deliver(done, answer))
        return answer

    def _count(self) -> None:
        """Count the workers from time to time, so that each has a task, and another one to go on with."""
        if time.monotonic() - self._counted > RECOUNT_S:
            with suppress(Exception):  # a scheduler that does not answer is found out by check
                self.slots = 2 * max(1, sum(self._workers().values()))
            self._counted = time.monotonic()

    def _workers(self) -> dict[str, int]:
        """Ask the scheduler for its workers, and how many threads each has."""
        ask = self._client.scheduler.ncores
        return dict(self._client.sync(ask, workers=None, callback_timeout=ANSWER_S))

    def _deliver(self, done: Future[Any], answer: Future[Any]) -> None:
        """Pass on how a task ended; this runs in the thread of the connection."""
        error = CancelledError() if done.cancelled() else done.exception()
        if isinstance(error, self._killed):
            error = WorkerLostError(" ".join(str(error).split()))
        if isinstance(error, (CancelledError, WorkerLostError)):
            answer.set_exception(error)
        elif error is not None:  # an error of the function would have been an answer
            self._client.loop.add_callback(self._explain, error, answer)
        elif "refused" in (reply := done.result()):
            answer.set_exception(IncompatibleWorkerError(reply["refused"]))
        elif "error" in reply:
            answer.set_exception(reply["error"])
        else:
            answer.set_result(reply["result"])

    async def _explain(self, error: Exception, answer: Future[Any]) -> None:
        """Find the worker that cannot load what it is sent, and say why."""
        reports: dict[str, Any] = {}
        with suppress(Exception):
            ask = self._client._run(pickle.loads, pickle.dumps(_Call(self._fingerprint.code)), on_error="return")
            reports = await asyncio.wait_for(ask, REPORT_S)
        for worker, report in reports.items():
            failed = isinstance(report, Exception)
            if other := _lacking(report) if failed else self._fingerprint.difference(self._expected, report):
                answer.set_exception(IncompatibleWorkerError(f"{worker}: {other}"))
                return
        left = isinstance(error, (ImportError, AttributeError))
        answer.set_exception(IncompatibleWorkerError(f"that has left: {_lacking(error)}") if left else error)

    def renew(self) -> None:
        """Nothing to replace: the scheduler looks after its workers."""

    def check(self) -> None:
        """Raise :class:`.NoWorkersError` if the scheduler is gone, or all workers are for as long as is waited."""
        if self._client.status not in _ALIVE:
            raise self._gone()
        workers, now = None, time.monotonic()
        if self._client.status == "running":
            with suppress(Exception):  # whatever dask raises where it gets no answer
                workers = self._workers()
        if workers:
            self._since, self._notified = None, False
            return
        missing = f"{'an answer' if workers is None else 'a worker'} of the scheduler at {self._address}"
        self._since = now if self._since is None else self._since
        if now - self._since >= MAX_WAIT_S:
            raise NoWorkersError(f"waited {MAX_WAIT_S:g} s for {missing}{records_kept()}")
        if now - self._since >= NOTICE_S and not self._notified and self._client.status == "running":
            _LOG.warning("waiting for %s, up to %g s", missing, MAX_WAIT_S)
            self._notified = True

    def _gone(self) -> NoWorkersError:
        return NoWorkersError(f"the scheduler at {self._address} is gone{records_kept()}")

    def close(self) -> None:
        """Leave the cluster; a scheduler that does not answer is left silently."""
        with self._stack, suppress(Exception):
            self._client.close(timeout=ANSWER_S)


@contextmanager
def _silence() -> Iterator[None]:
    """Silence dask, which reports in tracebacks what is said here in one line."""
    from distributed.versions import VersionMismatchWarning  # noqa: PLC0415  (optional)

    # what changes results is compared by fingerprints
    warnings.filterwarnings("ignore", category=VersionMismatchWarning)
    names = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] in _SILENCED]
    speaking = [logger for logger in map(logging.getLogger, names) if not logger.disabled]
    for logger in speaking:
        logger.disabled = True
    try:
        yield
    finally:
        for logger in speaking:
            logger.disabled = False


def _lacking(error: Exception) -> str:
    """Say what a worker lacks that could not load the package."""
    missing = getattr(error, "name", None)
    if isinstance(error, ImportError) and missing == "vibroplat":
        return "it has no vibroplat"
    is_other = isinstance(error, AttributeError) or str(missing).startswith("vibroplat.")
    return f"{'it has another vibroplat' if is_other else 'its vibroplat cannot be loaded'} ({error})"


# -- is there a scheduler? ----------------------------------------------------------------------------------


def require_scheduler(address: str) -> None:
    """Ask the scheduler at an address who it is.

    Raises
    ------
    ConfigError
        dask.distributed is not installed, or no scheduler answers there within :data:`FIRST_ANSWER_S` seconds.
    """
    try:
        import distributed  # noqa: F401, PLC0415  (optional)
    except ImportError:
        raise ConfigError("--scheduler needs dask.distributed; pip install 'vibroplat[cluster]' has it") from None
    if not _ADDRESS.match(address):
        raise ConfigError(f"--scheduler {address}: not an address; allowed: tcp://host:port")
    with _silence(), ThreadPoolExecutor(1) as thread:  # a notebook has a loop running in its own
        try:
            kind = thread.submit(asyncio.run, _kind(address)).result()
        except Exception as error:
            raise _no_scheduler(address, error) from None
    if kind != "Scheduler":
        raise ConfigError(f"--scheduler {address}: a dask {kind.lower()} answers there, not a scheduler")


async def _kind(address: str) -> str:
    """Return what a dask process calls itself."""
    from distributed.core import rpc  # noqa: PLC0415  (optional)
    from distributed.security import Security  # noqa: PLC0415

    options = Security().get_connection_args("client")
    async with rpc(address, timeout=FIRST_ANSWER_S, connection_args=options) as remote:
        identity = await asyncio.wait_for(remote.identity(), FIRST_ANSWER_S + 1.0)  # rpc knows better why it failed
    return str(identity["type"])


def _no_scheduler(address: str, error: Exception) -> ConfigError:
    cause: BaseException = error
    while cause.__cause__:
        cause = cause.__cause__
    reason = " ".join(str(cause).split()) or f"no answer within {FIRST_ANSWER_S:g} s"
    if isinstance(cause, MemoryError):  # the first bytes of another protocol were read as a length
        reason = "the answer is not dask's"
    return ConfigError(f"--scheduler {address}: no scheduler answers there ({reason})")
