"""Figures of accelerations: spectra, and what is drawn of which run."""

import itertools

import numpy as np
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from vibroplat.errors import TableError
from vibroplat.plots.histories import RunTables, spectrum_of
from vibroplat.results.tables import read_table

from .conftest import drawn

TURN = 2.0 * np.pi


def test_a_spectrum_has_the_amplitude_of_what_repeats_within_whole_turns():
    """Also where rows begin within a turn, and events have added some, two at a time."""
    t = np.sort(np.concatenate([np.arange(0.0, 0.4305, 5e-4), [0.21013, 0.21013]]))
    values = 1.0 + 3.0 * np.cos(TURN * 25.0 * t) + 0.2 * np.sin(TURN * 75.0 * t)
    table = pd.DataFrame({"t_s": t, "phi1_rad": TURN * 25.0 * t, "a": values})
    run = RunTables("hand", None, table, table, table, table, False, False, True)
    frequencies, sizes = spectrum_of(run, "a")
    assert frequencies[1] == pytest.approx(2.5)
    assert sizes[[10, 30]] == pytest.approx([3.0, 0.2], rel=1e-9)
    assert np.delete(sizes, [9, 10, 11, 29, 30, 31]).max() < 1e-9


def test_accelerations_are_drawn_where_there_are_some(moved, saved, tmp_path):
    figures = drawn("run", moved)
    assert {"acceleration", "spectrum"} <= {*figures}
    assert "measured" not in figures
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


def test_data_are_fitted_and_compared_with_any_column(moved, data_file):
    """In the time of another clock; each column has a panel, and the figure says how far they are apart."""
    table = read_table(moved, "trajectory").drop_duplicates("t_s")
    table = table[table["t_s"].between(0.13, 0.2)]
    data = data_file(table.assign(t_s=table["t_s"] + 100.0), "acceleration_x_tip_m_per_s2", "phi1_rate_rad_per_s")
    (figure,) = drawn("run", moved, kinds=["measured"], start=0.1, data=data).values()
    assert [axis.get_title(loc="left").splitlines()[-1] for axis in figure.axes] == ["differs by < 0.1 %"] * 2
    assert "measured data shifted by −100 s" in figure.axes[0].get_title(loc="left").splitlines()
    assert [axis.lines[1].get_marker() for axis in figure.axes] == ["D"] * 2
