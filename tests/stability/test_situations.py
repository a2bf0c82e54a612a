"""Situations that are difficult for a hybrid solver; every scene of them is checked.

A situation is a function of the number of scenes (of turns for ``endurance``) and the engine; it returns a row for each
scene, in which ``failed`` says what is beyond its limit. Quick tests take some scenes, ``-m campaign`` all.
"""

import pandas as pd
import pytest
from common.random_scenes import random_scene

from stability.accumulation import accumulation, elastic
from stability.campaign import campaign, judged
from stability.checks import row, sound, with_engine
from stability.endurance import endurance
from stability.grazing import grazing
from stability.layers import layers
from stability.orders import changed, tour
from stability.transport import judged_moving, transport
from stability.units import units
from vibroplat import simulate
from vibroplat.bench.measure import base

#: Engines whose figures stand side by side.
ENGINES = ("native", "taylor")
#: Situations, and their scenes in quick and in long tests and in the campaign.
SITUATIONS = {
    "grazing": (grazing, 0, 8, 100),
    "accumulation": (accumulation, 4, 8, 380),
    "elastic": (elastic, 0, 1, 80),
    "layers": (layers, 8, 8, 1500),
    "endurance": (endurance, 600, 3_000, 3_000_000),
    "units": (units, 6, 6, 198),
    "transport": (transport, 6, 24, 2_000),
    "campaign": (campaign, 8, 24, 10_000),
}


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    "size", [pytest.param(1, marks=pytest.mark.long, id="few"), pytest.param(2, marks=pytest.mark.campaign, id="all")]
)
@pytest.mark.parametrize("name", SITUATIONS)
def test_scenes_of_a_situation_pass(name, size, engine, capsys):
    run, *counts = SITUATIONS[name]
    table = pd.DataFrame(run(counts[size], engine))
    if size == 2:
        nearest = table.iloc[int(table["share"].to_numpy().argmax())]
        with capsys.disabled():
            print(f"\n{name}, {engine}: {len(table)} scenes, {table['outcome'].value_counts().to_dict()}")
            print(f"nearest to a limit: {nearest['scene']}, {nearest['worst']} at {nearest['share']:.2g}")
    failed = table[table["failed"] != ""]
    assert failed.empty, failed[["scene", "failed"]].to_string()


@pytest.mark.parametrize("name", [name for name, (_, few, *_) in SITUATIONS.items() if few])
def test_few_scenes_of_a_situation_pass(name):
    run, few, *_ = SITUATIONS[name]
    assert [found for found in run(few, ENGINES[len(name) % 2]) if found["failed"]] == []


@pytest.mark.parametrize(
    "calls", [pytest.param(120, marks=pytest.mark.long), pytest.param(20_736, marks=pytest.mark.campaign)]
)
def test_what_a_process_has_computed_before_changes_no_bit(calls):
    assert list(changed(tour(calls), {})) == []


#: Scenes of the campaign that were not sound once.
UNSOUND = {
    3065: "a small rotor and a strong motor",
    3951: "a hardly damped layer of 880 Hz in contact",
    6550: "a stiff layer, loosely",
    4637: "stiff motors, one layer",
    493: "an overdamped bare platform",
}


@pytest.mark.parametrize("number", UNSOUND, ids=UNSOUND.get)
def test_scenes_that_were_not_sound_once(number):
    scene = random_scene(number)
    for engine in ENGINES:
        summary = simulate(with_engine(scene, engine), keep="summary").summary
        allowed = ["ok", "too-many-events"] + ["solver-failure"] * (engine == "taylor")
        assert row("a", summary["outcome"], sound(scene, summary), allowed=allowed)["failed"] == ""
    if number == 3065:  # native takes long steps; stability holds those of the series at 1e-6 of a turn
        assert summary["detail"].startswith("taylor: more than 300000 steps within a period; mode ")
        assert ", state [" in summary["detail"]


@pytest.mark.parametrize("number", [58, 9570])
def test_a_platform_turned_too_far_ends_beyond_the_model(number):
    """Its mass matrix would lose its definiteness, and the motion run away in finite time."""
    for engine in ENGINES:
        run = simulate(with_engine(random_scene(number), engine))
        assert run.outcome == "outside-model-validity"
        assert "has turned by" in run.summary["detail"]
        assert run.summary["steps"] < 100_000


#: Scenes of the campaign of both engines that failed once.
FAILED = {
    155007: "a platform that runs away, with impacts faster than a storm of one engine",
    164054: "a platform that runs away: an engine fails on its way beyond the model",
    187192: "the same",
    5132: "at rest, and few steps: more momentum is left than moves",
    5333: "the same without contact",
    5426: "energy left just beyond the limit",
    6720: "the derivative by its start grows by 1e34 within a turn, in dozens of impacts of a tiny stiff layer",
    10245: "a layer of 6 kHz chatters as fast as the tolerance can tell: a storm with one engine, not with the other",
    10247: "native lets a stiff motor pass its critical slip, says so, and pulls",
    12669: "a slight flight of one engine stands where both have a clear one",
}


@pytest.mark.parametrize("number", FAILED, ids=FAILED.get)
def test_scenes_of_the_campaign_that_failed_once(number):
    assert judged(number)["failed"] == ""


def test_sound_runs_are_told_from_others():
    scene = base(1e-6, 0.2).replace({"drive.supply_frequency_hz": 50.0})
    summary = simulate(scene, keep="summary").summary
    assert row("a", "ok", sound(scene, summary))["failed"] == ""
    exchanged = summary["energy_residual_j"] / summary["energy_residual"]
    moved = summary["momentum_residual_n_s"] / summary["momentum_residual"]
    wrong = {"energy_residual": 1.0, "momentum_residual": 1.0, "gap_min_m": -1e-6, "contact_pull_n": 0.1}
    for key, value in wrong.items():
        found = summary | {key: value, "energy_residual_j": exchanged, "momentum_residual_n_s": moved}
        assert row("a", "ok", sound(scene, found))["failed"] != "", key


@pytest.mark.parametrize("number", [746, 1010])
def test_material_that_would_pull_if_it_stuck_slips_where_that_presses(number):
    """They flew into the deck, with 4e-6 and 2e-8 of the scale of gaps."""
    assert judged_moving(number, "taylor")["failed"] == ""
