"""Chains of tasks: stored once, the same results however they are spread over workers, and when workers die."""

import math
import os
import signal
import threading
import time
from concurrent.futures import BrokenExecutor, Future

import pytest
from common.commands import workers_of
from common.results import bits

from vibroplat import sweep
from vibroplat.config.plans import FREQUENCY
from vibroplat.study import pool as pools
from vibroplat.study.branches import branches
from vibroplat.study.point import SweepPoint
from vibroplat.study.pool import (
    MAX_LOSSES,
    Inline,
    Processes,
    StoredChain,
    Task,
    WorkerLostError,
    pool,
    run_chains,
    run_stored,
)
from vibroplat.study.store import Store
from vibroplat.study.sweep import point_along, run_branches, sweep_table
from vibroplat.system.workers import PINNED, loading_workers

from .helpers import MACHINE, Calls, planned

KILLER = (os._exit, (1,))
NAP = (time.sleep, (0.02,))


def finish(chains, workers):
    """Run all chains; return their results, those of lost tasks by their type's name."""
    yielded = list(run_chains(chains, workers))
    assert sorted(map(id, yielded)) == sorted(id(c) for c in chains for _ in c.results)
    return [["lost" if isinstance(r, WorkerLostError) else r for r in chain.results] for chain in chains]


@pytest.fixture(autouse=True)
def _guard():
    """End a test whose chains never end."""

    def stop(_signal, _frame):
        pytest.fail("did not end")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(300)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.fixture(scope="module")
def processes():
    """Two worker processes."""
    with pool(jobs=2) as workers:
        yield workers


# -- stored chains ---------------------------------------------------------------------------------------


class Interrupted(BaseException):
    pass


class Squares:
    """Squares numbers, and counts; may be interrupted after some."""

    def __init__(self, most=100):
        self.calls = []
        self.most = most

    def square(self, number):
        if len(self.calls) == self.most:
            raise Interrupted
        self.calls.append(number)
        return {"square": number**2}

    def powers(self, number, limit):
        """Square a number until a limit is passed: how often follows from the results."""
        count = 0
        while number <= limit:
            record = yield Task(self.square, (number,))
            number, count = record["square"], count + 1
        return number, count


def run(squares, store, *numbers):
    return run_stored([StoredChain(squares.powers(n, 100), store, f"from {n}") for n in numbers], Inline())


def test_tasks_follow_from_results_and_chains_take_turns():
    squares = Squares()
    with Store(None, {}) as store:
        assert run(squares, store, 2, 3, 200) == [(256, 3), (6561, 3), (200, 0)]
        assert [record for _, record in store.read("from 2")] == [{"square": n} for n in (4, 16, 256)]
        assert len(store) == 6
    assert squares.calls == [2, 3, 4, 9, 16, 81]


def test_task_whose_worker_is_lost_has_no_record_but_that_for_this_case():
    def one():
        return (yield Task(dict, on_worker_loss=lambda reason: {"why": reason}))

    lost = WorkerLostError("its worker died 2 times")
    with Store(None, {}) as store:
        with pytest.raises(WorkerLostError, match="died"):
            StoredChain(Squares().powers(2, 100), store, 0).accept(lost)
        assert len(store) == 0
        chain = StoredChain(one(), store, 0)
        chain.accept(lost)
        assert (chain.result, len(store)) == ({"why": str(lost)}, 1)


# -- chains ---------------------------------------------------------------------------------------------


def test_workers_work_side_by_side(processes):
    chains = [Calls(*[(time.sleep, (0.03,)), (os.getpid, ())] * 4) for _ in range(4)]
    found = finish(chains, processes)
    pids = {result for results in found for result in results[1::2]}
    assert len(pids) == 2
    assert os.getpid() not in pids


