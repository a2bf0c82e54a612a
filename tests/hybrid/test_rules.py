"""The rules between modes, by themselves."""

import numpy as np
import pytest

from vibroplat.hybrid import transitions
from vibroplat.model.parameters import parameters

#: Tolerance of the run (that of the quickstart), and contact forces that are round-off of larger ones (N).
TOLERANCE, NOISE = 1e-6, 1e-11


@pytest.fixture
def scene(quickstart):
    return quickstart.replace({"contact.restitution": 0.5})


@pytest.fixture
def p(scene):
    return parameters(scene)


@pytest.fixture
def follows(scene, p):
    """What follows an impact; the mode is pressed on unless it is said otherwise."""

    def after(rebound, acceleration, jerk, pressed=True):
        return transitions.after_impact(rebound, acceleration, jerk, True, pressed, TOLERANCE, scene.speed_scale, p)

    return after


@pytest.mark.parametrize(
    ("force", "rate", "expected"),
    [
        (1.0, -5.0, True),
        (0.0, 5.0, True),
        (-1e-14, 0.0, True),
        (1e-14, -1.0, False),
        (0.0, -1.0, False),
        (-1e-6, 5.0, False),
    ],
)
def test_contact_presses(scene, force, rate, expected):
    assert transitions.contact_holds(force, rate, NOISE, scene.speed_scale) is expected


def test_dead_impact_attaches_only_where_contact_presses(follows):
    assert follows(0.0, -8.0, 0.0) == transitions.ATTACH
    assert follows(0.0, 0.8, 0.0, pressed=False) == transitions.FLY


def test_rebound_flies_until_it_is_slow_enough(follows):
    assert follows(1e-1, -8.0, 1e3) == transitions.FLY
    assert follows(1e-9, -8.0, 1e3) == transitions.ACCUMULATE
    assert follows(1e-9, 8.0, 1e3, pressed=False) == transitions.FLY


def test_impacts_that_soon_stick_are_latched_sooner(p, follows):
    p.restitution = 0.999
    assert follows(1e-6, -8.0, 0.0) == transitions.FLY
    p.sticking_speed = 1e-5
    assert follows(1e-6, -8.0, 0.0) == transitions.ACCUMULATE
    p.restitution = 1.0  # followed, as all elastic impacts
    assert follows(1e-6, -8.0, 0.0) == transitions.FLY


def test_accumulation_threshold_bounds_the_neglected_jerk(scene, p):
    """Just below the threshold ω₀|j|τ² ≤ tol|a|, so t∞ is off by at most tol/ω₀."""
    acceleration, jerk, speed = -8.0, 3e4, scene.speed_scale
    speeds = np.logspace(-9, -1, 400)
    latched = [v for v in speeds if transitions.is_chatter(v, acceleration, jerk, True, TOLERANCE, speed, p)]
    duration = 2.0 * max(latched) / (0.5 * -acceleration)
    shift = jerk * duration**2 / -acceleration
    assert 0.9 * TOLERANCE / speed <= shift <= TOLERANCE / speed
