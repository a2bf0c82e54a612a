"""The data sheet: against closed forms, balances, trajectories, and between engines."""

import math

import numpy as np
import pytest
from common.places import QUICKSTART, ROOT

from vibroplat import Scene, load_config, orbit, simulate, sweep
from vibroplat.columns import split
from vibroplat.errors import ConfigError
from vibroplat.observe.extremes import CONTACT_FORCE, empty_extremes, merge_extremes
from vibroplat.report.data_sheet import SHEET, columns, whole_columns
from vibroplat.report.synchronization import converges, fluctuates
from vibroplat.results.sheet import FURTHER, Sheet, all_lines

POINTS = {"output.points": {"inlet": [-0.2, 0.1], "outlet": [0.25, 0.05], "top": [0.0, 0.3]}}


def lines_of(scene, summary):
    return all_lines(Sheet(scene, summary), None)


def test_closed_forms_of_a_bare_platform_in_antiphase():
    """Rotors so heavy that they keep their speed: the platform is a driven oscillator, the motors have a fixed slip."""
    omega, slip, (torque, critical) = 2.0 * math.pi * 26.0, 0.02, (1.2, 0.15)
    machine = {"rotor_inertia_kg_m2": 1e7, "damping_y_n_s_per_m": 400.0}
    supply = {"drive.supply_frequency_hz": omega / (math.pi * (1.0 - slip)), "motor.friction_radius_m": 0.0}
    scene = Scene().replace({f"machine.{name}": value for name, value in machine.items()} | supply)
    mass, m = scene.body.mass, scene.machine
    pull = 2.0 * scene.unbalances[0] * omega**2
    spring = m.stiffness_y_n_per_m + 1j * m.damping_y_n_s_per_m * omega
    y = pull / (spring - mass * omega**2)
    weight = mass * m.gravity_m_per_s2
    state = {
        "y_m": y.imag - weight / m.stiffness_y_n_per_m,
        "y_rate_m_per_s": (1j * omega * y).imag,
        "phi1_rad": 0.0,
        "phi2_rad": math.pi,
        "phi1_rate_rad_per_s": omega,
        "phi2_rate_rad_per_s": -omega,
    }
    run = {"run.initial": {"state": state}, "run.duration_s": 0.5, "solver.tolerance": 1e-10, "solver.engine": "taylor"}
    scene = scene.replace(run | POINTS)
    amplitude, torque = abs(y), 2.0 * torque * critical * slip / (critical**2 + slip**2)
    expected = {
        "foundation_force_y_mean_n": -weight,
        "foundation_force_y_rms_n": abs(spring * y) / math.sqrt(2.0),
        "foundation_force_y_amplitude_n": abs(spring * y),
        "foundation_force_y_max_n": weight + abs(spring * y),
        "stroke_y_m": 2.0 * amplitude,
        "stroke_y_inlet_m": 2.0 * amplitude,
        "acceleration_max_m_per_s2": amplitude * omega**2,
        "acceleration_max_top_m_per_s2": amplitude * omega**2,
        "gamma": amplitude * omega**2 / 9.81,
        "slip_1": slip,
        "torque_ratio_2": torque / 1.2,
        "motor_torque_1_mean_n_m": torque,
        "motor_torque_2_max_n_m": torque,
        "motor_power_1_mean_w": torque * omega,
        "motor_power_2_max_w": torque * omega,
        "bearing_force_1_max_n": scene.unbalances[0] * omega**2,
    }
    summary = simulate(scene).summary
    assert {name: summary[name] for name in expected} == pytest.approx(expected, rel=1e-7)
    assert max(summary["foundation_force_x_max_n"], summary["foundation_moment_max_n_m"]) < 1e-9
    assert summary["speed_ripple_1_hz"] < 1e-6
    assert summary["captured_by"] == ""


