"""Notes on what was measured: rotation, capture, samples."""

import math

import pytest
from common.places import QUICKSTART, ROOT

from vibroplat import load_config, simulate
from vibroplat.config.digits import percent
from vibroplat.observe.section import section_rows
from vibroplat.report.data_sheet import whole_run
from vibroplat.report.notes import SlowMotor, free_swing, slow_motors
from vibroplat.results.run_answer import headline
from vibroplat.results.sheet import Sheet, short_lines

#: Captured by the vertical resonance: with f_e = 66 Hz and b_y = 40 the motors turn at 30.493 Hz (Sommerfeld).
CAPTURED = {
    "drive.supply_frequency_hz": 66.0,
    "motor.friction_radius_m": 0.0,
    "run.initial.speed_ratio": 0.8,
    "run.duration_s": 6.0,
}


TAYLOR = {"solver.engine": "taylor"}


def of_motion(scene, **changes):
    return simulate(scene.replace(changes), keep="summary").notes


def test_a_platform_that_turns_far_is_noted(quickstart):
    far = [
        "warning: the platform turns by up to 0.15 rad, over 0.1 rad: inaccurate in a model of first order in phi, and "
        "less unbalance reduces it"
    ]
    for phi, notes in ((0.15, far), (0.05, [])):
        state = {"phi_rad": phi, "phi1_rate_rad_per_s": 160.0, "phi2_rate_rad_per_s": -160.0}
        found = of_motion(quickstart, **{"run.initial.state": state, "run.duration_s": 0.2})
        assert [note for note in found if "the platform" in note] == notes


def test_motors_that_a_resonance_captures_are_noted(printed):
    """Both motors are alike: one note."""
    assert of_motion(printed, **CAPTURED) == [
        "warning: each exciter turns at 30.49 Hz, 7.6 % below its synchronous speed 33.00 Hz: captured by a resonance, "
        "overloaded or still running up, and more torque or a longer run may help"
    ]


def test_only_a_motor_that_is_switched_on_can_be_captured(printed):
    motor = printed.motor.model_dump()
    off = {"motors": [motor, motor | {"critical_torque_n_m": 0.0}], "drive.supply_frequency_hz": 40.0}
    notes = of_motion(printed, **off, **{"machine.damping_y_n_s_per_m": 400.0, "run.duration_s": 6.0})
    assert not [note for note in notes if "exciter 2 turns" in note]


def test_capture_begins_at_a_third_of_the_critical_slip(quickstart):
    window = {"frequency_split_hz": 0.0, "measured_from_s": 1.0, "measured_to_s": 2.0, "impacts_per_period": 0.0}
    for speed, slip, noted in (
        (31.4, 0.15, False),  # the limit is 31.35 Hz
        (31.3, 0.15, True),
        (31.3, 0.3, False),
        (34.0, 0.15, False),
        (0.0, 0.15, True),
    ):
        scene = quickstart.replace({"drive.supply_frequency_hz": 66.0, "motor.critical_slip": slip})
        assert bool(slow_motors(scene, window | {"excitation_frequency_hz": speed})) == noted


def test_a_motor_too_weak_to_turn_is_noted(printed):
    """Its torque does not lift the unbalance over the top."""
    weak = {"motor.critical_torque_n_m": 0.02, "run.initial": {"speed_ratio": 0.0, "phase_difference_rad": 0.0}}
    notes = of_motion(printed, **weak, **{"run.duration_s": 4.0})
    assert notes[1].startswith("each motor gives 5.87 mN·m at standstill, 20.0 mN·m at most, where 28.8 mN·m carry")
    told = "each exciter hardly turns, although its synchronous speed is 25.00 Hz: more torque or a longer run may help"
    assert notes[:1] == [f"warning: {told}"]


def test_a_coarse_tolerance_of_sundials_is_noted_where_impacts_amplify_errors():
    coarse = {"contact.restitution": 0.99, "contact.restitution_threshold_m_per_s": 0.0, "run.duration_s": 2.0}
    scene, noted = load_config(QUICKSTART), {}
    for engine, tolerance in (("native", 1e-3), ("native", 1e-5), ("taylor", 1e-3)):
        notes = of_motion(scene, **coarse, **{"solver.engine": engine, "solver.tolerance": tolerance})
        noted[engine, tolerance] = any("amplify errors" in note for note in notes)
    assert noted == {("native", 1e-3): True, ("native", 1e-5): False, ("taylor", 1e-3): False}


# -- swing ----------------------------------------------------------------------------------------------


FAILURE = {"drive.program": [{"t_s": 0.0, "supply_frequency_hz": 50.0}, {"t_s": 5.0, "exciter_2": "off"}]}


