"""An orbit and its neighbourhood in keys, and guesses past whose section events go."""

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from vibroplat import load_config, orbit
from vibroplat.continuation.newton import NoConvergenceError
from vibroplat.continuation.orbit_neighbourhood import OrbitNeighbourhood

KEYS = ["machine.platform_mass_kg", "machine.stiffness_y_n_per_m", "drive.supply_frequency_hz", "material.mass_ratio"]
CALIBRATED = Path(__file__).parents[2] / "configs/machines/calibrated.yaml"


@pytest.fixture(scope="module")
def local():
    """An orbit with flight."""
    scene = load_config(CALIBRATED, {"drive.supply_frequency_hz": 55.0, "material.mass_ratio": 0.1})
    with closing(OrbitNeighbourhood.near(scene.replace({"solver.engine": "taylor"}), KEYS, tolerance=1e-10)) as found:
        yield found


def test_tangents_are_those_of_orbits_at_other_values(local):
    for k, column in enumerate(local.tangents.T):
        step = np.zeros(len(KEYS))
        step[k] = 1e-4 * local.values[k]
        above, below = local.correct(local.values + step), local.correct(local.values - step)
        assert above.orbit.chart is below.orbit.chart is local.orbit.chart
        difference = (above.orbit.u - below.orbit.u) / (2.0 * step[k])
        np.testing.assert_allclose(column, difference, rtol=0.0, atol=1e-5 * np.abs(difference).max())


def test_a_long_step_leads_to_the_orbit_that_settling_finds(local):
    """It is divided, its section moves, and that of one alone is as that of all."""
    values = local.values * (1.3, 0.75, 0.87, 2.5)
    there = local.correct(values)
    settled = orbit(there.scene)
    assert there.orbit.chart is not local.orbit.chart
    np.testing.assert_array_equal(there.values, values)
    for name in ("rms_y_m", "motor_power_w", "contact_force_max_n"):
        assert there.measures[name] == pytest.approx(settled.measures[name], rel=1e-6)
    assert there.measures["stability_margin"] == pytest.approx(1.0 - abs(settled.multipliers[0]), rel=1e-4)


def test_a_few_measures_are_those_of_all(local):
    """Without the data sheet, which is not made."""
    there = local.correct(local.values * 1.01)
    few = there.measured(["rms_y_m", "gap_max_m", "stability_margin"])
    assert "gamma" not in few
    assert "measures" not in vars(there)
    assert few == few | {name: value for name, value in there.measures.items() if name in few}
    assert there.measured(["gamma"]) is there.measures


def test_an_orbit_that_ends_is_lost(local):
    """The motors cannot follow so low a torque; the scene that was left is as before."""
    with (
        closing(OrbitNeighbourhood.near(local.scene, ["motor.critical_torque_n_m"])) as weak,
        pytest.raises(NoConvergenceError),
    ):
        weak.correct(0.02 * weak.values)


def test_a_guess_from_chaotic_motion_past_whose_section_an_event_goes(caplog):
    """On the section φ₁ = 0 Newton's first step closes the gap."""
    scene = load_config(CALIBRATED, {"drive.supply_frequency_hz": 66.0, "material.mass_ratio": 0.02})
    guess = [8.9468e-05, -0.001109186, 0.00325973, 0.0, 1.078422234, 0.001826554, -0.000328644]
    rates = [0.2659436, -0.07203861, -0.565116665, 206.67069684, -207.079281515, 0.006419506, 0.031291576]
    found = orbit(scene.replace({"solver.engine": "taylor"}), [*guess, *rates])
    assert (found.sequence, found.period) == ("none", 1)
    assert abs(found.multipliers[0]) == pytest.approx(0.97992673508)
    assert found.residual < 1e-8
    assert not caplog.records
