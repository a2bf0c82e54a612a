"""The commands ``paper`` and ``calibrate``: the paper's figures and claims."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibroplat.cli.loading import load_kernels, require_scheduler, tell_of_compilation
from vibroplat.cli.options import EngineName, Jobs, Out, Overwrite, Resume, Scheduler, Settings, Wait
from vibroplat.cli.printing import print_lines
from vibroplat.study import WAIT
from vibroplat.system.progress import calibration_progress, sweep_progress

if TYPE_CHECKING:
    from vibroplat.study.execution import Pool


def paper(
    machine: Annotated[
        list[str] | None, typer.Option(help="A machine from configs/machines. Default: printed and calibrated.")
    ] = None,
    set_: Settings = None,
    engine: EngineName = None,
    out: Out = Path("results"),
    jobs: Annotated[int | None, typer.Option(min=1, help="Number of worker processes. Default: all cores.")] = None,
    resume: Resume = False,
    overwrite: Overwrite = False,
    scheduler: Scheduler = None,
    wait: Wait = WAIT,
    seeds: Annotated[int, typer.Option(min=1, help="Number of perturbation seeds that each claim is judged with.")] = 3,
    seed: Annotated[int, typer.Option(min=0, help="The first seed; figures are drawn with it.")] = 0,
) -> None:
    """Reproduce the paper.

    Computes figures 2-7 and their tables, and compares each claim of the paper with what was measured.
    """
    tell_of_compilation(engine)
    from vibroplat.config.reader import parse_overrides
    from vibroplat.paper.trial import machine_numbers, paper_scene

    changes = parse_overrides(set_ or [], engine)
    chosen = {name: {**machine_numbers(name), **changes} for name in machine or ("printed", "calibrated")}
    require_scheduler(scheduler)
    from vibroplat.paper.reproduction import SWEEPS, planned
    from vibroplat.study.execution import pool

    tried = range(seed, seed + seeds)
    chains = max(planned(numbers, tried)[0] for numbers in chosen.values())
    load_kernels(*sorted({paper_scene(SWEEPS[0], numbers).solver.engine for numbers in chosen.values()}))
    with pool(jobs, scheduler, wait=wait, chains=chains) as workers:
        for name, numbers in chosen.items():
            _reproduce(name, numbers, out, workers, tried, resume=resume, overwrite=overwrite)


def _reproduce(
    name: str, numbers: dict[str, Any], out: Path, workers: Pool, seeds: range, *, resume: bool, overwrite: bool
) -> None:
    """Reproduce the paper with one machine; write its tables and figures and print an overview."""
    from vibroplat.paper import report, reproduction
    from vibroplat.plots.command import plot_results
    from vibroplat.results.tables import result_directory

    directory = result_directory(out / "paper", name)
    began = time.perf_counter()
    branches, points = reproduction.planned(numbers, seeds)
    with sweep_progress(name, branches, points) as progress:
        found = reproduction.reproduce(
            numbers, directory / "points", workers, seeds=seeds, resume=resume, overwrite=overwrite, progress=progress
        )
    report.write_reproduction(found, numbers, directory)
    figures = plot_results([directory])
    for line in report.overview(name, found, time.perf_counter() - began):
        print(line)
    print(f"{'tables and figures':<24}{directory}, {len(figures)} figures")


def calibrate(
    config: Annotated[
        Path | None, typer.Argument(help="Configuration of a machine with a calibration section.")
    ] = None,
    out: Out = Path("results"),
    jobs: Jobs = 1,
    generations: Annotated[int | None, typer.Option(min=0, help="Number of generations of the search.")] = None,
    resume: Resume = False,
    overwrite: Overwrite = False,
    scheduler: Scheduler = None,
    wait: Wait = WAIT,
    engine: EngineName = None,
) -> None:
    """Fit the numbers the paper does not print to its claims.

    Writes a table with one row per evaluation to OUT/calibration.
    """
    tell_of_compilation(engine)
    from vibroplat.config.reader import ENGINE, configurations, parse_overrides
    from vibroplat.paper.calibration.plan import load_plan

    overrides = {} if generations is None else {"generations": generations}
    path = config or configurations() / "claims" / "calibration.yaml"
    fixed, plan = load_plan(path, overrides, parse_overrides([], engine))
    require_scheduler(scheduler)
    from vibroplat.paper.calibration import reading, search
    from vibroplat.paper.report import write_calibration
    from vibroplat.results.tables import result_directory
    from vibroplat.study.execution import pool
    from vibroplat.study.store import Store

    directory = result_directory(out, "calibration")
    total = plan.evaluations + plan.confirmations
    with Store(directory, search.conditions(fixed), resume=resume, overwrite=overwrite) as store:
        load_kernels(fixed.get(ENGINE, "auto"))
        opened = pool(jobs, scheduler, wait=wait, chains=plan.side_by_side)
        with opened as workers, calibration_progress(total) as progress:
            found = search.calibrate(fixed, plan, store, workers, progress)
        store.finish()
        tables = {"evaluations": found.evaluations, "confirmation": found.confirmation}
        tables["left-out"] = reading.left_out(found.evaluations, plan)
        tables["spread"] = reading.spread(found.evaluations, plan)
        write_calibration(tables, directory)  # before the store lets another calibration in
    lines = reading.overview(found.evaluations, tables["left-out"], tables["spread"])
    print_lines(lines | {"tables": str(directory)}, width=40)
