from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from vibroplat import load_config, simulate
from vibroplat.errors import ConfigError

from .helpers import QUICKSTART

PROGRAM = Path(sys.executable).with_name("vibroplat")

CHANGES = {
    "two layers": {},
    "one layer": {"material.layers": 1},
    "bare": {"material.mass_ratio": 0.0},
    "bouncing": {"contact.restitution": 0.5},
}


@pytest.fixture
def scene_of(here):
    """Load a text, or bytes, as the configuration c.yaml."""

    def load(text, overrides=None):
        (here / "c.yaml").write_bytes(text if isinstance(text, bytes) else text.encode())
        return load_config("c.yaml", overrides)

    return load


@pytest.fixture
def complaint(scene_of):
    """Load a text as the configuration c.yaml, and return what the user is told."""

    def told(text, overrides=None):
        with pytest.raises(ConfigError) as caught:
            scene_of(text, overrides)
        return str(caught.value)

    return told


@pytest.fixture(scope="session")
def runs():
    """Finished runs of a quarter of a second."""
    scenes = {name: load_config(QUICKSTART, {"run.duration_s": 0.25, **c}) for name, c in CHANGES.items()}
    return {name: simulate(scene) for name, scene in scenes.items()}


@pytest.fixture(scope="session", params=list(CHANGES))
def finished(request, runs):
    """Each of the finished runs in turn."""
    return runs[request.param]


@pytest.fixture(scope="session")
def kernels():
    """Compile what a run needs, so that the command line need not tell that it does."""
    simulate(load_config(QUICKSTART, {"run.duration_s": 0.01}))


@pytest.fixture(scope="session")
def vibroplat(kernels):
    """Run the command line as a user does."""

    def run(*arguments, **options):
        command = [str(PROGRAM), *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, **options)

    return run


@pytest.fixture(scope="session")
def finished_commands(vibroplat, tmp_path_factory):
    """Two short runs with the default output directory: ``quickstart`` in Parquet, ``bare`` in CSV."""
    short = ("run", QUICKSTART, "--set", "run.duration_s=0.2")
    bare = ("--format", "csv", "--set", "name=bare", "--set", "material.mass_ratio=0.0")
    place = tmp_path_factory.mktemp("place")
    done = {"quickstart": vibroplat(*short, cwd=place), "bare": vibroplat(*short, *bare, cwd=place)}
    assert {name: (d.returncode, d.stderr) for name, d in done.items()} == dict.fromkeys(done, (0, ""))
    return done, place / "results"


@pytest.fixture(scope="session")
def written(finished_commands):
    """Their result directories."""
    return finished_commands[1]
