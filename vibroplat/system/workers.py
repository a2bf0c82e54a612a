"""Worker processes of this machine, which may load while the command loads that has work for them.

Starting takes a worker as long as the command itself: half a second, a third of a sweep of some hundred points.

A worker finds modules where its parent does and nowhere else: a file in the current directory may have the name of any
module. Tasks and results pass through two pipes, and of its parent's streams it has that of errors alone. It ends with
its parent, however that ends: by itself, as nobody is left to stop it, and also in the middle of a task.

Linear algebra has one thread in workers and in the process that has them: libraries round sums otherwise in several.
"""

from __future__ import annotations

import errno
import logging
import multiprocessing
import os
import pickle
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Future
from contextlib import contextmanager, suppress
from math import ceil
from queue import SimpleQueue
from traceback import format_exception
from typing import Any

from vibroplat.system.forks import lock
from vibroplat.system.interrupts import handlers_put_off, without_interrupts
from vibroplat.system.memory import control_groups
from vibroplat.system.terminal import open_streams

#: Environment of workers: without it numerical libraries would start a pool of threads in each process.
PINNED = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
#: How often (s) a worker looks for its parent.
LOOK_S = 0.2
#: Program of a worker: its arguments are its parent, and where that finds modules.
PROGRAM = "import sys; parent, *sys.path = sys.argv[1:]; from vibroplat.system.workers import serve; serve(int(parent))"
_LOCK = lock()
#: State of :func:`one_thread`: number of open blocks, and the limits that end with the last of them.
_inside = 0
_limits: list[Any] = []


class _Kept(threading.local):
    """Workers that load for this thread."""

    workers: Workers | None = None


_KEPT = _Kept()


class Workers:
    """Processes that run tasks; each has a thread of this process, which sends it one after another.

    Parameters
    ----------
    count
        How many.

    Attributes
    ----------
    usable
        Whether they are there: False once one of them has died, or all are closed.

    Raises
    ------
    OSError
        The system gives no process, pipe or thread.
    """

    def __init__(self, count: int) -> None:
        self.count, self.usable = count, True
        self._tasks = SimpleQueue[tuple[Future[Any], Callable[..., Any], tuple[Any, ...]] | None]()
        self._processes = list[subprocess.Popen[bytes]]()
        self._threads = list[threading.Thread]()
        try:
            for _ in range(count):
                with handlers_put_off():  # a process that nobody knows would stay
                    self._processes.append(_start())
                thread = threading.Thread(target=self._serve, args=(self._processes[-1],), daemon=True)
                thread.start()
                self._threads.append(thread)
        except BaseException as error:
            self.close()
            if isinstance(error, RuntimeError):  # no thread
                raise OSError(errno.EAGAIN, str(error)) from None
            raise

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Start a task; its error is BrokenExecutor if its worker dies, or has died."""
        future: Future[Any] = Future()
        self._tasks.put((future, function, arguments))
        return future

    def close(self) -> None:
        """Stop the processes, even in the middle of a task."""
        self.usable = False
        for process in self._processes:
            process.kill()
            self._tasks.put(None)
        for thread in self._threads:
            thread.join()
        for process in self._processes:
            with suppress(OSError), process:  # closes its pipes, one of which may be full
                pass

    def _serve(self, process: subprocess.Popen[bytes]) -> None:
        """Give a process tasks; those that find it dead fail."""
        assert process.stdin is not None
        assert process.stdout is not None
        while (task := self._tasks.get()) is not None:
            future, *work = task
            try:
                sent = pickle.dumps(work, pickle.HIGHEST_PROTOCOL)
            except Exception as error:
                future.set_exception(error)
                continue
            try:
                pickle.dump(sent, process.stdin, pickle.HIGHEST_PROTOCOL)
                process.stdin.flush()
                answer = pickle.load(process.stdout)
            except Exception:  # it has ended, perhaps in the middle of an answer
                self.usable = False
                future.set_exception(BrokenExecutor("a worker process has died"))
                continue
            try:
                raised, result = pickle.loads(answer)
                if raised is not None:
                    raise raised
            except BaseException as error:  # SystemExit too, or an answer that cannot be read here
                future.set_exception(error)
            else:
                future.set_result(result)


def _start() -> subprocess.Popen[bytes]:
    """Start a process with the flags of this one, which looks for modules where this one does."""
    # of its flags, those that a process started by Python's own library would have
    flags = subprocess._args_from_interpreter_flags()  # type: ignore[attr-defined]
    places = [*map(str, sys.path)]
    known = [place for place in places if os.path.isabs(place) and os.pathsep not in place]
    environment = os.environ | PINNED | {"PYTHONPATH": os.pathsep.join(known)}
    line = [sys.executable, *flags, "-P", "-c", PROGRAM, str(os.getpid()), *places]
    with without_interrupts():
        return subprocess.Popen(line, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment)


def serve(parent: int) -> None:
    """Run the tasks of the parent in this process, and end with it."""
    open_streams()
    tasks, results = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a task prints must not get among the results
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    multiprocessing.current_process().name = "worker"
    logging.basicConfig(format="vibroplat: %(message)s")
    try:
        while True:
            answer = _answer(pickle.load(tasks))
            pickle.dump(answer, results, pickle.HIGHEST_PROTOCOL)
            results.flush()
    finally:  # the parent has closed a pipe, or is gone
        os._exit(0)


def _end_with(parent: int) -> None:
    """End this process when it has another parent; kernels let this thread run beside them."""
    while os.getppid() == parent:
        time.sleep(LOOK_S)
    os._exit(0)


def _answer(work: bytes) -> bytes:
    """Do a task; return its error, None for none, and its result."""
    try:
        function, arguments = pickle.loads(work)
        return pickle.dumps((None, function(*arguments)), pickle.HIGHEST_PROTOCOL)
    except BaseException as error:
        error.add_note(f"in a worker process: {''.join(format_exception(error))}")
        with suppress(Exception):
            return pickle.dumps((error, None))
        return pickle.dumps((RuntimeError(f"{type(error).__name__}: {error}"), None))


def core_count() -> int:
    """Count the cores that this process may use, and its control group may keep busy."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    for group in control_groups():
        for names in (("cpu.max",), ("cpu/cpu.cfs_quota_us", "cpu/cpu.cfs_period_us")):
            with suppress(OSError, ValueError):  # "max" is no number
                quota, period = map(int, " ".join((group / name).read_text("ascii") for name in names).split())
                cores = min(cores, ceil(quota / period)) if quota > 0 else cores
    return max(cores, 1)


