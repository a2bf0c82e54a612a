"""The command ``sweep``: branches over supply frequencies and a grid."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vibroplat.cli import common
from vibroplat.study import WAIT
from vibroplat.system.progress import sweep_progress

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from vibroplat.check.sweeps import SweepCheck
    from vibroplat.study.branches import Branch

#: Failed points of a sweep that are reported one by one.
SHOWN = 5


def sweep(
    config: Annotated[Path, typer.Argument(help="Configuration file with a sweep section.")],
    check: Annotated[
        float | None,
        typer.Option(metavar="SHARE", help="Repeat this share of the points with another engine, and compare both."),
    ] = None,
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
    """Sweep over supply frequencies and a grid of values.

    Writes a table with one row per point to OUT/NAME. With --check, exit code 1 says that two engines disagree.
    """
    from vibroplat.study.branches import branches, chosen, require_share

    if check is not None:
        require_share(check)
    scene = common.scene_of(config, set_, engine)
    with common.about(config):
        planned = branches(scene)
    places = [] if check is None else chosen(planned, check)
    common.require_scheduler(scheduler)
    directory = common.study_directory(out, scene.name, "sweep", resume=resume)
    common.tell_of_compilation(scene.solver.engine)
    from vibroplat.check.sweeps import check_points
    from vibroplat.integrate import other_engine
    from vibroplat.study import sweep as sweeps
    from vibroplat.study.store import Store

    found = None
    with Store(directory, sweeps.conditions(scene), resume=resume, overwrite=overwrite) as store:
        common.load_kernels(scene.solver.engine, *([other_engine(scene.solver.engine)] if places else []))
        began = time.perf_counter()
        bar = sweep_progress(scene.name, len(planned), sum(len(branch.frequencies) for branch in planned))
        with sweeps.measured(planned, store, jobs, scheduler, wait, bar, len(places)) as workers:
            known, seconds = store.reused, time.perf_counter() - began
            if places:
                with sweep_progress(f"{scene.name}, check", len(places), len(places)) as progress:
                    found = check_points(planned, places, store, workers, progress=progress)
        store.finish()
        checked = None if found is None else found.to_tree()
        table, bands = sweeps.write_sweep(scene, planned, store, directory, format_, checked)
    took = f"{seconds:.3g} s, {(len(table) - known) / seconds:.3g} points per s"
    took += f", {known} of the points from before" if known else ""
    good = _print_sweep(planned, table, bands, {"wall time": took, "tables": str(directory)})
    agrees = found is None or _print_check(found)
    if not (good and agrees):
        raise typer.Exit(1)


def _print_sweep(planned: Sequence[Branch], table: pd.DataFrame, bands: pd.DataFrame, more: dict[str, str]) -> bool:
    """Print an overview of a finished sweep; return whether all points are good."""
    from vibroplat.study import sweep as sweeps
    from vibroplat.study.bands import band_lines

    common.print_lines(sweeps.overview(table) | more)
    for line in band_lines(bands):
        print(line)
    common.print_notes(sweeps.notes_on_branches(planned) + sweeps.notes_on_points(table))
    failed = sweeps.failures(table)
    common.complain_of(failed, f"{len(failed)} of {len(table)} points failed")
    return not failed


def _print_check(found: SweepCheck) -> bool:
    """Print what the check of a sweep has found; return whether the engines agree."""
    common.print_lines(dict(found.lines()))
    for row in found.reclassified[:SHOWN]:
        print(f"  {row}")
    worst = found.disagreements
    common.complain_of(worst, f"engines disagree at {len(worst)} of {len(found.checked)} points")
    return found.agrees
