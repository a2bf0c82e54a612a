"""Stored points that are damaged or lost: the same table, or one line; never another table."""

from __future__ import annotations

import random
import shutil
import signal
import sqlite3
from contextlib import closing

import pytest
from common.commands import command, ended, not_a_line
from common.places import FLYING
from common.results import bits, finished_points

from vibroplat.results.tables import read_table
from vibroplat.study import point
from vibroplat.study.store import FILE, SpoiledError, Store

pytestmark = pytest.mark.usefixtures("kernels")

CONFIGURATION = (
    f"{FLYING}sweep:\n"
    "  supply_frequency_hz: {start: 46.0, stop: 48.0, direction: [up, down]}\n"
    "  measure_s: 0.3\n"
    "  settle_s: 0.5\n"
    "  lyapunov: false\n"
)
POINTS = 10
#: Points that are stored when the unfinished sweep is killed.
KILLED = 7


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A finished sweep without its table, and the bits of the table."""
    place = tmp_path_factory.mktemp("finished")
    (place / "c.yaml").write_text(CONFIGURATION)
    assert command("sweep", place / "c.yaml", "--out", place).code == 0
    table = bits(read_table(place / "c", "sweep"))
    (place / "c/sweep.parquet").unlink()
    return place / "c", table


@pytest.fixture(scope="module")
def killed(tmp_path_factory):
    """A sweep that was killed: its last points are in the write-ahead log."""
    place = tmp_path_factory.mktemp("killed")
    (place / "c.yaml").write_text(CONFIGURATION)
    before = killing_at(KILLED)
    assert ended(place, "sweep", "c.yaml", before=before).code == -signal.SIGKILL
    log = place / f"results/c/{FILE}-wal"
    assert log.stat().st_size > 1000
    return place / "results/c"


def killing_at(number):
    """Text of a program that is killed when it has stored so many points."""
    return (
        "import os, signal\nfrom vibroplat.study.store import Store\nwrite, written = Store.write, []\n"
        "def killing(*arguments):\n    write(*arguments)\n    written.append(1)\n"
        f"    if len(written) == {number}:\n        os.kill(os.getpid(), signal.SIGKILL)\nStore.write = killing"
    )


@pytest.fixture
def result(here):
    """Copy a sweep to where it is resumed."""
    (here / "c.yaml").write_text(CONFIGURATION)

    def copy(source):
        shutil.rmtree(here / "results", ignore_errors=True)
        return shutil.copytree(source, here / "results/c")

    return copy


def resumed(directory, caplog):
    """Resume a sweep; return its table and what was said."""
    caplog.clear()
    done = command("sweep", "c.yaml", "--resume")
    assert (done.code, done.err) == (0, "")
    return bits(read_table(directory, "sweep")), [r.getMessage() for r in caplog.records], done.out


def changed(directory, *statements):
    """Change the store by SQL."""
    with closing(sqlite3.connect(directory / FILE)) as base, base:
        for statement in statements:
            base.execute(statement)


# -- single records -------------------------------------------------------------------------------------


@pytest.mark.parametrize("place", [0, 2, 4])
def test_deleted_record_is_computed_again_and_said(place, finished, result, caplog):
    directory = result(finished[0])
    changed(directory, f"DELETE FROM records WHERE first = 1 AND second = {place}")
    table, said, printed = resumed(directory, caplog)
    assert table == finished[1]
    assert said == [f"results/c/{FILE}: 1 of {POINTS} records damaged or missing; computing them again"]
    assert f", {POINTS - 1} of the points from before\n" in printed


@pytest.mark.parametrize(
    "change",
    [
        "record = replace(record, '0.', '1.')",
        "record = substr(record, 1, 100)",
        "record = NULL",
        "record = x'ff00'",
        "record = 7",
        "digest = NULL",
        "digest = (SELECT digest FROM records WHERE first = 1 AND second = 0)",
        "task = 'another'",
        "second = 17",
        "first = '0'",
        "second = NULL",
    ],
)
def test_changed_record_is_computed_again_and_said(change, finished, result, caplog):
    directory = result(finished[0])
    changed(directory, f"UPDATE records SET {change} WHERE first = 0 AND second = 1")
    table, said, _ = resumed(directory, caplog)
    assert table == finished[1]
    assert said == [f"results/c/{FILE}: 1 of {POINTS} records damaged or missing; computing them again"]


def test_records_in_each_others_places_are_computed_again(finished, result, caplog):
    directory = result(finished[0])
    changed(
        directory,
        "UPDATE records SET second = second + 100 WHERE first = 0",
        "UPDATE records SET second = 104 - second WHERE first = 0",
    )
    table, said, _ = resumed(directory, caplog)
    assert table == finished[1]
    assert len(said) == 1


def test_only_what_follows_from_another_state_is_computed_again(finished, result, caplog, monkeypatch):
    """A record that is made anew is the same, so those after it stay; if it were another one, they would not."""
    directory = result(finished[0])
    changed(directory, "DELETE FROM records WHERE first = 0 AND second = 1")
    measure = point.measure_point

    def another(*arguments):
        found = measure(*arguments)
        found.state[0] += 1e-6
        return found

    another.__module__, another.__qualname__ = measure.__module__, measure.__qualname__
    monkeypatch.setattr(point, "measure_point", another)
    caplog.clear()
    done = command("sweep", "c.yaml", "--resume")
    assert done.code == 0
    assert f", {POINTS - 4} of the points from before\n" in done.out
    assert [record.getMessage().partition(": ")[2] for record in caplog.records] == [
        f"1 of {POINTS} records damaged or missing; computing them again",
        "some records do not follow from those before them; computing them again",
    ]


def test_record_that_is_damaged_before_the_table_is_written_ends_in_a_line(finished, result, monkeypatch):
    directory = result(finished[0])
    finish = Store.finish
    for statement, told in (
        (
            "UPDATE records SET record = '{}' WHERE first = 1 AND second = 3",
            "a record is damaged",
        ),
        (
            "DELETE FROM records WHERE first = 1 AND second = 2",
            "point 2 of branch 1 is not stored",
        ),
    ):

        def losing(store, statement=statement):
            finish(store)
            store._base.execute(statement)
            store._base.commit()

        monkeypatch.setattr(Store, "finish", losing)
        done = command("sweep", "c.yaml", "--resume")
        assert not_a_line(done, codes=(1,)) == ""
        assert told in done.err
        assert not list(directory.glob("sweep.*"))


# -- the file -------------------------------------------------------------------------------------------


def test_store_of_the_former_format_is_refused(here):
    (here / "c.yaml").write_text(CONFIGURATION)
    (here / "results/c").mkdir(parents=True)
    with closing(sqlite3.connect(here / "results/c" / FILE)) as base, base:
        base.execute("CREATE TABLE about (key TEXT PRIMARY KEY, value TEXT)")
        base.execute("CREATE TABLE records (first, second INTEGER, record TEXT, PRIMARY KEY (first, second))")
    for option in ((), ("--resume",), ("--overwrite",)):
        done = command("sweep", "c.yaml", *option)
        assert done == (
            2,
            "",
            f"vibroplat: results/c/{FILE} cannot be used: its format is 0, this version reads 2; "
            "remove it to start again\n",
        )


@pytest.mark.parametrize("damage", ["header", "page", "half", "conditions"])
def test_store_that_is_damaged_as_a_whole_is_told_in_a_line(damage, finished, result):
    directory = result(finished[0])
    file = directory / FILE
    data = file.read_bytes()
    if damage == "conditions":
        changed(directory, "UPDATE about SET value = replace(value, '12.42', '12.43')")
    else:
        third = 4096 * 2
        file.write_bytes(
            {
                "header": bytes(100) + data[100:],
                "page": data[:third] + bytes(4096) + data[third + 4096 :],
                "half": data[: len(data) // 2],
            }[damage]
        )
    for options in (("--resume",), ("--overwrite",), ()):
        done = command("sweep", "c.yaml", *options)
        assert not_a_line(done, codes=(1,)) == ""
        assert done.err.startswith(f"vibroplat: results/c/{FILE} is damaged (")
        assert done.err.endswith("); remove it to start again\n")
    file.unlink()
    assert command("sweep", "c.yaml").code == 0
    assert bits(read_table(directory, "sweep")) == finished[1]


def flips(quick, more):
    return [pytest.param(quick, id=str(quick)), pytest.param(more, id=str(more), marks=pytest.mark.long)]


@pytest.mark.parametrize("number", flips(4, 250))
def test_flipped_bit_in_a_finished_store_never_changes_the_table(number, finished, result, caplog):
    flip_and_resume(number, [(finished[0], FILE)], finished[1], result, caplog)


@pytest.mark.faults
@pytest.mark.parametrize("number", flips(4, 250))
def test_flipped_bit_in_an_unfinished_store_never_changes_the_table(number, killed, finished, result, caplog):
    """Half of the bits are in the write-ahead log, the others in the file after the log was taken into it."""
    taken_in = shutil.copytree(killed, killed.with_name("taken in"), dirs_exist_ok=True)
    with closing(sqlite3.connect(taken_in / FILE)) as base:
        assert base.execute("SELECT COUNT(*) FROM records").fetchone() == (KILLED,)
    assert not (taken_in / f"{FILE}-wal").exists()
    flip_and_resume(number, [(killed, f"{FILE}-wal"), (taken_in, FILE)], finished[1], result, caplog)


def flip_and_resume(number, sources, table, result, caplog):
    """Flip one random bit after the other, each in a fresh copy, and count how a sweep goes on."""
    chance = random.Random(number)
    counts = {"as before": 0, "said": 0, "refused": 0}
    for k in range(number):
        source, name = sources[k % len(sources)]
        directory = result(source)
        file = directory / name
        data = bytearray(file.read_bytes())
        bit = chance.randrange(8 * len(data))
        data[bit // 8] ^= 1 << bit % 8
        file.write_bytes(data)
        caplog.clear()
        done = command("sweep", "c.yaml", "--resume")
        where = f"{file.name}, bit {bit}: {done.err}"
        if done.code:
            assert not_a_line(done, codes=(1, 2)) == "", where
            assert not list(directory.glob("sweep.*")), where
            counts["refused"] += 1
        else:
            assert bits(read_table(directory, "sweep")) == table, where
            counts["said" if caplog.records else "as before"] += 1
    print(counts)


# -- the store itself -----------------------------------------------------------------------------------


def test_damaged_record_is_not_read(tmp_path):
    with Store(tmp_path, {}) as store:
        store.write(0, 0, {"v": 1.0}, "task")
        store._base.execute("UPDATE records SET record = '{\"v\": 2.0}'")
        assert store.find(0, 0, "task") is None
        with pytest.raises(SpoiledError, match="a record is damaged"):
            list(store.read(0))


def test_record_of_another_task_is_not_found(tmp_path):
    with Store(tmp_path, {}) as store:
        store.write("a", 0, {"v": 1.0}, "task")
        assert store.find("a", 0, "another") is None
        assert store.find("a", 0, "task") == {"v": 1.0}
        assert (store.reused, finished_points(tmp_path)) == (1, 1)
