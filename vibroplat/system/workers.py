"""Worker processes of this machine, started by loky, which may load while the command loads that has work for them.

Starting takes a worker as long as the command itself: half a second, a third of a sweep of some hundred points.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import Any

from vibroplat.system.interrupts import without_interrupts

#: Environment of workers: without it numerical libraries would start a pool of threads in each process.
PINNED = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
#: Seconds without a task after which a worker process exits.
IDLE_S = 20


def worker_processes(jobs: int) -> Executor:
    """Return what runs tasks in so many processes: those that are running already, or new ones if they are broken."""
    from loky import get_reusable_executor  # noqa: PLC0415  (not needed for one job)

    # a worker that has been idle for long ends, and is replaced when there is work
    warnings.filterwarnings("ignore", message="A worker stopped while some jobs were given", category=UserWarning)
    found: Executor = get_reusable_executor(jobs, timeout=IDLE_S, env=PINNED)
    return found


def submit(workers: Executor, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
    """Start a task in a worker process, which is started itself if there is none."""
    resource_tracker.ensure_running()  # started later, it would unblock Ctrl-C (CPython < 3.14)
    with without_interrupts():
        return workers.submit(function, *arguments)


def close_workers(workers: Executor) -> None:
    """Stop worker processes, even in the middle of a task."""
    workers.shutdown(wait=True, kill_workers=True)  # type: ignore[call-arg]


@contextmanager
def _quiet_trackers() -> Iterator[None]:
    """Let processes that start in the block clean up without a warning once a request to end has killed workers."""
    before = os.environ.get("PYTHONWARNINGS")
    os.environ["PYTHONWARNINGS"] = ",".join([*filter(None, [before]), "ignore:resource_tracker"])
    try:
        yield
    finally:
        del os.environ["PYTHONWARNINGS"]
        if before is not None:
            os.environ["PYTHONWARNINGS"] = before


@contextmanager
def loading_workers(jobs: int | None, function: Callable[..., Any], *arguments: Any) -> Iterator[None]:
    """Let the workers of so many jobs, None for one on each core, call a function while the block begins.

    They stop at its end. One job, and a system that starts no processes, has none: whoever needs them says so.
    """
    from loky import cpu_count  # noqa: PLC0415  (not needed for one job)

    count = int(cpu_count()) if jobs is None else min(jobs, int(cpu_count()))
    if count == 1:
        yield
        return
    workers = None
    try:
        with _quiet_trackers():
            workers = worker_processes(count)
            for _ in range(count):
                submit(workers, function, *arguments)
    except OSError:
        pass
    try:
        yield
    finally:
        if workers is not None:
            close_workers(workers)
