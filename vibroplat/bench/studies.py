"""Cost of studies: branches of orbits beside sweeps of the same curves, and basins by both engines."""

from __future__ import annotations

import math
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.basin.study import basins
from vibroplat.bench.measure import by_turns, timed
from vibroplat.config.scene import Scene
from vibroplat.continuation.first_orbit import OrbitError
from vibroplat.continuation.orbit import orbit_near
from vibroplat.continuation.study import orbits
from vibroplat.paper.scenes import machine_numbers, paper_scene
from vibroplat.study.sweep import sweep

#: Tolerances to which sweeps settle, and of their integrator: those of a sweep unless it says otherwise, and two with
#: which its points are about as exact as orbits, and more exact.
SETTLED = ((1e-3, 1e-6), (1e-7, 1e-6), (1e-9, 1e-9))
#: Every so many points are compared with orbits of this tolerance; those farther away than OTHER are other motions.
COMPARED, EXACT, OTHER = 7, 1e-11, 0.01


def cost_of_orbits(repeats: int, changes: dict[str, Any] | None = None) -> pd.DataFrame:
    """Measure the processor time of branches and of sweeps of Fig. 3 on the calibrated machine.

    Branches have the unstable parts and both synchronizations. As the speed of a machine changes, they are timed anew
    right before each sweep: times are medians over repeats, and ``times_branches`` is the median of the time over that
    of the branches just before; ``times_point`` is the same for one point. ``error`` is that of the RMS of y over the
    RMS of (x, y): the median, and what a tenth of the points exceeds.
    """
    changes = {"solver.engine": "taylor", "sweep.settle_by": "section", "sweep.lyapunov": False} | (changes or {})
    scene = paper_scene("fig3", machine_numbers("calibrated"), changes)
    assert scene.sweep is not None
    plan = scene.sweep.swept.model_dump(include={"key", "start", "stop"}) | {"grid": scene.sweep.grid}
    followed = scene.replace({"orbits": plan})
    orbits(scene.replace({"orbits": plan | {"stop": plan["start"] + 1.0}}))  # loads the kernels
    rows: list[dict[str, Any]] = []
    for tolerance, solver in SETTLED:
        swept = scene.replace({"sweep.settle_tolerance": tolerance, "solver.tolerance": solver})
        pair: dict[str, Any] = {"branches": partial(timed, orbits, followed), "sweep": partial(timed, sweep, swept)}
        (own, found), (its, other) = by_turns(pair, repeats).values()
        branches, table = found.branches, other.sweep
        rows = rows or [{"what": "branches", "processor_s": np.median(own), "times_branches": 1.0}]
        rows[0] |= {"points": len(branches), **errors(scene, branches)}
        row = {"what": f"sweep, settled to {tolerance:g}", "processor_s": np.median(its), "points": len(table)}
        row |= {"times_branches": np.median(its / own), "simulated_s": table["simulated_s"].sum()}
        rows.append(row | errors(scene, table[table["period"] == 1]))
    result = pd.DataFrame(rows)
    return result.assign(times_point=result["times_branches"] * len(branches) / result["points"])


def errors(scene: Scene, table: pd.DataFrame) -> dict[str, float]:
    """Compare the RMS of y at points of a sweep or of branches with orbits that are known more exactly."""
    differences = []
    for _, row in table.iloc[::COMPARED].iterrows():
        with suppress(OrbitError):
            exact = orbit_near(scene, row, 1, EXACT).measures
            differences.append(abs(row["rms_y_m"] - exact["rms_y_m"]) / math.hypot(exact["rms_x_m"], exact["rms_y_m"]))
    same = [error for error in differences if error < OTHER]
    return {"error": float(np.median(same)), "error_of_a_tenth": float(np.quantile(same, 0.9))}


def basins_scene(starts: int, engine: str) -> Scene:
    """Return the calibrated machine without material where it has two synchronous motions, with random starts."""
    box = {"run.initial.phase_difference_rad": [-math.pi, math.pi], "run.initial.speed_ratio": [0.5, 1.1]}
    changes = {"drive.supply_frequency_hz": 62.3, "material.mass_ratio": 0.0, "solver.engine": engine, "sweep": None}
    return paper_scene("fig3", machine_numbers("calibrated"), {}).replace(
        {**changes, "basins": {"initial_conditions": box, "random": starts}}
    )


def cost_of_basins(repeats: int, starts: int = 400) -> pd.DataFrame:
    """Measure the processor time of basins by each engine.

    ``turns`` is the mean over the starts of how long each was followed. ``unlike`` counts starts that engine ``taylor``
    assigns to another attractor.
    """
    scenes = {engine: basins_scene(starts, engine) for engine in ("taylor", "native")}
    for scene in scenes.values():
        basins(scene.replace({"basins.random": 2}))  # loads the kernels
    timings = by_turns({engine: partial(timed, basins, scene) for engine, scene in scenes.items()}, repeats)
    usual = timings["taylor"]
    rows: list[dict[str, Any]] = []
    for engine, (seconds, tables) in timings.items():
        row = {"engine": engine, "turns": tables.starts["turns"].mean(), "processor_s": np.median(seconds)}
        row["ms_a_start"] = 1e3 * row["processor_s"] / starts
        row["over_taylor"] = np.median(seconds / usual.seconds)
        row["unlike"] = int((tables.starts["attractor"] != usual.value.starts["attractor"]).sum())
        rows.append(row)
    return pd.DataFrame(rows)
