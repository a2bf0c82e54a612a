"""The command ``run``: one scene in time."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from vibroplat.cli import common
from vibroplat.errors import ConfigError
from vibroplat.system.progress import run_progress

if TYPE_CHECKING:
    from vibroplat.check.runs import RunCheck
    from vibroplat.config.scene import Scene
    from vibroplat.motion.initial_condition import Start
    from vibroplat.motion.recorder import Sink
    from vibroplat.results.run import Trajectory


def run(
    config: Annotated[Path, typer.Argument(help="Configuration file (YAML).")],
    set_: common.Settings = None,
    engine: common.EngineName = None,
    check: Annotated[
        bool, typer.Option("--check", help="Run the scene with another engine too, and compare both; six runs in all.")
    ] = False,
    out: common.Out = Path("results"),
    format_: common.Format = "parquet",
) -> None:
    """Simulate one scene in time.

    Writes trajectory, events, summary and provenance to OUT/NAME and prints the summary. With --check, exit code 1 says
    that two engines disagree.
    """
    from vibroplat.motion.initial_condition import initial_condition
    from vibroplat.results.tables import result_directory

    scene = common.scene_of(config, set_, engine)
    with common.about(config):
        start = initial_condition(scene)  # refuses before anything is written or compiled
        source = scene.run.initial.from_
        if source is not None and Path(source).resolve() == (out / scene.name).resolve():
            raise ConfigError(
                f"run.initial.from = {source!r} is where this run would be written; allowed: another name"
            )
    directory = result_directory(out, scene.name)
    common.tell_of_compilation(scene.solver.engine)
    from vibroplat.motion.recorder import require_room

    require_room(scene, directory, format_)
    common.load_kernels(scene.solver.engine)
    result, found = _simulate_and_write(scene, start, directory, format_, check=check)
    from vibroplat.results.card import results, whole

    lines = results(scene, result.summary, result.origin) | whole(result.summary)
    common.print_lines(lines | {"tables": str(directory)})
    common.print_notes(result.notes)
    if found is not None:
        common.print_lines(found.lines())
    agrees = found is None or found.agrees
    if result.outcome != "ok":
        why, state, _ = result.summary["detail"].partition(", state [")
        more = f"; the state then is in {directory / 'summary.json'}" if state else ""
        print(f"vibroplat: {result.outcome}: {why}{more}", file=sys.stderr)
    if found is not None and not agrees:
        print(f"vibroplat: engines disagree {found.disagreement}", file=sys.stderr)
    if result.outcome != "ok" or not agrees:
        raise typer.Exit(1)


def _simulate_and_write(
    scene: Scene, start: Start, directory: Path, form: Literal["parquet", "csv"], *, check: bool
) -> tuple[Trajectory, RunCheck | None]:
    """Simulate a scene and write its result; with ``check``, return what another engine has found as well."""
    from vibroplat.results.files import write_result
    from vibroplat.results.provenance import provenance
    from vibroplat.results.tables import TableFile

    trajectory, events = (TableFile(directory, name, form) for name in ("trajectory", "events"))
    with trajectory, events:
        result, found = _simulate(scene, start, (trajectory.append, events.append), check=check)
        summary = result.summary | {"notes": result.notes} | ({} if found is None else {"check": found.to_tree()})
        origin = provenance(scene, summary["engine"], result.origin)
        tables = {"trajectory": trajectory, "events": events}
        write_result(directory, "run", origin, tables, {"summary": summary}, form=form)
    return result, found


def _simulate(scene: Scene, start: Start, sink: Sink, *, check: bool) -> tuple[Trajectory, RunCheck | None]:
    """Simulate a scene; with ``check``, compare the finished run with that of another engine."""
    with run_progress(scene.name, scene.run.duration_s) as report:
        from vibroplat.motion.run import simulate

        if not check:
            return simulate(scene, keep="summary", sink=sink, progress=report, start=start), None
        from vibroplat.check.runs import RUNS, Course, compared

        course = Course(scene, report, sink, start)
    if course.result.outcome == "out-of-memory":
        return course.result, None
    with run_progress(f"{scene.name}, check", RUNS * scene.run.duration_s) as report:
        return course.result, compared(course, progress=report)
