"""Two commands write into one folder: what is read is of one of them, and no file that may be in use is removed."""

import os
import subprocess
import sys
import time
from contextlib import ExitStack, suppress

import pandas as pd
import pytest
from common.places import ROOT

from vibroplat.errors import TableError
from vibroplat.results import locks
from vibroplat.results.files import SCHEMA, SavedFiles, write_result
from vibroplat.results.locks import Lock
from vibroplat.results.tables import FORMATS, read_table, write_table
from vibroplat.study.store import Store

TABLE = pd.DataFrame({"v": [1.0, 2.0]})


def write(directory, mark_, form="parquet", command_="run"):
    """Write a result all of whose files bear a mark."""
    table = pd.DataFrame({"v": [float(mark_)] * 200})
    found = {"trajectory": table, "events": table} if command_ == "run" else {"section": table, "sweep": table}
    documents = {"summary": {"v": mark_}} if command_ == "run" else {}
    write_result(directory, command_, {"schema": SCHEMA, "v": mark_}, found, documents, form=form)


def marks(directory):
    result = SavedFiles(directory, "run")
    found = {result.table(name)["v"].iloc[0] for name in ("trajectory", "events")}
    return found | {float(result.document("summary")["v"]), float(result.provenance["v"])}


#: A process that writes one result after the other, and takes its time between two files.
WRITER = """
import os, random, sys, time
sys.path.insert(0, {tests!r})
from pathlib import Path
from faults.test_two_writers import write
from vibroplat.errors import TableError
from vibroplat.results import files as results
replace = os.replace
def slowly(*arguments):
    time.sleep(random.uniform(0.0, 0.003))
    replace(*arguments)
os.replace = slowly
if {alone}:
    import contextlib
    assert results.replacement_lock  # the name that writers use
    results.replacement_lock = lambda directory: contextlib.nullcontext()
own, number = {own}, 0
print("ready", flush=True)
sys.stdin.readline()
while number < {rounds}:
    number += 1
    try:
        write(Path({place!r}), 1000 * own + number, random.choice(["parquet", "csv"]))
    except TableError:
        assert {alone}
"""


def race(place, rounds, *, alone=False):
    """Let two processes write into a directory; return what readers have found meanwhile."""
    with ExitStack() as stack:
        writers = []
        for own in (1, 2):
            text = WRITER.format(tests=str(ROOT / "tests"), place=str(place), own=own, rounds=rounds, alone=alone)
            line = [sys.executable, "-c", text]
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
            writers.append(stack.enter_context(subprocess.Popen(line, **pipes)))
        for process in writers:
            assert process.stdout.readline() == "ready\n"
        for process in writers:
            process.stdin.write("go\n")
            process.stdin.flush()
        found = []
        while any(process.poll() is None for process in writers):
            with suppress(TableError):
                found.append(marks(place))
        assert [process.wait() for process in writers] == [0, 0]
    return found


@pytest.mark.long
def test_two_runs_into_one_folder_leave_the_files_of_one(tmp_path):
    found = race(tmp_path, 40)
    assert {len(one) for one in [*found, marks(tmp_path)]} == {1}
    assert not list(tmp_path.glob(".*"))


@pytest.mark.long
def test_without_locks_no_mixture_of_two_runs_is_read(tmp_path):
    """As on a file system without locks: files may be mixed, but that is seen."""
    assert {len(one) for one in race(tmp_path, 40, alone=True)} <= {1}


@pytest.mark.parametrize("form", FORMATS)
def test_table_in_the_other_format_that_was_left_behind_is_not_read(form, tmp_path):
    write(tmp_path, 1, FORMATS[form == "parquet"])
    old = tmp_path / f"trajectory.{FORMATS[form == 'parquet']}"
    kept = old.read_bytes()
    write(tmp_path, 2, form)
    old.write_bytes(kept)
    assert marks(tmp_path) == {2.0}


@pytest.mark.parametrize("form", FORMATS)
def test_no_flipped_bit_of_a_result_is_read(form, tmp_path):
    write(tmp_path, 1, form)
    for name in (f"trajectory.{form}", "summary.json"):
        good = (tmp_path / name).read_bytes()
        for bit in range(0, 8 * len(good), 1 + len(good)):
            data = bytearray(good)
            data[bit // 8] ^= 1 << bit % 8
            (tmp_path / name).write_bytes(data)
            with pytest.raises(TableError) as caught:
                marks(tmp_path)
            told = " was changed or belongs to another result; repeat the command that"
            assert str(caught.value) == f"{tmp_path / name}{told} wrote it"
        (tmp_path / name).write_bytes(good)
    assert marks(tmp_path) == {1.0}


def test_flipped_bit_of_a_table_without_provenance_is_told_or_harmless(tmp_path):
    """Parquet's own checksums cover the pages of data, not the description at the end."""
    table = pd.DataFrame({"v": [0.1 * k for k in range(2000)]})
    path = write_table(table, tmp_path, "t", "parquet")
    good = path.read_bytes()
    for byte in (*range(100, 7000, 599), *range(len(good) - 1, len(good) - 500, -12)):
        data = bytearray(good)
        data[byte] ^= 1 << byte % 8
        path.write_bytes(data)
        with pytest.raises(TableError) if byte < 7000 else suppress(TableError) as caught:
            read_table(tmp_path, "t")
        if byte < 7000:
            assert str(caught.value).startswith(f"{path} cannot be read: ")
            assert len(str(caught.value).splitlines()) == 1


def test_lock_names_its_holder(tmp_path, monkeypatch):
    monkeypatch.setattr(locks, "MAX_WAIT_S", 0.1)
    with locks.replacement_lock(tmp_path), pytest.raises(TableError) as caught:
        write(tmp_path, 1)
    told = f"{tmp_path} is in use by process {os.getpid()} on {os.uname().nodename} since 20"
    assert str(caught.value).startswith(told)
    write(tmp_path, 1)
    assert (tmp_path / locks.NAME).read_text() == ""
    assert not list(tmp_path.glob(".*"))


def test_store_names_the_process_that_uses_it(tmp_path):
    with Store(tmp_path, {}), pytest.raises(TableError, match=rf"in use by process {os.getpid()} on .* since 20"):
        Store(tmp_path, {})
    Store(tmp_path, {}).close()


def test_file_system_without_locks_is_said_and_used(tmp_path, monkeypatch, caplog):
    def unsupported(*_):
        raise OSError(37, "No locks available")

    monkeypatch.setattr(Lock, "acquire", unsupported)
    write(tmp_path, 1)
    assert [record.getMessage() for record in caplog.records] == [
        f"the file system of {tmp_path} has no locks; let only one command at a time write there"
    ]
    assert marks(tmp_path) == {1.0}


def test_temporary_files_are_kept_for_a_day(tmp_path):
    """Their writers may live, on another machine perhaps; later files are removed by whoever writes next."""
    ages = {f".t-{k:016x}.csv": age for k, age in enumerate((0.0, 23.0, 25.0))} | {".t-notes.csv": 25.0}
    for name, hours in ages.items():
        (tmp_path / name).write_text("half a tab")
        os.utime(tmp_path / name, (time.time() - 3600.0 * hours,) * 2)
    write_table(TABLE, tmp_path, "t", "csv")
    assert {path.name for path in tmp_path.iterdir()} == {"t.csv", *ages} - {f".t-{2:016x}.csv"}
