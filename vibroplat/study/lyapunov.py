"""Largest Lyapunov exponent of a motion, by two trajectories compared on the Poincaré section."""

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

#: Distance of both trajectories after each comparison, in the scales of the scene.
DISTANCE = 1e-5
#: Local tolerance of both, small against their distance.
TOLERANCE = 1e-10
#: Turns of exciter 1 between comparisons, and comparisons of which the first are not counted.
TURNS, SKIPPED = 3, 8
#: Fewest and most comparisons that are counted, and how many more are made until the error is small enough.
LEAST, MOST, MORE = 96, 640, 32
#: The error is the largest of those from so many blocks of comparisons: few blocks are long against the memory of the
#: motion, many give their scatter well. Over 140 stretches of chaotic motion, exponents scatter by 0.9 … 1.3 times this
#: error; with 8 blocks of 32 comparisons it was 1.3 … 1.9 times, once 7 times.
BLOCKS = (4, 8, 16)
#: Errors that are small enough: as a share of the exponent, at which its sign is sure, and as growth a turn, below
#: which there is none: to double would take two thousand turns.
SHARE, PER_TURN = 1.0 / 6.0, 3e-4

_TURN = 2.0 * math.pi
_ANGLE = 3  # of exciter 1, the same for all points of the section


class Exponent(NamedTuple):
    """A Lyapunov exponent.

    Attributes
    ----------
    value, error
        Exponent and its standard error (1/s), from the scatter of blocks; nan where a trajectory ended early.
    turn
        Mean duration of a turn of exciter 1 (s).
    """

    value: float
    error: float
    turn: float

    @property
    def sign(self) -> int:
        """1 or −1 where it differs from 0 by more than three errors and by PER_TURN, otherwise 0."""
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
    """Estimate the largest Lyapunov exponent of the Poincaré map, to an error that follows from its own scatter.

    Two trajectories start close to each other, each goes through its own liftoffs and impacts, and both are
    compared where exciter 1 has made the same number of turns. Events shift in time between them, but by
    then both have passed the same ones: the jump of their difference at an event (the saltation matrix) is
    contained, and the neutral direction along the motion is not (Benettin et al. 1980; Müller 1995). Comparisons go
    on until the error is below a share of the exponent or PER_TURN, or there are as many as allowed.

    Parameters
    ----------
    scene
        What moves.
    state
        Full state on the attractor, shape (14,).
    direction
        First difference in the scales of the scene, shape (14,); all coordinates alike without it.
    turns
        Turns of exciter 1 after which the difference is measured and shortened again.
    least, most
        Fewest and most comparisons that are counted, no fewer than the most of BLOCKS.
    share
        Error that is small enough, as a share of the exponent.
    """
    scene = scene.replace({"solver.tolerance": min(TOLERANCE, scene.solver.tolerance)})
    lead = turns_later(scene, state, 1)
    if lead is None:
        return _NONE
    difference = np.ones(14) if direction is None else direction.copy()
    growth: list[float] = []
    seconds: list[float] = []
    while True:
        for _ in range(least + SKIPPED if not growth else MORE):
            compared = _compare(scene, lead[1], difference, turns)
            if compared is None:
                return _NONE
            lead, difference = compared
            distance = float(np.linalg.norm(difference))
            if distance == 0.0:  # both have met: what parted them is gone
                return Exponent(-math.inf, 0.0, lead[0] / turns)
            growth.append(math.log(distance / DISTANCE))
            seconds.append(lead[0])
        found = _estimate(np.array(growth[SKIPPED:]), np.array(seconds[SKIPPED:]), turns)
        enough = max(share * abs(found.value), PER_TURN / found.turn)
        if not found.error > enough or len(growth) - SKIPPED >= most:
            return found


_NONE = Exponent(math.nan, math.nan, math.nan)


def _compare(
    scene: Scene, state: FloatArray, difference: FloatArray, turns: int
) -> tuple[tuple[float, FloatArray], FloatArray] | None:
    """Carry a state and a neighbour on by some turns; time and state then, and what parts both."""
    scales = state_scales(scene)
    follower = state + DISTANCE * _admissible(difference, state) * scales
    follower[GAP] = max(follower[GAP], 0.0)
    ahead, behind = turns_later(scene, state, turns), turns_later(scene, follower, turns)
    if ahead is None or behind is None:
        return None
    difference = behind[1] - ahead[1]
    difference[3:5] -= _TURN * np.round(difference[3:5] / _TURN)  # angles may be folded on either side
    difference /= scales
    difference[_ANGLE] = 0.0
    return ahead, difference


def _estimate(growth: FloatArray, seconds: FloatArray, turns: int) -> Exponent:
    """Mean growth a second, and its standard error from the means of blocks."""
    errors = []
    for count in BLOCKS:
        blocks = np.array_split(growth, count), np.array_split(seconds, count)
        means = np.array([g.sum() / s.sum() for g, s in zip(*blocks, strict=True)])
        errors.append(float(means.std(ddof=1)) / math.sqrt(count))
    turn = float(seconds.sum() / (turns * len(seconds)))
    return Exponent(float(growth.sum() / seconds.sum()), max(errors), turn)


def turns_later(scene: Scene, state: FloatArray, turns: int) -> tuple[float, FloatArray] | None:
    """Time passed (s) and full state where exciter 1 completes so many turns after a state; None if it does not."""
    p = parameters(scene)
    turn = 2.0 * math.pi / scene.speed_scale
    with closing(make_engine(scene, p)) as engine:
        motion = Motion(scene, p, engine, state)
        if not motion.to_section(turns, (2 * turns + 2) * turn):
            return None
        found = motion.state
        found[3:5] -= _TURN * np.round(found[3:5] / _TURN)
        return motion.now, found


def _admissible(difference: FloatArray, state: FloatArray) -> FloatArray:
    """Keep a neighbour on the section, and in contact where the state is; of length 1."""
    difference = difference.copy()
    difference[_ANGLE] = 0.0
    if state[GAP] <= 0.0:
        difference[[GAP, GAP_RATE]] = 0.0
    return np.asarray(difference / np.linalg.norm(difference))