def test_balances_over_the_period_of_an_orbit(quickstart):
    """The impulse on the foundation is that of the weight, and motors replace what dampers and impacts take."""
    found = orbit(quickstart.replace({"solver.engine": "taylor"}))
    scene, sums = found.scene, found.run.summary
    weight = (scene.platform_mass + scene.material_mass) * scene.machine.gravity_m_per_s2
    assert found.measures["foundation_force_y_mean_n"] == pytest.approx(-weight, rel=1e-7)
    taken = ("damping_x", "damping_y", "damping_phi", "damping_layers", "resistance")
    losses = sum(sums[f"{name}_work_j"] for name in taken) + sums["impact_loss_j"]
    assert sums["impact_loss_j"] > 0.1 * losses
    fed = sum(found.measures[f"motor_power_{n}_mean_w"] for n in (1, 2))
    assert fed * found.period_s == pytest.approx(losses, rel=1e-6)
    assert fed == pytest.approx(found.measures["motor_power_w"], rel=1e-12)


def by_hand(run, begin, end):
    """Largest sizes and strokes between two times, from dense output: forces of springs and dampers, points, speeds."""
    times = np.linspace(begin, end, 100_001)
    events = run.events["t_s"].to_numpy()
    after = np.nextafter(events[(events >= begin) & (events < end)], np.inf)
    at = run(np.sort(np.concatenate([times, after])))
    m, found = run.scene.machine, {}
    for name, unit, q in (("force_x", "n", "x"), ("force_y", "n", "y"), ("moment", "n_m", "phi")):
        of = "phi_n_m" if q == "phi" else f"{q}_n"
        stiffness = getattr(m, f"stiffness_{of}_per_{'rad' if q == 'phi' else 'm'}")
        damping = getattr(m, f"damping_{of}_s_per_{'rad' if q == 'phi' else 'm'}")
        place, rate = (f"{q}_rad", f"{q}_rate_rad_per_s") if q == "phi" else (f"{q}_m", f"{q}_rate_m_per_s")
        found[f"foundation_{name}_max_{unit}"] = (stiffness * at[place] + damping * at[rate]).abs().max()
    for name, (x, y) in {"": (0.0, 0.0), **run.scene.named_points}.items():
        column = f"{name}_m" if name else "m"
        found[f"stroke_x_{column}"] = np.ptp(at["x_m"] - y * at["phi_rad"])
        found[f"stroke_y_{column}"] = np.ptp(at["y_m"] + x * at["phi_rad"])
    for n in (1, 2):
        speed = at[f"phi{n}_rate_rad_per_s"]
        found[f"motor_power_{n}_max_w"] = at[f"motor_power_{n}_w"].abs().max()
        found[f"motor_torque_{n}_max_n_m"] = (at[f"motor_power_{n}_w"] / speed).abs().max()
        found[f"speed_ripple_{n}_hz"] = np.ptp(speed) / (2.0 * math.pi)
        found[f"bearing_force_{n}_max_n"] = run.scene.unbalances[n - 1] * (speed**2).max()
    return found, at


def test_a_run_with_impacts_by_hand_and_by_both_engines(quickstart):
    changes = {"run.duration_s": 0.6, "solver.tolerance": 1e-9, "run.initial.phase_difference_rad": 2.5}
    scene = quickstart.replace(changes | POINTS)
    runs = [simulate(scene.replace({"solver.engine": engine})) for engine in ("taylor", "native")]
    summary = runs[0].summary
    begin, end = (summary[f"measured_{name}_s"] for name in ("from", "to"))
    expected, at = by_hand(runs[0], begin, end)
    expected |= {"contact_force_max_n": at["contact_force_n"].max(), "gap_max_m": at["gap_m"].max()}
    late = runs[0].events[runs[0].events["t_s"].between(begin, end)]
    expected |= {"measured_impacts": (late["kind"] == "impact").sum(), "impulse_max_n_s": late["impulse_n_s"].max()}
    assert {name: summary[name] for name in expected} == pytest.approx(expected, rel=1e-6)
    assert (
        by_hand(runs[0], 0.3, 0.6)[0]["stroke_x_m"] > 1.05 * summary["stroke_x_m"]
    )  # what is no whole turn is left out
    whole, _ = by_hand(runs[0], 0.0, 0.6)
    peaks = {name: value for name, value in whole.items() if not name.startswith("speed_")}
    assert {name: summary[f"whole_{name}"] for name in peaks} == pytest.approx(peaks, rel=1e-6)
    other = {name: runs[1].summary[name] for name in columns(scene)}
    assert {name: summary[name] for name in other} == pytest.approx(other, rel=2e-5)
    assert summary["acceleration_max_m_per_s2"] > summary["gamma"] * 9.81 > 20.0


