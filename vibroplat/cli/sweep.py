"""The command ``sweep``: branches over supply frequencies and a grid."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vibroplat.cli.loading import about, load_kernels, require_scheduler, tell_of_compilation
from vibroplat.cli.options import Study, with_study
from vibroplat.cli.printing import print_lines, print_notes
from vibroplat.system.progress import sweep_progress

if TYPE_CHECKING:
    from vibroplat.check.sweeps import SweepCheck

#: Failed points of a sweep that are reported one by one.
SHOWN = 5


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
    from vibroplat.study.branches import branches, chosen, require_share

    if check is not None:
        require_share(check)
    scene = load_config(config, parse_overrides(study.set_ or [], study.engine))
    with about(config):
        planned = branches(scene)
    places = [] if check is None else chosen(planned, check)
    require_scheduler(study.scheduler)
    from vibroplat.results.files import read_provenance
    from vibroplat.results.tables import result_directory

    directory = result_directory(study.out, scene.name)
    if study.resume and (directory / "provenance.json").exists():
        read_provenance(directory, "sweep")
    tell_of_compilation(scene.solver.engine)
    from vibroplat.check.sweeps import check_points
    from vibroplat.integrate import other_engine
    from vibroplat.study import sweep as sweeps
    from vibroplat.study.bands import band_lines
    from vibroplat.study.store import Store

    found = None
    with Store(directory, sweeps.conditions(scene), resume=study.resume, overwrite=study.overwrite) as store:
        load_kernels(scene.solver.engine, *([other_engine(scene.solver.engine)] if places else []))
        began = time.perf_counter()
        bar = sweep_progress(scene.name, len(planned), sum(len(branch.frequencies) for branch in planned))
        measured = sweeps.measured(planned, store, study.jobs, study.scheduler, study.wait, bar, len(places))
        with measured as workers:
            known, seconds = store.reused, time.perf_counter() - began
            if places:
                with sweep_progress(f"{scene.name}, check", len(places), len(places)) as progress:
                    found = check_points(planned, places, store, workers, progress=progress)
        store.finish()
        checked = None if found is None else found.to_tree()
        table, bands = sweeps.write_sweep(scene, planned, store, directory, study.format_.value, check=checked)
    resumed = f", {known} of the points from before" if known else ""
    took = f"{seconds:.3g} s, {(len(table) - known) / seconds:.3g} points per s{resumed}"
    print_lines(sweeps.overview(table) | {"wall time": took, "tables": str(directory)})
    for line in band_lines(bands):
        print(line)
    print_notes(sweeps.notes_on_branches(planned) + sweeps.notes_on_points(table))
    failed = sweeps.failures(table)
    _complain_of(failed, f"{len(failed)} of {len(table)} points failed")
    agrees = found is None or _print_check(found)
    if failed or not agrees:
        raise typer.Exit(1)


def _print_check(found: SweepCheck) -> bool:
    """Print what the check of a sweep has found; return whether the engines agree."""
    print_lines(dict(found.lines()))
    for row in found.reclassified[:SHOWN]:
        print(f"  {row}")
    _complain_of(found.disagreements, f"engines disagree at {len(found.disagreements)} of {len(found.checked)} points")
    return found.agrees


def _complain_of(lines: list[str], total: str) -> None:
    """Print the first of some lines and their total, if there are any."""
    for line in lines[:SHOWN]:
        print(f"vibroplat: {line}", file=sys.stderr)
    if lines:
        print(f"vibroplat: {total}", file=sys.stderr)
