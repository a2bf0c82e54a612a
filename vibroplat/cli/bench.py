"""The command ``bench``: run time, accuracy, stability."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from vibroplat.cli.loading import load_kernels, tell_of_compilation
from vibroplat.cli.options import Out
from vibroplat.errors import VibroplatError


class BenchName(StrEnum):
    """Names of the benchmarks."""

    runtime = "runtime"
    precision = "precision"
    engines = "engines"
    sweeps = "sweeps"
    peers = "peers"
    taylor = "taylor"
    orbits = "orbits"


#: About how long each takes on two cores; "" is the one without a name.
DURATIONS = {
    "": "about five minutes",
    BenchName.runtime: "half a minute",
    BenchName.precision: "a quarter of a minute",
    BenchName.engines: "ten minutes",
    BenchName.sweeps: "ten minutes",
    BenchName.peers: "five minutes",
    BenchName.taylor: "seven minutes",
    BenchName.orbits: "eight minutes",
}
_NAMES = ", ".join(f"{name} ({duration})" for name, duration in DURATIONS.items() if name)


def bench(
    names: Annotated[
        list[BenchName] | None,
        typer.Argument(metavar="[NAME]...", help=f"{_NAMES}."),
    ] = None,
    out: Out = Path("results"),
    long: Annotated[
        bool,
        typer.Option(
            "--long",
            help="Run all benchmarks.",
        ),
    ] = False,
    reference: Annotated[Path, typer.Option(help="Directory of the reference tables.")] = Path("tests/reference"),
    repeats: Annotated[int, typer.Option(min=1, help="Number of runs; their median is reported.")] = 5,
) -> None:
    """Measure run time and accuracy.

    Writes tables and plots to OUT/benchmarks. Without a name it compares peers at equal error, in about five minutes.
    """
    tell_of_compilation()
    from vibroplat.bench import report
    from vibroplat.bench.timing import machine
    from vibroplat.results.tables import result_directory

    if names and long:
        raise VibroplatError(f"{names[0].value} --long: --long runs every bench; allowed: names or --long")
    if long or not names or {BenchName.peers, BenchName.taylor, BenchName.orbits} & {*names}:
        report.require_oracle()
    load_kernels()
    directory = result_directory(out, "benchmarks")
    print(machine())
    if not (names or long):
        report.report_summary(directory, reference, repeats)
    for name in BenchName if long else names or []:
        report.REPORTS[name.value](directory, reference, repeats)