def test_accelerations_are_the_largest_of_those_in_the_columns(quickstart):
    changes = {"drive.supply_frequency_hz": 44.0, "run.duration_s": 0.4, "output.accelerations": True}
    run = simulate(quickstart.replace({**changes, "solver.engine": "taylor", **POINTS}))
    at = run(np.linspace(run.summary["measured_from_s"], run.summary["measured_to_s"], 40_001))
    assert run.summary["gamma"] == pytest.approx(at["acceleration_y_m_per_s2"].abs().max() / 9.81, rel=2e-6)
    for name in run.scene.named_points:
        size = np.hypot(*(at[f"acceleration_{axis}_{name}_m_per_s2"] for axis in "xy")).max()
        assert run.summary[f"acceleration_max_{name}_m_per_s2"] == pytest.approx(size, rel=2e-6)


def pace(at, time):
    """Mean speed of both exciters over the turn of the faster one around a time (Hz), from dense output since 0 s."""
    times, angles, end = at["t_s"].to_numpy(), at[["phi1_rad", "phi2_rad"]].to_numpy(), 0
    while times[end] < time:
        begin, turned = end, np.abs(angles - angles[end]) / (2.0 * math.pi)
        end = begin + np.argmax(turned[begin:].max(axis=1) >= 1.0)
    return turned[end].mean() / (times[end] - times[begin])


def test_a_start_from_rest_and_a_stop(quickstart):
    """The motors pass their critical slip, exciters come into step, and the coast-down is part of the whole run."""
    program = [{"t_s": 0.0, "supply_frequency_hz": 44.0}, {"t_s": 3.4, "off": True}]
    start = {"run.initial": {"speed_ratio": 0.0}, "run.duration_s": 4.0, "solver.engine": "taylor"}
    run = simulate(quickstart.replace({**start, "drive": {"program": program}}))
    summary, (expected, at) = run.summary, by_hand(run, 0.0, 4.0)
    assert summary["whole_motor_torque_1_max_n_m"] == pytest.approx(run.scene.exciter_pair[0].critical_torque_n_m)
    for column in ("foundation_force_y_max_n", "motor_power_2_max_w"):
        base = split(column)[0]
        assert summary[f"whole_{column}"] == pytest.approx(expected[column], rel=1e-6)
        speed = pace(at, summary[f"whole_{base}_at_s"])
        assert summary[f"whole_{base}_at_hz"] == pytest.approx(speed, rel=2e-3)
    assert summary["slip_1"] is None  # the supply changes while it is measured
    assert summary["synchronized_at_s"] is None  # the phase difference changes with it
    steady = simulate(run.scene.replace({"drive": {"program": program[:1]}, "run.duration_s": 5.0})).summary
    assert 0.0 < summary["whole_motor_torque_1_max_at_s"] < steady["synchronized_at_s"] < 2.0
    early = at[at["t_s"] <= steady["synchronized_at_s"]]
    work = np.trapezoid(early["motor_power_1_w"] + early["motor_power_2_w"], early["t_s"])
    assert steady["start_energy_j"] == pytest.approx(work, rel=0.02)
    late = at[at["t_s"].between(steady["synchronized_at_s"] + 0.02, 3.3)]
    speeds = late[["phi1_rate_rad_per_s", "phi2_rate_rad_per_s"]].abs() / (2.0 * math.pi)
    assert (speeds / steady["excitation_frequency_hz"] - 1.0).abs().to_numpy().max() < 0.07
    before = at[at["t_s"].between(steady["synchronized_at_s"] - 0.2, steady["synchronized_at_s"] - 0.05)]
    assert len(before) == 0 or steady["synchronized_at_s"] > 0.05


