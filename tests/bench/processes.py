"""Commands, dask's scheduler and its workers as processes, and what kills them."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

import vibroplat
from vibroplat.errors import VibroplatError
from vibroplat.system.interrupts import stop_if_asked, unwinding

#: Longest time (s) of a command. The longest takes minutes; one that takes longer hangs.
LONGEST = 3600.0
#: Longest time (s) until dask's scheduler has started.
START = 60.0
#: Seconds after which a scheduler without work, or a worker without a scheduler, ends: none outlives a killed soak.
ORPHANED = 120
#: How often processes are looked at (s).
TICK = 0.05
#: Most workers that are killed during a sweep. Dask gives a task up whose worker died more often.
MOST_WORKERS_KILLED = 3


class ProcessError(VibroplatError):
    """A process that did not do what it was to do."""

    exit_code = 1


class Done(NamedTuple):
    """How a command ended, and how often it or its workers were killed."""

    code: int
    kills: int


class Places:
    """A directory in which processes run, each with its output in a file.

    All of them, and what they have started, end with the context.
    """

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self._processes: list[subprocess.Popen[bytes]] = []
        self._stack = contextlib.ExitStack()

    def __enter__(self) -> Places:
        self._stack.enter_context(unwinding())
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes:
            if process.returncode is None:  # not reaped: the number of its group is still its own
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
                process.wait()
        self._stack.close()

    def start(self, *arguments: str) -> subprocess.Popen[bytes]:
        """Start a Python module in a process group of its own."""
        path = os.pathsep.join(filter(None, [str(Path(vibroplat.__file__).parents[1]), os.environ.get("PYTHONPATH")]))
        with self._log(len(self._processes)).open("wb") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", *arguments],
                cwd=self.directory,
                env=os.environ | {"PYTHONPATH": path},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
        self._processes.append(process)
        return process

    def _log(self, number: int) -> Path:
        return self.directory / f"process-{number}.log"

    def finish(self, process: subprocess.Popen[bytes]) -> int:
        """Wait for the end of a command; return its exit code.

        Raises
        ------
        ProcessError
            It hangs, was killed, printed a traceback, or ended with a code that is neither 0 nor 1.
        """
        if not _waited(process, LONGEST):
            raise ProcessError(f"{_name(process)} takes longer than {LONGEST:g} s")
        text = self._log(self._processes.index(process)).read_text(errors="replace")
        last = (text.splitlines() or [""])[-1]
        if process.returncode not in (0, 1) or "Traceback" in text:
            raise ProcessError(f"{_name(process)} ended with exit code {process.returncode}: {last}")
        return int(process.returncode)

    def run(self, *arguments: str) -> int:
        """Run a command of this program to its end; return its exit code."""
        return self.finish(self.start("vibroplat", *arguments))

    def run_with_kills(self, arguments: list[str], moments: list[float]) -> Done:
        """Run a sweep that is killed so many seconds after each of its starts, and resumed at last."""
        kills = 0
        for moment in moments:
            process = self.start("vibroplat", *arguments, *(["--resume"] if kills else []))
            if _waited(process, moment):
                return Done(self.finish(process), kills)
            # its worker processes are left to themselves; it is reaped later, with those that are still there
            os.kill(process.pid, signal.SIGKILL)
            kills += 1
        return Done(self.run(*arguments, "--resume"), kills)

    def run_on_dask(self, arguments: list[str], rng: np.random.Generator, between: float) -> Done:
        """Run a sweep on two workers of dask, which are killed and replaced about every ``between`` seconds.

        Raises
        ------
        ProcessError
            The scheduler did not start, or the command failed.
        """
        file = self.directory / "scheduler.json"
        self.start(*_SCHEDULER, "--scheduler-file", str(file), "--idle-timeout", f"{ORPHANED} seconds")
        address = _address(file)
        workers = [self._worker(address) for _ in range(2)]
        process = self.start("vibroplat", *arguments, "--scheduler", address)
        kills = 0
        while kills < MOST_WORKERS_KILLED and not _waited(process, between * rng.uniform(0.5, 1.5)):
            victim = workers.pop(0)
            victim.kill()
            victim.wait()
            kills += 1
            workers.append(self._worker(address))
        return Done(self.finish(process), kills)

    def _worker(self, address: str) -> subprocess.Popen[bytes]:
        options = ("--death-timeout", str(ORPHANED), "--local-directory", str(self.directory))
        return self.start(*_WORKER, address, *options)


_SCHEDULER = ("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
#: Without a nanny: a worker that is killed stays away until another one is started.
_WORKER = ("distributed.cli.dask_worker", "--no-nanny", "--nthreads", "1", "--no-dashboard")


def missing_dask() -> str:
    """Why there can be no cluster here; empty if there can."""
    if importlib.util.find_spec("distributed") is None:
        return "dask: distributed is not installed; it comes with vibroplat[cluster]"
    return ""


def _waited(process: subprocess.Popen[bytes], seconds: float) -> bool:
    """Wait for the end of a process; say whether it came in time."""
    until = time.monotonic() + seconds
    while process.poll() is None:
        stop_if_asked()
        if time.monotonic() > until:
            return False
        time.sleep(TICK)
    return True


def _address(file: Path) -> str:
    """Wait until a scheduler has said where it listens."""
    until = time.monotonic() + START
    while time.monotonic() < until:
        stop_if_asked()
        with contextlib.suppress(OSError, ValueError):  # not there yet, or half of it
            return str(json.loads(file.read_text())["address"])
        time.sleep(TICK)
    raise ProcessError(f"the scheduler of dask did not start within {START:g} s")


def _name(process: subprocess.Popen[bytes]) -> str:
    return " ".join(map(str, list(process.args)[2:5]))  # type: ignore[arg-type]
