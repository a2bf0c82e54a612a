"""Cost of branches of orbits beside a sweep of the same curves, and beside that sweep with heyoka's integrators."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.bench.peers.following import follow
from vibroplat.config.scene import Scene
from vibroplat.continuation.orbit import OrbitError, beginning_at, orbit
from vibroplat.continuation.tables import orbits
from vibroplat.kernels.compiled import FloatArray
from vibroplat.motion.run import simulate
from vibroplat.paper.scenes import machine_numbers, paper_scene
from vibroplat.study.branches import FREQUENCY, SUPPLY
from vibroplat.study.sweep import sweep

MASS = "material.mass_ratio"

#: Tolerances to which sweeps settle, and of their integrator: those of a sweep unless it says otherwise, and two with
#: which its points are about as exact as orbits, and more exact.
SETTLED = ((1e-3, 1e-6), (1e-7, 1e-6), (1e-9, 1e-9))
#: Every so many points are compared with orbits found to this tolerance; those that are farther from them than the last
#: number are other motions.
COMPARED, EXACT, OTHER = 7, 1e-11, 0.01

#: Every so many frequencies of the sweep heyoka is timed, after the motion has settled (s), over a time (s); the best
#: of some runs counts.
EVERY, BEFORE, OVER, RUNS = 8, 5.0, 10.0, 3


def curves() -> Scene:
    """Return the paper's Fig. 3 on the calibrated machine: three masses, up and down."""
    changes = {"solver.engine": "taylor", "sweep.lyapunov": False}
    return paper_scene("fig3", machine_numbers("calibrated"), changes)


def cost(repeats: int = 3) -> pd.DataFrame:
    """Measure the processor time of branches, of sweeps, and of heyoka over the motion of these sweeps.

    Branches have the unstable parts and both synchronizations. As the speed of a machine changes, they are timed anew
    right before each sweep: times are medians over repeats, and ``times_branches`` is the median of the time over that
    of the branches just before; that of heyoka is over the median. ``times_point`` is the same for one point.
    ``error`` is that of the RMS of y over the RMS of (x, y): the median, and what a tenth of the points exceeds.
    """
    scene = curves()
    assert scene.sweep is not None
    frequencies = scene.sweep.supply_frequency_hz
    plan = {"key": FREQUENCY, "start": frequencies.start, "stop": frequencies.stop, "grid": scene.sweep.grid}
    orbits(scene.replace({"orbits": plan | {"stop": frequencies.start + 1.0}}))  # loads the kernels
    followed = scene.replace({"orbits": plan})
    sweeps = [scene.replace({"sweep.settle_tolerance": t, "solver.tolerance": solver}) for t, solver in SETTLED]
    seconds, branches, tables = in_rounds(followed, sweeps, repeats)
    took = np.median(seconds, axis=0)
    once = float(np.median(seconds[:, :, 0]))
    rows: list[dict[str, Any]] = [
        {
            "what": "branches",
            "processor_s": once,
            "times_branches": 1.0,
            "points": len(branches),
            "turns_per_point": (branches["turns"] / branches["period"]).mean(),
            **errors(scene, branches),
        }
    ]
    brute = heyoka(scene)
    for i, ((tolerance, solver), table) in enumerate(zip(SETTLED, tables, strict=True)):
        motion = {"points": len(table), "simulated_s": table["simulated_s"].sum()}
        told = {"what": f"sweep, settled to {tolerance:g}", "processor_s": took[i, 1]}
        told["times_branches"] = np.median(seconds[:, i, 1] / seconds[:, i, 0])
        rows.append(told | motion | errors(scene, table[table["period"] == 1]))
        if solver < scene.solver.tolerance:
            continue  # heyoka was timed at the other tolerance
        for column, name in (("ms_per_s", "heyoka"), ("core_ms_per_s", "heyoka, its integrator alone")):
            total = 1e-3 * sum(at(brute, row, column) * row["simulated_s"] for _, row in table.iterrows())
            told = {"what": f"{name}, settled to {tolerance:g}", "processor_s": total, "times_branches": total / once}
            rows.append(told | motion | {"ms_per_s": 1e3 * total / motion["simulated_s"]})
    result = pd.DataFrame(rows)
    result["times_point"] = result["times_branches"] * result["points"].iloc[0] / result["points"]
    return result


def in_rounds(followed: Scene, sweeps: Sequence[Scene], repeats: int) -> tuple[FloatArray, pd.DataFrame, list[Any]]:
    """Time branches and then a sweep, for each sweep, in rounds.

    Returns
    -------
    seconds, branches, tables
        Processor times (s) of branches and sweep, shape (repeats, sweeps, 2), and the tables of the last round.
    """
    seconds: FloatArray = np.zeros((repeats, len(sweeps), 2))
    tables = [pd.DataFrame()] * len(sweeps)
    for timed in seconds:
        for i, settled in enumerate(sweeps):
            timed[i, 0], branches = processor_time(lambda: orbits(followed).branches)
            timed[i, 1], tables[i] = processor_time(lambda settled=settled: sweep(settled))  # type: ignore[misc]
    return seconds, branches, tables


def errors(scene: Scene, table: pd.DataFrame) -> dict[str, float]:
    """Compare the RMS of y at points of a sweep or of branches with orbits that are known more exactly."""
    found = []
    for _, row in table.iloc[::COMPARED].iterrows():
        try:
            exact = orbit(scene, row, tolerance=EXACT).measures
        except OrbitError:
            continue
        found.append(abs(row["rms_y_m"] - exact["rms_y_m"]) / math.hypot(exact["rms_x_m"], exact["rms_y_m"]))
    same = [error for error in found if error < OTHER]
    return {"error": float(np.median(same)), "error_of_a_tenth": float(np.quantile(same, 0.9)), "compared": len(same)}


def heyoka(scene: Scene) -> pd.DataFrame:
    """Time heyoka at masses and frequencies of a sweep: processor time of a run, and time of its integrator alone.

    Its kernels are compiled before, and the motion has settled.
    """
    from vibroplat.bench.peers.taylor import Taylor  # noqa: PLC0415  (optional)

    assert scene.sweep is not None
    rows = []
    for mass in scene.sweep.grid[MASS]:
        for supply in scene.sweep.supply_frequency_hz.upward[::EVERY]:
            placed = scene.replace({MASS: mass, FREQUENCY: supply, "run.duration_s": BEFORE})
            begun = beginning_at(placed, simulate(placed, keep="summary").final_state)
            begun = begun.replace({"run.duration_s": OVER, "run.perturbation": 0.0})
            peer = Taylor(begun, begun.solver.tolerance)
            runs = [processor_time(lambda begun=begun, peer=peer: follow(begun, peer)) for _ in range(RUNS)]  # type: ignore[misc]
            row = {MASS: mass, SUPPLY: supply, "ms_per_s": 1e3 * min(seconds for seconds, _ in runs) / OVER}
            rows.append(row | {"core_ms_per_s": 1e3 * min(run.core_s for _, run in runs) / OVER})
    return pd.DataFrame(rows)


def at(brute: pd.DataFrame, row: pd.Series, column: str) -> float:
    """Time per simulated second at a row of the sweep, between the frequencies that were measured."""
    of = brute[brute[MASS] == row[MASS]]
    return float(np.interp(row[SUPPLY], of[SUPPLY], of[column]))


def processor_time(what: Callable[[], Any]) -> tuple[float, Any]:
    """Do something; the processor time it took (s), and its result."""
    began = time.process_time()
    result = what()
    return time.process_time() - began, result