@pytest.mark.parametrize(
    ("seconds", "note"),
    [
        (20.0, "turns or swings: not steady, and a longer run.duration_s helps"),
        (40.0, "swings by ± 68 °: not steady before about run.duration_s = 390"),
        pytest.param(400.0, "swings by ± 3 °: not steady before about run.duration_s = 800", marks=pytest.mark.long),
        pytest.param(1000.0, "", marks=pytest.mark.long),
    ],
)
def test_an_exciter_that_is_off_and_swings_on_is_told_instead_of_a_limit(seconds, note):
    """Its swing decays for minutes; the stroke along x is 2.87 mm in a run of 40 s and 1.54 mm in one of 1000 s."""
    scene = load_config(ROOT / "configs" / "templates" / "screen.yaml", FAILURE | {"run.duration_s": seconds, **TAYLOR})
    run = simulate(scene, keep="summary")
    summary = run.summary
    assert run.notes == ([f"warning: exciter 2, off, still {note}"] if note else [])
    assert (summary["stroke_change"] is None) == bool(note)
    assert "tend to" not in "".join(short_lines(Sheet(scene, summary)))
    if seconds == 40.0:  # of a run that continues another, a part is over
        assert "run.duration_s = 370" in free_swing(scene, summary, section_rows(run.measures), 10.0)
    if not note:
        assert summary["stroke_x_m"] == pytest.approx(1.54e-3, rel=2e-3)


@pytest.mark.parametrize(("seconds", "turns"), [(6.0, True), (60.0, False)])
def test_a_stop_that_is_not_over_is_told(quickstart, seconds, turns):
    program = [{"t_s": 0.0, "supply_frequency_hz": 60.0}, {"t_s": 1.0, "off": True}]
    scene = quickstart.replace({"drive": {"program": program}, "material.mass_ratio": 0.0, "run.duration_s": seconds})
    notes = [note for note in simulate(scene, keep="summary").notes if "still turn or swing" in note]
    assert len(notes) == turns


def test_shear_inside_a_bed_is_told_by_its_share_of_the_contact():
    """Its mean is 0.2 of the mean pressure, so that means tell nothing."""
    changes = {"transport.friction": 1.5, "transport.static_friction": 1.5, "run.duration_s": 6.0}
    scene = load_config(ROOT / "configs" / "templates" / "feeder.yaml", changes | TAYLOR)
    run = simulate(scene)
    table = run.trajectory
    table = table[(table["t_s"] >= run.summary["measured_from_s"]) & table["mode"].isin(["stick", "slip+", "slip-"])]
    (lower, upper), (square, rate) = scene.layer_masses, scene.layer_spring
    pressure = -upper * (square * table["upper_m"] + rate * table["upper_rate_m_per_s"])
    shear = table["friction_force_n"].abs() * upper / (lower + upper)
    assert shear.mean() < 0.3 * pressure.mean()
    told = run.summary["sheared_fraction"]
    assert told == pytest.approx((shear > 0.7 * pressure).mean(), abs=0.07)
    assert f"in {percent(told)} of the contact shear between the layers is above 0.7 of their pressure" in "".join(
        run.notes
    )


# -- settling -------------------------------------------------------------------------------------------


def test_notes_are_made_when_somebody_reads_them(quickstart, monkeypatch):
    """Nobody else pays for them."""
    asked, scene = [], quickstart.replace({"run.duration_s": 2.0})
    monkeypatch.setattr("vibroplat.motion.run.notes_on_input", lambda scene, **_times: asked.append(scene) or [])
    run = simulate(scene, keep="events")
    assert (run.outcome, asked) == ("ok", [])
    assert (run.notes, run.notes, asked) == ([], [], [scene])


def test_a_part_measured_across_a_change_of_the_supply_says_so(quickstart):
    """With the duration that the note names the change lies before the measured part."""
    begin, off = {"t_s": 0.0, "supply_frequency_hz": 51.5}, {"t_s": 0.35, "off": True}
    same, slower = {"t_s": 0.4, "supply_frequency_hz": 51.5}, {"t_s": 0.6, "supply_frequency_hz": 50.0}
    for entry, seconds, noted in ((off, 0.5, (0.35, 0.7)), (off, 0.7, ()), (same, 0.5, ()), (slower, 0.5, (0.6, 1.2))):
        notes = of_motion(quickstart, **{"drive": {"program": [begin, entry]}, "run.duration_s": seconds})
        found = [note for note in notes if "supply" in note]
        assert len(found) == bool(noted)
        for note, (last, longer) in zip(found, [noted] * len(found), strict=True):
            assert note.startswith(f"warning: the supply changes until {last} s, but the measured part begins at 0.2")
            assert note.endswith(f"run.duration_s = {longer} or more avoids that")


