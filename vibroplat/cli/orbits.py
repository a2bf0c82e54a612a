"""The command ``orbits``: branches of periodic orbits, their stability and special points."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibroplat.cli.common import (
    EngineName,
    Format,
    Jobs,
    Out,
    Overwrite,
    Resume,
    Scheduler,
    Settings,
    Wait,
    complain_of,
    load_kernels,
    print_lines,
    print_notes,
    print_table,
    require_scheduler,
    tell_of_compilation,
)
from vibroplat.study import WAIT
from vibroplat.system.progress import orbits_progress

if TYPE_CHECKING:
    from vibroplat.config.scene import Scene
    from vibroplat.continuation.tables import OrbitTables
    from vibroplat.continuation.tracing import Traced
    from vibroplat.study.pool import Pool
    from vibroplat.study.store import Store

#: Name of the file that keeps finished parts of branches, so that a sweep may have its points beside it.
FILE = "orbits.sqlite"
#: Branches and special points that are printed at most.
TOLD = 40


def orbits(
    config: Annotated[Path, typer.Argument(help="Configuration file with an orbits section.")],
    set_: Settings = None,
    engine: EngineName = None,
    out: Out = Path("results"),
    jobs: Jobs = 1,
    resume: Resume = False,
    overwrite: Overwrite = False,
    scheduler: Scheduler = None,
    wait: Wait = WAIT,
    format_: Format = "parquet",
) -> None:
    """Follow branches of periodic orbits over a key.

    Writes a table of their points and one of special points to OUT/NAME. Exit code 1 says that a branch failed.
    """
    from vibroplat.config.reader import load_config, parse_overrides

    scene = load_config(config, parse_overrides(set_ or [], engine))
    tell_of_compilation(scene.solver.engine)
    from vibroplat.continuation import report
    from vibroplat.continuation.curves import boundaries
    from vibroplat.continuation.tables import planned, summary, tables

    found = planned(scene)
    require_scheduler(scheduler)
    from vibroplat.results.files import read_provenance
    from vibroplat.results.tables import result_directory
    from vibroplat.study.pool import pool
    from vibroplat.study.store import Store
    from vibroplat.study.sweep import conditions

    directory = result_directory(out, scene.name)
    if resume and (directory / "provenance.json").exists():
        read_provenance(directory, "orbits")
    kept: dict[str, Any] = {"file": FILE, "what": "parts of branches"}
    with Store(directory, conditions(scene), resume=resume, overwrite=overwrite, **kept) as store:
        load_kernels(scene.solver.engine)
        began = time.perf_counter()
        with pool(jobs, scheduler, wait=wait, chains=len(found)) as workers:
            traced = _trace(scene, len(found), store, workers)
            curves = boundaries(scene, traced, store, workers)
        seconds, known = time.perf_counter() - began, store.reused
        store.finish()
        told, made = summary(scene, traced, curves), tables(scene, traced, curves)
        report.write_orbits(scene, made, told, directory, format_)
    took = f"{told['points'] / seconds:.3g} points per s" if not known else f"{known} parts of branches from before"
    _print(scene, made, told, {"wall time": f"{seconds:.3g} s, {took}", "tables": str(directory)})
    print_notes(report.notes_on_families(found))
    if failed := report.failures(told):
        complain_of(failed, f"{len(failed)} of {len(told['branches'])} branches failed", most=TOLD)
        raise typer.Exit(1)


def _trace(scene: Scene, families: int, store: Store, workers: Pool) -> list[Traced]:
    """Follow the branches that are not stored yet; where there is no orbit to begin with, nothing is left to resume."""
    from vibroplat.continuation.orbit import OrbitError
    from vibroplat.continuation.tracing import trace

    try:
        with orbits_progress(scene.name, families) as progress:
            return trace(scene, store, workers, progress)
    except OrbitError:
        store.finish()
        raise


def _print(scene: Scene, made: OrbitTables, told: Mapping[str, Any], more: dict[str, str]) -> None:
    """Print an overview of branches and special points."""
    from vibroplat.continuation import report

    print_lines(report.overview(made.branches, told) | more)
    for curve in told["boundaries"]:
        which = "".join(f", {key} {value}" for key, value in curve["grid"].items())
        checks = "".join(f"; {number} {what}" for what, number in curve["checks"].items())
        print(f"boundary of {curve['kind']}{which}: {curve['points']} points; {' and '.join(curve['ended'])}{checks}")
    print()
    print_table(*report.branch_lines(scene, told), most=TOLD, more="orbits.json")
    if len(made.special):
        print()
        print_table(*report.special_lines(scene, made.special), most=TOLD, more="table special")
