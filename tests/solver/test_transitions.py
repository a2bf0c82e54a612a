"""The rules between modes, by themselves and in scenes made for them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from vibroplat.integrate.interpolation import dip_below_zero
from vibroplat.integrate.tape import blank_tape, calm, transcribe, write

from vibroplat import simulate
from vibroplat.bench.known import ball_on_table
from vibroplat.bench.scenes import base
from vibroplat.hybrid import transitions as rules
from vibroplat.model.impact import impulse_response
from vibroplat.model.parameters import IMPACT_LAWS, parameters
from vibroplat.observe.statistics import extremes
from vibroplat.scene import COORDINATES, RATES

#: Tolerance of the run (that of the quickstart), and contact forces that are round-off of larger ones (N).
TOLERANCE, NOISE = 1e-6, 1e-11


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
    assert rules.presses(force, rate, NOISE, p) is expected


def test_dead_impact_attaches_only_where_contact_presses(p):
    assert rules.after_impact(0.0, 10.0, 0.0, -8.0, 0.0, True, TOLERANCE, NOISE, p) == rules.ATTACH
    assert rules.after_impact(0.0, -1.0, 0.0, 0.8, 0.0, True, TOLERANCE, NOISE, p) == rules.FLY


def test_rebound_flies_until_it_is_slow_enough(p):
    assert rules.after_impact(1e-1, 10.0, 0.0, -8.0, 1e3, True, TOLERANCE, NOISE, p) == rules.FLY
    assert rules.after_impact(1e-9, 10.0, 0.0, -8.0, 1e3, True, TOLERANCE, NOISE, p) == rules.LATCH
    assert rules.after_impact(1e-9, -10.0, 0.0, 8.0, 1e3, True, TOLERANCE, NOISE, p) == rules.FLY


def test_elastic_impacts_do_not_accumulate(p):
    p.restitution = 1.0
    assert rules.after_impact(1e-12, 10.0, 0.0, -8.0, 0.0, True, TOLERANCE, NOISE, p) == rules.FLY


def test_impacts_that_soon_stick_close_sooner(p):
    p.restitution = 0.999
    assert rules.after_impact(1e-6, 10.0, 0.0, -8.0, 0.0, True, TOLERANCE, NOISE, p) == rules.FLY
    p.sticking_speed = 1e-5
    assert rules.after_impact(1e-6, 10.0, 0.0, -8.0, 0.0, True, TOLERANCE, NOISE, p) == rules.LATCH
    p.restitution = 1.0  # followed, as all elastic impacts
    assert rules.after_impact(1e-6, 10.0, 0.0, -8.0, 0.0, True, TOLERANCE, NOISE, p) == rules.FLY


def test_accumulation_threshold_bounds_the_neglected_jerk(p):
    """Just below the threshold ω₀|j|τ² ≤ tol|a|, so t∞ is off by at most tol/ω₀."""
    acceleration, jerk = -8.0, 3e4
    speeds = np.logspace(-9, -1, 400)
    closed = [v for v in speeds if rules.accumulates(v, acceleration, jerk, True, TOLERANCE, p)]
    duration = 2.0 * max(closed) / (0.5 * -acceleration)
    shift = jerk * duration**2 / -acceleration
    assert shift <= TOLERANCE / p.speed[0]
    assert shift >= 0.9 * TOLERANCE / p.speed[0]


def test_excursion_after_rebound_and_release():
    assert rules.excursion(0.2, -10.0, 5.0, 1.0) == pytest.approx((0.04, 0.002))
    duration, height = rules.excursion(0.0, 0.0, 6.0, -24.0)  # gap = t³ − t⁴
    assert (duration, height) == pytest.approx((1.0, 27.0 / 256.0))
    assert rules.excursion(0.0, 2.0, -6.0, 0.0) == pytest.approx((1.0, 4.0 / 27.0))  # gap = t² − t³
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
        (33.0**2 / 64.0**2 - 1e-5, 31.0**2 / 64.0**2 - 1e-5, -33.0 / 32.0, 31.0 / 32.0, 33.0 / 64.0 - math.sqrt(1e-5)),
        (-1.0, -2.0, 2.0, -4.0, 1.0 / 3.0),  # −1 + 2s − 3s²: falls from its highest
    ],
)
def test_dip_inside_a_step(g0, g1, rate_0, rate_1, expected):
    assert dip_below_zero(1.0, g0, g1, rate_0, rate_1) == pytest.approx(expected, abs=1e-9)


def calmed(values, slopes):
    """Slopes of F_c, one of two unknowns, after they have been limited; steps of 1."""
    tape = blank_tape(len(values) + 3)
    for k, (value, slope) in enumerate(zip(values, slopes, strict=True)):
        write(tape, float(k), np.array([7.0, value]), np.array([50.0, slope]))
    calm(tape, 1, True, True)
    assert (tape.yp[: len(values), 0] == 50.0).all()
    return tape.yp[: len(values), 1].tolist()


def test_slopes_of_the_force_that_belong_to_its_values_stay():
    times = np.arange(12.0)
    slopes = 0.3 * np.cos(0.3 * times)
    assert calmed(2.0 + np.sin(0.3 * times), slopes) == slopes.tolist()


@pytest.mark.parametrize(
    ("slopes", "expected"),
    [
        ([-9.0, 0.0, 0.0], [-3.0, 0.0, 0.0]),  # thrice the secant
        ([0.0, 80.0, 0.0], [0.0, 3.0, 0.0]),  # the larger secant counts, and F_c = 1 before a step of 1
        ([0.0, -80.0, 0.0], [0.0, -3.0, 0.0]),
        ([0.0, 0.0, 9.0], [0.0, 0.0, 0.0]),  # nothing that ends at 0 has come from below
    ],
)
def test_wild_slopes_of_the_force_are_limited(slopes, expected):
    assert calmed([2.0, 1.0, 0.0], slopes) == expected


@settings(derandomize=True, deadline=None, database=None)
@given(st.lists(st.tuples(st.floats(0.0, 1e3), st.floats(-1e6, 1e6)), min_size=2, max_size=8))
def test_a_force_that_presses_at_all_steps_presses_between_them(rows):
    values, slopes = zip(*rows, strict=True)
    slopes = calmed(values, slopes)
    for k in range(len(values) - 1):
        least, _ = extremes(1.0, values[k], values[k + 1], slopes[k], slopes[k + 1])
        assert least >= -1e-9 * max(values)


def recorded(g, rates, at_guard=False):
    """Write steps of one unknown, its own guard, to a tape."""
    tape = blank_tape(len(g) + 3)
    t = np.arange(len(g), dtype=float)
    ended = transcribe(tape, t, np.array(g)[:, np.newaxis], np.array(rates)[:, np.newaxis], 0, at_guard)
    rows = tape.used[0]
    return ended, tape.t[:rows], tape.y[:rows, 0]


def test_tape_ends_at_a_fall_between_two_steps():
    ended, t, g = recorded([1.0, 0.1, 0.1, 1.0], [-1.0, -1.0, 1.0, 1.0])
    assert ended
    assert len(t) == 3
    assert 1.0 < t[-1] < 1.5
    assert abs(g[-1]) < 1e-12


def test_tape_keeps_steps_without_a_fall():
    ended, t, _ = recorded([1.0, 0.6, 0.6, 1.0], [-1.0, -0.1, 0.1, 1.0])
    assert not ended
    assert t.tolist() == [0.0, 1.0, 2.0, 3.0]


def test_fall_that_the_integrator_found_stays_where_it_is():
    ended, t, _ = recorded([1.0, 0.5, -1e-18], [-0.5, -0.5, -0.5], at_guard=True)
    assert ended
    assert t.tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize("torque", [2e4, 1e5, 2e5])
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


@pytest.mark.parametrize("restitution", [0.0, 0.3, 0.7])
@pytest.mark.parametrize("layers", [1, 2])
def test_gap_and_force_keep_their_sign(damped, restitution, layers):
    scene = damped.replace(
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


@pytest.mark.parametrize("law", IMPACT_LAWS)
@pytest.mark.parametrize("restitution", [0.5, 1.0])
def test_slow_impacts_stick_and_fast_ones_rebound(quickstart, restitution, law):
    slowest = 0.3
    contact = {"restitution": restitution, "sticking_speed_m_per_s": slowest, "impact_law": law}
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


@pytest.mark.parametrize("law", IMPACT_LAWS)
def test_where_all_impacts_stick_restitution_does_not_matter(quickstart, law):
    contact = {"restitution": 0.5, "sticking_speed_m_per_s": 1e30, "impact_law": law}
    scene = quickstart.replace({"contact": contact, "run.duration_s": 1.0})
    runs = [simulate(scene.replace({"contact.restitution": r})) for r in (0.0, 0.5, 1.0)]
    runs.append(simulate(scene.replace({"contact": {"restitution": 0.0, "sticking_speed_m_per_s": 0.0}})))
    for run in runs[1:]:
        assert run.trajectory.equals(runs[0].trajectory)
        assert run.events.equals(runs[0].events)


def test_sticking_speed_ends_a_storm_of_elastic_impacts():
    """A layer that lands softly and presses: R = 1 never lets it rest, a tenth of a metre per second does."""
    scene = base(1e-8, 2.0).replace({"material.mass_ratio": 0.2, "drive.supply_frequency_hz": 45.0})
    scene = scene.replace({"contact.restitution": 1.0, "solver.max_events_per_period": 100})
    assert simulate(scene, keep="summary").outcome == "event-storm"
    run = simulate(scene.replace({"contact.sticking_speed_m_per_s": 0.1}))
    assert run.outcome == "ok"
    assert run.summary["energy_residual"] < 1e-5
    assert run.trajectory["mode"].iloc[-1] == "attached"


def test_flight_that_the_platform_drives_off_and_meets_again_at_once(damped):
    """A dead impact where F_c < 0 but rises: the gap opens as at²/2 and closes after half a millisecond."""
    state = {
        "y_m": 0.002,
        "phi1_rad": -1.2125052221854418,
        "phi2_rad": -0.070718269560059,
        "phi1_rate_rad_per_s": -100.0,
        "gap_m": 1e-3,
        "gap_rate_m_per_s": 1e-6,
        "phi_rad": 0.01,
    }
    scene = damped.replace(
        {
            "material": {"mass_ratio": 0.00942538258574175, "layers": 1},
            "drive.supply_frequency_hz": 26.369930004083688,
            "machine.gravity_m_per_s2": 1.0,
            "solver.tolerance": 2.2489e-4,
            "run.duration_s": 0.35,
            "run.initial": {"state": state},
        }
    )
    for shift in np.linspace(0.0, 0.03, 31):
        run = simulate(scene.replace({"run.initial.state.phi1_rad": state["phi1_rad"] + shift}), keep="summary")
        assert run.outcome == "ok"
        assert run.summary["restarts"] < 40


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
