"""What several commands share: their options, what they do before they begin, and how they print."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from vibroplat.errors import ConfigError
from vibroplat.system.interrupts import offer_resume
from vibroplat.system.terminal import compilation_progress

if TYPE_CHECKING:
    from vibroplat.check.studies import CrossCheck
    from vibroplat.config.scene import Scene
    from vibroplat.study.store import Store

# -- options ----------------------------------------------------------------------------------------------


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
Check = Annotated[
    bool, typer.Option("--check", help="Repeat some of the motions with another engine, and compare both.")
]
Out = Annotated[Path, typer.Option(help="Directory for the results.")]
Format = Annotated[Literal["parquet", "csv"], typer.Option("--format", help="File format of the tables.")]
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

# -- before a command begins --------------------------------------------------------------------------------


def scene_of(config: Path, settings: list[str] | None, engine: str | None) -> Scene:
    """Read a configuration, with the options ``--set`` and ``--engine`` over it."""
    from vibroplat.config.reader import parse_overrides
    from vibroplat.config.scene import load_config

    return load_config(config, parse_overrides(settings or [], engine))


@contextmanager
def about(config: Path) -> Iterator[None]:
    """Let errors of a configuration name its file, where they are found only after it was read."""
    try:
        yield
    except ConfigError as error:
        raise ConfigError(f"{config}: {error}") from None


def tell_of_compilation(engine: str | None = None) -> bool:
    """Say why the first run on a machine takes long; return whether it is one."""
    import vibroplat.kernels.compiled  # noqa: F401  (refuses where compilation is switched off)
    from vibroplat import integrate

    return integrate.announce_compilation(engine or "auto")


def load_kernels(*engines: str) -> None:
    """Compile or load what a motion needs by these engines, once, before workers would each do so."""
    from vibroplat.motion import run

    for engine in engines or ("auto",):
        with _compilation(engine) if tell_of_compilation(engine) else nullcontext():
            run.load_kernels(engine)
    gc.freeze()  # what is loaded stays: the garbage collector need not look at it


def begin(store: Store, engine: str, *others: str) -> None:
    """Load what a study computes with; refuse to resume one that was begun with another arithmetic."""
    load_kernels(engine, *others)
    from vibroplat.study.fingerprint import arithmetic

    store.require("arithmetic", arithmetic(engine))


def kept(resume: bool, overwrite: bool) -> dict[str, Any]:
    """Return what becomes of the records in a store, in its own words."""
    if overwrite and resume:
        raise ConfigError("--overwrite beside --resume; allowed: one of them")
    return {"resume": resume, "overwrite": overwrite}


def study_directory(out: Path, name: str, command: str, *, resume: bool) -> Path:
    """Make the directory of a study's results; what cannot be resumed there is refused."""
    from vibroplat.results.files import read_provenance
    from vibroplat.results.tables import result_directory

    directory = result_directory(out, name)
    if resume and (directory / "provenance.json").exists():
        read_provenance(directory, command)
    return directory


@contextmanager
def _compilation(engine: str) -> Iterator[None]:
    """Let a second process compile an engine's loop, and show how many kernels are compiled."""
    from vibroplat.kernels import cache
    from vibroplat.motion import run
    from vibroplat.system.two_processes import helped_by

    kept, before = cache.folder(), cache.count()
    helped = nullcontext() if kept is None else helped_by(lambda: run.compile_loop(engine))
    with helped, compilation_progress(lambda: cache.count() - before):
        yield


def require_scheduler(address: str | None) -> None:
    """Refuse an address without a scheduler before the kernels are loaded, which may take long."""
    if address is not None:
        from vibroplat.study import cluster

        cluster.require_scheduler(address)


# -- what is printed ----------------------------------------------------------------------------------------


def print_lines(lines: Mapping[str, str], width: int = 28) -> None:
    """Print labels and texts in two columns."""
    for label, text in lines.items():
        print(f"{label:<{width}}{text}")


def print_notes(notes: Sequence[str]) -> None:
    """Print what is to be noted, a line each, at once."""
    for note in notes:
        print(f"note: {note}", flush=True)


def complain_of(lines: Sequence[str], total: str, most: int = 5) -> None:
    """Print the first of some lines and their total on standard error, if there are any."""
    for line in lines[:most]:
        print(f"vibroplat: {line}", file=sys.stderr)
    if lines:
        print(f"vibroplat: {total}", file=sys.stderr)


def print_check(found: CrossCheck | None) -> bool:
    """Print what the check of a study has found, if there was one; return whether the engines agree."""
    if found is None:
        return True
    print_lines(dict(found.lines()))
    total = f"engines disagree at {len(found.disagreements)} of {found.checked} motions"
    complain_of(found.disagreements, total)
    return found.agrees
