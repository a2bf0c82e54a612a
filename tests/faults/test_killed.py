"""Killed at any moment: what is there under a final name is whole, and what was begun can be gone on with."""

from __future__ import annotations

import os
import shutil
import signal
import time

import numpy as np
import pytest
from common.commands import Child, command, not_a_line
from common.places import LOADED
from common.results import bits, left

pytestmark = pytest.mark.usefixtures("kernels")

RUN = f"extends: {LOADED}\nname: c\nrun: {{duration_s: 0.3}}\n"
SWEEP = (
    f"extends: {LOADED}\nname: c\n"
    "sweep:\n"
    "  supply_frequency_hz: {start: 46.0, stop: 51.0, step: 0.5, direction: [up, down]}\n"
    "  grid: {contact.restitution: [0.0, 0.3]}\n"
)
#: A run of which each table takes a while to be written.
SLOW = f"{RUN}output: {{sample_rate_hz: 100.0e+3}}\n"
#: What imports take (s), about.
START = 1.3
TABLES = ("trajectory", "events", "sweep")
SIGNALS = (signal.SIGTERM, signal.SIGKILL)


def kills(quick):
    """Numbers of kills: quick, long, and that of the campaign."""
    return [
        pytest.param(quick, id=str(quick)),
        pytest.param(5, id="5", marks=pytest.mark.long),
        pytest.param(50, id="50", marks=pytest.mark.campaign),
    ]


def tables(directory):
    """The bits of the tables in a directory, and the names of temporaries."""
    found, temporaries = left(directory)
    return {name: bits(table) for name, table in found.items() if name.startswith(TABLES)}, temporaries


@pytest.fixture
def uninterrupted(here):
    """Let a command alone; return its tables and the time (s) that it takes with its start."""

    def alone(*arguments):
        began = time.monotonic()
        assert command(*arguments, "--out", "alone").code == 0
        return tables(here / "alone/c")[0], time.monotonic() - began + START

    return alone


def ends(number):
    """Go through moments of so many kills: shares of the time that a command takes, half of them near its end."""
    random = np.random.default_rng(number)
    for k in range(number):
        yield k, SIGNALS[k % 2], random.uniform(0.0 if k % 4 < 2 else 0.6, 1.0)


def killed(here, signal_, after, *arguments):
    """Kill a command so long after its start; return its exit code, None where it was faster."""
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


def goes_on(here, wanted, *arguments):
    """Let a command come to its end, and to the tables of one that was let alone."""
    again = command(*arguments)
    assert (again.code, again.err) == (0, "")
    assert tables(here / "results/c")[0] == wanted


def report(capsys, what, codes, piled):
    ended = {code: codes.count(code) for code in sorted(set(codes), key=str)}
    with capsys.disabled():
        print(f"\n{what}: {len(codes)} kills, exit codes {ended}, temporaries left {len(piled)}")


@pytest.mark.parametrize("number", kills(1))
def test_killed_run_leaves_whole_tables_and_works_again(number, here, uninterrupted, capsys):
    (here / "c.yaml").write_text(RUN)
    wanted, seconds = uninterrupted("run", "c.yaml")
    codes, piled = [], []
    for _, signal_, share in ends(number):
        codes.append(killed(here, signal_, share * seconds, "run", "c.yaml"))
        found, piled = tables(here / "results/c")
        assert found == {name: wanted[name] for name in found}
        if len(codes) % 3 == 0:  # of the others something is gone on with that is not whole
            goes_on(here, wanted, "run", "c.yaml")
    report(capsys, "run", codes, piled)
    goes_on(here, wanted, "run", "c.yaml")


@pytest.mark.parametrize("number", kills(1))
def test_killed_sweep_leaves_whole_tables_and_is_gone_on_with(number, here, uninterrupted, capsys):
    (here / "c.yaml").write_text(SWEEP)
    wanted, seconds = uninterrupted("sweep", "c.yaml")
    codes, piled = [], []
    for k, signal_, share in ends(number):
        after = share * seconds
        options = ("--resume" if k % 3 else "--overwrite", "--jobs", "2" if k % 5 == 4 else "1")
        code = killed(here, signal_, after, "sweep", "c.yaml", *options)
        while code is None:  # with what others have left it was faster: there is to be something to do
            shutil.rmtree(here / "results")
            after *= 0.9
            code = killed(here, signal_, after, "sweep", "c.yaml", *options)
        codes.append(code)
        found, piled = tables(here / "results/c")
        assert found == {name: wanted[name] for name in found}
        if k % 3 == 2:
            goes_on(here, wanted, "sweep", "c.yaml", "--resume")
    report(capsys, "sweep", codes, piled)
    goes_on(here, wanted, "sweep", "c.yaml", "--resume")


@pytest.mark.parametrize("signal_", [signal.SIGKILL, pytest.param(signal.SIGTERM, marks=pytest.mark.long)])
def test_temporaries_do_not_pile_up(signal_, here):
    """Whoever is killed while a table is written leaves what is there of it; the next run takes it away."""
    (here / "c.yaml").write_text(SLOW)
    for _ in range(2):
        there = set((here / "results").glob("c/.*"))
        with Child(here, "run", "c.yaml", "--format", "csv") as child:
            assert child.wait_for(lambda there=there: set((here / "results").glob("c/.trajectory-*")) - there)
            time.sleep(0.05)
            child.process.send_signal(signal_)
            assert child.end().code in (-signal_, 128 + signal_)
        if signal_ == signal.SIGTERM:
            assert left(here / "results/c") == ({}, [])
    (here / "c.yaml").write_text(RUN)
    assert command("run", "c.yaml").code == 0
    assert left(here / "results/c")[1] == []


def test_run_killed_among_its_tables_leaves_no_set_of_two_runs(here):
    """A run over an earlier one of other length: what is left is of one of them, or known not to be whole."""
    (here / "c.yaml").write_text(RUN)
    assert command("run", "c.yaml", "--set", "run.duration_s=0.2").code == 0
    trajectory = here / "results/c/trajectory.parquet"
    before = trajectory.stat().st_ino
    with Child(here, "run", "c.yaml") as child:
        assert child.wait_for(lambda: trajectory.stat().st_ino != before)
        os.kill(child.process.pid, signal.SIGKILL)
        assert child.end().code == -signal.SIGKILL
    found, _ = left(here / "results/c")
    assert found["trajectory.parquet"]["t_s"].iloc[-1] == 0.3
    if "summary.json" in found:
        assert found["summary.json"]["simulated_s"] == 0.3
        assert found["provenance.json"]["configuration"]["run"]["duration_s"] == 0.3
    else:
        assert not_a_line(command("plot", "results/c")) == ""
