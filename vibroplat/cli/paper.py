"""The command ``paper``: the paper's figures and claims."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from vibroplat.cli import common
from vibroplat.study import WAIT
from vibroplat.system.terminal import sweep_progress


def paper(
    machine: Annotated[
        list[str] | None, typer.Option(help="A machine from configs/machines. Default: printed and calibrated.")
    ] = None,
    set_: common.Settings = None,
    engine: common.EngineName = None,
    out: common.Out = Path("results"),
    jobs: Annotated[int | None, typer.Option(min=1, help="Number of worker processes. Default: all cores.")] = None,
    resume: common.Resume = False,
    overwrite: common.Overwrite = False,
    scheduler: common.Scheduler = None,
    wait: common.Wait = WAIT,
    seeds: Annotated[int, typer.Option(min=1, help="Number of perturbation seeds that each claim is judged with.")] = 3,
    seed: Annotated[int, typer.Option(min=0, help="The first seed; figures are drawn with it.")] = 0,
) -> None:
    """Reproduce the paper.

    Computes figures 2-7 and their tables, and compares each claim of the paper with what was measured.
    """
    common.tell_of_compilation(engine)
    from vibroplat.config.reader import parse_overrides
    from vibroplat.paper.scenes import machine_numbers, paper_scene

    changes = parse_overrides(set_ or [], engine)
    chosen = {name: {**machine_numbers(name), **changes} for name in machine or ("printed", "calibrated")}
    common.require_scheduler(scheduler)
    from vibroplat.paper import reproduction
    from vibroplat.plots.command import plot_results
    from vibroplat.results.tables import result_directory
    from vibroplat.study.pool import pool

    tried = range(seed, seed + seeds)
    planned = {name: reproduction.planned(numbers, tried) for name, numbers in chosen.items()}
    common.load_kernels(*sorted({paper_scene("fig2", numbers).solver.engine for numbers in chosen.values()}))
    with pool(jobs, scheduler, wait=wait, chains=max(branches for branches, _ in planned.values())) as workers:
        for name, numbers in chosen.items():
            directory = result_directory(out / "paper", name)
            began = time.perf_counter()
            with sweep_progress(name, *planned[name]) as progress:
                kept = common.kept(resume, overwrite)
                points = directory / "points"
                found = reproduction.reproduce(numbers, points, workers, seeds=tried, progress=progress, **kept)
            found.write(numbers, directory)
            figures = plot_results([directory])
            for line in found.overview(name, time.perf_counter() - began):
                print(line)
            print(f"{'tables and figures':<24}{directory}, {len(figures)} figures")
