"""Runs on the page: the data sheet, curves over all of the run, and turns in which the machine moves."""

import itertools
import json
import re
import shutil

import numpy as np
import pytest
from common.pages import figures_of, frames_of, page_of, read, unpacked
from common.results import edited, unproven

from vibroplat.config.scene import Scene
from vibroplat.errors import TableError
from vibroplat.page.machine import drawing, machine_of
from vibroplat.page.report import sheet_html
from vibroplat.page.results import find_results
from vibroplat.page.run import windows_of
from vibroplat.results.sheet import Sheet
from vibroplat.results.tables import read_json, read_table, write_table


def rewritten(source, place, **changes):
    """Copy a run with another summary; None takes an entry out."""
    return edited(unproven(shutil.copytree(source, place)), "summary", **changes)


def rows_of(sheet):
    return {row.label: row for rows in sheet.groups.values() for row in rows}


# -- the data sheet -------------------------------------------------------------------------------------

LOADS = {
    "foundation_force_y_amplitude_n": 853.0,
    "foundation_force_y_mean_n": -14126.4,
    "foundation_force_y_max_n": 14979.4,
}
LOADS |= {
    "whole_foundation_force_y_max_n": 15713.8,
    "whole_foundation_force_y_max_at_s": 0.4538,
    "whole_foundation_force_y_max_at_hz": 23.41,
}
LOADS |= {"foundation_force_x_max_n": 0.0157, "whole_foundation_force_x_max_n": 54.3}
LOADS |= {"whole_foundation_force_x_max_at_s": 0.32, "whole_foundation_force_x_max_at_hz": 11.87}
#: Without what a start has left.
STEADY = {"transient_x_m": 0.0, "transient_y_m": 0.0}
POWERS = {"motor_power_1_mean_w": 959.9, "motor_power_2_mean_w": 960.1, "whole_motor_power_1_max_w": 4621.0}


@pytest.fixture
def sheet(saved):
    """Write the data sheet of the bare run with other entries in its summary."""
    (result,) = find_results([saved["bare"]])
    return lambda **changes: Sheet(result.scene, result.summary | changes)


UNLIKE = POWERS | {"motor_power_2_mean_w": 1200.0, "slip_1": 0.0005, "slip_2": 0.0009}
DRIFTING = {"excitation_frequency_hz": 25.0, "frequency_split_hz": 2.0, "phase_coherence": 0.1}
ALONE = DRIFTING | {"excitation_frequency_hz": 12.295, "frequency_split_hz": 24.5894}
FORCE = "y, static ± dynamic"


@pytest.mark.parametrize(
    ("changes", "label", "wanted"),
    [
        (LOADS | STEADY, FORCE, {"now": "123 ± 853 N", "also": "", "most": "15.7 kN", "when": "0.454 s, 23.4 Hz"}),
        # 1/1000 of the dynamic force along y is nothing
        (LOADS | STEADY, "x", {"now": "0", "also": "", "most": "54.3 N", "when": "0.320 s, 11.9 Hz"}),
        (STEADY | LOADS | {"foundation_force_y_amplitude_n": 900.0}, FORCE, {"now": "123 ± 900 N"}),
        (POWERS, "power, mean", {"now": "960 W"}),
        (UNLIKE, "power, mean", {"now": "0.960 / 1.20 kW", "most": "4.62 kW"}),
        (UNLIKE, "slip", {"now": "0.1 %"}),
        (DRIFTING, "speeds", {"now": "26.00 Hz / 24.00 Hz"}),
        (DRIFTING, "phase difference", {"now": "drifts"}),
        (ALONE, "speeds", {"now": "24.59 Hz / 0"}),
        (
            {"period": 1, "stroke_change": 0.14},
            "motion repeats",
            {"also": "strokes change by 14 %"},
        ),
        ({"period": 1, "stroke_change": 0.001}, "motion repeats", {"now": "every turn", "also": ""}),
    ],
)
def test_a_row_of_the_sheet_says_what_the_summary_has(changes, label, wanted, sheet):
    row = rows_of(sheet(**changes))[label]
    assert {name: getattr(row, name) for name in wanted} == wanted


def test_each_spring_at_a_point_has_its_static_and_dynamic_force(sheet):
    forces = {"spring_force_mean_inlet_n": -3500.0, "spring_force_amplitude_inlet_n": 210.0}
    forces |= {"spring_force_max_inlet_n": 3710.0, "whole_spring_force_max_inlet_n": 3900.0}
    row = sheet(**forces)._spring("inlet")
    assert (row.label, row.now, row.most) == ("each spring at inlet, static ± dynamic", "3.50 ± 0.21 kN", "3.90 kN")
    assert row.short == ("spring at inlet", "3.50 ± 0.21 kN", "each, static ± dynamic")
    alone = sheet(**forces | {"spring_force_amplitude_inlet_n": 0.1})._spring("inlet")
    assert alone.short == ("spring at inlet", "3.50 kN", "each, static"), "nothing moves"


