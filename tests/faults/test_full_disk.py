"""No room, no permission, no directory: one line, nothing half-written, and what was finished before is kept."""

import contextlib
import os
import resource
import shutil
import signal

import pytest
from common.commands import command, not_a_line
from common.places import LOADED, SWEPT
from common.results import bits, left

pytestmark = pytest.mark.usefixtures("kernels")

RUN = f"extends: {LOADED}\nname: c\nrun: {{duration_s: 0.3}}\n"
#: A run whose tables are smaller than what is told of them.
SPARSE = f"{RUN}output: {{sample_rate_hz: 1.0}}\nmaterial: {{mass_ratio: 0.0}}\n"
SWEEP = f"{SWEPT}  lyapunov: false\n  kind: bifurcation\n"
#: Exit codes of input or output that cannot be used, and of work that has failed.
FAILED = (1, 2)


@contextlib.contextmanager
def largest_file(size):
    """Let no file grow beyond so many bytes; Python ignores the signal, so that writing fails."""
    assert signal.getsignal(signal.SIGXFSZ) == signal.SIG_IGN
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize(("text", "size", "file"), [(RUN, 3000, "trajectory.csv"), (SPARSE, 2000, "summary.json")])
def test_earlier_run_is_kept_where_there_is_no_room(text, size, file, here):
    (here / "c.yaml").write_text(text)
    assert command("run", "c.yaml", "--format", "csv").code == 0
    before = {path.name: path.read_bytes() for path in (here / "results/c/run").iterdir()}
    with largest_file(size):
        done = command("run", "c.yaml", "--format", "csv")
    assert not_a_line(done, codes=FAILED) == ""
    assert f"{file} cannot be written: File too large" in done.err
    assert {path.name: path.read_bytes() for path in (here / "results/c/run").iterdir()} == before


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The tables of the sweep with room enough, and its directory."""
    place = tmp_path_factory.mktemp("alone")
    (place / "c.yaml").write_text(SWEEP)
    assert command("sweep", place / "c.yaml", "--out", place).code == 0
    return place / "c/sweep"


def tables(directory):
    return {name: bits(found) for name, found in left(directory)[0].items() if name.endswith((".parquet", ".csv"))}


def resumed_after(done, here, alone, kept=0):
    """Check how a sweep has ended without room, and that it goes on to the same tables with room."""
    assert not_a_line(done, codes=FAILED) == ""
    wanted = tables(alone)
    found, temporaries = left(here / "results/c/sweep")
    assert temporaries == []
    assert {name: bits(t) for name, t in found.items() if name in wanted} == {
        n: wanted[n] for n in wanted if n in found
    }
    again = command("sweep", "c.yaml", "--resume")
    assert (again.code, again.err) == (0, "")
    assert tables(here / "results/c/sweep") == wanted
    if kept:
        assert f": {kept} tasks from before; " in again.out


@pytest.mark.long
def test_sweep_without_room_is_told_in_a_line_and_goes_on_later(here, alone):
    (here / "c.yaml").write_text(SWEEP)
    with largest_file(40_000):
        done = command("sweep", "c.yaml")
    resumed_after(done, here, alone)


def test_points_outlive_tables_that_have_no_room(here, alone, monkeypatch):
    """All points are there, and one of the tables has no room."""
    (here / "c.yaml").write_text(SWEEP)
    shutil.copytree(alone, here / "results/c/sweep")
    for path in (*(here / "results/c/sweep").glob("*.parquet"), here / "results/c/sweep/provenance.json"):
        path.unlink()
    replace = os.replace

    def without_room(source, target):
        if "sweep" in str(target):
            with open(source, "ab") as table, largest_file(os.path.getsize(source)):
                table.write(b"x")
                table.flush()
        replace(source, target)

    monkeypatch.setattr("os.replace", without_room)
    done = command("sweep", "c.yaml", "--resume")
    assert "cannot be written: File too large" in done.err
    monkeypatch.undo()
    os.chdir(here)
    resumed_after(done, here, alone, kept=22)


def test_directory_that_is_removed_in_the_middle_is_told_in_a_line(here, monkeypatch):
    from vibroplat.motion import run

    simulate = run.simulate

    def removing(*arguments, **options):
        shutil.rmtree(here / "results/c")
        return simulate(*arguments, **options)

    (here / "c.yaml").write_text(RUN)
    monkeypatch.setattr(run, "simulate", removing)
    assert not_a_line(command("run", "c.yaml"), codes=FAILED) == ""
