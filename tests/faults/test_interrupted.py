"""Ctrl-C at any moment: the program ends at once, with one line, and leaves nothing half-done."""

from __future__ import annotations

import os
import signal
import time

import numpy as np
import pytest
from common.commands import Child, command, ended, not_a_line, sending
from common.places import LOADED
from common.results import bits, finished_points, left

pytestmark = pytest.mark.usefixtures("kernels")

#: Longest time from Ctrl-C to the end (s), on a busy machine too.
SOON = 10.0
CONFIGURATION = (
    f"extends: {LOADED}\nname: c\nrun: {{duration_s: 1000.0}}\noutput: {{sample_rate_hz: 10.0}}\n"
    "sweep:\n"
    "  supply_frequency_hz: {start: 46.0, stop: 51.0, step: 0.5, direction: [up, down]}\n"
    "  measure_s: 0.5\n"
)
POINTS = 22
RUN = ("run", "c.yaml")
SWEEP = ("sweep", "c.yaml", "--resume", "--jobs")

#: A program that gets Ctrl-C when it begins to load a module.
LOADING = """
import os, signal, sys
class Finder:
    def find_spec(self, name, *_):
        if name == {module!r}:
            sys.meta_path.remove(self)
            os.kill(0, signal.SIGINT)
sys.meta_path.insert(0, Finder())
"""
#: A program that gets Ctrl-C where an exception would be lost.
LOST = {
    "a callback of C code": """
import ctypes, os, signal
from vibroplat.system.interrupts import end_at_signals
end_at_signals()
ctypes.CFUNCTYPE(None)(lambda: os.kill(0, signal.SIGINT))()
print("lost")
""",
    "a destructor": """
import os, signal
from vibroplat.system.interrupts import end_at_signals
end_at_signals()
class Object:
    def __del__(self):
        os.kill(0, signal.SIGINT)
Object()
print("lost")
""",
}


@pytest.fixture
def place(here):
    (here / "c.yaml").write_text(CONFIGURATION)
    return here


def problem(done):
    """Say what is wrong with the end of a command at Ctrl-C."""
    return not_a_line(done, codes=(130,)) or ("" if done.err.startswith("vibroplat: interrupted; ") else done.err)


def resumes(place):
    """Whether a sweep continues to the table of one that was never interrupted."""
    assert command("sweep", "c.yaml", "--out", "alone").code == 0
    assert command("sweep", "c.yaml", "--resume").code == 0
    found, alone = (bits(left(place / out / "c")[0]["sweep.parquet"]) for out in ("results", "alone"))
    return found == alone


@pytest.mark.parametrize(
    "module",
    [
        "vibroplat.cli",
        *(pytest.param(m, marks=pytest.mark.faults) for m in ("numpy", "numba.np")),
    ],
)
def test_ctrl_c_while_the_program_loads(module, place):
    """A user who has mistyped does not wait until everything is loaded."""
    assert problem(ended(place, *RUN, before=LOADING.format(module=module))) == ""


@pytest.mark.parametrize("where", LOST)
def test_ctrl_c_is_not_lost(where, place):
    assert problem(ended(place, "--version", before=LOST[where])) == ""


@pytest.mark.faults
def test_ctrl_c_while_kernels_load(place):
    before = sending(signal.SIGINT, "numba.core.caching:IndexDataCacheFile.load", 3)
    assert problem(ended(place, *RUN, before=before)) == ""


@pytest.mark.faults
@pytest.mark.parametrize("engine", ["native", "sundae"])
def test_ctrl_c_in_a_long_run(engine, place):
    with Child(place, *RUN, "--set", f"solver.engine={engine}", before=ANNOUNCED) as child:
        while not (place / "running").exists():
            assert child.process.poll() is None
            time.sleep(0.01)
        os.killpg(child.process.pid, signal.SIGINT)
        assert problem(child.end(SOON)) == ""
    assert left(place / "results/c") == ({}, [])


#: A program that makes a file when the motion of its scene begins.
ANNOUNCED = """
from pathlib import Path
from vibroplat.motion import run
simulate = run.simulate
def announced(*arguments, **options):
    Path("running").touch()
    return simulate(*arguments, **options)
run.simulate = announced
"""
#: A program that gets Ctrl-C when a run writes the third part of its table.
GROWING = """
import os, signal
import pandas as pd
import vibroplat.observe.tables
vibroplat.observe.tables.BLOCK = 64
to_csv, parts = pd.DataFrame.to_csv, []
def interrupted(table, path, **options):
    to_csv(table, path, **options)
    parts.append(path)
    assert path.stat().st_size > 1000
    if len(parts) == 3:
        os.kill(0, signal.SIGINT)
pd.DataFrame.to_csv = interrupted
"""


@pytest.mark.faults
def test_ctrl_c_while_a_table_grows_leaves_no_part_of_it(place):
    assert problem(ended(place, *RUN, "--set", "output.sample_rate_hz=1000", "--format", "csv", before=GROWING)) == ""
    assert left(place / "results/c") == ({}, [])


