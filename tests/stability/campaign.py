"""Many random scenes: each ends soundly, with a named outcome, within its budget of steps."""

import numpy as np
from common.random_scenes import STORM, TURNS, random_scene

from stability.checks import row, sound, with_engine
from vibroplat.integrate.native import MAX_STEPS
from vibroplat.motion.run import simulate
from vibroplat.observe.summary import INACCURATE

#: Outcomes of scenes that end early.
GIVEN_UP = frozenset({"event-storm", "solver-failure", "beyond-model"})
#: Every RARE-th scene is also run by engine ``sundae``, and its tables are looked through.
RARE = 100


def campaign(count, engine):
    """Run random scenes; the last row of a thousand or more is of all, with tighter limits than for single scenes."""
    rows, residuals = [], []
    for number in range(count):
        scene = with_engine(random_scene(number), engine)
        rows.append(judged(scene))
        if rows[-1]["outcome"] == "ok":
            residuals.append(rows[-1]["energy_residual"] / scene.solver.tolerance)
        if engine == "native" and number % RARE == 0:
            rows.append(judged(with_engine(scene, "sundae")))
    if count < 1000:
        return rows
    share = {outcome: sum(r["outcome"] == outcome for r in rows) / len(rows) for outcome in ("ok", "solver-failure")}
    limits = {
        "ended_early": (1.0 - share["ok"], 0.15),
        "solver_failures": (share["solver-failure"], 0.01),
        "median_energy_residual_over_tolerance": (float(np.median(residuals)), 5.0),
        "most_energy_residuals_over_tolerance": (float(np.quantile(residuals, 0.95)), 300.0),
    }
    return [*rows, row("all of them", "ok", limits)]


def judged(scene):
    """Run a scene with its engine; return its row."""
    thorough = scene.solver.engine == "sundae"
    run = simulate(scene, keep="segments" if thorough else "summary")
    summary = run.summary
    limits = {
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
    return row(scene.name, summary["outcome"], limits, allowed=GIVEN_UP | {"ok", INACCURATE})


def _missing(*arrays):
    """Count what is not a number in arrays and records; only the turns passed have no number before the first step."""
    columns = [array[name] for array in arrays for name in array.dtype.names or () if name != "passed"]
    columns += [array for array in arrays if array.dtype.names is None]
    return sum(int(np.isnan(column).sum()) for column in columns)
