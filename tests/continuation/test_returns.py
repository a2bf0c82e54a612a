"""Which returns of a section that does not repeat are tried."""

from itertools import pairwise

import numpy as np

from vibroplat.continuation.returns import NEAREST_COUNT, RELATIVE_COUNT, near_returns

LONGEST = 8


def column(heights):
    return np.asarray(heights)[:, np.newaxis]


def test_returns_after_the_same_turns_are_tried_apart():
    """A section leaves a point, and is near another one for a while."""
    heights = [*(3.0 + 1e-3 * 2.0 ** np.arange(12)), *np.arange(50.0, 500.0, 30.0), *(10.0 + 1e-2 * np.arange(9))]
    tried = list(near_returns(column(heights), LONGEST))
    assert tried[0] == (1, 0)
    ones = sorted(place for turns, place in tried if turns == 1)
    assert len(tried) == len(set(tried))
    assert all(abs(heights[b] - heights[a]) > 0.5 * abs(heights[b + 1] - heights[b]) for a, b in pairwise(ones))


def test_few_of_the_returns_after_many_turns_are_tried():
    """Chaos that converges to an orbit of 19 turns passes near it; beyond 24 turns there are too many returns."""
    heights = np.random.default_rng(0).uniform(0.0, 1e6, 400)
    for turns, place in ((19, 100), (23, 200), (22, 300), (30, 150), (5, 250)):
        heights[place + turns] = heights[place] + 0.01 * turns
    assert list(near_returns(column(heights), LONGEST)) == [(5, 250), (19, 100), (22, 300)]


def test_returns_near_an_orbit_of_two_turns_do_not_hide_one_of_six():
    """All returns to two points are nearer than that after six turns, but only this one is no return after two."""
    away = 1e-3 * 1.3 ** np.arange(24)
    two = 10.0 + 5.0 * np.tile([1.0, -1.0], 12) + away
    six = [30.0, 41.0, 55.0, 33.0, 44.0, 59.0]
    heights = [*two, *np.arange(100.0, 500.0, 30.0), *six, *(height + 0.5 for height in six)]
    tried = list(near_returns(column(heights), LONGEST))
    assert any(turns == 6 and place >= 24 for turns, place in tried[: NEAREST_COUNT + 8 * RELATIVE_COUNT])


def test_returns_that_a_known_orbit_explains_are_not_tried():
    """Motion leaves a point from side to side."""
    leaving = column(1e-5 * (-2.0) ** np.arange(17))
    known, tried = [], []
    for trial in near_returns(leaving, LONGEST, known):
        tried.append(trial)
        known.append((1, column([0.0])))
    assert tried == [(1, 0)]
    assert len(list(near_returns(leaving, LONGEST))) == NEAREST_COUNT
