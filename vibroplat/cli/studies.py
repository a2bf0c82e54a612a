"""The commands ``run``, ``sweep`` and ``orbits``: a scene in time, its response over the supply, periodic orbits."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibroplat.cli import common
from vibroplat.errors import ConfigError
from vibroplat.study import WAIT
from vibroplat.system.terminal import orbits_progress, points_progress, run_progress, sweep_progress

if TYPE_CHECKING:
    import pandas as pd

    from vibroplat.check.runs import RunCheck
    from vibroplat.config.scene import Scene
    from vibroplat.continuation.tables import Planned
    from vibroplat.motion.initial_condition import Start
    from vibroplat.motion.recorder import Files
    from vibroplat.results.run import Trajectory

#: Branches and special points of orbits that are printed at most.
MOST = 40
#: Name of the file that keeps finished parts of branches, so that a sweep may have its points beside it.
FILE = "orbits.sqlite"


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
    from vibroplat.results.tables import TableFile, result_directory

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
    from vibroplat.observe.tables import require_room

    require_room(scene, directory, format_)
    from vibroplat.config.plausibility import notes_on_input

    common.print_notes(told := notes_on_input(scene))
    common.load_kernels(scene.solver.engine)
    from vibroplat.results.files import write_result
    from vibroplat.results.provenance import provenance

    trajectory, events = (TableFile(directory, name, format_) for name in ("trajectory", "events"))
    with trajectory, events:
        result, found = _simulate(scene, start, (trajectory, events), check=check)
        summary = result.summary | {"notes": result.notes} | ({} if found is None else {"check": found.to_tree()})
        origin = provenance(scene, summary["engine"], result.origin)
        tables = {"trajectory": trajectory, "events": events}
        write_result(directory, "run", origin, tables, {"summary": summary}, form=format_)
    from vibroplat.results.card import results, sheet, whole

    lines = results(scene, result.summary, result.origin) | sheet(scene, result.summary) | whole(result.summary)
    common.print_lines(lines | {"tables": str(directory)})
    common.print_notes([note for note in result.notes if note not in told])
    if found is not None:
        common.print_lines(found.lines())
    if result.outcome != "ok":
        why, state, _ = result.summary["detail"].partition(", state [")
        more = f"; the state then is in {directory / 'summary.json'}" if state else ""
        print(f"vibroplat: {result.outcome}: {why}{more}", file=sys.stderr)
    if found is not None and not found.agrees:
        print(f"vibroplat: engines disagree {found.disagreement}", file=sys.stderr)
    if result.outcome != "ok" or (found is not None and not found.agrees):
        raise typer.Exit(1)


def _simulate(scene: Scene, start: Start, files: Files, *, check: bool) -> tuple[Trajectory, RunCheck | None]:
    """Simulate a scene; with ``check``, compare the finished run with that of another engine."""
    with run_progress(scene.name, scene.run.duration_s) as report:
        from vibroplat.motion.run import simulate

        if not check:
            return simulate(scene, keep="summary", sink=files, progress=report, start=start), None
        from vibroplat.check.runs import RUNS, Course, compared

        course = Course(scene, report, (files[0].append, files[1].append), start)
    if course.result.outcome == "out-of-memory":
        return course.result, None
    with run_progress(f"{scene.name}, check", RUNS * scene.run.duration_s) as report:
        return course.result, compared(course, progress=report)


def sweep(
    config: Annotated[Path, typer.Argument(help="Configuration file with a sweep section.")],
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
    """Sweep over supply frequencies, or another key, and a grid of values.

    Writes a table with one row per point to OUT/NAME. With --check, exit code 1 says that two engines disagree.
    """
    from vibroplat.study.branches import branches

    scene = common.scene_of(config, set_, engine)
    with common.about(config):
        planned = branches(scene)
    common.require_scheduler(scheduler)
    directory = common.study_directory(out, scene.name, "sweep", resume=resume)
    common.tell_of_compilation(scene.solver.engine)
    from vibroplat.check.questions import check_motions
    from vibroplat.integrate import other_engine
    from vibroplat.study import sweep as sweeps
    from vibroplat.study.pool import pool
    from vibroplat.study.question import CHECKED
    from vibroplat.study.store import Store

    checked = None
    common.print_notes(sweeps.notes_on_branches(planned))
    with Store(directory, sweeps.conditions(scene), **common.kept(resume, overwrite)) as store:
        common.begin(store, scene.solver.engine, *([other_engine(scene.solver.engine)] if check else []))
        began, points = time.perf_counter(), sum(len(branch.along) for branch in planned)
        chains = max(sweeps.unfinished(planned, store), CHECKED if check else 1)
        with pool(jobs, scheduler, wait=wait, chains=chains) as workers:
            with sweep_progress(scene.name, len(planned), points) as progress:
                sweeps.run_sweeps([(planned, store)], workers, progress)
            known, seconds = store.reused, time.perf_counter() - began
            if check:
                repeats = partial(sweeps.repeats, planned, store)
                with points_progress(f"{scene.name}, check") as shown:
                    checked = check_motions(scene, repeats, store, workers, shown or (lambda done, known: None))
        store.finish()
        found = None if checked is None else checked.to_tree()
        table, bands = sweeps.write_sweep(scene, planned, store, directory, format_, found)
    took = f"{seconds:.3g} s, {(len(table) - known) / seconds:.3g} points per s"
    took += f", {known} of the points from before" if known else ""
    good = _print_sweep(table, bands, {"wall time": took, "tables": str(directory)})
    if not (common.print_check(checked) and good):
        raise typer.Exit(1)


def _print_sweep(table: pd.DataFrame, bands: pd.DataFrame, more: dict[str, str]) -> bool:
    """Print an overview of a finished sweep; return whether all points are good."""
    from vibroplat.study import sweep as sweeps
    from vibroplat.study.bands import band_lines

    common.print_lines(sweeps.overview(table) | more)
    for line in band_lines(bands, "".join(table["rotation"].dropna().unique())):
        print(line)
    common.print_notes(sweeps.notes_on_points(table))
    failed = sweeps.failures(table)
    common.complain_of(failed, f"{len(failed)} of {len(table)} points failed")
    return not failed


def orbits(
    config: Annotated[Path, typer.Argument(help="Configuration file with an orbits section.")],
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
    """Follow branches of periodic orbits over a key.

    Writes a table of their points and one of special points to OUT/NAME. Exit code 1 says that a branch failed, or with
    --check that two engines disagree.
    """
    scene = common.scene_of(config, set_, engine)
    common.tell_of_compilation(scene.solver.engine)
    from vibroplat.check.questions import check_motions
    from vibroplat.continuation.tables import conditions, follow, planned, repeats, write_orbits
    from vibroplat.integrate import other_engine

    with common.about(config):
        plan = planned(scene)
    common.require_scheduler(scheduler)
    from vibroplat.config.plausibility import notes_on_inputs
    from vibroplat.study.pool import pool
    from vibroplat.study.store import Store

    directory = common.study_directory(out, scene.name, "orbits", resume=resume)
    common.print_notes(notes_on_inputs(family.scene for family in plan.families))
    kept = common.kept(resume, overwrite)
    with Store(directory, conditions(scene), file=FILE, what="parts of branches", **kept) as store:
        common.begin(store, scene.solver.engine, *([other_engine(scene.solver.engine)] if check else []))
        began, families = time.perf_counter(), len(plan.families)
        with (
            pool(jobs, scheduler, wait=wait, chains=families) as workers,
            orbits_progress(scene.name, families) as progress,
        ):
            made, summary = follow(plan, store, workers, progress)
            seconds, known, checked = time.perf_counter() - began, store.reused, None
            if check:
                checked = check_motions(scene, partial(repeats, scene, made.branches), store, workers)
        store.finish()
        write_orbits(scene, made, summary, directory, format_, None if checked is None else checked.to_tree())
    took = f"{known} parts of branches from before" if known else f"{summary['points'] / seconds:.3g} points per s"
    rotation = "" if any("rotation" in key for key in plan.plan.grid) else scene.rotation
    common.print_lines(_overview(made.branches.assign(rotation=rotation), summary))
    common.print_lines({"wall time": f"{seconds:.3g} s, {took}", "tables": str(directory)})
    _print_boundaries(summary["boundaries"])
    _print_branches(plan, summary["branches"])
    _print_special(plan, made.special)
    failed = _failed(summary["branches"])
    common.complain_of(failed, f"{len(failed)} of {len(summary['branches'])} branches failed", most=MOST)
    if not (common.print_check(checked) and not failed):
        raise typer.Exit(1)


def _failed(branches: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a line for each branch that failed."""
    return [
        f"branch {branch['branch']}{''.join(f', {key} {value}' for key, value in branch['grid'].items())} failed "
        f"after {branch['points']} points: {branch['ended']}"
        for branch in branches
        if branch["failed"]
    ]


