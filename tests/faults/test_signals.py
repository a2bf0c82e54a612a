"""Ctrl-C, SIGTERM or SIGKILL at any moment: one line at most, complete result files, and work that can be resumed."""

import os
import shutil
import signal
import time

import numpy as np
import pytest
from common.commands import Child, command, ended, not_a_line, sending, until
from common.places import SWEPT
from common.results import bits, finished_points, left

from vibroplat.results.tables import LEFTOVER_AGE_S

pytestmark = pytest.mark.usefixtures("kernels")

#: Longest time from Ctrl-C to the end (s), on a busy machine too.
SOON = 10.0
#: What imports take (s), about.
START = 1.3
POINTS = 22
RUN = ("run", "c.yaml")
LONG_RUN = (*RUN, "--set", "run.duration_s=1000", "--set", "output.sample_rate_hz=10")
SWEEP = ("sweep", "c.yaml", "--resume", "--jobs")
TABLES = ("trajectory", "events", "sweep")
TOLD = {signal.SIGINT: "vibroplat: interrupted; ", signal.SIGTERM: "vibroplat: terminated; "}
SIGNALS = (*TOLD, signal.SIGKILL)
WRITE = "vibroplat.study.store:Store.write"


@pytest.fixture
def place(here):
    (here / "c.yaml").write_text(SWEPT)
    return here


def problem(done, signal_=signal.SIGINT):
    """Say what is wrong with the end of a command at a signal."""
    if signal_ == signal.SIGKILL:
        return "" if done.code == -signal_ else f"exit code {done.code}"
    return not_a_line(done, codes=(128 + signal_,)) or ("" if done.err.startswith(TOLD[signal_]) else done.err)


def tables(directory):
    found, temporaries = left(directory)
    return {name: bits(table) for name, table in found.items() if name.startswith(TABLES)}, temporaries


#: Says when a program listens to signals; before, Python itself ends it with a traceback.
LISTENING = """
from vibroplat.system.interrupts import end_at_signals
end_at_signals()
open("listening", "w").close()
"""


@pytest.mark.faults
@pytest.mark.parametrize("number", [3, pytest.param(60, marks=pytest.mark.campaign)])
def test_sweep_ended_at_any_moment_leaves_complete_tables_and_goes_on(number, place):
    began = time.monotonic()
    assert command("sweep", "c.yaml", "--out", "alone").code == 0
    wanted, seconds = tables(place / "alone/c/sweep")[0], time.monotonic() - began + START
    for k, share in enumerate(np.random.default_rng(number).random(number)):
        signal_ = SIGNALS[k % 3]
        with Child(place, *SWEEP, "2" if k % 5 == 1 else "1", before=LISTENING) as child:
            until((place / "listening").exists)
            (place / "listening").unlink()
            time.sleep(share * seconds)
            child.process.send_signal(signal_)
            done = child.end(20.0)
        assert "Traceback" not in done.err
        assert done.code in (0, -signal_, 128 + signal_)
        found, _ = tables(place / "results/c/sweep")
        assert found == {table: wanted[table] for table in found}
        if k % 5 == 2:  # the others start from what an ended one has left
            done = command("sweep", "c.yaml", "--resume")
            assert (done.code, done.err) == (0, "")
            assert tables(place / "results/c/sweep")[0] == wanted
            shutil.rmtree(place / "results")


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
    "a callback of C code": "import ctypes\nctypes.CFUNCTYPE(None)(lambda: os.kill(0, signal.SIGINT))()",
    "a destructor": "class Object:\n    def __del__(self):\n        os.kill(0, signal.SIGINT)\nObject()",
}


@pytest.mark.parametrize("module", ["vibroplat.cli", pytest.param("numba.np", marks=pytest.mark.faults)])
def test_ctrl_c_while_the_program_loads(module, place):
    """A user who has mistyped does not wait until everything is loaded."""
    assert problem(ended(place, *RUN, before=LOADING.format(module=module))) == ""


@pytest.mark.parametrize("where", LOST)
def test_ctrl_c_is_not_lost(where, place):
    before = f"{LISTENING}import os, signal\n{LOST[where]}\nprint('lost')"
    assert problem(ended(place, "--version", before=before)) == ""


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
#: A program that gets a signal when it has done something with a file of its results for the n-th time.
AT_FILE = """
import os
import vibroplat.observe.tables
import vibroplat.results.tables
vibroplat.observe.tables.BLOCK = 64
done, files = {function}, []
def signalled(first, path, *arguments, **options):
    done(first, path, *arguments, **options)
    files.extend([path] if "results" in str(path) else [])
    if len(files) == {number}:
        os.kill({whom}, {signal})
{function} = signalled
"""


