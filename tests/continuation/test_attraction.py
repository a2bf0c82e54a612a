"""From where motion is known to come to a stable orbit."""

from contextlib import closing

import numpy as np
import pytest

from continuation.helpers import MACHINE
from vibroplat import load_config
from vibroplat.continuation.attraction import AttractionEllipsoid, contracting_norm
from vibroplat.continuation.first_orbit import first_orbit
from vibroplat.continuation.orbit import with_orbit_tolerance
from vibroplat.continuation.shooting import Shooter


@pytest.mark.parametrize("defective", [False, True])
def test_the_norm_shrinks_in_each_period(defective):
    """For a map whose powers grow at first, and for one whose eigenvectors are parallel."""
    section_map = np.array([[0.9, 5.0, 0.0], [0.0, 0.9 if defective else 0.4, 3.0], [0.0, 0.0, -0.2]])
    norm = contracting_norm(section_map, *np.linalg.eig(section_map))
    bound = 0.95 if defective else 0.9
    for way in np.random.default_rng(0).standard_normal((20, 3)):
        assert np.linalg.norm(norm @ section_map @ way) <= (bound + 1e-9) * np.linalg.norm(norm @ way)


@pytest.fixture(scope="module")
def flying():
    """An orbit with flight, its attraction, and a shooter of its scene."""
    scene = load_config(MACHINE, {"solver.engine": "taylor", "material.mass_ratio": 0.2})
    with closing(Shooter(with_orbit_tolerance(scene.replace({"drive.supply_frequency_hz": 50.0}), 1e-8))) as shooter:
        _, found = first_orbit(shooter, None, 1, (), 1e-8)
        yield AttractionEllipsoid(found, 1), shooter


def moved(around, size):
    state = around.state.copy()
    state[8] += size
    return state


def test_motion_comes_nearer_from_where_an_orbit_attracts(flying):
    around, shooter = flying
    state = moved(around, 1e-3)
    away = around.distance(state, around.system)
    assert around.contracts_on_shells(shooter, away)
    assert around.contracts_along_trajectory(shooter, state)
    assert around.contracts_along_trajectory(shooter, moved(around, 0.0)), "nearer than what can be told"
    shooter.motion.reset(state)
    assert shooter.motion.to_section(40, 10.0)
    left = around.distance(shooter.motion.state, shooter.motion.system.index)
    assert left < (0.5 * (1.0 + around.spectral_radius)) ** 40 * away


def test_an_orbit_does_not_attract_from_anywhere(flying):
    around, shooter = flying
    assert not around.contracts_on_shells(shooter, 30.0)
    assert not around.contracts_along_trajectory(shooter, moved(around, 5.0))
    assert around.distance(around.state, around.system + 1) == np.inf


def test_directions_are_even_in_the_ellipsoid(flying, monkeypatch):
    """Its axes differ by two orders of magnitude: directions that are even in the scales of the state miss the long."""
    around, shooter = flying
    seen = []
    monkeypatch.setattr(AttractionEllipsoid, "_contracts", lambda self, shooter, starts, *more: not seen.append(starts))
    assert around.contracts_on_shells(shooter, 1.0, 400)
    shells = (np.array(seen).reshape(3, 402, -1)[:, 2:] - around.state) @ around.norm.T
    sizes = np.linalg.norm(shells, axis=2)
    np.testing.assert_allclose(sizes, np.array([[1.0], [0.25], [0.0625]]) * np.ones(400))
    for ways in shells / sizes[..., np.newaxis]:
        spread = np.linalg.eigvalsh(ways.T @ ways / 400) * ways.shape[1]
        assert 0.5 < spread.min() < spread.max() < 1.8


def test_a_distance_that_is_no_number_is_not_nearer(flying, monkeypatch):
    around, shooter = flying
    monkeypatch.setattr(around, "norm", np.full_like(around.norm, np.nan))
    assert not around.contracts_on_shells(shooter, 1e-3)
    assert not around.contracts_along_trajectory(shooter, moved(around, 1e-3))