def _overview(table: pd.DataFrame, summary: Mapping[str, Any]) -> dict[str, str]:
    """Summarize branches in a few lines: label and text."""
    from vibroplat.study.sweep import synchronizations

    points = len(table)
    frequency, height = table["excitation_frequency_hz"], 1e3 * table["rms_y_m"]
    failed = f", {summary['failed']} failed" if summary["failed"] else ""
    return {
        "branches": f"{len(summary['branches'])}{failed}",
        "points": f"{points}, {int(table['stable'].sum())} of them stable",
        "synchronization": synchronizations(table),
        "turns": f"{summary['turns']:.0f}, {summary['turns'] / max(points, 1):.1f} per point",
        "excitation frequency": f"{frequency.min():.2f} … {frequency.max():.2f} Hz",
        "RMS y": f"{height.min():.3g} … {height.max():.3g} mm",
        "residual": f"at most {table['residual'].max():.2g}",
    }


def _print_boundaries(curves: Sequence[Mapping[str, Any]]) -> None:
    """Print a line for each boundary, and an empty one."""
    for curve in curves:
        which = "".join(f", {key} {value}" for key, value in curve["grid"].items())
        print(f"boundary of {curve['kind']}{which}: {curve['points']} points; {' and '.join(curve['ended'])}")
    print()


