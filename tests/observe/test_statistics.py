"""Statistics and the Poincaré section of a run."""

import math

import numpy as np
import pytest
from common.known import motion_of

from vibroplat import simulate
from vibroplat.hybrid.state import WIDTH
from vibroplat.kernels.compiled import compiled
from vibroplat.kernels.lines import in_lines
from vibroplat.observe.extremes import HEIGHT, NODES, REACH, Equations, Span, empty_extremes
from vibroplat.observe.measures import SECTION_POINTS, SUMMED, WHOLE_RUN, WITH_EXTREMES
from vibroplat.observe.peaks import EIGHT, beyond_limits, polish
from vibroplat.observe.room import ROOM
from vibroplat.observe.section import section_rows
from vibroplat.observe.statistics import Statistics
from vibroplat.report.data_sheet import whole_run
from vibroplat.report.summary import measure, synchronization
from vibroplat.study.classification import block_values


def test_statistics_agree_with_the_tables(quickstart):
    run = simulate(quickstart.replace({"run.duration_s": 2.0, "output.sample_rate_hz": 20_000.0}))
    summary, table = run.summary, run.trajectory
    turns = np.floor(table["phi1_rad"] / (2.0 * np.pi))
    crossings = table["t_s"][1:][np.diff(turns) > 0]
    window = crossings[crossings >= 1.0]
    part = table[table["t_s"].between(window.iloc[0], window.iloc[-1])]
    assert summary["rms_y_m"] == pytest.approx(part["y_m"].std(ddof=0), rel=1e-3)
    assert summary["excitation_frequency_hz"] == pytest.approx(
        (len(window) - 1) / (window.iloc[-1] - window.iloc[0]), rel=1e-4
    )
    assert summary["contact_force_max_n"] == pytest.approx(part["contact_force_n"].max(), rel=1e-4)
    assert summary["gap_max_m"] == pytest.approx(part["gap_m"].max(), rel=1e-3)
    assert summary["contact_force_max_n"] < 0.9 * table["contact_force_n"].max()
    assert summary["flight_fraction"] == pytest.approx((part["mode"] == "flight").mean(), abs=2e-3)


@pytest.mark.parametrize(("seconds", "at_window"), [(0.132, "max"), (0.172, "min")])
def test_extremes_begin_where_the_measured_part_begins_within_a_step(quickstart, seconds, at_window):
    """The force rings down past an extreme, so that its largest or least value is where the measured part begins."""
    lifted = {"y_m": -0.0006, "phi1_rate_rad_per_s": 0.1, "phi2_rate_rad_per_s": -0.1}
    still = {"motor.critical_torque_n_m": 0.0, "motor.friction_radius_m": 0.0, "run.initial": {"state": lifted}}
    run = simulate(quickstart.replace({**still, "run.duration_s": seconds, "solver.tolerance": 1e-8}))
    dense = run(np.linspace(0.5 * seconds, seconds, 20_001))
    force = dense["contact_force_n"]
    assert force.iloc[0] == getattr(force, at_window)()
    for end in ("max", "min"):
        assert run.summary[f"contact_force_{end}_n"] == pytest.approx(getattr(force, end)(), rel=1e-6)
    assert run.summary["amplitude_y_m"] == pytest.approx(0.5 * np.ptp(dense["y_m"]), rel=1e-6)


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_events_are_counted_in_whole_turns_and_in_the_whole(quickstart, restitution):
    run = simulate(quickstart.replace({"run.duration_s": 1.0, "contact.restitution": restitution}))
    late = run.events[run.events["t_s"].between(run.summary["measured_from_s"], run.summary["measured_to_s"])]
    assert 0 < len(late) < len(run.events) == run.summary["events"]
    for kind, name in (("liftoff", "liftoffs"), ("impact", "impacts"), ("chatter", "chatters")):
        assert run.summary[name] == (run.events["kind"] == kind).sum()
        assert run.summary[f"measured_{name}"] == (late["kind"] == kind).sum()
    assert run.summary["impulse_max_n_s"] == late["impulse_n_s"].max() < run.events["impulse_n_s"].max()
    assert run.summary["impulse_sum_n_s"] == pytest.approx(run.events["impulse_n_s"].sum(), rel=1e-12)


