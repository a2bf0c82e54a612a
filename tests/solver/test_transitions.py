"""The rules between modes, by themselves and in scenes made for them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from known_scenes import ball_on_table

from vibroplat import simulate
from vibroplat.physics.parameters import parameters
from vibroplat.solver import transitions as rules
from vibroplat.solver.interpolation import dip_below_zero, missed_fall


@pytest.fixture
def p(quickstart):
    return parameters(quickstart.replace({"contact.restitution": 0.5}))


@pytest.mark.parametrize(
    ("force", "rate", "expected"),
    [
        (1.0, -5.0, True),
        (0.0, 5.0, True),
        (-1e-14, 0.0, True),
        (1e-14, -1.0, False),
        (0.0, -1.0, False),
        (-1e-6, 5.0, False),
    ],
)
def test_contact_presses(p, force, rate, expected):
    assert rules.presses(force, rate, p) is expected


@pytest.mark.parametrize(("rate", "expected"), [(-1.0, rules.FLY), (0.0, rules.ATTACH), (2.0, rules.ATTACH)])
def test_force_that_only_touches_zero_keeps_contact(rate, expected):
    assert rules.after_force_root(rate) == expected


def test_dead_impact_attaches_only_where_contact_presses(p):
    assert rules.after_impact(0.0, 10.0, 0.0, -8.0, 0.0, p) == rules.ATTACH
    assert rules.after_impact(0.0, -1.0, 0.0, 0.8, 0.0, p) == rules.FLY


def test_rebound_flies_until_it_is_slow_enough(p):
    assert rules.after_impact(1e-1, 10.0, 0.0, -8.0, 1e3, p) == rules.FLY
    assert rules.after_impact(1e-9, 10.0, 0.0, -8.0, 1e3, p) == rules.LATCH
    assert rules.after_impact(1e-9, -10.0, 0.0, 8.0, 1e3, p) == rules.FLY


def test_elastic_impacts_do_not_accumulate(p):
    p[rules.RESTITUTION] = 1.0
    assert rules.after_impact(1e-12, 10.0, 0.0, -8.0, 0.0, p) == rules.FLY


def test_accumulation_threshold_bounds_the_neglected_jerk(p):
    """Just below the threshold ω₀|j|τ² ≤ tol|a|, so t∞ is off by at most tol/ω₀."""
    acceleration, jerk = -8.0, 3e4
    speeds = np.logspace(-9, -1, 400)
    closed = [v for v in speeds if rules.accumulates(v, acceleration, jerk, p)]
    duration = 2.0 * max(closed) / (0.5 * -acceleration)
    shift = jerk * duration**2 / -acceleration
    assert shift <= p[rules.TOLERANCE] / p[rules.SPEED_1]
    assert shift >= 0.9 * p[rules.TOLERANCE] / p[rules.SPEED_1]


def test_excursion_after_rebound_and_release():
    assert rules.excursion(0.2, -10.0, 5.0, 1.0) == pytest.approx((0.04, 0.002))
    duration, height = rules.excursion(0.0, 0.0, 6.0, -24.0)  # gap = t³ − t⁴
    assert (duration, height) == pytest.approx((1.0, 27.0 / 256.0))
    assert rules.excursion(0.0, 0.0, 6.0, 24.0) == (math.inf, math.inf)


@pytest.mark.parametrize(
    ("g0", "g1", "rate_0", "rate_1", "expected"),
    [
        (1.0, 1.0, -1.0, 1.0, -1.0),  # dips, stays positive
        (0.1, 0.1, -1.0, 1.0, 0.5 - math.sqrt(0.25 - 0.1)),  # 0.1 − s + s²
        (0.0, 1.0, 0.0, 3.0, -1.0),  # opens as s³
        (-1e-9, 1.0, 1.0, 1.0, -1.0),  # rises out of a negative start
        (0.0, -1.0, 0.0, -3.0, 0.0),  # never opened: falls from the beginning
        (-1e-9, -1.0, -1.0, -1.0, 0.0),  # begins at round-off below zero and falls
        (-1.0, -2.0, 2.0, -4.0, 11.0 / 32.0),  # −1 + 2s − 3s²: falls from its highest, sampled
    ],
)
def test_dip_inside_a_step(g0, g1, rate_0, rate_1, expected):
    assert dip_below_zero(1.0, g0, g1, rate_0, rate_1) == pytest.approx(expected, abs=1e-9)


def test_missed_fall_names_the_step():
    t = np.array([0.0, 1.0, 2.0, 3.0])
    g = np.array([1.0, 0.1, 0.1, 1.0])
    step, share = missed_fall(t, g, np.array([-1.0, -1.0, 1.0, 1.0]))
    assert step == 1
    assert 0.0 < share < 0.5


def test_contact_that_touches_zero_rises_out_of_it(quickstart):
    """A jerky drive: F_c touches −5e-4 N and rises, while the integrator's first rates are noise."""
    run = simulate(quickstart.replace({"motor.critical_torque_n_m": 1e5, "run.duration_s": 0.1}))
    assert run.outcome == "ok"
    assert run.summary["restarts"] < 20


def test_contact_that_touches_zero_goes_on():
    """At Γ = 1 up to round-off F_c touches zero once a turn: no flight longer than round-off makes."""
    run = simulate(ball_on_table(1.0, tolerance=1e-9, periods=10))
    assert run.outcome == "ok"
    assert run.summary["flight_fraction"] < 1e-5
    assert run.summary["gap_max_m"] < 1e-15


@pytest.mark.parametrize("restitution", [0.0, 0.3, 0.7])
@pytest.mark.parametrize("layers", [1, 2])
def test_gap_and_force_keep_their_sign(calibrated, restitution, layers):
    scene = calibrated.replace(
        {
            "material": {"mass_ratio": 0.2, "layers": layers},
            "contact.restitution": restitution,
            "drive.supply_frequency_hz": 56.0,
            "run.duration_s": 1.0,
        }
    )
    run = simulate(scene)
    assert run.outcome == "ok"
    table = run.trajectory
    assert (table["gap_m"] >= -1e-9).all()
    attached = table["mode"] == "attached"
    assert (table.loc[attached, "contact_force_n"] >= -1e-4 * table["contact_force_n"].max()).all()
    assert (table.loc[attached, ["gap_m", "gap_rate_m_per_s"]] == 0.0).all(axis=None)
    assert (table.loc[~attached, "contact_force_n"] == 0.0).all()


def test_positions_are_continuous_and_only_impacts_jump(quickstart):
    run = simulate(quickstart.replace({"run.duration_s": 0.5, "contact.restitution": 0.4}))
    table = run.trajectory
    for event in run.events.itertuples():
        before, after = table[table["t_s"] == event.t_s].iloc[-2:].to_dict("records")
        for name in ("x_m", "y_m", "phi_rad", "phi1_rad", "phi2_rad", "upper_m", "gap_m"):
            assert after[name] == pytest.approx(before[name], abs=1e-12)
        jump = after["gap_rate_m_per_s"] - before["gap_rate_m_per_s"]
        if event.kind == "liftoff":
            assert jump == 0.0
        elif event.kind == "impact":
            assert after["gap_rate_m_per_s"] == pytest.approx(-0.4 * before["gap_rate_m_per_s"], rel=1e-12)
