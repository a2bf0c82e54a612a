"""Fixtures of several rooms."""

import csv
import os
import random
import signal
from collections import Counter
from pathlib import Path

import pytest
from common import commands
from common.places import QUICKSTART

from vibroplat import load_config, simulate
from vibroplat.config.reader import load_tree
from vibroplat.motion.run import load_kernels

CHANGES = {
    "two layers": {},
    "one layer": {"material.layers": 1},
    "bare": {"material.mass_ratio": 0.0},
    "bouncing": {"contact.restitution": 0.5},
}


ROOT = Path(__file__).parents[1]


def pytest_collection_modifyitems(config, items):
    """Begin with the files that take longest, or were never measured, so that processes end together.

    ``TEST_ORDER=1 python -m pytest`` takes files in a random order of this seed.
    """
    if "TEST_ORDER" in os.environ:
        files = list(dict.fromkeys(item.path for item in items))
        random.Random(int(os.environ["TEST_ORDER"])).shuffle(files)
        items.sort(key=lambda item: files.index(item.path))
        return
    column, seconds = "quick_s" if "not long" in config.option.markexpr else "other_s", Counter()
    with (ROOT / "tests/tools/durations.csv").open() as file:
        for row in csv.DictReader(file):
            seconds[ROOT / row["file"]] += float(row[column])
    items.sort(key=lambda item: -seconds.get(item.path, float("inf")))


@pytest.fixture(scope="session", autouse=True)
def _ctrl_c():
    """Let Ctrl-C interrupt commands, also where a shell has started the tests in the background.

    A shell without job control starts ``pytest &`` with SIGINT ignored, and processes would inherit that.
    """
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def kernels():
    """Compile what a motion needs, so that commands do not report that they compile."""
    load_kernels()


@pytest.fixture
def command():
    """Run the command line in this process, which spares the imports."""
    return commands.command


@pytest.fixture(scope="session")
def vibroplat(kernels):
    """Run the command line in a process of its own, as a user does."""
    return commands.process


@pytest.fixture
def figures(monkeypatch):
    """Figures by the names of their files; no pictures are made of them, which would take most of the time."""
    kept = {}

    def keep(figure, path, **_options):
        name = path.name.removeprefix(".").partition("-")[0]
        kept[name] = figure
        path.write_text(f"figure {name}")

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", keep)
    return kept


@pytest.fixture(scope="session")
def runs():
    """Finished runs of a quarter of a second."""
    scenes = {name: load_config(QUICKSTART, {"run.duration_s": 0.25, **c}) for name, c in CHANGES.items()}
    return {name: simulate(scene) for name, scene in scenes.items()}


@pytest.fixture(scope="session")
def saved(runs, tmp_path_factory):
    """Directories of these runs by name."""
    place = tmp_path_factory.mktemp("runs")
    return {name: run.save(place / name) for name, run in runs.items()}


@pytest.fixture(scope="session")
def printed():
    return load_config(ROOT / "configs/machines/printed.yaml", {"material.mass_ratio": 0.0})


@pytest.fixture(scope="session")
def damped():
    return load_config(ROOT / "tests/machines/damped.yaml")


@pytest.fixture(scope="session")
def quickstart():
    return load_config(QUICKSTART, load_tree(ROOT / "tests/machines/damped.yaml"))
