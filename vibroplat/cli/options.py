"""Options that several commands share."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from vibroplat.interrupts import offer_resume


class TableFormat(StrEnum):
    """Formats of result tables."""

    parquet = "parquet"
    csv = "csv"


def _offer(resume: bool) -> bool:
    """Note that this command can be resumed, whether or not it is now."""
    offer_resume(True)
    return resume


Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override a key, e.g. run.duration_s=2. May be repeated."),
]
EngineName = Annotated[
    str | None,
    typer.Option(
        "--engine",
        metavar="NAME",
        help="Integrator: auto, native, sundae, or taylor, which is mostly several times faster. Short for "
        "--set solver.engine=NAME.",
    ),
]
Out = Annotated[Path, typer.Option(help="Directory for the results.")]
Format = Annotated[TableFormat, typer.Option("--format", help="File format of the tables.")]
Jobs = Annotated[int, typer.Option(min=1, help="Number of worker processes.")]
Resume = Annotated[bool, typer.Option("--resume", callback=_offer, help="Resume an interrupted command.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Discard an unfinished command's points and start over.")]
Scheduler = Annotated[
    str | None, typer.Option(help="Run on a dask cluster: address of its scheduler, e.g. tcp://host:8786.")
]
Wait = Annotated[
    float,
    typer.Option(
        min=0.0, metavar="S", help="With --scheduler: end after S seconds without a worker. After 5 s a line says so."
    ),
]
