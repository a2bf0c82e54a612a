"""Rates at which chaotic motions converge to orbits, from arrivals at known rates."""

import math

import numpy as np
import pytest

from vibroplat.basin.rates import estimate_rate, estimate_rates


def orbit(multiplier=0.9, radius=1e-2, period=6):
    return {"row": {"motion": "periodic", "period": period, "multiplier_max": multiplier}, "radius": radius}


def restless(motion="chaotic"):
    return {"row": {"motion": motion, "period": 0, "multiplier_max": None}, "radius": None}


def starts_of(turns, longest, number=0, other=1):
    """Starts that arrive at an orbit after some turns, or are still chaotic at the end."""
    arrived = [{"attractor": number, "turns": int(t)} for t in turns if t < longest]
    return arrived + [{"attractor": other, "turns": longest, "windows": []} for t in turns if t >= longest]


@pytest.mark.parametrize(("count", "low", "high"), [(0, 0.0, 2.9957), (1, 0.0253, 5.5716), (10, 4.7954, 18.3904)])
def test_bounds_are_those_of_garwood(count, low, high):
    rate = estimate_rate(np.linspace(0.1, 0.9, count).tolist(), 1.0)
    np.testing.assert_allclose((rate.low, rate.high), (low, high), atol=1e-4)
    assert rate.value == count


@pytest.mark.parametrize("longest", [1500, 6000, 24000])
def test_rate_does_not_depend_on_how_long_motions_are_followed(longest):
    """A share within the turns does; and early arrivals, which are direct, do not count."""
    mean, random = 20_000.0, np.random.default_rng(0)
    held = 0
    for _ in range(200):
        direct = random.uniform(0.0, 0.2 * longest, 100)
        turns = np.concatenate([direct, random.exponential(mean, 300)])
        to_orbit, of_chaos = estimate_rates([orbit(), restless()], starts_of(turns, longest), longest)
        assert to_orbit == of_chaos
        held += to_orbit.low <= 1.0 / mean <= to_orbit.high
    assert held >= 180


def test_constant_rates_are_told_from_others():
    random = np.random.default_rng(1)
    told = []
    for make in (lambda: random.uniform(size=20), lambda: random.beta(1.0, 3.0, size=20)):
        told.append(np.mean([estimate_rate(make().tolist(), 1e5).constant < 0.05 for _ in range(200)]))
    assert told[0] <= 0.08
    assert told[1] >= 0.8
    assert math.isnan(estimate_rate([0.1, 0.2, 0.3, 0.4], 1e5).constant), "too few"


def test_arrivals_at_an_orbit_that_attracts_slowly_may_be_direct():
    """Then an upper bound alone is known of the rate at which chaos is left."""
    starts = starts_of(np.random.default_rng(2).exponential(20_000.0, 50), 6000)
    slow, of_chaos = estimate_rates([orbit(multiplier=0.999), restless()], starts, 6000)
    quick, left = estimate_rates([orbit(), restless()], starts, 6000)
    assert slow is None
    assert quick == left
    assert (math.isnan(of_chaos.value), of_chaos.low, of_chaos.high) == (True, 0.0, left.high)


def test_of_several_restless_motions_it_is_not_known_which_was_left():
    starts = [*starts_of([3000.0, 9000.0, 9000.0], 6000), {"attractor": 2, "turns": 6000, "windows": []}]
    to_orbit, *others = estimate_rates([orbit(), restless(), restless()], starts, 6000)
    assert to_orbit.value == pytest.approx(1.0 / (1500.0 + 3 * 4500.0))
    assert [math.isnan(rate.value) for rate in others] == [True, True]
    assert [rate.high for rate in others] == pytest.approx([5.5716 / 10_500.0, 5.5716 / 6000.0], rel=1e-4)
    assert [
        rate.high for rate in estimate_rates([orbit(), restless()], starts_of([9000.0], 6000), 6000)
    ] == pytest.approx([2.9957 / 4500.0] * 2, rel=1e-4)


def test_an_orbit_to_which_motions_converged_at_unknown_times_has_no_rate():
    """They were on it when they were measured at the end; and it may have no known multiplier."""
    many = {"row": {"motion": "periodic", "period": 24}, "radius": None}
    starts = [{"attractor": 0, "turns": 6000, "windows": []}, {"attractor": 1, "turns": 6000, "windows": []}]
    for one in (many, orbit()):
        rates = estimate_rates([one, restless()], starts, 6000)
        assert rates[0] is None
        assert (math.isnan(rates[1].value), rates[1].low) == (True, 0.0)


def test_undecided_motions_have_no_rate():
    """They may converge directly, and slowly."""
    to_orbit, left = estimate_rates([orbit(), restless("undecided")], starts_of([3000.0, 9000.0], 6000), 6000)
    assert left is None
    assert to_orbit.value > 0.0


def test_where_nothing_is_late_there_is_no_rate():
    assert estimate_rates([orbit()], starts_of([100.0, 200.0], 6000), 6000) == [None]
