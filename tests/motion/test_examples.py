"""The examples of configs/examples show what their headers say; known answers are averaged torques, see
:mod:`common.synchronization`."""

import math
from functools import cache

import numpy as np
import pytest
from common.places import ROOT
from common.synchronization import (
    TURN,
    influence,
    net_torques,
    stable_phases,
    steady_frequencies,
)
from scipy.optimize import brentq

from vibroplat import load_config, simulate

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


def test_energy_of_the_examples_balances_and_their_platforms_rotate_little():
    for path in EXAMPLES:
        summary = simulate(load_config(path, {"solver.tolerance": 1e-10}), keep="summary").summary
        assert (summary["outcome"], summary["name"]) == ("ok", path.stem)
        assert summary["energy_residual"] <= 1e-6, path.stem
        assert summary["phi_max_rad"] < 0.1, path.stem


@pytest.mark.parametrize(
    ("machine", "phase"), [("screen", math.pi), ("feeder", 1.479), ("inclined-screen", 0.0), ("heavy-screen", math.pi)]
)
def test_machines_of_templates_start_from_rest_and_shake_as_such_machines_do(machine, phase):
    scene = load_config(ROOT / f"configs/templates/{machine}.yaml", {"solver.engine": "taylor"})
    spring, motor = scene.machine.stiffness_y_n_per_m, scene.exciter_pair[0]
    assert 2.0 < math.sqrt(spring / scene.body.mass) / TURN < 5.0
    run = simulate(scene, keep="summary")
    summary = run.summary
    assert (run.outcome, run.notes) == ("ok", [])
    assert apart(phase_of(run), phase) < 0.01
    frequency, height = summary["excitation_frequency_hz"], math.sqrt(2.0) * summary["rms_y_m"]
    assert 0.0 < 1.0 - frequency * motor.pole_pairs / scene.drive.supply_frequency_hz < motor.critical_slip / 3.0
    assert 1e-3 < height < 5e-3
    assert 2.0 < height * (TURN * frequency) ** 2 / scene.machine.gravity_m_per_s2 < 5.0


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


# -- coast-down -------------------------------------------------------------------------------------------


def test_coast_down_passes_resonance_below_its_amplitude():
    """The amplitude after a fast passage is F/(Mω₀) √(π/2α) (Lewis), with α the rate at which the speed falls there."""
    run = finished("coast-down")
    machine, table = run.scene.machine, run.trajectory
    natural = math.sqrt(machine.stiffness_y_n_per_m / run.scene.body.mass)
    turns = table["t_s"].to_numpy(), 0.5 * (table["phi1_rad"] - table["phi2_rad"]).to_numpy()
    ends = turns[0][-1]
    grid = np.arange(1.2, ends, 1.0 / 33.0)
    speeds = np.diff(np.interp(grid, *turns)) * 33.0
    passing = int(np.flatnonzero(speeds < natural)[0])
    slowing = (speeds[passing - 4] - speeds[passing + 3]) * 33.0 / 7.0
    coasting = table[table["t_s"] > grid[passing] - 0.2]
    largest = 0.5 * (coasting["y_m"].max() - coasting["y_m"].min())
    lewis = sum(run.scene.unbalances) * natural / run.scene.body.mass * math.sqrt(math.pi / (2.0 * slowing))
    steady = sum(run.scene.unbalances) * natural / machine.damping_y_n_s_per_m
    assert largest == pytest.approx(lewis, rel=0.15)
    assert largest < steady / 4.0


# -- one motor off ----------------------------------------------------------------------------------------


def follows(run):
    return abs(run.summary["frequency_split_hz"]) < TOGETHER


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


@pytest.mark.parametrize(("angle", "supply"), [(22.5, 50.0), pytest.param(-40.0, 58.0, marks=pytest.mark.long)])
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
