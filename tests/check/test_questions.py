"""Motions of a study are repeated by another engine, which finds what was spoiled."""

from functools import partial
from pathlib import Path

import pandas as pd
import pytest

from vibroplat import load_config, orbits
from vibroplat.basin.question import Basins
from vibroplat.check.questions import check_motions
from vibroplat.continuation.tables import repeats as of_branches
from vibroplat.designs.question import Design
from vibroplat.study.branches import branches
from vibroplat.study.pool import Task, pool
from vibroplat.study.question import Repeat
from vibroplat.study.store import Store
from vibroplat.study.sweep import repeats as of_points
from vibroplat.study.sweep import run_sweeps
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
        {"starts": {"run.initial.phase_difference_rad": [2.5, 3.0]}, "random": 2},
        2,
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


def test_a_period_that_no_motion_has_is_compared():
    """Exciters that hang make no turn: a table has neither 0 nor a number there."""
    row = {"period": pd.NA, "sync": "none", "rms_y_m": 1e-3}
    for other, disagrees in ((None, False), (0, True)):
        repeat = Repeat("here", Task(as_record, ({**row, "period": other},)), row)
        with Store(None, {}) as store, pool(1, None) as workers:
            found = check_motions(load_config(CALIBRATED), lambda scene, one=repeat: [one], store, workers)
        assert bool(found.disagreements) == disagrees


def as_record(row):
    return {"row": row}


@pytest.mark.parametrize("name", CASES)
def test_a_spoiled_answer_is_found(name):
    ask, plan, count, table, column = CASES[name]
    keys = {"drive.supply_frequency_hz": 62.3, "material.mass_ratio": 0.0, "solver.engine": "taylor", name: plan}
    question = ask(load_config(CALIBRATED, keys))
    with Store(None, {}) as store, pool(1, None) as workers:
        answer = question.answer(store, workers, lambda done, known: None)
        found = check_motions(question.scene, partial(question.repeats, answer), store, workers)
        assert (found.other, found.checked, found.disagreements) == ("native", count, [])
        assert found.largest < 1e-4
        answer.tables[table][column] *= 1.01
        found = check_motions(question.scene, partial(question.repeats, answer), store, workers)
        assert found.disagreements
        assert column.removeprefix("above_") in found.disagreements[0]
        assert "(taylor)" in found.disagreements[0]


def loaded(**sections):
    """The machine with a tenth of its mass on it, and a study of it."""
    return load_config(CALIBRATED, {"material.mass_ratio": 0.1, "solver.engine": "taylor", **sections})


@pytest.fixture(scope="module")
def swept():
    """A sweep up and down, its branches and its points."""
    frequencies = {"start": 48.0, "stop": 56.0, "step": 4.0, "direction": ["up", "down"]}
    planned = branches(loaded(sweep={"supply_frequency_hz": frequencies, "settle": "motion"}))
    with Store(None, {}) as store, pool(1) as workers:
        run_sweeps([(planned, store)], workers)
        yield planned, store, workers


def test_points_begin_as_in_the_sweep(swept):
    """By its own engine nothing differs, in chained points too: they begin with the same bits."""
    planned, store, workers = swept
    found = check_motions(planned[0].scene, partial(of_points, planned, store), store, workers, other=lambda s: s)
    assert (found.checked, found.largest, found.disagreements) == (6, 0.0, [])


def test_a_spoiled_point_is_found(swept):
    planned, store, workers = swept
    scene, repeats = planned[0].scene, partial(of_points, planned, store)
    found = check_motions(scene, repeats, store, workers)
    assert (found.other, found.checked, found.disagreements) == ("native", 6, [])
    assert 0.0 < found.largest < 1e-3
    ((_, record),) = [one for one in store.read(1) if one[0] == 2]
    for column, value in (("rms_y_m", 1.02 * record["row"]["rms_y_m"]), ("motion", "undecided")):
        store.write(1, 2, {**record, "row": record["row"] | {column: value}})
        found = check_motions(scene, repeats, store, workers)
        assert found.checked == (6 if column == "rms_y_m" else 5)  # nothing is known of what is undecided
        assert [text.partition(": ")[0] for text in found.disagreements] == (
            ["engines disagree at supply_frequency_hz = 48.0, branch 1 (down)"] if found.checked == 6 else []
        )
    store.write(1, 2, record)


def test_an_engine_that_gives_up_is_found(swept):
    planned, store, workers = swept
    storm = {"solver.max_events_per_period": 1}
    repeats = partial(of_points, planned, store)
    found = check_motions(planned[0].scene, repeats, store, workers, other=lambda scene: scene.replace(storm))
    assert any(" = antiphase (taylor) and None (taylor)" in text for text in found.disagreements)


def test_points_are_chosen_all_over_a_sweep(monkeypatch, swept):
    monkeypatch.setattr("vibroplat.study.question.spread.__defaults__", (3,))
    assert [repeat.place.partition(",")[0] for repeat in of_points(*swept[:2], lambda scene: scene)] == [
        f"at supply_frequency_hz = {value}" for value in (48.0, 56.0, 48.0)
    ]


def test_a_spoiled_branch_of_orbits_is_found():
    plan = {"key": "drive.supply_frequency_hz", "start": 52.0, "stop": 62.0, "max_points": 24}
    scene = loaded(orbits=plan)
    table = orbits(scene).branches
    assert not table["stable"].all()
    with Store(None, {}) as store, pool(1) as workers:
        found = check_motions(scene, partial(of_branches, scene, table), store, workers)
        assert (found.other, found.checked, found.disagreements) == ("native", 20, [])
        assert 0.0 < found.largest < 1e-4
        table.loc[len(table) - 1, "rms_y_m"] *= 1.01
        (told,) = check_motions(scene, partial(of_branches, scene, table), store, workers).disagreements
    assert told.startswith("engines disagree at supply_frequency_hz = ")
    assert ": rms_y_m = " in told
