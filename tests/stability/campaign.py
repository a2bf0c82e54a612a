"""Many random scenes: each ends soundly, with a named outcome."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from common.random_scenes import STORM, TURNS, random_scene

from stability.checks import Limit, row, sound, with_engine
from vibroplat.config.scene import Scene
from vibroplat.integrate.native import MAX_STEPS
from vibroplat.motion.run import simulate
from vibroplat.observe.audit import INACCURATE

#: Outcomes of scenes that end early.
GIVEN_UP = frozenset({"event-storm", "solver-failure", "beyond-model"})
#: Every RARE-th scene is also run by the other engine.
RARE = 100


def campaign(count: int, engine: str) -> list[dict[str, Any]]:
    """Run random scenes; each must end with ``ok`` or another named outcome within its budget of steps.

    With ``native``, every hundredth is also run by engine ``sundae``, and its tables are looked through; the last row
    is of all.
    """
    rows = []
    for number in range(count):
        scene = random_scene(number)
        rows.append(judged(with_engine(scene, engine)))
        if engine == "native" and number % RARE == 0:
            rows.append(judged(with_engine(scene, "sundae")))
    return [*rows, _all(engine, rows, [random_scene(number).solver.tolerance for number in range(count)])]


def judged(scene: Scene) -> dict[str, Any]:
    """Run a scene with its engine; return its row, in which ``failed`` says what is beyond its limit."""
    began = time.perf_counter()
    thorough = scene.solver.engine == "sundae"
    run = simulate(scene, keep="segments" if thorough else "summary")
    seconds = time.perf_counter() - began
    summary = run.summary
    limits: dict[str, Limit] = {
        "restarts": (summary["restarts"], STORM * (TURNS + 1.0)),
        "not_a_number": (_missing(*run.measures, run.final_state), 0.0),
        **sound(scene, summary),
    }
    if thorough:
        limits["missing_in_tables"] = (int(run.trajectory.isna().sum().sum() + run.events.isna().sum().sum()), 0.0)
    else:
        limits["steps"] = (summary["steps"], MAX_STEPS * (TURNS + 1.0))
    if summary["outcome"] in ("ok", INACCURATE):
        limits["left_out_s"] = (abs(summary["simulated_s"] - scene.run.duration_s), 0.0)
    figures = {"steps": summary["steps"], "events": summary["events"], "seconds": seconds, "detail": summary["detail"]}
    engine = {"engine": summary["engine"]}
    return engine | row(scene.name, summary["outcome"], limits, allowed=GIVEN_UP | {"ok", INACCURATE}) | figures


def _missing(*arrays: Any) -> int:
    """Count what is not a number in arrays and records; only the turns passed have no number before the first step."""
    columns = [array[name] for array in arrays for name in array.dtype.names or () if name != "passed"]
    columns += [array for array in arrays if array.dtype.names is None]
    return sum(int(np.isnan(column).sum()) for column in columns)


def _all(engine: str, rows: list[dict[str, Any]], tolerances: list[float]) -> dict[str, Any]:
    """Judge the campaign as a whole, with tighter limits than for single scenes."""
    by_outcome = {outcome: sum(r["outcome"] == outcome for r in rows) / len(rows) for outcome in ("ok", *GIVEN_UP)}
    own = [r for r in rows if r["engine"] == engine] or rows  # another takes over where ``native`` is not available
    residuals = np.array(
        [r["energy_residual"] / t for r, t in zip(own, tolerances, strict=False) if r["outcome"] == "ok"]
    )
    limits: dict[str, Limit] = {
        "ended_early": (1.0 - by_outcome["ok"], 0.15),
        "solver_failures": (by_outcome["solver-failure"], 0.01),
        "median_energy_residual_over_tolerance": (float(np.median(residuals)), 5.0),
        "most_energy_residuals_over_tolerance": (float(np.quantile(residuals, 0.95)), 300.0),
    }
    return row("all of them", "ok", limits)
