"""The command ``orbits``: branches of periodic orbits, their stability and special points."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibroplat.cli import common
from vibroplat.study import WAIT
from vibroplat.system.progress import orbits_progress

if TYPE_CHECKING:
    import pandas as pd

    from vibroplat.continuation.tables import Planned

#: Name of the file that keeps finished parts of branches, so that a sweep may have its points beside it.
FILE = "orbits.sqlite"
#: Branches and special points that are printed at most.
MOST = 40


def orbits(
    config: Annotated[Path, typer.Argument(help="Configuration file with an orbits section.")],
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

    Writes a table of their points and one of special points to OUT/NAME. Exit code 1 says that a branch failed.
    """
    scene = common.scene_of(config, set_, engine)
    common.tell_of_compilation(scene.solver.engine)
    from vibroplat.continuation.tables import follow, planned, write_orbits

    plan = planned(scene)
    common.require_scheduler(scheduler)
    from vibroplat.config.plausibility import notes_on_inputs
    from vibroplat.study.pool import pool
    from vibroplat.study.store import Store
    from vibroplat.study.sweep import conditions

    directory = common.study_directory(out, scene.name, "orbits", resume=resume)
    kept: dict[str, Any] = {"file": FILE, "what": "parts of branches"}
    with Store(directory, conditions(scene), resume=resume, overwrite=overwrite, **kept) as store:
        common.load_kernels(scene.solver.engine)
        began, families = time.perf_counter(), len(plan.families)
        with (
            pool(jobs, scheduler, wait=wait, chains=families) as workers,
            orbits_progress(scene.name, families) as progress,
        ):
            made, summary = follow(plan, store, workers, progress)
        seconds, known = time.perf_counter() - began, store.reused
        store.finish()
        write_orbits(scene, made, summary, directory, format_)
    took = f"{known} parts of branches from before" if known else f"{summary['points'] / seconds:.3g} points per s"
    common.print_lines(_overview(made.branches, summary))
    common.print_lines({"wall time": f"{seconds:.3g} s, {took}", "tables": str(directory)})
    _print_boundaries(summary["boundaries"])
    _print_branches(plan, summary["branches"])
    _print_special(plan, made.special)
    common.print_notes(notes_on_inputs(family.scene for family in plan.families))
    failed = [
        f"branch {branch['branch']}{''.join(f', {key} {value}' for key, value in branch['grid'].items())} failed "
        f"after {branch['points']} points: {branch['ended']}"
        for branch in summary["branches"]
        if branch["failed"]
    ]
    if failed:
        common.complain_of(failed, f"{len(failed)} of {len(summary['branches'])} branches failed", most=MOST)
        raise typer.Exit(1)


def _overview(table: pd.DataFrame, summary: Mapping[str, Any]) -> dict[str, str]:
    """Summarize branches in a few lines: label and text."""
    points = len(table)
    frequency, height = table["excitation_frequency_hz"], 1e3 * table["rms_y_m"]
    failed = f", {summary['failed']} failed" if summary["failed"] else ""
    return {
        "branches": f"{len(summary['branches'])}{failed}",
        "points": f"{points}, {int(table['stable'].sum())} of them stable",
        "turns": f"{summary['turns']:.0f}, {summary['turns'] / max(points, 1):.1f} per point",
        "excitation frequency": f"{frequency.min():.2f} … {frequency.max():.2f} Hz",
        "RMS y": f"{height.min():.3g} … {height.max():.3g} mm",
        "residual": f"at most {table['residual'].max():.2g}",
    }


def _print_boundaries(curves: Sequence[Mapping[str, Any]]) -> None:
    """Print a line for each boundary, and an empty one."""
    for curve in curves:
        which = "".join(f", {key} {value}" for key, value in curve["grid"].items())
        checks = "".join(f"; {number} {what}" for what, number in curve["checks"].items())
        print(f"boundary of {curve['kind']}{which}: {curve['points']} points; {' and '.join(curve['ended'])}{checks}")
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
    common.print_table(header, rows, most=MOST, more="orbits.json")


def _print_special(plan: Planned, special: pd.DataFrame) -> None:
    """Print a row for each special point."""
    if special.empty:
        return
    from vibroplat.continuation.tables import column_of

    keys, names = [column_of(key) for key in _varied(plan)], ["branch", "kind", "period"]
    shown = special[[*keys, *names[:2]]].astype(str)
    for name in (plan.column, "excitation_frequency_hz"):
        shown[name] = [f"{value:.8g}" for value in special[name]]
    shown["period"] = special["period"].astype(str)
    header = [name.rpartition(".")[2] for name in keys]
    header += ["branch", "special point", plan.column, "excitation_frequency_hz", "period"]
    print()
    common.print_table(header, shown.to_numpy().tolist(), most=MOST, more="table special")
