"""Boundaries in two keys: where they go, and how settled motion differs on both sides."""

import numpy as np
import pytest
from common.orbits import bounded, traced
from common.shaken_table import GRAVITY, shaken, stable_range

from continuation.helpers import MACHINE, MASS
from vibroplat import load_config
from vibroplat.config.plans import SweepPlan
from vibroplat.continuation.special_points import others_outside
from vibroplat.study.point import measure_point

KEY, RESTITUTION = "drive.supply_frequency_hz", "contact.restitution"


def machine(restitution, boundaries):
    """The machine with material of a fifth of its mass, and its boundaries over two keys."""
    plan = {"key": KEY, "start": 46.0, "stop": 60.0, "switch": [], "boundaries": boundaries}
    return load_config(MACHINE, {"solver.engine": "taylor", MASS: 0.2, RESTITUTION: restitution, "orbits": plan})


@pytest.fixture(scope="module")
def over_mass():
    """Boundaries over the mass ratio, R = 0, by kind."""
    scene = machine(0.0, {"key": MASS, "start": 0.15, "stop": 0.25, "step": {"first": 0.01, "max": 0.02}})
    return scene, {curve.kind: curve for curve in bounded(scene)[1]}


def beside(scene, row, column):
    """A column of points of a sweep, 0.05 Hz to both sides of a point of a curve over the mass ratio."""
    found = []
    for frequency in (row["value"] - 0.05, row["value"] + 0.05):
        there = scene.replace({MASS: row["second"], KEY: frequency})
        frequencies = {"start": frequency, "stop": frequency}
        plan = SweepPlan(supply_frequency_hz=frequencies, settle_by="section", lyapunov=False)
        found.append(measure_point(there, plan, row["state"], (0,)).row[column])
    return found


def test_motion_differs_on_both_sides_of_boundaries_over_mass(over_mass):
    scene, curves = over_mass
    for row in curves["liftoff"].rows[1:-1:2]:
        below, above = beside(scene, row, "flight_fraction")
        assert below == 0.0 < above
    for row in curves["period-doubling"].rows[1:-1:2]:
        assert beside(scene, row, "period") == [1, 2]
    assert all(row["others_outside"] for row in curves["neimark-sacker"].rows)  # beyond the period doubling


@pytest.mark.long
def test_ball_leaves_its_orbit_where_it_folds():
    """It does so where Luck and Mehta (1993) find it."""
    middle = 0.5 * sum(stable_range(0.5))
    plan = {"key": "machine.gravity_m_per_s2", "start": GRAVITY, "stop": GRAVITY * 1.4, "from": "state", "switch": []}
    plan |= {"boundaries": {"key": RESTITUTION, "start": 0.48, "stop": 0.52}}
    _, curves = bounded(shaken(middle, 0.5).replace({"orbits": plan}))
    # nothing damps the platform under the ball: a product of its multipliers is 1 everywhere, not along a curve
    (curve,) = [curve for curve in curves if curve.rows]
    assert curve.kind == "fold"
    for row in curve.rows:
        assert middle * GRAVITY / row["value"] == pytest.approx(stable_range(row["second"])[0], rel=1e-6)


def test_multipliers_outside_beside_the_passing_ones():
    for kind, multipliers, count in (
        ("fold", [1.01, 0.5], 0),
        ("fold", [-1.2, 1.0, 0.5], 1),
        ("period-doubling", [-1.2, -1.0], 1),
        ("neimark-sacker", [0.6 + 0.8j, 0.6 - 0.8j, 1.3], 1),
        ("liftoff", [0.9, 0.5], 0),
    ):
        assert others_outside(kind, np.array(multipliers, dtype=complex)) == count, kind


@pytest.mark.long
def test_boundaries_go_through_the_points_of_other_branches():
    """Curves over the mass ratio from 0.2 pass the special points found at 0.1."""
    kinds = ["liftoff", "end-of-sticking", "period-doubling", "neimark-sacker", "branch-point"]
    second = {"key": MASS, "start": 0.05, "stop": 0.3, "kinds": kinds}
    scene = machine(0.0, second | {"max_points": 60}).replace({"orbits.stop": 64.0})
    _, curves = bounded(scene)
    assert {curve.kind for curve in curves} == {*kinds}
    known = traced(scene.replace({MASS: 0.1, "orbits.switch": ["branch-point"], "orbits.stop": 70.0}))
    for curve in curves:
        ratio, value = (np.array([row[name] for row in curve.rows]) for name in ("second", "value"))
        assert curve.ended == ["end of a key's range"] * 2
        assert (ratio.min(), ratio.max()) == pytest.approx((0.05, 0.3), abs=1e-7)
        near = np.argsort(np.abs(ratio - 0.1))[:6]
        fitted = np.polyval(np.polyfit(ratio[near] - 0.1, value[near], 5), 0.0)
        places = [s["value"] for branch in known for s in branch.special if s["kind"] == curve.kind]
        assert np.abs(np.array(places) - fitted).min() < 1e-5, curve.kind
        assert np.diff(np.sort(ratio)).max() < 0.02


def test_doubling_of_the_ball_over_restitution():
    middle = 0.5 * sum(stable_range(0.5))
    plan = {"key": "machine.gravity_m_per_s2", "start": GRAVITY, "stop": GRAVITY * middle / 1.7, "from": "state"}
    plan |= {"switch": [], "boundaries": {"key": "contact.restitution", "start": 0.45, "stop": 0.55}}
    _, curves = bounded(shaken(middle, 0.5).replace({"orbits": plan}))
    (doubling,) = [curve for curve in curves if curve.kind == "period-doubling"]
    assert len(doubling.rows) > 10
    for row in doubling.rows:
        gamma = middle * GRAVITY / row["value"]
        assert gamma == pytest.approx(stable_range(row["second"])[1], rel=1e-6)
