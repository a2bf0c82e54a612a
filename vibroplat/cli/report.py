"""The command ``report``: a page to hand on."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibroplat.cli.loading import tell_of_compilation

if TYPE_CHECKING:
    from vibroplat.config.scene import Scene
    from vibroplat.continuation.orbit import OrbitMotion


def report(
    directories: Annotated[list[Path], typer.Argument(metavar="DIR...", help="Directories of runs, sweeps or orbits.")],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The page. Default: report.html in the first DIR.")
    ] = None,
    start: Annotated[float | None, typer.Option(help="Start of the interval in which the machine moves (s).")] = None,
    stop: Annotated[float | None, typer.Option(help="End of that interval (s).")] = None,
    orbits: Annotated[
        bool,
        typer.Option(help="Compute orbits of points of sweeps and branches: a click on such a point draws its orbit."),
    ] = True,
) -> None:
    """Write an HTML page of results, to look at and to hand on.

    One HTML file with curves, tables and the moving machine of all results side by side; it opens offline in a browser.
    """
    from vibroplat.page.report import write_report
    from vibroplat.system.progress import points_progress

    with points_progress("orbits") as progress:
        print(write_report(directories, out, start, stop, mover=_move if orbits else None, progress=progress))


def _move(scene: Scene, row: Mapping[str, Any]) -> OrbitMotion:
    """Compute the orbit of a row; what computes is loaded when the first one is wanted."""
    from vibroplat.continuation.orbit import motion_of

    _tell(scene.solver.engine)
    return motion_of(scene, row)


#: Once for each engine.
_tell = cache(tell_of_compilation)
