"""Boundaries in two keys: where they go, and their check by settled motion on both sides."""

from collections import Counter

import numpy as np
import pytest
from common.orbits import bounded, traced
from common.shaken_table import GRAVITY, shaken, stable_range

from continuation.helpers import MACHINE, MASS
from vibroplat import load_config
from vibroplat.continuation.special_points import others_outside
from vibroplat.continuation.two_keys import AGREES, DIFFERS, UNSTABLE, check, chosen

KEY, RESTITUTION = "drive.supply_frequency_hz", "contact.restitution"


def machine(restitution, boundaries):
    """The machine with material of a fifth of its mass, and its boundaries over two keys."""
    plan = {"key": KEY, "start": 46.0, "stop": 60.0, "switch": [], "boundaries": boundaries}
    return load_config(MACHINE, {"solver.engine": "taylor", MASS: 0.2, RESTITUTION: restitution, "orbits": plan})


@pytest.fixture(scope="module")
def over_mass():
    """Boundaries over the mass ratio, R = 0, by kind."""
    scene = machine(
        0.0, {"key": MASS, "start": 0.15, "stop": 0.25, "step": {"first": 0.01, "largest": 0.02}, "check": 3}
    )
    return scene, {curve.kind: curve for curve in bounded(scene)[1]}


def checks(curve):
    return Counter(row["check"] for row in curve.rows if "check" in row)


def test_motion_differs_on_both_sides_of_boundaries_over_mass(over_mass):
    _, curves = over_mass
    for kind in ("liftoff", "end-of-sticking", "period-doubling"):
        assert checks(curves[kind]) == {AGREES: 3}
    assert checks(curves["neimark-sacker"]) == {UNSTABLE: 3}  # beyond the period doubling
    (below, above) = {(row["below"], row["above"]) for row in curves["liftoff"].rows if "check" in row}.pop()
    assert (below, above) == ("period 1: none", "period 1: liftoff stick")


@pytest.mark.parametrize("kind", ["liftoff", "period-doubling"])
def test_a_curve_in_the_wrong_place_is_told(over_mass, kind):
    """Half a hertz away, where the motion on both sides is of one kind."""
    scene, curves = over_mass
    curve, plan = curves[kind], scene.orbits
    place, way = list(chosen(curve.rows, plan).items())[1]
    wrong = curve.rows[place] | {"value": curve.rows[place]["value"] - 0.5}
    found = check(scene, plan, kind, wrong, way)
    assert found["check"] == DIFFERS
    assert found["below"] == found["above"]


@pytest.mark.long
def test_motion_differs_on_both_sides_of_boundaries_over_restitution():
    kinds = ["liftoff", "end-of-sticking", "fold", "period-doubling"]
    boundaries = {"key": RESTITUTION, "start": 0.0, "stop": 0.4, "step": {"first": 0.02, "largest": 0.05}, "check": 3}
    _, curves = bounded(machine(0.1, boundaries | {"kinds": kinds}))
    found = {kind: sum((checks(c) for c in curves if c.kind == kind), Counter()) for kind in kinds}
    for kind in ("liftoff", "end-of-sticking", "fold"):
        assert found[kind].total() >= 3
        assert set(found[kind]) == {AGREES}
    (sticking,) = [curve for curve in curves if curve.kind == "end-of-sticking"]
    assert sticking.ended[1] == "end of a key's range"
    assert sticking.rows[0]["second"] < 1e-5
    # one of these curves bounds orbits of three impacts, which in places attract too little to be met
    assert found["period-doubling"].total() >= 6
    assert found["period-doubling"][AGREES] >= 4


@pytest.mark.long
def test_ball_leaves_its_orbit_where_it_folds():
    middle = 0.5 * sum(stable_range(0.5))
    plan = {"key": "machine.gravity_m_per_s2", "start": GRAVITY, "stop": GRAVITY * 1.4, "from": "state", "switch": []}
    plan |= {"boundaries": {"key": RESTITUTION, "start": 0.48, "stop": 0.52, "check": 2}}
    _, curves = bounded(shaken(middle, 0.5).replace({"orbits": plan}))
    # nothing damps the platform under the ball: a product of its multipliers is 1 everywhere, not along a curve
    (curve,) = [curve for curve in curves if curve.rows]
    assert (curve.kind, checks(curve)) == ("fold", {AGREES: 2})


def test_points_are_chosen_evenly_along_a_curve(over_mass):
    plan = over_mass[0].orbits
    rows = [{"value": value, "second": 0.2} for value in (46.0, *np.linspace(47.0, 47.1, 50), 50.0, 52.0, 54.0)]
    assert [rows[place]["value"] for place in chosen(rows, plan)] == [47.1, 50.0, 52.0]
    assert chosen(rows[:2], plan) == {}


def test_the_way_across_a_curve_is_at_right_angles_to_larger_values_of_the_first_key(over_mass):
    plan = over_mass[0].orbits
    rows = [{"value": 50.0 + i * plan.unit, "second": 0.2 - 2.0 * i * plan.boundaries.unit} for i in range(3)]
    for there in (rows, rows[::-1]):
        assert chosen(there, plan) == {1: pytest.approx((2.0 / 5**0.5, 1.0 / 5**0.5))}


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
    second = {"key": MASS, "start": 0.05, "stop": 0.3, "kinds": kinds, "check": 0}
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
    plan |= {"switch": [], "boundaries": {"key": "contact.restitution", "start": 0.45, "stop": 0.55, "check": 0}}
    _, curves = bounded(shaken(middle, 0.5).replace({"orbits": plan}))
    (doubling,) = [curve for curve in curves if curve.kind == "period-doubling"]
    assert len(doubling.rows) > 10
    for row in doubling.rows:
        gamma = middle * GRAVITY / row["value"]
        assert gamma == pytest.approx(stable_range(row["second"])[1], rel=1e-6)
