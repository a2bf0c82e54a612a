"""Compares the engines: speed, cost of a restart, work against error, endurance, start-up."""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.bench.reference import Reference
from vibroplat.bench.scenes import base, kinds, regimes
from vibroplat.bench.timing import TOLERANCES, with_engine
from vibroplat.config.coordinates import Mode
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import absolute_tolerances
from vibroplat.integrate import make_engine
from vibroplat.model.parameters import parameters
from vibroplat.model.systems import GAP, systems
from vibroplat.motion.motion import Motion
from vibroplat.motion.run import simulate

#: Engines of the long run.
ENGINES = ("native", "taylor")
#: Turns between artificial restarts; not simple fractions, so that restarts hit all phases of a turn.
_TURNS = (1.0, 1.51, 2.37)


def restart_costs(tolerances: Sequence[float] = TOLERANCES, seconds: float = 4.0) -> pd.DataFrame:
    """Measure how many steps and residual calls a restart adds, by tolerance.

    Runs of engine ``native`` are interrupted at regular intervals and restarted from a
    consistent state, as after an event.
    """
    rows = []
    for name in ("attached, f_e 46", "bare, f_e 50"):
        for tolerance in tolerances:
            scene = with_engine(kinds(tolerance, seconds)[name], "native")
            steps, calls, restarts = _work(scene, 1e9)
            for turns in _TURNS:
                more_steps, more_calls, more_restarts = _work(scene, turns)
                added = more_restarts - restarts
                rows.append(
                    {
                        "scene": name,
                        "tolerance": tolerance,
                        "turns_between": turns,
                        "restarts": added,
                        "steps_per_restart": (more_steps - steps) / added,
                        "residual_calls_per_restart": (more_calls - calls) / added,
                    }
                )
    return pd.DataFrame(rows)


def _work(scene: Scene, turns: float) -> tuple[int, int, int]:
    """Return steps, residual calls and restarts of a run with a largest segment length (turns)."""
    p = parameters(scene)
    with closing(make_engine(scene, p)) as engine:
        engine.turns_per_segment = turns
        motion = Motion(scene, p, engine)
        motion.advance(scene.run.duration_s)
        work = engine.work
    return int(work["steps"] or 0), int(work["residual_calls"] or 0), motion.restarts


def regime_references(seconds: float = 1.0) -> list[Reference]:
    """Make references for the paper's regimes: runs at tolerance 1e-12."""
    times = np.linspace(0.0, seconds, 401)
    found = []
    for name, scene in regimes(seconds).items():
        run = simulate(with_engine(scene.replace({"solver.tolerance": 1e-12}), "native"))
        found.append(Reference(name, scene, run(times), run.events))
    return found


def endurance(restarts: float = 1e6, tolerance: float = 1e-6) -> pd.DataFrame:
    """Run a scene with impacts for very many restarts with each engine, as :func:`long_run` does."""
    return pd.DataFrame([long_run(engine, restarts, tolerance) for engine in ENGINES])


def long_run(engine: str, restarts: float, tolerance: float) -> dict[str, Any]:
    """Run a scene with impacts for very many restarts without a trajectory: time, memory, gap, energy."""
    scene = with_engine(base(tolerance, 1.0).replace({"drive.supply_frequency_hz": 50.0}), engine)
    flight = systems(scene)[Mode.FLIGHT]
    rate = simulate(scene.replace({"run.duration_s": 100.0}), keep="summary").summary["restarts"] / 100.0
    before = resident()
    began = time.perf_counter()
    summary = simulate(scene.replace({"run.duration_s": 1.002 * restarts / rate}), keep="summary").summary
    seconds = time.perf_counter() - began
    names = ("outcome", "simulated_s", "restarts", "liftoffs", "impacts", "impacts_per_period", "energy_residual")
    return {
        "engine": engine,
        **{name: summary[name] for name in names},
        "tolerance": tolerance,
        "seconds": seconds,
        "ms_per_s": 1e3 * seconds / summary["simulated_s"],
        "memory_growth_kib": resident() - before,
        "gap_min_m": summary["gap_min_m"],
        "gap_tolerance_m": absolute_tolerances(scene, flight)[GAP],
    }


