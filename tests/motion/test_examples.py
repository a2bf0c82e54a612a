"""The examples of configs/examples show what their headers say; known answers are averaged torques, see
:mod:`common.synchronization`."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from common.places import ROOT
from common.synchronization import (
    TURN,
    influence,
    most_friction,
    net_torques,
    stable_phases,
    steady_frequencies,
)
from scipy.optimize import brentq

from vibroplat import load_config, simulate
from vibroplat.config.coordinates import COORDINATES, RATES

EXAMPLES = sorted((ROOT / "configs/examples").glob("*.yaml"))

#: Frequency split of exciters that turn at one speed, at most (Hz).
TOGETHER = 0.05


def example(name, changes=None):
    return load_config(ROOT / f"configs/examples/{name}.yaml", changes)


@cache
def finished(name):
    return simulate(example(name))


def phase_of(run):
    return run.summary["phase_difference_rad"]


def apart(angle, other):
    return abs(math.remainder(angle - other, TURN))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_energy_of_an_example_balances(path):
    summary = simulate(load_config(path, {"solver.tolerance": 1e-10}), keep="summary").summary
    assert (summary["outcome"], summary["name"]) == ("ok", path.stem)
    assert summary["energy_residual"] <= 1e-6


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_platform_of_an_example_rotates_little(path):
    assert finished(path.stem).trajectory["phi_rad"].abs().max() < 0.1


# -- start through resonance ------------------------------------------------------------------------------


def test_start_is_captured_at_the_first_root_of_the_torque_balance():
    summary = finished("start-captured").summary
    roots = steady_frequencies(finished("start-captured").scene, math.pi)
    assert len(roots) == 3
    assert summary["excitation_frequency_hz"] == pytest.approx(roots[0], abs=3e-3)
    # without resistance the roots are those of the formula L_M(ω) = b_y ω A²/4
    free = example("start-captured", {"motor.friction_radius_m": 0.0})
    assert steady_frequencies(free, math.pi) == pytest.approx([30.4929, 31.3117, 32.8770], abs=1e-4)


def test_start_passes_with_more_damping():
    run = finished("start-passed")
    assert len(steady_frequencies(run.scene, math.pi)) == 1
    (expected,) = steady_frequencies(run.scene, 0.0)
    assert run.summary["excitation_frequency_hz"] == pytest.approx(expected, abs=3e-3)
    assert abs(phase_of(run)) < 0.02
    largest = run.trajectory["y_m"].abs().max()
    assert run.trajectory["y_m"][run.trajectory["t_s"] > 11.0].abs().max() < largest / 5.0


def test_start_begins_at_rest():
    for name in ("start-captured", "start-passed"):
        table = finished(name).trajectory
        assert table["supply_frequency_hz"].iloc[0] == 0.0
        early = table[table["t_s"] < 0.05][["phi1_rate_rad_per_s", "phi2_rate_rad_per_s"]]
        assert early.abs().max(axis=None) < TURN * 1.0


# -- coast-down -------------------------------------------------------------------------------------------


def test_coast_down_passes_resonance_below_its_amplitude():
    """The amplitude after a fast passage is F/(Mω₀) √(π/2α) (Lewis), with α the rate at which the speed falls there."""
    run = finished("coast-down")
    machine, table = run.scene.machine, run.trajectory
    natural = math.sqrt(machine.stiffness_y_n_per_m / machine.total_mass)
    turns = table["t_s"].to_numpy(), 0.5 * (table["phi1_rad"] - table["phi2_rad"]).to_numpy()
    ends = turns[0][-1]
    grid = np.arange(1.2, ends, 1.0 / 33.0)
    speeds = np.diff(np.interp(grid, *turns)) * 33.0
    passing = int(np.flatnonzero(speeds < natural)[0])
    slowing = (speeds[passing - 4] - speeds[passing + 3]) * 33.0 / 7.0
    coasting = table[table["t_s"] > grid[passing] - 0.2]
    largest = 0.5 * (coasting["y_m"].max() - coasting["y_m"].min())
    lewis = sum(run.scene.unbalances) * natural / machine.total_mass * math.sqrt(math.pi / (2.0 * slowing))
    steady = sum(run.scene.unbalances) * natural / machine.damping_y_n_s_per_m
    assert largest == pytest.approx(lewis, rel=0.15)
    assert largest < steady / 4.0


def test_coast_down_takes_no_energy_from_the_supply():
    table = finished("coast-down").trajectory
    power = table[["motor_power_1_w", "motor_power_2_w"]]
    driven = table["t_s"] < 1.0
    assert power[driven].iloc[-1].min() > 0.0
    assert (power[table["t_s"] > 1.0] == 0.0).all(axis=None)


# -- one motor off ----------------------------------------------------------------------------------------


def dragged(friction, supply=50.0, state=None):
    """Run with exciter 2 off from a state, or switched off at 2 s."""
    program = [{"t_s": 0.0, "supply_frequency_hz": supply}, {"t_s": 2.0, "exciter_2": "off"}]
    changes = {"motors.1.friction_radius_m": friction, "drive.program": program}
    if state is not None:
        changes["run.initial.state"] = state
        changes["drive.program"] = [program[0] | {"exciter_2": "off"}]
    return simulate(example("one-motor-off", changes), keep="summary")


def follows(run):
    return abs(run.summary["frequency_split_hz"]) < TOGETHER


def end_of(run):
    return {key: float(run.final_state[i]) for i, key in enumerate((*COORDINATES, *RATES)) if i % 7 < 5}


def test_exciter_without_motor_is_dragged_along():
    run = finished("one-motor-off")
    table = run.trajectory
    assert follows(run)
    assert run.summary["phase_coherence"] > 0.999
    assert (table["motor_power_2_w"][table["t_s"] > 2.0] == 0.0).all()
    # the vibration alone balances its resistance, on the stable side next to antiphase
    omega = TURN * run.summary["excitation_frequency_hz"]
    h, k = influence(run.scene, omega), run.scene.unbalances[0]
    resistance = run.scene.exciter_pair[1].friction_radius_m * k * omega**2

    def short(phase):
        vibration = 0.5 * k**2 * omega**4 * (h[1, 0] * np.exp(1j * phase) + h[1, 1]).imag
        return vibration - resistance

    expected = brentq(short, math.pi, 1.5 * math.pi)
    assert apart(phase_of(run), expected) < 0.01


def test_exciter_with_more_resistance_stops():
    run = finished("one-motor-off-stops")
    late = run.trajectory[run.trajectory["t_s"] > 22.0]
    assert not follows(run)
    assert late["phi2_rad"].max() - late["phi2_rad"].min() < TURN  # it swings
    assert late["phi2_rate_rad_per_s"].min() < 0.0 < late["phi2_rate_rad_per_s"].max()
    assert late["phi1_rate_rad_per_s"].min() > 0.9 * run.scene.speed_scale


@pytest.mark.parametrize("supply", [50.0, pytest.param(80.0, marks=pytest.mark.long)])
def test_limit_of_dragging_is_the_largest_torque_of_the_vibration(supply):
    """Resistance grows step by step, each run from the end of the one before, down to 0.1 % of it."""
    run = dragged(1e-4, supply)
    assert follows(run)
    low, step = 1e-4, 2e-4
    while step > 4e-7:
        further = dragged(low + step, supply, end_of(run))
        if follows(further):
            run, low = further, low + step
        else:
            step /= 2.0
    omega = TURN * run.summary["excitation_frequency_hz"]
    assert low == pytest.approx(most_friction(run.scene, omega), rel=5e-3)


def test_sudden_switch_carries_less_than_the_limit():
    """The phase difference overshoots where it is to settle."""
    assert follows(dragged(0.73e-3))
    assert not follows(dragged(0.75e-3))


# -- unequal radii ----------------------------------------------------------------------------------------


def test_unequal_radii_shift_the_phase_difference_by_a_small_angle():
    run = finished("unequal-radii")
    omega = TURN * run.summary["excitation_frequency_hz"]
    (expected,) = stable_phases(run.scene, omega)
    shift = math.remainder(phase_of(run) - math.pi, TURN)
    assert shift == pytest.approx(math.remainder(expected - math.pi, TURN), rel=2e-3)
    assert follows(run)
    # to first order in the difference δ of radii: Im H₁₁ and the resistances differ, Re H₁₂ holds them together
    h, k = influence(run.scene, omega), run.scene.unbalances
    friction = run.scene.exciter_pair[0].friction_radius_m
    small = (h[0, 0].imag - 2.0 * friction / (k[0] * omega**2) / 2.0) / h[0, 1].real * (k[1] / k[0] - 1.0)
    assert shift == pytest.approx(small, rel=0.05)


def test_shift_grows_linearly_with_the_difference_of_radii():
    shifts = []
    for share in (-0.01, 0.01, 0.02, 0.04):
        run = simulate(
            example("unequal-radii", {"exciters.1.unbalance_radius_m": 0.09 * (1.0 + share)}), keep="summary"
        )
        shifts.append(math.remainder(phase_of(run) - math.pi, TURN) / share)
    assert shifts == pytest.approx([shifts[1]] * 4, rel=0.05)
    assert (shifts[0] + shifts[1]) / 2.0 == pytest.approx(2.0 * shifts[1] - shifts[2], rel=1e-3)


# -- co-rotating exciters ---------------------------------------------------------------------------------


def test_co_rotating_exciters_get_in_phase_or_opposite():
    together, opposite = finished("co-rotating-in-phase"), finished("co-rotating-opposite")
    assert abs(phase_of(together)) < 1e-3
    assert apart(phase_of(opposite), math.pi) < 1e-3
    for run in (together, opposite):
        omega = TURN * run.summary["excitation_frequency_hz"]
        (expected,) = stable_phases(run.scene, omega)
        assert apart(phase_of(run), expected) < 1e-3
    assert together.summary["rms_phi_rad"] < 1e-6 < together.summary["rms_y_m"]
    assert opposite.summary["rms_y_m"] < 1e-6 < opposite.summary["rms_phi_rad"]


def soft(distance, inertia, skew):
    """Co-rotating exciters on a platform with soft springs and hardly any damping, level with its centre of mass."""
    changes = {
        "machine": {
            "exciter_distance_m": distance,
            "platform_inertia_kg_m2": inertia,
            "stiffness_x_n_per_m": 5.8e3,
            "stiffness_y_n_per_m": 4.7e3,
            "stiffness_phi_n_m_per_rad": 18.0,
            "damping_x_n_s_per_m": 3.0,
            "damping_y_n_s_per_m": 3.0,
            "damping_phi_n_m_s_per_rad": 0.03,
        },
        # weak motors: what holds a phase difference against the vibration is the slope of their torque
        **{f"exciters.{i}.critical_torque_n_m": 0.3 for i in (0, 1)},
        "run.initial.phase_difference_rad": skew,
        "run.duration_s": 40.0,
    }
    return example("co-rotating-in-phase", changes)


@pytest.mark.parametrize("skew", [0.6, 2.5])
@pytest.mark.parametrize(
    ("distance", "inertia"), [(0.128, 0.14), (0.128, 0.122), (0.128, 0.08), (0.1, 0.08), (0.16, 0.11), (0.16, 0.18)]
)
def test_criterion_of_co_rotating_exciters_on_soft_springs(distance, inertia, skew):
    """In phase where Mρ²/J > 2, opposite where it is smaller (Blekhman)."""
    scene = soft(distance, inertia, skew)
    number = scene.machine.total_mass * distance**2 / scene.machine.inertia
    expected = 0.0 if number > 2.0 else math.pi
    assert abs(number - 2.0) > 0.1
    assert apart(phase_of(simulate(scene, keep="summary")), expected) < 0.02


@pytest.mark.parametrize(
    ("angle", "supply"),
    [
        (22.5, 50.0),
        (22.5, 80.0),
        *(
            pytest.param(angle, supply, marks=pytest.mark.long)
            for angle in (0.0, 22.5, -40.0)
            for supply in (38.0, 44.0, 58.0, 76.0, 90.0)
        ),
    ],
)
def test_phase_of_co_rotating_exciters_on_any_springs(angle, supply):
    """The stable phase minimizes −(G_x + G_y) cos Δ + p² G_φ cos(Δ − 2γ), with damping by balance of torques."""
    changes = {
        "machine.exciter_angle_deg": angle,
        "machine.damping_y_n_s_per_m": 400.0,
        "drive.supply_frequency_hz": supply,
        "run.duration_s": 16.0,
    }
    for skew in (0.5, 2.5):
        run = simulate(example("co-rotating-in-phase", {**changes, "run.initial.phase_difference_rad": skew}))
        omega = TURN * run.summary["excitation_frequency_hz"]
        (expected,) = stable_phases(run.scene, omega)
        assert apart(phase_of(run), expected) < 2e-3
        assert run.summary["phase_coherence"] > 0.9999
        first, second = net_torques(run.scene, omega, phase_of(run))
        assert max(abs(first), abs(second)) < 2e-3
