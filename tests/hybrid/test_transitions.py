"""Transitions in scenes made for them: liftoffs, impacts, chatters."""

import numpy as np
import pytest
from common.known import ball_on_table, motion_of

from vibroplat import simulate
from vibroplat.bench.measure import base
from vibroplat.config.coordinates import COORDINATES, RATES
from vibroplat.hybrid.resets import apply_impact
from vibroplat.model.impact import impulse_response
from vibroplat.model.parameters import IMPACT_LAWS, parameters
from vibroplat.model.systems import GAP, GAP_RATE


@pytest.mark.parametrize("torque", [2e4, 2e5])
def test_force_that_stays_below_zero_where_it_turns_is_a_flight(quickstart, torque):
    """A jerky drive: F_c rises again 3e-4 N below zero; contact that went on there would not end."""
    run = simulate(quickstart.replace({"motor.critical_torque_n_m": torque, "run.duration_s": 0.1}))
    assert run.outcome == "ok"
    assert run.summary["restarts"] < 40


def test_contact_that_touches_zero_goes_on():
    """At Γ = 1 up to round-off F_c touches zero once a turn: no flight longer than round-off makes."""
    run = simulate(ball_on_table(1.0, tolerance=1e-9, periods=10))
    assert run.outcome == "ok"
    assert run.summary["flight_fraction"] < 1e-5
    assert run.summary["gap_max_m"] < 1e-15


@pytest.mark.parametrize(("law", "restitution"), list(zip(IMPACT_LAWS, (0.5, 1.0, 0.5), strict=True)))
def test_slow_impacts_stick_and_fast_ones_rebound(quickstart, restitution, law):
    slowest = 0.3
    contact = {"restitution": restitution, "restitution_threshold_m_per_s": slowest, "impact_law": law}
    scene = quickstart.replace({"contact": contact, "run.duration_s": 2.0})
    run = simulate(scene)
    p, table = parameters(scene), run.trajectory
    impacts = run.events[run.events["kind"] == "impact"]
    sticking = impacts["gap_rate_before_m_per_s"] > -slowest
    assert min(sticking.sum(), (~sticking).sum()) > 5
    assert set(run.events["kind"]) == {"liftoff", "impact"}  # what sticks need not accumulate
    for event, sticks in zip(impacts.itertuples(), sticking, strict=True):
        before = table.loc[table["t_s"] == event.t_s, [*COORDINATES, *RATES]].iloc[-2].to_numpy()
        share, speed = 0.0 if sticks else restitution, -event.gap_rate_before_m_per_s
        reduced = impulse_response(before, np.empty(7), p)
        assert event.gap_rate_after_m_per_s == share * speed
        assert event.impulse_n_s == pytest.approx((1.0 + share) * reduced * speed, rel=1e-9)
        if law == "conservative":
            loss = 0.5 * reduced * (1.0 - share**2) * speed**2
            assert event.energy_loss_j == pytest.approx(loss, rel=1e-9, abs=1e-14)


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_layer_that_already_leaves_strikes_nothing(quickstart, restitution):
    """Round-off may find an impact where the gap opens again: an impulse there would pull."""
    contact = {"material": {"mass_ratio": 0.2, "layers": 1}, "contact.restitution": restitution}
    leaving = {"run.initial": {"state": {"gap_m": 1e-12, "gap_rate_m_per_s": 0.1}}}
    with motion_of(quickstart.replace(contact | leaving)) as motion:
        before = motion.automaton.run["state"].copy()
        apply_impact(motion.automaton)
        change = motion.automaton.run["state"] - before
    assert np.flatnonzero(change).tolist() == [GAP, GAP_RATE]
    assert change[GAP_RATE] == -0.1


def test_sticking_speed_ends_a_storm_of_elastic_impacts():
    """A layer that lands softly and presses: R = 1 never lets it rest, a tenth of a metre per second does."""
    scene = base(1e-8, 2.0).replace({"material.mass_ratio": 0.2, "drive.supply_frequency_hz": 45.0})
    scene = scene.replace({"contact.restitution": 1.0, "solver.max_events_per_period": 100})
    assert simulate(scene, keep="summary").outcome == "too-many-events"
    run = simulate(scene.replace({"contact.restitution_threshold_m_per_s": 0.1}))
    assert run.outcome == "ok"
    assert run.summary["energy_residual"] < 1e-5
    assert run.trajectory["mode"].iloc[-1] == "attached"


def test_elastic_layer_at_round_off_comes_to_rest(quickstart):
    """Elastic impacts that have become unresolvably slow end in contact instead of a storm of noise."""
    changes = {"material": {"mass_ratio": 0.2, "layers": 1}, "contact.restitution": 1.0, "run.duration_s": 0.01}
    run = simulate(quickstart.replace(changes | {"run.initial": {"state": {"gap_m": 1e-18}}}))
    assert run.outcome == "ok"


def test_short_falls_land_at_the_right_speed(quickstart):
    """A gap of 1e-10 m is integrated as accurately as its height asks, not as the machine's size does."""
    scene = quickstart.replace(
        {
            "material": {"mass_ratio": 0.2, "layers": 1},
            "run.duration_s": 0.001,
            "run.initial": {"state": {"gap_m": 1e-10}},
        }
    )
    speeds = [
        simulate(scene.replace({"solver.tolerance": t})).events["gap_rate_before_m_per_s"].iloc[0] for t in (1e-5, 1e-9)
    ]
    assert speeds[0] == pytest.approx(speeds[1], rel=1e-3)
