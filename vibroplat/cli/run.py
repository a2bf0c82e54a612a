"""The command ``run``: a scene in time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibroplat.cli import common
from vibroplat.errors import ConfigError, errors_about
from vibroplat.system.terminal import run_progress

if TYPE_CHECKING:
    from vibroplat.check.runs import RunCheck
    from vibroplat.config.scene import Scene
    from vibroplat.motion.initial_condition import Start
    from vibroplat.motion.recorder import Files
    from vibroplat.results.result import Result
    from vibroplat.results.run import RunResult


def run(
    config: Annotated[Path, typer.Argument(help="Configuration file (YAML).")],
    set_: common.Settings = None,
    engine: common.EngineName = None,
    check: Annotated[bool, typer.Option("--check", help="Cross-check with another engine; needs six runs.")] = False,
    out: common.Out = Path("results"),
    format_: common.Format = "parquet",
    verbose: common.Verbose = False,
) -> None:
    """Simulate one scene in time.

    Writes trajectory, events, summary and provenance to OUT/NAME/run and prints the answer. Exit code 1 means that the
    run failed, or with --check that two engines disagree.
    """
    from vibroplat.config.engine_choice import chosen_engine
    from vibroplat.motion.initial_condition import initial_condition
    from vibroplat.results.files import directory_of
    from vibroplat.results.tables import TableFile

    scene = common.scene_of(config, set_, engine)
    with errors_about(config):
        start = initial_condition(scene)  # errors appear before anything is written or compiled
        source = scene.run.initial.from_
        own = (out / scene.name / "run").resolve()
        if source is not None and directory_of(Path(source), "run").resolve() == own:
            raise ConfigError(
                f"run.initial.from = {source!r} is also the directory of the new run; allowed: another name"
            )
    directory = common.command_directory(out, scene.name, "run")
    known = common.finished(directory, "run", scene, format_, start.origin) if verbose and not check else None
    if known is not None:
        return _print(known, known.documents["summary"], directory, verbose=True, reused="computed before")
    engine = chosen_engine(scene, run=True)
    common.announce_first_run(engine)
    from vibroplat.observe.tables import require_room

    require_room(scene, directory, format_)
    common.load_kernels(engine)
    from vibroplat.motion.seeds import peaks_of_seeds
    from vibroplat.results.files import write_result
    from vibroplat.results.provenance import provenance

    trajectory, events = (TableFile(directory, name, format_) for name in ("trajectory", "events"))
    with trajectory, events:
        result, checked = _simulate(scene, start, (trajectory, events), check=check)
        result.summary["peaks_of_seeds"] = peaks_of_seeds(result)
        summary = result.summary | {"notes": result.notes} | ({} if checked is None else {"check": checked.to_tree()})
        origin = provenance(scene, summary["engine"], result.origin)
        tables = {"trajectory": trajectory, "events": events}
        write_result(directory, "run", origin, tables, {"summary": summary}, form=format_)
    return _print(result, summary, directory, checked, verbose=verbose)


def _print(
    result: Result,
    summary: Mapping[str, Any],
    directory: Path,
    checked: RunCheck | None = None,
    *,
    verbose: bool,
    reused: str = "",
) -> None:
    """Print the answer of a run; exit with 1 if it failed, or if two engines disagree."""
    failures = list(result.answer.failures)
    if ", state [" in summary["detail"]:
        failures[0] += f"; {directory / 'summary.json'} contains the state at that time"
    if checked is not None and not checked.agrees:
        failures.append(f"engines disagree {checked.disagreement}")
    common.print_answer(
        result.answer,
        directory,
        f"report {directory.parent}",
        verbose=verbose,
        failures=failures,
        check=None if checked is None else checked.lines(),
        reused=reused,
    )
    if failures:
        raise typer.Exit(1)


def _simulate(scene: Scene, start: Start, files: Files, *, check: bool) -> tuple[RunResult, RunCheck | None]:
    """Simulate a scene; with ``check``, compare the finished run with that of another engine."""
    with run_progress(scene.name, scene.run.duration_s) as report:
        from vibroplat.motion.run import simulate

        if not check:
            return simulate(scene, keep="summary", sink=files, progress=report, start=start), None
        from vibroplat.check.runs import MORE_RUNS, SampledRun, compare_run

        course = SampledRun(scene, report, (files[0].append, files[1].append), start)
    if course.result.outcome == "out-of-memory":
        return course.result, None
    with run_progress(f"{scene.name}, check", MORE_RUNS * scene.run.duration_s) as report:
        return course.result, compare_run(course, progress=report)
