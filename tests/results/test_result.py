"""Results of studies: what is computed and what is loaded are the same, at a prompt and on disk."""

import json
import pickle
from pathlib import Path

import pandas as pd
import pytest

import vibroplat
from vibroplat import load, load_config
from vibroplat.config.kinds import KINDS
from vibroplat.errors import ConfigError, TableError
from vibroplat.results import renamed
from vibroplat.results.files import SCHEMA, hash_of
from vibroplat.results.result import Answer

CALIBRATED = Path(__file__).parents[2] / "configs/machines/calibrated.yaml"
SUPPLY, RADIUS = "drive.supply_frequency_hz", "machine.unbalance_radius_m"
BARE = {SUPPLY: 62.3, "material.mass_ratio": 0.0, "solver.engine": "taylor"}
#: A small study of each kind: its section, and the figure that is drawn first.
PLANS = {
    "sweep": {"supply_frequency_hz": {"start": 62.0, "stop": 63.0, "step": 1.0}, "kind": "bifurcation", "grid": {}},
    "orbits": {"key": SUPPLY, "start": 62.0, "stop": 63.0},
    "find": {"key": SUPPLY, "start": 62.0, "stop": 63.0, "scan": 2, "tolerance": 0.3},
    "basins": {"initial_conditions": {"run.initial.phase_difference_rad": [-3.0, 3.0]}, "random": 3},
    "design": {"keys": {RADIUS: [0.03, 0.04]}, "minimize": "motor_power_w", "starts": 1},
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_result_is_loaded_as_it_was_computed(kind, kernels, tmp_path):
    scene = load_config(CALIBRATED, BARE | {"name": "small", kind: PLANS[kind]})
    fresh = getattr(vibroplat, kind)(scene)
    again = load(pickle.loads(pickle.dumps(fresh)).save(tmp_path / "saved"))
    assert (again.command, again.scene, again.answer) == (kind, scene, fresh.answer)
    assert str(fresh.answer).splitlines()
    assert [*again.tables] == [*fresh.tables]
    for name, table in fresh.tables.items():
        pd.testing.assert_frame_equal(getattr(again, name), table, check_exact=True)
    assert (again.documents, again.configurations) == (fresh.documents, fresh.configurations)
    assert {*again.provenance} == {*fresh.provenance} | {"command", "result", "files"}
    assert len(again.plot().axes) == len(fresh.plot().axes) > 0
    copied = load(again.save(tmp_path / "copied", "csv"))
    assert copied.answer == fresh.answer
    with pytest.raises(ConfigError, match="kind = 'motion'; allowed: "):
        fresh.plot("motion")
    with pytest.raises(TableError, match="is not a directory"):
        load(tmp_path / "nothing", kind)


def former(directory, names, schema=1):
    """Make a result one of a former schema: names of columns and tables as they were, without digests."""
    proof = json.loads((directory / "provenance.json").read_text())
    for path in directory.glob("*.parquet"):
        pd.read_parquet(path).rename(columns=names).to_parquet(path)
    return proof | {"schema": schema, "files": None}


def test_a_run_of_schema_1_has_present_names(runs, tmp_path):
    run = runs["two layers"]
    names = {new: old for old, new in renamed.COLUMNS.items()}
    directory = run.save(tmp_path / "run")
    proof = former(directory, names)
    proof["configuration"]["sweep"] = {
        "supply_frequency_hz": {"start": 45.0, "stop": 46.0},
        "settle": "motion",
        "settle_s": 5.0,
        "grid": {"contact.sticking_speed_m_per_s": [0.0, 0.1]},
    }
    proof["configuration"]["run"]["initial"] = {"phase_sum_rad": 0.3}
    (directory / "provenance.json").write_text(json.dumps(proof))
    summary = {names.get(name, name): value for name, value in run.documents["summary"].items()}
    assert "torque_share_1" in summary
    (directory / "summary.json").write_text(json.dumps(summary))
    again = load(directory)
    assert (repr(again), again.scene.sweep.settle_by) == (repr(run), "section")
    assert again.scene.run.initial.phase_difference_rad == 0.3
    assert again.scene.sweep.grid == {"contact.restitution_threshold_m_per_s": [0.0, 0.1]}
    assert again.data_sheet.equals(run.data_sheet)
    assert json.loads((again.save(tmp_path / "again") / "provenance.json").read_text())["schema"] == SCHEMA


def test_a_design_of_schema_1_is_drawn(kernels, tmp_path):
    plan = PLANS["design"] | {"constraints": {"stability_margin": ">= 0.001"}}
    fresh = vibroplat.design(load_config(CALIBRATED, BARE | {"design": plan}))
    directory = fresh.save(tmp_path / "design")
    proof = former(directory, {new: old for old, new in renamed.COLUMNS.items()})
    proof["configuration"]["design"]["subject"] = {"margin": ">= 0.001"}
    del proof["configuration"]["design"]["constraints"]
    (directory / "provenance.json").write_text(json.dumps(proof))
    again = load(directory)
    assert again.scene.design == fresh.scene.design
    assert again.plot("evaluations").axes
    assert [*again.evaluations] == [*fresh.evaluations]
    events = renamed.rename_table(pd.DataFrame({"kind": ["latch", "impact"], "measure": ["margin", "rms_y_m"]}), "run")
    assert events.to_numpy().tolist() == [["chatter", "stability_margin"], ["impact", "rms_y_m"]]
    ends = renamed.rename_table(pd.DataFrame({"outcome": ["ok", "event-storm"], "rotation": ["a", "b"]}), "sweep")
    assert ends.to_dict("list") == {"outcome": ["ok", "too-many-events"], "relative_rotation": ["a", "b"]}
    keys = renamed.rename_keys_of(pd.DataFrame({"key": ["run.initial.phase_sum_rad", "material.mass_ratio"]}))
    assert keys["key"].tolist() == ["run.initial.phase_difference_rad", "material.mass_ratio"]


def test_results_of_schema_2_have_present_names(kernels, tmp_path):
    plan = PLANS["design"] | {"parameter_tolerances": {"machine.platform_mass_kg": 0.05}, "samples": 8}
    del plan["minimize"], plan["starts"], plan["keys"]
    design = vibroplat.design(load_config(CALIBRATED, BARE | {"design": plan}))
    few = {"solver.max_events_per_period": 3, "material.mass_ratio": 0.2, SUPPLY: 52.0, "contact.restitution": 0.5}
    basins = vibroplat.basins(load_config(CALIBRATED, BARE | few | {"basins": PLANS["basins"]}))
    assert set(basins.attractors["attractor"]) == {"too-many-events"}
    for fresh in (design, basins):
        directory = fresh.save(tmp_path / fresh.command)
        proof = former(directory, {"relative_rotation": "rotation"}, schema=2)
        for path in directory.glob("*.parquet"):
            pd.read_parquet(path).replace("too-many-events", "event-storm").to_parquet(path)
        proof["configuration"]["sweep"] = {"supply_frequency_hz": {"start": 45.0, "stop": 46.0}, "max_points": 9}
        digest = proof["configuration_sha256"] = hash_of(proof["configuration"])
        (directory / "provenance.json").write_text(json.dumps(proof))
        again = load(directory)
        assert {*again.tables} == {*fresh.tables}
        for name in again.tables:
            pd.testing.assert_frame_equal(again.table(name), fresh.table(name), check_dtype=False)
        assert again.provenance["configuration_sha256"] == hash_of(again.provenance["configuration"]) != digest


@pytest.mark.parametrize("answer", [{"lines": 3}, {"text": [1], "notes": 3}, [], None])
def test_a_damaged_answer_is_an_empty_one(answer):
    assert Answer.from_tree(answer).lines == {}
    assert str(Answer.from_tree(answer)) in ("", "1")