def test_a_run_that_has_not_settled_says_so(quickstart):
    """At 65 Hz antiphase is unstable: the exciters are on their way to in-phase when a short run ends."""
    scene = quickstart.replace({"drive.supply_frequency_hz": 65.0, "run": {"duration_s": 3.0, "perturbation": 0.01}})
    (note,) = (note for note in simulate(scene, keep="summary").notes if "phase" in note)
    assert note.startswith("warning: the phase difference changes by ")
    settled = quickstart.replace({"run": {"duration_s": 3.0, "perturbation": 0.01}})
    assert not any("phase" in note for note in simulate(settled, keep="summary").notes)


def test_a_transient_left_in_strokes_that_repeat_is_noted():
    """Rotating bodies opposite each other excite nothing but rotation: what else moves is left from the start."""
    scene = load_config(ROOT / "configs" / "examples" / "co-rotating-opposite.yaml")
    short, long = (simulate(scene.replace({"run.duration_s": end}), keep="summary") for end in (10.0, 40.0))
    assert short.summary["period"] == long.summary["period"] == 1
    assert short.summary["stroke_change"] > 0.5
    assert short.notes[0].startswith(f"warning: {percent(short.summary['stroke_change'])} of the stroke, ")
    assert long.summary["stroke_change"] < 0.02
    assert not any("transient" in note for note in long.notes)


@pytest.mark.parametrize("damping", [100.0, 400.0])
def test_what_a_start_leaves_in_the_strokes_is_estimated_though_nothing_repeats(damping):
    """A long run tells what decays; here the machine is empty, as material only adds damping."""
    scene = load_config(ROOT / "configs" / "templates" / "screen.yaml").replace(
        {
            "machine.damping_y_n_s_per_m": damping,
            "material.mass_ratio": 0.0,
        }
    )
    short, long = (simulate(scene.replace({"run.duration_s": end}), keep="summary").summary for end in (20.0, 200.0))
    assert short["period"] == 0
    decays = short["stroke_y_m"] - long["stroke_y_m"]
    assert decays > 0.05 * long["stroke_y_m"]
    assert short["transient_y_m"] - long["transient_y_m"] == pytest.approx(decays, rel=0.15)
    told = Sheet(scene, short)
    limit = long["stroke_y_m"] * 1e3
    assert float(next(told.short())[2].split()[3]) == pytest.approx(limit, rel=0.05)


def test_a_motor_that_hangs_far_below_a_resonance_is_captured_by_it(printed):
    """The headline has no cliff: captured or not, it tells how far a motor is below its synchronous speed."""
    run = simulate(printed.replace(CAPTURED))
    scene, summary = run.scene, run.summary
    assert headline(scene, summary).endswith(
        "CAPTURED by the resonance in y: 30.49 Hz, 7.6 % below the synchronous speed 33.00 Hz"
    )
    assert ", 7.6 % below synchronous speed, " in headline(scene, summary | {"captured_by": ""})
    slow = [SlowMotor(1, 24.0, 33.0)]
    assert whole_run(run.measures, scene, 0.0, slow, locked=True)["captured_by"] == "y", "not within 10 % of 30.85 Hz"
    assert whole_run(run.measures, scene, 0.0, [SlowMotor(1, 24.0, 28.0)], locked=True)["captured_by"] == ""


def test_a_stop_that_nothing_disturbs_says_that_its_symmetry_hides_a_direction():
    stop = {"drive.program": [{"t_s": 0.0, "supply_frequency_hz": 50.0}, {"t_s": 0.05, "off": True}]}
    upward = {f"phi{i}_rad": 0.5 * math.pi for i in (1, 2)}
    turning = {
        "run.duration_s": 0.2,
        "run.initial.state": upward | {"phi1_rate_rad_per_s": 160.0, "phi2_rate_rad_per_s": -160.0},
    }
    coasting = turning | {"drive.program": [{"t_s": 0.0, "supply_frequency_hz": 50.0, "off": True}]}
    told = "next to nothing moves along x, as this start is symmetric"
    found = [
        any(told in note for note in of_motion(load_config(QUICKSTART), **changes))
        for changes in (coasting, turning, coasting | {"run.perturbation": 0.01}, coasting | {"run.perturbation": 0.0})
    ]
    assert found == [True, False, False, False]
    (note,) = (note for note in of_motion(load_config(QUICKSTART), **turning | stop) if "symmetry" in note)
    assert note.startswith("a stop within a run keeps the symmetry that its motion has reached")


def test_a_synchronization_that_a_short_run_does_not_leave_though_it_does_not_hold_is_noted():
    """At 38 Hz antiphase has a multiplier of 1.005; 200 s end in-phase."""
    told = "the mean torques on the empty machine do not hold antiphase"
    found = {
        supply: any(
            told in note for note in of_motion(load_config(QUICKSTART), **{"drive.supply_frequency_hz": supply})
        )
        for supply in (38.0, 51.5)
    }
    assert found == {38.0: True, 51.5: False}