def _varied(plan: Planned) -> list[str]:
    """List the keys of the grid that have several values."""
    return [key for key, values in plan.plan.grid.items() if len(values) > 1]


def _print_branches(plan: Planned, branches: Sequence[Mapping[str, Any]]) -> None:
    """Print a row for each branch."""
    keys, value = _varied(plan), plan.column
    header = [*(key.rpartition(".")[2] for key in keys), "branch", "begins at", value, "points", "stable", "ended"]
    rows = [
        [
            *(f"{branch['grid'][key]}" for key in keys),
            str(branch["branch"]),
            branch["origin"] + ("" if branch["parent"] is None else f" of branch {branch['parent']}"),
            "" if branch["least"] is None else f"{branch['least']:.6g} … {branch['largest']:.6g}",
            str(branch["points"]),
            str(branch["stable"]),
            ("failed: " if branch["failed"] else "") + branch["ended"],
        ]
        for branch in branches
    ]
    _print_table(header, rows, most=MOST, more="orbits.json")


def _print_special(plan: Planned, special: pd.DataFrame) -> None:
    """Print a row for each special point."""
    if special.empty:
        return
    from vibroplat.study.branches import column_of

    keys, names = [column_of(key) for key in _varied(plan)], ["branch", "kind", "period"]
    shown = special[[*keys, *names[:2]]].astype(str)
    for name in (plan.column, "excitation_frequency_hz"):
        shown[name] = [f"{value:.8g}" for value in special[name]]
    shown["period"] = special["period"].astype(str)
    header = [name.rpartition(".")[2] for name in keys]
    header += ["branch", "special point", plan.column, "excitation_frequency_hz", "period"]
    print()
    _print_table(header, shown.to_numpy().tolist(), most=MOST, more="table special")


def _print_table(header: Sequence[str], rows: Iterable[Sequence[str]], most: int, more: str) -> None:
    """Print the first rows of a table of texts in columns; if they are not all, where the others are."""
    lines = [header, *rows]
    shown = lines[: most + 1]
    widths = [max(map(len, column)) for column in zip(*shown, strict=True)]
    for line in shown:
        print("  ".join(f"{text:<{width}}" for text, width in zip(line, widths, strict=True)).rstrip())
    if len(lines) > len(shown):
        print(f"… and {len(lines) - len(shown)} more: {more}")