def test_workers_have_one_thread_and_do_not_hear_ctrl_c(processes):
    """A terminal sends it to them too; their parent stops them."""
    assert {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"} <= set(PINNED)
    (found,) = finish([Calls(*[(os.getenv, (name,)) for name in PINNED])], processes)
    assert found == ["1"] * len(PINNED)
    assert finish([Calls((signal.pthread_sigmask, (signal.SIG_BLOCK, ())))], processes) == [[{signal.SIGINT}]]


# -- workers that die -----------------------------------------------------------------------------------


class Fragile:
    """Workers that all break together, a little after a killer was given to them; those of dask are there again."""

    slots = 3

    def __init__(self, error):
        self._error = error
        self.deaths = []  # how many tasks each has cost
        self._open = []
        self._broken = False
        self._lock = threading.Lock()

    def submit(self, function, *arguments):
        future = Future()
        if self._broken:
            future.set_exception(BrokenExecutor())
        else:
            self._open.append(future)
            threading.Timer(0.01, self._finish, (future, function, arguments)).start()
        return future

    def _finish(self, future, function, arguments):
        with self._lock:
            if future.done():
                return
            if (function, arguments) != KILLER:
                future.set_result(function(*arguments))
                return
            hit = [other for other in self._open if not other.done()]
            self.deaths.append(len(hit))
            self._broken = self._error is BrokenExecutor
            for other in hit:
                other.set_exception(self._error("died"))

    def renew(self):
        self._open, self._broken = [], False


@pytest.mark.parametrize("error", [BrokenExecutor, WorkerLostError])
@pytest.mark.parametrize("killers", [(0, 4), (1, 2, 3)], ids=str)
def test_suspects_run_alone(killers, error):
    """Each death costs what the other workers are at: once at first, then a killer's own work alone."""
    workers = Fragile(error)
    chains = [Calls((abs, (-1,)), KILLER if k in killers else (abs, (-2,)), (abs, (-3,))) for k in range(5)]
    assert finish(chains, workers) == [[1, "lost" if k in killers else 2, 3] for k in range(5)]
    in_company = [cost for cost in workers.deaths if cost > 1]
    assert len(in_company) <= len(killers)
    assert len(workers.deaths) <= len(killers) * (1 + MAX_LOSSES)


@pytest.mark.faults
def test_dask_task_that_kills_its_worker_costs_its_own_point_alone():
    """Each worker holds two tasks; dask counts the death of one against both, and gives both up at the first.

    There are workers enough that none need be started again: a nanny gives a worker up that dies while it starts.
    """
    import dask
    from distributed import LocalCluster

    killer = exec, ("import os, time; time.sleep(0.5); os._exit(1)",)
    chains = [Calls((time.sleep, (1.0,)) if k != 1 else killer, NAP, (abs, (-k,))) for k in range(6)]
    options = {"n_workers": 3, "threads_per_worker": 1, "silence_logs": 50, "dashboard_address": ":0"}
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        LocalCluster(**options) as three,
        pool(scheduler=three.scheduler_address) as workers,
    ):
        assert finish(chains, workers) == [["lost" if k == 1 else None, None, k] for k in range(6)]


# -- sweeps ---------------------------------------------------------------------------------------------


#: What does not repeat is not followed for long.
SHORT = {"max_settle_s": 5.0, "measure_s": 0.5, "lyapunov": False}


@pytest.fixture(scope="module")
def scene():
    """Attached, periodic and non-periodic points in eight branches."""
    changes = {"material.damping_ratio": 0.005}
    grid = {"material.mass_ratio": [0.0, 0.2], "contact.restitution": [0.0, 0.3]}
    return planned(MACHINE, 46.0, 62.0, step=8.0, direction=["up", "down"], changes=changes, grid=grid, **SHORT)


