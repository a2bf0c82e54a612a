"""Finished points outlive the process: killed at any moment, a sweep continues to the same table."""

from __future__ import annotations

import json
import math
import os
import shutil
import signal
import sqlite3

import psutil
import pytest
from common import commands
from common.commands import Child, ended, sending
from common.places import FLYING
from common.results import bits, finished_points

from vibroplat import load_config, sweep
from vibroplat.errors import ConfigError
from vibroplat.results.tables import read_table, write_table
from vibroplat.study.store import FILE, Store, digest

POINTS = 44
CONFIGURATION = (
    f"{FLYING}"
    "sweep:\n"
    "  supply_frequency_hz: {start: 46.0, stop: 51.0, step: 0.5, direction: [up, down]}\n"
    "  grid: {contact.restitution: [0.0, 0.3]}\n"
)
SMALL = f"{FLYING}sweep: {{supply_frequency_hz: {{start: 50.0, stop: 50.5}}}}\n"


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    """The table of a sweep that was let alone, as it is read back in each format."""
    place = tmp_path_factory.mktemp("uninterrupted")
    (place / "c.yaml").write_text(CONFIGURATION)
    table = sweep(load_config(place / "c.yaml"))
    assert len(table) == POINTS
    write_table(table, place, "sweep", "csv")
    return {"parquet": table, "csv": read_table(place, "sweep")}


WRITE = "vibroplat.study.store:Store.write"


@pytest.fixture
def place(here):
    (here / "c.yaml").write_text(CONFIGURATION)
    return here


@pytest.fixture
def resumed(here, command):
    """Go on with a sweep; return what is printed, and the table."""

    def go_on(*options):
        done = command("sweep", "c.yaml", "--resume", *options)
        assert (done.code, done.err) == (0, "")
        return done.out, read_table(here / "results/c", "sweep")

    return go_on


# -- killed ---------------------------------------------------------------------------------------------


@pytest.mark.faults
@pytest.mark.parametrize(("jobs", "form"), [("1", "parquet"), ("2", "csv")])
def test_sweep_killed_three_times_ends_in_the_same_table(jobs, form, place, resumed, uninterrupted):
    options = ("sweep", "c.yaml", "--resume", "--jobs", jobs, "--format", form)
    expected = 0
    for points, after in ((1, True), (9, False), (4, True)):
        done = ended(place, *options, before=sending(signal.SIGKILL, WRITE, points, after=after))
        assert done.code == -signal.SIGKILL
        expected += points if after else points - 1
        assert finished_points(place / "results/c") == expected
    assert not list((place / "results/c").glob("sweep.*"))
    printed, table = resumed("--format", form)
    assert f", {expected} of the points from before\n" in printed
    assert bits(table) == bits(uninterrupted[form])
    assert table.dtypes.equals(uninterrupted[form].dtypes)


@pytest.mark.faults
def test_sweep_killed_before_its_first_point_can_be_resumed(place, resumed):
    (place / "c.yaml").write_text(SMALL)
    ended(place, "sweep", "c.yaml", before=sending(signal.SIGKILL, "vibroplat.study.sweep:run_sweeps"))
    assert (place / "results/c" / FILE).exists()
    assert finished_points(place / "results/c") == 0
    assert len(resumed()[1]) == 2


def test_table_lost_after_the_last_point_is_made_again(command, here):
    (here / "c.yaml").write_text(SMALL)
    assert command("sweep", "c.yaml").code == 0
    first = read_table(here / "results/c", "sweep")
    (here / "results/c/sweep.parquet").unlink()
    done = command("sweep", "c.yaml", "--resume")
    assert (done.code, done.err) == (0, "")
    again = read_table(here / "results/c", "sweep")
    assert again.equals(first)


def test_any_point_that_is_missing_is_made_again(command, here):
    """From whichever point on a branch was not finished, its rest is the same, the perturbations too."""
    (here / "c.yaml").write_text(SMALL.replace("50.5", "52.0"))
    assert command("sweep", "c.yaml").code == 0
    first = bits(read_table(here / "results/c", "sweep"))
    for point in range(5):
        with sqlite3.connect(here / "results/c" / FILE) as base:
            base.execute("DELETE FROM records WHERE second >= ?", (point,))
        base.close()
        assert command("sweep", "c.yaml", "--resume").code == 0
        assert bits(read_table(here / "results/c", "sweep")) == first


# -- ended ----------------------------------------------------------------------------------------------


@pytest.mark.faults
def test_terminated_sweep_can_be_resumed(place, resumed, uninterrupted):
    before = sending(signal.SIGTERM, WRITE, 10)
    done = ended(place, "sweep", "c.yaml", "--jobs", "2", before=before)
    assert (done.code, done.out, len(done.err.splitlines())) == (128 + signal.SIGTERM, "", 1)
    assert done.err.startswith("vibroplat: terminated; ")
    assert bits(resumed()[1]) == bits(uninterrupted["parquet"])


