"""Schedulers and workers of dask that are none, are others, or go: one line, and what is finished is kept."""

import logging
import math
import signal
import socket
import time

import pandas as pd
import pytest
from common import clusters
from common.commands import Child, command
from common.places import LOADED
from common.results import bits, finished_points

from vibroplat.errors import ConfigError
from vibroplat.study import cluster
from vibroplat.study.cluster import IncompatibleWorkerError, NoWorkersError, require_scheduler
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


# -- addresses where no scheduler is ----------------------------------------------------------------------


#: Dask leaves connections that it gave up to the garbage collector.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")


@pytest.mark.parametrize(
    ("kind", "listens"), [("tcp", False), pytest.param("tcp", True, marks=pytest.mark.long), ("ws", True)]
)
def test_no_scheduler_at_an_address(kind, listens, monkeypatch):
    """Nobody is there, or somebody who says nothing."""
    monkeypatch.setattr(cluster, "FIRST_ANSWER_S", 0.1)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1] if listens else clusters.free_port()
        address = f"{kind}://127.0.0.1:{port}"
        with pytest.raises(ConfigError) as caught:
            require_scheduler(address)
    assert str(caught.value).startswith(f"--scheduler {address}: no scheduler answers there (")


def test_what_is_no_address_or_that_of_a_worker_is_refused(threads):
    with pytest.raises(ConfigError, match=r"^--scheduler foo://127.0.0.1:1: not an address; allowed: tcp://host:port$"):
        require_scheduler("foo://127.0.0.1:1")
    (worker,) = threads.workers.values()
    with pytest.raises(ConfigError, match="a dask worker answers there, not a scheduler"):
        require_scheduler(worker.address)


# -- in this process: a scheduler and workers that are threads --------------------------------------------


@pytest.fixture(scope="module")
def threads(kernels):
    """A scheduler with a worker."""
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol="tcp", dashboard_address=":0"
    ) as found:
        yield found


@pytest.fixture
def workers(threads):
    with pool(scheduler=threads.scheduler_address) as found:
        yield found


def test_worker_with_another_fingerprint_gives_no_result(workers, threads):
    offer_resume(None)  # as in a program, whatever commands ran before
    workers._expected = {**workers._expected, "numpy": "1.0"}
    chain = Calls((math.sqrt, (4.0,)))
    with pytest.raises(IncompatibleWorkerError) as caught:
        list(run_chains([chain], workers))
    (worker,) = threads.workers.values()
    assert str(caught.value).startswith(f"worker {worker.address}: numpy ")
    assert str(caught.value).endswith(" (here 1.0); all workers need the versions of this process")
    assert (chain.results, caught.value.exit_code) == ([], 1)


def test_workers_that_join_are_given_tasks(workers, threads, monkeypatch):
    monkeypatch.setattr(cluster, "RECOUNT_S", 0.0)
    monkeypatch.setattr(workers, "_workers", lambda: {"one": 4, "another": 2})
    list(run_chains([Calls((math.sqrt, (4.0,)))], workers))
    assert workers.slots == 12
    workers.check()


def test_scheduler_that_cannot_count_its_workers_in_time_is_given_tasks(workers, monkeypatch):
    def late():
        raise TimeoutError

    monkeypatch.setattr(cluster, "RECOUNT_S", 0.0)
    monkeypatch.setattr(workers, "_workers", late)
    chain = Calls((math.sqrt, (4.0,)))
    list(run_chains([chain], workers))
    assert chain.results == [2.0]


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (ModuleNotFoundError("No module named 'vibroplat'", name="vibroplat"), "it has no vibroplat"),
        (AttributeError("no checked"), "it has another vibroplat (no checked)"),
        (ModuleNotFoundError("No module named 'numba'", name="numba"), "its vibroplat cannot be loaded (No module"),
        (RuntimeError("no cache"), "its vibroplat cannot be loaded (no cache)"),
    ],
)
def test_worker_that_cannot_load_the_package_is_named(error, text, workers, threads, monkeypatch):
    def fail(*_):
        raise error

    monkeypatch.setattr("vibroplat.study.fingerprint.run_checked", fail)
    monkeypatch.setattr("vibroplat.study.fingerprint.code", fail)
    monkeypatch.setattr(fail, "__module__", "vibroplat.study.fingerprint", raising=False)
    monkeypatch.setattr(fail, "__qualname__", "run_checked")
    with pytest.raises(IncompatibleWorkerError) as caught:
        list(run_chains([Calls((math.sqrt, (4.0,)))], workers))
    (worker,) = threads.workers.values()
    assert str(caught.value).startswith(f"worker {worker.address}: {text}")
    monkeypatch.setattr(workers._client, "_run", None)  # as if it had left before it could be asked
    lacks = isinstance(error, (ImportError, AttributeError))
    with pytest.raises(IncompatibleWorkerError if lacks else RuntimeError) as caught:
        list(run_chains([Calls((math.sqrt, (4.0,)))], workers))
    assert str(caught.value).startswith(f"worker that has left: {text}" if lacks else str(error))


