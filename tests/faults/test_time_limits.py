"""A program's time limit, a handler of a signal that raises: it is told soon, and leaves nothing half-made."""

import ctypes
import os
import signal
import threading
import time

import numpy as np
import pytest
from common.places import QUICKSTART, ROOT

from vibroplat import basins, design, find, load_config, orbits, sweep
from vibroplat.integrate import _FINDING
from vibroplat.integrate.sundae import _SOLVING
from vibroplat.kernels.compiled import PythonFunction, call_int, compiled
from vibroplat.system.interrupts import handlers_put_off
from vibroplat.system.workers import _LOCK

EXAMPLES = ROOT / "configs/examples"
STARTS = "basins.initial_conditions"
#: Functions with their scenes.
STUDIES = {
    "sweep": (sweep, QUICKSTART, {"sweep": {"supply_frequency_hz": {"start": 46.0, "stop": 48.0, "step": 1.0}}}),
    "orbits": (orbits, EXAMPLES / "branches.yaml", {"orbits.stop": 42.5}),
    "find": (find, EXAMPLES / "threshold-torque.yaml", {"find.start": 1.0, "find.stop": 2.5, "find.tolerance": 0.02}),
    "basins": (basins, EXAMPLES / "basins.yaml", {STARTS: {"run.initial.phase_difference_rad": [-3.0, 3.0, 4]}}),
    "design": (design, EXAMPLES / "design-power.yaml", {"design.samples": 20, "design.starts": 1}),
}
#: Moments of the limit, as parts of the time that a call takes.
MOMENTS = (0.02, 0.3, 0.8)

pytestmark = pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no such signals")


class TimeUpError(Exception):
    pass


@pytest.fixture
def limit():
    """Set a time limit (s); 0 for none."""

    def stop(*_):
        raise TimeUpError

    before = signal.signal(signal.SIGALRM, stop)
    yield lambda seconds: signal.setitimer(signal.ITIMER_REAL, seconds)
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    signal.signal(signal.SIGALRM, before)


def texts(result):
    return {name: table.drop(columns="wall_s", errors="ignore").to_csv() for name, table in result.tables.items()}


@pytest.mark.long
@pytest.mark.parametrize(("study", "jobs"), [*((study, 1) for study in STUDIES), ("sweep", 2), ("basins", 2)])
def test_a_time_limit_ends_a_study_soon_and_the_next_is_as_ever(study, jobs, limit, kernels):
    function, file, changes = STUDIES[study]
    scene = load_config(file, {"solver.engine": "taylor", **changes})
    expected = texts(function(scene, jobs=jobs))
    began = time.monotonic()
    function(scene, jobs=jobs)
    whole = time.monotonic() - began
    ended = 0
    for moment in MOMENTS if study != "find" else MOMENTS[1:2]:
        seconds = moment * whole
        limit(seconds)
        began = time.monotonic()
        try:
            function(scene, jobs=jobs)
        except TimeUpError:
            ended += 1
        limit(0.0)  # it may be faster than before
        assert time.monotonic() - began < seconds + 1.0
        assert texts(function(scene, jobs=jobs)) == expected
    assert ended


@compiled
def raise_and_call(calls, result):
    call_int(calls[0], (calls[1],))
    result[0] = call_int(calls[2], (7,))


def test_what_a_handler_raises_on_the_way_from_compiled_code_to_python_is_not_lost(limit):
    called = []
    function = PythonFunction(called.append)
    to_raise = ctypes.cast(ctypes.CDLL(None)["raise"], ctypes.c_void_p).value
    result = np.full(1, -1)
    raise_and_call((to_raise, int(signal.SIGALRM), function.address), result)
    assert (result[0], called) == (0, [])
    with pytest.raises(TimeUpError):
        function.check()
    raise_and_call((to_raise, 0, function.address), result)
    function.check()
    assert (result[0], called) == (1, [7])


def test_handlers_are_put_off_where_llvm_calls_python(limit):
    passed = []

    def load():
        with handlers_put_off():
            signal.raise_signal(signal.SIGALRM)
            passed.append(1)

    with pytest.raises(TimeUpError):
        load()
    with pytest.raises(TimeUpError):
        signal.raise_signal(signal.SIGALRM)
    assert passed == [1]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_a_fork_finds_locks_free_that_another_thread_holds():
    held, done = threading.Event(), threading.Event()

    def hold():
        with _FINDING, _SOLVING, _LOCK:
            held.set()
            done.wait()

    thread = threading.Thread(target=hold)
    thread.start()
    held.wait()
    child = os.fork()
    if child == 0:
        os._exit(0 if all(lock.acquire(timeout=1.0) for lock in (_FINDING, _SOLVING, _LOCK)) else 1)
    done.set()
    thread.join()
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
