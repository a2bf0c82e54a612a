"""Figures of a run at a prompt and in a notebook: the one place between runs and what draws them."""

from __future__ import annotations

import base64
import io
from typing import TYPE_CHECKING

from vibroplat.plots import run as drawing
from vibroplat.plots.run_tables import run_of
from vibroplat.plots.style import styled
from vibroplat.prompt import AtPrompt, Kind

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figure(run: AtPrompt, kind: Kind, start: float | None = None, stop: float | None = None) -> Figure:
    """Draw a figure of a run.

    Raises
    ------
    ValueError
        The figure is unknown, or the run has no contact force to draw.
    TableError
        There is nothing to draw in the interval.
    """
    if kind not in drawing.FIGURES:
        raise ValueError(f"kind = {kind!r}; allowed: {', '.join(drawing.FIGURES)}")
    if kind == "force" and not run.scene.has_contact:
        raise ValueError("kind = 'force' but this run has no contact; allowed: motion, exciters")
    shown = drawing.Shown([run_of(run.summary, run.scene, run.trajectory, run.events, start, stop)])
    with styled():
        return drawing.FIGURES[kind](shown)


def picture(run: AtPrompt) -> str:
    """Return the figure of the motion as an HTML image."""
    written = io.BytesIO()
    figure(run, "motion").savefig(written, format="png", dpi=90)
    return f'<img alt="motion" src="data:image/png;base64,{base64.b64encode(written.getvalue()).decode()}">'