#: Scenes, their motors if these differ, and whether the exciters are in step at last. At 65.5 Hz antiphase is unstable.
PAIRS = {
    "drifting": ({"drive.supply_frequency_hz": 90.0, "run.duration_s": 4.1}, ((1.2, 1e-5), (0.2, 2e-4)), False),
    "leaving antiphase": ({"drive.supply_frequency_hz": 65.5, "material.mass_ratio": 0.1}, (), False),
    "off": ({"motor.critical_torque_n_m": 0.0, "run.duration_s": 1.0}, (), False),
    "in step": ({"drive.supply_frequency_hz": 60.0, "run.duration_s": 4.0}, (), True),
}


@pytest.mark.parametrize("name", PAIRS)
def test_only_exciters_that_are_synchronized_have_come_into_step(name):
    changes, motors, expected = PAIRS[name]
    scene = load_config(QUICKSTART, {"material.mass_ratio": 0.0, "solver.engine": "taylor"}).replace(changes)
    if motors:
        keys = ("critical_torque_n_m", "friction_radius_m")
        scene = scene.replace({"motors": [dict(zip(keys, motor, strict=True)) for motor in motors]})
    summary = simulate(scene, keep="summary").summary
    found = (summary["synchronized_at_s"] is not None, summary["start_energy_j"] is not None)
    assert (*found, "in step" in lines_of(scene, summary)) == (expected,) * 3


def test_a_phase_difference_converges_if_its_changes_do_not_slow_down_less_and_less():
    """Changes in equal times: three of a slow passage; exponential ones, near their limit and far; and round-off."""
    passing = [np.diff(0.01 * np.tan(0.2 * np.arange(4.0) - begin)) for begin in (1.5, 1.0, 0.3)]
    assert [converges(changes) for changes in passing] == [False] * 3
    assert converges(0.01 * np.exp(-0.2 * np.arange(3.0)))
    assert not converges(np.exp(-0.2 * np.arange(3.0)))
    assert converges(np.array([1e-3, 1e-6, 2e-7]))


def test_a_phase_difference_that_fluctuates_stays_unless_it_has_a_trend():
    means = 0.001 * np.array([1.0, -1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0])
    assert fluctuates(means)
    assert not fluctuates(means + 0.01 * np.arange(8.0))
    assert not fluctuates(100.0 * means)  # too rough to tell


def test_exciters_that_come_into_step_late_have_a_time():
    """Their phase difference changes by 0.2 rad in the measured part, and by 2e-6 rad in the latter half of it."""
    scene = load_config(ROOT / "configs/examples/start-passed.yaml", {"solver.engine": "taylor"})
    summary = simulate(scene, keep="summary").summary
    assert summary["synchronized_at_s"] == pytest.approx(5.5, abs=0.1)


def test_a_peak_that_is_reached_again_keeps_its_first_time():
    """The value is the largest of all, and so is that of the measured part."""
    peaks = empty_extremes(3)
    for row, value in enumerate((1.0, 1.0 + 1e-13, 0.5)):
        peaks["largest"][row, CONTACT_FORCE], peaks["at_largest"][row, CONTACT_FORCE] = value, row + 1.0
        peaks["least"][row, CONTACT_FORCE], peaks["at_least"][row, CONTACT_FORCE] = -2.0 * value, row + 1.0
    found = merge_extremes(peaks)
    assert (found["largest"][CONTACT_FORCE], found["at_largest"][CONTACT_FORCE]) == (1.0 + 1e-13, 1.0)
    assert (found["least"][CONTACT_FORCE], found["at_least"][CONTACT_FORCE]) == (-2.0 * (1.0 + 1e-13), 1.0)


