"""The commands ``plot``, ``report``, ``film`` and ``export``: figures, a page, a film and files of result tables."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from vibroplat.cli.common import announce_first_run, writable
from vibroplat.config.kinds import KINDS, RUN_FIGURES

if TYPE_CHECKING:
    from vibroplat.config.scene import Scene
    from vibroplat.continuation.rows import OrbitMotion

#: Figures: those of a run, and of each kind of study.
_FIGURES = " ".join([RUN_FIGURES, *(kind.figures for kind in KINDS.values())])
Kind = StrEnum("Kind", _FIGURES)  # type: ignore[misc]

#: Measured data beside results.
Data = Annotated[
    str | None,
    typer.Option(
        metavar="FILE[:MAP]",
        help="Measured data to overlay and compare: CSV or .xlsx, columns as in the tables, or as MAP says, e.g. "
        "t=Zeit,ay=Beschl_y*9.81,shift=fit,offset=fit.",
    ),
]


def plot(
    directories: Annotated[
        list[Path], typer.Argument(metavar="DIR...", help="Result directories; several runs or sweeps are overlaid.")
    ],
    kind: Annotated[list[Kind] | None, typer.Option(help="Figures to draw. Default: all.")] = None,
    start: Annotated[float | None, typer.Option(help="Start of the plotted interval of a run (s).")] = None,
    stop: Annotated[float | None, typer.Option(help="End of the plotted interval (s).")] = None,
    x: Annotated[
        Literal["excitation", "supply"] | None,
        typer.Option(help="Horizontal axis of a sweep. Default: excitation, or the swept key."),
    ] = None,
    measure: Annotated[
        list[str] | None,
        typer.Option(metavar="COLUMN", help="Column to plot in a response, a map or thresholds. May be repeated."),
    ] = None,
    data: Data = None,
    format_: Annotated[Literal["png", "pdf", "svg"], typer.Option("--format", help="Format of the figures.")] = "png",
    dpi: Annotated[int | None, typer.Option(min=10, max=2400, help="Dots per inch. Default: 130.")] = None,
    out: Annotated[Path | None, typer.Option(help="Directory for the figures. Default: the first DIR.")] = None,
) -> None:
    """Draw figures of one or several results.

    Several runs or sweeps are overlaid. Only the tables in DIR are read; nothing is simulated.
    """
    from vibroplat.measured.data import read_data
    from vibroplat.plots.command import plot_results
    from vibroplat.plots.style import Saving

    kinds, saving = [one.value for one in kind or []], Saving(format_, dpi, out)
    measured = None if data is None else read_data(data)
    options = {"start": start, "stop": stop, "x": x, "data": measured, "measure": measure or None}
    for path in plot_results(directories, kinds, saving=saving, **options):
        print(path)
    for line in () if measured is None else measured.lines():
        print(line)


def report(
    directories: Annotated[
        list[Path], typer.Argument(metavar="DIR...", help="Result directories of any command but paper.")
    ],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The page. Default: report.html in the first DIR.")
    ] = None,
    start: Annotated[float | None, typer.Option(help="Start of the detail (s). Default: the last turns.")] = None,
    stop: Annotated[float | None, typer.Option(help="End of the detail (s).")] = None,
    orbits: Annotated[
        bool, typer.Option(help="Compute the orbits of sweep and branch points, which a click on a point draws.")
    ] = True,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace FILE even if it is not a page of vibroplat.")
    ] = False,
    data: Data = None,
) -> None:
    """Write results as one HTML page that opens offline.

    The answer comes first, then the moving machine, the data sheet and curves; all else is folded.
    """
    from vibroplat.page.report import write_report
    from vibroplat.system.terminal import points_progress

    with points_progress("orbits") as progress:
        mover = _move if orbits else None
        kept = write_report(
            directories, out, start, stop, mover=mover, progress=progress, overwrite=overwrite, data=data
        )
        print(kept)


def film(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="Result directory of a run.")],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Film to write, .gif. Default: machine.gif in DIR.")
    ] = None,
    start: Annotated[float | None, typer.Option(help="Start of the interval (s). Default: the last turns.")] = None,
    stop: Annotated[float | None, typer.Option(help="End of the interval (s).")] = None,
) -> None:
    """Film the moving machine of a run in slow motion, as a GIF."""
    from vibroplat.page.film import write_film

    print(write_film(directory, out, start, stop))


def export(
    directories: Annotated[list[Path], typer.Argument(metavar="DIR...", help="Result directories of any command.")],
    format_: Annotated[
        Literal["xlsx", "mat", "csv-semicolon"],
        typer.Option("--format", callback=writable, help="Excel, MATLAB, or CSV with ; and decimal commas."),
    ] = "xlsx",
) -> None:
    """Write finished results for other programs."""
    from vibroplat.results.files import commands_in, export_result

    for directory in directories:
        for command in commands_in(directory) or ["run"]:
            for path in export_result(directory, command, format_):
                print(path)


def _move(scene: Scene, row: Mapping[str, Any]) -> OrbitMotion:
    """Compute the orbit of a row; the modules that compute are imported at the first call."""
    from vibroplat.config.engine_choice import chosen_engine
    from vibroplat.continuation.rows import orbit_motion

    announce_first_run(chosen_engine(scene))
    return orbit_motion(scene, row)
