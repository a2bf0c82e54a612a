"""``vibroplat plot`` of a run: what is drawn, and what is refused."""

from __future__ import annotations

import json

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Text

from vibroplat.errors import TableError
from vibroplat.plots.run import plot_run
from vibroplat.results.tables import read_json, read_table, write_table

TURN = 2.0 * np.pi


def points(line):
    """The data of a line, two rows."""
    return np.array([line.get_xdata(), line.get_ydata()], dtype=float)


def curve(table, column, factor=1.0):
    """What a line shows of a table."""
    return np.array([table["t_s"], factor * table[column]])


def test_plot_writes_pictures_and_names_them(command, result):
    done = command("plot", result)
    assert (done.code, done.err) == (0, "")
    paths = [result / f"{figure}.png" for figure in ("motion", "force", "exciters")]
    assert done.out.splitlines() == list(map(str, paths))
    for path in paths:
        pixels = plt.imread(path)
        assert pixels.shape[1] > 800
        assert pixels[..., :3].min() < 0.3 < pixels[..., :3].max() == 1.0  # something dark on white


def test_motion_shows_platform_and_gap_of_the_last_ten_turns(figures, result):
    plot_run(result, ["motion"])
    top, bottom = figures["motion"].axes
    trajectory, events = read_table(result, "trajectory"), read_table(result, "events")
    frequency = read_json(result, "summary")["excitation_frequency_hz"]
    begin = max(0.0, 0.2 - 10.0 / frequency)
    shown = trajectory[trajectory["t_s"] >= begin]
    np.testing.assert_allclose(points(top.lines[0]), curve(shown, "y_m", 1e3))
    np.testing.assert_allclose(points(bottom.lines[0]), curve(shown, "gap_m", 1e3))
    impacts = events[(events["kind"] == "impact") & (events["t_s"] >= begin)]
    assert len(impacts) > 0
    assert bottom.lines[1].get_xdata().tolist() == impacts["t_s"].tolist()
    stretches = (shown["mode"] == "attached").astype(int).diff().eq(1).sum() + (shown["mode"].iloc[0] == "attached")
    assert len(top.patches) == len(bottom.patches) == stretches > 1


def test_force_and_impulses_are_shown(figures, result):
    plot_run(result, ["force"], 0.05, 0.2)
    force, impulses = figures["force"].axes
    trajectory, events = (read_table(result, name).query("t_s >= 0.05") for name in ("trajectory", "events"))
    np.testing.assert_array_equal(points(force.lines[0]), curve(trajectory, "contact_force_n"))
    np.testing.assert_array_equal(points(impulses.lines[0]), curve(events[events["impulse_n_s"] > 0.0], "impulse_n_s"))


def test_exciters_show_both_speeds_and_their_phase_over_the_whole_run(figures, result):
    plot_run(result, ["exciters"])
    speeds, phase = figures["exciters"].axes
    table = read_table(result, "trajectory")
    assert [line.get_label() for line in speeds.lines] == ["exciter 1", "exciter 2", "synchronous speed"]
    np.testing.assert_allclose(points(speeds.lines[0]), curve(table, "phi1_rate_rad_per_s", 1.0 / TURN))
    np.testing.assert_allclose(points(speeds.lines[1]), curve(table, "phi2_rate_rad_per_s", -1.0 / TURN))
    np.testing.assert_allclose(speeds.lines[2].get_ydata(), 25.75)
    np.testing.assert_allclose(phase.lines[0].get_ydata(), (table["phi1_rad"] + table["phi2_rad"]) % TURN)


def test_plot_of_a_long_table_reads_it_in_parts_and_thins_out_what_shows_all_of_it(figures, result, monkeypatch):
    plot_run(result, ["motion"])
    (whole,) = (points(figures["motion"].axes[0].lines[0]),)
    monkeypatch.setattr("vibroplat.results.tables.PART", 50)
    monkeypatch.setattr("vibroplat.plots.run_tables.POINTS", 100)
    monkeypatch.setattr("vibroplat.results.files.read_table", None)
    plot_run(result, ["motion", "exciters"])
    np.testing.assert_array_equal(points(figures["motion"].axes[0].lines[0]), whole)
    table = read_table(result, "trajectory")
    every = -(-len(table) // 100)
    shown = figures["exciters"].axes[0].lines[0].get_xdata()
    np.testing.assert_array_equal(shown, table["t_s"].iloc[::every])
    assert 50 < len(shown) <= 100


def test_plot_leaves_out_what_a_scene_without_contact_has_not(figures, written):
    paths = plot_run(written / "bare", ["motion", "force", "exciters"])
    assert [path.name for path in paths] == ["motion.png", "exciters.png"]
    assert len(figures["motion"].axes) == 1


def test_plot_of_one_kind_in_an_interval(command, figures, result):
    done = command("plot", result, "--kind", "force", "--start", "0.1", "--stop", "0.15")
    assert (done.code, done.err) == (0, "")
    assert [path.name for path in result.glob("*.png")] == ["force.png"]
    times = figures["force"].axes[0].lines[0].get_xdata()
    assert (times.min(), times.max()) == (0.1, 0.15)


def refusal(directory, **interval):
    """What the user is told instead of figures."""
    with pytest.raises(TableError) as caught:
        plot_run(directory, ["motion", "force"], **interval)
    assert list(directory.glob("*.png")) == []
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value).replace(str(directory), "DIR")


