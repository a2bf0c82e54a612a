import shutil

import pytest
from common import commands
from common.places import QUICKSTART
from common.results import unproven


@pytest.fixture(scope="session")
def finished_commands(vibroplat, tmp_path_factory):
    """Two short runs with the default output directory: ``quickstart`` in Parquet, ``bare`` in CSV."""
    short = ("run", QUICKSTART, "--set", "run.duration_s=0.2")
    bare = ("--format", "csv", "--set", "name=bare", "--set", "material.mass_ratio=0.0")
    place = tmp_path_factory.mktemp("place")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        done = {"quickstart": vibroplat(*short, cwd=place), "bare": commands.command(*short, *bare)}
    assert {name: (d.code, d.err) for name, d in done.items()} == dict.fromkeys(done, (0, ""))
    return done, place / "results"


@pytest.fixture(scope="session")
def written(finished_commands):
    """Their result directories."""
    return finished_commands[1]


@pytest.fixture
def result(written, tmp_path):
    """A copy of a result whose files may be changed."""
    copy = shutil.copytree(written / "quickstart/run", tmp_path / "result", ignore=shutil.ignore_patterns("*.png"))
    return unproven(copy)
