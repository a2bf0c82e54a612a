"""Branches of a ball on a table against closed formulas (Holmes 1982; Luck and Mehta 1993)."""

import math

import numpy as np
import pytest
from common.orbits import traced
from common.shaken_table import GRAVITY, jacobian, shaken, stable_range

from vibroplat.continuation.orbit import orbit

GAMMA = "machine.gravity_m_per_s2"


def branches(restitution, tolerance, stop, **changes):
    """Branches over gravity from the middle of the stable range to a value of Γ, which is inversely proportional."""
    middle = 0.5 * sum(stable_range(restitution))
    plan = {"key": GAMMA, "start": GRAVITY, "stop": GRAVITY * middle / stop, "from": "state", "switch": []}
    scene = shaken(middle, restitution)
    return middle * GRAVITY, traced(
        scene.replace({"orbits": plan | {"tolerance": tolerance} | changes, "solver.tolerance": tolerance})
    )


@pytest.mark.parametrize(
    ("restitution", "tolerance", "error"), [(0.3, 1e-6, 1e-6), (0.5, 1e-10, 1e-9), (0.8, 1e-6, 1e-6)]
)
def test_stable_range_ends_where_the_formulas_say(restitution, tolerance, error):
    for kind, end, beyond in zip(("fold", "period-doubling"), stable_range(restitution), (0.98, 1.07), strict=True):
        scale, (branch,) = branches(restitution, tolerance, end * beyond)
        special = next(special for special in branch.special if special["kind"] == kind)
        assert scale / special["value"] == pytest.approx(end, rel=error)


@pytest.mark.parametrize(("restitution", "share"), [(0.3, 0.1), (0.5, 1.05), (0.8, 0.6)])
def test_multipliers_of_the_ball_are_those_of_its_map(restitution, share):
    low, high = stable_range(restitution)
    gamma = low + share * (high - low)
    scene = shaken(gamma, restitution)
    found = orbit(scene, scene.run.initial.state.model_dump(), tolerance=1e-9).multipliers
    expected = np.linalg.eigvals(jacobian(math.sqrt(gamma**2 - low**2), restitution))
    own = [found[np.argmin(np.abs(found - m))] for m in expected]
    assert np.prod(own) == pytest.approx(restitution**2, abs=1e-9)
    assert own == pytest.approx(expected, abs=1e-8)


def test_period_two_branches_off_where_period_one_loses_stability():
    _, (first, second) = branches(0.5, 1e-8, 1.6, switch=["period-doubling"], max_branches=2)
    assert (first.origin, second.origin) == ("start", "period-doubling")
    assert {row["period"] for row in second.rows} == {2}
    assert {row["sequence"] for row in second.rows} == {"impact impact"}
    (doubling,) = [special for special in first.special if special["kind"] == "period-doubling"]
    # it begins there, stable, beside the unstable orbit of period 1
    assert abs(second.rows[0]["value"] / doubling["value"] - 1.0) < 0.02
    assert second.rows[0]["stable"]
    assert not first.rows[-1]["stable"]


def test_sticking_of_the_inelastic_ball_ends_at_the_root_of_one_plus_pi_squared():
    scene = shaken(2.0, 0.0)
    plan = {"key": GAMMA, "start": GRAVITY, "stop": GRAVITY * 2.0 / 3.4, "from": "state", "switch": []}
    (branch,) = traced(scene.replace({"orbits": plan}))
    (special,) = [special for special in branch.special if special["kind"] == "end-of-sticking"]
    assert 2.0 * GRAVITY / special["value"] == pytest.approx(math.hypot(1.0, math.pi), rel=1e-8)
    assert {row["sequence"] for row in branch.rows if row["value"] > special["value"]} == {"liftoff stick"}
