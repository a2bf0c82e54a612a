"""Memory of a run: tables are made while it goes on, what cannot fit is refused, what runs out ends it with a name."""

import resource
import sys
import tracemalloc
from pathlib import Path

import pandas as pd
import pytest
from common.known import motion_of
from common.places import QUICKSTART

from vibroplat import load_config, simulate
from vibroplat.errors import ConfigError
from vibroplat.motion.recorder import Recorder
from vibroplat.system.memory import MemoryBudget, OutOfMemoryError, available

pytestmark = pytest.mark.usefixtures("kernels")

PROGRAM = [
    {"t_s": 0.0, "supply_frequency_hz": 51.5},
    {"t_s": 0.05, "supply_frequency_hz": 51.5},
    {"t_s": 0.2, "supply_frequency_hz": 56.0},
    {"t_s": 0.21, "exciter_1": "off"},
]
SCENES = {
    "bouncing": {"contact.restitution": 0.5},
    "one layer at an odd rate": {"material.layers": 1, "output.sample_rate_hz": 1000.0 / 3.0},
    "drive program": {"drive.program": PROGRAM},
    "through Python": {"solver.engine": "sundae", "run.duration_s": 0.1},
    "ends early": {"contact.restitution": 0.5, "solver.max_events_per_period": 3},
}


@pytest.fixture
def small_blocks(monkeypatch):
    monkeypatch.setattr("vibroplat.observe.tables.BLOCK", 7)


class Parts:
    def __init__(self):
        self.trajectory, self.events = [], []

    @property
    def sink(self):
        return (self.trajectory.append, self.events.append)

    def tables(self):
        return [pd.concat(parts, ignore_index=True) for parts in (self.trajectory, self.events)]


def same(found, wanted):
    pd.testing.assert_frame_equal(found, wanted, check_exact=True)


@pytest.mark.parametrize("name", SCENES)
def test_tables_made_while_a_run_goes_on_are_those_made_afterwards(name, small_blocks):
    scene = load_config(QUICKSTART, {"run.duration_s": 0.25, **SCENES[name]})
    parts, whole = Parts(), simulate(scene)
    run = simulate(scene, keep="table", sink=parts.sink)
    assert (run.outcome == "ok") == (name != "ends early")
    assert max(map(len, (*parts.trajectory, *parts.events))) <= 7
    for trajectory, events in ((run.trajectory, run.events), parts.tables()):
        same(trajectory, whole.trajectory)
        same(events, whole.events)
    assert run.notes == whole.notes
    assert not run.segments
    assert run.summary | {"wall_s": 0.0} == whole.summary | {"wall_s": 0.0}


def peak(scene, **options):
    """Most memory (bytes) that a run takes besides what was there before."""
    tracemalloc.start()
    try:
        simulate(scene, **options)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_grows_neither_with_duration_nor_with_rows_nor_with_events(quickstart, monkeypatch):
    monkeypatch.setattr("vibroplat.observe.tables.BLOCK", 100)
    short = quickstart.replace({"run.duration_s": 0.5, "output.sample_rate_hz": 1000.0})
    drop = (len, len)
    peak(short, keep="summary", sink=drop)  # loads what is needed
    little = peak(short, keep="summary", sink=drop)
    long = short.replace({"run.duration_s": 2.5})
    assert peak(long, keep="summary", sink=drop) < little + 100_000
    assert peak(long) > little + 2_000_000


def test_table_that_does_not_fit_into_memory_is_refused_at_once(quickstart, monkeypatch):
    monkeypatch.setattr("vibroplat.observe.tables.available", lambda: 4.0 * 2**30)
    scene = quickstart.replace({"run.duration_s": 1e4, "output.sample_rate_hz": 5000.0})
    with pytest.raises(ConfigError) as caught:
        simulate(scene, keep="table", engine=pytest.fail)
    assert str(caught.value) == (
        "output.sample_rate_hz = 5000 asks for 5e+07 rows of 19 columns in 10000 s: 14.2 GiB of memory, "
        "where 2 GiB may be taken of 4 GiB available; allowed: at most 7.1e+02 Hz, or a shorter run.duration_s"
    )


def test_table_that_does_not_fit_on_the_disk_is_refused_at_once(command, tmp_path, monkeypatch):
    class Usage:
        free = 2 * 2**30

    monkeypatch.setattr("shutil.disk_usage", lambda _path: Usage)
    monkeypatch.setattr("vibroplat.motion.run.simulate", None)
    settings = ("--set", "run.duration_s=1e4", "--set", "output.sample_rate_hz=5000", "--set", "material.layers=1")
    done = command("run", QUICKSTART, "--out", tmp_path, "--format", "csv", *settings)
    assert (done.code, done.out) == (2, "")
    assert done.err == (
        "vibroplat: output.sample_rate_hz = 5000 asks for 5e+07 rows of 17 columns in 10000 s: "
        "15.8 GiB on disk, where 2 GiB are free; allowed: at most 6.3e+02 Hz, or a shorter run.duration_s\n"
    )
    assert list((tmp_path / "quickstart/run").iterdir()) == []