#: A program that gets Ctrl-C when it renames the second file of a result.
RENAMING = """
import os, signal
replace, renamed = os.replace, []
def interrupted(source, target, **options):
    replace(source, target, **options)
    if "results" in str(target):
        renamed.append(target)
    if len(renamed) == 2:
        os.kill(0, signal.SIGINT)
os.replace = interrupted
"""


@pytest.mark.faults
def test_ctrl_c_while_a_result_is_renamed_leaves_all_of_it(place):
    assert command(*RUN, "--set", "run.duration_s=0.2").code == 0
    done = ended(place, *RUN, "--set", "run.duration_s=0.1", before=RENAMING)
    assert problem(done) == ""
    found, temporaries = left(place / "results/c")
    assert (len(found), temporaries) == (4, [])
    assert found["summary.json"]["simulated_s"] == found["trajectory.parquet"]["t_s"].iloc[-1] == 0.1


@pytest.mark.faults
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_ctrl_c_at_a_point_of_a_sweep(jobs, place):
    with Child(place, *SWEEP, jobs, before=sending(signal.SIGINT, "vibroplat.study.store:Store.write", 10)) as child:
        assert problem(child.end()) == ""
        assert all_gone(child)
    assert 9 <= finished_points(place / "results/c") < POINTS
    assert resumes(place)


@pytest.mark.faults
@pytest.mark.parametrize(
    "function",
    ["loky:get_reusable_executor", "vibroplat.study.sweep:run_sweeps"],
)
def test_ctrl_c_while_workers_start(function, place):
    with Child(place, *SWEEP, "2", before=sending(signal.SIGINT, function)) as child:
        assert problem(child.end()) == ""
        assert all_gone(child)


@pytest.mark.faults
def test_ctrl_c_again_while_workers_stop_is_still_one_line(place):
    first = sending(signal.SIGINT, "vibroplat.study.store:Store.write", 10)
    again = sending(signal.SIGINT, "vibroplat.study.pool:Processes.close")
    renamed = {name: f"again_{name}" for name in ("holder", "calls", "original", "sending")}
    for name, other in renamed.items():
        again = again.replace(name, other)
    with Child(place, *SWEEP, "2", before=first + again) as child:
        assert problem(child.end()) == ""
        assert all_gone(child)


#: A program with workers that gets Ctrl-C while they are idle.
IDLE = """
import os, signal
from vibroplat.system.interrupts import end_at_signals
from vibroplat.study.pool import pool
from vibroplat.study.store import Store
from vibroplat.study.pool import StoredChain, Task, run_stored
end_at_signals()
def tasks():
    yield Task(dict)
with Store(None, {}) as store, pool(2) as workers:
    run_stored([StoredChain(tasks(), store, k) for k in range(3)], workers)
    os.kill(0, signal.SIGINT)
print("lost")
"""


@pytest.mark.faults
def test_ctrl_c_between_tasks_stops_the_workers(place):
    with Child(place, "--version", before=IDLE) as child:
        assert problem(child.end()) == ""
        assert all_gone(child)


def all_gone(child):
    """Whether no process of a command is left, soon after its end."""
    until = time.monotonic() + SOON
    while child.members() and time.monotonic() < until:
        time.sleep(0.02)
    return child.members() == []


@pytest.mark.faults
def test_program_started_with_ctrl_c_ignored_goes_on(place):
    """As by ``sh -c 'vibroplat … &'``: Ctrl-C is for the foreground then."""
    ignoring = "import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"
    before = ignoring + sending(signal.SIGINT, "vibroplat.study.store:Store.write", 10)
    done = ended(place, *SWEEP, "2", before=before)
    assert (done.code, done.err) == (0, "")
    assert finished_points(place / "results/c") == POINTS


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["run", "jobs 1", "jobs 2"])
def test_ctrl_c_at_random_moments(name, place, capsys):
    arguments = RUN if name == "run" else (*SWEEP, name[-1])
    random = np.random.default_rng(40)
    wrong, times = {}, []
    for _ in range(40):
        after = float(random.uniform(0.3, 3.0))
        with Child(place, *arguments) as child:
            time.sleep(after)
            if child.process.poll() is not None:
                continue
            pressed = time.monotonic()
            os.killpg(child.process.pid, signal.SIGINT)
            done = child.end(20.0)
        times.append(time.monotonic() - pressed)
        just_done = done.code == 0 or (done.code == -signal.SIGINT and "\ntables  " in done.out)
        if problem(done) and not just_done:
            wrong[round(after, 3)] = problem(done)
    with capsys.disabled():
        print(f"\n{name}: Ctrl-C {len(times)} times, slowest {max(times):.2f} s, {len(wrong)} wrong at {sorted(wrong)}")
    assert name == "run" or resumes(place)
    assert wrong == {}
    assert max(times) < SOON
