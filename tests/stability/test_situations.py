"""The stability suite with few scenes of each situation; all of them are in ``vibroplat bench stability``."""

from __future__ import annotations

import math

import pandas as pd
import pytest
from common.random_scenes import TURNS, random_scene

from stability.checks import overview, row, side_by_side, sound, with_engine
from stability.situations import ENGINES, SITUATIONS
from vibroplat import simulate
from vibroplat.bench.scenes import base
from vibroplat.integrate.native import MAX_STEPS

#: Those that take seconds.
LENGTHY = {"agreement", "campaign", "elastic", "release", "invariance", "layers", "accumulation", "grazing"}


@pytest.mark.parametrize(
    ("name", "engine"),
    [
        pytest.param(name, engine, marks=[pytest.mark.long] if name in LENGTHY else [])
        for name, situation in SITUATIONS.items()
        for engine in situation.engines
    ],
)
def test_few_scenes_of_each_situation_pass(name, engine):
    situation = SITUATIONS[name]
    table = situation.table(engine, situation.few)
    failed = table[table["failed"] != ""]
    assert failed.empty, failed[["scene", "failed"]].to_string()


@pytest.mark.long
@pytest.mark.parametrize("engine", ENGINES)
def test_more_random_scenes_pass(engine):
    table = SITUATIONS["campaign"].table(engine, 500)
    assert (table["failed"] == "").all()


def test_two_engines_find_the_same_events_in_some_random_scenes():
    table = SITUATIONS["agreement"].table("native", 40)
    assert (table["failed"] == "").all()
    assert set(table["other"]) == {"taylor"}
    assert table["events"].sum() > 500


@pytest.mark.campaign
def test_two_engines_find_the_same_events_in_all_random_scenes():
    situation = SITUATIONS["agreement"]
    failed = situation.table("native", situation.all).query("failed != ''")
    assert failed.empty, failed[["scene", "at_first", "at_last"]].to_string()


@pytest.mark.parametrize(
    "number",
    [pytest.param(3065, id="a small rotor and a strong motor"), pytest.param(8873, id="no arm, the same")],
)
def test_motors_that_are_too_stiff_for_a_series_end_with_a_reason(number):
    """Where ``native`` takes long steps, stability holds those of the series at a millionth of a turn."""
    scene = random_scene(number)
    summaries = {e: simulate(with_engine(scene, e), keep="summary").summary for e in ENGINES}
    found = summaries["taylor"]
    assert (summaries["native"]["outcome"] in ("ok", "event-storm"), found["outcome"]) == (True, "solver-failure")
    assert found["detail"].startswith("taylor: more than 300000 steps within a period; mode ")
    assert ", state [" in found["detail"]
    assert row("a", "ok", sound(scene, found))["failed"] == ""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    "number",
    [
        pytest.param(3065, id="a small rotor and a strong motor"),
        pytest.param(8873, id="no arm, the same"),
        pytest.param(3951, id="a hardly damped layer of 880 Hz in contact"),
        pytest.param(6550, id="a stiff layer, loosely"),
        pytest.param(9870, id="a layer of 18 kHz, overdamped"),
        pytest.param(4637, id="stiff motors, one layer"),
        pytest.param(493, id="an overdamped bare platform"),
    ],
)
def test_scenes_that_were_not_sound_once(number, engine):
    scene = with_engine(random_scene(number), engine)
    summary = simulate(scene, keep="summary").summary
    allowed = ["ok", "event-storm"] + ["solver-failure"] * (engine == "taylor")
    assert row("a", summary["outcome"], sound(scene, summary), allowed=allowed)["failed"] == ""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("number", [58, 186, 231, 344, 9570, 9819])
def test_a_platform_turned_too_far_ends_beyond_the_model(number, engine):
    """Its mass matrix would lose its definiteness, and the motion run away in finite time."""
    run = simulate(with_engine(random_scene(number), engine))
    assert run.outcome == "beyond-model"
    assert "has turned by" in run.summary["detail"]
    assert run.summary["steps"] < 100_000


@pytest.mark.long
@pytest.mark.parametrize("engine", ENGINES)
def test_steps_within_a_period_are_bounded_whatever_the_events(engine):
    summary = simulate(with_engine(random_scene(7452), engine), keep="summary").summary
    assert summary["steps"] <= MAX_STEPS * (TURNS + 1.0)


# -- the checks themselves --------------------------------------------------------------------------------


def test_a_figure_beyond_its_limit_is_a_failure():
    found = row("a", "ok", {"small": (1.0, 2.0), "large": (3.0, 2.0)})
    assert (found["failed"], found["worst"], found["share"]) == ("large 3, allowed 2", "large", 1.5)
    assert (found["small"], found["large"]) == (1.0, 3.0)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_figure_that_is_no_number_is_a_failure(value):
    assert row("a", "ok", {"x": (value, 1.0)})["failed"]


def test_any_excess_over_nothing_allowed_is_a_failure():
    assert row("a", "ok", {"x": (1e-300, 0.0)})["failed"]
    assert not row("a", "ok", {"x": (0.0, 0.0)})["failed"]
    assert not row("a", "ok", {"x": (-1.0, 0.0)})["failed"]


def test_an_outcome_that_is_not_allowed_is_a_failure():
    assert row("a", "event-storm", {})["failed"] == "outcome event-storm"
    assert row("a", "event-storm", {}, allowed={"event-storm"})["failed"] == ""


def test_overview_counts_and_finds_what_is_nearest_to_its_limit():
    rows = [row("a", "ok", {"x": (1.0, 4.0)}), row("b", "ok", {"x": (3.0, 2.0)})]
    table = pd.DataFrame([{"engine": engine} | r for engine in ENGINES for r in rows])
    found = overview({"s": table})
    assert found["engine"].to_list() == ["native", "taylor"]
    assert found.iloc[1].to_dict() == {
        "situation": "s",
        "engine": "taylor",
        "scenes": 2,
        "failed": 1,
        "outcomes": "ok 2",
        "nearest": "x 3, 1.5 of its limit",
        "in_scene": "b",
    }


def test_engines_stand_side_by_side():
    tables = [pd.DataFrame({"engine": [e] * 2, "scene": ["b", "a"]}) for e in ENGINES]
    found = side_by_side(tables)
    assert found["scene"].to_list() == ["b", "b", "a", "a"]
    assert found["engine"].to_list() == ["native", "taylor"] * 2


@pytest.mark.parametrize(
    ("key", "value"),
    [("energy_residual", 1.0), ("momentum_residual", 1.0), ("gap_min_m", -1e-6), ("contact_pull_n", 0.1)],
)
def test_sound_runs_are_told_from_others(key, value):
    scene = base(1e-6, 0.2).replace({"drive.supply_frequency_hz": 50.0})
    summary = simulate(scene, keep="summary").summary
    assert row("a", "ok", sound(scene, summary))["failed"] == ""
    assert row("a", "ok", sound(scene, summary | {key: value}))["failed"] != ""


def test_random_scenes_are_the_same_each_time_and_not_alike():
    assert random_scene(7) == random_scene(7)
    assert random_scene(7) != random_scene(8)
    drawn = [random_scene(number) for number in range(200)]
    assert {scene.layers for scene in drawn} == {0, 1, 2}
    assert {scene.contact.impact_law for scene in drawn} == {"conservative", "central", "printed"}
    assert any(scene.motors for scene in drawn)
    assert any(scene.run.initial.state for scene in drawn)
