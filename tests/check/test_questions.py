"""Answers of questions are repeated by another engine, which finds one that was spoiled."""

from pathlib import Path

import pytest

from vibroplat import load_config
from vibroplat.basin.question import Basins
from vibroplat.check.questions import check_answer
from vibroplat.designs.question import Design
from vibroplat.study.pool import pool
from vibroplat.study.store import Store
from vibroplat.thresholds.tables import question as find

CALIBRATED = Path(__file__).parents[2] / "configs/machines/calibrated.yaml"
STIFFNESS = "machine.stiffness_y_n_per_m"
#: Question, its section, how many motions are repeated, the table and the column that are spoiled.
CASES = {
    "find": (
        find,
        {"key": "drive.supply_frequency_hz", "start": 60.0, "stop": 64.0, "scan": 2, "tolerance": 0.5},
        2,
        "thresholds",
        "above_rms_x_m",
    ),
    "basins": (
        Basins,
        {"starts": {"run.initial.phase_difference_rad": [-3.0, 3.0]}, "random": 4},
        4,
        "attractors",
        "rms_y_m",
    ),
    "design": (
        Design,
        {
            "keys": {STIFFNESS: [460e3, 480e3]},
            "minimize": "motor_power_w",
            "subject": {"rms_y_m": ">= 1e-3"},
            "starts": 1,
        },
        2,
        "evaluations",
        "motor_power_w",
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_spoiled_answer_is_found(name):
    ask, plan, count, table, column = CASES[name]
    keys = {"drive.supply_frequency_hz": 62.3, "material.mass_ratio": 0.0, "solver.engine": "taylor", name: plan}
    question = ask(load_config(CALIBRATED, keys))
    with Store(None, {}) as store, pool(1, None) as workers:
        answer = question.answer(store, workers, lambda done, known: None)
        found = check_answer(question, answer, store, workers)
        assert (found.other, found.checked, found.disagreements) == ("native", count, [])
        assert found.largest < 1e-4
        answer.tables[table][column] *= 1.01
        found = check_answer(question, answer, store, workers)
        assert found.disagreements
        assert column.removeprefix("above_") in found.disagreements[0]
        assert "(taylor)" in found.disagreements[0]
