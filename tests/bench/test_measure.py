"""What ``vibroplat bench`` measures, writes and says: errors, run times at equal errors, and what studies cost."""

import numpy as np
import pandas as pd
import pytest

from vibroplat.bench import measure, studies


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
        "simulate_ms_per_s": [1.0, 4.0, 10.0, 40.0],
        "ms_per_s": [0.8, 3.2, 10.0, 40.0],
        "bare_ms_per_s": [0.5, 2.0, 10.0, 40.0],
    }
)


def test_ratios_are_to_engine_taylor():
    found = measure.at_equal_error(TABLE).set_index(["engine", "error"])
    assert found.loc[("taylor", 1e-6), "ms_per_s"] == pytest.approx(1.6)
    ratios = [f"{name}over_taylor" for name in ("simulate_", "", "bare_")]
    assert found.loc[("other", 1e-6), ratios].tolist() == pytest.approx([10.0, 12.5, 20.0])
    assert np.isnan(found.loc[("other", 1e-9), "over_taylor"])
    told = measure.brief_precision(TABLE.assign(failed=""), measure.at_equal_error(TABLE))
    assert told[-1] == "  attached  2.00 / 1.60 / 1.00  20.0 / 20.0 / 20.0"


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


@pytest.mark.long
def test_branches_are_as_exact_as_sweeps_that_settle_longest():
    narrow = {"sweep.grid": {"material.mass_ratio": [0.1]}, "sweep.supply_frequency_hz.stop": 45.0}
    table = studies.cost_of_orbits(1, narrow).set_index("what")
    assert list(table.index) == ["branches", *(f"sweep, settled to {t:g}" for t in (1e-3, 1e-7, 1e-9))]
    assert table["simulated_s"].iloc[1:].is_monotonic_increasing
    assert (table["times_point"] > 0.0).all()
    assert (table["error"] < [1e-8, 1e-2, 1e-6, 1e-8]).all()


@pytest.fixture
def short(monkeypatch):
    scene = measure.cases()["attached"].replace({"run.duration_s": 0.05})
    monkeypatch.setattr(measure, "cases", lambda: {"attached": scene})


@pytest.mark.usefixtures("short", "kernels")
def test_precision_is_a_table_and_a_figure(command, here, figures):
    done = command("bench", "precision", "--repeats", 1, "--out", "out")
    assert (done.code, done.err) == (0, "")
    assert "results" not in {path.name for path in here.iterdir()}
    table = pd.read_csv("out/benchmarks/precision.csv")
    assert list(table["tolerance"]) == pytest.approx([10.0**-n for n in range(4, 11)])
    assert set(table["engine"]) == {"native"}
    assert table["coordinates"].iloc[-1] < 1e-3 * table["coordinates"].iloc[0]
    assert (table["ms_per_s"] > 0.0).all()
    assert figures["precision"].axes[0].get_title(loc="left").endswith("\nattached")


@pytest.mark.usefixtures("short", "kernels", "figures")
def test_engines_are_compared_at_equal_error(command, here):
    assert command("bench", "--repeats", 1).code == 0
    table = pd.read_csv("results/benchmarks/summary-equal.csv").set_index(["engine", "error"])
    usual = table.xs(measure.LEVEL, level="error")
    assert list(usual.index) == ["taylor", "native"]
    assert usual.loc["taylor", "over_taylor"] == 1.0
    assert (usual[[*measure.TIMES]] > 0.0).all(axis=None)


def test_all_benchmarks_and_some_are_not_asked_for_at_once(command, here):
    done = command("bench", "engines", "--long")
    line = "engines --long: --long runs all benchmarks; allowed: names or --long"
    assert (done.code, done.out, done.err) == (2, "", f"vibroplat: {line}\n")
