"""Functions that draw tables into axes: what a reader of a figure could be misled by."""

import numpy as np
import pandas as pd
import pytest
from common.handmade import after, branch
from matplotlib.figure import Figure

from vibroplat.config.scene import Scene
from vibroplat.plots import (
    draw_phase_difference,
    draw_response,
    draw_synchronous_speed,
)
from vibroplat.study.curves import failed_places


@pytest.fixture
def axis():
    return Figure().add_subplot()


def lines(axis):
    return [line for line in axis.lines if line.get_linestyle() != "None"]


def points(axis, fillstyle=None, marker=None):
    """Markers with a filling, or of a kind."""
    return [
        line
        for line in axis.lines
        if line.get_marker() != "None"
        and (fillstyle is None or line.get_fillstyle() == fillstyle)
        and (marker is None or line.get_marker() == marker)
    ]


def test_a_jump_is_not_joined(axis):
    rows = branch(phase_difference_rad=after(8, np.pi, 0.0), sync=after(8, "antiphase", "in-phase"))
    draw_response(axis, rows, "rms_y_m")
    (line,) = lines(axis)
    height = line.get_ydata()
    assert np.flatnonzero(np.isnan(height)).tolist() == [8]
    assert height[np.isfinite(height)] == pytest.approx(1e3 * rows["rms_y_m"].to_numpy())
    smooth = draw_response(Figure().add_subplot(), branch(), "rms_y_m")
    assert np.isfinite(lines(smooth)[0].get_ydata()).all()


def test_motions_are_told_apart_by_the_filling_of_markers(axis):
    motions = np.array(["periodic", "chaotic", "quasi-periodic", "undecided", "non-periodic"] * 4 + ["periodic"])
    draw_response(axis, branch(motion=motions), "rms_y_m")
    found = {filling: len(points(axis, filling)[0].get_xdata()) for filling in ("none", "bottom")}
    assert found == {"none": 12, "bottom": 4}  # what is periodic has a line alone


def test_failed_points_have_a_marker_of_their_own_on_the_axis(axis):
    failed = np.arange(21) >= 18
    rows = branch(outcome=np.where(failed, "event-storm", "ok"))
    columns = ["excitation_frequency_hz", "rms_x_m", "rms_y_m", "phase_difference_rad", "sync"]
    rows.loc[failed, columns] = np.nan
    draw_response(axis, rows, "rms_y_m")
    crosses, *_ = points(axis, marker="x")
    assert crosses.get_xdata() == pytest.approx(0.5 * rows["supply_frequency_hz"][failed].to_numpy())
    assert crosses.get_transform() == axis.get_xaxis_transform()
    assert np.isfinite(lines(axis)[0].get_ydata()).sum() == 18
    assert failed_places(rows, "supply_frequency_hz").tolist() == [51.0, 51.5, 52.0]
    lost = rows.assign(outcome="event-storm", sync=None, **dict.fromkeys(columns[:4], np.nan))
    assert np.isnan(failed_places(lost, "excitation_frequency_hz")).all()
    draw_response(axis, lost, "rms_y_m", x="supply_frequency_hz")
    assert len(points(axis, marker="x")[-1].get_xdata()) == 21


def test_wraps_of_the_phase_difference_are_not_drawn(axis):
    t = np.linspace(0.0, 3.0, 301)
    run = pd.DataFrame({"t_s": t, "phi1_rad": 100.0 * t, "phi2_rad": -95.0 * t})
    draw_phase_difference(axis, run)
    values = axis.lines[0].get_ydata()
    steps = np.diff(values)
    assert np.isnan(values).sum() == 2
    assert np.abs(steps[np.isfinite(steps)]).max() < 0.1
    assert axis.get_ylabel() == r"$\Delta\varphi$ = $\varphi_1 + \varphi_2$"
    draw_phase_difference(axis, run, co_rotating=True)
    assert axis.get_ylabel() == r"$\Delta\varphi$ = $\varphi_1 - \varphi_2$"


def test_phase_differences_near_both_synchronizations_stay_whole(axis):
    t = np.linspace(0.0, 1.0, 50)
    for mean in (0.0, np.pi):
        run = pd.DataFrame({"t_s": t, "phi1_rad": mean + 0.5 * np.sin(20.0 * t), "phi2_rad": 0.0})
        draw_phase_difference(axis, run)
    assert all(np.isfinite(line.get_ydata()).all() for line in axis.lines)


def test_synchronous_speed_follows_the_program_and_ends_where_a_motor_is_off(axis):
    program = [
        {"t_s": 0.0, "supply_frequency_hz": 0.0},
        {"t_s": 2.0, "supply_frequency_hz": 50.0},
        {"t_s": 3.0, "exciter_2": "off"},
    ]
    scene = Scene().replace({"drive": {"program": program}})
    draw_synchronous_speed(axis, scene, pd.Series([0.0, 4.0]))
    assert [line.get_label() for line in axis.lines] == ["synchronous speed"]
    assert axis.lines[0].get_ydata()[[0, 250, 1000]] == pytest.approx([0.0, 12.5, 25.0])
    off = [*program, {"t_s": 3.5, "off": True}]
    draw_synchronous_speed(axis, Scene().replace({"drive": {"program": off}}), pd.Series([0.0, 4.0]))
    assert np.isnan(axis.lines[1].get_ydata()[-1])
