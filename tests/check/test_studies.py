"""Motions of a study are repeated by another engine, which finds what was spoiled."""

from pathlib import Path

import pandas as pd
import pytest

from vibroplat import load_config
from vibroplat.check.studies import cross_check
from vibroplat.config.kinds import KINDS
from vibroplat.study.pool import Task, pool
from vibroplat.study.store import Store
from vibroplat.study.study import CrossCheckCase

CALIBRATED = Path(__file__).parents[2] / "configs/machines/calibrated.yaml"
STIFFNESS = "machine.stiffness_y_n_per_m"
#: Section, how many motions are repeated, the table and the column that are spoiled.
CASES = {
    "find": (
        {"key": "drive.supply_frequency_hz", "start": 60.0, "stop": 64.0, "scan": 2, "tolerance": 0.5},
        2,
        "thresholds",
        "above_rms_x_m",
    ),
    "basins": (
        {"initial_conditions": {"run.initial.phase_difference_rad": [2.5, 3.0]}, "random": 2},
        2,
        "attractors",
        "rms_y_m",
    ),
    "design": (
        {
            "keys": {STIFFNESS: [460e3, 480e3]},
            "minimize": "motor_power_w",
            "constraints": {"rms_y_m": ">= 1e-3"},
            "starts": 1,
        },
        2,
        "evaluations",
        "motor_power_w",
    ),
}


def test_a_period_that_no_motion_has_is_compared():
    """Exciters that hang make no turn: a table has neither 0 nor a number there."""
    row = {"period": pd.NA, "sync": "none", "rms_y_m": 1e-3}
    for other, disagrees in ((None, False), (0, True)):
        study = OneCase(CrossCheckCase("here", Task(as_record, ({**row, "period": other},)), row))
        with Store(None, {}) as store, pool(1, None) as workers:
            found = cross_check(study, None, store, workers)
        assert bool(found.disagreements) == disagrees
        told = "0 of 1 motions agree" if disagrees else "1 of 1 motions agree, measures within 0 %"
        assert [text for _, text in found.lines()] == [f"engine native, {told}"]


class OneCase:
    """In the place of a study: it has a single motion to repeat."""

    scene = load_config(CALIBRATED)

    def __init__(self, case):
        self.case = case

    def cross_check_cases(self, result, store, other):
        return [self.case]


def as_record(row):
    return {"row": row}


@pytest.mark.parametrize("name", CASES)
def test_a_spoiled_answer_is_found(name):
    plan, count, table, column = CASES[name]
    keys = {"drive.supply_frequency_hz": 62.3, "material.mass_ratio": 0.0, "solver.engine": "taylor", name: plan}
    study = KINDS[name].load()(load_config(CALIBRATED, keys))
    with Store(None, {}) as store, pool(1, None) as workers:
        result = study.run(store, workers, lambda done, known: None)
        found = cross_check(study, result, store, workers)
        assert (found.other, found.checked, found.disagreements) == ("native", count, [])
        assert found.largest < 1e-4
        result.tables[table][column] *= 1.01
        found = cross_check(study, result, store, workers)
        assert found.disagreements
        assert column.removeprefix("above_") in found.disagreements[0]
        assert "(taylor)" in found.disagreements[0]


def loaded(**sections):
    """The machine with a tenth of its mass on it, and a study of it."""
    return load_config(CALIBRATED, {"material.mass_ratio": 0.1, "solver.engine": "taylor", **sections})


@pytest.fixture(scope="module")
def swept():
    """A sweep up and down, and its points."""
    frequencies = {"start": 48.0, "stop": 56.0, "step": 4.0, "direction": ["up", "down"]}
    study = KINDS["sweep"].load()(loaded(sweep={"supply_frequency_hz": frequencies, "settle_by": "section"}))
    with Store(None, {}) as store, pool(1) as workers:
        yield study, study.run(store, workers, lambda done, known: None), store, workers


def test_points_begin_as_in_the_sweep(swept):
    """By its own engine nothing differs, in chained points too: they begin with the same bits."""
    found = cross_check(*swept, other=lambda scene: scene)
    assert (found.checked, found.largest, found.disagreements) == (6, 0.0, [])


def test_a_spoiled_point_is_found(swept):
    store = swept[2]
    found = cross_check(*swept)
    assert (found.other, found.checked, found.disagreements) == ("native", 6, [])
    assert 0.0 < found.largest < 1e-3
    ((_, record),) = [one for one in store.read(1) if one[0] == 2]
    for column, value in (("rms_y_m", 1.02 * record["row"]["rms_y_m"]), ("motion", "undecided")):
        store.write(1, 2, {**record, "row": record["row"] | {column: value}})
        found = cross_check(*swept)
        assert found.checked == (6 if column == "rms_y_m" else 5)  # nothing is known of what is undecided
        assert [text.partition(": ")[0] for text in found.disagreements] == (
            ["engines disagree at supply_frequency_hz = 48.0, branch 1 (down)"] if found.checked == 6 else []
        )
    store.write(1, 2, record)


def test_an_engine_that_gives_up_is_found(swept):
    storm = {"solver.max_events_per_period": 1}
    found = cross_check(*swept, other=lambda scene: scene.replace(storm))
    assert any(" = antiphase (taylor) and None (taylor)" in text for text in found.disagreements)


def test_points_are_chosen_all_over_a_sweep(monkeypatch, swept):
    monkeypatch.setattr("vibroplat.study.study.choose_evenly.__defaults__", (3,))
    study, result, store, _ = swept
    cases = study.cross_check_cases(result, store, lambda scene: scene)
    assert [case.place.partition(",")[0] for case in cases] == [
        f"at supply_frequency_hz = {value}" for value in (48.0, 56.0, 48.0)
    ]


def test_a_spoiled_branch_of_orbits_is_found():
    plan = {"key": "drive.supply_frequency_hz", "start": 52.0, "stop": 62.0, "max_points": 100}
    study = KINDS["orbits"].load()(loaded(orbits=plan))
    with Store(None, {}) as store, pool(1) as workers:
        result = study.run(store, workers, lambda done, known: None)
        table = result.branches
        assert not table["stable"].all()
        found = cross_check(study, result, store, workers)
        assert (found.other, found.checked, found.disagreements) == ("native", 20, [])
        assert 0.0 < found.largest < 1e-4
        table.loc[len(table) - 1, "rms_y_m"] *= 1.01
        (told,) = cross_check(study, result, store, workers).disagreements
    assert told.startswith("engines disagree at supply_frequency_hz = ")
    assert ": rms_y_m = " in told
