"""How long a point settles, and what is read off a Poincaré section; what does not repeat is known."""

import math
from contextlib import closing, suppress
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from common.known import motion_of
from common.places import LOADED

from vibroplat import Scene, load_config, sweep
from vibroplat.continuation.newton import NoConvergenceError
from vibroplat.continuation.orbit_detection import NewtonOrbitDetector
from vibroplat.hybrid.state import state_scales
from vibroplat.observe import statistics as m
from vibroplat.observe.measures import empty_accumulators
from vibroplat.observe.section import MAX_PERIOD, period, section_points, spreads
from vibroplat.report.summary import measure
from vibroplat.study.branches import branches
from vibroplat.study.classification import BLOCKS
from vibroplat.study.point import ERRORS, measure_point
from vibroplat.study.settling import BLOCK, TURNS, contraction_period, settle

from .helpers import CALIBRATED, CHAOTIC, DAMPED, MACHINE, planned, swept

FIXED = 30.0
SLOW = Path(__file__).parents[1] / "machines" / "slow.yaml"
IN_PHASE = {"run.initial.phase_difference_rad": 0.3}
MATERIAL = {"material.mass_ratio": 0.2}
BOUNCING = {**MATERIAL, "contact.restitution": 0.3}
SERIES = {**MATERIAL, "solver.engine": "taylor"}


# -- auto -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("frequencies", "changes"),
    [((50.0, 52.0, 54.0), {}), pytest.param((50.0, 50.5, 51.0), BOUNCING, marks=pytest.mark.long)],
)
@pytest.mark.parametrize("how", ["newton", "section"])
def test_a_settled_point_is_where_thirty_seconds_lead(how, frequencies, changes):
    """In less time than these."""
    for frequency in frequencies:
        row = swept(MACHINE, frequency, changes=changes, settle_by=how).iloc[0]
        scene = planned(MACHINE, frequency, changes=changes).replace({"drive.supply_frequency_hz": frequency})
        with motion_of(scene) as motion:
            motion.advance(FIXED)
            late = measure(motion.advance(2.0), scene)
        tolerance = scene.sweep.settle_tolerance
        assert (row["motion"], row["period"]) == ("periodic", 1)
        assert row["rms_y_m"] == pytest.approx(late["rms_y_m"], abs=tolerance * scene.length_scale)
        apart = math.remainder(row["phase_difference_rad"] - late["phase_difference_rad"], 2.0 * math.pi)
        assert abs(apart) <= tolerance
        assert row["flight_fraction"] == pytest.approx(late["flight_fraction"], abs=2.0 * tolerance)
        assert row["simulated_s"] < 0.5 * FIXED


def test_auto_settles_by_whole_looks_and_measures_whole_turns():
    row = swept(MACHINE, 50.0, settle_by="section").iloc[0]
    looks = row["settle_s"] / (BLOCK / 25.0)
    assert looks == pytest.approx(round(looks), abs=1e-9)
    assert looks >= 2 * TURNS / BLOCK
    measured = row["simulated_s"] - row["settle_s"]
    assert 2.0 <= measured <= 2.0 + 2.5 / row["excitation_frequency_hz"]


def test_antiphase_that_is_left_slowly_is_not_taken_for_its_goal():
    """At 63 Hz antiphase is left with a rate of 0.13 per s: after some ten seconds it is still near π, and in phase
    after sixty. A point that has not got there yet is neither periodic nor non-periodic.
    """
    row = swept(MACHINE, 63.0).iloc[0]
    assert (row["motion"], row["sync"], row["period"]) == ("periodic", "in-phase", 1)