def test_the_measured_part_is_named(quickstart):
    run = simulate(quickstart.replace({"run.duration_s": 1.0}))
    summary = run.summary
    assert (summary["measured_from_s"], summary["measured_to_s"]) == tuple(run.section["t_s"].iloc[[0, -1]])
    assert 0.5 <= summary["measured_from_s"] < 0.55
    assert 0.95 < summary["measured_to_s"] <= 1.0
    assert summary["measured_turns"] == len(run.section) - 1 > 10
    assert summary["measured_s"] == pytest.approx(np.ptp(run.section["t_s"]), abs=1e-9)


def test_a_run_that_ends_before_its_measured_part_has_no_extremes_of_it(quickstart):
    run = simulate(quickstart.replace({"solver.max_events_per_period": 1, "contact.restitution": 0.5}))
    assert run.summary["simulated_s"] < run.summary["measured_from_s"] == run.summary["measured_to_s"] == 2.0
    assert run.summary["events"] > 0
    for name in ("contact_force_max_n", "contact_force_min_n", "rms_y_m", "measured_s"):
        assert run.summary[name] is None
    assert [run.summary[f"measured_{name}"] for name in ("liftoffs", "impacts", "chatters", "turns")] == [0, 0, 0, 0]


def test_the_largest_rotation_is_that_of_the_whole_run(quickstart):
    """A platform that is let go rings down."""
    state = {"phi_rad": -0.02, "phi1_rate_rad_per_s": 0.1, "phi2_rate_rad_per_s": -0.1}
    still = {"motor.critical_torque_n_m": 0.0, "motor.friction_radius_m": 0.0, "run.initial": {"state": state}}
    run = simulate(quickstart.replace({**still, "run.duration_s": 2.0}))
    assert run.summary["phi_max_rad"] == pytest.approx(0.02, rel=1e-9)
    assert run.trajectory["phi_rad"][run.trajectory["t_s"] >= 1.0].abs().max() < 0.01


def test_a_contact_force_below_zero_is_found_before_the_measured_part(quickstart):
    """An upper layer of 1 kHz and a loose tolerance: F_c falls below 0 just before a liftoff."""
    stiff = {"material.natural_frequency_hz": 1000.0, "material.damping_ratio": 0.02, "solver.tolerance": 1e-3}
    run = simulate(quickstart.replace({**stiff, "run.duration_s": 0.4, "output.sample_rate_hz": 200_000.0}))
    table = run.trajectory
    early, late = (table["contact_force_n"][part].min() for part in (table["t_s"] < 0.2, table["t_s"] >= 0.2))
    assert early < -1e-7 < late
    assert run.summary["contact_pull_n"] == pytest.approx(-early, rel=1e-3)
    assert run.summary["contact_force_min_n"] > -1e-7
    time = float(table.loc[table["contact_force_n"].idxmin(), "t_s"])
    measured = simulate(run.scene.replace({"run.duration_s": 1.5 * time}), keep="summary").summary
    assert measured["contact_pull_n"] == -measured["contact_force_min_n"] == pytest.approx(-early, rel=1e-3)


def test_speeds_of_exciters_that_differ_are_their_turns_over_their_time(quickstart):
    braked = {"critical_torque_n_m": 0.0, "friction_radius_m": 5e-3}
    run = simulate(quickstart.replace({"exciters": [{}, braked], "run.duration_s": 0.5, "material.mass_ratio": 0.0}))
    passed = run.section.iloc[-1] - run.section.iloc[0]
    first, second = (abs(passed[f"phi{n}_rad"]) / (2.0 * np.pi * passed["t_s"]) for n in (1, 2))
    assert first > 1.2 * second
    assert run.summary["excitation_frequency_hz"] == pytest.approx(0.5 * (first + second), rel=1e-9)
    assert run.summary["frequency_split_hz"] == pytest.approx(first - second, rel=1e-9)


def test_an_exciter_that_swings_completes_no_turn_and_has_a_mean_speed(printed):
    idle = {"critical_torque_n_m": 0.0, "friction_radius_m": 0.0}
    state = {"phi1_rad": 0.5, "phi2_rad": 0.2}
    scene = printed.replace({"motor": idle, "run.duration_s": 4.0, "run.initial": {"state": state}})
    run = simulate(scene)
    passed = abs(run([2.0, 4.0])[["phi1_rad", "phi2_rad"]].diff().iloc[1]) / (2.0 * np.pi * 2.0)
    assert run.summary["excitation_frequency_hz"] == pytest.approx(passed.mean(), rel=1e-6)
    assert run.summary["frequency_split_hz"] == pytest.approx(passed["phi1_rad"] - passed["phi2_rad"], rel=1e-6)
    assert synchronization(run.summary) == "none"
    assert run.summary["measured_s"] == pytest.approx(2.0, abs=0.01)
    assert len(run.section) <= 1


