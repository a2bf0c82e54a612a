"""The commands that answer questions with many motions: ``basins``, ``find``, ``design``."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibroplat.cli import common
from vibroplat.study import WAIT
from vibroplat.system.terminal import points_progress

if TYPE_CHECKING:
    from vibroplat.check.questions import AnswerCheck
    from vibroplat.study.question import Answer, Question


def _command(name: str, module: str, ask: str, about: str) -> Callable[..., None]:
    """Make the command of a name; ``ask``, in a module, reads its question from the section of that name."""

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
        wait: common.Wait = WAIT,
        format_: common.Format = "parquet",
    ) -> None:
        scene = common.scene_of(config, set_, engine)
        common.tell_of_compilation(scene.solver.engine)
        with common.about(config):
            question = getattr(import_module(module), ask)(scene)
        common.require_scheduler(scheduler)
        kept = common.kept(resume, overwrite)
        _answer(question, out, jobs, scheduler, wait, format_, kept, check=check)

    command.__name__, command.__doc__ = name, about
    return command


find = _command(
    "find",
    "vibroplat.thresholds.tables",
    "question",
    """Find the values of a key at which the motion that is reached, or a measure of it, changes.

    Writes them and all values that were looked at to OUT/NAME, and prints the answer. That nothing changes is an answer
    too; exit code 1 says that a motion failed.
    """,
)
basins = _command(
    "basins",
    "vibroplat.basin.question",
    "Basins",
    """Find which motions a scene comes to from a box of starts, and from which share of it.

    Writes tables of the attractors and of all starts to OUT/NAME. Exit code 1 says that motions failed.
    """,
)
design = _command(
    "design",
    "vibroplat.designs.question",
    "Design",
    """Find what an orbit depends on, what tolerances do to it, and which values of keys are best.

    Writes tables of sensitivities, samples, shares and evaluations to OUT/NAME, and the best design as best.yaml.
    """,
)


def _answer(
    question: Question,
    out: Path,
    jobs: int,
    scheduler: str | None,
    wait: float,
    form: Any,
    kept: dict[str, bool],
    *,
    check: bool,
) -> None:
    """Answer the question that a section of a scene asks: write its tables and print what was found.

    Finished tasks are stored, so that a command that was killed can be resumed. Exit code 1 says that motions failed,
    or with a check that two engines disagree.
    """
    from vibroplat.check.questions import check_motions
    from vibroplat.config.plausibility import notes_on_inputs
    from vibroplat.integrate import engine_name, other_engine
    from vibroplat.results.files import write_result
    from vibroplat.results.provenance import provenance
    from vibroplat.study.pool import pool
    from vibroplat.study.store import Store
    from vibroplat.study.sweep import conditions

    scene, command = question.scene, question.command
    directory = common.study_directory(out, scene.name, command, resume=kept["resume"])
    file = f"{command}.sqlite"  # a sweep may have its points there
    common.print_notes(notes_on_inputs(question.scenes()))
    with Store(directory, conditions(scene), file=file, what="tasks", **kept) as store:
        common.begin(store, scene.solver.engine, *([other_engine(scene.solver.engine)] if check else []))
        began = time.perf_counter()
        with (
            pool(jobs, scheduler, wait=wait, chains=question.chains) as workers,
            points_progress(scene.name, question.counted) as progress,
        ):
            found = question.answer(store, workers, progress or (lambda done, known: None))
            repeats = partial(question.repeats, found)
            checked = check_motions(scene, repeats, store, workers) if check else None
        seconds, known = time.perf_counter() - began, store.reused
        store.finish()
        origin = provenance(scene, engine_name(scene)) | {"answer": found.told}
        origin |= {} if checked is None else {"check": checked.to_tree()}
        absent = question.absent - found.tables.keys()
        write_result(
            directory, command, origin, found.tables, form=form, absent=absent, configurations=found.configurations
        )
    took = f"{seconds:.3g} s" + (f", {known} tasks from before" if known else "")
    common.print_lines({**found.lines, "wall time": took, "tables": str(directory)})
    if not _print_answer(found, checked, question.counted):
        raise typer.Exit(1)


def _print_answer(found: Answer, checked: AnswerCheck | None, counted: str) -> bool:
    """Print an answer, and what its check has found; return whether no motion failed and the engines agree."""
    for line in found.text:
        print(line)
    common.print_notes(list(found.notes))
    common.complain_of(found.failures, f"{len(found.failures)} {counted} failed")
    return common.print_check(checked) and not found.failures