def resident() -> float:
    """Memory in use (KiB), or its maximum so far if the system does not report it."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1])
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return pages * resource.getpagesize() / 1024.0


def start_times(repeats: int = 3) -> pd.DataFrame:
    """Time ``vibroplat run`` of a scene of 1 s as a whole process, by engine: the very first run, and later ones."""
    return pd.concat([_start_times(engine, repeats) for engine in ("native", "taylor")], ignore_index=True)


def _start_times(engine: str, repeats: int) -> pd.DataFrame:
    command = [sys.executable, "-c", "from vibroplat.cli import main; main()", "run"]
    with tempfile.TemporaryDirectory() as room:
        scene = Path(room) / "start.yaml"
        scene.write_text(
            "material: {mass_ratio: 0.1, natural_frequency_hz: 18.5, damping_ratio: 0.05}\nrun: {duration_s: 1.0}\n",
            encoding="utf-8",
        )
        environment = os.environ | {"NUMBA_CACHE_DIR": str(Path(room) / "kernels")}
        times = []
        for _ in range(1 + repeats):
            began = time.perf_counter()
            done = subprocess.run(
                [*command, str(scene), "--engine", engine, "--out", room],
                env=environment,
                capture_output=True,
                text=True,
                check=True,
            )
            times.append((time.perf_counter() - began, done.stderr.strip()))
    warm = [seconds for seconds, _ in times[1:]]
    return pd.DataFrame(
        [
            {"engine": engine, "start": "cold", "seconds": times[0][0], "message": times[0][1]},
            {"engine": engine, "start": "warm", "seconds": statistics.median(warm), "message": times[1][1]},
        ]
    )


def targets(speed: pd.DataFrame, restarts: pd.DataFrame, long_runs: pd.DataFrame, starts: pd.DataFrame) -> pd.DataFrame:
    """Compare the measurements with the design targets of the engines."""

    def of(scene: str, engine: str, column: str) -> float:
        rows = speed[(speed["scene"] == scene) & (speed["engine"] == engine)]
        return float(rows[column].iloc[0])

    impacts, attached = "impacts, f_e 50", "attached, f_e 46"
    at_1e6 = restarts[restarts["tolerance"] == 1e-6].groupby("scene")["steps_per_restart"].mean()
    start = starts.set_index(["engine", "start"])["seconds"]
    rows = [
        ("sundae over native, 50 impacts a second", of(impacts, "sundae", "ratio"), ">=", 8.0),
        ("sundae over native, attached", of(attached, "sundae", "ratio"), ">=", 6.0),
        ("ms per s, attached", of(attached, "native", "ms_per_s_median"), "<=", 1.2),
        ("ms per s, 50 impacts a second", of(impacts, "native", "ms_per_s_median"), "<=", 4.0),
        ("steps per restart at 1e-6, attached", float(at_1e6["attached, f_e 46"]), "<=", 25.0),
        ("steps per restart at 1e-6, bare", float(at_1e6["bare, f_e 50"]), "<=", 25.0),
        ("cold start (s)", float(start["native", "cold"]), "<=", 30.0),
        ("warm start (s)", float(start["native", "warm"]), "<=", 1.5),
        ("cold start of taylor (s)", float(start["taylor", "cold"]), "<=", 40.0),
        ("warm start of taylor (s)", float(start["taylor", "warm"]), "<=", 1.5),
    ]
    for run in long_runs.to_dict("records"):
        rows += [
            (f"restarts of the long run, {run['engine']}", run["restarts"], ">=", 1e6),
            ("memory growth in it (KiB)", run["memory_growth_kib"], "<=", 1024.0),
            ("liftoffs without impact", abs(run["liftoffs"] - run["impacts"]), "<=", 1.0),
            ("least gap (m)", run["gap_min_m"], ">=", 0.0),
        ]
    table = pd.DataFrame(rows, columns=["figure", "measured", "relation", "target"])
    met = np.where(
        table["relation"] == ">=", table["measured"] >= table["target"], table["measured"] <= table["target"]
    )
    return table.assign(met=met)
