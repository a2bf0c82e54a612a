"""Options, preparations and output that several commands share."""

from __future__ import annotations

import gc
import sys
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from vibroplat.errors import ConfigError
from vibroplat.system.interrupts import offer_resume
from vibroplat.system.terminal import compilation_progress

if TYPE_CHECKING:
    from vibroplat.config.scene import Scene
    from vibroplat.results.answer import Answer
    from vibroplat.results.result import Result

# -- options ----------------------------------------------------------------------------------------------


def _offer(resume: bool) -> bool:
    """Offer --resume in messages about an interruption if it is given now; otherwise the first stored point does."""
    offer_resume(resume)
    return resume


Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Set a key, e.g. run.duration_s=2. exciters.0 is motor 1, exciters.N both.",
    ),
]
EngineName = Annotated[
    str | None,
    typer.Option(
        "--engine",
        metavar="NAME",
        help="Integrator: auto, native, sundae, taylor. auto: native (SUNDIALS IDA) for runs; taylor (Taylor series) "
        "for studies and orbits, unless the scene is stiff; the other one where it fails. Same as --set "
        "solver.engine=NAME.",
    ),
]
Check = Annotated[bool, typer.Option("--check", help="Cross-check: repeat some motions with another engine.")]
Out = Annotated[Path, typer.Option(help="Parent directory of the results.")]


def writable(form: str) -> str:
    """Return a format; refuse one without the package that writes it (ConfigError)."""
    from vibroplat.results.exports import require_writer

    return form if form in ("parquet", "csv") else require_writer(form)


Format = Annotated[
    Literal["parquet", "csv", "csv-semicolon", "xlsx", "mat"],
    typer.Option(
        "--format",
        callback=writable,
        help="File format of the tables. xlsx (Excel), mat (MATLAB) and csv-semicolon (; and decimal commas) are "
        "written beside parquet.",
    ),
]
Jobs = Annotated[int, typer.Option(min=1, help="Number of worker processes, at most one for each core.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Print all numbers, not only the answer.")]
Resume = Annotated[bool, typer.Option("--resume", callback=_offer, help="Continue an interrupted command.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Discard the points of an unfinished command.")]
Scheduler = Annotated[str | None, typer.Option(help="Address of a dask scheduler to use, e.g. tcp://host:8786.")]

# -- before a command begins --------------------------------------------------------------------------------


def scene_of(config: Path, settings: list[str] | None, engine: str | None) -> Scene:
    """Read a configuration and apply the options ``--set`` and ``--engine``."""
    from vibroplat.config.loading import load_config
    from vibroplat.config.reader import parse_overrides

    return load_config(config, parse_overrides(settings or [], engine))


def announce_first_run(engine: str = "native") -> bool:
    """Announce a compilation on standard error; return whether kernels have to be compiled."""
    import vibroplat.kernels.compiled  # noqa: F401  (refuses where compilation is switched off)
    from vibroplat import integrate

    return integrate.announce_compilation(engine)


def load_kernels(*engines: str) -> None:
    """Compile or load the kernels of these engines once, before workers start."""
    from vibroplat.motion import run

    for engine in engines or ("native",):
        with compilation_progress() if announce_first_run(engine) else nullcontext():
            run.load_kernels(engine)
    gc.freeze()  # loaded modules stay: the garbage collector need not visit them


def workers_of(study: str, engine: str | None, jobs: int | None, scheduler: str | None) -> AbstractContextManager[None]:
    """Let worker processes load a study while this command does."""
    if jobs == 1 or scheduler is not None:
        return nullcontext()
    from vibroplat.config.engine_choice import engine_of_studies
    from vibroplat.study import load_study
    from vibroplat.system.workers import loading_workers

    return loading_workers(jobs, load_study, study, engine_of_studies(engine))


def store_options(resume: bool, overwrite: bool) -> dict[str, Any]:
    """Return the arguments of a store for ``--resume`` and ``--overwrite``, which exclude each other."""
    if overwrite and resume:
        raise ConfigError("--overwrite with --resume; allowed: one of the two")
    return {"resume": resume, "overwrite": overwrite}


def command_directory(out: Path, name: str, command: str, *, resume: bool = False) -> Path:
    """Create the directory of a command's results, ``OUT/NAME/COMMAND``; refuse to resume one of another schema."""
    from vibroplat.results.files import read_provenance
    from vibroplat.results.tables import result_directory

    directory = result_directory(result_directory(out, name), command)
    if resume and (directory / "provenance.json").exists():
        read_provenance(directory)
    return directory


def require_scheduler(address: str | None) -> None:
    """Refuse an address without a scheduler, before kernels are loaded, which may take long."""
    if address is not None:
        from vibroplat.study import executors

        executors.require_scheduler(address)


def finished(
    directory: Path, command: str, scene: Scene, form: str, origin: dict[str, Any] | None = None
) -> Result | None:
    """Return a command's result in its directory if the same code computed it from the same scene; None otherwise."""
    from vibroplat.results.files import commands_in
    from vibroplat.results.provenance import is_current
    from vibroplat.results.run import load

    saved = load(directory, command) if command in commands_in(directory) and any(directory.glob(f"*.{form}")) else None
    return saved if saved is not None and is_current(saved.provenance, scene, origin) else None


# -- what is printed ----------------------------------------------------------------------------------------


def print_answer(
    answer: Answer,
    directory: Path,
    after: str,
    *,
    verbose: bool,
    failures: Sequence[str] = (),
    check: Mapping[str, str] | None = None,
    reused: str = "",
) -> None:
    """Print the answer of a command, where its files are and what to do next; failures on standard error.

    Parameters
    ----------
    answer
        The answer.
    directory
        Where the files are.
    after
        Command to run next, and what it is run with.
    verbose
        Whether all of it is printed.
    failures
        Lines for standard error, the total included.
    check
        What a cross-check found: labels and texts.
    reused
        What was computed before.
    """
    from vibroplat.results.answer import MAX_LINES, label_lines

    checked = [f"  {label}: {text}" for label, text in (check or {}).items()]
    if verbose:
        lines = [*answer.full(), *label_lines(check or {})]
    else:
        lines = [*answer.brief(MAX_LINES - 1 - len(checked) - len(failures)), *checked]
    again = "" if verbose else "again with -v: all"
    last = filter(None, (reused, again, f"next: vibroplat {after}"))
    print(*lines, f"{directory}: {'; '.join(last)}", sep="\n", flush=True)
    for line in failures:
        print(f"vibroplat: {line}", file=sys.stderr)
