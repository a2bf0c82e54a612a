from __future__ import annotations

import pytest
from common import handmade

from vibroplat import load_config
from vibroplat.results import write_result


@pytest.fixture(scope="session")
def moved(runs, tmp_path_factory):
    """Results of short runs by name: ``two layers``, ``bare``, ``bouncing``."""
    place = tmp_path_factory.mktemp("runs")
    found = {}
    for name in ("two layers", "bare", "bouncing"):
        run = runs[name]
        directory = place / name.replace(" ", "-")
        directory.mkdir()
        origin = handmade.origin("quickstart") | {"configuration": run.scene.to_tree()}
        tables = {"trajectory": run.trajectory, "events": run.events}
        write_result(directory, "run", origin, tables, {"summary": run.summary | {"notes": []}}, form="parquet")
        found[name] = directory
    return found


@pytest.fixture(scope="session")
def swept(tmp_path_factory):
    """Result of a sweep."""
    return handmade.write_sweep(tmp_path_factory.mktemp("sweep") / "swept")


@pytest.fixture(scope="session")
def followed(tmp_path_factory):
    """Result of orbits."""
    return handmade.write_orbits(tmp_path_factory.mktemp("orbits") / "followed")


@pytest.fixture(scope="session")
def quickstart_scene():
    return load_config(handmade.QUICKSTART)
