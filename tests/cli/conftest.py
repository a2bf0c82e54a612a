import shutil

import pytest
from common import commands
from common.places import QUICKSTART
from common.results import unproven


@pytest.fixture(scope="session")
def written(vibroplat, tmp_path_factory):
    """Directories of two short runs where they are by default: ``quickstart`` in Parquet, ``bare`` in CSV."""
    short = ("run", QUICKSTART, "--set", "run.duration_s=0.2")
    bare = ("--format", "csv", "--set", "name=bare", "--set", "material.mass_ratio=0.0")
    place = tmp_path_factory.mktemp("place")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        done = vibroplat(*short, cwd=place), commands.command(*short, *bare)
    assert [(one.code, one.err) for one in done] == [(0, "")] * 2
    return place / "results"


@pytest.fixture
def result(written, tmp_path):
    """A copy of a result whose files may be changed."""
    copy = shutil.copytree(written / "quickstart/run", tmp_path / "result", ignore=shutil.ignore_patterns("*.png"))
    return unproven(copy)
