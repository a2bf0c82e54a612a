"""Orbits by either engine, and by the other one where the first one finds none."""

from contextlib import closing

import numpy as np
import pytest
from common.places import QUICKSTART, ROOT

from vibroplat import load_config, orbit
from vibroplat.continuation import orbit as orbits
from vibroplat.continuation.first_orbit import MissedOrbitError, OrbitError
from vibroplat.continuation.orbit import with_orbit_tolerance
from vibroplat.continuation.shooting import Shooter
from vibroplat.designs.sensitivities import local_orbit

SCREEN = ROOT / "tests/machines/screen-2t.yaml"


def test_shots_of_sundials_are_accurate_enough_for_newton(kernels):
    """With the tolerance that is enough for the series, ends from neighbouring states scatter by 2.6e-9."""
    screen = load_config(SCREEN)
    known, random = orbit(screen, period=2), np.random.default_rng(0)
    with closing(Shooter(with_orbit_tolerance(screen.replace({"solver.engine": "native"}), 1e-9))) as shooter:
        starts = known.state * (1.0 + 1e-12 * random.standard_normal((8, 14)))
        ends = [shooter.shot(start, known.period_s).state / shooter.scales for start in starts]
    assert np.std(ends, axis=0).max() < 1e-9


def test_no_orbit_is_said_when_both_engines_have_found_none(monkeypatch):
    search, asked = orbits.first_orbit, []

    def missing(shooter, *arguments):
        asked.append(shooter.engine.name)
        if shooter.engine.name in lost:
            raise MissedOrbitError(f"no orbit by {shooter.engine.name}")
        return search(shooter, *arguments)

    monkeypatch.setattr(orbits, "first_orbit", missing)
    monkeypatch.setattr("vibroplat.continuation.orbit_neighbourhood.first_orbit", missing)
    scene = load_config(QUICKSTART)
    lost = {"taylor"}
    known = orbit(scene)
    local_orbit(scene, [], {"state": known.state, "period": 1}).close()
    assert asked == ["taylor", "native"] * 2
    lost.add("native")
    with pytest.raises(OrbitError, match="no orbit by taylor"):
        orbit(scene)
    assert asked == ["taylor", "native"] * 3