@pytest.mark.parametrize(
    ("keep", "advice"),
    [
        ("segments", "shorten run.duration_s, or simulate with keep='table'"),
        ("table", "lower output.sample_rate_hz or shorten run.duration_s"),
        ("events", "shorten run.duration_s, or simulate with keep='summary'"),
    ],
)
def test_run_that_would_keep_more_than_its_share_ends_with_what_was_computed(
    keep, advice, quickstart, monkeypatch, small_blocks
):
    scene = quickstart.replace({"run.duration_s": 3.0, "output.sample_rate_hz": 50.0})
    whole = simulate(scene)
    most = {"segments": 2e6, "table": 5e4, "events": 9e3}[keep]
    monkeypatch.setattr("vibroplat.system.memory.INTERVAL", 0)
    monkeypatch.setattr("vibroplat.system.memory.available", lambda: most)
    run = simulate(scene, keep=keep)
    assert run.outcome == "out-of-memory"
    assert run.summary["detail"].startswith("the data that the run keeps would need more than ")
    assert f", 0.5 of the memory that is available; {advice}; mode " in run.summary["detail"]
    assert 0.0 < run.summary["simulated_s"] < 3.0
    same(run.trajectory, whole.trajectory.iloc[: len(run.trajectory)])
    assert (len(run.trajectory) > 10) == (keep != "events")
    assert len(run.events) > 10
    same(run.events, whole.events.iloc[: len(run.events)])


@pytest.mark.parametrize("sink", [False, True])
def test_dense_output_that_grows_too_large_is_given_up_for_the_table(sink, quickstart, monkeypatch, small_blocks):
    scene, parts = quickstart.replace({"run.duration_s": 0.5}), Parts()
    whole = simulate(scene)
    monkeypatch.setattr("vibroplat.motion.recorder.MAX_DENSE_OUTPUT", 2e5)
    run = simulate(scene, sink=parts.sink if sink else None)
    assert (run.outcome, run.segments) == ("ok", [])
    same(run.trajectory, whole.trajectory)
    same(run.events, whole.events)
    assert [note.partition(" takes")[0] for note in run.notes if note not in whole.notes] == ["dense output"]
    with pytest.raises(ConfigError, match="kept no segments"):
        run(0.1)
    if sink:
        same(parts.tables()[0], whole.trajectory)


class Full:
    """An observer for which memory runs out at its third reading."""

    def __init__(self):
        self.readings = 0

    def read(self, _h):
        self.readings += 1
        if self.readings == 3:
            raise MemoryError


def test_observer_without_memory_ends_the_motion_and_all_others_read_to_the_end(quickstart):
    segments, events, full = Recorder(quickstart, "segments"), Recorder(quickstart, "events"), Full()
    with motion_of(quickstart) as motion:
        motion.to_time(4.0, [full, segments, events])
    assert (motion.outcome, full.readings) == ("out-of-memory", 3)
    assert motion.detail.startswith("the system gave no more memory; ")
    assert segments.segments[-1].end == motion.now > 0.0
    assert motion.events == len(events.events) > 0


@pytest.mark.parametrize("version", [1, 2])
def test_limit_of_a_container_is_what_is_available(version, tmp_path, monkeypatch):
    names = ("memory.max", "memory.current")
    if version == 1:
        names = ("memory/memory.limit_in_bytes", "memory/memory.usage_in_bytes")
    (tmp_path / "memory").mkdir()
    for name, text in zip(names, ("5000000", "3000000"), strict=True):
        (tmp_path / name).write_text(text)
    (tmp_path / names[0]).with_name("memory.stat").write_text("anon 1\ninactive_file 1000000\n")
    before = available()
    monkeypatch.setattr("vibroplat.system.memory.GROUPS", tmp_path)
    assert available() == 3e6 < before


@pytest.mark.skipif(sys.platform != "linux", reason="the limit and what is taken of it are Linux's")
def test_limit_of_addresses_is_what_is_available():
    taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    try:
        resource.setrlimit(resource.RLIMIT_AS, (taken + 200 * 2**20, before[1]))
        assert available() == pytest.approx(200 * 2**20, rel=0.1)
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def test_share_is_counted_over_all_that_is_kept(monkeypatch):
    monkeypatch.setattr("vibroplat.system.memory.INTERVAL", 0)
    monkeypatch.setattr("vibroplat.system.memory.available", lambda: 100.0)
    share = MemoryBudget("keep less")
    share.take(40)
    with pytest.raises(
        OutOfMemoryError, match=r"^the data that the run keeps would need more than 70 bytes, .*; keep less$"
    ):
        share.take(40)
    assert share.taken == 40
    MemoryBudget(bounded=False).take(10**9)
