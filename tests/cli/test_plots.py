"""``vibroplat plot`` of a run: what is drawn, and what is refused."""

from __future__ import annotations

import json

import pytest

from vibroplat.errors import TableError
from vibroplat.plots.run import plot_run
from vibroplat.tables import read_table, write_table


def is_png(path):
    return path.read_bytes().startswith(b"\x89PNG\r\n\x1a\n")


def test_plot_draws_all_figures_and_names_the_files(vibroplat, result):
    done = vibroplat("plot", result)
    assert (done.code, done.err) == (0, "")
    paths = [result / f"{figure}.png" for figure in ("motion", "force", "exciters")]
    assert done.out.splitlines() == list(map(str, paths))
    assert all(map(is_png, paths))


def test_plot_leaves_out_the_force_of_a_scene_without_contact(written):
    paths = plot_run(written / "bare", ["motion", "force", "exciters"])
    assert [path.name for path in paths] == ["motion.png", "exciters.png"]
    assert all(map(is_png, paths))


def test_plot_of_one_kind_in_an_interval(vibroplat, result):
    done = vibroplat("plot", result, "--kind", "force", "--start", "0.1", "--stop", "0.15")
    assert (done.code, done.err) == (0, "")
    assert [path.name for path in result.glob("*.png")] == ["force.png"]


def refusal(directory, **interval):
    """What the user is told instead of figures."""
    with pytest.raises(TableError) as caught:
        plot_run(directory, ["motion", "force"], **interval)
    assert list(directory.glob("*.png")) == []
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value).replace(str(directory), "DIR")


@pytest.mark.parametrize("found", [0, 2, None, "1"])
def test_plot_refuses_another_schema(found, result):
    (result / "provenance.json").write_text(json.dumps({"schema": found}))
    assert refusal(result) == f"DIR holds results of schema {found}; this version reads schema 1"


@pytest.mark.parametrize(
    ("interval", "between"),
    [
        ({"start": 5.0}, "5.0 and 0.2"),
        ({"start": 0.1, "stop": 0.05}, "0.1 and 0.05"),
        ({"start": float("nan")}, "nan and 0.2"),
        ({"start": 0.1, "stop": 0.1}, "0.1 and 0.1"),
    ],
)
def test_plot_of_an_empty_interval_is_refused(interval, between, result):
    assert refusal(result, **interval) == f"nothing between {between} s; allowed: an interval within 0.0 … 0.2 s"


@pytest.mark.parametrize(
    ("missing", "line"),
    [
        ("provenance.json", "DIR holds no provenance.json"),
        ("summary.json", "DIR holds no summary.json"),
        ("trajectory.parquet", "DIR holds no trajectory table; allowed: a directory that vibroplat has written"),
        ("events.parquet", "DIR holds no events table; allowed: a directory that vibroplat has written"),
    ],
)
def test_plot_names_the_file_it_misses(missing, line, result):
    (result / missing).unlink()
    assert refusal(result) == line


@pytest.mark.parametrize(
    ("file", "content", "line"),
    [
        ("provenance.json", "[]", "DIR holds results of schema None; this version reads schema 1"),
        ("provenance.json", "{", "DIR/provenance.json cannot be read: "),
        ("summary.json", "{}", "DIR/summary.json is no summary of a run"),
        ("summary.json", "[]", "DIR/summary.json is no summary of a run"),
        ("trajectory.csv", "a,b\n1,2\n", "the trajectory table in DIR has no numbers in column t_s"),
        ("trajectory.csv", "t_s,y_m\nx,y\nz,w\n", "the trajectory table in DIR has no numbers in column t_s"),
        ("events.csv", "a,b\n1,2\n", "the events table in DIR has no numbers in column t_s"),
        ("events.csv", "", "DIR/events.csv cannot be read: "),
    ],
)
def test_plot_of_damaged_files_is_told_in_a_line(file, content, line, result):
    if file.endswith("csv"):
        (result / file).with_suffix(".parquet").unlink()
    (result / file).write_text(content)
    assert refusal(result).startswith(line)


@pytest.mark.parametrize(
    ("table", "column"),
    [
        *(("trajectory", column) for column in ("t_s", "mode", "y_m", "phi2_rad", "phi1_rate_rad_per_s")),
        ("events", "kind"),
    ],
)
def test_plot_names_the_column_it_misses(table, column, result):
    write_table(read_table(result, table).drop(columns=column), result, table, "parquet")
    with pytest.raises(TableError, match=column):
        plot_run(result, ["motion", "force", "exciters"])


def test_plot_where_a_figure_cannot_be_written_is_told_in_a_line(result):
    (result / "motion.png").mkdir()
    with pytest.raises(TableError) as caught:
        plot_run(result, ["motion"])
    assert str(caught.value) == f"{result}/motion.png cannot be written: Is a directory"
