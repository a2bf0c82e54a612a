"""Input without an end, or far too much of it: refused soon, in one line."""

import os
import socket
import subprocess
import sys

import pytest
from common.commands import Done, not_a_line, script

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