def test_exciters_that_swing_have_no_speed_at_a_peak():
    """A coasting screen is shaken most while both unbalances swing, at momentary speeds of up to 2 Hz."""
    program = [{"t_s": 0.0, "supply_frequency_hz": 50}, {"t_s": 2.0, "off": True}]
    changes = {"drive": {"program": program}, "run.duration_s": 16.0, "solver.engine": "taylor"}
    run = simulate(load_config(ROOT / "configs/templates/heavy-screen.yaml", changes))
    summary = run.summary
    assert summary["whole_foundation_force_y_max_at_s"] > 8.0
    assert summary["whole_foundation_force_y_max_at_hz"] is None
    assert not lines_of(run.scene, summary)["y, static ± dynamic"].endswith("Hz")
    at, expected = run(np.linspace(0.0, 2.0, 100_001)), summary["whole_motor_power_1_max_at_s"]
    assert summary["whole_motor_power_1_max_at_hz"] == pytest.approx(pace(at, expected), rel=2e-3)


def test_loads_strokes_torques_and_powers_have_a_time_and_a_speed(quickstart):
    """Those that are largest at a start or a stop; of the others there is the value alone, in summary and sheet."""
    run = simulate(quickstart.replace({"run.duration_s": 0.2, "solver.engine": "taylor", **POINTS}))
    summary, whole = run.summary, whole_columns(columns(run.scene))
    timed = {name.removesuffix("_at_s") for name in summary if name.startswith("whole_") and name.endswith("_at_s")}
    assert {name.removesuffix("_at_hz") for name in summary if name.endswith("_at_hz")} == timed
    strokes = {
        f"whole_stroke_{axis}{point}"
        for axis in "xy"
        for point in ("", *(f"_{name}" for name in POINTS["output.points"]))
    }
    loads = {f"whole_foundation_{load}_max" for load in ("force_x", "force_y", "moment")}
    assert timed == strokes | loads | {f"whole_motor_{what}_{i}_max" for what in ("power", "torque") for i in (1, 2)}
    assert set(whole) == {name for name in summary if name.startswith("whole_")}
    lines = lines_of(run.scene, summary | {"whole_acceleration_max_m_per_s2": 999.0})
    assert lines["acceleration"].endswith("; largest 999 m/s²")


def test_the_viscous_force_of_the_material_does_not_reach_the_foundation(quickstart):
    """What changes the momentum of machine and unbalances: weight, the force on the material, and the suspension."""
    contact = {"model": "non-impact", "viscous_per_mass_per_s": 300.0, "added_mass_share": 0.5}
    changes = {"contact": contact, "run.duration_s": 0.4, "solver.engine": "taylor", "solver.tolerance": 1e-11}
    run = simulate(quickstart.replace(changes))
    summary, scene = run.summary, run.scene
    times = np.linspace(*(summary[f"measured_{name}_s"] for name in ("from", "to")), 40_001)
    at, mass = run(times), scene.platform_mass
    momentum = mass * at["y_rate_m_per_s"] + sum(
        k * np.cos(at[f"phi{n}_rad"]) * at[f"phi{n}_rate_rad_per_s"] for n, k in enumerate(scene.unbalances, start=1)
    )
    on_material = 300.0 * scene.material_mass * at["y_rate_m_per_s"]
    force = -np.gradient(momentum, times, edge_order=2) - on_material - mass * scene.machine.gravity_m_per_s2
    mean = -(scene.body.mass + 0.5 * scene.material_mass) * scene.machine.gravity_m_per_s2
    assert summary["foundation_force_y_mean_n"] == pytest.approx(mean, rel=1e-3)
    assert summary["foundation_force_y_max_n"] == pytest.approx(force.abs().max(), rel=1e-6)
    assert summary["foundation_force_y_amplitude_n"] == pytest.approx(0.5 * np.ptp(force), rel=1e-6)
    assert summary["foundation_force_y_rms_n"] == pytest.approx(force.std(), rel=1e-3)


def test_power_is_largest_within_a_step_while_the_supply_changes(quickstart):
    """It is largest where neither speed nor supply is."""
    program = [{"t_s": 0.0, "supply_frequency_hz": 52.0}, {"t_s": 1.0, "supply_frequency_hz": 44.0}]
    changes = {"drive": {"program": program}, "run.duration_s": 1.0, "solver.engine": "taylor"}
    run = simulate(quickstart.replace({**changes, "solver.tolerance": 1e-9, "material.mass_ratio": 0.0}))
    expected, _ = by_hand(run, *(run.summary[f"measured_{name}_s"] for name in ("from", "to")))
    expected = {name: value for name, value in expected.items() if name.startswith("motor_")}
    assert {name: run.summary[name] for name in expected} == pytest.approx(expected, rel=1e-6)