def worker_processes(jobs: int) -> Workers:
    """Return what runs tasks in so many processes: those of this thread that are loading, or new ones (OSError)."""
    kept = _KEPT.workers
    return kept if kept is not None and kept.usable and kept.count >= jobs else Workers(jobs)


@contextmanager
def loading_workers(jobs: int | None, function: Callable[..., Any], *arguments: Any) -> Iterator[None]:
    """Let the workers of so many jobs, None for one on each core, call a function while the block begins.

    They stop at its end. One job, and a system that starts no processes, has none: whoever needs them says so.
    """
    count = core_count() if jobs is None else min(jobs, core_count())
    if count == 1:
        yield
        return
    with suppress(OSError):
        _KEPT.workers = Workers(count)
        for _ in range(count):
            _KEPT.workers.submit(function, *arguments)
    try:
        yield
    finally:
        if _KEPT.workers is not None:
            _KEPT.workers.close()
            _KEPT.workers = None


@contextmanager
def one_thread() -> Iterator[None]:
    """Let the linear algebra of all libraries that are loaded use one thread in the block.

    A library that is loaded in the block needs another block inside. Blocks of several threads, as dask's workers have,
    overlap; the last one that ends gives back the threads.
    """
    from threadpoolctl import threadpool_limits  # noqa: PLC0415  (looks for all libraries of the process)

    global _inside  # noqa: PLW0603
    counted = 0
    try:
        with handlers_put_off(), _LOCK:  # what a handler raises midway would leave the limits as they are
            _limits.append(threadpool_limits(limits=1))
            counted = 1
            _inside += counted
        yield
    finally:
        with handlers_put_off(), _LOCK:
            _inside -= counted
            while _limits and not _inside:
                _limits.pop().restore_original_limits()
