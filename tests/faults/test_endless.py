"""Input without an end, or far too much of it: refused soon, in one line."""

import os
import socket
import subprocess
import sys

import pytest
from common.commands import Done, command, not_a_line, script
from common.limits import cpu_seconds
from common.places import QUICKSTART

#: Most memory of a refusal (bytes): what reads on and on ends there and not with the machine.
MEMORY = 3 * 2**30
#: Longest time of the program with its start (s).
STARTED = 60.0


def limited(*arguments, cwd):
    """Run the command line with little memory and time; None where it did not end."""
    limit = f"import resource; resource.setrlimit(resource.RLIMIT_AS, ({MEMORY}, {MEMORY}))"
    line = [sys.executable, "-c", script(limit), *map(str, arguments)]
    try:
        done = subprocess.run(line, capture_output=True, text=True, timeout=STARTED, check=False, cwd=cwd)
    except subprocess.TimeoutExpired:
        return None
    return Done(done.returncode, done.stdout, done.stderr)


@pytest.mark.parametrize(
    ("way", "file"),
    [
        ("extended", "fifo"),
        pytest.param("extended", "/dev/zero", marks=pytest.mark.long),
        pytest.param("itself", "socket", marks=pytest.mark.long),
    ],
)
def test_file_without_an_end_is_refused(way, file, here):
    os.mkfifo(here / "fifo")
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind("socket")
    (here / "c.yaml").write_text(f"extends: {file}\n")
    done = limited("run", file if way == "itself" else "c.yaml", cwd=here)
    assert done is not None, "did not end"
    assert not_a_line(done) == ""


def test_grid_of_far_too_many_branches_is_refused_soon(here):
    """Few values make very many combinations."""
    keys = ("contact.restitution", "material.mass_ratio", "material.damping_ratio", "material.lower_share")
    grid = ", ".join(f"{key}: [{', '.join(str(0.001 * k) for k in range(1, 101))}]" for key in keys)
    (here / "c.yaml").write_text(
        f"extends: {QUICKSTART}\nsweep: {{supply_frequency_hz: {{start: 50, stop: 51}}, grid: {{{grid}}}}}\n"
    )
    with cpu_seconds(5.0):
        done = command("sweep", "c.yaml")
    assert not_a_line(done) == ""


@pytest.mark.usefixtures("kernels")
def test_grid_that_no_table_can_hold_is_refused_by_a_run_too(here):
    """A run does not look at the sweep, but writes it down."""
    for grid in ("{contact.restitution: [.nan]}", '{"a\\ud800": [1]}', '{"run.\\ud800": [1]}'):
        plan = f"sweep: {{supply_frequency_hz: {{start: 50, stop: 51}}, grid: {grid}}}\n"
        (here / "c.yaml").write_text(f"run: {{duration_s: 0.01}}\n{plan}")
        assert not_a_line(command("run", "c.yaml")) == ""
        assert not (here / "results").exists()
