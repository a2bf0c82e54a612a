"""Worker processes: they load nothing that their parent would not, end with it, and answer whatever a task does."""

import contextlib
import os
import shlex
import subprocess
import sys
from concurrent.futures import BrokenExecutor
from pathlib import Path

import matplotlib
import psutil
import pytest
from common.commands import PROGRAM, script, workers_of

import vibroplat
from vibroplat.plots.style import styled
from vibroplat.system import workers as rooms
from vibroplat.system.workers import Workers, core_count

#: Longest wait (s) for processes to end, on a busy machine too.
SOON = 15.0
#: Modules that processes load as they start, and names that innocent files may have.
NAMES = ("loky", "queue", "numpy", "json", "pickle", "threading", "sitecustomize", "vibroplat", "numba")
FEW = """name: few
sweep:
  supply_frequency_hz: {start: 46.0, stop: 47.0, step: 1.0}
  grid: {contact.restitution: [0.0, 0.3]}
  max_settle_s: 2.0
  measure_s: 0.3
"""


@contextlib.contextmanager
def opened(count):
    workers = Workers(count)
    try:
        yield workers
    finally:
        workers.close()


@pytest.fixture
def hostile(here):
    """A working directory with files that leave a trace when they are run."""
    for name in NAMES:
        (here / f"{name}.py").write_text(f"open({str(here / 'ran')!r}, 'a').write({name!r})\nraise SystemExit('ran')\n")
    return here


@pytest.mark.parametrize("path", ["absolute", "relative"])
def test_worker_finds_modules_where_its_parent_does_and_nowhere_else(path, hostile, monkeypatch):
    """A relative path was made absolute when the parent began, perhaps elsewhere."""
    if path == "relative":
        monkeypatch.setenv("PYTHONPATH", os.pathsep.join([".", os.environ.get("PYTHONPATH", "")]))
    monkeypatch.setattr(sys, "path", [*sys.path, "/nowhere", "not absolute"])
    with opened(1) as workers:
        assert workers.submit(eval, "__import__('sys').path").result(SOON) == sys.path
        assert workers.submit(eval, "__import__('vibroplat').__file__").result(SOON) == vibroplat.__file__
    assert not (hostile / "ran").exists()


