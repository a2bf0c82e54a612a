"""Motions with a known answer; the numbers are formulas evaluated independently (cases with sources in the text)."""

import math

import pytest
from common.known import GRAVITY, OMEGA, TURN, accumulation_time, ball_on_table, dropped_ball
from scipy.optimize import brentq

import vibroplat


@pytest.fixture(params=["native", "taylor"])
def simulate(request):
    return lambda scene, **options: vibroplat.simulate(scene.replace({"solver.engine": request.param}), **options)


def test_flight_fraction_of_the_inelastic_ball(simulate):
    for gamma, fraction in ((1.5, 0.567581021819), (3.0, 0.949774312877)):
        summary = simulate(ball_on_table(gamma)).summary
        assert summary["outcome"] == "ok"
        assert summary["flight_fraction"] == pytest.approx(fraction, abs=1e-6)
        assert summary["liftoffs"] == 40
        assert summary["impacts"] in (39, 40)


def test_landing_speed_of_the_inelastic_ball(simulate):
    impacts = simulate(ball_on_table(2.0)).events.query("kind == 'impact'")
    assert impacts["gap_rate_before_m_per_s"].iloc[-1] * OMEGA / GRAVITY == pytest.approx(-3.8326824916, abs=1e-8)


def test_no_flight_below_one_g(simulate):
    assert simulate(ball_on_table(1.0 - 1e-6, tolerance=1e-8)).summary["events"] == 0


def short_flight_fraction(gamma):
    """Release at sin φ₀ = 1/Γ, landing by bisection of the ball's parabola against the sine."""
    release = math.asin(1.0 / gamma)

    def gap(angle):
        s = angle - release
        return gamma * math.sin(release) + gamma * math.cos(release) * s - 0.5 * s * s - gamma * math.sin(angle)

    first = 3.0 * math.sqrt(2.0 * (gamma - 1.0))  # leading order of the flight's length in angle
    return (brentq(gap, release + 0.5 * first, release + 2.0 * first, xtol=1e-15) - release) / TURN


def test_short_flights_are_neither_missed_nor_doubled(simulate):
    """Just above lift-off the gap opens on a triple root; each period has one liftoff and one impact."""
    excess = 1e-3
    run = simulate(ball_on_table(1.0 + excess, tolerance=1e-9))
    assert run.summary["liftoffs"] == run.summary["impacts"] == 40
    # the fraction goes with √(Γ − 1), which amplifies the error of F_c (3e-9 at this tolerance) by 1/excess
    expected = short_flight_fraction(1.0 + excess)
    assert run.summary["flight_fraction"] == pytest.approx(expected, rel=1e-8 / excess + 1e-7)


def test_shortest_flights_cause_no_storm(simulate):
    # F_c falls by the excess below zero; its error is some 100 times the tolerance
    run = simulate(ball_on_table(1.0 + 1e-7, tolerance=1e-10))
    assert run.outcome == "ok"
    assert run.summary["liftoffs"] == run.summary["impacts"] == 40


def test_accumulation_time_of_a_dropped_ball(simulate):
    restitution = 0.8
    events = simulate(dropped_ball(restitution)).events
    chatter = events[events["kind"] == "chatter"].iloc[0]
    assert chatter["t_s"] == pytest.approx(accumulation_time(restitution), rel=1e-8)
    assert chatter["mode_after"] == "attached"


def rest_of_dropped_ball(restitution, sticking_speed):
    """Number of the impact at which a ball dropped from 1 m comes to rest, and its time."""
    time = math.sqrt(2.0 / GRAVITY)
    number, speed = 1, GRAVITY * time
    while speed >= sticking_speed:
        speed *= restitution
        number, time = number + 1, time + 2.0 * speed / GRAVITY
    return number, time


def sticking_ball(restitution, sticking_speed):
    return dropped_ball(restitution).replace({"contact.restitution_threshold_m_per_s": sticking_speed})


@pytest.mark.parametrize(("restitution", "sticking_speed"), [(0.3, 5.0), (0.8, 1e-12)])
def test_ball_comes_to_rest_at_the_first_impact_that_is_too_slow(simulate, restitution, sticking_speed):
    """The last is summed by the chatter, which counts what it sums."""
    scene = sticking_ball(restitution, sticking_speed)
    run = simulate(scene)
    number, time = rest_of_dropped_ball(restitution, sticking_speed)
    last = run.events.iloc[-1]
    assert run.outcome == "ok"
    assert run.events["impacts"].sum() == number
    assert last["kind"] == ("impact" if sticking_speed > 1e-7 else "chatter")
    assert last["t_s"] == pytest.approx(time, rel=1e-10)
    assert last["gap_rate_after_m_per_s"] == 0.0
    assert last["mode_after"] == "attached"
    after = run.trajectory[run.trajectory["t_s"] >= last["t_s"]].iloc[1:]
    assert len(after) > 10
    assert (after[["gap_m", "gap_rate_m_per_s"]] == 0.0).all(axis=None)
    assert run.events["energy_loss_j"].sum() == pytest.approx(scene.layer_masses[0] * GRAVITY, rel=1e-10)
    assert run.events["impulse_n_s"].sum() == pytest.approx(scene.layer_masses[0] * GRAVITY * time, rel=1e-10)
    assert run.summary["energy_residual"] < 1e-12
    assert run.summary["momentum_residual"] < 1e-12


def test_impact_at_the_sticking_speed_rebounds(simulate):
    speed = -simulate(dropped_ball(0.5)).events["gap_rate_before_m_per_s"].iloc[0]
    assert len(simulate(sticking_ball(0.5, speed)).events) == 2
    assert len(simulate(sticking_ball(0.5, math.nextafter(speed, 10.0))).events) == 1
