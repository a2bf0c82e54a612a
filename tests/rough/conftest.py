from __future__ import annotations

import pytest

from vibroplat.flow.warm import load_kernels


@pytest.fixture(scope="session")
def kernels():
    """Compile what a motion needs, so that the command line need not tell that it does."""
    load_kernels()
