import pytest

from vibroplat import load_config, orbits
from vibroplat.motion.run import load_kernels

from .helpers import MACHINE, PLAN


@pytest.fixture(scope="session")
def scene():
    """Bare and loaded machine from below the supply frequency at which the material lifts off to above it."""
    load_kernels("taylor")
    return load_config(MACHINE, {"solver.engine": "taylor", "orbits": PLAN})


@pytest.fixture(scope="session")
def found(scene):
    """The tables of its branches."""
    return orbits(scene)
