"""Kernels compiled by two processes: each once, and neither waits for one that has died, nor outlives a command."""

import os
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from common.commands import until

from vibroplat.kernels.cache import KernelCache
from vibroplat.system import compile_lock
from vibroplat.system.compile_lock import second_compiler

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or len(os.sched_getaffinity(0)) < 2, reason="one core, or a system without fork"
)


def script(code, *arguments, stdin=None, **environment):
    line = [sys.executable, "-c", code, *map(str, arguments)]
    pipes = {"stdin": stdin, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(line, env=os.environ | environment, start_new_session=True, **pipes)


def is_running(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


#: Calls a kernel which a second process compiles, or fails to, or both compile; prints whether it was loaded.
CALL = """
import sys, time
import numpy as np
from vibroplat.kernels.cache import count
from vibroplat.kernels.compiled import compile_for
from vibroplat.kernels.polynomial import crossing
from vibroplat.system.compile_lock import second_compiler, is_second

c = np.array([[1.0], [-0.5], [0.2], [1.0]])

def work():
    assert is_second()
    if "fail" in sys.argv:
        print("not heard", file=sys.stderr)
        raise KeyboardInterrupt
    compile_for(crossing, c, 3, 0, 1.2, c[:, 0].sum())

with second_compiler(work):
    while "wait" in sys.argv and count() == 0:
        time.sleep(0.001)
    found = crossing(c, 3, 0, 1.2, c[:, 0].sum())
print(round(found, 9), sum(crossing.stats.cache_hits.values()), is_second())
"""


@pytest.mark.long
@pytest.mark.parametrize(("how", "loaded"), [("wait", "1"), ("fail", "0"), ("both", "[01]")])
def test_kernel_is_compiled_once_by_one_of_them(how, loaded, tmp_path):
    process = script(CALL, how, NUMBA_CACHE_DIR=str(tmp_path))
    out, err = process.communicate(timeout=120)
    value, hits, second = out.split()
    assert (value, second, err) == ("0.776170787", "False", "")
    assert hits in loaded
    files = sorted(path.name.split("-")[0] for path in tmp_path.rglob("*.bin"))
    assert files == ["kernels.polynomial.crossing"]


#: The second process tells its number and keeps a lock, and dies if it is told so; the first one asks for the lock.
KEEP = """
import os, sys, time
from pathlib import Path
from vibroplat.system.compile_lock import second_compiler, locked

here = Path.cwd()

def work():
    with locked(here, 7), open("second", "w") as file:
        file.write(str(os.getpid()))
        file.close()
        if "die" in sys.argv:
            time.sleep(0.2)
            os.abort()
        time.sleep(600.0)

with second_compiler(work):
    while not (os.path.exists("second") and os.path.getsize("second")):
        time.sleep(0.01)
    with locked(here, 8), locked(here, 9):
        print("free", flush=True)
    with locked(here, 7):
        print("free", flush=True)
"""


def test_nobody_waits_for_a_process_that_has_died(here):
    process = script(KEEP, "die")
    assert process.communicate(timeout=60) == ("free\nfree\n", "")


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_second_process_ends_with_the_first_however_that_ends(number, here):
    with script(KEEP) as process:
        assert process.stdout.readline() == "free\n"
        second = int((here / "second").read_text())
        assert is_running(second)
        process.send_signal(number)
        assert process.wait(60) == -number
        until(lambda: not is_running(second))


@pytest.mark.long
def test_interrupted_command_leaves_one_line_and_no_process(here):
    run = "import sys\nfrom vibroplat.__main__ import main\nsys.argv = ['vibroplat', 'run', 'short.yaml']\nmain()"
    (here / "short.yaml").write_text("run: {duration_s: 0.01}\n")
    with script(run, NUMBA_CACHE_DIR=str(here / "kernels")) as process:
        until(lambda: len(list(here.rglob("*.bin"))) > 3)
        (second,) = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=60)
    told = err.splitlines()
    assert (process.returncode, len(told)) == (130, 2)
    assert all(line.startswith("note: ") for line in out.splitlines())  # on the input, which come first
    assert told[0].startswith("vibroplat: compiling the numerical kernels; ")
    assert told[1].startswith("vibroplat: interrupted; ")
    until(lambda: not is_running(second))


@pytest.mark.parametrize("why", ["one core", "threads", "memory"])
def test_there_is_no_second_process_where_it_would_be_of_no_use(why, monkeypatch):
    if why == "one core":
        monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})
    elif why == "threads":
        monkeypatch.setattr(compile_lock.threading, "active_count", lambda: 2)
    else:
        monkeypatch.setattr(compile_lock, "available", lambda: 1e9)
    monkeypatch.setattr(os, "fork", lambda: pytest.fail("it was copied"))
    with second_compiler(lambda: None):
        assert not compile_lock.is_second()


#: Takes a lock, tells so, and keeps it.
TAKE = """
import sys
from pathlib import Path
from vibroplat.system.compile_lock import locked

with locked(Path.cwd(), 7):
    print("taken", flush=True)
    sys.stdin.readline()
"""


def test_others_wait_for_a_kernel_until_its_process_ends(here):
    first, second = (script(TAKE, stdin=subprocess.PIPE) for _ in range(2))
    ready = select.select([first.stdout, second.stdout], [], [], 60.0)[0]
    if ready == [second.stdout]:
        first, second = second, first
    assert select.select([second.stdout], [], [], 0.5)[0] == []
    first.kill()
    first.communicate(timeout=60)
    assert second.communicate("\n", timeout=60) == ("taken\n", "")


def test_a_process_that_was_stopped_is_not_waited_for_in_vain(here, monkeypatch):
    monkeypatch.setattr(compile_lock, "MAX_WAIT_S", 0.1)
    monkeypatch.setattr(compile_lock._Shared, "waits", True)
    with script(TAKE, stdin=subprocess.PIPE) as process:
        assert process.stdout.readline() == "taken\n"
        process.send_signal(signal.SIGSTOP)
        began = time.monotonic()
        with compile_lock.locked(here, 7):
            assert 0.05 < time.monotonic() - began < 30.0
        monkeypatch.setattr(compile_lock, "MAX_WAIT_S", 1e3)  # it may hold several, and is waited for once
        with compile_lock.locked(here, 7):
            assert time.monotonic() - began < 60.0
        process.kill()


def test_without_a_folder_or_a_file_nobody_waits(here):
    (here / compile_lock.LOCK_FILE).mkdir()  # that cannot be opened, for root as well
    for folder in (None, here):
        with compile_lock.locked(folder, 7), compile_lock.locked(folder, 8):
            pass


def test_kernels_and_their_signatures_have_numbers_of_their_own():
    numbers = {
        KernelCache(name).number(sig)
        for name in ("model.one.force", "model.two.force", "hybrid.one.force", "model.one.force.inside")
        for sig in ("int64(int64)", "int64(float64)", "float64(float64, int64)")
    }
    assert len(numbers) == 12
    assert max(numbers) < 2**63
