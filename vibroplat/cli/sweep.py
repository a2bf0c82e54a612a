"""The command ``sweep``: branches over supply frequencies and a grid."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from vibroplat.cli.loading import about, load_kernels, require_scheduler, tell_of_compilation
from vibroplat.cli.options import Study, with_study
from vibroplat.cli.printing import print_lines, print_notes
from vibroplat.system.progress import sweep_progress

if TYPE_CHECKING:
    from vibroplat.check.sweeps import SweepCheck
    from vibroplat.config.scene import Scene
    from vibroplat.study.branches import Branch
    from vibroplat.study.choice import Place
    from vibroplat.study.execution import Pool
    from vibroplat.study.store import Store

#: Failed points of a sweep that are reported one by one.
TOLD = 5


class _Done(NamedTuple):
    """What a finished sweep has taken: points that were known before, seconds; and what its check has found."""

    known: int
    seconds: float
    check: SweepCheck | None


@with_study
def sweep(
    config: Annotated[Path, typer.Argument(help="Configuration file with a sweep section.")],
    check: Annotated[
        float | None,
        typer.Option(metavar="SHARE", help="Repeat this share of the points with another engine, and compare both."),
    ] = None,
    *,
    study: Study,
) -> None:
    """Sweep over supply frequencies and a grid of values.

    Writes a table with one row per point to OUT/NAME. With --check, exit code 1 says that two engines disagree.
    """
    from vibroplat.config.reader import load_config, parse_overrides
    from vibroplat.study.branches import branches
    from vibroplat.study.choice import chosen, require_share

    if check is not None:
        require_share(check)
    scene = load_config(config, parse_overrides(study.set_ or [], study.engine))
    with about(config):
        planned = branches(scene)
    places = [] if check is None else chosen(scene, check)
    require_scheduler(study.scheduler)
    from vibroplat.results.files import read_provenance
    from vibroplat.results.tables import result_directory

    directory = result_directory(study.out, scene.name)
    if study.resume and (directory / "provenance.json").exists():
        read_provenance(directory, "sweep")
    tell_of_compilation(scene.solver.engine)
    from vibroplat.integrate import other_engine
    from vibroplat.study import report
    from vibroplat.study.execution import pool
    from vibroplat.study.store import Store
    from vibroplat.study.sweep import conditions

    engines = [scene.solver.engine, *([other_engine(scene.solver.engine)] if places else [])]
    with Store(directory, conditions(scene), resume=study.resume, overwrite=study.overwrite) as store:
        stored = store.lengths()
        left = sum(stored.get(branch.number, 0) < len(branch.frequencies) for branch in planned)
        load_kernels(*engines)
        with pool(study.jobs, study.scheduler, wait=study.wait, chains=max(left, len(places))) as workers:
            done = _measure(scene, planned, places, store, workers)
        store.finish()
        found = None if done.check is None else done.check.to_tree()
        report.write_sweep(scene, store, directory, study.format_.value, check=found)
    if not _print_sweep(planned, directory, done):
        raise typer.Exit(1)


def _measure(scene: Scene, planned: Sequence[Branch], places: list[Place], store: Store, workers: Pool) -> _Done:
    """Measure the points of a sweep that are not stored yet, and check those at some places."""
    from vibroplat.check.sweeps import check_points
    from vibroplat.study.sweep import run_sweeps

    began = time.perf_counter()
    with sweep_progress(scene.name, len(planned), sum(len(branch.frequencies) for branch in planned)) as progress:
        run_sweeps([(scene, store)], workers, progress)
    known, seconds = store.reused, time.perf_counter() - began
    if not places:
        return _Done(known, seconds, None)
    with sweep_progress(f"{scene.name}, check", len(places), len(places)) as progress:
        found = check_points(scene, places, store, store.part("check"), workers, progress=progress)
    return _Done(known, seconds, found)


def _print_sweep(planned: Sequence[Branch], directory: Path, done: _Done) -> bool:
    """Print an overview of a finished sweep; return whether all points are good and no engine disagrees."""
    from vibroplat.results.files import Result
    from vibroplat.study import report

    table = Result(directory, "sweep").table("sweep")
    points, measured = len(table), len(table) - done.known
    resumed = f", {done.known} of the points from before" if done.known else ""
    took = f"{done.seconds:.3g} s, {measured / done.seconds:.3g} points per s{resumed}"
    print_lines(report.overview(table) | {"wall time": took, "tables": str(directory)})
    for line in report.band_report(Result(directory, "sweep").table("bands")):
        print(line)
    print_notes(report.notes_on_branches(planned))
    print_notes(report.notes_on_points(table) + report.note_on_undecided(table))
    failed = report.failures(table)
    _complain_of(failed, f"{len(failed)} of {points} points failed")
    return (done.check is None or _print_check(done.check)) and not failed


def _print_check(found: SweepCheck) -> bool:
    """Print what the check of a sweep has found; return whether the engines agree."""
    print_lines(dict(found.lines()))
    for row in found.reclassified[:TOLD]:
        print(f"  {row}")
    _complain_of(found.disagreements, f"engines disagree at {len(found.disagreements)} of {len(found.checked)} points")
    return found.agrees


def _complain_of(lines: list[str], total: str) -> None:
    """Print the first of some lines and their total, if there are any."""
    for line in lines[:TOLD]:
        print(f"vibroplat: {line}", file=sys.stderr)
    if lines:
        print(f"vibroplat: {total}", file=sys.stderr)
