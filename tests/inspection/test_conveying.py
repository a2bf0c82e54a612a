"""What an inspection tells of material that moves along the deck."""

import cmath
import itertools
import math

import numpy as np
import pytest

from vibroplat import load_config
from vibroplat.config.reader import configurations
from vibroplat.inspection.material import expected_conveying, path, range_of_speed, unique_friction

TEMPLATES = configurations() / "templates"


@pytest.fixture(scope="module")
def feeder():
    return load_config(TEMPLATES / "feeder.yaml")


@pytest.mark.parametrize(("along", "normal", "angle", "ratio"), [
    (math.sqrt(3.0) * 1j, 1j, 30.0, 0.0),
    (2.0, -2.0, -45.0, 0.0),
    (3.0, 1j, 0.0, 1.0 / 3.0),
    (1e-9j, 1.0, 90.0, 0.0),
])  # fmt: skip
def test_the_axes_of_a_path(along, normal, angle, ratio):
    turn = cmath.exp(0.7j)
    found = path(along * turn, normal * turn)
    assert (math.degrees(found[0]), found[1]) == pytest.approx((angle, ratio), abs=1e-7)


def test_the_formulas_of_practice_hold_in_their_ranges_and_on_straight_paths(feeder):
    down = feeder.replace({"transport.deck_angle_deg": 10.0})
    rise = 2e-3 * math.tan(math.radians(10.0))
    for sense in (1.0, -1.0):
        found = expected_conveying(down, 100.0, complex(sense * 3e-3), complex(2e-3), 2.5)
        ends = sorted(factor * 100.0 * (sense * 3e-3 + rise) for factor in (0.75, 0.95))
        assert [found[f"conveying_speed_{end}_m_per_s"] for end in ("low", "high")] == pytest.approx(ends)
    assert range_of_speed(1.5) == (0.49, 0.56)
    for throw, normal in ((0.5, 2e-3), (2.0, 2e-3), (3.5, 2e-3), (math.nan, 2e-3), (2.5, 2e-3j)):
        found = expected_conveying(down, 100.0, complex(3e-3), complex(normal), throw)
        assert math.isnan(found["conveying_speed_low_m_per_s"])


def test_contact_is_unique_up_to_the_bound(feeder):
    """D_nn and D_nt of the whole mass matrix, at all angles of the exciters."""
    body, deck = feeder.body, feeder.transport.deck_height_m
    normal, along = np.array([0.0, 1.0, 0.0, 0.0, 0.0]), np.array([1.0, 0.0, -deck, 0.0, 0.0])
    least = math.inf
    for angles in itertools.product(np.linspace(-math.pi, math.pi, 25), repeat=2):
        masses = np.diag([body.mass, body.mass, body.inertia, *feeder.exciter_inertias])
        for i, (angle, moment, axis) in enumerate(zip(angles, feeder.unbalances, body.axes, strict=True)):
            sine, cosine = math.sin(angle), math.cos(angle)
            masses[3 + i, :3] = moment * np.array([-sine, cosine, axis[0] * cosine + axis[1] * sine])
            masses[:3, 3 + i] = masses[3 + i, :3]
        moved = np.linalg.solve(masses, normal)
        least = min(least, (1.0 / feeder.layer_masses[0] + moved @ normal) / abs(moved @ along))
    assert 0.5 * least < unique_friction(feeder) < least


@pytest.mark.long
def test_the_feeder_is_told_to_convey_as_it_does(feeder):
    found = feeder.inspect()
    assert found["loaded_stroke_x_m"] == pytest.approx(4.90e-3, rel=0.02)  # as simulated, and so on
    assert found["loaded_throw_index"] == pytest.approx(2.63, rel=0.04)
    assert math.degrees(found["throw_angle_rad"]) == pytest.approx(37.4, abs=2.0)
    assert found["conveying_speed_low_m_per_s"] < 0.240 < found["conveying_speed_high_m_per_s"]
    lines = str(found).splitlines()
    assert lines[4].split("  ")[-1].strip().startswith("at 3")
    assert lines[5].startswith("  conveying speed     0.195 … 0.248 m/s ")
    rough = feeder.replace({"transport": {"friction": 300.0, "static_friction": 300.0}})
    assert "friction 300 is above 277" in rough.inspect().answer.notes[0]
