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


@pytest.mark.parametrize(
    ("restitution", "sticking_speed", "rebound", "acceleration", "pressed", "expected"),
    [
        (0.5, 0.0, 0.0, -8.0, True, transitions.ATTACH),
        (0.5, 0.0, 0.0, 0.8, False, transitions.FLY),
        (0.5, 0.0, 1e-1, -8.0, True, transitions.FLY),
        (0.5, 0.0, 1e-9, -8.0, True, transitions.ACCUMULATE),
        (0.5, 0.0, 1e-9, 8.0, False, transitions.FLY),
        (0.999, 0.0, 1e-6, -8.0, True, transitions.FLY),
        (0.999, 1e-5, 1e-6, -8.0, True, transitions.ACCUMULATE),  # sooner, as they soon stick
        (1.0, 1e-5, 1e-6, -8.0, True, transitions.FLY),  # followed, as all elastic impacts
    ],
)
def test_what_follows_an_impact(scene, p, restitution, sticking_speed, rebound, acceleration, pressed, expected):
    p.restitution, p.sticking_speed = restitution, sticking_speed
    speed, jerk = scene.speed_scale, 1e3 if restitution == 0.5 else 0.0
    found = transitions.after_impact(rebound, acceleration, jerk, True, pressed, TOLERANCE, speed, p)
    assert found == expected


def test_accumulation_threshold_bounds_the_neglected_jerk(scene, p):
    """Just below the threshold ω₀|j|τ² ≤ tol|a|, so t∞ is off by at most tol/ω₀."""
    acceleration, jerk, speed = -8.0, 3e4, scene.speed_scale
    speeds = np.logspace(-9, -1, 400)
    latched = [v for v in speeds if transitions.is_chatter(v, acceleration, jerk, True, TOLERANCE, speed, p)]
    duration = 2.0 * max(latched) / (0.5 * -acceleration)
    shift = jerk * duration**2 / -acceleration
    assert 0.9 * TOLERANCE / speed <= shift <= TOLERANCE / speed
