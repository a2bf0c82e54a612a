"""The command ``plot``: figures from result tables."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from vibroplat.errors import VibroplatError


class PlotKind(StrEnum):
    """Figures: the first three show a run, the last two orbits, the others a sweep."""

    motion = "motion"
    force = "force"
    exciters = "exciters"
    response = "response"
    bifurcation = "bifurcation"
    map = "map"
    branches = "branches"
    multipliers = "multipliers"


RUN_FIGURES = (PlotKind.motion, PlotKind.force, PlotKind.exciters)
ORBIT_FIGURES = (PlotKind.branches, PlotKind.multipliers)


def plot(
    directory: Annotated[
        Path, typer.Argument(metavar="DIR", help="Result directory of a run, a sweep, orbits or the paper.")
    ],
    kind: Annotated[list[PlotKind] | None, typer.Option(help="Figures to draw. Default: all.")] = None,
    start: Annotated[float | None, typer.Option(help="Start of the interval shown by motion and force (s).")] = None,
    stop: Annotated[float | None, typer.Option(help="End of that interval (s).")] = None,
) -> None:
    """Draw the figures of a run, a sweep, orbits or the paper.

    Only the tables in DIR are read; nothing is simulated.
    """
    wanted = [k.value for k in kind or []]
    of_run = [k.value for k in kind or [] if k in RUN_FIGURES]
    of_orbits = [k.value for k in kind or [] if k in ORBIT_FIGURES]
    of_sweep = [k for k in wanted if k not in (*of_run, *of_orbits)]
    has_paper, has_sweep, has_run, has_orbits = (
        any(directory.glob(f"{name}.*")) for name in ("claims", "sweep", "trajectory", "branches")
    )
    if of_orbits and not has_orbits:
        raise VibroplatError(f"--kind {of_orbits[0]}: {directory} holds no branches of orbits; see `vibroplat orbits`")
    if (of_run or of_sweep) and has_orbits and not (has_run or has_sweep):
        other = [*of_run, *of_sweep][0]
        raise VibroplatError(f"--kind {other}: {directory} holds orbits; allowed: branches, multipliers")
    if of_run and has_sweep and not has_run:
        raise VibroplatError(f"--kind {of_run[0]}: {directory} holds a sweep; allowed: response, bifurcation, map")
    if of_sweep and not has_sweep:
        raise VibroplatError(f"--kind {of_sweep[0]}: {directory} holds no sweep; allowed: motion, force, exciters")
    written: list[Path] = []
    if has_paper and not wanted:
        from vibroplat.plots.paper import plot_paper

        written += plot_paper(directory)
    if of_sweep or (has_sweep and not wanted):
        from vibroplat.plots.sweep import plot_sweep

        written += plot_sweep(directory, of_sweep)
    if of_orbits or (has_orbits and not wanted):
        from vibroplat.plots.orbits import plot_orbits

        written += plot_orbits(directory, of_orbits)
    if of_run or not (wanted or written) or (has_run and not wanted):
        from vibroplat.plots.run import plot_run

        written += plot_run(directory, of_run or [k.value for k in RUN_FIGURES], start, stop)
    for path in written:
        print(path)
