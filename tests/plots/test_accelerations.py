"""Figures of accelerations: spectra, and what is drawn of which run."""

import itertools
import re

import numpy as np
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from vibroplat.config.digits import quantity
from vibroplat.config.scene import Scene
from vibroplat.errors import TableError
from vibroplat.plots.histories import RunTables, peaks_of, spectrum_of
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
    """Also where rows begin within a turn, events have added some, two at a time, and round-off of late times shows.

    One event is so near a time of the grid that its rows count as of this time.
    """
    events = np.repeat([begin / 2000.0 + 0.21013, begin / 2000.0 + 0.22 + 2e-7], 2)
    run = run_of_rows(np.sort([*(np.arange(begin, begin + 862) / 2000.0), *events]), scene)
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


@pytest.mark.parametrize(("rate", "orders"), [(77.0, 1), (110.0, 1), (160.0, 1), (333.0, 3), (2000.0, 3)])
def test_lines_that_may_be_folded_have_no_name(rate, orders):
    """Impacts at 25 Hz, orders of which decay slowly: each line that is named is one of these and has its amplitude."""
    run = run_of_rows(np.arange(0.0, 2.0, 1.0 / rate), Scene().replace({"output.sample_rate_hz": rate}))
    angle, known = run.shown["phi1_rad"], {1: 9.0, **{n: 3.0 / n for n in range(2, 60)}}
    run.shown["a"] = sum(size * np.cos(n * angle + n * n) for n, size in known.items())
    named = re.findall(r"([\d.]+) m/s² at ([\d.]+) Hz", peaks_of(*spectrum_of(run, "a"), run.speed))
    found = {round(float(at) / 25.0, 1): float(size) for size, at in named}
    assert found == pytest.approx({n: known[n] for n in range(1, orders + 1)}, rel=0.1)


def test_accelerations_are_drawn_where_there_are_some(moved, saved, tmp_path):
    figures = drawn("run", moved)
    assert {"acceleration", "spectrum"} <= {*figures}
    assert "measured" not in figures
    largest = quantity(read_json(moved, "summary")["acceleration_max_m_per_s2"], "m/s²")
    assert figures["acceleration"].get_suptitle().startswith(f"Acceleration {largest}")
    vertical, *_ = figures["acceleration"].axes
    table = read_table(moved, "trajectory")
    assert vertical.lines[0].get_ydata()[-1] == table["acceleration_y_m_per_s2"].iloc[-1]
    assert "folds back, lines up to" in figures["spectrum"].axes[0].get_title(loc="left")
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
    titles = [axis.get_title(loc="left").splitlines() for axis in figure.axes]
    assert all(lines[-1].endswith(" differs by < 0.1 %") for lines in titles)
    assert any(line.startswith("measured data shifted by 0.13") for line in titles[0])
    assert [axis.lines[-1].get_marker() for axis in figure.axes] == ["o"] * 2
