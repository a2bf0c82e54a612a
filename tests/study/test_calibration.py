from __future__ import annotations

import math

import pandas as pd
import pytest

from vibroplat.errors import ConfigError
from vibroplat.study import calibration
from vibroplat.study.calibration import Plan, Range, calibrate, conditions, evaluate, load_plan
from vibroplat.study.execution import Inline
from vibroplat.study.store import Store
from vibroplat.study.trial import machine_numbers

DAMPING, RATIO = "machine.damping_y_n_s_per_m", "material.damping_ratio"
PLAN = Plan(
    parameters={DAMPING: Range(low=100.0, high=500.0), RATIO: Range(low=1e-3, high=1.0, scale="log")},
    population_per_parameter=6,
    generations=12,
    seed=3,
)


class Killed(BaseException):
    pass


@pytest.fixture
def valley(monkeypatch):
    """Claims whose scores are best at b_y 320 and damping ratio 0.02; counts evaluations, and may stop after some."""
    state = {"calls": 0, "most": math.inf}

    def judged(numbers):
        if state["calls"] >= state["most"]:
            raise Killed
        state["calls"] += 1
        assert numbers["machine.gravity_m_per_s2"] == 9.81
        first = math.exp(-(((numbers[DAMPING] - 320.0) / 50.0) ** 2))
        second = math.exp(-(math.log10(numbers[RATIO] / 0.02) ** 2))
        return {"score": 0.5 * (first + second), "held": 1, "scores": {"first": first, "second": second}}

    monkeypatch.setattr(calibration, "evaluate", judged)
    return state


FIXED = {"machine.gravity_m_per_s2": 9.81}


def test_search_finds_the_best_numbers(valley):
    with Store(None, {}) as store:
        table = calibrate(FIXED, PLAN, store, Inline())
    best = table.iloc[0]
    assert best[DAMPING] == pytest.approx(320.0, abs=10.0)
    assert math.log10(best[RATIO]) == pytest.approx(math.log10(0.02), abs=0.15)
    assert len(table) == valley["calls"] == PLAN.evaluations
    assert table["score"].is_monotonic_decreasing
    assert list(table.columns) == [DAMPING, RATIO, "score", "held", "first", "second"]


@pytest.mark.parametrize("most", [0, 5, 40])
def test_interrupted_search_goes_on_to_the_same_table(valley, tmp_path, most):
    with Store(None, {}) as store:
        whole = calibrate(FIXED, PLAN, store, Inline())
    valley.update(calls=0, most=most)
    with Store(tmp_path, conditions(FIXED, PLAN)) as store, pytest.raises(Killed):
        calibrate(FIXED, PLAN, store, Inline())
    valley["most"] = math.inf
    with Store(tmp_path, conditions(FIXED, PLAN), resume=True) as store:
        table = calibrate(FIXED, PLAN, store, Inline())
    assert valley["calls"] == PLAN.evaluations
    pd.testing.assert_frame_equal(table, whole, check_exact=True)


def test_more_generations_go_on_from_those_there_are(valley, tmp_path):
    fewer = PLAN.model_copy(update={"generations": 2})
    with Store(tmp_path, conditions(FIXED, fewer)) as store:
        calibrate(FIXED, fewer, store, Inline())
    with Store(tmp_path, conditions(FIXED, PLAN), resume=True) as store:
        calibrate(FIXED, PLAN, store, Inline())
    assert valley["calls"] == PLAN.evaluations


def test_other_machine_does_not_go_on(valley, tmp_path):
    with Store(tmp_path, conditions(FIXED, PLAN)) as store:
        calibrate(FIXED, PLAN, store, Inline())
    other = {"machine.gravity_m_per_s2": 1.62}
    with pytest.raises(ConfigError, match=r"cannot resume: machine\.machine\.gravity_m_per_s2 = 1\.62; allowed: 9\.81"):
        Store(tmp_path, conditions(other, PLAN), resume=True)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("name: x", "no section calibration"),
        ("calibration: {}", "allowed: a value is required"),
        ("calibration: {parameters: {a.b: {low: 2, high: 1}}}", "high = 1.0 is not above low = 2.0"),
        ("calibration: {parameters: {a.b: {low: 0, high: 1, scale: log}}}", "low = 0.0; allowed: more than 0"),
        (
            "calibration: {parameters: {a.b: {low: 0, high: 1, scale: root}}}",
            "scale = 'root'; allowed: 'linear' or 'log'",
        ),
        ("calibration: {parameters: {a.b: {low: 0, high: 1}}, generation: 3}", "did you mean generations?"),
    ],
)
def test_bad_plan_is_refused_with_a_line(tmp_path, text, line):
    (tmp_path / "c.yaml").write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_plan(tmp_path / "c.yaml", {})
    assert str(caught.value).startswith(f"{tmp_path / 'c.yaml'}: ")
    assert line in str(caught.value)


@pytest.mark.long
def test_evaluation_prefers_the_calibrated_machine_to_the_printed_one():
    calibrated, printed = (evaluate(machine_numbers(name)) for name in ("calibrated", "printed"))
    assert calibrated["held"] > printed["held"]
    assert calibrated["score"] > printed["score"]