def at_file(signal_, function, number):
    """Text of such a program; SIGKILL goes to the process alone, others to its group."""
    whom = "os.getpid()" if signal_ == signal.SIGKILL else "0"
    return AT_FILE.format(function=function, number=number, whom=whom, signal=int(signal_))


@pytest.mark.faults
def test_ctrl_c_in_a_long_run(place):
    with Child(place, *LONG_RUN, "--set", "solver.engine=sundae", before=ANNOUNCED) as child:
        until((place / "running").exists)
        os.killpg(child.process.pid, signal.SIGINT)
        assert problem(child.end(SOON)) == ""
    assert left(place / "results/c/run") == ({}, [])


@pytest.mark.faults
@pytest.mark.parametrize("signal_", [signal.SIGINT, signal.SIGKILL])
def test_run_ended_while_its_table_grows_leaves_the_old_result(signal_, place):
    """A process that is killed leaves its part of a table behind; the next run removes it once it is a day old."""
    assert command(*RUN).code == 0
    wanted = tables(place / "results/c/run")[0]
    before = at_file(signal_, "vibroplat.results.tables._append_lines", 3)
    done = ended(place, *RUN, "--set", "run.duration_s=0.5", "--format", "csv", before=before)
    assert problem(done, signal_) == ""
    found, temporaries = tables(place / "results/c/run")
    assert found == wanted
    assert [name.partition("-")[0] for name in temporaries] == [".trajectory"] * (signal_ == signal.SIGKILL)
    for name in temporaries:
        os.utime(place / "results/c/run" / name, (time.time() - 1.1 * LEFTOVER_AGE_S,) * 2)
    assert command(*RUN).code == 0
    assert tables(place / "results/c/run") == (wanted, [])


@pytest.mark.faults
def test_ctrl_c_while_a_result_is_renamed_leaves_all_of_it(place):
    assert command(*RUN, "--set", "run.duration_s=0.2").code == 0
    assert problem(ended(place, *RUN, before=at_file(signal.SIGINT, "os.replace", 2))) == ""
    found, temporaries = left(place / "results/c/run")
    assert (len(found), temporaries) == (4, [])
    assert found["summary.json"]["simulated_s"] == found["trajectory.parquet"]["t_s"].iloc[-1] == 0.3


@pytest.mark.faults
@pytest.mark.parametrize("number", [1, 3])
def test_run_killed_among_its_tables_leaves_no_set_of_two_runs(number, place):
    """After a run of another length: what is left belongs to one of the two, or is known to be incomplete."""
    assert command(*RUN, "--set", "run.duration_s=0.2").code == 0
    assert problem(ended(place, *RUN, before=at_file(signal.SIGKILL, "os.replace", number)), signal.SIGKILL) == ""
    found, _ = left(place / "results/c/run")
    assert len(found) == number
    assert found["trajectory.parquet"]["t_s"].iloc[-1] == 0.3
    if "summary.json" in found:
        assert found["summary.json"]["simulated_s"] == 0.3
        assert found["provenance.json"]["configuration"]["run"]["duration_s"] == 0.3
    else:
        assert not_a_line(command("plot", "results/c/run")) == ""


@pytest.mark.faults
@pytest.mark.parametrize("signal_", TOLD)
@pytest.mark.parametrize("seconds", [0.2, 0.8])
def test_workers_that_load_end_with_the_command(signal_, seconds, place):
    """The signal goes to the command alone; its workers would keep its output open for a minute."""
    with Child(place, *SWEEP, "2", before=LISTENING) as child:
        until((place / "listening").exists, SOON)
        time.sleep(seconds)
        os.kill(child.process.pid, signal_)
        began = time.monotonic()
        assert problem(child.end(), signal_) == ""
        assert time.monotonic() - began < SOON
        until(lambda: child.members() == [], SOON)


@pytest.mark.faults
def test_program_started_with_ctrl_c_ignored_goes_on(place):
    """As by ``sh -c 'vibroplat … &'``: Ctrl-C is for the foreground then."""
    ignoring = "import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"
    done = ended(place, *SWEEP, "2", before=ignoring + sending(signal.SIGINT, WRITE, 10))
    assert (done.code, done.err) == (0, "")
    assert finished_points(place / "results/c/sweep") == POINTS
