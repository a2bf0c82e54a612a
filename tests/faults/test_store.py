"""Finished points outlive the process, and damaged or lost ones are seen: the same table or one line, never another."""

import json
import math
import os
import shutil
import signal
import sqlite3
import tempfile
from contextlib import closing
from pathlib import Path

import psutil
import pytest
from common.commands import Child, command, ended, not_a_line, sending
from common.places import FLYING
from common.results import bits, finished_points

from vibroplat.errors import ConfigError, TableError
from vibroplat.results.tables import read_table
from vibroplat.study import sweep
from vibroplat.study.fingerprint import package
from vibroplat.study.store import CorruptRecordError, Store, digest
from vibroplat.system.interrupts import RESUMABLE, offer_resume, records_kept

pytestmark = pytest.mark.usefixtures("kernels")

PLAN = "direction: [up, down]}, measure_s: 0.3, lyapunov: false}\n"
CONFIGURATION = f"{FLYING}sweep: {{supply_frequency_hz: {{start: 46.0, stop: 47.0, {PLAN}"
POINTS = 6
#: A sweep of 22 points.
LONGER = CONFIGURATION.replace("47.0", "51.0")
WRITE = "vibroplat.study.store:Store.write"
FILE = "points.sqlite"
STORED = f"results/c/sweep/{FILE}"


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A finished sweep without its table, and the bits of the table."""
    place = tmp_path_factory.mktemp("finished")
    (place / "c.yaml").write_text(CONFIGURATION)
    assert command("sweep", place / "c.yaml", "--out", place).code == 0
    table = bits(read_table(place / "c/sweep", "sweep"))
    (place / "c/sweep/sweep.parquet").unlink()
    return place / "c/sweep", table


@pytest.fixture
def result(here, finished):
    (here / "c.yaml").write_text(CONFIGURATION)

    def copy():
        shutil.rmtree(here / "results", ignore_errors=True)
        return shutil.copytree(finished[0], here / "results/c/sweep")

    return copy


@pytest.fixture
def unfinished(result):
    directory = result()
    changed(
        directory,
        "DELETE FROM records WHERE first = 1 OR second > 0",
        f"UPDATE about SET value = '0', digest = '{digest('finished', '0')}' WHERE key = 'finished'",
    )
    return directory


def changed(directory, *statements):
    with closing(sqlite3.connect(directory / FILE)) as base, base:
        for statement in statements:
            base.execute(statement)


def resumed(directory, caplog):
    caplog.clear()
    done = command("sweep", "c.yaml", "--resume")
    assert (done.code, done.err) == (0, "")
    return bits(read_table(directory, "sweep")), [r.getMessage() for r in caplog.records], done.out


@pytest.mark.faults
def test_sweep_that_was_killed_goes_on_to_the_same_table_and_no_worker_outlives_it(here):
    """A killed process cannot stop its workers; they end by themselves."""
    (here / "c.yaml").write_text(LONGER)
    with Child(here, "sweep", "c.yaml", "--jobs", "2", before=sending(signal.SIGKILL, WRITE, 10)) as child:
        assert child.end().code == -signal.SIGKILL
        orphans = child.members()
        assert command("sweep", "c.yaml", "--out", "alone").code == 0
        assert finished_points(here / "results/c/sweep") == 9
        kill = sending(signal.SIGKILL, WRITE, 4, after=True)
        assert ended(here, "sweep", "c.yaml", "--resume", before=kill).code == -signal.SIGKILL
        assert not list((here / "results/c/sweep").glob("sweep.*"))
        done = command("sweep", "c.yaml", "--resume")
        assert ": 13 tasks from before; " in done.out
        table, alone = (read_table(here / place, "sweep") for place in ("results/c/sweep", "alone/c/sweep"))
        assert bits(table) == bits(alone)
        assert table.dtypes.equals(alone.dtypes)
        _, alive = psutil.wait_procs(orphans, timeout=60.0)
        assert alive == []


def test_unfinished_sweep_is_begun_anew_only_if_asked(unfinished, here):
    line = (
        "vibroplat: results/c/sweep holds 1 tasks of unfinished work; "
        "allowed: --resume to continue it, --overwrite to start again\n"
    )
    assert command("sweep", "c.yaml") == (2, "", line)
    assert finished_points(unfinished) == 1
    done = command("sweep", "c.yaml", "--overwrite", "--set", "sweep.seed=3")
    assert (done.code, done.err) == (0, "")
    assert "tasks from before" not in done.out
    overwritten = bits(read_table(unfinished, "sweep"))
    # finished work may be begun anew, and what is not there can be resumed
    for option in ("--overwrite", "--resume"):
        assert command("sweep", "c.yaml", "--set", "sweep.seed=3", "--out", "fresh", option).code == 0
    assert bits(read_table(here / "fresh/c/sweep", "sweep")) == overwritten
    assert command("sweep", "c.yaml").code == 0


def test_sweep_under_other_conditions_is_not_resumed_and_the_first_is_named(unfinished, monkeypatch):
    """Points of other sources or arithmetic look alike and differ."""
    done = command("sweep", "c.yaml", "--resume", "--set", "machine.platform_mass_kg=12.5")
    assert not_a_line(done) == ""
    assert "machine.platform_mass_kg = 12.5; allowed: 12.42" in done.err
    others = package() | {"source files": "others"}
    for what, where, found in (
        ("arithmetic", "vibroplat.study.fingerprint.arithmetic", lambda _engine: "others"),
        ("source files", "vibroplat.study.study.package", lambda: others),
    ):
        monkeypatch.setattr(where, found)
        done = command("sweep", "c.yaml", "--resume")
        assert (done.code, done.out) == (2, "")
        assert f"cannot resume: {what} = others; allowed: " in done.err
    assert finished_points(unfinished) == 1
    assert not_a_line(command("sweep", "c.yaml", "--resume", "--overwrite")) == ""


DAMAGE = (
    "record = replace(record, '0.', '1.')",
    "record = NULL",
    "digest = (SELECT digest FROM records WHERE first = 1 AND second = 0)",
    "task = 'another'",
    "second = 17",
    "record = '{}'",
)


@pytest.mark.parametrize("kinds", [DAMAGE[k::2] for k in range(2)], ids="ab")
def test_damaged_records_are_computed_again_and_said(kinds, finished, result, caplog):
    """Each kind of damage to a record of its own."""
    directory = result()
    places = [(0, 1), (0, 2), (1, 1)]
    for kind, (first, second) in zip(kinds, places, strict=True):
        changed(directory, f"UPDATE records SET {kind} WHERE first = {first} AND second = {second}")
    table, said, printed = resumed(directory, caplog)
    assert table == finished[1]
    assert said == [f"{STORED}: 3 of {POINTS} records damaged or missing; computing them again"]
    assert f": {POINTS - 3} tasks from before; " in printed


def test_only_what_follows_from_another_state_is_computed_again(result, caplog, monkeypatch):
    """A record that is made anew is the same, so those after it stay; if it were another one, they would not."""
    directory = result()
    changed(directory, "DELETE FROM records WHERE first = 0 AND second = 1")
    measure = sweep.measure_point

    def another(*arguments):
        found = measure(*arguments)
        found.state[0] += 1e-6
        return found

    another.__module__, another.__qualname__ = measure.__module__, measure.__qualname__
    monkeypatch.setattr(sweep, "measure_point", another)
    _, said, printed = resumed(directory, caplog)
    assert f": {POINTS - 2} tasks from before; " in printed
    assert [line.partition(": ")[2] for line in said] == [
        f"1 of {POINTS} records damaged or missing; computing them again",
        "some records do not follow from those before them; computing them again",
    ]


def test_store_that_is_damaged_as_a_whole_is_told_in_a_line(finished, result):
    page = 4096
    for damage in (
        lambda data: bytes(100) + data[100:],  # the header
        lambda data: data[: 2 * page] + bytes(page) + data[3 * page :],
        lambda data: data[: len(data) // 2],
        None,
    ):
        file = result() / FILE
        if damage is None:
            changed(file.parent, "UPDATE about SET value = replace(value, '12.42', '12.43')")
        else:
            file.write_bytes(damage(file.read_bytes()))
        for option in ("--resume", "--overwrite"):
            done = command("sweep", "c.yaml", option)
            assert not_a_line(done, codes=(1,)) == ""
            assert done.err.startswith(f"vibroplat: {STORED} is damaged (")
            assert done.err.endswith("); remove it to start again\n")
    file.unlink()
    assert command("sweep", "c.yaml").code == 0
    assert bits(read_table(file.parent, "sweep")) == finished[1]


def test_file_that_is_no_store_is_told_and_left_alone(tmp_path):
    file = tmp_path / FILE
    file.write_text("hello\n" * 1000)
    for how in ({}, {"overwrite": True}):
        with pytest.raises(
            CorruptRecordError, match=r" is damaged \(file is not a database\); remove it to start again$"
        ):
            Store(tmp_path, {}, **how)
    assert file.read_text() == "hello\n" * 1000
    file.unlink()
    changed(tmp_path, "CREATE TABLE records (first, second INTEGER, record TEXT)")  # the format of former versions
    told = f"{file} cannot be used: its format is 0, this version reads 3; remove it to start again"
    with pytest.raises(TableError, match=f"^{told}$"):
        Store(tmp_path, {})
    file.unlink()
    file.mkdir()
    with pytest.raises(TableError, match=f"^{file} cannot be used: Is a directory$"):
        Store(tmp_path, {})


def test_records_are_read_in_the_order_of_their_numbers(tmp_path):
    with Store(tmp_path, {}) as store:
        for count, (first, second) in enumerate(((1, 0), (0, 2), (0, 10), (0, 1)), 1):
            store.write(first, second, {"at": [first, second]})
            assert finished_points(tmp_path) == count  # on disk at once
        assert [second for second, _ in store.read(0)] == [1, 2, 10]
        assert list(store.read(1)) == [(0, {"at": [1, 0]})]
        assert (list(store.read(2)), len(store)) == ([], 4)
        for name in ("r", "R"):  # names are not those of files
            store.write(name, 0, {"of": name})
        assert [list(store.read(name)) for name in ("r", "R")] == [[(0, {"of": "r"})], [(0, {"of": "R"})]]


def test_numbers_are_kept_bit_for_bit(tmp_path):
    numbers = [0.1 + 0.2, -0.0, 5e-324, math.pi, 1.7976931348623157e308, -1.0 / 3.0]
    with Store(tmp_path, {}) as store:
        store.write(0, 0, {"state": numbers})
        for value in (math.nan, math.inf):
            with pytest.raises(ValueError, match="not JSON compliant"):
                store.write(0, 1, {"state": [value]})
    with Store(tmp_path, {}, resume=True) as store:
        ((_, record),) = store.read(0)
    assert [n.hex() for n in record["state"]] == [n.hex() for n in numbers]


def test_record_of_another_task_is_not_found_and_a_damaged_one_not_read(tmp_path):
    with Store(tmp_path, {}) as store:
        store.write("a", 0, {"v": 1.0}, "task")
        assert store.get("a", 0, "another") is None
        assert store.get("a", 0, "task") == {"v": 1.0}
        assert (store.reused, finished_points(tmp_path)) == (1, 1)
        store._base.execute("UPDATE records SET record = '{\"v\": 2.0}'")
        with pytest.raises(CorruptRecordError, match="a record is damaged"):
            list(store.read("a"))


def test_first_condition_that_differs_is_named(tmp_path):
    conditions = {"a": {"b": 1, "c": [1, 2]}, "d": "text", "e": None}
    with Store(tmp_path, conditions) as store:
        store.write(0, 0, {})
    with Store(tmp_path, json.loads(json.dumps(conditions)), resume=True) as store:
        assert len(store) == 1
    for changed_, line in (
        ({**conditions, "a": {"b": 2, "c": [1, 2]}}, "a.b = 2; allowed: 1, as in the finished tasks"),
        ({**conditions, "a": {"b": 1, "c": [1]}}, "a.c = [1]; allowed: [1, 2], as in the finished tasks"),
        ({**conditions, "a": {"c": [1]}}, "a.b = None; allowed: 1, as in the finished tasks (and 1 more)"),
        ({**conditions, "f": True}, "f = True; allowed: None, as in the finished tasks"),
    ):
        with pytest.raises(ConfigError) as caught:
            Store(tmp_path, changed_, resume=True)
        assert str(caught.value) == f"cannot resume: {line}, or --overwrite to start again"


def test_store_that_does_not_say_what_its_records_depend_on_is_refused(tmp_path):
    with Store(tmp_path, {"a": 1}) as store:
        store.write(0, 0, {})
        store._base.execute("DELETE FROM about")
        store._base.commit()
    for how in ({"resume": True}, {}):
        with pytest.raises(CorruptRecordError, match="it does not contain the conditions of its records"):
            Store(tmp_path, {"a": 1}, **how)
    with Store(tmp_path, {"a": 1}, overwrite=True) as store:
        assert len(store) == 0


def test_other_code_is_told_after_other_conditions_and_needs_no_refusal_where_nothing_is_stored(tmp_path):
    begun = {"source files": "a", "configuration": {"x": 1}}
    with Store(tmp_path, begun) as store:
        store.write(0, 0, {})
    changed_ = {"source files": "b", "configuration": {"x": 2}}
    with pytest.raises(
        ConfigError, match=r"^cannot resume: configuration\.x = 2; allowed: 1, as in .* \(and 1 more\), or"
    ):
        Store(tmp_path, changed_, resume=True)
    with Store(tmp_path, begun, overwrite=True) as store:
        assert len(store) == 0
        store.require("arithmetic", "here")  # known later
    with Store(tmp_path, begun | {"source files": "b"}, resume=True) as store:
        store.require("arithmetic", "there")
        store.write(0, 0, {})
        with pytest.raises(ConfigError, match=r"^cannot resume: arithmetic = here; allowed: there, as in the finished"):
            store.require("arithmetic", "here")


@pytest.mark.parametrize(("folder", "mode"), [(0o2775, 0o664), (0o755, 0o644)])
def test_files_of_a_study_can_be_written_by_those_who_can_write_their_folder(folder, mode, tmp_path):
    """SQLite and a umask of 022 would keep them from the group."""
    tmp_path.chmod(folder)
    before = os.umask(0o022)
    try:
        with Store(tmp_path, {}):
            modes = {path.name: path.stat().st_mode & 0o777 for path in tmp_path.iterdir()}
    finally:
        os.umask(before)
    assert modes == dict.fromkeys((f"points.{end}" for end in ("lock", "sqlite", "sqlite-shm", "sqlite-wal")), mode)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can be two users")
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_an_attempt_of_another_user_leaves_nothing(tmp_path):
    """The database of a former version can be written by its owner alone; its lock can be taken by the group."""

    def as_user(number, conditions):
        child = os.fork()
        if child == 0:
            os.setgroups([])
            os.setgid(40_000)
            os.setuid(number)
            try:
                Store(place, conditions, resume=True).close()
                os._exit(0)
            except TableError as error:
                os._exit(3 if str(error) == f"{place / 'points.sqlite'} cannot be used: Permission denied" else 4)
            finally:
                os._exit(5)
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])

    with tempfile.TemporaryDirectory() as made:  # other users cannot enter pytest's
        place = Path(made)
        os.chown(place, 40_001, 40_000)
        place.chmod(0o2775)
        assert as_user(40_001, {}) == 0
        assert as_user(40_002, {}) == 0
        (place / "points.sqlite").chmod(0o644)
        assert as_user(40_002, {}) == 3
        assert {path.name for path in place.iterdir()} == {"points.sqlite", "points.lock"}
        assert as_user(40_001, {}) == 0
        (place / "points.sqlite").unlink()
        assert as_user(40_002, {0: object()}) == 5  # conditions that cannot be kept
        assert {path.name for path in place.iterdir()} == {"points.lock"}


@pytest.mark.parametrize(("promised", "then"), [(False, RESUMABLE), (None, "")])
def test_resume_is_promised_once_a_point_is_stored(promised, then, tmp_path):
    """A program, which has no command, promises nothing."""
    offer_resume(promised)
    try:
        with Store(tmp_path, {}) as store:
            assert RESUMABLE not in records_kept()
            store.write("a", 0, {"x": 1.0})
        assert records_kept().removeprefix("; ") == then
    finally:
        offer_resume(None)
