"""Tables on disk, and the tables of a run: columns, rows, dense output."""

import itertools
import math
import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from vibroplat import simulate
from vibroplat.columns import Column
from vibroplat.errors import ConfigError, TableError
from vibroplat.frames import ArrayTable, CategoryColumn
from vibroplat.results.files import write_result
from vibroplat.results.tables import (
    FORMATS,
    TableFile,
    read_json,
    read_parts,
    read_table,
    replace_file,
    require_replaceable,
    result_directory,
    write_table,
)

OLD, NEW = pd.DataFrame({"v": [1.0, 2.0]}), pd.DataFrame({"v": [3.0]})


@pytest.fixture(scope="module", params=["two layers", "bare", "bouncing"])
def finished(request, runs):
    return runs[request.param]


def files(directory):
    return sorted(path.name for path in directory.iterdir())


def write_half(reason):
    def write(_, target, **_options):
        if isinstance(target, Path):  # a writer of Parquet has its file open
            target.write_text("half a tab")
        raise reason

    return write


@pytest.mark.parametrize(
    ("form", "reason"), [("csv", KeyboardInterrupt()), ("parquet", OSError(28, "No space left on device"))], ids=repr
)
def test_writer_that_fails_leaves_the_old_table_and_nothing_else(form, reason, tmp_path, monkeypatch):
    write_table(OLD, tmp_path, "table", form)
    writer = "pyarrow.parquet.ParquetWriter.write_table" if form == "parquet" else "pandas.DataFrame.to_csv"
    monkeypatch.setattr(writer, write_half(reason))
    with pytest.raises((TableError, type(reason))):
        write_table(NEW, tmp_path, "table", form)
    assert files(tmp_path) == [f"table.{form}"]
    pd.testing.assert_frame_equal(read_table(tmp_path, "table"), OLD)


def test_files_are_whole_under_their_names_and_readable_by_all(tmp_path):
    paths = [write_table(OLD, tmp_path, "a", "parquet"), write_table(OLD, tmp_path, "b", "csv")]
    assert files(tmp_path) == ["a.parquet", "b.csv"] == [path.name for path in paths]
    write_result(tmp_path, "run", {}, {}, {"c": {"φ": None}}, form="csv")
    assert {path.stat().st_mode & 0o777 for path in [*paths, *tmp_path.glob("*.json")]} == {0o644}
    assert (tmp_path / "c.json").read_text(encoding="utf-8") == '{\n  "φ": null\n}\n'


def test_another_format_replaces_the_table(tmp_path):
    for first, second in (FORMATS, FORMATS[::-1]):
        write_table(OLD, tmp_path, "table", first)
        write_table(OLD, tmp_path, "other", first)
        write_table(NEW, tmp_path, "table", second)
        assert files(tmp_path) == sorted([f"other.{first}", f"table.{second}"])
        pd.testing.assert_frame_equal(read_table(tmp_path, "table"), NEW)
        (tmp_path / f"other.{first}").unlink()


@pytest.mark.parametrize("form", FORMATS)
def test_numbers_read_back_bit_for_bit(form, tmp_path):
    bits = np.random.default_rng(0).integers(0, 2**64, 20_000, dtype=np.uint64)
    numbers = bits.view(np.float64)
    special = [0.0, -0.0, 5e-324, np.finfo(float).max, np.pi, 0.1, 1.0, 1e22, 1e23]
    table = pd.DataFrame({"v": np.concatenate((special, numbers[np.isfinite(numbers)]))})
    write_table(table, tmp_path, "table", form)
    back = read_table(tmp_path, "table")["v"].to_numpy()
    np.testing.assert_array_equal(back.view(np.uint64), table["v"].to_numpy().view(np.uint64))


