"""The command ``bench``: run time and errors on this machine."""

from __future__ import annotations

import itertools
import platform
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vibroplat.cli.common import Out, Verbose, announce_first_run, load_kernels
from vibroplat.errors import VibroplatError

if TYPE_CHECKING:
    from vibroplat.config.scene import Scene

#: Approximate duration of each benchmark on two cores; "" is the default benchmark.
DURATIONS = {
    "": "twenty seconds",
    "precision": "half a minute",
    "engines": "ten minutes",
    "orbits": "eight minutes",
    "basins": "ten seconds",
}
_NAMES = ", ".join(f"{name} ({duration})" for name, duration in DURATIONS.items() if name)
Benchmark = StrEnum("Benchmark", "precision engines orbits basins")


def bench(
    names: Annotated[list[Benchmark] | None, typer.Argument(metavar="NAME", help=f"{_NAMES}.")] = None,
    out: Out = Path("results"),
    long: Annotated[bool, typer.Option("--long", help="Run all benchmarks.")] = False,
    repeats: Annotated[int, typer.Option(min=1, help="Number of runs; their median is reported.")] = 5,
    verbose: Verbose = False,
) -> None:
    """Measure run time and accuracy on this machine.

    Writes tables and plots to OUT/benchmarks. Without NAME, compares two engines at equal error in twenty seconds.
    """
    if names and long:
        raise VibroplatError(f"{names[0]} --long: --long runs all benchmarks; allowed: names or --long")
    announce_first_run()
    from vibroplat.bench import measure, studies
    from vibroplat.results.tables import result_directory

    load_kernels()
    directory = result_directory(out, "benchmarks")
    both, cases, fine = ["taylor", "native"], measure.cases(), [10.0**-n for n in range(4, 11)]
    plans: dict[str, tuple[dict[str, Scene], list[str], list[float]]] = {
        "summary": (cases, both, fine[::2]),
        "precision": (cases, ["native"], fine),
        "engines": (measure.kinds(1e-6, 2.0), [*both, "sundae"], fine),
    }
    for name in (Benchmark if long else names) or ("summary",):
        if name in plans:
            chosen, engines, tolerances = plans[name]
            table = measure.precision(itertools.starmap(measure.truth, chosen.items()), engines, tolerances, repeats)
            brief = measure.brief_precision(table, measure.show_precision(table, directory, name, verbose=verbose))
        else:
            cost = (studies.cost_of_orbits if name == "orbits" else studies.cost_of_basins)(min(repeats, 3))
            measure.show(cost, directory, f"{name}-cost", verbose=verbose)
            brief = measure.brief_costs(cost, name)
        print(*brief, sep="\n", flush=True)
    print(f"  on {measure.processor_name()}, Python {platform.python_version()}, {platform.system()}")
    print(f"{directory}: tables{' and figures' if verbose else '; -v prints all'}")
