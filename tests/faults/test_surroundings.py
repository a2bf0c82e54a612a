"""Commands in poor surroundings: closed streams, narrow encodings, little memory, kernels that may not be compiled."""

import errno
import os
import shlex
import subprocess
import sys

import pytest
from common.commands import PROGRAM, Done
from common.places import FLYING, QUICKSTART
from common.results import edited, unproven

from vibroplat import load
from vibroplat.page.text import escape
from vibroplat.system import memory
from vibroplat.system.interrupts import KEPT

SHORT = ("--set", "run.duration_s=0.05")
SWEEP = FLYING + "name: few\nsweep: {supply_frequency_hz: {start: 50.0, stop: 52.0, step: 1.0}, measure_s: 0.5}\n"


def shell(*arguments, redirect="", before="", **environment):
    """Run the command line from a shell, in its own way with streams and limits."""
    line = f"{before} exec {shlex.join([str(PROGRAM), *map(str, arguments)])} {redirect}"
    options = {"env": os.environ | environment, "capture_output": True, "text": True, "timeout": 120}
    done = subprocess.run(["sh", "-c", line], check=False, **options)
    return Done(done.returncode, done.stdout, done.stderr)


_NUMBERS = """
import os, sys
from vibroplat.system.terminal import open_streams
open_streams()
print("out \\u2026 \\udc80"); print("err \\u2026", file=sys.stderr); sys.stdin.read()
file = os.open(os.devnull, os.O_RDONLY)
assert file > 2, file
"""


@pytest.mark.parametrize("redirect", ["<&-", "2>&-", "<&- >&- 2>&-"])
def test_files_never_get_the_number_of_a_closed_stream(redirect):
    line = f"exec {shlex.join([sys.executable, '-c', _NUMBERS])} {redirect}"
    done = subprocess.run(["sh", "-c", line], capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    assert done.returncode == 0, done.stderr
    assert ("err" in done.stderr) == ("2>&-" not in redirect)
    assert ("out" in done.stdout) == (" >&-" not in f" {redirect}")


def test_characters_that_a_stream_does_not_have_are_escaped():
    code = "import sys\nfrom vibroplat.system.terminal import open_streams\nopen_streams()\n"
    code += "print('…')\nprint('…', file=sys.stderr)"
    environment = os.environ | {"PYTHONIOENCODING": "ascii"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == done.stderr == "\\u2026\n"


def test_characters_of_control_are_shown_and_not_sent():
    code = "import logging, sys\nfrom vibroplat.system.terminal import open_streams\nopen_streams()\n"
    code += "logging.basicConfig()\nprint(text := 'a\\x1b]0;b\\x07\\x9b2J\\u202e\\tc')\n"
    code += "logging.warning(text)\nsys.stdout.writelines([text])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    shown = r"a\x1b]0;b\x07\x9b2J\u202e" + "\tc"
    assert (done.stdout, done.stderr) == (f"{shown}\n{shown}", f"WARNING:root:{shown}\n")


def test_a_result_of_somebody_else_changes_no_terminal(runs, tmp_path):
    directory = runs["bare"].save(tmp_path / "some")
    edited(unproven(directory), "summary", notes=["\x1b[2J"])
    for text in (repr(load(directory)), escape("\x1b[2J")):
        assert "\x1b" not in text
        assert r"\x1b[2J" in text


def test_run_without_compilation_is_refused_with_the_name_of_the_setting(here):
    done = shell("run", QUICKSTART, NUMBA_DISABLE_JIT="1", NUMBA_CACHE_DIR=str(here / "empty"))
    assert (done.code, done.out, len(done.err.splitlines())) == (2, "", 1)
    assert done.err.startswith("vibroplat: NUMBA_DISABLE_JIT is set, ")


def test_too_little_address_space_is_told_before_anything_is_loaded(here):
    done = shell("run", QUICKSTART, before="ulimit -v 600000;")
    assert (done.code, done.out) == (1, "")
    told = "memory is limited to 614 MB of addresses (ulimit -v 600000); loading the libraries takes 1200 MB: "
    assert done.err == f"vibroplat: {told}raise the limit, or limit resident memory instead\n"
    assert shell("run", "--help", before="ulimit -v 600000;").code == 0


def test_first_start_without_the_memory_to_compile_is_told_before_it_compiles(here, tmp_path):
    limit = memory.MIN_ADDRESS_SPACE // 1024 + 1
    done = shell("run", QUICKSTART, before=f"ulimit -v {limit};", NUMBA_CACHE_DIR=str(tmp_path / "empty"))
    assert (done.code, done.out, len(done.err.splitlines())) == (1, "", 1)
    assert "; compiling the kernels for the first time takes 1450 MB: " in done.err
    assert not list((tmp_path / "empty").rglob("*.nb[ci]"))


@pytest.mark.long
def test_run_in_the_least_address_space_is_done(here, kernels):
    limit = memory.MIN_ADDRESS_SPACE // 1024 + 1
    done = shell("run", QUICKSTART, *SHORT, before=f"ulimit -v {limit};")
    assert (done.code, done.err) == (0, "")


SHORTAGES = [
    MemoryError(),
    MemoryError("Unable to allocate 7.28 TiB for an array"),
    OSError(errno.ENOMEM, "Cannot allocate memory"),
    ImportError("libopenblas.so: failed to map segment from shared object"),
]


def raising(error):
    def fail(*_arguments, **_options):
        raise error

    return fail


def test_errors_are_told_apart_from_a_lack_of_memory():
    assert [error for error in SHORTAGES if not memory.is_short_of_memory(error)] == []
    others = [ImportError("No module named 'x'"), RuntimeError("a mistake"), ValueError("out of memory")]
    assert [error for error in others if memory.is_short_of_memory(error)] == []


def test_processes_that_the_system_refuses_are_not_blamed_on_the_output(command, here, kernels, monkeypatch):
    refused = raising(OSError(errno.EAGAIN, "Resource temporarily unavailable"))
    monkeypatch.setattr("vibroplat.system.workers._start", refused)
    (here / "few.yaml").write_text(SWEEP.replace("measure_s", "grid: {contact.restitution: [0.0, 0.3]}, measure_s"))
    told = "worker processes cannot be started: Resource temporarily unavailable; one job needs none"
    assert command("sweep", "few.yaml", "--jobs", "2") == (1, "", f"vibroplat: {told}; {KEPT}\n")
    monkeypatch.setattr(
        "vibroplat.study.sweep.run_branches", raising(OSError(errno.EMFILE, "Too many open files", "it"))
    )
    assert command("sweep", "few.yaml") == (1, "", f"vibroplat: it: Too many open files; {KEPT}\n")


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_full_output_is_named(unbuffered):
    done = shell("--version", redirect="> /dev/full", PYTHONUNBUFFERED=unbuffered)
    assert (done.code, done.out) == (1, "")
    assert done.err.startswith("vibroplat: standard output cannot be written: No space left on device")
