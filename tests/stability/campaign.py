"""Many random scenes by two engines that share no numerics: each ends soundly, and both find the same events.

As a program it writes a table for each hundred of them into a folder, with as many processes as it is told, and goes on
where it was ended. Then it prints what all tables in the folder say; with ``--scenes 0`` it does only that::

    PYTHONPATH=tests python -m stability.campaign FOLDER --scenes 1000000 --jobs 2
"""

import argparse
from dataclasses import replace
from functools import partial
from multiprocessing import Pool
from pathlib import Path

import numpy as np
import pandas as pd
from common.random_scenes import STORM, TURNS, random_scene

from stability.checks import NAMED, row, sound, with_engine
from vibroplat import orbit, simulate
from vibroplat.check import by_other_engine
from vibroplat.check.events import Errors, paired
from vibroplat.check.runs import Course, check_run
from vibroplat.continuation.orbit import OrbitError, run_from
from vibroplat.hybrid.state import state_scales
from vibroplat.integrate.native import MAX_STEPS
from vibroplat.model.systems import GAP
from vibroplat.observe.summary import INACCURATE

#: Engines that run each scene.
ENGINES = ("native", "taylor")
#: Scenes of a table.
PART = 100
#: Every THOROUGH-th scene is also compared with its accurate motion and with an orbit near its end. Where the error,
#: over the tolerance and what the motion makes of a disturbance, is above SUSPECT, the engines are compared in time, as
#: they are where they differ: that takes as long as three scenes. One of 100 runs of ``native`` is beyond 3e4.
THOROUGH, SUSPECT = 10, 1e4
#: Tolerances with which an engine is compared again where it disagrees, over that of the scene, and the least of them.
FINER, FINEST = (1e-2, 1e-4, 1e-6), 1e-12
#: Share of a run that is compared where an integrator has failed in it.
BEFORE = 0.99
#: Disturbance that shows what errors grow to, and that of the differences that multipliers are compared with, both in
#: the scales of the scene; and how far a multiplier may be from that, over the larger of it and 1.
SLIGHT, STEP, NEAR = 1e-9, 1e-6, 1e-3


def campaign(count, engine):
    """Run random scenes; those of one engine are checked by the other."""
    return [judged(number, engine) for number in range(count)]


def judged(number, engine=ENGINES[0]):
    """Run a random scene with both engines; return its row."""
    scene = with_engine(random_scene(number, seed=1, as_bought=True), engine)
    one, two = Course(scene), Course(by_other_engine(scene))
    values, limits = {"number": number, "tolerance": scene.solver.tolerance, "failure": ""}, {}
    for course in (one, two):
        summary, name = course.result.summary, course.engine
        values |= {f"outcome_{name}": summary["outcome"], f"steps_{name}": summary["steps"]}
        limits |= {f"{name}_{key}": limit for key, limit in _sound(course.scene, course.result).items()}
        if summary["outcome"] == "solver-failure":
            values["failure"] = summary["detail"]
    pairs = paired(one.events, two.events, Errors(np.zeros(1), np.zeros(1)), scene, min(one.end, two.end))
    values["events"] = len(pairs.rows)
    differ = one.outcome != two.outcome or np.isfinite(pairs.differ_s)
    if number % THOROUGH == 0 and one.outcome == two.outcome == "ok":
        errors = _errors(scene, one, two)
        values |= errors | _multipliers(scene, one.result.final_state)
        limits["multipliers"] = (values["multipliers_off"], NEAR)
        differ |= max(errors.get(f"error_{course.engine}", 0.0) for course in (one, two)) > SUSPECT
    if differ:
        found = _explained(scene)
        values["events"], limits["disagreements"] = found.events, (float(not found.agrees), 0.0)
    return row(scene.name, one.result.outcome, limits, allowed=NAMED) | values


def _sound(scene, run):
    """Limits of a run by name: those of every run, its steps and restarts, and that nothing is missing."""
    summary = run.summary
    limits = {
        "restarts": (summary["restarts"], STORM * (TURNS + 1.0)),
        "steps": (summary["steps"], MAX_STEPS * (TURNS + 1.0)),
        "not_a_number": (_missing(*run.measures, run.final_state), 0.0),
        **sound(scene, summary),
    }
    if summary["outcome"] in ("ok", INACCURATE):
        limits["left_out_s"] = (abs(summary["simulated_s"] - scene.run.duration_s), 0.0)
    return limits


def _missing(*arrays):
    """Count what is not a number in arrays and records; before the first step turns and supplies have none."""
    columns = [array[name] for array in arrays for name in array.dtype.names or () if name not in ("passed", "since")]
    columns += [array for array in arrays if array.dtype.names is None]
    return sum(int(np.isnan(column).sum()) for column in columns)


