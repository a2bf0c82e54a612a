"""Writes and prints the results of each benchmark."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from vibroplat.bench import engines, sweeps
from vibroplat.bench.reference import load_references
from vibroplat.bench.timing import ENGINES, precision, runtime
from vibroplat.errors import VibroplatError
from vibroplat.plots.bench import OWN, SCALED, plot_precision, plot_scaling
from vibroplat.results.tables import write_table

if TYPE_CHECKING:
    from vibroplat.bench.peers.peers import Peer

#: Repeats at least, of which medians are taken where engines are compared closely.
MEDIAN_OF = 7

#: Number of scenes in the summary; later ones amplify errors most.
QUICK = 4


def report_runtime(directory: Path, reference: Path, repeats: int) -> None:
    """Time each kind of scene with the default engine."""
    _show(runtime(repeats=repeats), directory, "runtime")


def report_precision(directory: Path, reference: Path, repeats: int) -> None:
    """Measure run time against error on the reference cases, with the default engine."""
    table = precision(load_references(reference), repeats=repeats)
    _show(table, directory, "precision")
    print(plot_precision(table, directory, "precision", OWN, ["engine"]))


def report_engines(directory: Path, reference: Path, repeats: int) -> None:
    """Compare both engines: speed, restarts, work against error, endurance, start-up, targets."""
    cases = load_references(reference)
    starts = engines.start_times()
    _show(starts, directory, "engines-start")
    speed = runtime(seconds=10.0, repeats=repeats, engines=ENGINES)
    _show(speed, directory, "engines-speed")
    restarts = engines.restart_costs()
    _show(restarts, directory, "engines-restarts")
    work = precision(cases, repeats=min(repeats, 3), engines=ENGINES)
    _show(work, directory, "engines-precision")
    print(plot_precision(work, directory, "engines-precision", OWN, ["engine"]))
    regimes = precision(engines.regime_references(), repeats=min(repeats, 3))
    _show(regimes, directory, "engines-regimes")
    print(plot_precision(regimes, directory, "engines-regimes", OWN, ["engine"]))
    long_run = engines.endurance()
    _show(long_run, directory, "engines-endurance")
    _show(engines.targets(speed, restarts, long_run, starts), directory, "engines-targets")


def report_sweeps(directory: Path, reference: Path, repeats: int) -> None:
    """Measure settling and parallel workers of sweeps."""
    _show(sweeps.settling(), directory, "sweeps-settling")
    _show(sweeps.workers(min(repeats, 3)), directory, "sweeps-workers")


def report_summary(directory: Path, reference: Path, repeats: int) -> None:
    """Compare run times of the installed peers at equal error, on scenes with and without events."""
    _compare(directory, reference, repeats, "summary", quick=True)


def report_peers(directory: Path, reference: Path, repeats: int) -> None:
    """Compare peers: work–precision, statistics of a non-periodic motion, and scaling."""
    from vibroplat.bench.peers import cases, precision, scaling  # noqa: PLC0415  (imports peers)

    peers = _compare(directory, reference, repeats, "peers", quick=False)
    last = cases.cases(reference)[-1]
    _show(precision.statistics_of(last, peers, scaling.TOLERANCE), directory, "peers-statistics")
    first = [peer for peer in peers if peer.name in ("vibroplat", "heyoka")]
    mains = [peer for peer in peers if not peer.name.startswith("Siconos")]
    tables = {
        "time": scaling.simulated_time(first, repeats),
        "events": scaling.events_per_second(repeats),
        "scenes": scaling.scenes(min(repeats, 3)),
        "memory": scaling.memory(mains),
    }
    for name, table in tables.items():
        _show(table, directory, f"scaling-{name}")
    print(plot_scaling(tables, directory))
    _show(scaling.paper(), directory, "scaling-paper")


def report_taylor(directory: Path, reference: Path, repeats: int) -> None:
    """Compare engine ``taylor`` with ``native``, heyoka and DOP853 at equal errors, and both engines on Fig. 3."""
    from vibroplat.bench.peers import precision, scaling  # noqa: PLC0415

    beside = {precision.TAYLOR, *(peer for peer, *_ in precision.BESIDE_TAYLOR)}
    _compare(directory, reference, max(repeats, MEDIAN_OF), "taylor", quick=False, only=beside)
    _show(scaling.paper([scaling.FIG_3]), directory, "taylor-fig3")


def report_orbits(directory: Path, reference: Path, repeats: int) -> None:
    """Measure branches of orbits beside sweeps and heyoka."""
    from vibroplat.bench import orbits  # noqa: PLC0415  (imports studies)

    _show(orbits.cost(min(repeats, 3)), directory, "orbits-cost")


def require_oracle() -> None:
    """Check early that the oracle, against which errors are measured, is installed.

    Raises
    ------
    VibroplatError
        The oracle is missing; the message says what to install.
    """
    if importlib.util.find_spec("heyoka") is None:
        raise VibroplatError("heyoka is the oracle of this bench; pip install 'vibroplat[bench]' has it")


def _compare(
    directory: Path, reference: Path, repeats: int, name: str, *, quick: bool, only: Collection[str] = ()
) -> list[Peer]:
    """Measure work–precision of all installed peers, or of those named only; write the tables, return the peers."""
    from vibroplat.bench.peers import cases, precision  # noqa: PLC0415
    from vibroplat.bench.peers.peers import PEERS  # noqa: PLC0415

    here = []
    for peer in PEERS:
        if (quick and not peer.quick) or (only and peer.name not in only):
            continue
        if reason := peer.missing:
            print(f"left out: {peer.name}: {reason}", file=sys.stderr)
        else:
            here.append(peer)
    compared = [case for case in cases.cases(reference) if not case.statistics]
    tables = []
    for case in compared[:QUICK] if quick else compared:
        tables.append(precision.precision(case, here, min(repeats, 3) if quick else repeats, quick=quick))
    table = pd.concat(tables, ignore_index=True)
    if quick:
        write_table(table, directory, name, "csv")
    else:
        _show(precision.references(reference, compared), directory, f"{name}-oracle")
        _show(table, directory, f"{name}-precision")
        print(plot_precision(table, directory, f"{name}-precision", SCALED, ["peer"]))
    _show(precision.at_equal_error(table, compared), directory, f"{name}-equal")
    measured = [case for case in compared if case.name in set(table["case"])]
    _show(precision.beside_taylor(table, measured), directory, f"{name}-ratios")
    return here


#: Reports by their names on the command line.
REPORTS: dict[str, Callable[[Path, Path, int], None]] = {
    "runtime": report_runtime,
    "precision": report_precision,
    "engines": report_engines,
    "sweeps": report_sweeps,
    "peers": report_peers,
    "taylor": report_taylor,
    "orbits": report_orbits,
}


def _show(table: pd.DataFrame, directory: Path, name: str) -> None:
    """Write a table and print it."""
    write_table(table, directory, name, "csv")
    print(f"\n{name}")
    print(table.to_string(index=False, float_format="%.3g"), flush=True)