@pytest.mark.parametrize(("longest", "how"), [(0.5, "maximum"), (7.0, "maximum"), (8.3, "periodic")])
def test_longest_settling_is_kept(longest, how):
    """Bare, in phase from the start, needs 8.13 s at 63 Hz."""
    scene = planned(MACHINE, 63.0, changes=IN_PHASE).replace({"drive.supply_frequency_hz": 63.0})
    with motion_of(scene) as motion:
        settling = settle(motion, scene.sweep, longest)
    assert (settling.reason, settling.seconds) == (how, motion.now)
    if how == "maximum":
        assert settling.seconds == pytest.approx(longest, abs=1e-9)
        assert (settling.period, settling.turn) == (1, 0.0)
    else:
        assert settling.seconds < longest
        assert settling.turn == pytest.approx(1.0 / 31.5, rel=0.02)


def test_a_motion_has_settled_if_it_draws_together_in_two_checks_that_follow_one_another(monkeypatch):
    """A quick transient may hide a slow one at the first."""
    answers = iter([1, 0, 1, 1])
    monkeypatch.setattr("vibroplat.study.settling.contraction_period", lambda *_: next(answers))
    scene = planned(MACHINE, 50.0)
    with motion_of(scene) as motion:
        settling = settle(motion, scene.sweep, 150.0)
    assert (settling.reason, settling.period, list(answers)) == ("periodic", 1, [])


def test_a_section_draws_together_where_what_is_left_is_within_the_tolerance():
    """Heights that fall by ρ a turn fall by q = ρ³² from half to half: D q/(1 − q) is left of a spread D."""
    scene, fall = planned(MACHINE, 50.0), 0.99 ** np.arange(2 * TURNS)
    spread, q = fall[TURNS] - fall[-1], fall[TURNS]
    for share, expected in ((0.9, 1), (2.0, 0)):  # points 16 turns apart are nearer, by 0.56
        points = np.zeros((2 * TURNS, 14))
        points[:, 1] = share * scene.sweep.settle_tolerance * fall * (1.0 - q) / (spread * q)
        assert contraction_period(points, scene, scene.sweep) == expected


def test_longest_settling_counts_from_the_beginning_of_the_motion():
    """What looked settled and was not goes on with it."""
    scene = planned(MACHINE, 62.5).replace(CHAOTIC)
    with motion_of(scene) as motion:
        for longest in (2.0, 3.0, 3.0):
            settling = settle(motion, scene.sweep, longest)
            assert (settling.reason, settling.seconds) == ("maximum", pytest.approx(longest, abs=1e-9))
            assert settling.seconds == motion.now


def test_motion_that_repeats_at_the_end_of_the_plan_is_measured_over_whole_periods():
    """Here it has not drawn together before; what was measured to find out belongs to the settling."""
    row = swept(MACHINE, 63.0, changes=IN_PHASE, settle_by="section", max_settle_s=0.5).iloc[0]
    assert (row["motion"], row["period"]) == ("periodic", 1)
    assert row["settle_s"] >= 0.5 + BLOCKS * 2.0 - 1e-9
    assert 2.0 <= row["simulated_s"] - row["settle_s"] <= 2.0 + 2.5 / row["excitation_frequency_hz"]
    assert row[list(ERRORS.values())].isna().all()


def test_short_measuring_is_enough_to_confirm_a_period():
    """Each half of what is measured must show the period: four of them are measured at least.

    No chaotic transient comes before this motion, whose length would hang on the last bits.
    """
    row = swept(DAMPED, 57.5, changes=MATERIAL, settle_by="section", measure_s=0.01).iloc[0]
    assert (row["motion"], row["period"], row["settle_s"] < 60.0) == ("periodic", 4, True)
    turns = (row["simulated_s"] - row["settle_s"]) * row["excitation_frequency_hz"]
    assert 16.0 <= turns <= 21.5


# -- by orbits ------------------------------------------------------------------------------------------


