"""Ctrl-C at any moment, also while the program is loaded: it ends at once, with one line."""

from __future__ import annotations

import os
import signal
import time

import numpy as np
import pytest
from common.commands import Child, command, not_a_line
from common.places import LOADED
from common.results import bits, left

pytestmark = pytest.mark.usefixtures("kernels")

#: Longest time from Ctrl-C to the end (s).
SOON = 2.0
CONFIGURATION = (
    f"extends: {LOADED}\nname: c\nrun: {{duration_s: 1000.0}}\noutput: {{sample_rate_hz: 10.0}}\n"
    "sweep:\n"
    "  supply_frequency_hz: {start: 46.0, stop: 51.0, step: 0.5, direction: [up, down]}\n"
    "  grid: {contact.restitution: [0.0, 0.3]}\n"
)
COMMANDS = {
    "run": ("run", "c.yaml"),
    "jobs 1": ("sweep", "c.yaml", "--resume", "--jobs", "1"),
    "jobs 2": ("sweep", "c.yaml", "--resume", "--jobs", "2"),
}
#: Time within which Ctrl-C is sent (s): half of it is spent on imports.
WITHIN = 3.0
#: Before that even a program that takes care at once may not be ready for it (s).
FIRST = 0.3


def interrupted(here, after, arguments):
    """Press Ctrl-C so long after the program has begun to load; return how it ended, and after what time (s)."""
    with Child(here, *arguments) as child:
        child.begun()
        time.sleep(after)
        if child.process.poll() is not None:
            return None, 0.0
        pressed = time.monotonic()
        os.killpg(child.process.pid, signal.SIGINT)
        return child.end(20.0), time.monotonic() - pressed


def problem(done):
    """Say what is wrong with the end of a command at Ctrl-C; it may have been done just then."""
    if done is None or (done.code, done.err) == (0, ""):
        return ""
    if (done.code, done.err) == (-signal.SIGINT, "") and "\ntables  " in done.out:
        return ""  # all was told; Python, which takes itself apart for half a second, was ended in that
    told = not_a_line(done, codes=(130,))
    return told or ("" if done.err.startswith("vibroplat: interrupted") else f"told {done.err!r}")


def resumed(here):
    """Whether the sweep goes on to the same table."""
    assert command("sweep", "c.yaml", "--out", "alone").code == 0
    assert command("sweep", "c.yaml", "--resume").code == 0
    found, alone = (bits(left(here / out / "c")[0]["sweep.parquet"]) for out in ("results", "alone"))
    assert found == alone


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize(
    "presses",
    [pytest.param(2, id="2", marks=pytest.mark.long), pytest.param(40, id="40", marks=pytest.mark.campaign)],
)
def test_ctrl_c_at_random_moments_ends_with_one_line(presses, name, here, capsys):
    (here / "c.yaml").write_text(CONFIGURATION)
    random = np.random.default_rng(presses)
    wrong, times = {}, []
    for _ in range(presses):
        after = float(random.uniform(FIRST, WITHIN))
        done, seconds = interrupted(here, after, COMMANDS[name])
        times.append(seconds if done is not None and done.code else 0.0)
        if problem(done):
            wrong[round(after, 3)] = problem(done)
    with capsys.disabled():
        print(f"\n{name}: {presses} times Ctrl-C, slowest {max(times):.2f} s, {len(wrong)} wrong at {sorted(wrong)}")
    if name != "run":
        resumed(here)
    assert wrong == {}
    assert max(times) < SOON


def test_ctrl_c_while_it_is_loaded_ends_with_one_line(here):
    """Nobody who has mistyped waits until everything is there."""
    (here / "c.yaml").write_text(CONFIGURATION)
    done, seconds = interrupted(here, FIRST, COMMANDS["run"])
    assert problem(done) == ""
    assert seconds < SOON


@pytest.mark.long
def test_ctrl_c_in_a_long_run_ends_with_one_line(here):
    (here / "c.yaml").write_text(CONFIGURATION)
    done, seconds = interrupted(here, 2.5, COMMANDS["run"])
    assert done is not None
    assert problem(done) == ""
    assert seconds < SOON
    assert left(here / "results/c") == ({}, [])
