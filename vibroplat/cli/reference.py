"""The commands ``new``, ``inspect``, ``schema`` and ``columns``: what needs no simulation."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, Literal

import typer

from vibroplat.cli import common
from vibroplat.errors import ConfigError, errors_about


def new(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="File to write, e.g. mine.yaml.")],
    machine: Annotated[
        Literal["rig", "screen", "feeder", "inclined-screen", "heavy-screen"],
        typer.Option(
            "--template",
            help="rig: 12.5 kg, 4-pole motors. screen: 1.2 t, 4-pole. feeder: 0.6 t, 6-pole, conveys. inclined-screen: "
            "1.2 t, 4-pole, conveys. heavy-screen: 4.5 t, 6-pole.",
        ),
    ] = "rig",
    full: Annotated[bool, typer.Option("--full", help="Write all keys with their meanings.")] = False,
) -> None:
    """Write a commented configuration to start from."""
    from vibroplat.config.keys import template
    from vibroplat.config.scene import Scene

    with errors_about(file):
        Scene.from_tree({"name": file.stem})  # the file's name will be that of the results
    quoted = shlex.quote(str(file))  # in commands that are to be copied
    text = template(machine, quoted, file.stem, full=full)
    try:
        with file.open("x", encoding="utf-8") as opened:
            opened.write(text)
    except FileExistsError:
        raise ConfigError(f"{file} exists already; allowed: the name of a new file") from None
    except OSError as error:
        raise ConfigError(f"{file}: cannot be written ({error.strerror or error})") from None
    print(f"{file}: change it, then `vibroplat run {quoted}`; its first lines name further commands")


def schema(
    markdown: Annotated[bool, typer.Option("--markdown", help="Print a page as results/configuration.md.")] = False,
) -> None:
    """Print all keys of a configuration, as JSON schema or page."""
    import json

    if markdown:
        from vibroplat.cli.data_dictionary import configuration_page

        print(configuration_page(), end="")
        return
    from vibroplat.config.keys import configuration_schema

    print(json.dumps(configuration_schema(), indent=2))


def columns() -> None:
    """Print meanings and units of the columns of all tables."""
    from vibroplat.cli.data_dictionary import columns_page

    print(columns_page(), end="")


def inspect(
    config: Annotated[Path, typer.Argument(help="Configuration file (YAML).")],
    set_: common.Settings = None,
    verbose: common.Verbose = False,
) -> None:
    """Estimate strokes, forces, resonances and the run-up.

    Formulas and averaged equations take a second; nothing is simulated. `vibroplat columns` lists their meanings;
    results/method.md compares them with simulations.
    """
    from vibroplat.inspection.values import inspect as find_numbers

    answer = find_numbers(common.scene_of(config, set_, None)).answer
    print(*(answer.full() if verbose else answer.brief()), sep="\n")
