"""The command ``paper``: the paper's figures and claims."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vibroplat.cli import common
from vibroplat.cli.studies import run_and_print
from vibroplat.study import WAIT


def paper(
    machine: Annotated[
        list[str] | None, typer.Option(help="A machine from configs/machines. Default: printed and calibrated.")
    ] = None,
    check: common.Check = False,
    set_: common.Settings = None,
    engine: common.EngineName = None,
    out: common.Out = Path("results"),
    jobs: Annotated[int | None, typer.Option(min=1, help="Number of worker processes. Default: all cores.")] = None,
    resume: common.Resume = False,
    overwrite: common.Overwrite = False,
    scheduler: common.Scheduler = None,
    wait: common.Wait = WAIT,
    format_: common.Format = "csv",
    seeds: Annotated[int, typer.Option(min=1, help="Number of perturbation seeds for each claim.")] = 3,
    seed: Annotated[int, typer.Option(min=0, help="First seed; figures are drawn with it.")] = 0,
    verbose: common.Verbose = False,
) -> None:
    """Reproduce the figures and claims of the paper.

    Computes figures 2-7 and their tables, and compares each claim of the paper with the simulation. Exit code 1 means
    that with --check two engines disagree.
    """
    common.announce_first_run(engine)
    from vibroplat.config.reader import parse_overrides
    from vibroplat.paper.scenes import machine_numbers

    changes = parse_overrides(set_ or [], engine)
    chosen = {name: {**machine_numbers(name), **changes} for name in machine or ("printed", "calibrated")}
    common.require_scheduler(scheduler)
    from vibroplat.paper.reproduction import PaperStudy
    from vibroplat.plots.command import plot_results
    from vibroplat.results.tables import result_directory

    good = True
    for name, numbers in chosen.items():
        study = PaperStudy(numbers, range(seed, seed + seeds), name)
        directory = result_directory(out / "paper", name)
        kept = common.store_options(resume, overwrite)
        good &= run_and_print(study, directory, jobs, scheduler, wait, format_, kept, check=check, verbose=verbose)
        plot_results([directory])
    if not good:
        raise typer.Exit(1)
