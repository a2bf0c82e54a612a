"""Errors, run times at equal errors, and their figure."""

import numpy as np
import pandas as pd
import pytest

from vibroplat.bench import measure


@pytest.fixture(scope="module")
def case():
    return measure.truth("attached", measure.cases()["attached"].replace({"run.duration_s": 0.1}))


def test_a_run_at_its_own_accuracy_has_no_error(case):
    found = measure.precision([case], ["taylor"], [measure.CLOSEST], 1).iloc[0]
    assert (found["coordinates"], found["contact_force"], found["event_time_s"]) == (0.0, 0.0, 0.0)
    assert found["ms_per_s"] > 0.0


def test_failed_run_is_a_row_with_its_reason(case):
    def fail(name, scene, tolerance):
        raise RuntimeError("no step is small enough\nmore of it")

    table = measure.precision([case], ["failing"], [1e-3], 1, fail)
    assert list(table["failed"]) == ["RuntimeError: no step is small enough"]


def test_tasks_take_turns_and_short_ones_are_repeated():
    order, seconds = [], iter([0.004, 0.01, 0.008, 0.03])

    def short():
        order.append("short")
        return next(seconds), len(order)

    def long():
        order.append("long")
        return 1.0 * len(order), "done"

    found = measure.by_turns({"short": short, "long": long}, 2)
    assert order == ["short", "short", "short", "long", "short", "long"]
    assert (found["short"].seconds.tolist(), found["short"].value) == ([0.008, 0.03], 5)
    assert (found["long"].seconds.tolist(), found["long"].value) == ([4.0, 6.0], "done")


def test_run_time_at_an_error_is_on_the_line_between_the_fastest_runs():
    errors, times = pd.Series([1e-2, 1e-4, 1e-3, 1e-6, np.nan]), pd.Series([1.0, 2.0, 3.0, 8.0, 0.1])
    assert measure.time_at(errors, times, 1e-3) == pytest.approx(2**0.5)  # the one at 1e-3 is slower than at 1e-4
    assert measure.time_at(errors, times, 1e-5) == pytest.approx(4.0)
    assert measure.time_at(errors, times, 1.0) == 1.0  # all are more accurate
    assert np.isnan(measure.time_at(errors, times, 1e-7))


TABLE = pd.DataFrame(
    {
        "case": "attached",
        "engine": ["taylor", "taylor", "other", "other"],
        "coordinates": [1e-4, 1e-8, 1e-4, 1e-8],
        "event_time_s": 0.0,
        "ms_per_s": [1.0, 4.0, 10.0, 40.0],
        "bare_ms_per_s": [0.5, 2.0, 10.0, 40.0],
    }
)


def test_ratios_are_to_engine_taylor():
    found = measure.at_equal_error(TABLE).set_index(["engine", "error"])
    assert found.loc[("taylor", 1e-6), "ms_per_s"] == pytest.approx(2.0)
    assert found.loc[("other", 1e-6), ["over_taylor", "bare_over_taylor"]].tolist() == pytest.approx([10.0, 20.0])
    assert np.isnan(found.loc[("other", 1e-9), "over_taylor"])


def test_run_time_is_drawn_over_error(tmp_path, figures):
    measure.plot_precision(TABLE, tmp_path, "work")
    coordinates, *others = figures["work"].axes
    assert [line.get_xydata().tolist() for line in coordinates.lines] == [
        [[1e-4, 1.0], [1e-8, 4.0]],
        [[1e-4, 10.0], [1e-8, 40.0]],
    ]
    assert (coordinates.get_xscale(), coordinates.get_yscale(), coordinates.xaxis_inverted()) == ("log", "log", True)
    assert not any(axis.get_visible() for axis in others)  # errors that are zero, or not there
    assert [text.get_text() for text in figures["work"].legends[0].texts] == ["taylor", "other"]
