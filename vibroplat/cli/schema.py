"""The commands ``schema`` and ``columns``: what the keys of a configuration and the columns of tables mean."""

from __future__ import annotations

from typing import Annotated

import typer


def schema(
    markdown: Annotated[
        bool, typer.Option("--markdown", help="A page for people instead, as results/configuration.md.")
    ] = False,
) -> None:
    """Print all keys of a configuration, as a JSON schema or a page."""
    import json

    if markdown:
        from vibroplat.cli.dictionary import configuration_page

        print(configuration_page(), end="")
        return
    from vibroplat.config.keys import configuration_schema

    print(json.dumps(configuration_schema(), indent=2))


def columns() -> None:
    """Print what the columns of all tables mean."""
    from vibroplat.cli.dictionary import columns_page

    print(columns_page(), end="")
