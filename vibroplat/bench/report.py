"""What ``vibroplat bench`` writes and prints for each of its names."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pandas as pd

from vibroplat.bench import engines, sweeps
from vibroplat.bench.reference import load_references
from vibroplat.bench.timing import TOLERANCES, VARIANTS, precision, runtime
from vibroplat.plots.bench import plot_precision
from vibroplat.tables import write_table

#: Failed scenes of a situation that are told one by one.
TOLD = 5


def report_runtime(directory: Path, reference: Path, repeats: int) -> None:
    """Each kind of scene with the engine that runs by default."""
    _show(runtime(repeats=repeats), directory, "runtime")


def report_precision(directory: Path, reference: Path, repeats: int) -> None:
    """Run time against error over the reference cases, with the engine that runs by default."""
    table = precision(load_references(reference), repeats=repeats)
    _show(table, directory, "precision")
    print(plot_precision(table, directory))


def report_engines(directory: Path, reference: Path, repeats: int) -> None:
    """Both engines and both integrators: speed, restarts, work against error, endurance, start, targets."""
    cases = load_references(reference)
    starts = engines.start_times()
    _show(starts, directory, "engines-start")
    speed = runtime(seconds=10.0, repeats=repeats, variants=VARIANTS)
    _show(speed, directory, "engines-speed")
    restarts = engines.restart_costs()
    _show(restarts, directory, "engines-restarts")
    work = precision(cases, repeats=min(repeats, 3), variants=VARIANTS)
    _show(work, directory, "engines-precision")
    print(plot_precision(work, directory, "engines-precision"))
    regimes = precision(engines.regime_references(), (*TOLERANCES, 1e-12), min(repeats, 3), VARIANTS[:2])
    _show(regimes, directory, "engines-regimes")
    print(plot_precision(regimes, directory, "engines-regimes"))
    long_run = engines.endurance()
    _show(long_run, directory, "engines-endurance")
    _show(engines.targets(speed, restarts, long_run, starts), directory, "engines-targets")


def report_sweeps(directory: Path, reference: Path, repeats: int) -> None:
    """Settling and workers of sweeps."""
    _show(sweeps.settling(), directory, "sweeps-settling")
    _show(sweeps.workers(min(repeats, 3)), directory, "sweeps-workers")


def report_stability(directory: Path, reference: Path, repeats: int) -> None:
    """Situations that a hybrid solver stumbles over, each scene with its check; all scenes in a table."""
    from vibroplat.bench.stability.checks import overview  # noqa: PLC0415
    from vibroplat.bench.stability.situations import SITUATIONS  # noqa: PLC0415  (imports all that they need)

    tables = {}
    for name, situation in SITUATIONS.items():
        began = time.perf_counter()
        table = pd.DataFrame(situation.run(situation.all))
        seconds = time.perf_counter() - began
        write_table(table, directory, f"stability-{name}", "csv")
        tables[name] = table
        failed = table[table["failed"] != ""]
        print(f"{name:<16}{len(table)} scenes, {len(failed)} failed, {seconds:.3g} s", flush=True)
        for scene, what in zip(failed["scene"].head(TOLD), failed["failed"].head(TOLD), strict=True):
            print(f"  {scene}: {what}")
    _show(overview(tables), directory, "stability")


#: By the name on the command line.
REPORTS: dict[str, Callable[[Path, Path, int], None]] = {
    "runtime": report_runtime,
    "precision": report_precision,
    "engines": report_engines,
    "sweeps": report_sweeps,
    "stability": report_stability,
}


def _show(table: pd.DataFrame, directory: Path, name: str) -> None:
    """Write a table and print it."""
    write_table(table, directory, name, "csv")
    print(f"\n{name}")
    print(table.to_string(index=False, float_format="%.3g"), flush=True)
