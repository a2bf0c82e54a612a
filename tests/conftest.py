"""What all tests share."""

from __future__ import annotations

from pathlib import Path

import pytest

from vibroplat import load_config
from vibroplat.config import load_tree

ROOT = Path(__file__).parents[1]


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def printed():
    return load_config(ROOT / "configs/machines/printed.yaml")


@pytest.fixture(scope="session")
def damped():
    return load_config(ROOT / "tests/machines/damped.yaml")


@pytest.fixture(scope="session")
def quickstart():
    return load_config(ROOT / "configs/quickstart.yaml", load_tree(ROOT / "tests/machines/damped.yaml"))
