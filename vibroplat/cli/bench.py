"""The command ``bench``: run time and errors on this machine."""

from __future__ import annotations

import importlib.util
import os
import platform
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from vibroplat.cli.common import Out, load_kernels, tell_of_compilation
from vibroplat.errors import VibroplatError

#: The benchmarks, and about how long each takes on two cores; "" is the one without a name.
DURATIONS = {
    "": "about a minute",
    "precision": "half a minute",
    "engines": "two minutes",
    "peers": "five minutes",
    "orbits": "eight minutes",
    "basins": "a minute",
}
_NAMES = ", ".join(f"{name} ({duration})" for name, duration in DURATIONS.items() if name)
_FORMER = {
    "stability": "a test now, in tests/stability",
    "soak": "a test now, in tests/bench",
    "runtime": "part of engines now",
    "taylor": "part of peers now",
    "sweeps": "no longer measured",
}


def _completed() -> list[str]:
    """Names that a shell completes."""
    return [name for name in DURATIONS if name]


def bench(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="NAME", help=f"{_NAMES}.", autocompletion=_completed)
    ] = None,
    out: Out = Path("results"),
    long: Annotated[bool, typer.Option("--long", help="Run all benchmarks.")] = False,
    repeats: Annotated[int, typer.Option(min=1, help="Number of runs; their median is reported.")] = 5,
) -> None:
    """Measure run time and accuracy.

    Writes tables and plots to OUT/benchmarks. Without a name it compares solvers at equal error, in about a minute.
    """
    known = _completed()
    for name in names or []:
        if name not in known:
            raise VibroplatError(f"bench {name}: {_FORMER.get(name, 'unknown')}; allowed: {', '.join(known)}")
        if long:
            raise VibroplatError(f"{name} --long: --long runs every bench; allowed: names or --long")
    tell_of_compilation()
    from vibroplat.bench import basins, measure, orbits, scenes
    from vibroplat.plots.bench import plot_precision
    from vibroplat.results.tables import result_directory, write_table

    load_kernels()
    directory = result_directory(out, "benchmarks")
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, {platform.system()}")

    def show(table: Any, name: str) -> None:
        write_table(table, directory, name, "csv")
        print(f"\n{name}\n{table.to_string(index=False, float_format='%.3g')}", flush=True)

    others = ["scipy DOP853", "scipy LSODA", "heyoka"]
    if importlib.util.find_spec("heyoka") is None:
        print(f"left out: {others.pop()}; pip install 'vibroplat[bench]' has it", file=sys.stderr)
    both, cases, fine = ["taylor", "native"], scenes.cases(), [10.0**-n for n in range(4, 11)]
    plans: dict[str, tuple[Any, list[str], list[float]]] = {
        "summary": (cases, [*both, *others], fine[::2]),
        "precision": (cases, ["auto"], fine),
        "engines": (scenes.kinds(1e-6, 2.0), [*both, "sundae"], fine),
        "peers": (cases, [*both, *others], [1e-3, *fine, 1e-11, 1e-12]),
    }
    for name in known if long else names or ["summary"]:
        if name in ("orbits", "basins"):
            show((orbits if name == "orbits" else basins).cost(min(repeats, 3)), f"{name}-cost")
            continue
        chosen, engines, tolerances = plans[name]
        table = measure.precision((measure.truth(*case) for case in chosen.items()), engines, tolerances, repeats)
        show(table, name)
        print(plot_precision(table, directory, name))
        if len(engines) > 1:
            show(measure.at_equal_error(table), f"{name}-equal")
