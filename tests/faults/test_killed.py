"""Killed at any moment: result files are complete, and unfinished work can be resumed."""

from __future__ import annotations

import shutil
import signal
import time

import numpy as np
import pytest
from common.commands import Child, command, ended, not_a_line, sending
from common.places import LOADED
from common.results import bits, left

pytestmark = [pytest.mark.usefixtures("kernels"), pytest.mark.faults]

RUN = f"extends: {LOADED}\nname: c\nrun: {{duration_s: 0.3}}\n"
SWEEP = (
    f"extends: {LOADED}\nname: c\n"
    "sweep:\n"
    "  supply_frequency_hz: {start: 46.0, stop: 51.0, step: 0.5, direction: [up, down]}\n"
    "  measure_s: 0.5\n"
)
#: What imports take (s), about.
START = 1.3
TABLES = ("trajectory", "events", "sweep")
SIGNALS = (signal.SIGTERM, signal.SIGKILL)
#: A program that writes half a table and gets a signal.
HALF = """
import os
import pandas as pd
def half(_table, path, **_options):
    path.write_text("half a tab")
    os.kill(0, {signal})
pd.DataFrame.to_csv = half
"""


def kills():
    """Numbers of kills."""
    return [pytest.param(4, id="4"), pytest.param(50, id="50", marks=pytest.mark.campaign)]


def tables(directory):
    """The bits of the tables in a directory, and the names of temporaries."""
    found, temporaries = left(directory)
    return {name: bits(table) for name, table in found.items() if name.startswith(TABLES)}, temporaries


@pytest.fixture
def uninterrupted(here):
    """Run a command to its end; return its tables and the time (s) that it takes with its start."""

    def alone(*arguments):
        began = time.monotonic()
        assert command(*arguments, "--out", "alone").code == 0
        return tables(here / "alone/c")[0], time.monotonic() - began + START

    return alone


def ends(number):
    """Yield as many kills: shares of the time that a command takes, half of them near its end."""
    random = np.random.default_rng(number)
    for k in range(number):
        yield k, SIGNALS[k % 2], random.uniform(0.0 if k % 4 < 2 else 0.6, 1.0)


def killed(here, signal_, after, *arguments):
    """Kill a command that long after its start; return its exit code, None where it was faster."""
    with Child(here, *arguments) as child:
        time.sleep(after)
        if child.process.poll() is not None:
            return None
        child.process.send_signal(signal_)
        done = child.end(20.0)
    assert "Traceback" not in done.err
    assert done.code in (0, -signal_, 128 + signal_), done
    if done.code == 128 + signal_:
        assert not_a_line(done._replace(out=""), codes=(done.code,)) == ""
        assert done.err.startswith("vibroplat: terminated")
    return done.code


def completes(here, wanted, *arguments):
    """Run a command to its end, and compare with the tables of one that was not killed."""
    again = command(*arguments)
    assert (again.code, again.err) == (0, "")
    assert tables(here / "results/c")[0] == wanted


def report(capsys, what, codes, piled):
    ended_ = {code: codes.count(code) for code in sorted(set(codes), key=str)}
    with capsys.disabled():
        print(f"\n{what}: {len(codes)} kills, exit codes {ended_}, temporaries left {len(piled)}")


@pytest.mark.parametrize("number", kills())
def test_killed_run_leaves_complete_tables_and_works_again(number, here, uninterrupted, capsys):
    (here / "c.yaml").write_text(RUN)
    wanted, seconds = uninterrupted("run", "c.yaml")
    codes, piled = [], []
    for _, signal_, share in ends(number):
        codes.append(killed(here, signal_, share * seconds, "run", "c.yaml"))
        found, piled = tables(here / "results/c")
        assert found == {name: wanted[name] for name in found}
        if len(codes) % 5 == 0:  # the others start from what a killed one has left
            completes(here, wanted, "run", "c.yaml")
    report(capsys, "run", codes, piled)
    completes(here, wanted, "run", "c.yaml")


