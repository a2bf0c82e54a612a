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
from common.known import motion_of
from common.random_scenes import STORM, random_scene

from stability.checks import NAMED, row, sound, with_engine
from vibroplat import orbit, simulate
from vibroplat.check import MIN_ALLOWED, with_other_engine
from vibroplat.check.events import ErrorBound, EventMatches, compared_events, match_events
from vibroplat.check.runs import check_run
from vibroplat.continuation.first_orbit import OrbitError
from vibroplat.continuation.orbit import run_from
from vibroplat.hybrid.state import state_scales
from vibroplat.integrate.interface import MAX_STEPS
from vibroplat.model.systems import GAP
from vibroplat.report.summary import INACCURATE
from vibroplat.study.fingerprint import package

#: Engines that run each scene.
ENGINES = ("native", "taylor")
#: Scenes of a table.
PART = 100
#: Turns of a scene, and of a thorough one. Many short motions find more than few long ones: most of what is difficult
#: lies in the parameters and shows at once. Stiff scenes are as short as MANY steps allow, but no shorter than LEAST,
#: which is tried first; otherwise a tenth of all scenes would take most of the time.
SHORT, LONG, LEAST, MANY = 4.0, 6.0, 0.1, 3000
#: Every THOROUGH-th scene is longer, and unless it is stiff also compared with its accurate motion and with an orbit
#: near its end. Where the error, over the tolerance and what the motion makes of a disturbance, is above SUSPECT, the
#: engines are compared in time, as they are where they differ: that takes as long as three scenes. One of 1000 runs of
#: ``native`` is beyond 3300.
THOROUGH, SUSPECT = 10, 1e4
#: Tolerances with which an engine is compared again where it disagrees, over that of the scene, and the least of them.
FINER, FINEST = (1e-2, 1e-4, 1e-6), 1e-12
#: Limits that errors of steps may exceed, and what a finer run may leave of such a value, over the root of the ratio of
#: both tolerances: a defect that goes with that root would leave 1.
BALANCES, LESS = {"energy_residual", "momentum_residual", "gap_below", "pull_n"}, 0.5
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
    scene, turns = _scene(number, SHORT if number % THOROUGH else LONG, engine)
    runs = [simulate(s, keep="events") for s in (scene, with_other_engine(scene))]
    values, limits = {"number": number, "tolerance": scene.solver.tolerance, "failure": ""}, {}
    for run in runs:
        summary, name = run.summary, run.summary["engine"]
        values |= {f"outcome_{name}": run.outcome, f"steps_{name}": summary["steps"]}
        found, values[f"beyond_{name}"] = judged_finer(run, _sound(run, turns))
        limits |= {f"{name}_{key}": limit for key, limit in found.items()}
        if run.outcome == "solver-failure":
            values["failure"] = summary["detail"]
    pairs, differ = paired(*runs), are_apart(*runs)
    values["events"] = len(pairs.rows)
    if turns == LONG and {end(run) for run in runs} == {"ok"}:
        errors = _errors(scene, *runs)
        values |= errors | _multipliers(scene, runs[0].final_state)
        limits["multipliers"] = (values["multipliers_off"], NEAR)
        differ |= max(errors.get(f"error_{name}", 0.0) for name in ENGINES) > SUSPECT
    if differ:
        found = explained(scene)
        values["events"], limits["disagreements"] = found.events, (float(not found.agrees), 0.0)
    return row(scene.name, runs[0].outcome, limits, allowed=NAMED) | values


def _scene(number, turns, engine):
    """Return a random scene and its turns, fewer than these if it is stiff."""
    scene = with_engine(random_scene(number, seed=1, as_bought=True, turns=turns), engine)
    least = LEAST / turns * scene.run.duration_s
    steps = max(_steps(with_engine(scene, name), least) for name in ENGINES)
    if steps * turns <= LEAST * MANY:
        return scene, turns
    turns = max(LEAST, LEAST * MANY / steps)
    return with_engine(random_scene(number, seed=1, as_bought=True, turns=turns), engine), turns


def _steps(scene, seconds):
    with motion_of(scene) as motion:
        motion.to_time(seconds)
        return motion.engine.work["steps"]


def end(run):
    """How a run ended; energy that was lost is not what is compared."""
    return "ok" if run.outcome == INACCURATE else run.outcome


def paired(*runs):
    """Pair events of two runs, but for those that an error of the tolerance may add or remove."""
    if not any(run.event_rows.size for run in runs):
        return EventMatches(np.zeros((0, 2), np.int64))
    scene, until = runs[0].scene, min(run.summary["simulated_s"] for run in runs)
    tables = [compared_events(run.events) for run in runs]
    return match_events(
        *tables, ErrorBound(np.zeros(1), np.array([MIN_ALLOWED * scene.solver.tolerance])), scene, until
    )


def _sound(run, turns):
    """Limits of a run by name: those of every run, its steps and restarts, and that nothing is missing."""
    scene, summary = run.scene, run.summary
    limits = {
        "restarts": (summary["restarts"], STORM * (turns + 1.0)),
        "steps": (summary["steps"], MAX_STEPS * (turns + 1.0)),
        "not_a_number": (_missing(*run.measures, run.final_state), 0.0),
        **sound(scene, summary),
    }
    if summary["outcome"] in ("ok", INACCURATE):
        limits["left_out_s"] = (abs(summary["simulated_s"] - scene.run.duration_s), 0.0)
    return limits


