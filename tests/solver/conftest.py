from pathlib import Path

import pytest

from vibroplat import load_config

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def printed():
    return load_config(ROOT / "configs/machines/printed.yaml")


@pytest.fixture(scope="session")
def calibrated():
    return load_config(ROOT / "configs/machines/calibrated.yaml")


@pytest.fixture(scope="session")
def quickstart():
    return load_config(ROOT / "configs/quickstart.yaml")
