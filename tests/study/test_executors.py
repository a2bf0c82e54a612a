"""Executors and schedulers of dask: whose workers are others, or that go: one line, and what is finished is kept."""

import logging
import math
import signal
import socket
import sys
import time
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import pandas as pd
import pytest
from common import clusters
from common.commands import Child, command
from common.places import LOADED
from common.results import bits, finished_points

from vibroplat import load_config, sweep
from vibroplat.errors import ConfigError
from vibroplat.study import executors
from vibroplat.study.executors import IncompatibleWorkerError, NoWorkersError, require_scheduler
from vibroplat.study.pool import pool, run_chains
from vibroplat.system.interrupts import RESUMABLE, offer_resume

from .helpers import Calls

#: A sweep of some seconds with four branches.
SWEEP = (
    f"extends: {LOADED}\nname: c\n"
    "sweep:\n"
    "  supply_frequency_hz: {start: 46.0, stop: 51.0, step: 0.5, direction: [up, down]}\n"
    "  grid: {contact.restitution: [0.0, 0.3]}\n"
)

#: Dask leaves connections that it gave up to the garbage collector.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")


# -- any executor -----------------------------------------------------------------------------------------


class Answering(Executor):
    """An executor all of whose tasks end in an error."""

    def __init__(self, error):
        self.error = error

    def submit(self, function, *arguments):
        future = Future()
        future.set_exception(self.error)
        return future


def test_worker_with_another_fingerprint_gives_no_result(kernels):
    offer_resume(None)  # as in a program, whatever commands ran before
    chain = Calls((math.sqrt, (4.0,)))
    with ThreadPoolExecutor(1) as threads, pool(executor=threads) as workers:
        workers._expected = {**workers._expected, "numpy": "1.0"}
        with pytest.raises(IncompatibleWorkerError) as caught:
            list(run_chains([chain], workers))
    assert str(caught.value).startswith("worker process ")
    assert str(caught.value).endswith(" (here 1.0); all workers need the versions of this process")
    assert (chain.results, caught.value.exit_code) == ([], 1)


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (
            ModuleNotFoundError("No module named 'vibroplat'"),
            "worker cannot load this vibroplat (No module named 'vibroplat'); all workers need the versions",
        ),
        (BrokenExecutor("a worker died"), "the executor is gone (a worker died)"),
        (OSError("no room"), "no room"),
    ],
)
def test_what_an_executor_cannot_do_is_told_in_a_line(error, line, kernels):
    with (
        pool(executor=Answering(error)) as workers,
        pytest.raises((IncompatibleWorkerError, NoWorkersError, OSError)) as caught,
    ):
        list(run_chains([Calls((math.sqrt, (4.0,)))], workers))
    assert str(caught.value).startswith(line)
    assert len(str(caught.value).splitlines()) == 1


def test_an_executor_that_was_shut_down_is_told_and_tasks_that_wait_are_cancelled(kernels):
    with ThreadPoolExecutor(1) as threads:
        with pool(executor=threads) as workers:
            _, waiting = workers.submit(time.sleep, 0.3), workers.submit(math.sqrt, 4.0)
        assert isinstance(waiting.exception(timeout=5.0), NoWorkersError)
    with pool(executor=threads) as workers, pytest.raises(NoWorkersError, match="the executor is gone"):
        list(run_chains([Calls((math.sqrt, (4.0,)))], workers))


@pytest.mark.long
def test_a_sweep_by_an_executor_has_the_same_bits(tmp_path, kernels):
    (tmp_path / "c.yaml").write_text(SWEEP)
    scene = load_config(tmp_path / "c.yaml")
    with ProcessPoolExecutor(2, get_context("spawn")) as processes:
        found = sweep(scene, executor=processes).sweep
    assert bits(found) == bits(sweep(scene).sweep)