def test_a_summary_of_an_old_version_has_what_it_has(saved, sheet):
    (result,) = find_results([saved["bare"]])
    old = {
        key: value
        for key, value in result.summary.items()
        if not key.startswith(("foundation", "whole", "stroke", "motor_p", "motor_t", "slip", "torque"))
    }
    rows = rows_of(Sheet(result.scene, old))
    assert rows["RMS x, y"].now.endswith("mm")
    assert "y, static ± dynamic" not in rows
    assert Sheet(result.scene, {"outcome": "solver-failure"}).groups == {}


def test_a_run_with_motors_off_is_not_in_operation(saved, sheet):
    (result,) = find_results([saved["bare"]])
    assert '"col">in operation</th>' in sheet_html([sheet()], [""])
    off = result.scene.replace({"drive.program": [{"t_s": 0.0, "supply_frequency_hz": 50.0, "off": True}]})
    assert '"col">while it coasts down</th>' in sheet_html([Sheet(off, result.summary)], [""])


def test_several_runs_have_a_column_each(saved):
    runs = find_results([saved["two layers"], saved["bare"]])
    text = sheet_html([Sheet(one.scene, one.summary) for one in runs], ["<one>", "two"])
    assert "&lt;one&gt;" in text
    assert text.count("<td>") == 2 * (text.count("<tr><th") - 1), "one row has the headings"
    assert ">Material</th>" in text


def test_of_several_runs_a_colour_is_a_run_and_their_last_turns_stand_beside_each_other(saved):
    """Those of the run with more last turns, as of one that does not repeat, are cut to the shortest."""
    text = page_of(saved["two layers"], saved["bouncing"])
    figure = figures_of(text)["y from rest, from a whole turn on"]
    names = ["quickstart (two layers)", "quickstart (bouncing)"]
    assert [name for name in figure.names if "underside" not in name] == names
    first, second = (figure.points(name)[:, 0] for name in names)
    assert np.ptp(first) == pytest.approx(np.ptp(second), rel=0.1)
    assert first.min() == pytest.approx(second.min(), abs=1e-3)
    assert re.search('stroke-dasharray:6 3"/></svg> underside of the material', text)


# -- curves ---------------------------------------------------------------------------------------------


def test_curves_have_the_extremes_of_all_of_the_run(saved):
    """Forces follow from springs and dampers; what is on the page lies on the curves of the run to a pixel."""
    figures = figures_of(page_of(saved["two layers"]))
    trajectory, summary = read_table(saved["two layers"], "trajectory"), read_json(saved["two layers"], "summary")
    y = 1e3 * (trajectory["y_m"] + summary["static_sag_m"])
    shown = figures["y from rest"].points("platform")[:, 1]
    assert [shown.min(), shown.max()] == pytest.approx([y.min(), y.max()], abs=0.01 * np.ptp(y))
    force = figures["Force y into foundation"]
    whole = np.abs(force.points("force y into foundation")[:, 1]).max() * (1e3 if force.unit == "kN" else 1.0)
    assert whole == pytest.approx(summary["whole_foundation_force_y_max_n"], rel=0.02)


def test_impulses_and_the_machine_cover_the_whole_run(saved):
    text = page_of(saved["two layers"])
    events = read_table(saved["two layers"], "events")
    struck = events[events["impulse_n_s"] > 0.0]
    (motion,) = frames_of(text)
    assert figures_of(text)["Impulse P"].ends(0)[1] > struck["t_s"].max()
    first, last = motion["windows"][0], motion["windows"][-1]
    assert first[0] < 1.1 / 25.0
    assert last[0] + last[1] > read_table(saved["two layers"], "trajectory")["t_s"].iloc[-1] - 1.1 / 25.0
    assert len(motion["hits"]) > 0.8 * len(struck) > 0


def test_frames_are_where_the_machine_was(saved):
    (motion,) = frames_of(page_of(saved["two layers"]))
    trajectory, sag = (
        read_table(saved["two layers"], "trajectory"),
        read_json(saved["two layers"], "summary")["static_sag_m"],
    )
    begin, seconds, first, count = motion["windows"][-1]
    times = begin + seconds * np.arange(count) / count
    y = np.interp(times, trajectory["t_s"], trajectory["y_m"]) + sag
    np.testing.assert_allclose(unpacked(motion["columns"]["y_m"])[first : first + count], y, atol=1e-3 * np.ptp(y))
    angle = np.interp(times, trajectory["t_s"], trajectory["phi1_rad"])
    shown = unpacked(motion["columns"]["phi1_rad"])[first : first + count]
    np.testing.assert_allclose(np.exp(1j * shown), np.exp(1j * angle), atol=2e-3)


