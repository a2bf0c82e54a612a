"""Accumulating impacts, and elastic ones that nearly accumulate."""

import math

import numpy as np
from common.known import GRAVITY, OMEGA, TURN, accumulation_time, dropped_ball

from stability.checks import NAMED, row, sound, with_engine
from vibroplat.bench.measure import base
from vibroplat.motion.run import simulate

TOLERANCE = 1e-10
#: Largest relative error of the time of a chatter; at the default tolerance 1 − R times that: more of the series is
#: summed there, and an error would be visible.
LATCH = 1e-6
#: The same for layers on the moving platform, compared with a run at a tenth of the tolerance.
LATCH_MOVING = 1e-7
#: The same after tens of thousands of impacts, each of which adds its own error.
LATCH_SLOW = 1e-5
#: Number of impacts followed one by one before the chatter, over the number that the geometric series requires.
COST = 1.2
#: Drop height of a ball (m) for which the accumulation ends within a few turns.
HEIGHT = 1e-3
#: Number of elastic impacts of a ball, and relative energy that each may lose or gain at tolerance 1.
BOUNCES, DRIFT = 1000, 10.0


def accumulation(count, engine):
    """Drop a ball on a table at rest, and layers on the running machine, for R from 0.05 to 0.99."""
    rows = []
    for restitution in np.linspace(0.05, 0.99, max(count // 3, 1)).tolist():
        rows.append(_ball(restitution, TOLERANCE, LATCH, engine))
        # the error of each impact affects all later ones
        rows.append(_ball(restitution, 1e-6, LATCH / (1.0 - restitution), engine))
        rows.append(_moving(restitution, engine))
    return rows


def _ball(restitution, tolerance, allowed, engine):
    """Compare the time of a chatter with t∞, and momentum and energy with those of the fall."""
    scene = with_engine(dropped_ball(restitution, HEIGHT, tolerance), engine)
    name = f"ball, R {restitution:.3g}, tolerance {tolerance:g}"
    run = simulate(scene)
    events = run.events
    chatters = events[events["kind"] == "chatter"]
    if chatters.empty:
        return row(name, run.outcome, {"latches_missed": (1.0, 0.0)})
    mass, closed = scene.layer_masses[0], float(chatters["t_s"].iloc[0])
    landed = events[events["t_s"] <= closed]
    # until ω₀τ ≤ √tol, the impacts' duration τ falling with Rⁿ from 2 √(2h/g) R/(1−R)
    first = OMEGA * 2.0 * math.sqrt(2.0 * HEIGHT / GRAVITY) * restitution / (1.0 - restitution)
    needed = max(math.log(first / math.sqrt(tolerance)) / -math.log(restitution), 0.0)
    limits = {
        "latch_time": (abs(closed / accumulation_time(restitution, HEIGHT) - 1.0), allowed),
        "momentum": (abs(landed["impulse_n_s"].sum() / (mass * GRAVITY * closed) - 1.0), allowed),
        "loss": (abs(landed["energy_loss_j"].sum() / (mass * GRAVITY * HEIGHT) - 1.0), allowed),
        "latches_too_many": (len(chatters) - 1, 0.0),
        "impacts_followed": (int((landed["kind"] == "impact").sum()), COST * needed + 2.0),
    }
    return row(name, run.outcome, limits | sound(scene, run.summary))


def _moving(restitution, engine):
    """Let a small drop accumulate on the running machine; a run at a smaller tolerance gives the same chatter."""
    state = {"phi1_rad": 0.3, "phi2_rad": 2.9, "phi1_rate_rad_per_s": 120.0, "phi2_rate_rad_per_s": -120.0}
    scene = with_engine(base(TOLERANCE, 0.2), engine).replace(
        {
            "drive.supply_frequency_hz": 40.0,
            "contact.restitution": restitution,
            "run.initial.state": state | {"gap_m": 2e-6},
        }
    )
    runs = [simulate(scene.replace({"solver.tolerance": t}), keep="events") for t in (TOLERANCE, 0.1 * TOLERANCE)]
    found, expected = (_latch(run) for run in runs)
    limits = {"latch_time": (abs(found / expected - 1.0), LATCH_MOVING), **sound(scene, runs[0].summary)}
    return row(f"running machine, R {restitution:.3g}", runs[0].outcome, limits)


def _latch(run):
    """Time of the first chatter (s); nan if there is none."""
    times = run.events.loc[run.events["kind"] == "chatter", "t_s"]
    return float(times.iloc[0]) if len(times) else math.nan


def elastic(count, engine):
    """Use R of nearly 1: impacts keep their energy, pressing layers end with a named outcome, work is bounded."""
    rows = [_bounces(tolerance, engine) for tolerance in (1e-10, 1e-8, 1e-6)[:count]]
    rows += [_slow_accumulation(restitution, engine) for restitution in (0.995, 0.999, 0.9995)[:count]]
    supply = np.linspace(42.0, 78.0, max(count - len(rows), 2) // 2)
    return rows + [_pressing(restitution, float(f), engine) for restitution in (0.999, 1.0) for f in supply]


def _bounces(tolerance, engine):
    """Drop a ball elastically: each flight lasts 2 √(2h/g), and the impact speed stays constant."""
    flight = 2.0 * math.sqrt(2.0 * HEIGHT / GRAVITY)
    changes = {"contact.restitution": 1.0, "run.duration_s": (BOUNCES + 0.25) * flight}
    scene = with_engine(dropped_ball(0.5, HEIGHT, tolerance), engine).replace(changes)
    run = simulate(scene, keep="events")
    impacts = run.events[run.events["kind"] == "impact"]
    error = np.abs(impacts["t_s"] - flight * (np.arange(len(impacts)) + 0.5)).max() / flight
    drift = np.abs(impacts["gap_rate_after_m_per_s"] / math.sqrt(2.0 * GRAVITY * HEIGHT) - 1.0).max()
    limits = {
        "bounces": (abs(len(impacts) - BOUNCES), 0.0),
        "speed_drift": (float(drift), DRIFT * BOUNCES * tolerance),
        "phase_error": (float(error), DRIFT * BOUNCES**2 * tolerance),
    }
    return row(f"bounces, tolerance {tolerance:g}", run.outcome, limits | sound(scene, run.summary))


def _slow_accumulation(restitution, engine):
    """Follow all the impacts of a slow accumulation, as requested by a large limit on events."""
    ball = with_engine(dropped_ball(restitution, HEIGHT, TOLERANCE), engine)
    scene = ball.replace({"solver.max_events_per_period": 1_000_000})
    run = simulate(scene, keep="events")
    error = abs(_latch(run) / accumulation_time(restitution, HEIGHT) - 1.0)
    limits = {"latch_time": (error, LATCH_SLOW), "impacts_followed": (len(run.events), 1e6)}
    return row(f"ball, R {restitution:g}, followed", run.outcome, limits | sound(scene, run.summary))


def _pressing(restitution, supply, engine):
    """Run the paper's machine with pressing layers that hardly lose energy; R = 1 never accumulates."""
    changes = {"drive.supply_frequency_hz": supply, "contact.restitution": restitution}
    scene = with_engine(base(1e-6, 2.0), engine).replace(changes)
    summary = simulate(scene, keep="summary").summary
    limits = sound(scene, summary)
    turns = scene.run.duration_s * scene.speed_scale / TURN
    limits["restarts"] = (summary["restarts"], scene.solver.max_events_per_period * (turns + 1.0))
    if restitution == 1.0:
        limits["impact_loss_j"] = (abs(summary["impact_loss_j"]), 1e-12 * abs(summary["motor_work_j"]))
    return row(f"layers, R {restitution:g}, f_e {supply:.3g}", summary["outcome"], limits, allowed=NAMED)