def test_a_motor_that_hangs_below_a_resonance_is_captured(printed):
    """The paper's printed imbalance: at 66 Hz it stays at the first root of the balance of power, 30.49 Hz."""
    scene = printed.replace({"drive.supply_frequency_hz": 66.0, "run.initial": {"speed_ratio": 0.85}})
    summary = simulate(scene.replace({"run.duration_s": 6.0, "solver.engine": "taylor"}), keep="summary").summary
    assert summary["excitation_frequency_hz"] == pytest.approx(30.49, abs=0.3)
    assert summary["captured_by"] == "y"
    assert summary["slip_1"] > 0.05


def test_rows_and_old_summaries(quickstart):
    plan = {"supply_frequency_hz": {"start": 46.0, "stop": 46.0}, "measure_s": 0.2}
    scene = quickstart.replace({"sweep": plan, "solver.engine": "taylor", **POINTS})
    table = sweep(scene).sweep
    names = list(columns(scene))
    assert list(table.columns)[-len(names) :] == names
    assert table[names].notna().all(axis=None)
    assert table.attrs["units"]["stroke_x_inlet_m"] == "m"
    run = simulate(scene.replace({"run.duration_s": 0.2}))
    assert list(run.data_sheet.index) == names
    assert run.data_sheet.loc["gamma", "whole_run"] == run.summary["whole_gamma"]
    lines = lines_of(scene, run.summary)
    assert "stroke y at inlet" in lines
    assert "; largest " in lines["stroke y"]
    assert ";" not in lines_of(scene, run.summary | {"whole_stroke_y_m": 0.0})["stroke y"]
    for name in [name for name in run.summary if name in SHEET or name.startswith("whole_")]:
        del run.summary[name]
    assert not set(run.data_sheet.index) & set(SHEET)
    assert not {"stroke y", "y, static ± dynamic", FURTHER} & {*lines_of(scene, run.summary)}


def test_springs_carry_the_static_force_together_and_move_with_their_points(quickstart):
    """Four springs alike at ±a."""
    a, stiffness, (centre, _) = 0.2, quickstart.machine.stiffness_y_n_per_m, quickstart.body.centre
    points = {"left": [centre - a, 0.0], "right": [centre + a, 0.1]}
    changes = {"run.initial": {"phase_difference_rad": 1.0}, "run.duration_s": 0.5, "solver.engine": "taylor"}
    scene = quickstart.replace(changes | {"output": {"points": points, "springs": {"left": 2, "right": 2}}})
    run = simulate(scene)
    summary = run.summary
    at = run(np.linspace(summary["measured_from_s"], summary["measured_to_s"], 20_001))
    for name, side in (("left", -1.0), ("right", 1.0)):
        force = stiffness * (at["y_m"] + side * a * at["phi_rad"]) / 4.0
        assert summary[f"spring_force_mean_{name}_n"] == pytest.approx(force.mean(), rel=1e-3)
        assert summary[f"spring_force_amplitude_{name}_n"] == pytest.approx(0.5 * np.ptp(force), rel=1e-5)
        assert summary[f"spring_force_max_{name}_n"] == pytest.approx(force.abs().max(), rel=1e-5)
        assert summary[f"whole_spring_force_max_{name}_n"] >= summary[f"spring_force_max_{name}_n"]
    both = sum(summary[f"spring_force_mean_{name}_n"] for name in points)
    assert 2.0 * both == pytest.approx(summary["foundation_force_y_mean_n"], rel=5e-3)  # without that of the damper
    with pytest.raises(ConfigError, match=r"no such point; allowed: names in points \(left, right\)"):
        scene.replace({"output.springs": {"middle": 1}})
