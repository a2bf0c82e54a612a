import pytest

from vibroplat import load_config
from vibroplat.errors import ConfigError


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
