"""Common style of figures, and how they are saved."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl

from vibroplat.tables import replace_files

if "MPLBACKEND" not in os.environ:  # a notebook has its own
    mpl.use("Agg")

import matplotlib.pyplot as plt

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["CONTACT", "CURVES", "FORCE", "MATERIAL", "PLATFORM", "plain", "plt", "save", "styled"]

PLATFORM, MATERIAL, FORCE, CONTACT = "#1f4e79", "#c05a1c", "#2a7f4f", "#dfe8f1"
#: Colours of curves in one figure.
CURVES = ("#1f4e79", "#c05a1c", "#2a7f4f", "#7b3f98", "#8a6d1d", "#444444", "#b03060", "#2f8f9d")

_STYLE: Any = {
    "figure.constrained_layout.use": True,
    "figure.dpi": 130,
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.alpha": 0.25,
    "lines.linewidth": 1.3,
    "font.size": 9.5,
    "legend.frameon": False,
}


@contextmanager
def styled() -> Iterator[None]:
    """Use the common style."""
    with mpl.rc_context(_STYLE):
        yield


def plain(text: str) -> str:
    """Return a text of a user's to be drawn as it is: between two dollar signs, matplotlib would read mathematics."""
    return text.replace("$", r"\$")


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG, close it, and return its path.

    Raises
    ------
    TableError
        It cannot be written.
    """
    try:
        replace_files({path: figure.savefig})
    finally:
        plt.close(figure)
    return path