def test_poincare_section_is_the_motion_at_whole_turns(quickstart):
    run = simulate(quickstart.replace({"run.duration_s": 2.0}))
    section = run.section
    assert len(section) == pytest.approx(1.0 * run.summary["excitation_frequency_hz"], abs=1.5)
    turns = section["phi1_rad"] / (2.0 * np.pi)
    assert np.allclose(turns, np.round(turns), atol=1e-12)
    dense = run(section["t_s"])
    for column in ("y_m", "gap_rate_m_per_s", "contact_force_n"):
        assert np.allclose(section[column], dense[column], rtol=0.0, atol=1e-9 * dense[column].abs().max())


def test_a_turn_completed_in_the_first_step_is_counted(quickstart):
    scene = quickstart.replace({"run.duration_s": 0.01, "run.initial.phi1_rad": 2.0 * np.pi - 1e-9})
    marks = simulate(scene).measures.marks
    assert marks["passed"] == 1.0
    whole = Statistics(0.0)
    with motion_of(scene) as motion:
        motion.to_time(1e-4, [whole])
    assert whole.measures.marks["turns"] == 1
    assert whole.measures.marks["first"][0] == pytest.approx(1e-9 / scene.synchronous_speeds[0], rel=0.1)


@pytest.mark.parametrize("engine", ["native", "taylor"])
def test_a_run_that_begins_on_the_section_and_goes_backwards_loses_nothing(quickstart, engine):
    """Exciter 1 passes angle 0 at the very beginning of the first step: nothing of the step is before it."""
    still = {
        f"machine.{name}": 0.0 for name in ("stiffness_x_n_per_m", "stiffness_phi_n_m_per_rad", "gravity_m_per_s2")
    }
    start = {"run.initial": {"phase_difference_rad": 0.0, "phi1_rad": 0.0, "speed_ratio": -0.5}}
    scene = quickstart.replace(
        {"material.mass_ratio": 0.0, "run.duration_s": 0.4, "run.perturbation": 0.0, "solver.engine": engine, **start}
        | still
    )
    summary = simulate(scene, keep="summary").summary
    assert summary["momentum_residual"] < 1e-5
    assert summary["energy_residual"] < 1e-5


def test_strokes_of_all_points_are_found_where_many_peaks_are_in_a_step(quickstart):
    """A rocking platform: most of its points turn back in each step."""
    points = {f"p{i}": [0.4 * np.cos(i), 0.3 * np.sin(i)] for i in range(8)}
    asked = {"output.points": points, "run.duration_s": 0.4, "run.initial.phase_difference_rad": 1.0}
    run = simulate(quickstart.replace(asked | {"solver.engine": "taylor"}))
    dense = run(np.linspace(run.summary["measured_from_s"], run.summary["measured_to_s"], 20_001))
    for name, (x, y) in run.scene.named_points.items():
        for axis, moved in (("x", dense["x_m"] - y * dense["phi_rad"]), ("y", dense["y_m"] + x * dense["phi_rad"])):
            stroke = np.ptp(moved)
            assert stroke * (1.0 - 1e-12) <= run.summary[f"stroke_{axis}_{name}_m"] <= stroke * (1.0 + 1e-5)


@compiled
def screen(samples, nodes, reach, limits, found):
    found[0], found[1] = beyond_limits(samples, nodes, reach, limits, 0)


def oscillations(s, rates, phases, sizes, slopes):
    return np.cos(rates[0] * s + phases[0]) + sizes * np.cos(rates[1] * s + phases[1]) + slopes * s


