"""The command ``plot``: figures from result tables."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class PlotKind(StrEnum):
    """Figures: the first three show a run, the last three orbits, the others a sweep."""

    motion = "motion"
    force = "force"
    exciters = "exciters"
    response = "response"
    bifurcation = "bifurcation"
    map = "map"
    branches = "branches"
    multipliers = "multipliers"
    boundaries = "boundaries"


class Abscissa(StrEnum):
    """Frequencies that a sweep is drawn over: capture by a resonance shows over that of the supply."""

    excitation = "excitation"
    supply = "supply"


class FigureFormat(StrEnum):
    """Formats of figures."""

    png = "png"
    pdf = "pdf"
    svg = "svg"


def plot(
    directories: Annotated[
        list[Path],
        typer.Argument(
            metavar="DIR...",
            help="Result directory of a run, a sweep, orbits or the paper; several are laid over each other.",
        ),
    ],
    kind: Annotated[list[PlotKind] | None, typer.Option(help="Figures to draw. Default: all.")] = None,
    start: Annotated[float | None, typer.Option(help="Start of the interval that figures of a run show (s).")] = None,
    stop: Annotated[float | None, typer.Option(help="End of that interval (s).")] = None,
    x: Annotated[Abscissa | None, typer.Option(help="Horizontal axis of a sweep. Default: excitation.")] = None,
    data: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Measured data to lay over: CSV, columns as in the tables.")
    ] = None,
    format_: Annotated[FigureFormat, typer.Option("--format", help="Format of the figures.")] = FigureFormat.png,
    dpi: Annotated[int | None, typer.Option(min=10, max=2400, help="Dots per inch. Default: 130.")] = None,
    out: Annotated[Path | None, typer.Option(help="Directory for the figures. Default: the first DIR.")] = None,
) -> None:
    """Draw figures of a run, a sweep, orbits or the paper.

    Several runs or sweeps are laid over each other. Only the tables in DIR are read; nothing is simulated.
    """
    from vibroplat.plots.command import plot_results
    from vibroplat.plots.style import Saving

    kinds = [k.value for k in kind or []]
    saving = Saving(format_.value, dpi, out)
    axis = None if x is None else x.value
    for path in plot_results(directories, kinds, saving=saving, start=start, stop=stop, x=axis, data=data):
        print(path)