@pytest.mark.faults
@pytest.mark.parametrize(("signal_", "seconds"), [(signal.SIGTERM, 20.0), (signal.SIGKILL, 150.0)])
def test_no_workers_outlive_a_sweep_that_was_ended(signal_, seconds, place):
    """A killed process cannot stop its workers; they end when no more tasks come."""
    before = sending(signal_, WRITE, 10).replace("os.kill(0,", "os.kill(os.getpid(),")
    with Child(place, "sweep", "c.yaml", "--jobs", "2", before=before) as child:
        child.end()
        _, alive = psutil.wait_procs(child.members(), timeout=seconds)
        assert alive == []


# -- refused --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def begun(tmp_path_factory):
    """A sweep with one of two points missing."""
    place = tmp_path_factory.mktemp("begun")
    (place / "c.yaml").write_text(SMALL)
    assert commands.command("sweep", place / "c.yaml", "--out", place).code == 0
    with sqlite3.connect(place / "c" / FILE) as base:
        base.execute("DELETE FROM records WHERE second = 1")
        base.execute("UPDATE about SET value = '0', digest = ? WHERE key = 'finished'", (digest("finished", "0"),))
    base.close()
    (place / "c/sweep.parquet").unlink()
    return place / "c"


@pytest.fixture
def unfinished(here, begun):
    """A copy of it."""
    (here / "c.yaml").write_text(SMALL)
    return shutil.copytree(begun, here / "results/c")


def test_unfinished_sweep_is_not_begun_anew_unasked(unfinished, command):
    line = (
        "vibroplat: results/c holds 1 points of unfinished work; "
        "allowed: --resume to continue it, --overwrite to start again\n"
    )
    assert command("sweep", "c.yaml") == (2, "", line)
    assert finished_points(unfinished) == 1


def test_overwrite_begins_anew(unfinished, command, here):
    done = command("sweep", "c.yaml", "--overwrite", "--set", "sweep.seed=3")
    assert (done.code, done.err) == (0, "")
    assert "points of them from before" not in done.out
    overwritten = bits(read_table(unfinished, "sweep"))
    fresh = command("sweep", "c.yaml", "--set", "sweep.seed=3", "--out", "fresh")
    assert fresh.code == 0
    assert bits(read_table(here / "fresh/c", "sweep")) == overwritten


def test_finished_sweep_may_be_begun_anew(command, here):
    (here / "c.yaml").write_text(SMALL)
    for seed in (0, 1):
        assert command("sweep", "c.yaml", "--set", f"sweep.seed={seed}").code == 0


@pytest.mark.parametrize(
    ("setting", "found", "wanted"),
    [
        ("sweep.measure_s=3.0", "2.0", "3.0"),
        ("sweep.seed=1", "0", "1"),
        ("sweep.supply_frequency_hz.stop=51.0", "50.5", "51.0"),
        ("sweep.grid={contact.restitution: [0.1]}", "{}", None),
        ("machine.platform_mass_kg=12.5", "12.42", "12.5"),
        ("solver.tolerance=1e-7", "1e-06", "1e-07"),
        ("contact.impact_law=central", "conservative", "central"),
        ("material.layers=1", "2", "1"),
    ],
)
def test_changed_configuration_is_not_resumed_and_the_key_is_named(setting, found, wanted, unfinished, command):
    done = command("sweep", "c.yaml", "--resume", "--set", setting)
    assert (done.code, done.out, len(done.err.splitlines())) == (2, "", 1)
    key = setting.partition("=")[0]
    assert key in done.err
    assert f"allowed: {found}" in done.err
    assert wanted is None or f"= {wanted}; " in done.err
    assert finished_points(unfinished) == 1


def test_finished_sweep_is_not_resumed_under_another_configuration(unfinished, command):
    assert command("sweep", "c.yaml", "--resume").code == 0
    done = command("sweep", "c.yaml", "--resume", "--set", "sweep.measure_s=3.0")
    assert (done.code, done.out, len(done.err.splitlines())) == (2, "", 1)
    assert "sweep.measure_s = 3.0; allowed: 2.0" in done.err
    assert finished_points(unfinished) == 2


def test_other_version_is_not_resumed(unfinished, command, monkeypatch):
    monkeypatch.setattr("vibroplat.__version__", "9.9.9")
    done = command("sweep", "c.yaml", "--resume")
    assert (done.code, len(done.err.splitlines())) == (2, 1)
    assert "vibroplat = 9.9.9; allowed: 0." in done.err


def test_resume_of_nothing_begins(command, here):
    (here / "c.yaml").write_text(SMALL)
    done = command("sweep", "c.yaml", "--resume")
    assert (done.code, done.err) == (0, "")


