"""Results of studies: what is computed and what is loaded are the same, at a prompt and on disk."""

import pickle
from pathlib import Path

import pandas as pd
import pytest

import vibroplat
from vibroplat import load, load_config
from vibroplat.config.kinds import KINDS
from vibroplat.errors import ConfigError, TableError
from vibroplat.results.result import Answer

CALIBRATED = Path(__file__).parents[2] / "configs/machines/calibrated.yaml"
MEASURED = Path(__file__).parents[2] / "configs/examples/measured.csv"
SUPPLY, RADIUS = "drive.supply_frequency_hz", "machine.unbalance_radius_m"
BARE = {SUPPLY: 62.3, "material.mass_ratio": 0.0, "solver.engine": "taylor"}
#: A small study of each kind: its section, and the figure that is drawn first.
PLANS = {
    "sweep": {"supply_frequency_hz": {"start": 62.0, "stop": 63.0, "step": 1.0}, "kind": "bifurcation", "grid": {}},
    "orbits": {"key": SUPPLY, "start": 62.0, "stop": 63.0},
    "find": {"key": SUPPLY, "start": 62.0, "stop": 63.0, "scan": 2, "tolerance": 0.3},
    "basins": {"initial_conditions": {"run.initial.phase_difference_rad": [-3.0, 3.0]}, "random": 3},
    "design": {"keys": {RADIUS: [0.03, 0.04]}, "minimize": "motor_power_w", "starts": 1},
    "fit": {
        "data": [{"file": str(MEASURED), "columns": {"t": "Zeit", "y": "Weg_y*0.001"}}],
        "keys": {RADIUS: [0.03, 0.1]},
        "starts": 1,
    },
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


@pytest.mark.parametrize("answer", [{"lines": 3}, {"text": [1], "notes": 3}, [], None])
def test_a_damaged_answer_is_an_empty_one(answer):
    assert Answer.from_tree(answer).lines == {}
    assert str(Answer.from_tree(answer)) in ("", "1")
