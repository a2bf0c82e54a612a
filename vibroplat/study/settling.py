"""How long a motion settles before it is measured.

Every 16 turns of exciter 1 the Poincaré section of the last 32 is compared with that of the 32 before. Where
for some n ≤ 16 the points, taken n turns apart, draw together, what is left of the way follows as a geometric
series of the ratio q of both spreads D: D q/(1−q). It must be little at two looks one after the other, for at the
first a quick transient may hide a slow one. A motion that will not repeat is known by spreads that neither fall nor
rise and statistics without a trend, those of the phase difference and of x and φ among them: near antiphase it is
only there that a slow escape shows.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from vibroplat.physics.parameters import FloatArray
from vibroplat.plan import Sweep
from vibroplat.scene import Scene
from vibroplat.solver import measures as m
from vibroplat.solver.measures import section_rows
from vibroplat.solver.motion import Motion
from vibroplat.solver.scales import state_scales
from vibroplat.solver.summary import measured
from vibroplat.study.section import section_points, spreads

#: Turns of exciter 1 that are compared with as many before, and those between two looks.
TURNS, BLOCK = 32, 16
#: Largest spread, over the settling tolerance, from which the rest of the way is extrapolated.
NEAR = 30.0
#: Spread, over the solver's tolerance, that is its noise.
NOISE = 30.0
#: Looks of which the first and the second half are compared where no period shows.
WINDOW = 12
#: Spreads of the second half over those of the first, between which and whose inverse they neither fall nor rise.
LEVEL = 0.75
#: Difference of the halves' means that is no trend, in its standard errors, and as a share of the mean.
STANDARD_ERRORS, TREND = 3.0, 3e-3


class Settling(NamedTuple):
    """How a motion settled.

    Attributes
    ----------
    how
        ``periodic``, ``non-periodic``, ``maximum`` (neither until then), ``fixed``, ``unfinished`` (ended early).
    seconds
        How long.
    period
        After how many turns of exciter 1 it repeats, where it is periodic; otherwise 1.
    turn
        Duration of a turn at the end (s); 0 where it is not known.
    slip
        Change of the phase difference over the looks that showed no period (rad).
    """

    how: str
    seconds: float
    period: int = 1
    turn: float = 0.0
    slip: float = 0.0


def settle(motion: Motion, plan: Sweep) -> Settling:
    """Carry a motion on until it has settled as the plan says, or has ended early."""
    began = motion.now
    if plan.settle_s != "auto":
        motion.go_on(plan.settle_s)
        return Settling("fixed" if motion.outcome == "ok" else "unfinished", motion.now - began)
    block = BLOCK * 2.0 * math.pi / motion.scene.speed_scale
    points, times = np.empty((0, 14)), np.empty(0)
    falls: list[float] = []
    statistics: list[list[float]] = []
    sums: list[float] = []  # of both exciter angles
    noise = min(NOISE * motion.scene.solver.tolerance, plan.settle_tolerance)
    close = 0
    while (left := plan.max_settle_s - (motion.now - began)) > 1e-9 * plan.max_settle_s:
        part = motion.go_on(min(block, left))
        if motion.outcome != "ok":
            return Settling("unfinished", motion.now - began)
        points = np.concatenate([points, section_points(part.measures, motion.scene)])[-2 * TURNS :]
        times = np.concatenate([times, section_rows(part.measures)[:, m.SECTION_TIME]])[-2 * TURNS :]
        if len(points) < 2 * TURNS:
            continue
        now, before = spreads(points[TURNS:]), spreads(points[:TURNS])
        was_close = close
        close = _draws_together(now, before, plan.settle_tolerance, noise)
        if close and was_close:
            return Settling("periodic", motion.now - began, close, float(times[-1] - times[TURNS]) / (TURNS - 1))
        falls.append(float(now.min()))
        statistics.append(_watched(measured(part), motion.scene))
        sums = [*sums, float(motion.state[3:5].sum())][-WINDOW:]
        if falls[-1] > plan.period_tolerance and _goes_on(falls, np.array(statistics), plan.settle_tolerance):
            return Settling("non-periodic", motion.now - began, slip=sums[-1] - sums[0])
    return Settling("maximum", motion.now - began, slip=sums[-1] - sums[0] if sums else 0.0)


def _draws_together(now: FloatArray, before: FloatArray, tolerance: float, noise: float) -> int:
    """Return the shortest period to which all that is left of the way is within the tolerance, or 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = now / before
        left = np.where(ratio < 1.0, now * ratio / (1.0 - ratio), np.inf)
    near = np.flatnonzero((now <= noise) | ((now <= NEAR * tolerance) & (left <= tolerance)))
    return int(near[0]) + 1 if near.size else 0


def _watched(summary: dict[str, Any], scene: Scene) -> list[float]:
    """Return the statistics of a stretch in which a trend may show, in the scales of the scene."""
    scales = state_scales(scene)
    lengths = [(summary[name] or 0.0) / scales[i] for i, name in enumerate(("rms_x_m", "rms_y_m", "rms_phi_rad"))]
    phase, frequency = summary["phase_difference_rad"] or 0.0, summary["excitation_frequency_hz"] or 0.0
    turning = [math.cos(phase), math.sin(phase), summary["phase_coherence"] or 0.0]
    return [*lengths, *turning, frequency * 2.0 * math.pi / scene.speed_scale, summary["flight_fraction"] or 0.0]


def _goes_on(falls: list[float], statistics: FloatArray, tolerance: float) -> bool:
    """Whether spreads neither fall nor rise and statistics show no trend over the last looks."""
    if len(falls) < WINDOW:
        return False
    half = WINDOW // 2
    change = np.median(falls[-half:]) / np.median(falls[-WINDOW:-half])
    if not LEVEL <= change <= 1.0 / LEVEL:
        return False
    early, late = statistics[-WINDOW:-half], statistics[-half:]
    trend = np.abs(late.mean(axis=0) - early.mean(axis=0))
    error = np.sqrt((early.var(axis=0, ddof=1) + late.var(axis=0, ddof=1)) / half)
    return bool((trend <= STANDARD_ERRORS * error + TREND * np.abs(late.mean(axis=0)) + tolerance).all())