# -- a scheduler of dask: addresses where none is -----------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "listens"), [("tcp", False), pytest.param("tcp", True, marks=pytest.mark.long), ("ws", True)]
)
def test_no_scheduler_at_an_address(kind, listens, monkeypatch):
    """Nobody is there, or somebody who says nothing."""
    monkeypatch.setattr(executors, "ANSWER_S", 0.1)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1] if listens else clusters.free_port()
        address = f"{kind}://127.0.0.1:{port}"
        with pytest.raises(ConfigError) as caught:
            require_scheduler(address)
    assert str(caught.value).startswith(f"--scheduler {address}: no scheduler answers there (")


def test_what_is_no_address_or_that_of_a_worker_is_refused(threads):
    with pytest.raises(ConfigError, match=r"^--scheduler foo://127.0.0.1:1: .*; allowed: tcp://host:port$"):
        require_scheduler("foo://127.0.0.1:1")
    (worker,) = threads.workers.values()
    with pytest.raises(ConfigError, match="a dask worker answers there; allowed: a scheduler"):
        require_scheduler(worker.address)


def test_scheduler_without_dask_is_refused(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ConfigError) as caught:
        require_scheduler("tcp://127.0.0.1:8786")
    assert str(caught.value) == "--scheduler needs dask.distributed; pip install 'vibroplat[cluster]' has it"


# -- in this process: a scheduler and workers that are threads --------------------------------------------


@pytest.fixture(scope="module")
def threads(kernels):
    """A scheduler with a worker."""
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol="tcp", dashboard_address=":0"
    ) as found:
        yield found


def test_dask_is_silent_while_its_workers_are_used(threads):
    logger, chain = logging.getLogger("distributed.client"), Calls((math.sqrt, (4.0,)))
    with pool(scheduler=threads.scheduler_address) as workers:
        assert logger.disabled
        list(run_chains([chain], workers))
    assert (logger.disabled, chain.results) == (False, [2.0])


def test_a_scheduler_without_workers_is_told(kernels, monkeypatch):
    from distributed import LocalCluster

    monkeypatch.setattr(executors, "WORKER_S", 0.1)
    options = {"n_workers": 0, "processes": False, "protocol": "tcp", "dashboard_address": ":0"}
    with (
        LocalCluster(**options) as empty,
        pytest.raises(ConfigError, match=r"it has no worker after 0\.1 s"),
        pool(scheduler=empty.scheduler_address),
    ):
        pass


# -- in processes of their own ----------------------------------------------------------------------------


@pytest.fixture
def place(here, kernels):
    """A directory with a sweep."""
    (here / "c.yaml").write_text(SWEEP)
    return here


def await_points(place, number, child):
    """Wait until a sweep has so many points on disk."""
    for _ in range(1200):
        if finished_points(place / "results/c/sweep") >= number:
            return
        assert child.process.poll() is None, "the sweep has ended"
        time.sleep(0.05)
    raise AssertionError("no points")


@pytest.mark.faults
def test_scheduler_that_dies_is_told_and_costs_no_point(place):
    with clusters.scheduler(place) as (address, scheduler), clusters.worker(place, address):
        clusters.await_workers(address, 1)
        with Child(place, "sweep", "c.yaml", "--scheduler", address) as child:
            await_points(place, 3, child)
            scheduler.send_signal(signal.SIGKILL)
            done = child.end()
    assert (done.code, done.out, len(done.err.splitlines())) == (1, "", 1)
    assert done.err.startswith(f"vibroplat: the scheduler at {address} is gone")
    assert done.err.endswith(f"{RESUMABLE}\n")
    assert finished_points(place / "results/c/sweep", "worker-lost") == 0
    assert finished_points(place / "results/c/sweep") >= 3
    assert command("sweep", "c.yaml", "--resume").code == 0
    resumed = pd.read_parquet(place / "results/c/sweep/sweep.parquet")
    assert bits(resumed) == bits(sweep(load_config(place / "c.yaml")).sweep)
