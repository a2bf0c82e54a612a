"""The largest Lyapunov exponent against the bouncing ball's map, whose multipliers are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vibroplat import load_config
from vibroplat.bench.known import GRAVITY, OMEGA, TURN, ball_on_table
from vibroplat.solver.initial import initial_state
from vibroplat.study.lyapunov import SKIPPED, largest_exponent, turns_later

from .helpers import CHAOTIC, MACHINE, swept

#: Only gap and gap rate are changed: the table's own motion is undamped, its exponent 0.
OF_THE_BALL = np.zeros(14)
OF_THE_BALL[[5, 12]] = 1.0, 0.3


def jacobian(gamma_sine, restitution):
    """Of the map (impact phase, speed after it) ↦ the next ones, at the period-1 orbit, Γ sin φ given.

    In units of g/ω² and 1/ω: Γ sin θ' = Γ sin θ + w(θ' − θ) − (θ' − θ)²/2, w' = (1 + R)Γ cos θ' − R(w − θ' + θ),
    and w = π, θ' − θ = 2π, Γ cos θ = π(1 − R)/(1 + R) on the orbit.
    """
    gamma_cosine = math.pi * (1.0 - restitution) / (1.0 + restitution)
    shift = np.array([1.0, 2.0 * math.pi / (math.pi + gamma_cosine)])
    by_phase = -(1.0 + restitution) * gamma_sine + restitution
    return np.array([shift, by_phase * shift - restitution])


def on_the_orbit(gamma_sine, restitution):
    """Scene and state right after an impact of the period-1 orbit, cos φ = π(1 − R)/((1 + R)Γ)."""
    gamma_cosine = math.pi * (1.0 - restitution) / (1.0 + restitution)
    gamma, phase = math.hypot(gamma_cosine, gamma_sine), math.atan2(gamma_sine, gamma_cosine)
    rebound = (math.pi - gamma_cosine) * GRAVITY / OMEGA
    scene = ball_on_table(gamma, restitution, phase=phase, gap_rate=rebound)
    return scene, initial_state(scene)


def measured_log(gamma_sine, restitution, turns):
    """Logarithm of the growth a period, over so many periods that are counted."""
    scene, state = on_the_orbit(gamma_sine, restitution)
    found = largest_exponent(scene, state, OF_THE_BALL, comparisons=SKIPPED + turns, turns=1)
    return found * TURN / OMEGA


def test_determinant_of_the_map_is_the_square_of_restitution():
    for restitution in (0.2, 0.5, 0.8):
        assert np.linalg.det(jacobian(0.3, restitution)) == pytest.approx(restitution**2, rel=1e-12)


# Γ sin φ between ((1 − R)/(1 + R))² and 1 gives a complex pair of modulus R.
@pytest.mark.parametrize(("gamma_sine", "restitution"), [(0.5, 0.8), (0.3, 0.8), (0.7, 0.7), (0.5, 0.6)])
def test_exponent_of_a_complex_pair_is_that_of_restitution(gamma_sine, restitution):
    """Differences turn while they shrink: counted over whole half turns they are as long as their modulus says."""
    multiplier = np.linalg.eigvals(jacobian(gamma_sine, restitution))[0]
    assert abs(multiplier.imag) > 0.1
    assert abs(multiplier) == pytest.approx(restitution, rel=1e-12)
    halves = [n * abs(np.angle(multiplier)) / math.pi for n in range(8, 17)]
    turns = 8 + int(np.argmin([abs(h - round(h)) for h in halves]))
    assert measured_log(gamma_sine, restitution, turns) == pytest.approx(math.log(restitution), abs=0.02)


# real and positive near the saddle-node, real and negative near and beyond the period doubling
@pytest.mark.parametrize(
    ("gamma_sine", "restitution", "sign", "stable"),
    [(0.05, 0.5, 1, True), (1.05, 0.5, -1, True), (1.2, 0.5, -1, False), (1.5, 0.5, -1, False), (1.3, 0.2, -1, True)],
)
def test_exponent_of_real_multipliers_is_that_of_the_larger(gamma_sine, restitution, sign, stable):
    multipliers = np.linalg.eigvals(jacobian(gamma_sine, restitution))
    assert np.isrealobj(multipliers)
    largest = multipliers[np.abs(multipliers).argmax()]
    assert (np.sign(largest), abs(largest) < 1.0) == (sign, stable)
    found = measured_log(gamma_sine, restitution, 10)
    assert found == pytest.approx(math.log(abs(largest)), abs=5e-3)


def test_exponent_in_antiphase_knows_no_whole_turns_of_exciter_2():
    """Its angle is ±π where exciter 1 completes a turn; two neighbours may lie on either side of the cut."""
    scene, state = settled(MACHINE, 51.0, {"material.mass_ratio": 0.2})
    assert abs(math.remainder(state[4], TURN)) == pytest.approx(math.pi, abs=1e-6)
    states = [state + shift * np.eye(14)[4] for shift in (-1e-3, 0.0, 1e-3, TURN)]
    found = [largest_exponent(scene, s) for s in states]
    assert found == pytest.approx([found[0]] * 4, rel=0.05)


def test_exponent_does_not_depend_on_the_turns_between_comparisons():
    scene, state = on_the_orbit(1.2, 0.5)
    one, three = (largest_exponent(scene, state, OF_THE_BALL, comparisons=SKIPPED + 6, turns=n) for n in (1, 3))
    assert three == pytest.approx(one, rel=0.02)


def settled(config, frequency, changes=None):
    """A scene and its state after thirty seconds."""
    scene = load_config(config, {**(changes or {}), "drive.supply_frequency_hz": frequency})
    later = turns_later(scene, initial_state(scene), int(15 * frequency))
    assert later is not None
    return scene, later[1]


def test_exponent_of_the_chaotic_scene_is_positive():
    scene, state = settled(MACHINE, 62.5, CHAOTIC)
    found = largest_exponent(scene, state)
    assert 1.0 < found < 30.0


@pytest.mark.parametrize(("frequency", "restitution"), [(51.0, 0.0), (53.0, 0.0), (51.0, 0.3)])
def test_exponent_of_a_periodic_scene_with_impacts_is_negative(frequency, restitution):
    scene, state = settled(MACHINE, frequency, {"material.mass_ratio": 0.2, "contact.restitution": restitution})
    assert -30.0 < largest_exponent(scene, state) < -0.1


@pytest.mark.parametrize("frequency", [63.0, 66.0])
def test_exponent_is_that_of_the_slowest_settling(frequency):
    """Bare and in phase, the phase difference settles last: its rate is read off the section."""
    scene, state = settled(MACHINE, frequency, {"run.initial.phase_sum_rad": 0.3})
    state[11] += 1.0
    accurate = scene.replace({"solver.tolerance": 1e-10})
    phases = []
    for _ in range(5):
        seconds, state = turns_later(accurate, state, 30)
        phases.append(math.remainder(state[3] + state[4], 2.0 * math.pi))
    rate = math.log((phases[4] - phases[3]) / (phases[3] - phases[2])) / seconds
    assert largest_exponent(scene, state) == pytest.approx(rate, rel=0.05)


def test_no_exponent_where_the_exciter_stands_still():
    scene = load_config(MACHINE, {"run.initial.speed_ratio": 0.0, "motor.critical_torque_n_m": 0.0})
    assert math.isnan(largest_exponent(scene, initial_state(scene)))


def test_no_exponent_where_the_motion_ends_early():
    scene, state = settled(MACHINE, 62.5, CHAOTIC)
    assert math.isnan(largest_exponent(scene.replace({"solver.max_events_per_period": 1}), state))


# -- in a table -----------------------------------------------------------------------------------------


def test_exponent_is_estimated_where_no_period_is_found():
    chaotic = swept(MACHINE, 62.5, changes=CHAOTIC).iloc[0]
    periodic = swept(MACHINE, 51.0, changes={"material.mass_ratio": 0.2}).iloc[0]
    assert chaotic["lyapunov_per_s"] > 1.0
    assert math.isnan(periodic["lyapunov_per_s"])


def test_exponent_is_left_out_on_demand():
    row = swept(MACHINE, 62.5, changes=CHAOTIC, lyapunov=False).iloc[0]
    assert (row["period"], math.isnan(row["lyapunov_per_s"])) == (0, True)