@pytest.mark.parametrize("options", [(), ("--resume",), ("--overwrite",)])
def test_file_that_is_no_database_is_told_in_a_line_and_left_alone(options, command, here):
    (here / "c.yaml").write_text(SMALL)
    (here / "results/c").mkdir(parents=True)
    (here / "results/c" / FILE).write_text("hello\n" * 1000)
    line = f"vibroplat: results/c/{FILE} is damaged (file is not a database); remove it to start again\n"
    assert command("sweep", "c.yaml", *options) == (1, "", line)
    assert (here / "results/c" / FILE).read_text() == "hello\n" * 1000


def test_database_of_another_program_is_told_in_a_line(command, here):
    (here / "c.yaml").write_text(SMALL)
    (here / "results/c").mkdir(parents=True)
    with sqlite3.connect(here / "results/c" / FILE) as base:
        base.execute("CREATE TABLE about (x)")
    base.close()
    done = command("sweep", "c.yaml")
    assert (done.code, done.out, len(done.err.splitlines())) == (2, "", 1)
    assert done.err.startswith(f"vibroplat: results/c/{FILE} cannot be used: ")


def test_directory_in_the_place_of_the_file_is_told_in_a_line(command, here):
    (here / "c.yaml").write_text(SMALL)
    (here / "results/c" / FILE).mkdir(parents=True)
    done = command("sweep", "c.yaml")
    assert (done.code, done.out) == (2, "")
    assert done.err == f"vibroplat: results/c/{FILE} cannot be used: unable to open database file\n"


def test_output_that_is_a_file_is_told_in_a_line(command, here):
    (here / "c.yaml").write_text(SMALL)
    line = "vibroplat: output c.yaml/c is not writable: Not a directory\n"
    assert command("sweep", "c.yaml", "--out", "c.yaml") == (2, "", line)


def test_output_that_must_not_be_written_is_told_in_a_line(command, here):
    (here / "c.yaml").write_text(SMALL)
    (here / "results").mkdir(mode=0o555)
    if os.access(here / "results", os.W_OK):
        pytest.skip("this user may write everywhere")
    line = "vibroplat: output results/c is not writable: Permission denied\n"
    assert command("sweep", "c.yaml") == (2, "", line)


# -- the store itself -----------------------------------------------------------------------------------


def test_records_are_read_in_the_order_of_their_numbers(tmp_path):
    with Store(tmp_path, {}) as store:
        for first, second in ((1, 0), (0, 2), (0, 10), (0, 1)):
            store.write(first, second, {"at": [first, second]})
        assert [second for second, _ in store.read(0)] == [1, 2, 10]
        assert list(store.read(1)) == [(0, {"at": [1, 0]})]
        assert (list(store.read(2)), len(store)) == ([], 4)


def test_numbers_are_kept_bit_for_bit(tmp_path):
    numbers = [0.1 + 0.2, -0.0, 5e-324, math.pi, 1.7976931348623157e308, -1.0 / 3.0]
    with Store(tmp_path, {}) as store:
        store.write(0, 0, {"state": numbers})
    with Store(tmp_path, {}, resume=True) as store:
        ((_, record),) = store.read(0)
    assert [n.hex() for n in record["state"]] == [n.hex() for n in numbers]


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_numbers_that_are_not_finite_are_refused(value, tmp_path):
    with Store(tmp_path, {}) as store, pytest.raises(ValueError, match="not JSON compliant"):
        store.write(0, 0, {"state": [value]})


def test_record_is_on_disk_when_it_was_written(tmp_path):
    with Store(tmp_path, {}) as store:
        for k in range(3):
            store.write(0, k, {})
            assert finished_points(tmp_path) == k + 1


def test_first_condition_that_differs_is_named(tmp_path):
    conditions = {"a": {"b": 1, "c": [1, 2]}, "d": "text", "e": None}
    with Store(tmp_path, conditions) as store:
        store.write(0, 0, {})
    same = json.loads(json.dumps(conditions))
    with Store(tmp_path, same, resume=True) as store:
        assert len(store) == 1
    for changed, line in (
        ({**conditions, "a": {"b": 2, "c": [1, 2]}}, "a.b = 2; allowed: 1, as in the finished points"),
        ({**conditions, "a": {"b": 1, "c": [1]}}, "a.c = [1]; allowed: [1, 2], as in the finished points"),
        ({**conditions, "a": {"c": [1]}}, "a.b = None; allowed: 1, as in the finished points (and 1 more)"),
        ({**conditions, "f": True}, "f = True; allowed: None, as in the finished points"),
    ):
        with pytest.raises(ConfigError) as caught:
            Store(tmp_path, changed, resume=True)
        assert str(caught.value) == f"cannot resume: {line}"


def test_finished_work_is_finished_when_resumed(tmp_path):
    with Store(tmp_path, {}) as store:
        store.write(0, 0, {})
        store.finish()
    Store(tmp_path, {}, resume=True).close()
    Store(tmp_path, {}).close()
    assert finished_points(tmp_path) == 0


def test_store_in_memory_writes_no_file(here):
    with Store(None, {}) as store:
        store.write(0, 0, {})
        assert len(store) == 1
    assert list(here.iterdir()) == []