@pytest.mark.parametrize(("nodes", "turn"), [(4, 3.2), (6, 4.0), (8, 4.3), (10, 4.5)])
def test_screening_lets_no_extreme_between_samples_pass(nodes, turn):
    """Two oscillations as fast as the degree allows, and a straight line, against limits just inside their extremes."""
    rng, places = np.random.default_rng(nodes), np.concatenate([[0.0], NODES[nodes, :nodes], [1.0]])
    dense = np.linspace(0.0, 1.0, 2001)[:, np.newaxis]
    limits, found = in_lines((2, EIGHT)), np.zeros(2, np.int64)
    for _ in range(300):
        rates, phases = rng.uniform(0.05, turn, (2, EIGHT)), rng.uniform(0.0, 2.0 * np.pi, (2, EIGHT))
        sizes, slopes = rng.uniform(-1.0, 1.0, EIGHT) * rng.integers(0, 2, EIGHT), rng.uniform(-3.0, 3.0, EIGHT)
        samples, true = in_lines((nodes + 2, EIGHT)), oscillations(dense, rates, phases, sizes, slopes)
        samples[:] = oscillations(places[:, np.newaxis], rates, phases, sizes, slopes)
        least, largest = true.min(axis=0), true.max(axis=0)
        limits[0], limits[1] = least + 1e-9 * np.abs(least), largest - 1e-9 * np.abs(largest)
        screen(samples, nodes, REACH[nodes], limits, found)
        assert found.tolist() == [0xFF, 0xFF]
        limits[0], limits[1] = least - np.ptp(true, axis=0), largest + np.ptp(true, axis=0)
        samples[:, -1] = np.nan  # what a system does not have is beyond no limit
        limits[:, -1] = 1.0, -1.0
        screen(samples, nodes, REACH[nodes], limits, found)
        assert found.tolist() == [0, 0]


@pytest.fixture(scope="module")
def parts(quickstart):
    """The same motion measured in each scope, in two blocks."""
    found = []
    for scope in (SECTION_POINTS, SUMMED, WITH_EXTREMES, WHOLE_RUN):
        with motion_of(quickstart) as motion:
            motion.to_time(1.0)
            found.append(motion.advance(1.0, blocks=2, scope=scope))
    return found


def test_a_smaller_scope_measures_the_same_bits(parts, quickstart):
    everything = parts[WHOLE_RUN]
    for part in parts:
        for field in ("t", "state"):
            assert np.array_equal(section_rows(part.measures)[field], section_rows(everything.measures)[field])
        assert part.measures.marks["counts"].tolist() == everything.measures.marks["counts"].tolist()
    for part in parts[SUMMED:]:
        assert np.array_equal(block_values(part.blocks), block_values(everything.blocks))
        assert part.measures.work.tolist() == everything.measures.work.tolist()
    assert measure(parts[WITH_EXTREMES], quickstart) == measure(everything, quickstart)


def test_what_was_not_measured_is_refused_instead_of_0(parts, quickstart):
    asked = (
        lambda part: block_values(part.blocks),
        lambda part: measure(part, quickstart),
        lambda part: whole_run(part.measures, quickstart, 0.0, [], False),
    )
    for needed, ask in enumerate(asked, SUMMED):
        ask(parts[needed])
        with pytest.raises(ValueError, match=f"{needed} is needed"):
            ask(parts[needed - 1])


def test_a_peak_hangs_on_nothing_that_is_looked_for_beside_it():
    """The search in another lane goes on for longer, as it did for what an observer had found before."""
    degree, peak = 12, (0.5 * math.pi - 0.5) / 3.0
    sine = np.array([math.sin(0.5 + 0.5 * math.pi * k) * 3.0**k / math.factorial(k) for k in range(degree + 1)])
    span = Span(0.0, 1.0, np.zeros((degree + 1, WIDTH)), degree, 0.0, 1.0, 0, 8, Equations(0, 0))
    for start in np.linspace(peak - 0.15, peak + 0.15, 16):
        found = []
        for beside in (peak, 0.02):
            room, extremes = in_lines((ROOM.itemsize // 8,)).view(ROOM)[0], empty_extremes(1)[0]
            room["series"][: degree + 1, 0] = sine[:, np.newaxis]
            room["place"], room["high"], room["sense"], room["quantity"] = beside, 1.0, 1.0, HEIGHT
            room["place"][0] = start
            polish(extremes, room, span, 1)
            found.append((extremes["largest"][HEIGHT], extremes["at_largest"][HEIGHT]))
        assert found[0] == found[1]
        assert found[0] == pytest.approx((1.0, peak), abs=1e-6)
