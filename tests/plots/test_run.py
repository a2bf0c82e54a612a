"""Figures of runs: what is drawn, and what is refused."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from common.places import QUICKSTART
from common.results import edited
from matplotlib.collections import LineCollection
from matplotlib.text import Text

from vibroplat import load_config
from vibroplat.config.digits import percent, quantity
from vibroplat.config.kinds import RUN_FIGURES
from vibroplat.errors import TableError
from vibroplat.measured.data import read_data
from vibroplat.plots import headlines, histories
from vibroplat.plots.command import plot_results
from vibroplat.plots.run import FIGURES
from vibroplat.results.labels import run_parameters
from vibroplat.results.run import RunResult
from vibroplat.results.tables import read_json, read_table, write_table

from . import conftest
from .conftest import data_of, table_line, texts

TURN = 2.0 * np.pi


def drawn(*directories, kinds=(), **options):
    """Figures of runs by name."""
    return conftest.drawn("run", *directories, kinds=kinds, **options)


def test_help_lists_figures_in_the_order_in_which_they_are_drawn():
    assert RUN_FIGURES.split() == [*FIGURES]


def from_rest(table, directory):
    """A trajectory with y as figures show it."""
    return table.assign(y_m=table["y_m"] + read_json(directory, "summary")["static_sag_m"])


def shown_from(directory, turns):
    """When the last turns begin (s)."""
    return 0.25 - turns / read_json(directory, "summary")["excitation_frequency_hz"]


@pytest.fixture
def settled(result):
    """A run of six turns whose motion repeats each turn."""
    return edited(result, "summary", period=1)


def test_motion_shows_platform_and_gap_of_the_last_turns(settled):
    result = settled
    (_, top), (_, bottom) = np.reshape(drawn(result)["motion"].axes, (2, 2))
    trajectory, events = read_table(result, "trajectory"), read_table(result, "events")
    begin = shown_from(result, histories.shown_turns(read_json(result, "summary")))
    shown = trajectory[trajectory["t_s"] >= begin]
    assert 100 < len(shown) < len(trajectory)
    np.testing.assert_allclose(data_of(top.lines[0]), table_line(from_rest(shown, result), "y_m"))
    np.testing.assert_allclose(data_of(bottom.lines[0]), table_line(shown, "gap_m"))
    impacts = events[(events["kind"] == "impact") & (events["t_s"] >= begin)]
    assert len(impacts) > 0
    assert bottom.lines[1].get_xdata().tolist() == impacts["t_s"].tolist()
    stretches = (shown["mode"] == "attached").astype(int).diff().eq(1).sum() + (shown["mode"].iloc[0] == "attached")
    assert len(top.patches) == len(bottom.patches) == stretches > 1


@pytest.mark.parametrize(("period", "turns"), [(1, 3), (3, 5), (9, 10), (0, 10), (None, 10)])
def test_last_turns_are_several_periods_or_ten_where_motion_does_not_repeat(period, turns):
    assert histories.shown_turns({"period": period}) == turns


def test_y_is_counted_from_rest_where_a_scene_or_a_summary_tells_the_sag(result):
    edited(result, "provenance", configuration={"lost": 1})
    axis = drawn(result)["motion"].axes[0]
    table = read_table(result, "trajectory")
    assert axis.lines[0].get_ydata()[-1] == pytest.approx(from_rest(table, result)["y_m"].iloc[-1])
    axis = drawn(edited(result, "summary", static_sag_m=None))["motion"].axes[0]
    assert axis.lines[0].get_ydata()[-1] == pytest.approx(table["y_m"].iloc[-1])
    assert axis.get_ylabel() == "$y$ (mm)"


def test_a_long_run_has_the_range_of_each_turn_on_the_left_and_its_last_turns_on_the_right(settled):
    result = settled
    figure = drawn(result, kinds=["motion"])["motion"]
    titles = [axis.get_title(loc="left").splitlines()[-1] for axis in figure.axes[:2]]
    assert titles == ["whole run: range of each turn", "last 3 turns"]
    table = from_rest(read_table(result, "trajectory"), result)
    low, high = figure.axes[0].lines[:2]
    assert (low.get_ydata().min(), high.get_ydata().max()) == pytest.approx((table["y_m"].min(), table["y_m"].max()))
    assert figure.axes[0].get_ylim() == figure.axes[1].get_ylim()
    assert np.ptp(figure.axes[1].lines[0].get_xdata()) == pytest.approx(3.0 / 25.75, rel=0.05)


def test_a_long_table_is_read_in_parts_and_thinned_where_all_of_it_is_shown(result, monkeypatch):
    before = drawn(result, kinds=["motion"])["motion"]
    monkeypatch.setattr("vibroplat.results.tables.MAX_PART_ROWS", 50)
    monkeypatch.setattr("vibroplat.results.files.read_table", None)
    monkeypatch.setattr(histories, "POINTS", 100)
    figures = drawn(result)
    after = figures["motion"]
    np.testing.assert_array_equal(data_of(after.axes[1].lines[0]), data_of(before.axes[1].lines[0]))
    np.testing.assert_array_equal(*(data_of(f.axes[0].lines[0]) for f in (before, after)))
    table = read_table(result, "trajectory")
    shown = figures["exciters"].axes[1].lines[0].get_xdata()
    np.testing.assert_array_equal(shown, table["t_s"].iloc[:: -(-len(table) // 100)])
    assert 50 < len(shown) <= 100


def test_impulses_are_stems_on_an_axis_of_their_own(result):
    force, impulses = drawn(result, kinds=["force"], start=0.05, stop=0.2)["force"].axes
    trajectory, events = (read_table(result, name).query("0.05 <= t_s <= 0.2") for name in ("trajectory", "events"))
    strikes = events[events["impulse_n_s"] > 0.0]
    np.testing.assert_array_equal(data_of(force.lines[0]), table_line(trajectory, "contact_force_n"))
    np.testing.assert_array_equal(data_of(impulses.lines[0]), table_line(strikes, "impulse_n_s"))
    assert [axis.get_ylabel() for axis in (force, impulses)] == [
        "contact force $F_c$ (N)",
        "impulse $P$ (mN·s)",
    ]
    (stems,) = (c for c in impulses.collections if isinstance(c, LineCollection))
    assert [segment[0][1] for segment in stems.get_segments()] == [0.0] * len(strikes)
    assert not force.get_shared_y_axes().joined(force, impulses)
    assert not any(isinstance(c, LineCollection) for c in force.collections)


def test_exciters_show_both_speeds_and_their_phase(result):
    figure = drawn(result)["exciters"]
    speeds, phase = figure.axes
    table = read_table(result, "trajectory")
    assert texts(figure.legends[0]) == ["exciter 1 = 2", "synchronous speed"]
    np.testing.assert_allclose(data_of(speeds.lines[0]), table_line(table, "phi1_rate_rad_per_s", 1.0 / TURN))
    np.testing.assert_allclose(speeds.lines[1].get_ydata(), 25.75)
    np.testing.assert_allclose(phase.lines[0].get_ydata(), (table["phi1_rad"] + table["phi2_rad"]) % TURN)


def test_loads_are_forces_and_displacements_with_their_peaks(settled):
    result = settled
    force, _, height, _, speeds, _ = drawn(result, kinds=["loads"])["loads"].axes
    table, summary = read_table(result, "trajectory"), read_json(result, "summary")
    machine = load_config(QUICKSTART).machine
    along_y = machine.stiffness_y_n_per_m * table["y_m"] + machine.damping_y_n_s_per_m * table["y_rate_m_per_s"]
    for axis, values in ((force, -along_y), (height, from_rest(table, result)["y_m"])):
        low, high = (line.get_ydata() for line in axis.lines[:2])
        assert (low.min(), high.max()) == pytest.approx([values.min(), values.max()])
    size, at, pace = (summary[f"whole_foundation_force_y_max_{what}"] for what in ("n", "at_s", "at_hz"))
    peak, static = force.lines[-2:]
    assert (peak.get_xdata()[0], peak.get_ydata()[0]) == (at, size), "downwards, as on the page"
    assert static.get_ydata()[0] == -summary["foundation_force_y_mean_n"]
    assert size == pytest.approx(along_y.abs().max(), rel=1e-3)
    assert force.texts[-1].get_text() == f"{quantity(size, 'N')} at {quantity(at, 's')}, {pace:.1f} Hz"
    assert height.texts[-1].get_text().startswith(f"stroke {1e3 * summary['whole_stroke_y_m']:.3g} mm at ")
    assert len(speeds.lines) == 2  # the range of both
    late = drawn(result, kinds=["loads"], start=at + 1e-3)["loads"].axes[0]
    assert not late.texts  # the peak is before


def test_a_scene_without_contact_has_no_force(saved):
    figures = drawn(saved["bare"])
    assert [*figures] == ["motion", "exciters", "loads"]
    assert [axis.get_ylabel() for axis in figures["motion"].axes if axis.get_ylabel()] == ["$y$ from rest (mm)"]
    with pytest.raises(TableError, match="has no contact force, as its scene is bare or non-impact"):
        drawn(saved["bare"], kinds=["force"])


def test_parameters_are_in_the_title(saved):
    figure = drawn(saved["bouncing"], kinds=["force"])["force"]
    parameters = r"$f_e$ = 51.5 Hz, $\mu_w$ = 0.2, two layers, $R$ = 0.5"
    assert figure.axes[0].get_title(loc="left") == f"quickstart: {parameters}"
    program = [{"t_s": 0.0, "supply_frequency_hz": 50.0}, {"t_s": 2.0, "exciter_2": "off"}, {"t_s": 3.5, "off": True}]
    scene = load_config(QUICKSTART, {"drive": {"program": program}})
    assert run_parameters(scene).startswith("$f_e$ = 50 Hz, motor 2 off at 2 s, motors off at 3.5 s, ")
    assert run_parameters(scene, 4.0).startswith("motor 2 off, motors off, ")


def test_titles_say_what_answer_and_data_sheet_say(saved):
    told = read_json(saved["two layers"], "summary")
    titles = {kind: figure.get_suptitle().replace("\n", " ") for kind, figure in drawn(saved["two layers"]).items()}
    stroke = f"stroke y {quantity(told['stroke_y_m'], 'm')}"
    assert titles["motion"].startswith(stroke.capitalize())
    assert titles["exciters"].startswith(f"Runs at {quantity(told['excitation_frequency_hz'], 'Hz')} ")
    assert f"material in flight {percent(told['flight_fraction'])}" in titles["force"]
    assert titles["loads"].startswith(stroke.capitalize())
    assert "foundation, y " in titles["loads"]


def test_titles_of_runs_that_coast_down_do_not_speak_of_operation(saved):
    told, scene = read_json(saved["bare"], "summary"), RunResult.read(saved["bare"], "run").scene
    off = {"program": [{"t_s": 0.0, "supply_frequency_hz": 50.0, "off": True}]}
    run = SimpleNamespace(summary=told, scene=scene.replace({"drive": off}), name=told["name"])
    assert headlines.headline("exciters", [run]).startswith("Coasts with the motors off, at ")
    title = headlines.headline("motion", [run])
    assert title.startswith("It coasts down; largest stroke y "), "nothing of a steady motion"
    assert quantity(told["whole_stroke_y_m"], "m") in title
    assert (
        quantity(told["stroke_y_m"], "m") not in title.split(" at ")[0]
        or told["stroke_y_m"] == told["whole_stroke_y_m"]
    )


def test_runs_are_laid_over_each_other_from_a_whole_turn_on(saved, tmp_path, figures):
    places = [saved["two layers"], saved["bouncing"]]
    named = [f"{places[0]} (restitution 0)", f"{places[1]} (restitution 0.5)"]
    paths = plot_results(places)
    kinds = ("motion", "force", "exciters", "loads")
    assert [path.name for path in paths] == [f"{kind}-compared.png" for kind in kinds]
    for path in paths:
        path.unlink()
    top = figures["motion"].axes[0]
    assert all(0.0 <= line.get_xdata()[0] < 1e-3 for line in top.lines)
    assert texts(figures["motion"].legends[0]) == named
    assert len({line.get_color() for line in top.lines}) == 2
    assert not top.patches  # contact of two runs cannot be shaded
    for figure in figures.values():
        assert texts(figure.legends[0])[:2] == named


def test_measured_data_are_laid_over_a_run(saved, tmp_path):
    file = tmp_path / "rig.csv"
    pd.DataFrame({"t_s": [0.1, 0.2], "y_m": [1e-4, -2e-4]}).to_csv(file, index=False)
    top, gap = drawn(saved["two layers"], kinds=["motion"], data=read_data(file))["motion"].axes
    assert top.lines[-1].get_ydata() == pytest.approx([0.1e-3, -0.2e-3])
    assert top.lines[-1].get_label().startswith("measured: rig.csv, y differs by ")
    assert not any(line.get_marker() == "D" for line in gap.lines)


# -- intervals ------------------------------------------------------------------------------------------


def test_every_figure_shows_the_interval_asked_for(result):
    for figure in drawn(result, start=0.1, stop=0.15).values():
        for axis in figure.axes:
            times = np.concatenate(
                [line.get_xdata() for line in axis.lines if len(line.get_xdata()) and line.get_linestyle() != ":"]
            )
            assert 0.1 <= times.min() <= times.max() <= 0.15


@pytest.mark.parametrize(
    ("interval", "line"),
    [
        ({"start": 5.0}, "--start 5: DIR runs from 0 to 0.25 s; allowed: a time within it"),
        ({"stop": -1.0}, "--stop -1: DIR runs from 0 to 0.25 s; allowed: a time within it"),
        ({"start": 0.1, "stop": 0.1}, "--start 0.1 is not before --stop 0.1; DIR runs from 0 to 0.25 s"),
        ({"start": float("nan")}, "--start nan: DIR runs from 0 to 0.25 s; allowed: a time within it"),
        ({"start": 0.1001, "stop": 0.1002}, "no data between 0.1001 and 0.1002 s; DIR runs from 0 to 0.25 s"),
    ],
    ids=str,
)
def test_an_interval_without_data_is_refused_with_how_long_the_run_was(interval, line, result):
    assert refusal(result, **interval) == line


def test_an_interval_that_is_longer_than_the_run_is_told(caplog, result):
    drawn(result, start=0.1, stop=9.0)
    assert caplog.messages == [f"--stop 9: {result} runs from 0 to 0.25 s; the figures show what there is"]


# -- refused --------------------------------------------------------------------------------------------


def refusal(directory, **interval):
    """What the user is told instead of figures."""
    with pytest.raises(TableError) as caught:
        plot_results([directory], ["motion", "force"], **interval)
    assert list(directory.glob("*.png")) == []
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value).replace(str(directory), "DIR")


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"phi2_rad": None}, "column phi2_rad"),
        ({"mode": None}, "column mode"),
        ({"gap_m": "text"}, "numbers in column gap_m"),
        ({"y_m": True}, "numbers in column y_m"),
    ],
    ids=str,
)
def test_the_column_that_cannot_be_drawn_is_named(change, told, result):
    ((column, values),) = change.items()
    table = read_table(result, "trajectory")
    changed = table.drop(columns=column) if values is None else table.assign(**change)
    write_table(changed, result, "trajectory", "parquet")
    assert refusal(result) == f"the trajectory table in DIR has no {told}"


def test_dollar_signs_in_names_are_drawn_as_they_are(result):
    name = r"10 $ and $\frac$ x"
    edited(result, "summary", name=name)
    shown, mathematics = Text()._preprocess_math(
        drawn(result, kinds=["exciters"])["exciters"].axes[0].get_title(loc="left")
    )
    assert shown.startswith(name.replace("$", r"\$"))
    assert mathematics == "tex" or mathematics is True  # that of the parameters
