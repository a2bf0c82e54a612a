"""The command ``inspect``: what follows from a configuration before any run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vibroplat.cli import common


def inspect(
    config: Annotated[Path, typer.Argument(help="Configuration file (YAML).")], set_: common.Settings = None
) -> None:
    """Tell strokes, forces, resonances and starts before a run.

    Formulas and averaged equations take a second; nothing is simulated or written. `vibroplat columns` has their
    meanings, results/method.md how they compare with simulations.
    """
    from vibroplat.config.plausibility import notes_on_input
    from vibroplat.results.answer import note_lines

    scene = common.scene_of(config, set_, None)
    print(scene.inspect())
    for note in notes_on_input(scene):
        print("\n".join(note_lines(note)))