def test_no_worker_is_told_and_given_up(kernels, monkeypatch, caplog):
    from distributed import LocalCluster

    monkeypatch.setattr(cluster, "NOTICE_S", 0.1)
    monkeypatch.setattr(cluster, "MAX_WAIT_S", 0.4)
    monkeypatch.setattr("vibroplat.study.pool.CHECK_AFTER_S", 0.1)
    with (
        LocalCluster(n_workers=0, processes=False, protocol="tcp", dashboard_address=":0") as empty,
        pool(scheduler=empty.scheduler_address) as workers,
        caplog.at_level(logging.WARNING, "vibroplat"),
        pytest.raises(NoWorkersError) as caught,
    ):
        list(run_chains([Calls((math.sqrt, (4.0,)))], workers))
    what = f"a worker of the scheduler at {empty.scheduler_address}"
    assert str(caught.value).startswith(f"waited 0.4 s for {what}")
    told = [record.getMessage() for record in caplog.records if record.name == "vibroplat"]
    assert told == [f"waiting for {what}, up to 0.4 s"]


def test_dask_may_speak_again_when_the_pool_is_closed(threads):
    logger = logging.getLogger("distributed.client")
    with pool(scheduler=threads.scheduler_address):
        assert logger.disabled
    assert not logger.disabled


# -- in processes of their own ----------------------------------------------------------------------------


@pytest.fixture
def place(here, kernels):
    """A directory with a sweep."""
    (here / "c.yaml").write_text(SWEEP)
    return here


@pytest.fixture(scope="module")
def table(tmp_path_factory, kernels):
    """The sweep's table, made without a cluster."""
    place = tmp_path_factory.mktemp("alone")
    (place / "c.yaml").write_text(SWEEP)
    assert command("sweep", place / "c.yaml", "--out", place / "results").code == 0
    return made(place)


def made(place):
    return bits(pd.read_parquet(place / "results/c/sweep/sweep.parquet"))


def await_points(place, number, child):
    """Wait until a sweep has so many points on disk."""
    for _ in range(1200):
        if finished_points(place / "results/c/sweep") >= number:
            return
        assert child.process.poll() is None, "the sweep has ended"
        time.sleep(0.05)
    raise AssertionError("no points")


def waiting(seconds):
    """Text of a program that waits so long for workers."""
    return f"from vibroplat.study import cluster\ncluster.MAX_WAIT_S = {seconds}\n"


def given_up(done, what, seconds):
    """Whether a command has told what it waited for, and then ended; on a busy machine it ends without the notice."""
    *notice, end = done.err.splitlines()
    assert notice in ([], [f"vibroplat: waiting for {what}, up to {seconds} s"])
    assert end == f"vibroplat: waited {seconds} s for {what}; {RESUMABLE}"
    assert (done.code, done.out) == (1, "")


@pytest.mark.faults
@pytest.mark.parametrize(("signal_", "wait"), [(signal.SIGSTOP, 2), (signal.SIGKILL, 60)])
def test_scheduler_that_freezes_or_dies_is_told_and_costs_no_point(signal_, wait, place):
    with clusters.scheduler(place) as (address, scheduler), clusters.worker(place, address):
        clusters.await_workers(address, 1)
        with Child(place, "sweep", "c.yaml", "--scheduler", address, before=waiting(wait)) as child:
            await_points(place, 3, child)
            scheduler.send_signal(signal_)
            done = child.end()
    if signal_ == signal.SIGSTOP:
        given_up(done, f"an answer of the scheduler at {address}", wait)
    else:
        told = f"vibroplat: the scheduler at {address} is gone; {RESUMABLE}\n"
        assert done == (1, "", told)
    assert finished_points(place / "results/c/sweep", "worker-lost") == 0
