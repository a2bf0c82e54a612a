"""How long a motion settles before it is measured.

Every 16 turns of exciter 1, the Poincaré section of the last 32 turns is compared with that of the 32 turns before.
If the spread D of points n turns apart shrinks by a factor q, for some n ≤ 16, a geometric series gives the remaining
distance: D q/(1−q). It must be small in two consecutive checks, because a fast transient can hide a slow one in the
first. A motion that does not settle is followed to the end of the plan: long chaotic transients may end in periodic
motion, and only time can tell them from chaos.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vibroplat.flow.motion import Motion
from vibroplat.model.parameters import FloatArray
from vibroplat.observe import statistics as m
from vibroplat.observe.statistics import section_rows
from vibroplat.plan import Sweep
from vibroplat.scene import Scene
from vibroplat.study.section import section_points, spreads

#: Number of turns of exciter 1 that are compared with as many before, and number of turns between two checks.
TURNS, BLOCK = 32, 16
#: After this many checks, the next ones come only every LATE_BLOCK turns: settling is slow by then.
EARLY_LOOKS, LATE_BLOCK = 40, 64
#: Largest spread, over the settling tolerance, from which the remaining distance is extrapolated.
NEAR = 30.0
#: Spread, over the solver's tolerance, that counts as the solver's noise.
NOISE = 30.0
#: Turns before the measured part over which the drift of the phase difference is measured.
WANDERING = 192


class Settling(NamedTuple):
    """How a motion settled.

    Attributes
    ----------
    how
        ``periodic``, ``maximum`` (not until the end of the plan), ``fixed``, ``unfinished`` (ended early).
    seconds
        Settling time.
    period
        Number of turns of exciter 1 after which a periodic motion repeats; otherwise 1.
    turn
        Duration of a turn at the end (s); 0 if unknown.
    slip
        Change of the phase difference over the last WANDERING turns (rad), if the motion is not periodic.
    """

    how: str
    seconds: float
    period: int = 1
    turn: float = 0.0
    slip: float = 0.0

    @property
    def late(self) -> bool:
        """Whether the motion became periodic late, so that it may look periodic only for a while."""
        return self.how == "periodic" and self.turn > 0.0 and self.seconds > EARLY_LOOKS * BLOCK * self.turn


def settle(motion: Motion, plan: Sweep, longest: float) -> Settling:
    """Advance a motion until it has settled as planned, or ended early.

    ``longest`` is the longest settling time with ``auto`` (s). It counts from the beginning of the motion, so that a
    motion that only looked settled can continue to settle.
    """
    if plan.settle_s != "auto":
        motion.go_on(plan.settle_s)
        return Settling("fixed" if motion.outcome == "ok" else "unfinished", motion.now)
    turn = 2.0 * math.pi / motion.scene.speed_scale
    points, times = np.empty((0, 14)), np.empty(0)
    sums: list[float] = []  # of both exciter angles
    close = 0
    while (left := longest - motion.now) > 1e-9 * longest:
        block = BLOCK if motion.now < EARLY_LOOKS * BLOCK * turn else LATE_BLOCK
        part = motion.go_on(min(block * turn, left))
        if motion.outcome != "ok":
            return Settling("unfinished", motion.now)
        points = np.concatenate([points, section_points(part.measures, motion.scene)])[-2 * TURNS :]
        times = np.concatenate([times, section_rows(part.measures)[:, m.SECTION_TIME]])[-2 * TURNS :]
        sums = [*sums, float(motion.state[3:5].sum())][-max(WANDERING // block, 1) - 1 :]
        if len(points) < 2 * TURNS:
            continue
        was_close = close
        close = draws_together(points, plan.settle_tolerance, noise(motion.scene, plan))
        if close and was_close:
            return Settling("periodic", motion.now, close, float(times[-1] - times[TURNS]) / (TURNS - 1))
    return Settling("maximum", motion.now, slip=sums[-1] - sums[0] if sums else 0.0)


def noise(scene: Scene, plan: Sweep) -> float:
    """Spread of the section due to the solver's noise, in the scales of the scene."""
    return min(NOISE * scene.solver.tolerance, plan.settle_tolerance)


def draws_together(points: FloatArray, tolerance: float, noise: float) -> int:
    """Return the shortest period from which the remaining distance is within the tolerance, or 0.

    The second half of the points is compared with the first.
    """
    half = len(points) // 2
    now, before = spreads(points[-half:]), spreads(points[-2 * half : -half])
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = now / before
        left = np.where(ratio < 1.0, now * ratio / (1.0 - ratio), np.inf)
    near = np.flatnonzero((now <= noise) | ((now <= NEAR * tolerance) & (left <= tolerance)))
    return int(near[0]) + 1 if near.size else 0
