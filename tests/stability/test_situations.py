"""The stability suite with few scenes of each situation; all of them are in ``vibroplat bench stability``."""

from __future__ import annotations

import math

import pandas as pd
import pytest

from vibroplat import simulate
from vibroplat.bench.scenes import base
from vibroplat.bench.stability.campaign import TURNS, random_scene
from vibroplat.bench.stability.checks import overview, row, sound
from vibroplat.bench.stability.situations import SITUATIONS
from vibroplat.integrate.native import MAX_STEPS

#: Those that take seconds.
LENGTHY = {"campaign", "elastic", "release", "invariance", "layers", "accumulation", "grazing"}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.long] if name in LENGTHY else []) for name in SITUATIONS]
)
def test_few_scenes_of_each_situation_pass(name):
    situation = SITUATIONS[name]
    table = pd.DataFrame(situation.run(situation.few))
    failed = table[table["failed"] != ""]
    assert failed.empty, failed[["scene", "failed"]].to_string()


@pytest.mark.long
def test_more_random_scenes_pass():
    table = pd.DataFrame(SITUATIONS["campaign"].run(500))
    assert (table["failed"] == "").all()


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
def test_scenes_that_were_not_sound_once(number):
    scene = random_scene(number)
    summary = simulate(scene, keep="summary").summary
    assert row("a", summary["outcome"], sound(scene, summary), allowed=("ok", "event-storm"))["failed"] == ""


@pytest.mark.parametrize("number", [58, 186, 231, 344, 9570, 9819])
def test_a_platform_turned_too_far_ends_beyond_the_model(number):
    """Its mass matrix would lose its definiteness, and the motion run away in finite time."""
    run = simulate(random_scene(number))
    assert run.outcome == "beyond-model"
    assert "has turned by" in run.summary["detail"]
    assert run.summary["steps"] < 100_000


@pytest.mark.long
def test_steps_within_a_period_are_bounded_whatever_the_events():
    summary = simulate(random_scene(7452), keep="summary").summary
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
    table = pd.DataFrame([row("a", "ok", {"x": (1.0, 4.0)}), row("b", "ok", {"x": (3.0, 2.0)})])
    found = overview({"s": table}).iloc[0].to_dict()
    assert found == {
        "situation": "s",
        "scenes": 2,
        "failed": 1,
        "outcomes": "ok 2",
        "nearest": "x 3, 1.5 of its limit",
        "in_scene": "b",
    }


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
