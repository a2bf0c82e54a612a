"""Options that several commands share."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields
from enum import StrEnum
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from vibroplat.study import WAIT
from vibroplat.system.interrupts import offer_resume


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


@dataclass(frozen=True, kw_only=True)
class Study:
    """The options of commands that compute many points and can be resumed; each is an option of the same name."""

    set_: Settings = None
    engine: EngineName = None
    out: Out = Path("results")
    jobs: Jobs = 1
    resume: Resume = False
    overwrite: Overwrite = False
    scheduler: Scheduler = None
    wait: Wait = WAIT
    format_: Format = TableFormat.parquet


def with_study(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of :class:`Study`, after its own; it gets them as its last parameter, ``study``."""
    own = inspect.signature(command, eval_str=True)
    types = get_type_hints(Study, include_extras=True)
    options = [
        inspect.Parameter(
            field.name, inspect.Parameter.KEYWORD_ONLY, default=field.default, annotation=types[field.name]
        )
        for field in fields(Study)
    ]

    @wraps(command)
    def given(*arguments: Any, **values: Any) -> None:
        study = Study(**{option.name: values.pop(option.name) for option in options})
        command(*arguments, **values, study=study)

    shown = [parameter for name, parameter in own.parameters.items() if name != "study"]
    given.__signature__ = own.replace(parameters=[*shown, *options])  # type: ignore[attr-defined]
    given.__annotations__ = {parameter.name: parameter.annotation for parameter in (*shown, *options)}
    return given