def judged_finer(run, limits):
    """Leave out limits that errors of steps alone exceed: those that a finer run keeps or comes far nearer to.

    Also return how far the run was beyond them, 0 if it was not. What errors of steps add up to is not known: where a
    stiff motor passes its critical slip, or a hardly damped layer rings for hundreds of periods, it is more than the
    limits say. Other errors stay as they are.
    """
    scene, beyond = run.scene, {key: limits[key][0] / limits[key][1] for key in limits.keys() & BALANCES}
    beyond = {key: share for key, share in beyond.items() if share > 1.0}
    left = set(beyond)
    for tolerance in sorted({max(share * scene.solver.tolerance, FINEST) for share in FINER}, reverse=True):
        if not left or tolerance >= scene.solver.tolerance:
            break
        finer = scene.replace({"solver.tolerance": tolerance})
        again = sound(finer, simulate(finer, keep="summary").summary)
        less = LESS * (tolerance / scene.solver.tolerance) ** 0.5
        left -= {key for key in left & again.keys() if again[key][0] <= max(again[key][1], less * limits[key][0])}
    kept = beyond.keys() - left
    return {key: limits[key] for key in limits.keys() - kept}, max((beyond[key] for key in kept), default=0.0)


def _missing(*arrays):
    """Count what is not a number in arrays and records; before the first step turns and supplies have none."""
    empty = ("passed", "since", "turn")
    columns = [array[name] for array in arrays for name in array.dtype.names or () if name not in empty]
    columns += [array for array in arrays if array.dtype.names is None]
    return sum(int(np.isnan(column).sum()) for column in columns)


def are_apart(*runs):
    """Whether two runs end in different ways, or with other events."""
    return len({end(run) for run in runs}) > 1 or bool(np.isfinite(paired(*runs).differ_s))


def explained(scene):
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
        changed = with_other_engine(scene)
        return changed if tolerance is None else changed.replace({"solver.tolerance": tolerance})

    found = check_run(scene, other=other)
    if found.agrees or "solver-failure" not in found.outcomes or not found.compared_until_s:
        return found
    sooner = scene.replace({"run.duration_s": BEFORE * found.compared_until_s})
    return replace(check_run(sooner, other=other), outcomes=found.outcomes)


def _errors(scene, *runs):
    """Errors of the end of runs, over the tolerance and what the motion makes of a disturbance, by engine."""
    exact = scene.replace({"solver.engine": "taylor", "solver.tolerance": 0.1 * FINEST})
    share = scene.start_perturbation
    near = exact.replace({"run.perturbation": share + (SLIGHT if share < 0.5 else -SLIGHT)})
    reference, other = (simulate(one, keep="summary") for one in (exact, near))
    if not reference.outcome == other.outcome == "ok":
        return {}
    scales = state_scales(scene)

    def off(state):
        return float(np.abs((state - reference.final_state) / scales).max())

    growth = max(1.0, off(other.final_state) / SLIGHT)
    amount = scene.solver.tolerance * growth
    errors = {f"error_{run.summary['engine']}": off(run.final_state) / amount for run in runs}
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


def write_part(folder, part):
    """Write the table of a part of all scenes, all of it or nothing."""
    unfinished = folder / f".{part:06}.parquet"
    rows = [_row(number) for number in range(part * PART, (part + 1) * PART)]
    pd.DataFrame(rows).to_parquet(unfinished, index=False)
    unfinished.rename(folder / f"{part:06}.parquet")


def _row(number):
    """Return the row of a scene, and the code that ran it; what is raised is a failure like others."""
    try:
        found = judged(number)
    except Exception as error:
        found = {"number": number, "failed": f"{type(error).__name__}: {error}"}
    return found | {"code": package()["source files"]}


def report(folder):
    """Print what the tables in a folder say: outcomes, errors, orbits, and each scene that failed."""
    table = pd.concat([pd.read_parquet(path) for path in sorted(folder.glob("[0-9]*.parquet"))], ignore_index=True)
    print(f"{len(table)} random scenes, by code {', '.join(table['code'].unique())}")
    print(pd.DataFrame({e: table[f"outcome_{e}"].value_counts() for e in ENGINES}).fillna(0).astype(int).to_string())
    errors = table[[f"error_{e}" for e in ENGINES]].describe(percentiles=[0.5, 0.9, 0.99, 0.999])
    print("error over tolerance and amplification\n" + errors.to_string(float_format="{:.2g}".format))
    for engine in ENGINES:
        beyond = table[f"beyond_{engine}"]
        print(f"{engine}: {(beyond > 0).sum()} by errors of steps beyond limits, by up to {beyond.max():.2g}")
    orbits = table[table["orbit"].fillna("") != ""]
    print(f"{len(orbits)} orbits, multipliers off by {orbits['multipliers_off'].max():.2g} at most")
    print(table.loc[table["failed"] != "", ["number", "failed"]].to_string(index=False))


def main():
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
