"""Which returns of a section that does not repeat are tried, and for how long."""

from contextlib import closing
from itertools import pairwise

import numpy as np
import pytest

from vibroplat import load_config
from vibroplat.config.coordinates import TURN
from vibroplat.continuation.newton import NoConvergenceError, Problem, correct, fixed_border
from vibroplat.continuation.orbit_detection import MIN_SEPARATION, NEAREST_COUNT, RELATIVE_COUNT, near_returns
from vibroplat.continuation.shooting import Shooter
from vibroplat.observe.section import is_apart

from .helpers import MACHINE

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


def test_returns_that_a_known_orbit_explains_are_not_apart_from_it():
    """Motion leaves a point from side to side."""
    leaving = column(1e-5 * (-2.0) ** np.arange(17))
    tried = list(near_returns(leaving, LONGEST))
    assert len(tried) == NEAREST_COUNT
    for turns, place in tried:
        distance = float(abs(leaving[place + turns] - leaving[place])[0])
        least = MIN_SEPARATION * distance
        assert not is_apart(leaving[place], column([0.0]), least)
        assert is_apart(leaving[place], column([0.0, distance]) + leaving[place] + 0.6 * distance, least)


def test_returns_from_which_motion_leaves_at_once_are_not_tried_for_their_turns():
    """The nearest returns are: nothing is known of what is farther than all of them."""
    heights = np.arange(0.0, 3000.0, 10.0)
    for place, growth in ((20, 2.0), (60, 4.0)):
        heights[[place, place + 5]] = place, place + 0.5
        heights[place + 10] = place + 0.5 + 0.5 * growth
    near = [(turns, 100 + 20 * turns) for turns in range(1, NEAREST_COUNT + 1)]
    for turns, place in near:
        heights[place + turns] = heights[place] + 0.01
    tried = list(near_returns(column(heights), LONGEST))
    assert sorted(tried[:NEAREST_COUNT]) == near
    assert (5, 20) in tried
    assert (5, 60) not in tried


def test_newtons_method_is_given_up_by_the_course_of_its_residuals():
    """A limit below the first residual after a step; one above it changes nothing."""
    scene = load_config(MACHINE, {"solver.engine": "taylor", "drive.supply_frequency_hz": 50.0})
    with closing(Shooter(scene)) as shooter:
        shooter.motion.to_section(20, 40.0 * TURN / scene.speed_scale)
        state = shooter.motion.state
        state[3:5] -= TURN * np.round(state[3:5] / TURN)
        problem = Problem(shooter, (1, -1))
        chart = problem.chart(state)
        guess = chart, chart.pack(state, TURN / scene.speed_scale), fixed_border(chart)
        found = correct(problem, *guess)
        fall = found.residuals[1] / found.residuals[0]
        kept = correct(problem, *guess, limits=((), (2.0 * fall, 1.0)))
        with pytest.raises(NoConvergenceError) as error:
            correct(problem, *guess, limits=((), (0.5 * fall, 1.0)))
    assert kept.residuals == found.residuals
    assert error.value.residuals == tuple(found.residuals[:2])
