"""The command ``inspect``: what follows from a configuration before any run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vibroplat.cli import common


def inspect(
    config: Annotated[Path, typer.Argument(help="Configuration file (YAML).")], set_: common.Settings = None
) -> None:
    """Print what is known before a run: stroke, forces, resonances, starting torque, synchronization.

    Formulas and averaged equations take a second; nothing is simulated or written. `vibroplat columns` has their
    meanings, results/method.md how they compare with simulations.
    """
    from vibroplat.config.plausibility import notes_on_input

    scene = common.scene_of(config, set_, None)
    print(scene.inspect())
    for note in notes_on_input(scene):
        print(f"  note: {note}")
