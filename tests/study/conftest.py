import pytest

from vibroplat import load_config
from vibroplat.errors import ConfigError
from vibroplat.study.branches import branches


@pytest.fixture
def complaint(here):
    """Load a text as the configuration c.yaml and list its branches; return what the user is told."""

    def told(text):
        (here / "c.yaml").write_text(text, encoding="utf-8")
        with pytest.raises(ConfigError) as caught:
            branches(load_config("c.yaml"))
        line = str(caught.value)
        assert len(line.splitlines()) == 1
        return line

    return told


@pytest.fixture(scope="session", autouse=True)
def _compiled(kernels):
    """Compile before any of the tests."""