@pytest.mark.parametrize("number", kills())
def test_killed_sweep_leaves_complete_tables_and_can_be_resumed(number, here, uninterrupted, capsys):
    (here / "c.yaml").write_text(SWEEP)
    wanted, seconds = uninterrupted("sweep", "c.yaml")
    codes, piled = [], []
    for k, signal_, share in ends(number):
        after = share * seconds
        options = ("--resume" if k % 3 else "--overwrite", "--jobs", "2" if k % 5 == 4 else "1")
        code = killed(here, signal_, after, "sweep", "c.yaml", *options)
        while code is None:  # with the points of earlier ones it was faster: give it something to do
            shutil.rmtree(here / "results")
            after *= 0.9
            code = killed(here, signal_, after, "sweep", "c.yaml", *options)
        codes.append(code)
        found, piled = tables(here / "results/c")
        assert found == {name: wanted[name] for name in found}
        if k % 5 == 3:
            completes(here, wanted, "sweep", "c.yaml", "--resume")
    report(capsys, "sweep", codes, piled)
    completes(here, wanted, "sweep", "c.yaml", "--resume")


@pytest.mark.parametrize("signal_", SIGNALS)
def test_temporaries_do_not_pile_up(signal_, here):
    """A process that is killed leaves its half table behind; the next run removes it. At SIGTERM nothing is left."""
    (here / "c.yaml").write_text(RUN)
    before = HALF.format(signal=int(signal_))
    if signal_ == signal.SIGKILL:
        before = before.replace("os.kill(0,", "os.kill(os.getpid(),")
    assert ended(here, "run", "c.yaml", "--format", "csv", before=before).code in (-signal_, 128 + signal_)
    assert len(list((here / "results/c").glob(".trajectory-*"))) == (signal_ == signal.SIGKILL)
    assert command("run", "c.yaml").code == 0
    assert left(here / "results/c")[1] == []


def test_run_killed_while_its_table_grows_leaves_the_old_result(here):
    (here / "c.yaml").write_text(RUN)
    assert command("run", "c.yaml").code == 0
    wanted = tables(here / "results/c")[0]
    small = "import vibroplat.observe.tables\nvibroplat.observe.tables.BLOCK = 64\n"
    before = small + sending(signal.SIGKILL, "pyarrow.parquet:ParquetWriter.write_table", 3)
    assert ended(here, "run", "c.yaml", "--set", "run.duration_s=0.5", before=before).code == -signal.SIGKILL
    found, temporaries = tables(here / "results/c")
    assert found == wanted
    assert [name.partition("-")[0] for name in temporaries] == [".trajectory"]
    completes(here, wanted, "run", "c.yaml")
    assert tables(here / "results/c")[1] == []


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_run_killed_among_its_tables_leaves_no_set_of_two_runs(number, here):
    """After a run of another length: what is left belongs to one of the two, or is known to be incomplete."""
    (here / "c.yaml").write_text(RUN)
    assert command("run", "c.yaml", "--set", "run.duration_s=0.2").code == 0
    before = RENAMING.format(number=number)
    assert ended(here, "run", "c.yaml", before=before).code == -signal.SIGKILL
    found, _ = left(here / "results/c")
    assert len(found) == number
    assert found["trajectory.parquet"]["t_s"].iloc[-1] == 0.3
    if "summary.json" in found:
        assert found["summary.json"]["simulated_s"] == 0.3
        assert found["provenance.json"]["configuration"]["run"]["duration_s"] == 0.3
    else:
        assert not_a_line(command("plot", "results/c")) == ""


#: A program that is killed when it has renamed so many files of a result.
RENAMING = """
import os, signal
replace, renamed = os.replace, []
def killing(source, target, **options):
    replace(source, target, **options)
    if "results" in str(target):
        renamed.append(target)
    if len(renamed) == {number}:
        os.kill(os.getpid(), signal.SIGKILL)
os.replace = killing
"""