def test_turns_lie_evenly_over_a_start_and_a_stop_and_each_begins_at_one_angle():
    t = np.linspace(0.0, 20.0, 40_001)
    speed = 25.0 * np.clip(np.minimum(t, 20.0 - t) / 4.0, 0.0, 1.0)
    turns = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))])
    windows = windows_of(t, turns, 25.0, 1)
    begins = np.array([begin for begin, _, _ in windows])
    assert begins[0] == 0.0
    assert windows[-1][1] > 19.5
    assert np.diff(begins).max() < 1.0
    running = [(a, b) for a, b, _ in windows if 2.0 < a < 18.0]
    for a, b in running:
        np.testing.assert_allclose(np.interp([a, b], t, turns) % 1.0 % 0.999, 0.0, atol=2e-3)
    assert all(b <= c for (_, b, _), (c, _, _) in itertools.pairwise(windows))


def test_a_machine_that_does_not_turn_is_shown_by_time():
    t = np.linspace(0.0, 2.0, 2001)
    windows = windows_of(t, 0.0 * t, None, 1)
    assert windows[0][0] == 0.0
    assert windows[-1][1] == 2.0


def test_speeds_of_exciters_are_in_hz_and_phases_in_degrees(saved):
    figures = figures_of(page_of(saved["bare"]))
    trajectory = read_table(saved["bare"], "trajectory")
    speed = figures["Speed"]
    assert speed.unit == "Hz"
    wanted = np.abs(trajectory["phi1_rate_rad_per_s"]) / (2.0 * np.pi)
    assert speed.points(speed.names[0])[:, 1].mean() == pytest.approx(wanted.mean(), rel=0.01)
    assert figures["Δφ = φ1 + φ2"].unit == "°"


def test_a_machine_without_material_has_no_curves_of_it(saved):
    assert not [title for title in figures_of(page_of(saved["bare"])) if title.startswith(("Gap", "Contact force"))]
    assert {"Gap", "Contact force"} <= {*figures_of(page_of(saved["two layers"]))}


def test_the_interval_of_a_run_can_be_chosen(saved):
    text = page_of(saved["two layers"], start=0.05, stop=0.1)
    (motion,) = frames_of(text)
    ends = motion["windows"][0][0], sum(motion["windows"][-1][:2])
    assert 0.05 <= ends[0] < ends[1] <= 0.1 + 1e-4
    detail = figures_of(text)["y from rest"]
    assert detail.ends(0) == pytest.approx([0.05, 0.1], abs=4e-3)
    with pytest.raises(TableError, match=r"--start 3: .* runs from 0 to 0\.25 s; allowed: a time within it"):
        page_of(saved["bare"], start=3.0, stop=4.0)


@pytest.mark.long
def test_a_start_says_when_it_is_steady_and_shows_its_speeds(started):
    text = page_of(started)
    assert "Speed until the stroke is steady" in figures_of(text)
    assert frames_of(text)[0]["windows"][0][0] == pytest.approx(0.0, abs=0.05)


# -- odd runs -------------------------------------------------------------------------------------------


def test_a_failed_run_tells_its_outcome_first(saved, tmp_path):
    copy = rewritten(
        saved["bare"], tmp_path / "copy", outcome="too-many-events", detail="more than 10", notes=["look twice"]
    )
    write_table(read_table(copy, "trajectory").iloc[:0], copy, "trajectory", "csv")
    text = page_of(copy)
    assert '<p class="answer bad">too-many-events: more than 10</p>' in text
    assert "Note: look twice" in read(text)
    assert 'id="frames"' not in text
    assert "All curves" not in text
    assert "RMS" in read(text)


def test_a_run_without_a_measured_part_has_no_sheet(saved, tmp_path):
    copy = rewritten(saved["bare"], tmp_path / "copy")
    nothing = dict.fromkeys(("rms_y_m", "rms_x_m", "excitation_frequency_hz"))
    (copy / "summary.json").write_text(json.dumps(read_json(copy, "summary") | nothing))
    text = page_of(copy)
    assert "Nothing measured" in text
    assert '<table class="sheet' not in text
    assert frames_of(text)[0]["windows"]


def test_a_captured_start_says_so_first(saved, tmp_path):
    text = page_of(rewritten(saved["bare"], tmp_path / "copy", captured_by="y"))
    assert '<p class="answer bad">CAPTURED by the resonance in y' in text


# -- the drawing ----------------------------------------------------------------------------------------


def test_the_drawing_has_the_layers_of_the_scene_and_ways_of_turning(quickstart_scene):
    two = drawing(machine_of(quickstart_scene), "x")
    assert two.count('class="between"') == 3
    bare = quickstart_scene.replace({"material.mass_ratio": 0.0})
    assert 'class="lower"' not in drawing(machine_of(bare), "x")
    one = Scene.from_tree(quickstart_scene.to_tree() | {"contact": {"model": "non-impact"}})
    assert drawing(machine_of(one), "x").count('class="arm"') == 2
