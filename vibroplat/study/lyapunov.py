"""Largest Lyapunov exponent of a motion, by two trajectories compared on the Poincaré section."""

from __future__ import annotations

import math
from contextlib import closing

import numpy as np

from vibroplat.physics.parameters import FloatArray, parameters
from vibroplat.physics.systems import GAP, GAP_RATE
from vibroplat.scene import Scene
from vibroplat.solver import measures as m
from vibroplat.solver.engines import make_engine
from vibroplat.solver.motion import Motion
from vibroplat.solver.scales import state_scales

#: Distance of both trajectories after each comparison, in the scales of the scene.
DISTANCE = 1e-5
#: Local tolerance of both, small against their distance.
TOLERANCE = 1e-10
#: Turns of exciter 1 between comparisons, and comparisons of which the first are not counted.
TURNS, COMPARISONS, SKIPPED = 3, 40, 8

_TURN = 2.0 * math.pi
_ANGLE = 3  # of exciter 1, the same for all points of the section


def largest_exponent(
    scene: Scene,
    state: FloatArray,
    direction: FloatArray | None = None,
    *,
    comparisons: int = COMPARISONS,
    turns: int = TURNS,
) -> float:
    """Estimate the largest Lyapunov exponent (1/s) of the Poincaré map.

    Two trajectories start close to each other, each goes through its own liftoffs and impacts, and both are
    compared where exciter 1 has made the same number of turns. Events shift in time between them, but by
    then both have passed the same ones: the jump of their difference at an event (the saltation matrix) is
    contained, and the neutral direction along the motion is not (Benettin et al. 1980; Müller 1995).

    Parameters
    ----------
    scene
        What moves.
    state
        Full state on the attractor, shape (14,).
    direction
        First difference in the scales of the scene, shape (14,); all coordinates alike without it.
    comparisons, turns
        How often, and after how many turns, the difference is measured and shortened again.

    Returns
    -------
    float
        nan where a trajectory ends early, or the exciter stands still.
    """
    scene = scene.replace({"solver.tolerance": min(TOLERANCE, scene.solver.tolerance)})
    scales = state_scales(scene)
    lead = turns_later(scene, state, 1)
    if lead is None:
        return math.nan
    difference = np.ones(14) if direction is None else direction.copy()
    growth = seconds = 0.0
    for k in range(comparisons):
        difference = _admissible(difference, lead[1])
        follower = lead[1] + DISTANCE * difference * scales
        follower[GAP] = max(follower[GAP], 0.0)
        ahead, behind = turns_later(scene, lead[1], turns), turns_later(scene, follower, turns)
        if ahead is None or behind is None:
            return math.nan
        difference = behind[1] - ahead[1]
        difference[3:5] -= _TURN * np.round(difference[3:5] / _TURN)  # angles may be folded on either side
        difference /= scales
        difference[_ANGLE] = 0.0
        distance = float(np.linalg.norm(difference))
        if distance == 0.0:
            return -math.inf
        if k >= SKIPPED:
            growth += math.log(distance / DISTANCE)
            seconds += ahead[0]
        difference /= distance
        lead = ahead
    return growth / seconds


def turns_later(scene: Scene, state: FloatArray, turns: int) -> tuple[float, FloatArray] | None:
    """Time passed (s) and full state where exciter 1 completes so many turns after a state; None if it does not."""
    p = parameters(scene)
    turn = 2.0 * math.pi / scene.speed_scale
    with closing(make_engine(scene, p)) as engine:
        motion = Motion(scene, p, engine, state)
        # a state on the section starts at a whole turn, which may or may not be counted: leave it first
        motion.go_on(0.25 * turn)
        left, length = turns, turns * turn
        for _ in range(4 * turns + 4):
            part = motion.go_on(length)
            if motion.outcome != "ok":
                return None
            passed = int(part.measures.marks[m.TURNS])
            if passed >= left:
                row = part.measures.section[left - 1]
                found = row[m.SECTION_STATE : m.SECTION_FORCE].copy()
                found[3:5] -= _TURN * np.round(found[3:5] / _TURN)
                return float(row[m.SECTION_TIME]), found
            left, length = left - passed, 0.25 * turn
    return None


def _admissible(difference: FloatArray, state: FloatArray) -> FloatArray:
    """Keep a neighbour on the section, and in contact where the state is; of length 1."""
    difference = difference.copy()
    difference[_ANGLE] = 0.0
    if state[GAP] <= 0.0:
        difference[[GAP, GAP_RATE]] = 0.0
    return np.asarray(difference / np.linalg.norm(difference))
