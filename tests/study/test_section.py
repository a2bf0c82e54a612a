"""What is read off a Poincaré section: points in scales, spreads, periods."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vibroplat import Scene
from vibroplat.hybrid.state import state_scales
from vibroplat.observe import statistics as m
from vibroplat.observe.statistics import no_measures
from vibroplat.study.section import MAX_PERIOD, period, section_points, spreads

GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


def repeating(n, turns=64, coordinate=1):
    """A section that repeats after n turns, its n points 1 apart in one coordinate."""
    points = np.full((turns, 14), 0.3)
    points[:, coordinate] += np.arange(turns) % n
    return points


def section_of(states):
    """Points of a section that has seen these states, one a turn."""
    ms = no_measures(0.0)
    for turn, state in enumerate(states):
        ms.section["state"][turn % m.SECTION_ROWS] = state
    ms.marks["turns"] = len(states)
    return section_points(ms, Scene())


# -- period ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("coordinate", [0, 6, 13])
@pytest.mark.parametrize("n", [1, 2, 3, 12, 16])
def test_period_is_the_smallest_number_of_turns(n, coordinate):
    assert period(repeating(n, coordinate=coordinate), 1e-9) == n


@pytest.mark.parametrize("n", [1, 2, 5, 16])
def test_period_needs_each_point_twice(n):
    assert period(repeating(n, 2 * n), 1e-9) == n
    assert period(repeating(n, 2 * n - 1), 1e-9) == 0


@pytest.mark.parametrize("turns", [0, 1])
def test_no_period_of_too_few_points(turns):
    assert period(np.zeros((turns, 14)), 1.0) == 0


def test_periods_beyond_the_longest_are_not_found():
    assert MAX_PERIOD == 16
    assert period(repeating(17, 200), 1e-9) == 0


def test_quasi_periodic_section_has_no_period():
    points = np.zeros((64, 14))
    points[:, 1] = np.cos(2.0 * math.pi * GOLDEN * np.arange(64))
    assert period(points, 0.05) == 0


def test_one_coordinate_that_does_not_repeat_is_enough():
    points = repeating(2)
    points[:, 12] += GOLDEN * np.arange(64) % 1.0
    assert period(points, 0.1) == 0


@pytest.mark.parametrize(("tolerance", "found"), [(0.009, 2), (0.011, 1)])
def test_period_within_the_tolerance(tolerance, found):
    """A doubling by a hundredth is period 1 to who does not look closer."""
    points = repeating(1)
    points[::2, 1] += 0.01
    assert period(points, tolerance) == found


def test_slow_drift_is_no_period():
    """Each point is within the tolerance of the one before, the first is not of the last."""
    points = repeating(1)
    points[:, 1] += 0.001 * np.arange(64)
    assert period(points, 0.01) == 0
    assert period(points, 0.0631) == 1


# -- spread ---------------------------------------------------------------------------------------------


def spread(points, n):
    return float(spreads(points, n, n)[0])


def distance_by_hand(points, n):
    """Largest distance of points from the last one that is a multiple of n turns apart."""
    if len(points) < 2 * n:
        return math.inf
    last = len(points) - 1
    return max(float(np.abs(points[i] - points[last - (last - i) % n]).max()) for i in range(len(points)))


def test_spread_is_the_largest_distance_from_the_last_point():
    points = np.zeros((3, 14))
    points[0, 2], points[1, 5] = 0.25, -0.75
    assert spread(points, 1) == 0.75
    points[2, 5] = 0.5
    assert spread(points, 1) == 1.25


def test_spread_takes_the_largest_coordinate_not_their_sum():
    points = np.zeros((2, 14))
    points[0] = 0.5
    assert spread(points, 1) == 0.5


def test_spread_counts_turns_from_the_last_point():
    """Of an odd number of points of a period-2 motion the first belongs to the last."""
    points = np.zeros((5, 14))
    points[:, 1] = [7.0, 3.0, 1.0, 3.0, 1.0]
    assert spread(points, 2) == 6.0
    points[:, 1] = [1.0, 7.0, 1.0, 3.0, 1.0]
    assert spread(points, 2) == 4.0


def test_spreads_are_those_of_one_to_sixteen_turns():
    points = repeating(3, 20)
    found = spreads(points)
    assert found.tolist() == [distance_by_hand(points, n) for n in range(1, 17)]
    assert [n for n, value in enumerate(found, 1) if value == 0.0] == [3, 6, 9]
    assert [n for n, value in enumerate(found, 1) if math.isinf(value)] == [11, 12, 13, 14, 15, 16]


# -- points of a section --------------------------------------------------------------------------------


def states_with_phase(phases, turn=0.0):
    states = np.zeros((len(phases), 14))
    states[:, 3] = turn
    states[:, 4] = np.asarray(phases) - turn
    return states


def test_phase_difference_wraps_across_pi():
    phases = [math.pi - 1e-4, -math.pi + 1e-4] * 16
    assert period(section_of(states_with_phase(phases)), 1e-3) == 1
    assert period(section_of(states_with_phase(phases)), 1e-5) == 2


def test_whole_turns_do_not_count():
    phases = 0.3 + 2.0 * math.pi * np.arange(32)
    assert period(section_of(states_with_phase(phases, turn=2.0 * math.pi * 1000)), 1e-9) == 1


def test_phases_of_the_same_cosine_differ():
    assert period(section_of(states_with_phase([0.5 * math.pi, -0.5 * math.pi] * 16)), 0.1) == 2


def test_antiphase_and_in_phase_differ():
    assert period(section_of(states_with_phase([0.0, math.pi] * 16)), 0.1) == 2


def test_points_are_in_the_scales_of_the_scene():
    state = np.arange(1.0, 15.0)
    found = section_of([state, state])
    expected = state / state_scales(Scene())
    expected[3:5] = math.cos(9.0), math.sin(9.0)
    assert found.shape == (2, 14)
    assert found[0] == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("extra", [0, 1, 5, m.SECTION_ROWS])
def test_points_of_a_full_section_are_the_last_in_the_order_of_time(extra):
    turns = m.SECTION_ROWS + extra
    states = np.zeros((turns, 14))
    states[:, 0] = state_scales(Scene())[0] * np.arange(turns)
    assert section_of(states)[:, 0] == pytest.approx(np.arange(extra, turns))


def test_no_points_before_the_first_turn():
    assert section_of([]).shape == (0, 14)
