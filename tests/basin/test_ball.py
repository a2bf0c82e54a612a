"""Basins of a ball on a shaken table beside its map from impact to impact: an orbit with one impact, and sticking."""

import math

import numpy as np
import pytest
from common.shaken_table import GRAVITY, OMEGA, shaken

from vibroplat import basins
from vibroplat.basin.initial_conditions import key_values

GAMMA, RESTITUTION = 1.3, 0.5
LENGTH, SPEED = GRAVITY / OMEGA**2, GRAVITY / OMEGA
GAP, RATE = "run.initial.state.gap_m", "run.initial.state.gap_rate_m_per_s"
#: Speed after an impact below which the ball of the map sticks, in units of g/ω.
SLOWEST = 1e-5
#: Distance from the border of a basin, in units of g/ω² and g/ω, within which nothing is compared.
BORDER = 1e-6


def between(function, low, high):
    """Places where a function falls through zero, by halving."""
    for _ in range(54):
        middle = 0.5 * (low + high)
        above = function(middle) > 0.0
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    return 0.5 * (low + high)


def landings(phase, gap, rate):
    """Phases of the table at the next impacts, and gap rates before them.

    The gap's rate rises or falls between places where its second derivative, Γ sin θ − 1, is zero, so that in each part
    there is at most one extremum of the gap, and on either side of it at most one impact.
    """
    thrown = rate + GAMMA * np.cos(phase)
    ends, rates = np.full_like(phase, np.nan), np.full_like(phase, np.nan)
    flying, low = np.arange(phase.size), phase.copy()
    while flying.size:
        t0, h, w = phase[flying], gap[flying], thrown[flying]

        def height(t, t0=t0, h=h, w=w):
            return h + w * (t - t0) - 0.5 * (t - t0) ** 2 - GAMMA * (np.sin(t) - np.sin(t0))

        def speed(t, t0=t0, w=w):
            return w - (t - t0) - GAMMA * np.cos(t)

        turns = 2.0 * math.pi * (low[flying, np.newaxis] // (2.0 * math.pi) + np.arange(2))
        bends = np.concatenate([turns + math.asin(1.0 / GAMMA), turns + math.pi - math.asin(1.0 / GAMMA)], axis=1)
        high = np.where(bends > low[flying, np.newaxis] + 1e-12, bends, np.inf).min(axis=1)
        side = np.where(speed(low[flying]) > 0.0, 1.0, -1.0)
        turning = between(lambda t, side=side: side * speed(t), low[flying], high)  # the end where there is none
        for begin, end in ((low[flying], turning), (turning, high)):
            lands = (height(end) <= 0.0) & np.isnan(ends[flying])
            where = between(height, begin, end)
            ends[flying[lands]], rates[flying[lands]] = where[lands], speed(where)[lands]
        low[flying] = high
        flying = flying[np.isnan(ends[flying])]
    return ends, rates


def sticking(phase, gap, rate):
    """Whether a ball comes to stick, now and then, by its map; else it comes to bounce once in a period."""
    found, left = np.zeros(phase.size, dtype=bool), np.arange(phase.size)
    repeated = np.zeros(phase.size, dtype=int)
    for _ in range(2000):
        new, before = landings(phase, gap, rate)
        after = -RESTITUTION * before
        repeated = np.where(np.abs(new - phase - 2.0 * math.pi) < 1e-9, repeated + 1, 0)
        phase, gap, rate = new, np.zeros_like(new), after
        sticks = (after < SLOWEST) & (GAMMA * np.sin(phase) < 1.0)
        found[left[sticks]] = True
        going = ~sticks & (repeated < 5)
        left, phase, gap, rate, repeated = (each[going] for each in (left, phase, gap, rate, repeated))
        if not left.size:
            return found
    raise AssertionError("a ball comes to neither motion")


@pytest.mark.parametrize(
    "number", [80, pytest.param(2_000, marks=pytest.mark.long), pytest.param(10_000, marks=pytest.mark.campaign)]
)
def test_all_balls_come_to_the_motion_that_the_map_says(number):
    scene = shaken(GAMMA, RESTITUTION)
    box = {GAP: [0.01 * LENGTH, 8.0 * LENGTH], RATE: [-4.0 * SPEED, 4.0 * SPEED]}
    scene = scene.replace({"basins": {"initial_conditions": box, "random": number}})
    tables = basins(scene)
    impacts = tables.attractors.set_index("attractor")["impacts_per_period"]
    assert impacts.min() == 1.0
    assert impacts.max() > 10.0, "a chatter"
    assert len(impacts) == 2
    gap, rate = (key_values(scene.basins, range(number)) / (LENGTH, SPEED)).T
    begun = np.full(number, math.acos(math.pi * (1.0 - RESTITUTION) / ((1.0 + RESTITUTION) * GAMMA)))
    ours = tables.starts["attractor"].map(impacts).to_numpy() > 1.0
    theirs = sticking(begun, gap, rate)
    assert 0.1 < theirs.mean() < 0.9
    sides = [sticking(begun, gap + a, rate + b) for a, b in BORDER * np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)])]
    clear = (np.array(sides) == theirs).all(axis=0)
    assert clear.mean() > 0.98
    np.testing.assert_array_equal(ours[clear], theirs[clear])
    # that which sticks takes off where the table falls as quickly as the ball, and a tenth of a radian later it flies
    lifts = math.asin(1.0 / GAMMA)
    flown, thrown = np.array([lifts, lifts + 0.1]), GAMMA * math.cos(lifts)
    height = np.diff(thrown * flown - 0.5 * (flown - lifts) ** 2 - GAMMA * np.sin(flown))
    assert sticking(flown[1:], height, thrown - 0.1 - GAMMA * np.cos(flown[1:])).all()
