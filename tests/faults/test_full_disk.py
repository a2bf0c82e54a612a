"""No room, no permission, no directory: one line, nothing half-written, and what was finished before is kept."""

import contextlib
import gc
import resource
import shutil
import signal

import pytest
from common.commands import command, not_a_line
from common.places import LOADED

pytestmark = pytest.mark.usefixtures("kernels")

RUN = f"extends: {LOADED}\nname: c\nrun: {{duration_s: 0.3}}\n"
#: A run whose tables are smaller than what is told of them.
SPARSE = f"{RUN}output: {{sample_rate_hz: 1.0}}\nmaterial: {{mass_ratio: 0.0}}\n"
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


@pytest.mark.long
def test_a_workbook_for_which_there_is_no_room_is_told_in_a_line(here):
    pytest.importorskip("openpyxl")
    (here / "c.yaml").write_text(RUN)
    assert command("run", "c.yaml").code == 0
    before = {path.name for path in (here / "results/c/run").iterdir()}
    with largest_file(5000):
        done = command("export", "results/c", "--format", "xlsx")
    gc.collect()  # what openpyxl left would complain now
    assert not_a_line(done, codes=FAILED) == ""
    assert {path.name for path in (here / "results/c/run").iterdir()} == before


def test_directory_that_is_removed_in_the_middle_is_told_in_a_line(here, monkeypatch):
    from vibroplat.motion import run

    simulate = run.simulate

    def removing(*arguments, **options):
        shutil.rmtree(here / "results/c")
        return simulate(*arguments, **options)

    (here / "c.yaml").write_text(RUN)
    monkeypatch.setattr(run, "simulate", removing)
    assert not_a_line(command("run", "c.yaml"), codes=FAILED) == ""