def test_every_figure_shows_the_interval_asked_for(figures, result):
    plot_run(result, ["motion", "force", "exciters"], 0.1, 0.15)
    for axis in (axis for figure in figures.values() for axis in figure.axes):
        times = np.concatenate([line.get_xdata() for line in axis.lines if len(line.get_xdata())])
        assert 0.1 <= times.min() <= times.max() <= 0.15


def test_plot_of_an_interval_without_data_says_how_long_the_run_was(result):
    within = "DIR runs from 0 to 0.2 s; allowed: a time within it"
    for start, stop, line in (
        (5.0, None, f"--start 5: {within}"),
        (None, -1.0, f"--stop -1: {within}"),
        (0.1, 0.05, "--start 0.1 is not before --stop 0.05; DIR runs from 0 to 0.2 s"),
        (0.1, 0.1, "--start 0.1 is not before --stop 0.1; DIR runs from 0 to 0.2 s"),
        (float("nan"), None, f"--start nan: {within}"),
        (0.1001, 0.1002, "no data between 0.1001 and 0.1002 s; DIR runs from 0 to 0.2 s"),
    ):
        assert refusal(result, start=start, stop=stop) == line


def test_plot_of_an_interval_that_is_longer_than_the_run_says_so(caplog, figures, result):
    plot_run(result, ["motion"], 0.1, 9.0)
    assert caplog.messages == [f"--stop 9: {result} runs from 0 to 0.2 s; the figures show what there is"]


TABLE = "allowed: a result directory of vibroplat"

#: What is damaged: file and its content, None for a file that is missing; and what is told.
DAMAGES = [
    ("provenance.json", None, "DIR holds no provenance.json"),
    ("summary.json", None, "DIR holds no summary.json"),
    ("trajectory.parquet", None, f"DIR holds no trajectory table; {TABLE}"),
    ("events.parquet", None, f"DIR holds no events table; {TABLE}"),
    ("provenance.json", "[]", "DIR holds results of schema None; this version reads schema 1"),
    ("provenance.json", '{"schema": 2}', "DIR holds results of schema 2; this version reads schema 1"),
    ("provenance.json", "{", "DIR/provenance.json cannot be read: "),
    ("summary.json", "{}", "DIR/summary.json is not the summary of a run"),
    ("summary.json", "[]", "DIR/summary.json is not the summary of a run"),
    ("trajectory.csv", "t_s,y_m\nx,y\nz,w\n", "the trajectory table in DIR has no numbers in column t_s"),
    ("events.csv", "a,b\n1,2\n", "the events table in DIR has no numbers in column t_s"),
    ("events.csv", "", "DIR/events.csv cannot be read: "),
]


@pytest.mark.parametrize(("file", "content", "line"), DAMAGES)
def test_plot_of_damaged_files_is_told_in_a_line(file, content, line, result):
    if content is None or file.endswith("csv"):
        (result / file).with_suffix(".json" if file.endswith("json") else ".parquet").unlink()
    if content is not None:
        (result / file).write_text(content)
    assert refusal(result).startswith(line)


def test_plot_names_the_column_it_misses(figures, result):
    for table, columns in (
        ("trajectory", ["t_s", "mode", "y_m", "phi2_rad", "phi1_rate_rad_per_s"]),
        ("events", ["kind"]),
    ):
        whole = read_table(result, table)
        for column in columns:
            write_table(whole.drop(columns=column), result, table, "parquet")
            with pytest.raises(TableError, match=column):
                plot_run(result, ["motion", "force", "exciters"])
        write_table(whole, result, table, "parquet")


def test_plot_names_the_column_that_has_no_numbers(result):
    table = read_table(result, "trajectory")
    (result / "trajectory.parquet").unlink()
    for column, values in (("y_m", "text"), ("gap_m", True), ("contact_force_n", 1j)):
        table.assign(**{column: values}).to_csv(result / "trajectory.csv", index=False)
        assert refusal(result) == f"the trajectory table in DIR has no numbers in column {column}"


def test_plot_names_the_column_that_has_no_names(result):
    write_table(read_table(result, "trajectory").assign(mode=1.5), result, "trajectory", "parquet")
    assert refusal(result) == "the trajectory table in DIR has no names in column mode"


def test_plot_of_a_parquet_file_of_something_else_is_refused(result):
    write_table(pd.DataFrame({"city": ["Omsk"], "people": [1]}), result, "trajectory", "parquet")
    assert refusal(result) == "the trajectory table in DIR has no numbers in column t_s"


def test_plot_of_a_summary_of_something_else_is_refused(result):
    summary = read_json(result, "summary")
    for change in ({"name": 5}, {"excitation_frequency_hz": "fast"}, {"excitation_frequency_hz": [25.0]}):
        (result / "summary.json").write_text(json.dumps(summary | change))
        assert refusal(result) == "DIR/summary.json is not the summary of a run"


def test_dollar_signs_in_names_are_drawn_as_they_are(figures, result):
    summary = read_json(result, "summary")
    for name in ("10 $ and 20 $", r"cost $\frac$ x", r"\$5 $"):
        (result / "summary.json").write_text(json.dumps(summary | {"name": name}))
        plot_run(result, ["motion"])
        assert Text()._preprocess_math(figures["motion"].get_suptitle()) == (name, False)


def test_plot_where_a_figure_cannot_be_written_is_told_in_a_line(result):
    (result / "motion.png").mkdir()
    with pytest.raises(TableError) as caught:
        plot_run(result, ["motion"])
    assert str(caught.value) == f"{result}/motion.png cannot be written: Is a directory"
