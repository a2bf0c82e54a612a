"""Checks of the stability suite."""

import math

import numpy as np
from common.known import motion_of

from vibroplat.hybrid.state import FORCE_ERROR, force_spread, state_scales
from vibroplat.model.systems import GAP
from vibroplat.motion.motion import OUTCOMES
from vibroplat.report.summary import INACCURATE, measure

#: Largest residuals of energy and vertical momentum over tolerance and steps: each step may be off by about the
#: tolerance, and the errors may add up. In a campaign of 10 000 random scenes the largest of energy is 2.8, the median
#: 6e-4; in one of 7300 shorter ones the largest is 5.04. The scale of momentum is the impulse of the springs, which the
#: error of every step changes.
RESIDUAL = 10.0
#: Largest gap and contact force below zero, in units of their scales, over the tolerance.
GAP_BELOW, PULL = 1.0, 10.0
#: Named outcomes.
NAMED = frozenset((*OUTCOMES.values(), INACCURATE))


def sound(scene, summary):
    """Limits that hold for every run, (value, largest) by name: gap, contact force, energy and momentum.

    A motion that diverges where the model breaks down need not satisfy the balances, and one that is called inaccurate
    is known not to.
    """
    tolerance, steps = scene.solver.tolerance, max(summary["steps"], 1)
    limits = {}
    if summary["outcome"] not in ("outside-model-validity", INACCURATE):
        # one that hardly turns has less energy than the tolerance is meant for, that of rotors in step
        spinning = max(e.rotor_inertia_kg_m2 for e in scene.exciter_pair) * scene.speed_scale**2
        residual, left = summary["energy_residual"], abs(summary["energy_residual_j"])
        most = max(1.0, 0.5 * spinning * residual / left) if left > 0.0 else 1.0
        limits["energy_residual"] = (residual, most * RESIDUAL * tolerance * steps)
        if scene.contact.impact_law != "printed":  # which does not keep the upper layer's momentum
            # one that hardly moves has less momentum than the tolerance is meant for, that of the scene's scales
            usual = scene.body.mass * scene.length_scale * scene.speed_scale
            residual, left = summary["momentum_residual"], abs(summary["momentum_residual_n_s"])
            most = max(1.0, usual * residual / left) if left > 0.0 else 1.0
            limits["momentum_residual"] = (residual, most * RESIDUAL * tolerance * steps)
    if scene.has_contact:
        below = abs(min(summary["gap_min_m"], 0.0)) / state_scales(scene)[GAP]
        limits["gap_below"] = (below, GAP_BELOW * tolerance)
        allowed = min(PULL * tolerance * force_spread(scene), FORCE_ERROR * scene.force_scale)
        limits["pull_n"] = (summary["contact_pull_n"] or 0.0, allowed)
    return limits


def with_engine(scene, engine):
    return scene.replace({"solver.engine": engine})


def steady(scene, settle, seconds):
    """Let a scene settle (s) and then measure (s); return the measures with outcome and steps."""
    with motion_of(scene) as motion:
        motion.advance(settle)
        part = motion.advance(seconds)
        work = {"outcome": motion.outcome, "detail": motion.detail, "steps": motion.engine.work["steps"] or 0}
    return measure(part, scene) | work


def row(name, outcome, limits, *, allowed=("ok",)):
    """Make the row of a scene: its values, the one closest to its limit, and those beyond their limits.

    A value of nan exceeds its limit, and so does an outcome that is not allowed.
    """
    shares = {key: _share(*limit) for key, limit in limits.items()}
    worst = max(shares, key=shares.get, default="")
    failed = [f"{key} {limits[key][0]}, allowed {limits[key][1]:.3g}" for key, share in shares.items() if share > 1]
    if outcome not in allowed:
        failed.insert(0, f"outcome {outcome}")
    values = {key: value for key, (value, _) in limits.items()}
    found = {"scene": name, "outcome": outcome, "worst": worst, "share": shares.get(worst, 0.0)}
    return found | values | {"failed": "; ".join(failed)}


def _share(value, limit):
    if value is None or not math.isfinite(value):
        return math.inf
    return value / limit if limit > 0.0 else (math.inf if value > 0.0 else 0.0)


def off(found, expected):
    """Relative difference of two values; the found value itself if the expected one is 0."""
    if found is None or expected is None:
        return 0.0 if found == expected else math.nan
    return abs(found / expected - 1.0) if expected else abs(found)


def spread_over(items, count):
    """Choose evenly spaced items of a list."""
    return [items[i] for i in np.unique(np.linspace(0, len(items) - 1, min(count, len(items))).astype(int))]