@pytest.mark.parametrize(("form", "columns"), [("parquet", None), ("csv", ("mode", "y_m", "unknown"))])
def test_table_in_parts_reads_back_bit_for_bit(form, columns, runs, tmp_path, monkeypatch):
    table = runs["two layers"].trajectory
    with TableFile(tmp_path, "t", form) as grown:
        for first in range(0, len(table), 100):
            grown.append(table.iloc[first : first + 100])
        assert not (tmp_path / f"t.{form}").exists()
        grown.finish().rename(tmp_path / f"t.{form}")
    write_table(table, tmp_path, "whole", form)
    pd.testing.assert_frame_equal(read_table(tmp_path, "t"), read_table(tmp_path, "whole"), check_exact=True)
    monkeypatch.setattr("vibroplat.results.tables.MAX_PART_ROWS", 64)
    parts = list(read_parts(tmp_path, "t", columns=columns))
    assert max(map(len, parts)) <= 64
    wanted = table if columns is None else table[["mode", "y_m"]]
    found = pd.concat(parts, ignore_index=True).astype({"mode": "str"})
    pd.testing.assert_frame_equal(found, wanted.astype({"mode": "str"}), check_exact=True)
    (*_, end) = read_parts(tmp_path, "t", last=True)
    assert end["t_s"].iloc[-1] == table["t_s"].iloc[-1]


#: A table with all kinds of columns that tables of runs have.
PLAIN = {
    "t_s": np.arange(12.0)[::2],
    "gap_m": np.array([math.nan, math.inf, -0.0, 5e-324, 0.1, 1e22]),
    "mode": CategoryColumn(np.array([0, 1, 1, 2, 0, 0]), ("a", "b", "ψ"), categorical=True),
    "kind": CategoryColumn(np.array([1, 1, 0, 1, 0, 1]), ("liftoff", "Stoß")),
    "impacts": np.arange(6),
}


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("ends", [(2, 6), (6,), (0,)], ids=str)
def test_plain_tables_are_written_to_the_byte_as_dataframes_are(form, ends, tmp_path):
    def rows(column, part):
        return column._replace(numbers=column.numbers[part]) if isinstance(column, CategoryColumn) else column[part]

    parts = [slice(*part) for part in itertools.pairwise((0, *ends))]
    described = {"t_s": Column("time"), "kind": Column("kind", "what – or how")}
    plain = [ArrayTable({name: rows(of, part) for name, of in PLAIN.items()}, described) for part in parts]
    frames = [part.frame for part in plain]
    for name, table in (("plain", plain), ("frames", frames)):
        write_table(table, tmp_path, name, form)
    assert (tmp_path / f"plain.{form}").read_bytes() == (tmp_path / f"frames.{form}").read_bytes()
    if form == "parquet" and ends[-1]:  # an empty column of words has no categories in a file
        back, wanted = pd.read_parquet(tmp_path / "plain.parquet"), pd.concat(frames, ignore_index=True)
        pd.testing.assert_frame_equal(back, wanted, check_exact=True)
        assert (
            back.attrs
            == frames[0].attrs
            == {
                "units": {"t_s": "s", "gap_m": "m", "mode": "", "kind": "", "impacts": ""},
                "meanings": {"t_s": "time", "kind": "kind; what – or how"},
            }
        )