def test_orbits_are_what_motions_settle_to():
    """In antiphase and in phase; no row has what is left of a transient."""
    options = {"changes": {"material.mass_ratio": 0.02, "solver.engine": "taylor"}, "step": 8.0}
    motion, orbits = (swept(MACHINE, 50.0, 66.0, settle_by=how, **options) for how in ("section", "newton"))
    assert orbits[["motion", "period", "sync", "outcome"]].equals(motion[["motion", "period", "sync", "outcome"]])
    assert orbits["rms_y_m"].to_numpy() == pytest.approx(motion["rms_y_m"].to_numpy(), rel=1e-3, abs=2e-6)
    apart = orbits["phase_difference_rad"] - motion["phase_difference_rad"]
    assert np.abs(np.angle(np.exp(1j * apart))).max() < 6e-3
    assert motion["multiplier_max"].isna().all()
    assert ((orbits["multiplier_max"] > 0.5) & (orbits["multiplier_max"] < 1.0)).all()
    assert orbits["simulated_s"].sum() < 0.5 * motion["simulated_s"].sum()
    others = swept(MACHINE, 50.0, 66.0, settle_by="newton", seed=1, **options)
    for name in ("rms_y_m", "rms_phi_rad", "excitation_frequency_hz", "multiplier_max"):
        assert orbits[name].to_numpy() == pytest.approx(others[name].to_numpy(), rel=1e-5, abs=1e-9)


def test_period_of_an_orbit_is_its_least():
    """Period 4 between chaotic motions, not a multiple of it."""
    row = swept(DAMPED, 57.5, changes=SERIES, settle_by="newton").iloc[0]
    assert (row["motion"], row["period"], row["multiplier_max"] < 1.0) == ("periodic", 4, True)


def test_diagram_of_an_orbit_has_its_points_once():
    (branch,) = branches(planned(DAMPED, 57.5, changes=SERIES, settle_by="newton", kind="bifurcation"))
    point = measure_point(branch.at(0), branch.plan, None, branch.perturbation_key(57.5))
    assert len(set(point.section_y)) == len(point.section_y) == 4
    impacts = point.row["impacts_per_period"] * 4
    assert len(point.impact_speeds) == pytest.approx(impacts)
    assert min(point.impact_speeds) > 0.0


def test_stable_orbit_after_chaos_is_found():
    """A chaotic transient comes before it: the row waits for it."""
    row = swept(DAMPED, 61.0, changes={**SERIES, "contact.restitution": 0.0}, settle_by="newton").iloc[0]
    assert row["period"] == 4


def test_an_orbit_is_found_where_the_motion_repeats_after_several_of_its_periods():
    """Motion that spirals in may come back to itself after three periods first."""
    scene, points = planned(MACHINE, 50.0).replace(SERIES), np.zeros((20, 14))
    points[:, 0] = np.arange(20) % 3
    with closing(NewtonOrbitDetector(scene)) as detector, motion_of(scene) as motion:
        motion.advance(5.0)
        assert detector.detect(motion, points, 0).period == 1


def test_motion_that_goes_round_an_orbit_is_not_taken_to_come_to_it():
    """Unequal exciters at 79 Hz: chaos round a stable orbit of period 1 is nearer to it some turns later."""
    motor = {"critical_torque_n_m": 1.2, "critical_slip": 0.15, "pole_pairs": 2, "friction_radius_m": 1e-5}
    second = {**motor, "critical_torque_n_m": 1.14, "unbalance_radius_m": 0.03, "position_m": [-0.15, 0.03]}
    changes = {"exciters": [{**motor, "unbalance_radius_m": 0.0291}, second], "machine.damping_y_n_s_per_m": 40.0}
    changes["material"] = {"mass_ratio": 0.2, "natural_frequency_hz": 22.0, "damping_ratio": 0.95}
    changes["contact"] = {"restitution": 0.5, "restitution_threshold_m_per_s": 0.15}
    changes |= {"solver.engine": "taylor", "drive.supply_frequency_hz": 79.0, "run.initial.speed_ratio": 1.0}
    scene = planned(MACHINE, 79.0).replace(changes)
    with closing(NewtonOrbitDetector(scene)) as detector, motion_of(scene) as motion:
        motion.advance(9.0)  # this chaos is a transient
        near = []
        for _ in range(24):
            motion.to_section(1, 1.0)
            assert detector.detect(motion, np.zeros((10, 14)), 0) is None
            with suppress(NoConvergenceError):
                near.append(detector.known_orbit(motion.state, 1).multiplier)
    assert min(near) < 1.0


