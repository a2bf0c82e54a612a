"""A run at a prompt and in a notebook: card, figure, files."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from common.results import edited, unproven
from scipy.io import loadmat

from vibroplat import Scene, load, simulate
from vibroplat.errors import ConfigError, TableError
from vibroplat.page.report import write_report
from vibroplat.plots.command import plot_results


@pytest.fixture(scope="module")
def run(runs):
    return runs["two layers"]


@pytest.fixture
def saved(run, tmp_path):
    return run.save(tmp_path / "saved")


def test_a_run_shows_its_answer(run):
    first, second, *lines = repr(run).splitlines()
    assert first == "vibroplat run quickstart"
    assert second.startswith(f"quickstart: runs at {run.summary['excitation_frequency_hz']:.2f} Hz (15")
    assert lines[0].split()[:4] == ["stroke", "y", f"{1e3 * run.summary['stroke_y_m']:.2f}", "mm"]
    assert len(lines) < 11
    assert max(map(len, lines)) <= 110


def test_a_run_that_failed_says_why(kernels):
    run = simulate(Scene().replace({"run.initial.state": {"phi_rad": 1e20}, "run.duration_s": 0.1}))
    assert repr(run).splitlines()[1] == "scene: STOPPED at 0: outside-model-validity"
    assert "\noutside-model-validity: the platform has turned by 1e+20 rad" in repr(run)
    assert "<img" not in run._repr_html_()  # there is nothing to draw


def test_a_notebook_has_the_answer_and_a_picture(run):
    page = run._repr_html_()
    assert "quickstart: runs at " in page
    assert page.count("data:image/png;base64,") == 1


def test_a_figure_shows_itself_in_a_notebook_and_is_none_of_pyplots(run):
    before = plt.get_fignums()
    picture = run.plot("motion")._repr_png_()
    assert picture.startswith(b"\x89PNG")
    assert int.from_bytes(picture[16:20]) == 8 * 130  # inches, dots per inch
    assert plt.get_fignums() == before


def test_saved_run_is_the_same_when_it_is_loaded(run, saved):
    found = load(saved)
    assert (found.scene, found.outcome, found.notes) == (run.scene, run.outcome, run.notes)
    assert found.summary == run.summary | {"notes": run.notes}
    pd.testing.assert_frame_equal(found.trajectory, run.trajectory)
    pd.testing.assert_frame_equal(found.events, run.events)
    assert found.trajectory.attrs == run.trajectory.attrs
    assert repr(found) == repr(run)
    assert found.plot("force").axes


def test_mat_file_has_tables_summary_and_units(run, tmp_path):
    found = loadmat(run.save_mat(tmp_path / "a.mat"), simplify_cells=True)
    assert (np.diff(found["trajectory"]["t_s"]) > 0.0).all()
    assert found["trajectory"]["gap_m"].tolist() == run.rows("unique")["gap_m"].tolist()
    assert found["trajectory"]["mode"].tolist() == run.rows("unique")["mode"].tolist()
    assert found["events"]["impulse_n_s"].tolist() == run.events["impulse_n_s"].tolist()
    assert found["summary"]["rms_y_m"] == run.summary["rms_y_m"]
    assert found["units"]["gap_rate_m_per_s"] == "m/s"


def test_unique_rows_ascend_and_begin_after_an_event(run):
    rows, events = run.rows("unique"), run.events
    assert (np.diff(rows["t_s"]) > 0.0).all()
    assert len(run.rows()) - len(rows) == len(events)
    impact = events[events["kind"] == "impact"].iloc[0]
    after = rows.loc[rows["t_s"] == impact["t_s"], "gap_rate_m_per_s"].item()
    assert after == pytest.approx(impact["gap_rate_after_m_per_s"], abs=1e-9)
    with pytest.raises(ConfigError, match="sample = 'some'; allowed: all, unique"):
        run.rows("some")


def test_dataset_has_units_and_meanings(run):
    pytest.importorskip("xarray", reason="optional, pip install 'vibroplat[xarray]'")
    found = run.to_xarray()
    assert found["y_m"].attrs["units"] == "m"
    assert found["gap_m"].attrs["long_name"] == "gap between platform and lower layer; 0: in contact"
    assert found["y_m"].interp(t_s=0.1).item() == pytest.approx(run([0.1])["y_m"].item(), abs=1e-5)
    assert found.attrs == {"name": "quickstart", "outcome": "ok"}


@pytest.mark.parametrize("keep", ["summary", "events", "segments"])
def test_a_run_without_its_table_needs_no_sample_rate(quickstart, monkeypatch, keep):
    """Neither run nor notes make a table that nobody asked for."""
    fine = quickstart.replace({"run.duration_s": 0.2, "output.sample_rate_hz": 1e12})
    run = simulate(fine, keep=keep)
    with monkeypatch.context() as without:
        without.setattr("vibroplat.results.run.TrajectoryRows", None)
        assert repr(run)
        assert isinstance(run.notes, list)
    if keep == "segments":
        with pytest.raises(ConfigError, match=r"^output.sample_rate_hz = 1e\+12 asks for"):
            _ = run.trajectory


@pytest.mark.parametrize(("name", "value"), [("rms_phi_rad", None), ("outcome", None), ("motor_torque_1_mean_n_m", {})])
def test_a_summary_that_no_run_has_written_is_told_in_a_line_by_all_readers(saved, name, value):
    edited(unproven(saved), "summary", **{name: value})
    readers = (lambda: load(saved).answer, lambda: plot_results([saved], ["force"]), lambda: write_report([saved]))
    for read in readers:
        with pytest.raises(
            TableError, match=r"summary\.json cannot be used \(\w+Error: .*\): not as vibroplat writes it"
        ):
            read()


def test_what_readers_do_not_check_is_a_line_too(saved):
    edited(saved, "provenance", libraries={"numpy": [1]})
    with pytest.raises(TableError, match=r"saved cannot be used \(TypeError: "):
        write_report([saved])