@pytest.mark.faults
def test_killed_workers_change_nothing(scene, processes):
    table, killed = sweep(scene).sweep, []
    assert len(table) == 24
    assert {0, 1} <= set(table["period"])

    def progress(points, _):
        if points >= 10 and not killed:
            killed.extend(worker.pid for worker in workers_of())
            for pid in killed:
                os.kill(pid, signal.SIGKILL)

    with Store(None, {}) as store:
        run_branches(branches(scene), store, processes, progress)
        assert killed
        found = sweep_table(branches(scene), store)
    assert bits(found) == bits(table)


def place(scene, key):
    """Where a point of the scene's sweep is: mass, restitution, direction, frequency."""
    return scene.material.mass_ratio, scene.contact.restitution, key[0], scene.drive.supply_frequency_hz


#: Point 1 of branch 2, and the one after it.
LOST, NEXT = (0.0, 0.3, 0, 54.0), (0.0, 0.3, 0, 62.0)


class Mortal(Inline):
    """This process, which pretends to have died of this point."""

    def submit(self, function, first, value, *more):
        if function is not point_along or place(first.replace({FREQUENCY: value}), more[1]) != LOST:
            return super().submit(function, first, value, *more)
        future = Future()
        future.set_exception(BrokenExecutor())
        return future


def test_point_that_kills_its_workers_is_a_row_and_the_branch_goes_on(scene, monkeypatch):
    begun = {}

    def measure(scene, plan, state, key):
        begun[place(scene, key)] = None if state is None else state[0]
        return SweepPoint({"outcome": "ok"}, [scene.drive.supply_frequency_hz if state is None else state[0]] * 14)

    monkeypatch.setattr("vibroplat.study.sweep.measure_point", measure)
    with Store(None, {}) as store:
        run_branches(branches(scene), store, Mortal())
        found = sweep_table(branches(scene), store)
    lost = found[found["outcome"] != "ok"]
    assert lost[["branch", "supply_frequency_hz", "outcome"]].to_numpy().tolist() == [[2, 54.0, "worker-lost"]]
    assert lost["detail"].item() == f"its worker died {MAX_LOSSES} times"
    assert not lost[["steps", "residual_calls", "events", "simulated_s"]].isna().any(axis=None)
    assert len(found) == 24
    assert LOST not in begun
    assert begun[NEXT] == 46.0


# -- pools of their own ---------------------------------------------------------------------------------


def test_workers_are_gone_when_the_pool_is_closed_and_another_may_be_opened():
    others = workers_of()
    for _ in range(2):
        with pool(jobs=2) as workers:
            assert isinstance(workers, Processes)
            assert finish([Calls((abs, (-3,))), Calls(NAP)], workers) == [[3], [None]]
            assert len(workers_of()) == len(others) + 2
        assert workers_of() == others


# -- no more processes than are of use --------------------------------------------------------------------


def test_workers_that_load_early_are_those_of_the_pool_and_are_gone_in_the_end():
    others = workers_of()
    with loading_workers(2, math.sqrt, 4.0):
        early = {worker.pid for worker in workers_of() if worker not in others}
        with pool(jobs=2) as workers:
            ((found, *_),) = finish([Calls((os.getpid,), NAP)], workers)
        assert len(early) == 2
        assert found in early
    assert workers_of() == others
    with loading_workers(1, math.sqrt, 4.0):
        assert workers_of() == others


def test_processes_have_a_core_and_a_chain(monkeypatch):
    monkeypatch.setattr(pools, "Processes", Counted)
    wanted = {(8, 4, 100): 4, (8, 16, 3): 3, (8, 16, None): 8, (None, 4, 2): 2}
    for (jobs, available, chains), used in wanted.items():
        monkeypatch.setattr(pools, "core_count", lambda available=available: available)
        with pool(jobs, chains=chains) as workers:
            assert workers.slots == used
    for jobs, chains in ((1, 9), (3, 1), (3, 0)):
        with pool(jobs, chains=chains) as workers:
            assert isinstance(workers, Inline)


class Counted(Inline):
    def __init__(self, jobs):
        self.slots = jobs
