"""Cost of branches of orbits beside sweeps of the same curves."""

from __future__ import annotations

import math
import time
from contextlib import suppress
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.config.scene import Scene
from vibroplat.continuation.orbit import OrbitError, orbit_near
from vibroplat.continuation.study import orbits
from vibroplat.paper.scenes import machine_numbers, paper_scene
from vibroplat.study.sweep import sweep

#: Tolerances to which sweeps settle, and of their integrator: those of a sweep unless it says otherwise, and two with
#: which its points are about as exact as orbits, and more exact.
SETTLED = ((1e-3, 1e-6), (1e-7, 1e-6), (1e-9, 1e-9))
#: Every so many points are compared with orbits of this tolerance; those farther away than OTHER are other motions.
COMPARED, EXACT, OTHER = 7, 1e-11, 0.01


def cost(repeats: int, changes: dict[str, Any] | None = None) -> pd.DataFrame:
    """Measure the processor time of branches and of sweeps of Fig. 3 on the calibrated machine.

    Branches have the unstable parts and both synchronizations. As the speed of a machine changes, they are timed anew
    right before each sweep: times are medians over repeats, and ``times_branches`` is the median of the time over that
    of the branches just before; ``times_point`` is the same for one point. ``error`` is that of the RMS of y over the
    RMS of (x, y): the median, and what a tenth of the points exceeds.
    """
    changes = {"solver.engine": "taylor", "sweep.settle": "motion", "sweep.lyapunov": False} | (changes or {})
    scene = paper_scene("fig3", machine_numbers("calibrated"), changes)
    assert scene.sweep is not None
    plan = scene.sweep.swept.model_dump(include={"key", "start", "stop"}) | {"grid": scene.sweep.grid}
    orbits(scene.replace({"orbits": plan | {"stop": plan["start"] + 1.0}}))  # loads the kernels
    rows: list[dict[str, Any]] = []
    for tolerance, solver in SETTLED:
        seconds = []
        for _ in range(repeats):
            began = time.process_time()
            branches = orbits(scene.replace({"orbits": plan})).branches
            between = time.process_time()
            table = sweep(scene.replace({"sweep.settle_tolerance": tolerance, "solver.tolerance": solver})).sweep
            seconds.append((between - began, time.process_time() - between))
        own, its = np.array(seconds).T
        rows = rows or [{"what": "branches", "processor_s": np.median(own), "times_branches": 1.0}]
        rows[0] |= {"points": len(branches), **errors(scene, branches)}
        row = {"what": f"sweep, settled to {tolerance:g}", "processor_s": np.median(its), "points": len(table)}
        row |= {"times_branches": np.median(its / own), "simulated_s": table["simulated_s"].sum()}
        rows.append(row | errors(scene, table[table["period"] == 1]))
    result = pd.DataFrame(rows)
    return result.assign(times_point=result["times_branches"] * len(branches) / result["points"])


def errors(scene: Scene, table: pd.DataFrame) -> dict[str, float]:
    """Compare the RMS of y at points of a sweep or of branches with orbits that are known more exactly."""
    found = []
    for _, row in table.iloc[::COMPARED].iterrows():
        with suppress(OrbitError):
            exact = orbit_near(scene, row, 1, EXACT).measures
            found.append(abs(row["rms_y_m"] - exact["rms_y_m"]) / math.hypot(exact["rms_x_m"], exact["rms_y_m"]))
    same = [error for error in found if error < OTHER]
    return {"error": float(np.median(same)), "error_of_a_tenth": float(np.quantile(same, 0.9))}
