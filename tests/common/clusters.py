"""Dask schedulers and workers in processes of their own, with this package or another one."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import vibroplat

PACKAGE = Path(vibroplat.__file__).parent
DASK = Path(sys.executable).with_name("dask")


def free_port():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


@contextlib.contextmanager
def _process(place, *arguments, path=None, **environment):
    """A dask process with its output in a file; all that it has started ends with it."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, [path or PACKAGE.parent]))} | environment
    with (place / f"{arguments[0]}-{time.monotonic_ns()}.log").open("w") as log:
        process = subprocess.Popen(
            [str(DASK), *map(str, arguments)],
            cwd=place,
            env=environment,
            stdout=log,
            stderr=log,
            start_new_session=True,
        )
    try:
        yield process
    finally:
        kill(process)


def kill(process):
    """Kill a process with all that it has started."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


@contextlib.contextmanager
def scheduler(place, **options):
    """A scheduler without workers: its address and its process."""
    port = free_port()
    with _process(place, "scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard", **options) as process:
        _await_port(port)
        yield f"tcp://127.0.0.1:{port}", process


def _await_port(port):
    for _ in range(600):
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1.0):
            return
        time.sleep(0.05)
    raise AssertionError("the scheduler did not start")


def worker(place, address, *options, path=None, **environment):
    """A worker with the packages of a directory, these without it, in a nanny unless options say otherwise."""
    common = ("--nthreads", "1", "--no-dashboard", "--local-directory", place)
    return _process(place, "worker", address, *common, *options, path=path, **environment)


def await_workers(address, number):
    """Wait until a scheduler has so many workers."""
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        client.wait_for_workers(number, timeout=60.0)
