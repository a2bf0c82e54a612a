"""Figures of accelerations: spectra, and what is drawn of which run."""

import itertools

import numpy as np
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from vibroplat.config.digits import quantity
from vibroplat.config.scene import Scene
from vibroplat.errors import TableError
from vibroplat.plots.histories import RunTables, spectrum_of
from vibroplat.results.tables import read_json, read_table

from .conftest import drawn

TURN = 2.0 * np.pi


def run_of_rows(t, scene):
    """Rows of a run at 25 Hz at some times."""
    values = 1.0 + 3.0 * np.cos(TURN * 25.0 * t) + 0.2 * np.sin(TURN * 75.0 * t)
    table = pd.DataFrame({"t_s": t, "phi1_rad": TURN * 25.0 * t, "a": values, "speed_1_hz": 25.0, "speed_2_hz": -25.0})
    return RunTables("hand", scene, table, table, table, table, False, False, True)


@pytest.mark.parametrize(("begin", "scene"), [(0, None), (0, Scene()), (20_000_000, Scene())])
def test_a_spectrum_has_the_amplitude_of_what_repeats_within_whole_turns(begin, scene):
    """Also where rows begin within a turn, events have added some, two at a time, and round-off of late times shows."""
    run = run_of_rows(np.sort([*(np.arange(begin, begin + 862) / 2000.0), *[begin / 2000.0 + 0.21013] * 2]), scene)
    frequencies, sizes = spectrum_of(run, "a")
    assert frequencies[1] == pytest.approx(2.5)
    assert sizes[[10, 30]] == pytest.approx([3.0, 0.2], rel=1e-9)
    assert np.delete(sizes, [9, 10, 11, 29, 30, 31]).max() < 1e-9


@pytest.mark.parametrize(("rate", "seconds", "lacking"), [
    (50.0, 4.0, "2.0 samples a turn"), (40.0, 4.0, "1.6 samples a turn"),
    (100.0, 0.05, "4 samples"), (51.0, 4.0, ""), (2000.0, 0.05, ""),
])  # fmt: skip
def test_few_samples_give_no_spectrum(rate, seconds, lacking):
    """Two samples a turn or fewer would show the excitation at another frequency."""
    scene = Scene().replace({"output.sample_rate_hz": rate})
    assert run_of_rows(np.arange(0.0, seconds + 0.5 / rate, 1.0 / rate), scene).too_coarse == lacking


def test_accelerations_are_drawn_where_there_are_some(moved, saved, tmp_path):
    figures = drawn("run", moved)
    assert {"acceleration", "spectrum"} <= {*figures}
    assert "measured" not in figures
    largest = quantity(read_json(moved, "summary")["acceleration_max_m_per_s2"], "m/s²")
    assert figures["acceleration"].get_suptitle().startswith(f"Acceleration {largest}")
    vertical, *_ = figures["acceleration"].axes
    table = read_table(moved, "trajectory")
    assert vertical.lines[0].get_ydata()[-1] == table["acceleration_y_m_per_s2"].iloc[-1]
    FigureCanvasAgg(figures["spectrum"]).draw()
    orders = [text.get_window_extent() for text in figures["spectrum"].axes[0].texts]
    assert len(orders) > 3
    assert all(one.x1 < other.x0 for one, other in itertools.pairwise(orders)), "names of orders lie on each other"
    for kind, line in (("spectrum", "has no accelerations; simulate it with"), ("measured", "needs --data FILE")):
        with pytest.raises(TableError, match=f"figure {kind}: .*{line}"):
            drawn("run", saved["bare"], kinds=[kind])
    with pytest.raises(TableError, match=r"figure spectrum: .* too few samples for a spectrum \(5 samples of run "):
        drawn("run", moved, kinds=["spectrum"], start=0.1, stop=0.1021)


def test_data_are_fitted_and_compared_with_any_column(moved, data_file):
    """In the time of another clock; each column has a panel, and the figure says how far they are apart."""
    table = read_table(moved, "trajectory").drop_duplicates("t_s")
    table = table[table["t_s"].between(0.13, 0.2)]
    data = data_file(table.assign(t_s=table["t_s"] + 100.0), "acceleration_x_tip_m_per_s2", "phi1_rate_rad_per_s")
    (figure,) = drawn("run", moved, kinds=["measured"], start=0.1, data=data).values()
    assert [axis.get_title(loc="left").splitlines()[-1] for axis in figure.axes] == ["differs by < 0.1 %"] * 2
    assert "measured data shifted by −100 s" in figure.axes[0].get_title(loc="left").splitlines()
    assert [axis.lines[1].get_marker() for axis in figure.axes] == ["D"] * 2
