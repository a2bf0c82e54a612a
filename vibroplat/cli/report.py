"""The command ``report``: a page to hand on."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def report(
    directories: Annotated[list[Path], typer.Argument(metavar="DIR...", help="Directories of runs, sweeps or orbits.")],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The page. Default: report.html in the first DIR.")
    ] = None,
    start: Annotated[float | None, typer.Option(help="Start of the interval in which the machine moves (s).")] = None,
    stop: Annotated[float | None, typer.Option(help="End of that interval (s).")] = None,
) -> None:
    """Write an HTML page of results, to look at and to hand on.

    One HTML file with curves, tables and the moving machine of all results side by side; it opens offline in a browser.
    """
    from vibroplat.page.report import write_report

    print(write_report(directories, out, start, stop))
