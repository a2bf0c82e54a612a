"""Trajectories are cut to intervals and thinned so that peaks stay."""

import numpy as np
import pandas as pd
import pytest

from vibroplat.plots.reading import EVENLY, SLOW, Cut, ends_of, turn_edges


def parts(table, size):
    """A table in parts."""
    return [table.iloc[first : first + size].reset_index(drop=True) for first in range(0, len(table), size)]


def test_extremes_keep_each_peak():
    t = np.linspace(0.0, 1.0, 10_001)
    values = np.sin(40.0 * t)
    values[7003], values[1234] = 9.0, -5.0
    table = pd.DataFrame({"t_s": t, "y_m": values})
    found = Cut([table], (0.5, 0.6), np.linspace(0.0, 1.0, 51), ["y_m", "gap_m"]).envelope()
    assert len(found) == 50
    assert (found["y_m:min"].min(), found["y_m:max"].max()) == (-5.0, 9.0)
    assert found["t_s"][found["y_m:max"] == 9.0].tolist() == pytest.approx([0.71])


def test_extremes_skip_what_is_missing():
    values = [np.nan, np.nan, 2.0, np.nan, 5.0, 4.0]
    table = pd.DataFrame({"t_s": np.arange(6.0), "y_m": values})
    cut = Cut([table], (0.0, 5.0), np.linspace(0.0, 6.0, 4), ["y_m"])
    envelope = cut.envelope()
    assert envelope["t_s"].tolist() == [3.0, 5.0]
    assert envelope[["y_m:min", "y_m:max"]].to_numpy().tolist() == [[2.0, 2.0], [4.0, 5.0]]


def test_parts_give_what_the_whole_gives():
    t = np.linspace(0.0, 1.0, 101)
    table = pd.DataFrame({"t_s": t, "y_m": np.cos(30.0 * t)})
    whole, cut = (Cut(parts(table, n), (0.25, 0.5), np.linspace(0.1, 0.9, 9), ["y_m"], every=7) for n in (101, 10))
    pd.testing.assert_frame_equal(cut.shown, whole.shown)
    pd.testing.assert_frame_equal(cut.envelope(), whole.envelope())
    assert cut.shown["t_s"].tolist() == t[25:51].tolist()
    assert cut.thinned["t_s"].tolist() == whole.thinned["t_s"].tolist() == t[14:91:7].tolist()
    ends = ends_of(parts(table, 10))
    assert (ends.rows, ends.first["t_s"], ends.last["t_s"]) == (101, 0.0, 1.0)
    assert ends_of([table.iloc[:0]]) is None


def test_the_range_of_a_turn_has_a_whole_turn_however_slow():
    """While exciters coast down turns grow longer; whatever shakes as they turn, shakes once in each part."""
    t = np.linspace(0.0, 18.0, 36_001)
    turns = 16.0 * 9.0 * (1.0 - np.exp(-t / 9.0))
    table = pd.DataFrame({"t_s": t, "phi1_rad": -2.0 * np.pi * turns, "phi2_rad": 2.0 * np.pi * 1.01 * turns})
    table["y_m"] = np.cos(2.0 * np.pi * turns)
    edges = turn_edges(table, 0.0, 18.0, 400)
    assert np.diff(edges).min() > 0.9 / 16.0
    assert 0.4 < np.diff(edges).max() < SLOW + 0.5
    found = Cut([table], (17.0, 18.0), edges, ["y_m"]).envelope()
    assert found["y_m:min"].to_numpy() == pytest.approx(-1.0, abs=1e-3)
    assert found["y_m:max"].to_numpy() == pytest.approx(1.0, abs=1e-3)


def test_turns_are_counted_on_few_rows_of_a_long_run_and_a_rest_has_parts_as_well():
    t = np.linspace(0.0, 20.0, 450_001)
    turned = 2.0 * np.pi * 10.0 * np.minimum(t, 10.0)
    table = pd.DataFrame({"t_s": t, "phi1_rad": -turned, "phi2_rad": turned})
    ends = ends_of(parts(table, 70_001))
    assert EVENLY < len(ends.evenly) <= 2 * EVENLY
    assert np.ptp(np.diff(ends.evenly["t_s"])) < 1e-9
    one = turn_edges(ends.evenly.assign(phi1_rad=0.0), 0.0, 20.0, 50)
    assert np.diff(one) == pytest.approx(SLOW, abs=1e-3), "an exciter that rests has no turns"
    edges = turn_edges(ends.evenly, 0.0, 20.0, 50)
    assert edges[:50] == pytest.approx(0.2 * np.arange(50), abs=1e-4)
    assert edges[50:] == pytest.approx(np.arange(10.0, 20.1, SLOW), abs=1e-3)