def test_chaos_settles_as_long_as_the_plan_allows():
    """Also where all orbits near it are clearly unstable: it may come to one of many turns yet."""
    row = swept(CALIBRATED, 55.0, changes={**SERIES, "contact.restitution": 0.5}).iloc[0]
    assert (row["motion"], row["settle_s"]) == ("chaotic", pytest.approx(150.0, abs=1e-9))


def slow_row(*torques):
    """The last row of a sweep of the slow machine over these torques."""
    over = {"key": "exciters.0.critical_torque_n_m", "values": list(torques)}
    return sweep(load_config(SLOW).replace({"sweep": {"over": over}})).sweep.iloc[-1]


def test_slow_motion_has_settled_where_it_surely_converges_to_an_orbit():
    """A multiplier of 0.99987 is left for 300 s: the orbit's residual is small far from it, and its way is curved."""
    row = slow_row(2.6981, 3.0)
    assert (row["motion"], row["period"]) == ("periodic", 1)
    assert row["multiplier_max"] == pytest.approx(0.999866, abs=1e-6)


def test_motion_that_has_not_settled_has_no_errors():
    """The phase difference of unequal exciters creeps for minutes."""
    row = slow_row(0.84)
    assert (row["motion"], row["detail"].endswith("the section still drifts")) == ("undecided", True)
    assert row[list(ERRORS.values())].isna().all()


def test_settling_ends_where_the_motion_does():
    storm = {"contact.restitution": 1.0, "solver.max_events_per_period": 3}
    scene = planned(LOADED, 50.0, changes=storm)
    with motion_of(scene) as motion:
        settling = settle(motion, scene.sweep, 150.0)
    assert motion.outcome == "too-many-events"
    assert (settling.reason, settling.seconds) == ("unfinished", motion.now)
    assert motion.now < 150.0


def test_exciters_that_stand_still_settle_until_the_maximum():
    """A section that never gets a point is no settled one."""
    stopped = {"run.initial.speed_ratio": 0.0, "motor.critical_torque_n_m": 0.0}
    row = swept(MACHINE, 50.0, changes=stopped, max_settle_s=3.0).iloc[0]
    assert (row["outcome"], row["motion"], row["settle_s"]) == ("ok", "undecided", pytest.approx(3.0, abs=1e-9))
    assert (row["sync"], row["detail"]) == ("none", "exciter 1 made fewer than two full turns while measured")
    assert pd.isna(row["period"])
    assert math.isnan(row["lyapunov_per_s"])


# -- symmetric motion that has lost stability -------------------------------------------------------------


def test_symmetry_keeps_antiphase_without_a_perturbation():
    """In phase is where the motion goes from everywhere else; who looks at orbits knows that it leaves antiphase."""
    kept, left = (swept(MACHINE, 66.0, settle_by="section", **plan).iloc[0] for plan in ({"perturbation": 0.0}, {}))
    begun = swept(MACHINE, 66.0, changes=IN_PHASE, perturbation=0.0).iloc[0]
    assert abs(kept["phase_difference_rad"]) == pytest.approx(math.pi, abs=1e-4)  # round-off grows, to some 1e-6 here
    assert (kept["sync"], left["sync"], begun["sync"]) == ("antiphase", "in-phase", "in-phase")
    assert left["phase_difference_rad"] == pytest.approx(0.0, abs=1e-3)
    assert left["rms_y_m"] < 1e-3 * kept["rms_y_m"]
    assert left["rms_phi_rad"] == pytest.approx(begun["rms_phi_rad"], rel=1e-3)


# -- the Poincaré section -------------------------------------------------------------------------------

GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


