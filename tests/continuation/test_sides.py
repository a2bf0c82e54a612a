"""Boundaries checked by settled motion on both sides."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from common.orbits import bounded
from common.shaken_table import GRAVITY, shaken, stable_range

from continuation.helpers import MACHINE, MASS
from vibroplat import load_config
from vibroplat.continuation.boundary_validation import AGREES, DIFFERS, UNSTABLE, across, check, chosen, others_outside

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
    return scene.orbits, {curve.kind: curve for curve in bounded(scene)[1]}


def checks(curve):
    return Counter(row["check"] for row in curve.rows if "check" in row)


def test_motion_differs_on_both_sides_of_boundaries_over_mass(over_mass):
    _, curves = over_mass
    for kind in ("liftoff", "end-of-sticking", "period-doubling"):
        assert checks(curves[kind]) == {AGREES: 3}
    assert checks(curves["neimark-sacker"]) == {UNSTABLE: 3}  # beyond the period doubling
    (below, above) = {(row["below"], row["above"]) for row in curves["liftoff"].rows if "check" in row}.pop()
    assert (below, above) == ("period 1: none", "period 1: liftoff stick")


@pytest.mark.parametrize("kind", ["liftoff", "end-of-sticking", "period-doubling"])
def test_a_curve_in_the_wrong_place_is_told(over_mass, kind):
    """Half a hertz away, where the motion on both sides is of one kind."""
    plan, curves = over_mass
    curve = curves[kind]
    place = len(curve.rows) // 2
    wrong = curve.rows[place] | {"value": curve.rows[place]["value"] - 0.5}
    found = check(curve.family.scene, plan, kind, wrong, across(curve.rows, place, plan))
    assert found["check"] == DIFFERS
    assert found["below"] == found["above"]


@pytest.mark.long
def test_motion_differs_on_both_sides_of_boundaries_over_restitution():
    boundaries = {"key": RESTITUTION, "start": 0.0, "stop": 0.4, "step": {"first": 0.02, "largest": 0.05}}
    _, curves = bounded(machine(0.1, boundaries))
    assert {curve.kind for curve in curves} >= {"liftoff", "end-of-sticking", "period-doubling"}
    found = {kind: sum((checks(c) for c in curves if c.kind == kind), Counter()) for kind in {c.kind for c in curves}}
    for kind in ("liftoff", "end-of-sticking", "fold"):
        assert found[kind].total() >= 5
        assert set(found[kind]) == {AGREES}
    # one of these curves bounds orbits of three impacts, which in places attract too little to be met
    assert found["period-doubling"].total() >= 10
    assert found["period-doubling"][AGREES] >= 6


def test_ball_leaves_its_orbit_where_it_folds():
    middle = 0.5 * sum(stable_range(0.5))
    plan = {"key": "machine.gravity_m_per_s2", "start": GRAVITY, "stop": GRAVITY * 1.4, "from": "state", "switch": []}
    plan |= {"boundaries": {"key": RESTITUTION, "start": 0.48, "stop": 0.52, "check": 2}}
    _, curves = bounded(shaken(middle, 0.5).replace({"orbits": plan}))
    (curve,) = [curve for curve in curves if curve.kind == "fold"]
    assert checks(curve) == {AGREES: 2}


def test_points_are_chosen_evenly_along_a_curve(over_mass):
    plan, _ = over_mass
    rows = [{"value": value, "second": 0.2} for value in (46.0, *np.linspace(47.0, 47.1, 50), 50.0, 52.0, 54.0)]
    assert [rows[place]["value"] for place in chosen(rows, plan)] == [47.1, 50.0, 52.0]
    assert chosen(rows[:2], plan) == []


def test_the_way_across_a_curve_is_at_right_angles_to_larger_values_of_the_first_key(over_mass):
    plan, _ = over_mass
    rows = [{"value": 50.0 + i * plan.unit, "second": 0.2 - 2.0 * i * plan.boundaries.unit} for i in range(3)]
    assert across(rows, 1, plan) == pytest.approx((2.0 / 5**0.5, 1.0 / 5**0.5))
    assert across(rows[::-1], 1, plan) == pytest.approx((2.0 / 5**0.5, 1.0 / 5**0.5))


@pytest.mark.parametrize(
    ("kind", "multipliers", "count"),
    [
        ("fold", [1.01, 0.5], 0),
        ("fold", [-1.2, 1.0, 0.5], 1),
        ("period-doubling", [-1.2, -1.0], 1),
        ("neimark-sacker", [0.6 + 0.8j, 0.6 - 0.8j, 1.3], 1),
        ("liftoff", [0.9, 0.5], 0),
    ],
)
def test_multipliers_outside_beside_the_passing_ones(kind, multipliers, count):
    assert others_outside(kind, np.array(multipliers, dtype=complex)) == count
