"""The commands of studies: one for each kind, all made by one function, and that of the paper."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from vibroplat.cli import common
from vibroplat.config.kinds import KINDS, Kind
from vibroplat.errors import errors_about
from vibroplat.system.terminal import points_progress

if TYPE_CHECKING:
    from vibroplat.check.studies import CrossCheck
    from vibroplat.results.result import Result
    from vibroplat.study.study import Study


class Execution(NamedTuple):
    """How a command runs a study: workers, format of tables, options of the store, cross-check, length of the print."""

    jobs: int | None
    scheduler: str | None
    form: Any
    options: dict[str, Any]
    check: bool
    verbose: bool


def study_command(kind: Kind) -> Callable[..., None]:
    """Return the command of a kind of study; the command reads the configuration section of the same name."""

    def command(
        config: Annotated[Path, typer.Argument(help="Configuration file with a section of the command's name.")],
        check: common.Check = False,
        set_: common.Settings = None,
        engine: common.EngineName = None,
        out: common.Out = Path("results"),
        jobs: common.Jobs = 1,
        resume: common.Resume = False,
        overwrite: common.Overwrite = False,
        scheduler: common.Scheduler = None,
        format_: common.Format = "parquet",
        verbose: common.Verbose = False,
    ) -> None:
        with common.workers_of(kind.study, engine, jobs, scheduler):
            from vibroplat.config.engine_choice import chosen_engine

            scene = common.scene_of(config, set_, engine)
            common.announce_first_run(chosen_engine(scene))
            with errors_about(config):
                study = kind.load()(scene)
            mode = common.store_options(resume, overwrite)
            common.require_scheduler(scheduler)
            directory = common.command_directory(out, scene.name, kind.name, resume=resume)
            how = Execution(jobs, scheduler, format_, mode, check, verbose)
            if not run_and_print(study, directory, how):
                raise typer.Exit(1)

    command.__name__ = kind.name
    command.__doc__ = (
        f"{kind.summary}\n\n{kind.about} Exit code 1 means that a simulation failed, or with --check that two engines "
        "disagree."
    )
    return command


COMMANDS = [study_command(kind) for kind in KINDS.values()]


def run_and_print(study: Study, directory: Path, how: Execution) -> bool:
    """Run a study, write its result and print its answer; return whether all motions succeeded and the engines agree.

    Finished tasks are stored, so that a killed command can be resumed.
    """
    from vibroplat.results.answer import first_failures

    again = how.verbose and study.kind in KINDS and not (how.check or any(how.options.values()))
    result = common.finished(directory, study.kind, study.scene, how.form) if again else None
    lines, checked, reused = dict[str, str](), None, "computed before"
    if result is None:
        result, lines, checked, reused = _compute(study, directory, how)
    failed = result.answer.failures
    failures = first_failures(failed, f"{len(failed)} of the {study.counted} failed")
    if checked is not None:
        total = f"engines disagree at {len(checked.disagreements)} of {checked.checked} motions"
        failures += first_failures(checked.disagreements, total)
    home = directory.parent if directory.name == study.kind else directory
    common.print_answer(
        result.answer._replace(lines={**result.answer.lines, **lines}),
        directory,
        f"run {directory / 'best.yaml'}" if "best" in result.configurations else f"plot {home}",
        verbose=how.verbose,
        failures=failures,
        check=None if checked is None else dict(checked.lines()),
        reused=reused,
    )
    return not failures


def _compute(study: Study, directory: Path, how: Execution) -> tuple[Result, dict[str, str], CrossCheck | None, str]:
    """Run a study and write its result; return it, more lines, the cross-check, and what was computed before."""
    from vibroplat.check.studies import cross_check
    from vibroplat.config.digits import quantity
    from vibroplat.config.engine_choice import chosen_engine, other_engine
    from vibroplat.results.answer import noted
    from vibroplat.study.fingerprint import arithmetic
    from vibroplat.study.pool import pool
    from vibroplat.study.store import Store
    from vibroplat.study.study import MAX_CROSS_CHECKS, note_computation

    scene = study.scene
    for note in study.input_notes() if sys.stderr.isatty() else ():  # to a person who waits
        print(f"vibroplat: {noted(note)}", file=sys.stderr)
    with Store(directory, study.conditions, **how.options) as store:
        engine = chosen_engine(scene)
        common.load_kernels(engine, *([other_engine(engine)] if how.check else []))
        store.require("arithmetic", arithmetic(engine))
        began = time.perf_counter()
        chains = max(study.chains(store), MAX_CROSS_CHECKS if how.check else 1)
        with pool(how.jobs, how.scheduler, chains=chains) as workers:
            with points_progress(scene.name, study.counted) as progress:
                result = study.run(store, workers, progress or (lambda done, known: None))
            seconds, known = time.perf_counter() - began, store.reused
            checked = None
            if how.check:
                with points_progress(f"{scene.name}, check", "motions") as progress:
                    checked = cross_check(study, result, store, workers, progress or (lambda done, known: None))
        store.finish()
        result.check = None if checked is None else checked.to_tree()
        note_computation(study, result)
        result.save(directory, how.form)
    return result, {"wall time": quantity(seconds, "s")}, checked, f"{known} tasks from before" * bool(known)


def paper(
    machine: Annotated[
        list[str] | None, typer.Option(help="A machine from configs/machines. Default: printed and calibrated.")
    ] = None,
    check: common.Check = False,
    set_: common.Settings = None,
    engine: common.EngineName = None,
    out: common.Out = Path("results"),
    jobs: Annotated[int | None, typer.Option(min=1, help="Number of worker processes. Default: all cores.")] = None,
    resume: common.Resume = False,
    overwrite: common.Overwrite = False,
    scheduler: common.Scheduler = None,
    format_: common.Format = "csv",
    seeds: Annotated[int, typer.Option(min=1, help="Number of perturbation seeds for each claim.")] = 3,
    verbose: common.Verbose = False,
) -> None:
    """Reproduce the figures and claims of the paper.

    Computes figures 2-7 and their tables, and compares each claim of the paper with the simulation. Exit code 1 means
    that with --check two engines disagree.
    """
    from vibroplat.config.engine_choice import engine_of_studies

    common.announce_first_run(engine_of_studies(engine))
    from vibroplat.config.reader import parse_overrides
    from vibroplat.paper.scenes import machine_numbers

    changes = parse_overrides(set_ or [], engine)
    chosen = {name: {**machine_numbers(name), **changes} for name in machine or ("printed", "calibrated")}
    common.require_scheduler(scheduler)
    from vibroplat.paper.reproduction import PaperStudy
    from vibroplat.plots.command import plot_results
    from vibroplat.results.tables import result_directory

    good = True
    for name, numbers in chosen.items():
        study = PaperStudy(numbers, range(seeds), name)
        directory = result_directory(out / "paper", name)
        how = Execution(jobs, scheduler, format_, common.store_options(resume, overwrite), check, verbose)
        good &= run_and_print(study, directory, how)
        plot_results([directory])
    if not good:
        raise typer.Exit(1)
