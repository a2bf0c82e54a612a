"""When a motion is assigned to an attractor."""

import numpy as np
import pytest

from vibroplat.hybrid.state import RUN
from vibroplat.shooting.assignment import ASSIGNED, FOLLOWED, GO_ON, Ellipsoids, Limits, decide


@pytest.mark.parametrize(("size", "fate"), [(0.02, ASSIGNED), (0.4, ASSIGNED), (0.6, GO_ON), (0.99, GO_ON)])
def test_a_motion_must_come_nearer_in_an_ellipsoid(size, fate):
    """Within it beside a chaotic motion, many a start was only passing: being there is not enough."""
    ellipsoids = Ellipsoids(np.zeros((1, 14)), np.eye(14)[None], np.zeros(1, int), np.full(1, 4), np.full(1, 0.5))
    limits = Limits(early=1, later=1, late=50, unsearched=10, most=100, turn=0.04, longest=0.1, near=0.05)
    runs, followed = np.zeros(1, RUN), np.zeros(1, FOLLOWED)
    runs["state"][0, 0] = np.sqrt(size)
    followed["before"], followed["search"] = 0.9, 90
    assert decide(runs[0], followed[0], limits, ellipsoids) == fate


def test_no_motion_is_followed_beyond_the_last_turn():
    far = Ellipsoids(np.zeros((1, 14)), np.eye(14)[None], np.zeros(1, int), np.full(1, 4), np.full(1, 0.5))
    limits = Limits(early=1, later=10, late=50, unsearched=10, most=100, turn=0.04, longest=0.1, near=0.05)
    runs, followed = np.zeros(1, RUN), np.zeros(1, FOLLOWED)
    runs["state"][0, 0] = 2.0
    followed["place"], followed["turns"], followed["stride"], followed["search"] = -1, 95, 2, 1000
    assert decide(runs[0], followed[0], limits, far) == GO_ON
    assert (followed["turns"][0], followed["stride"][0]) == (97, 3)
