import shutil

import pytest
from common import handmade
from common.places import ROOT
from common.results import edited, unproven

from vibroplat import basins, design, find, load_config, orbits, simulate, sweep


@pytest.fixture(scope="session")
def saved(saved, tmp_path_factory):
    """The same runs without their notes, which take room."""
    place = tmp_path_factory.mktemp("quiet")
    copies = {name: unproven(shutil.copytree(directory, place / name)) for name, directory in saved.items()}
    return {name: edited(copy, "summary", notes=[]) for name, copy in copies.items()}


@pytest.fixture(scope="session")
def started(tmp_path_factory):
    """Result of a start from rest."""
    changes = {"name": "started", "solver.engine": "taylor", "run.duration_s": 1.5, "run.initial.speed_ratio": 0.0}
    run = simulate(load_config(handmade.QUICKSTART, changes))
    return run.save(tmp_path_factory.mktemp("starts") / "started")


@pytest.fixture(scope="session")
def swept(tmp_path_factory):
    """Result of a sweep."""
    return handmade.write_sweep(tmp_path_factory.mktemp("sweep") / "swept")


@pytest.fixture(scope="session")
def followed(tmp_path_factory):
    """Result of orbits."""
    return handmade.write_orbits(tmp_path_factory.mktemp("orbits") / "followed")


@pytest.fixture(scope="session")
def branched(tmp_path_factory):
    """Result of orbits that were followed: without material, and with material that lifts off."""
    plan = {
        "key": "drive.supply_frequency_hz",
        "start": 46.5,
        "stop": 49.0,
        "grid": {"material.mass_ratio": [0.0, 0.1]},
    }
    scene = load_config(handmade.QUICKSTART, {"name": "branched", "solver.engine": "taylor", "orbits": plan})
    directory = tmp_path_factory.mktemp("orbits") / "branched"
    return orbits(scene).save(directory)


@pytest.fixture(scope="session")
def measured(tmp_path_factory):
    """Result of a sweep that was measured."""
    plan = {"supply_frequency_hz": {"start": 45.0, "stop": 51.0, "step": 2.0}, "grid": {}, "measure_s": 1.0}
    scene = load_config(handmade.QUICKSTART, {"name": "measured", "solver.engine": "taylor", "sweep": plan})
    directory = tmp_path_factory.mktemp("sweeps") / "measured"
    return sweep(scene).save(directory)


@pytest.fixture(scope="session")
def quickstart_scene():
    return load_config(handmade.QUICKSTART)


@pytest.fixture(scope="session")
def answered(tmp_path_factory):
    """Results of questions by name: ``basins``, ``over``, ``thresholds``, ``design``, ``best``."""
    place = tmp_path_factory.mktemp("answers")
    supply, radius = "drive.supply_frequency_hz", "machine.unbalance_radius_m"
    box = {"run.initial.phase_difference_rad": [-3.1, 3.1], "run.initial.speed_ratio": [0.0, 1.1]}
    mass = {"key": "material.mass_ratio", "start": 0.0, "stop": 0.6, "from": "previous"}
    wide = {radius: [0.018, 0.048], "machine.stiffness_y_n_per_m": [329e3, 611e3], supply: [46.75, 60.5]}
    best = {
        "keys": wide,
        "minimize": "motor_power_w",
        "constraints": {"rms_y_m": ">= 1e-3"},
        "pareto": {"rms_y_m": [0.9e-3, 1.1e-3]},
    }
    spread = {"parameter_tolerances": {radius: 0.05}, "samples": 20}
    over = {"key": supply, "start": 62.3, "stop": 63.1, "count": 2}
    questions = {
        "basins": (basins, 62.3, 0.0, {"basins": {"initial_conditions": box, "random": 40}}),
        "over": (basins, 62.3, 0.0, {"basins": {"initial_conditions": box, "random": 20, "over": over}}),
        "thresholds": (find, 60.0, 0.3, {"find": mass}),
        "design": (design, 57.4, 0.1, {"design": spread | {"keys": {radius: [0.02, 0.04]}}}),
        "best": (design, 55.0, 0.1, {"design": best | {"starts": 2}}),
    }
    for name, (study, frequency, ratio, plan) in questions.items():
        keys = {"name": name, "solver.engine": "taylor", supply: frequency, "material.mass_ratio": ratio}
        scene = load_config(ROOT / "configs/machines/calibrated.yaml", keys | plan)
        study(scene).save(place / name)
    return {name: place / name for name in questions}