def repeating(n, turns=64, coordinate=1):
    """A section that repeats after n turns, its n points 1 apart in one coordinate."""
    points = np.full((turns, 14), 0.3)
    points[:, coordinate] += np.arange(turns) % n
    return points


def section_of(states):
    """Points of a section that has seen these states, one a turn."""
    ms = empty_accumulators(0.0)
    for turn, state in enumerate(states):
        ms.section["state"][turn % m.SECTION_ROWS] = state
    ms.marks["turns"] = len(states)
    return section_points(ms, Scene())


# -- period ---------------------------------------------------------------------------------------------


def test_period_is_the_smallest_number_of_turns_after_which_each_point_is_seen_twice():
    for n, coordinate in ((1, 0), (3, 6), (12, 13), (16, 1)):
        assert period(repeating(n, coordinate=coordinate), 1e-9) == n
        assert period(repeating(n, 2 * n), 1e-9) == n
        assert period(repeating(n, 2 * n - 1), 1e-9) == 0
    assert MAX_PERIOD == 16
    assert period(repeating(17, 200), 1e-9) == period(np.zeros((1, 14)), 1.0) == 0


def test_periods_are_told_within_the_tolerance():
    k = np.arange(64)
    closed_curve, doubled, drifting = np.zeros((64, 14)), repeating(1), repeating(1)
    closed_curve[:, 1] = np.cos(2.0 * math.pi * GOLDEN * k)
    assert period(closed_curve, 0.05) == 0
    doubled[::2, 1] += 0.01  # period 1 to who does not look closer
    assert (period(doubled, 0.009), period(doubled, 0.011)) == (2, 1)
    drifting[:, 1] += 0.001 * k  # each point is within the tolerance of the one before, the first is not of the last
    assert (period(drifting, 0.01), period(drifting, 0.0631)) == (0, 1)


def test_spreads_are_those_of_one_to_sixteen_turns():
    """The largest distance of points from the last one that is a multiple of so many turns apart."""
    points = repeating(3, 20)
    last = [[points[19 - (19 - i) % n] for i in range(20)] for n in range(1, 11)]
    found = spreads(points)
    assert found[:10].tolist() == [np.abs(points - np.array(those)).max() for those in last]
    assert np.flatnonzero(found == 0.0).tolist() == [2, 5, 8]
    assert np.isinf(found[10:]).tolist() == [True] * 6


# -- points of a section --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("phases", "turn", "tolerance", "expected"),
    [
        ([math.pi - 1e-4, -math.pi + 1e-4] * 16, 0.0, 1e-3, 1),  # on both sides of π
        ([math.pi - 1e-4, -math.pi + 1e-4] * 16, 0.0, 1e-5, 2),
        (0.3 + 2.0 * math.pi * np.arange(32), 2000.0 * math.pi, 1e-9, 1),  # whole turns do not count
        ([0.5 * math.pi, -0.5 * math.pi] * 16, 0.0, 0.1, 2),  # of the same cosine
        ([0.0, math.pi] * 16, 0.0, 0.1, 2),  # of the same sine
    ],
)
def test_phase_differences_are_those_of_angles(phases, turn, tolerance, expected):
    states = np.zeros((len(phases), 14))
    states[:, 3], states[:, 4] = turn, np.asarray(phases) - turn
    assert period(section_of(states), tolerance) == expected


def test_points_are_in_the_scales_of_the_scene_and_in_the_order_of_time():
    state = np.arange(1.0, 15.0)
    expected = state / state_scales(Scene())
    expected[3:5] = math.cos(9.0), math.sin(9.0)
    assert section_of([state, state]) == pytest.approx(np.array([expected, expected]), rel=1e-14)
    for extra in (0, 5, m.SECTION_ROWS):
        turns = m.SECTION_ROWS + extra
        states = np.zeros((turns, 14))
        states[:, 0] = state_scales(Scene())[0] * np.arange(turns)
        assert section_of(states)[:, 0] == pytest.approx(np.arange(extra, turns))
