"""The command ``inspect``: what follows from a configuration before any run."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from vibroplat.cli import common

#: Most lines of notes below those of the inspection.
MAX_NOTES = 4


def inspect(
    config: Annotated[Path, typer.Argument(help="Configuration file (YAML).")],
    set_: common.Settings = None,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print all notes.")] = False,
) -> None:
    """Tell strokes, forces, resonances and starts before a run.

    Formulas and averaged equations take a second; nothing is simulated or written. `vibroplat columns` has their
    meanings, results/method.md how they compare with simulations.
    """
    from vibroplat.config.plausibility import by_severity, notes_on_input
    from vibroplat.results.answer import notes_within

    scene = common.scene_of(config, set_, None)
    notes = by_severity(notes_on_input(scene))
    print(scene.inspect(), *notes_within(notes, sys.maxsize if verbose else MAX_NOTES), sep="\n")