@pytest.mark.parametrize(
    ("out", "name", "reason"), [("file", "scene", "Not a directory"), (".", "file", "File exists")]
)
def test_file_in_place_of_the_directory_is_told_in_a_line(out, name, reason, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(TableError) as caught:
        result_directory(tmp_path / out, name)
    assert str(caught.value) == f"output {tmp_path / out / name} is not writable: {reason}"


def test_directory_that_is_only_read_is_told_in_a_line(tmp_path, monkeypatch):
    def read_only(**_):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr("tempfile.TemporaryFile", read_only)
    with pytest.raises(TableError, match=f"^output {tmp_path}/a is not writable: Read-only file system$"):
        result_directory(tmp_path, "a")


def test_result_is_not_written_over_one_whose_name_differs_in_capitals(tmp_path):
    """As it would be on a file system that does not tell them apart: here both names are links to one directory."""
    (result_directory(tmp_path, "rig") / "provenance.json").write_text("{}")
    assert result_directory(tmp_path, "rig") == tmp_path / "rig"
    assert result_directory(tmp_path, "RIG") != result_directory(tmp_path, "Rig")
    (tmp_path / "RIg").symlink_to("rig")
    with pytest.raises(TableError) as caught:
        result_directory(tmp_path, "RIg")
    line = f"output {tmp_path / 'RIg'} is {tmp_path / 'rig'} on this file system; allowed: another name"
    assert str(caught.value) == line
    (tmp_path / "rig/provenance.json").unlink()  # figures may go anywhere
    assert result_directory(tmp_path, "RIg") == tmp_path / "RIg"


def test_missing_tables_are_told_in_a_line(tmp_path):
    with pytest.raises(TableError) as caught:
        read_table(tmp_path, "trajectory")
    assert str(caught.value) == (f"{tmp_path} holds no trajectory table; allowed: a result directory of vibroplat")
    with pytest.raises(TableError) as caught:
        read_json(tmp_path, "summary")
    assert str(caught.value) == f"{tmp_path} holds no summary.json"


@pytest.mark.parametrize("name", ["t.parquet", "t.csv", "t.json"])
def test_damaged_file_is_told_in_a_line(name, tmp_path):
    contents = {
        "t.parquet": (b"", b"PAR1garbagePAR1"),
        "t.csv": (b"", b"\xff\xfe", b"a,b\n1,2\n1,2,3\n", None),
        "t.json": (b"{", b"\xff"),
    }
    for number, content in enumerate(contents[name]):
        path = tmp_path / str(number) / name
        path.parent.mkdir()
        if content is None:
            path.mkdir()
        else:
            path.write_bytes(content)
        with pytest.raises(TableError) as caught:
            (read_json if path.suffix == ".json" else read_table)(path.parent, "t")
        assert str(caught.value).startswith(f"{path} cannot be read: ")
        assert len(str(caught.value).splitlines()) == 1


PLATFORM = ["x_m", "y_m", "phi_rad", "phi1_rad", "phi2_rad"]
PLATFORM_RATES = [
    "x_rate_m_per_s",
    "y_rate_m_per_s",
    "phi_rate_rad_per_s",
    "phi1_rate_rad_per_s",
    "phi2_rate_rad_per_s",
]
GAP, UPPER = ("gap_m", "gap_rate_m_per_s"), ("upper_m", "upper_rate_m_per_s")


def test_columns_are_those_the_scene_has(runs):
    for run, layers in (("two layers", [GAP, UPPER]), ("one layer", [GAP]), ("bare", [])):
        coordinates = [*PLATFORM, *(layer[0] for layer in layers)]
        rates = [*PLATFORM_RATES, *(layer[1] for layer in layers)]
        force = ["contact_force_n"] if layers else []
        table = runs[run].trajectory
        assert list(table) == ["t_s", "mode", *coordinates, *rates, *force, "motor_power_1_w", "motor_power_2_w"]
        assert {str(table[column].dtype) for column in table if column != "mode"} == {"float64"}
        assert set(table["mode"]) == ({"attached", "flight"} if layers else {"bare"})


def test_events_have_the_columns_of_the_interface(runs):
    expected = ["t_s", "kind", "gap_rate_before_m_per_s", "gap_rate_after_m_per_s", "impulse_n_s", "energy_loss_j"]
    for run in runs.values():
        assert list(run.events) == [*expected, "contact_force_after_n", "mode_after", "impacts"]
        assert set(run.events["kind"]) <= {"liftoff", "impact", "chatter"}
        assert len(run.events) == run.summary["events"]
        assert (len(run.events) > 0) == run.scene.has_contact


def test_rows_are_the_sample_grid_and_two_at_each_event(finished):
    times, at_events = finished.trajectory["t_s"], finished.events["t_s"]
    assert (times.iloc[0], times.iloc[-1]) == (0.0, 0.25)
    grid = np.arange(501) / 2000.0
    np.testing.assert_array_equal(np.sort(np.concatenate((grid, at_events, at_events))), times)


def test_two_rows_of_an_event_are_before_and_after(finished):
    table, events = finished.trajectory, finished.events
    pairs = table[table["t_s"].isin(events["t_s"])]
    before, after = pairs.iloc[::2].reset_index(drop=True), pairs.iloc[1::2].reset_index(drop=True)
    assert list(after["mode"]) == list(events["mode_after"])
    assert list(before["mode"]) == ["attached" if kind == "liftoff" else "flight" for kind in events["kind"]]
    positions = [*PLATFORM, *(name for name in ("upper_m",) if name in table)]
    pd.testing.assert_frame_equal(before[positions], after[positions], rtol=0.0, atol=1e-9)
    if finished.scene.has_contact:
        assert np.abs(pairs["gap_m"]).max() < 1e-9
        struck, lifted = events["kind"] == "impact", events["kind"] == "liftoff"
        assert (before["gap_rate_m_per_s"][lifted] == after["gap_rate_m_per_s"][lifted]).all()
        for name, rows in (("before", before), ("after", after)):
            np.testing.assert_allclose(rows["gap_rate_m_per_s"][struck], events[f"gap_rate_{name}_m_per_s"][struck])
        landed = events["mode_after"] == "attached"
        np.testing.assert_allclose(after["contact_force_n"][landed], events["contact_force_after_n"][landed], rtol=1e-9)


def test_odd_sample_rates_keep_the_ends(runs):
    rate = 1000.0 / 3.0
    scene = runs["two layers"].scene.replace({"output.sample_rate_hz": rate})
    run = simulate(scene)
    times = run.trajectory["t_s"].to_numpy()
    inside = np.setdiff1d(times[1:-1], run.events["t_s"])
    np.testing.assert_array_equal(inside, np.arange(1, np.ceil(0.25 * rate)) / rate)
    assert (times[0], times[-1]) == (0.0, 0.25)


def test_dense_output_equals_the_table_on_the_grid_and_before_events(finished):
    grid, table = np.arange(501) / 2000.0, finished.trajectory
    for times, rows in (
        (grid, table[table["t_s"].isin(grid)]),
        (finished.events["t_s"], table[table["t_s"].isin(finished.events["t_s"])].iloc[::2]),
    ):
        pd.testing.assert_frame_equal(finished(times), rows.reset_index(drop=True), check_exact=True)


def test_times_keep_their_order(runs):
    finished = runs["bouncing"]
    times = np.random.default_rng(1).permutation(np.concatenate((np.linspace(0.0, 0.25, 99), finished.events["t_s"])))
    times[3] = times[50]
    shuffled, ascending = finished(times), finished(np.sort(times))
    np.testing.assert_array_equal(shuffled["t_s"], times)
    expected = ascending.iloc[np.searchsorted(np.sort(times), times)].reset_index(drop=True)
    pd.testing.assert_frame_equal(shuffled, expected, check_exact=True)


def test_times_may_be_a_number_or_a_list(runs):
    run = runs["two layers"]
    for times in (0.1, [0.1], pd.Series([0.1], index=[7])):
        row = run(times)
        assert (row.index[0], len(row), row["t_s"][0]) == (0, 1, 0.1)
    assert list(run([])) == list(run.trajectory)
    assert len(run([])) == 0
    lean = simulate(run.scene.replace({"run.duration_s": 0.01}), keep="events")
    with pytest.raises(ConfigError, match=r"^this run kept no segments; simulate with keep='segments' for dense"):
        lean(0.0)


def test_times_that_are_none_of_the_run_are_refused(runs):
    numbers = "times must be a number or a one-dimensional list of finite numbers"
    for times, told in (
        ([0.1, -1e-9], "times must lie in [0.0, 0.25] s, got -1e-09 … 0.1"),
        ([0.2500001, 0.0], "times must lie in [0.0, 0.25] s, got 0.0 … 0.2500001"),
        ([0.1, np.nan], numbers),
        ([[0.1, 0.2]], numbers),
    ):
        with pytest.raises(ConfigError, match=r"^times must ") as caught:
            runs["two layers"](times)
        assert str(caught.value) == told


@pytest.mark.parametrize("kind", ["device", "link", "fifo", "folder"])
def test_what_is_no_file_is_never_replaced(kind, tmp_path):
    """As root a device would give way to a file of its name."""
    path = {"device": Path("/dev/null")}.get(kind, tmp_path / "there")
    if kind == "link":
        path.symlink_to("/dev/null")
    elif kind == "fifo":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    before = path.stat().st_mode
    with pytest.raises(TableError, match=f"{path} is no regular file; allowed: a new file or one to replace"):
        replace_file(path, lambda place: place.write_text("mine"))
    assert path.stat().st_mode == before


def test_file_of_another_kind_is_replaced_only_on_request(tmp_path, monkeypatch):
    path = tmp_path / "machine.yaml"
    require_replaceable(path, b"MATLAB")
    path.touch()  # as mktemp does
    require_replaceable(path, b"MATLAB")
    path.write_text("MatLab 5.0")
    require_replaceable(path, b"MATLAB")
    path.write_text("name: mine")
    require_replaceable(path, b"MATLAB", overwrite=True)
    with pytest.raises(TableError, match="is a file of another kind; allowed: a new file, or to overwrite it"):
        require_replaceable(path, b"MATLAB")

    def gone(*_):
        raise FileNotFoundError(2, "No such file or directory")

    monkeypatch.setattr(Path, "open", gone)
    require_replaceable(path, b"MATLAB")  # another process has just removed it
