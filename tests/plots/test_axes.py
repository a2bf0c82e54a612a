"""Curves and axes: what a reader of a figure could be misled by."""

import numpy as np
import pandas as pd
import pytest
from common.handmade import after, branch

from vibroplat.config.digits import quantity
from vibroplat.config.scene import Scene
from vibroplat.page import panels
from vibroplat.page.tables import table_html
from vibroplat.page.view import View
from vibroplat.plots.histories import RunTables
from vibroplat.plots.pictures import draw_picture
from vibroplat.plots.run import FIGURES
from vibroplat.plots.run_picture import RunPicture
from vibroplat.results import content
from vibroplat.results.picture import Panel, Picture, Series
from vibroplat.study.curves import curves_of, fill_failed
from vibroplat.study.sweeps import Sweeps


def drawn(rows, column="rms_y_m", x="excitation_frequency_hz"):
    """The axis of a column of a branch."""
    sweeps = Sweeps([], [], rows, "supply_frequency_hz", [], x)
    series, _ = curves_of(sweeps, [column], {"": "k"}, mark_aperiodic=True)
    table = rows.assign(**{x: fill_failed(rows, x)})
    look = {"panels": [Panel(column)], "states": content.motions_of(rows)}
    return draw_picture(Picture("", "", "", table, "", [x], series=series, **look)).axes[0]


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


def run(scene=None, **columns):
    """A run of one trajectory by hand."""
    table = pd.DataFrame({"t_s": np.linspace(0.0, 3.0, 301), "phi1_rate_rad_per_s": 1.0, "phi2_rate_rad_per_s": 1.0})
    table = table.assign(
        speed_1_hz=1.0, speed_2_hz=1.0, mode="bare", **{n: f(table["t_s"]) for n, f in columns.items()}
    )
    ends = {f"speed_{n}_hz:{end}": 1.0 for n in (1, 2) for end in ("min", "max")}
    told = {"name": "hand", "outcome": "by hand", "simulated_s": 3.0}
    return RunTables(
        "hand", scene, table, table[["t_s"]].assign(**ends), table, table.iloc[:0], False, True, True, told
    )


def exciters(shown):
    return draw_picture(FIGURES["exciters"](RunPicture([shown]))).axes


@pytest.mark.parametrize(("largest", "unit"), [(980.0, "N"), (2500.0, "kN")])
def test_print_figure_page_and_table_have_one_unit(largest, unit):
    """Of a force whose axis goes beyond the next prefix, and of a mean beside it."""
    table = pd.DataFrame({"supply_frequency_hz": [50.0, 51.0], "contact_force_max_n": [largest, 0.5 * largest]})
    look = {"panels": [Panel("contact_force_max_n")], "series": [Series("", [0, 1])]}
    picture = Picture("", "", "", table, "", ["supply_frequency_hz"], **look)
    figure = draw_picture(picture)
    assert quantity(largest, "N").endswith(f" {unit}")
    assert figure.axes[0].get_ylabel() == f"largest $F_c$ ({unit})"
    view = View(picture, "supply_frequency_hz", np.arange(2))
    assert f"<b>largest contact force</b> {unit} " in panels.points(view, picture.panels[0], picture.series).html()
    page = table_html("", table.assign(foundation_force_y_mean_n=200.0))
    assert f"largest contact force ({unit})" in page
    assert f"foundation force y mean ({unit})" in page


def test_a_jump_is_not_joined():
    rows = branch(phase_difference_rad=after(8, np.pi, 0.0), sync=after(8, "antiphase", "in-phase"))
    (line,) = lines(drawn(rows))
    height = line.get_ydata()
    assert np.flatnonzero(np.isnan(height)).tolist() == [8]
    assert height[np.isfinite(height)] == pytest.approx(rows["rms_y_m"].to_numpy())
    assert np.isfinite(lines(drawn(branch()))[0].get_ydata()).all()


def test_motions_are_told_apart_by_the_filling_of_markers():
    motions = np.array(["periodic", "chaotic", "quasi-periodic", "undecided", "non-periodic"] * 4 + ["periodic"])
    axis = drawn(branch(motion=motions))
    found = {filling: len(points(axis, filling)[0].get_xdata()) for filling in ("none", "bottom")}
    assert found == {"none": 12, "bottom": 4}  # what is periodic has a line alone


def test_failed_points_have_a_marker_of_their_own_on_the_axis():
    failed = np.arange(21) >= 18
    rows = branch(outcome=np.where(failed, "too-many-events", "ok"))
    columns = ["excitation_frequency_hz", "rms_x_m", "rms_y_m", "phase_difference_rad", "sync"]
    rows.loc[failed, columns] = np.nan
    axis = drawn(rows)
    crosses, *_ = points(axis, marker="x")
    assert crosses.get_xdata() == pytest.approx(0.5 * rows["supply_frequency_hz"][failed].to_numpy())
    assert crosses.get_transform() == axis.get_xaxis_transform()
    assert np.isfinite(lines(axis)[0].get_ydata()).sum() == 18
    assert fill_failed(rows, "supply_frequency_hz")[failed].tolist() == [51.0, 51.5, 52.0]
    lost = rows.assign(outcome="too-many-events", sync=None, **dict.fromkeys(columns[:4], np.nan))
    assert np.isnan(fill_failed(lost, "excitation_frequency_hz")).all()
    assert len(points(drawn(lost, x="supply_frequency_hz"), marker="x")[-1].get_xdata()) == 21


def test_wraps_of_the_phase_difference_are_not_drawn():
    phase = exciters(run(phi1_rad=lambda t: 100.0 * t, phi2_rad=lambda t: -95.0 * t))[1]
    values = phase.lines[0].get_ydata()
    steps = np.diff(values)
    assert np.isnan(values).sum() == 2
    assert np.abs(steps[np.isfinite(steps)]).max() < 0.1
    assert phase.get_ylabel() == r"$\Delta\varphi$ = $\varphi_1 + \varphi_2$"


def test_phase_differences_near_both_synchronizations_stay_whole():
    for mean in (0.0, np.pi):
        shown = run(phi1_rad=lambda t, mean=mean: mean + 0.5 * np.sin(20.0 * t), phi2_rad=lambda t: 0.0 * t)
        assert np.isfinite(exciters(shown)[1].lines[0].get_ydata()).all()


def test_synchronous_speed_follows_the_program_and_ends_where_a_motor_is_off():
    program = [
        {"t_s": 0.0, "supply_frequency_hz": 0.0},
        {"t_s": 1.5, "supply_frequency_hz": 50.0},
        {"t_s": 2.25, "exciter_2": "off"},
    ]
    angles = {"phi1_rad": lambda t: t, "phi2_rad": lambda t: t}
    _, speed = exciters(run(Scene().replace({"drive": {"program": program}}), **angles))[0].lines
    assert speed.get_ydata()[[0, 100, 400]] == pytest.approx([0.0, 12.5, 25.0])
    off = [*program, {"t_s": 2.6, "off": True}]
    _, speed = exciters(run(Scene().replace({"drive": {"program": off}}), **angles))[0].lines
    assert np.isnan(speed.get_ydata()[-1])