@pytest.mark.faults
@pytest.mark.parametrize("flags", [(), ("-E", "-P"), ("-I",)])
def test_command_runs_nothing_of_the_directory_it_is_called_in(flags, hostile, kernels):
    (hostile / "few.yaml").write_text(FEW)
    found = f"import sys; sys.path.insert(0, {str(Path(vibroplat.__file__).parents[1])!r})"
    line = [sys.executable, *flags, "-c", script(found)] if flags else [PROGRAM]
    done = subprocess.run([*line, "sweep", "few.yaml", "--jobs", "2"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert not (hostile / "ran").exists()


def test_figures_start_no_program_that_a_file_of_the_directory_names(here):
    """Matplotlib reads its settings there."""
    (here / "matplotlibrc").write_text("text.usetex: True\n")
    with matplotlib.rc_context(fname="matplotlibrc"), styled():
        assert not matplotlib.rcParams["text.usetex"]


#: A parent that says when its worker has begun.
PARENT = """
import sys, time
from vibroplat.system.workers import Workers
workers = Workers(2)
{begin}
print("begun", flush=True)
time.sleep(100)
"""
IDLE = "workers.submit(abs, -1).result()"
#: A process that has the pipes too and goes on for a while.
FORK = "import os\nif not os.fork():\n    os.close(1)\n    os.close(2)\n    time.sleep(20)"
#: A run for ever, with time to load what it needs.
COMPILED = """{idle}
workers.submit(exec, '''
from vibroplat import Scene, simulate
scene = Scene().replace({{"run.duration_s": 1e6, "solver.engine": "{engine}"}})
simulate(scene, keep="summary")
''')
time.sleep(3.0)"""
BEGIN = {
    "in a task": f"{IDLE}; workers.submit(time.sleep, 100)",
    "starting": "",
    "idle": IDLE,
    "in Python": f"{IDLE}; workers.submit(exec, 'while True: pass')",
    "pipes": f"{IDLE}\n{FORK}",
    **{f"in compiled code of {e}": COMPILED.format(idle=IDLE, engine=e) for e in ("native", "taylor", "sundae")},
}


@pytest.mark.faults
@pytest.mark.parametrize("what", BEGIN)
def test_worker_ends_with_a_parent_that_is_killed(what):
    """Silently, and whoever reads what the parent has printed is not kept waiting."""
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT.format(begin=BEGIN[what])], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert parent.stdout.readline() == b"begun\n"
    children = workers_of(parent.pid)
    assert len(children) == 2
    parent.kill()
    assert parent.communicate(timeout=SOON) == (b"", b"")
    assert psutil.wait_procs(children, timeout=SOON)[1] == []


class UnkindError(Exception):
    def __reduce__(self):
        raise TypeError


def fail_unkindly():
    raise UnkindError("so it is")


def test_worker_answers_whatever_a_task_does():
    tasks = {
        "unreadable": (eval, "lambda: 0"),
        "result": (eval, "lambda: 0"),
        "exit": (sys.exit, 3),
        "error": (fail_unkindly,),
        "print": (print, "not a result"),
    }
    with opened(1) as workers:
        assert "Traceback" in workers.submit(int, "x").exception(SOON).__notes__[0]
        assert workers.submit(lambda: 0).exception(SOON) is not None
        raised = {name: workers.submit(*task).exception(SOON) for name, task in tasks.items()}
        assert workers.submit(len, bytes(10_000_000)).result(SOON) == 10_000_000
        assert len(workers.submit(bytes, 10_000_000).result(SOON)) == 10_000_000
        assert workers.usable
        assert workers.submit(os._exit, 0).exception(SOON).args == ("a worker process has died",)
        assert not workers.usable
        assert isinstance(workers.submit(abs, -1).exception(SOON), BrokenExecutor)
    assert isinstance(raised["exit"], SystemExit)
    assert str(raised["error"]) == "UnkindError: so it is"
    assert raised["print"] is None


def test_threads_that_the_system_refuses_leave_no_process(monkeypatch):
    def refuse(_self):
        raise RuntimeError("can't start new thread")

    before = workers_of()
    monkeypatch.setattr(rooms.threading.Thread, "start", refuse)
    with pytest.raises(OSError, match="can't start new thread"):
        Workers(2)
    assert workers_of() == before


@pytest.mark.faults
@pytest.mark.parametrize("command", [("sweep", "few.yaml"), ("run", "few.yaml", "--set", "run.duration_s=0.1")])
def test_few_open_files_are_enough_or_told_in_a_line(command, here, kernels):
    (here / "few.yaml").write_text(FEW)
    jobs = ("--jobs", "2") * (command[0] == "sweep")
    codes = []
    for limit in (10, 12, 20):
        line = f"ulimit -n {limit}; exec {shlex.join([str(PROGRAM), *command, *jobs, '--out', f'out-{limit}'])}"
        done = subprocess.run(["sh", "-c", line], capture_output=True, text=True, check=False, timeout=120)
        told = done.stderr.splitlines()
        assert len(told) == (done.returncode != 0), (limit, done.stderr)
        assert all(line.startswith("vibroplat: ") for line in told)
        codes.append(done.returncode)
    assert codes[-1] == 0


def test_group_that_may_keep_few_cores_busy_has_no_more_workers(tmp_path, monkeypatch):
    if hasattr(os, "sched_getaffinity"):
        monkeypatch.setattr(os, "sched_getaffinity", lambda _pid: range(8))
    monkeypatch.setattr(os, "cpu_count", lambda: 8)
    monkeypatch.setattr(rooms, "control_groups", lambda: [tmp_path])
    assert core_count() == 8
    for text, cores in (("max 100000", 8), ("250000 100000", 3), ("1000 100000", 1), ("9900000 100000", 8)):
        (tmp_path / "cpu.max").write_text(text + "\n")
        assert core_count() == cores
    (tmp_path / "cpu.max").unlink()
    (tmp_path / "cpu").mkdir()
    (tmp_path / "cpu/cpu.cfs_period_us").write_text("100000\n")
    for quota, cores in ((-1, 8), (200000, 2)):
        (tmp_path / "cpu/cpu.cfs_quota_us").write_text(f"{quota}\n")
        assert core_count() == cores
