"""How long a motion settles before it is measured.

Every 16 turns of exciter 1, the Poincaré section of the last 32 turns is compared with that of the 32 turns before. If
points n ≤ 16 turns apart draw together, the remaining distance D q/(1−q) follows from a geometric series, with the
ratio q of the later spread D to the earlier one. It must stay small in two consecutive checks, as a quick transient may
hide a slow one at the first. A motion that does not settle is followed for as long as the plan allows: long chaotic
transients end in periodic motion, and only time distinguishes them from chaos.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vibroplat.config.plans import SweepPlan
from vibroplat.config.scene import Scene
from vibroplat.model.parameters import FloatArray
from vibroplat.motion.motion import Motion
from vibroplat.observe.statistics import section_rows
from vibroplat.study.section import section_points, spreads

#: Turns of exciter 1 that are compared with as many before, and turns between two checks.
TURNS, BLOCK = 32, 16
#: Number of checks after which the next ones are LATE_BLOCK turns apart: what has not settled by then takes long.
EARLY_LOOKS, LATE_BLOCK = 40, 64
#: Largest spread, in units of the settling tolerance, from which the remaining distance is extrapolated.
NEAR = 30.0
#: Spread, in units of the solver's tolerance, that counts as noise of the solver.
NOISE = 30.0
#: Turns before the measured part over which the drift of the phase difference is taken.
WANDERING = 192


class Settling(NamedTuple):
    """How a motion settled.

    Attributes
    ----------
    how
        ``periodic``, ``maximum`` (not within the time that the plan allows), ``fixed`` (for a given time), or
        ``unfinished`` (it ended early).
    seconds
        How long it settled (s).
    period
        Turns of exciter 1 after which it repeats if it is periodic; otherwise 1.
    turn
        Duration of a turn at the end (s); 0 if it is not known.
    slip
        Change of the phase difference over the last WANDERING turns (rad) if the motion is not periodic.
    """

    how: str
    seconds: float
    period: int = 1
    turn: float = 0.0
    slip: float = 0.0

    @property
    def late(self) -> bool:
        """Whether the motion became periodic so late that it may only look periodic for a while."""
        return self.how == "periodic" and self.turn > 0.0 and self.seconds > EARLY_LOOKS * BLOCK * self.turn


def settle(motion: Motion, plan: SweepPlan, longest: float) -> Settling:
    """Advance a motion until it has settled as the plan says or has ended early.

    ``longest`` limits the settling with ``auto`` (s). It is counted from the beginning of the motion, so that one that
    turns out not to have settled can settle for the remaining time.
    """
    if plan.settle_s != "auto":
        motion.advance(plan.settle_s)
        return Settling("fixed" if motion.outcome == "ok" else "unfinished", motion.now)
    turn = 2.0 * math.pi / motion.scene.speed_scale
    points, times = np.empty((0, 14)), np.empty(0)
    phases: list[float] = []  # differences
    close = 0
    while (left := longest - motion.now) > 1e-9 * longest:
        block = BLOCK if motion.now < EARLY_LOOKS * BLOCK * turn else LATE_BLOCK
        part = motion.advance(min(block * turn, left))
        if motion.outcome != "ok":
            return Settling("unfinished", motion.now)
        points = np.concatenate([points, section_points(part.measures, motion.scene)])[-2 * TURNS :]
        times = np.concatenate([times, section_rows(part.measures)["t"]])[-2 * TURNS :]
        phases = [*phases, float(motion.state[3:5] @ motion.scene.phase_weights)][-max(WANDERING // block, 1) - 1 :]
        if len(points) < 2 * TURNS:
            continue
        was_close = close
        close = draws_together(points, plan.settle_tolerance, noise(motion.scene, plan))
        if close and was_close:
            return Settling("periodic", motion.now, close, float(times[-1] - times[TURNS]) / (TURNS - 1))
    return Settling("maximum", motion.now, slip=phases[-1] - phases[0] if phases else 0.0)


def noise(scene: Scene, plan: SweepPlan) -> float:
    """Return the spread of the section that counts as noise of the solver, in the scales of the scene."""
    return min(NOISE * scene.solver.tolerance, plan.settle_tolerance)


def draws_together(points: FloatArray, tolerance: float, noise: float) -> int:
    """Return the shortest period (turns) to which the remaining distance is within the tolerance; 0 if there is none.

    The second half of the points, shape (turns, 14), is compared with the first.
    """
    half = len(points) // 2
    now, before = spreads(points[-half:]), spreads(points[-2 * half : -half])
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = now / before
        left = np.where(ratio < 1.0, now * ratio / (1.0 - ratio), np.inf)
    near = np.flatnonzero((now <= noise) | ((now <= NEAR * tolerance) & (left <= tolerance)))
    return int(near[0]) + 1 if near.size else 0
