"""Largest Lyapunov exponent of a motion, from two trajectories compared on the Poincaré section."""

from __future__ import annotations

import math
from contextlib import closing
from typing import NamedTuple

import numpy as np

from vibroplat.flow.motion import Motion
from vibroplat.hybrid.scales import state_scales
from vibroplat.integrate.choice import make_engine
from vibroplat.model.parameters import FloatArray, parameters
from vibroplat.model.systems import GAP, GAP_RATE
from vibroplat.scene import Scene

#: Distance to which the trajectories are reset after each comparison, in the scales of the scene.
DISTANCE = 1e-5
#: Local tolerance of both trajectories, small against their distance.
TOLERANCE = 1e-10
#: Number of turns of exciter 1 between comparisons, and number of first comparisons that are not counted.
TURNS, SKIPPED = 3, 8
#: Smallest and largest number of counted comparisons, and how many are added while the error is too large.
LEAST, MOST, MORE = 96, 640, 32
#: Numbers of blocks of comparisons. The error is the largest that any of them gives: few blocks are long against the
#: memory of the motion, many blocks give the scatter accurately. Over 140 stretches of chaotic motion, exponents
#: scatter by 0.9 … 1.3 times this error; with 8 blocks of 32 comparisons it was 1.3 … 1.9 times, once 7 times.
BLOCKS = (4, 8, 16)
#: Errors that are small enough: relative to the exponent, so that its sign is clear, and as growth per turn, which
#: would need two thousand turns to double a distance.
SHARE, PER_TURN = 1.0 / 6.0, 3e-4

_TURN = 2.0 * math.pi
_ANGLE = 3  # of exciter 1, the same for all points of the section


class Exponent(NamedTuple):
    """A Lyapunov exponent.

    Attributes
    ----------
    value, error
        Exponent and its standard error (1/s), from the scatter of blocks; nan if a trajectory ended early.
    turn
        Mean duration of a turn of exciter 1 (s).
    """

    value: float
    error: float
    turn: float

    @property
    def sign(self) -> int:
        """1 or −1 if it differs from 0 by more than three errors and by PER_TURN, otherwise 0."""
        clear = abs(self.value) > max(3.0 * self.error, PER_TURN / self.turn)
        return int(math.copysign(1.0, self.value)) if clear else 0


def largest_exponent(
    scene: Scene,
    state: FloatArray,
    direction: FloatArray | None = None,
    *,
    turns: int = TURNS,
    least: int = LEAST,
    most: int = MOST,
    share: float = SHARE,
) -> Exponent:
    """Estimate the largest Lyapunov exponent of the Poincaré map, and its error from its own scatter.

    Two trajectories start close to each other and have their own liftoffs and impacts. They are compared after the
    same number of turns of exciter 1. Their events happen at slightly different times, but by then both have passed
    the same events. The comparison thus includes the jump of their difference at an event (the saltation matrix) and
    excludes the neutral direction along the motion (Benettin et al. 1980; Müller 1995). Comparisons are added until
    the error is below a share of the exponent or below PER_TURN, or until the largest number is reached.

    Parameters
    ----------
    scene
        The scene.
    state
        Full state on the attractor, shape (14,).
    direction
        Initial difference in the scales of the scene, shape (14,). Default: equal in all coordinates.
    turns
        Number of turns of exciter 1 after which the difference is measured and rescaled.
    least, most
        Smallest and largest number of counted comparisons; at least the largest of BLOCKS.
    share
        Error that is small enough, relative to the exponent.
    """
    scene = scene.replace({"solver.tolerance": min(TOLERANCE, scene.solver.tolerance)})
    p = parameters(scene)
    with closing(make_engine(scene, p)) as engine:
        return _exponent(Motion(scene, p, engine, state), direction, turns, least, most, share)


def _exponent(
    motion: Motion, direction: FloatArray | None, turns: int, least: int, most: int, share: float
) -> Exponent:
    """Estimate the exponent of a motion from its state on, as :func:`largest_exponent` says."""
    lead = turns_later(motion, motion.state, 1)
    if lead is None:
        return _NONE
    difference = np.ones(14) if direction is None else direction.copy()
    growth: list[float] = []
    seconds: list[float] = []
    while True:
        for _ in range(least + SKIPPED if not growth else MORE):
            compared = _compare(motion, lead[1], difference, turns)
            if compared is None:
                return _NONE
            lead, difference = compared
            distance = float(np.linalg.norm(difference))
            if distance == 0.0:  # the trajectories have merged
                return Exponent(-math.inf, 0.0, lead[0] / turns)
            growth.append(math.log(distance / DISTANCE))
            seconds.append(lead[0])
        found = _estimate(np.array(growth[SKIPPED:]), np.array(seconds[SKIPPED:]), turns)
        enough = max(share * abs(found.value), PER_TURN / found.turn)
        if not found.error > enough or len(growth) - SKIPPED >= most:
            return found


_NONE = Exponent(math.nan, math.nan, math.nan)


def _compare(
    motion: Motion, state: FloatArray, difference: FloatArray, turns: int
) -> tuple[tuple[float, FloatArray], FloatArray] | None:
    """Advance a state and a neighbour by some turns; return the time passed and the new state, and the difference."""
    scales = state_scales(motion.scene)
    follower = state + DISTANCE * _admissible(difference, state) * scales
    follower[GAP] = max(follower[GAP], 0.0)
    ahead, behind = turns_later(motion, state, turns), turns_later(motion, follower, turns)
    if ahead is None or behind is None:
        return None
    difference = behind[1] - ahead[1]
    difference[3:5] -= _TURN * np.round(difference[3:5] / _TURN)  # angles may differ by whole turns
    difference /= scales
    difference[_ANGLE] = 0.0
    return ahead, difference


def _estimate(growth: FloatArray, seconds: FloatArray, turns: int) -> Exponent:
    """Return the mean growth per second and its standard error from the means of blocks."""
    errors = []
    for count in BLOCKS:
        blocks = np.array_split(growth, count), np.array_split(seconds, count)
        means = np.array([g.sum() / s.sum() for g, s in zip(*blocks, strict=True)])
        errors.append(float(means.std(ddof=1)) / math.sqrt(count))
    turn = float(seconds.sum() / (turns * len(seconds)))
    return Exponent(float(growth.sum() / seconds.sum()), max(errors), turn)


def turns_later(motion: Motion, state: FloatArray, turns: int) -> tuple[float, FloatArray] | None:
    """Time passed (s) and full state where exciter 1 completes so many turns after a state; None if it does not.

    The motion begins again at that state.
    """
    motion.begin_again(state)
    if not motion.to_section(turns, (2 * turns + 2) * _TURN / motion.scene.speed_scale):
        return None
    found = motion.state
    found[3:5] -= _TURN * np.round(found[3:5] / _TURN)
    return motion.now, found


def _admissible(difference: FloatArray, state: FloatArray) -> FloatArray:
    """Return a difference of length 1 that keeps a neighbour on the section, and in contact if the state is."""
    difference = difference.copy()
    difference[_ANGLE] = 0.0
    if state[GAP] <= 0.0:
        difference[[GAP, GAP_RATE]] = 0.0
    return np.asarray(difference / np.linalg.norm(difference))
