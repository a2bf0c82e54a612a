"""The command ``schema``: the keys of a configuration."""

from __future__ import annotations


def schema() -> None:
    """Print the JSON schema of a configuration, for editors."""
    import json

    from vibroplat.config import configuration_schema

    print(json.dumps(configuration_schema(), indent=2))
