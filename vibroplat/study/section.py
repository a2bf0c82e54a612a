"""Analysis of a Poincaré section: whether the motion repeats, after how many turns, and how fast it settles."""

from __future__ import annotations

import numpy as np

from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import state_scales
from vibroplat.model.parameters import FloatArray
from vibroplat.observe.statistics import Measures, section_rows

#: Longest period, in turns of exciter 1, that is searched for while a motion settles and at its end.
MAX_PERIOD, LONGEST_PERIOD = 16, 64


def section_points(measures: Measures, scene: Scene) -> FloatArray:
    """Points of the Poincaré section in the scales of the scene, in chronological order.

    Returns
    -------
    array, shape (turns, 14)
        Coordinates and rates over their scales. The exciters' angles are replaced by the cosine and sine of the
        phase difference, so that whole turns do not matter.
    """
    states = section_rows(measures)["state"]
    points = states / state_scales(scene)
    phase = states[:, 3:5] @ scene.phase_weights
    points[:, 3], points[:, 4] = np.cos(phase), np.sin(phase)
    return points


def spreads(points: FloatArray, first: int = 1, last: int = MAX_PERIOD) -> FloatArray:
    """Spread for each number of turns n from the first to the last, shape (last − first + 1,).

    A spread is the largest distance, in any coordinate, between points that are a multiple of n turns apart, the last
    one fixed. It is inf if there are fewer than 2 n points.
    """
    found = np.full(last - first + 1, np.inf)
    turns = np.arange(first, min(last, len(points) // 2) + 1)
    if turns.size:
        backwards = points[::-1]
        same = np.arange(len(points)) % turns[:, np.newaxis]  # where the last point stands that each belongs to
        found[: turns.size] = np.abs(backwards - backwards[same]).max(axis=(1, 2))
    return found


def period(points: FloatArray, tolerance: float, first: int = 1, last: int = MAX_PERIOD) -> int:
    """Smallest number of turns after which the section repeats within a tolerance, or 0."""
    repeats = np.flatnonzero(spreads(points, first, last) <= tolerance)
    return int(repeats[0]) + first if repeats.size else 0