def _explained(scene):
    """Compare two engines, with repetitions that show what errors grow to.

    Where these do not explain a difference, the same run of the other engine is compared with finer runs of the first:
    an error over its tolerance varies from scene to scene, and a tenth of the tolerance does not always show it. What
    is then left would be an error of the other engine.
    """
    found, tolerance = _checked(scene), scene.solver.tolerance
    finer = sorted({max(share * tolerance, FINEST) for share in FINER} - {tolerance}, reverse=True)
    while not found.agrees and finer and finer[0] < tolerance:
        found = _checked(scene.replace({"solver.tolerance": finer.pop(0)}), tolerance)
    return found


def _checked(scene, tolerance=None):
    """Check a scene by the other engine with a tolerance, up to where an integrator fails in one of both."""

    def other(scene):
        changed = by_other_engine(scene)
        return changed if tolerance is None else changed.replace({"solver.tolerance": tolerance})

    found = check_run(scene, other=other)
    if found.agrees or "solver-failure" not in found.outcomes or not found.compared_until_s:
        return found
    sooner = scene.replace({"run.duration_s": BEFORE * found.compared_until_s})
    return replace(check_run(sooner, other=other), outcomes=found.outcomes)


def _errors(scene, *courses):
    """Errors of the end of runs, over the tolerance and what the motion makes of a disturbance, by engine."""
    exact = scene.replace({"solver.engine": "taylor", "solver.tolerance": 0.1 * FINEST})
    share = scene.run.start_perturbation
    near = exact.replace({"run.perturbation": share + (SLIGHT if share < 0.5 else -SLIGHT)})
    reference, other = (simulate(one, keep="summary") for one in (exact, near))
    if not reference.outcome == other.outcome == "ok":
        return {}
    scales = state_scales(scene)

    def off(state):
        return float(np.abs((state - reference.final_state) / scales).max())

    growth = max(1.0, off(other.final_state) / SLIGHT)
    errors = {f"error_{c.engine}": off(c.result.final_state) / (scene.solver.tolerance * growth) for c in courses}
    return errors | {"amplification": growth}


def _multipliers(scene, state):
    """How far multipliers of an orbit near a state are from those of differences; 0 without such an orbit."""
    none = {"orbit": "", "multipliers_off": 0.0}
    if scene.drive.program is not None:
        return none
    try:
        found = orbit(scene.replace({"solver.engine": "taylor"}), state)
    except OrbitError:
        return none
    exact, scales = found.scene.replace({"solver.tolerance": FINEST}), state_scales(scene)
    apart = not scene.has_contact or found.state[GAP] > 0.0
    here = [i for k in scene.coordinates for i in (k, 7 + k) if apart or k != GAP]

    def end(i, way):
        moved = found.state.copy()
        moved[i] += way * scales[i]
        return run_from(exact, moved, found.period_s).final_state[here] / scales[here]

    columns = [(end(i, STEP) - end(i, -STEP)) / (2.0 * STEP) for i in here]
    known = np.linalg.eigvals(np.array(columns).T)
    off = [np.abs(known - one).min() / max(1.0, abs(one)) for one in found.multipliers if abs(one) > NEAR]
    return {"orbit": found.sequence, "stable": found.stable, "multipliers_off": float(max(off, default=0.0))}


# -- as a program -----------------------------------------------------------------------------------------


def write_part(folder, part):
    """Write the table of a part of all scenes, all of it or nothing."""
    table = pd.DataFrame([judged(number) for number in range(part * PART, (part + 1) * PART)])
    unfinished = folder / f".{part:06}.parquet"
    table.to_parquet(unfinished, index=False)
    unfinished.rename(folder / f"{part:06}.parquet")


def report(folder):
    """Print what the tables in a folder say: outcomes, errors, orbits, and each scene that failed."""
    table = pd.concat([pd.read_parquet(path) for path in sorted(folder.glob("[0-9]*.parquet"))], ignore_index=True)
    print(f"{len(table)} random scenes")
    print(pd.DataFrame({e: table[f"outcome_{e}"].value_counts() for e in ENGINES}).fillna(0).astype(int).to_string())
    errors = table[[f"error_{e}" for e in ENGINES]].describe(percentiles=[0.5, 0.9, 0.99, 0.999])
    print("error over tolerance and amplification\n" + errors.to_string(float_format="{:.2g}".format))
    orbits = table[table["orbit"].fillna("") != ""]
    print(f"{len(orbits)} orbits, multipliers off by {orbits['multipliers_off'].max():.2g} at most")
    print(table.loc[table["failed"] != "", ["number", "failed"]].to_string(index=False))


def main():
    """Run what is missing of a campaign, and report."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--scenes", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    parts = range(given.scenes // PART)
    missing = [part for part in parts if not (given.folder / f"{part:06}.parquet").exists()]
    with Pool(given.jobs) as workers:
        for done, _ in enumerate(workers.imap_unordered(partial(write_part, given.folder), missing), start=1):
            print(f"{done} of {len(missing)} parts", end="\r", flush=True)
    report(given.folder)


if __name__ == "__main__":
    main()
