"""The cost of branches beside sweeps, and an orbit of two masses in closed form."""

import math

import numpy as np
import pytest
from common.shaken_table import GRAVITY, OMEGA, shaken

from vibroplat import orbit
from vibroplat.bench.orbits import cost
from vibroplat.hybrid.state import static_rest

#: Γ and restitution; share of the lower mass, frequency of the upper over that of the table, damping ratio.
GAMMA, RESTITUTION = 3.0, 0.5
SHARE, FREQUENCY, DAMPING = 0.5, 0.16, 0.1


def flight(state, seconds):
    """Heights and speeds of both masses after a time; in g/ω² and g/ω."""
    from scipy.linalg import expm

    pull = FREQUENCY**2, 2.0 * DAMPING * FREQUENCY
    share = (1.0 - SHARE) / SHARE
    matrix = np.zeros((5, 5))
    matrix[0, 1] = matrix[2, 3] = 1.0
    for row, sign in ((1, share), (3, -1.0)):
        matrix[row] = [-sign * pull[0], -sign * pull[1], sign * pull[0], sign * pull[1], -1.0]
    return (expm(seconds * matrix) @ [*state, 1.0])[:4]


def test_orbit_of_two_masses_is_one_of_their_equations():
    """From one impact to the next one."""
    layers = {"mass_ratio": 1e-12, "layers": 2, "lower_share": SHARE}
    layers |= {"natural_frequency_hz": FREQUENCY * 25.0, "damping_ratio": DAMPING}
    scene = shaken(GAMMA, RESTITUTION).replace({"material": layers})
    run = orbit(scene).run
    after = run.trajectory[run.trajectory["t_s"] == run.events["t_s"].iloc[0]].iloc[-1]
    length, rate = GRAVITY / OMEGA**2, GRAVITY / OMEGA
    height = (after["y_m"] - static_rest(scene)[1]) / length
    speed = (after["y_rate_m_per_s"] + after["gap_rate_m_per_s"]) / rate
    phase = math.atan2(height, after["y_rate_m_per_s"] / rate)
    state = [speed, height + after["upper_m"] / length, speed + after["upper_rate_m_per_s"] / rate]
    table = GAMMA * math.sin(phase)
    end = flight([table, *state], 2.0 * math.pi)
    rebound = (1.0 + RESTITUTION) * GAMMA * math.cos(phase) - RESTITUTION * end[1]
    np.testing.assert_allclose([end[0], rebound, *end[2:]], [table, *state], atol=1e-6)


@pytest.mark.long
def test_branches_are_cheaper_than_sweeps_and_as_exact():
    narrow = {"sweep.grid": {"material.mass_ratio": [0.1]}, "sweep.supply_frequency_hz.stop": 45.0}
    table = cost(1, narrow).set_index("what")
    assert list(table.index) == ["branches", *(f"sweep, settled to {t:g}" for t in (1e-3, 1e-7, 1e-9))]
    assert table["times_branches"].is_monotonic_increasing
    assert (table["error"] < [1e-8, 1e-2, 1e-6, 1e-8]).all()
