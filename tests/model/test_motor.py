"""Kloss's torque and the resistance at points where their values are known, under a constant and a changing supply."""

from itertools import product

import numpy as np
import pytest

from vibroplat import Scene
from vibroplat.kernels.compiled import compiled
from vibroplat.model.accelerations import accelerations, second_derivatives
from vibroplat.model.equations import jacobian, rates_of_rows
from vibroplat.model.motor import motor_powers, motor_torque
from vibroplat.model.parameters import blank_record, parameters
from vibroplat.model.systems import SYSTEMS

from .helpers import TIME, central_difference, random_states, scene_of, torque_by_quotient

CRITICAL, SLIP, SYNCHRONOUS = 1.2, 0.15, 160.0
BARE = SYSTEMS[0]


@compiled
def fill_rates(t, y, yp, b, p):
    rates_of_rows(0, t, y, yp, b, p)


def torque_rate(i, t, speed, p):
    """Rate of a motor's torque at constant speed: that of its exciter's row, where nothing else moves."""
    y, b = np.zeros(BARE.size), np.zeros(BARE.size)
    y[8 + i] = speed
    fill_rates(t, y, np.zeros(BARE.size), b, p)
    return b[8 + i]


def net_slope(i, t, speed, p):
    """Slope of torque less resistance by the speed, in its exciter's row."""
    y, jac = np.zeros(BARE.size), np.empty((BARE.size, BARE.size))
    y[8 + i] = speed
    jacobian(0, t, y, np.zeros(BARE.size), 0.0, jac, p)
    return -jac[8 + i, 8 + i]


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_torque_at_known_slips(direction):
    """It drives below synchronous speed and brakes above; standstill and counter-rotation included."""
    p = blank_record()  # without resistance
    p.direction = direction, -direction
    p.torque, p.speed, p.slip_speed = CRITICAL, SYNCHRONOUS, SLIP * SYNCHRONOUS

    def torque(slip):
        return motor_torque(0, 0.3, direction * (1.0 - slip) * SYNCHRONOUS, p) * direction

    assert (torque(SLIP), torque(-SLIP), torque(0.0)) == pytest.approx((CRITICAL, -CRITICAL, 0.0), rel=1e-13)
    assert torque(1.0) == pytest.approx(2.0 * CRITICAL / (1.0 / SLIP + SLIP), rel=1e-13)  # at the start
    for slip in (0.01, SLIP, 1.0, 1.7):
        assert torque(slip) > 0.0 > torque(-slip)
    assert max(abs(torque(slip)) for slip in np.linspace(-2.0, 3.0, 1001)) <= CRITICAL * (1.0 + 1e-13)
    assert [torque_rate(i, 0.3, 120.0, p) for i in range(2)] == [0.0, 0.0]
    steepest = 2.0 * CRITICAL / (SLIP * SYNCHRONOUS)
    assert net_slope(0, 0.3, direction * SYNCHRONOUS, p) == pytest.approx(-steepest, rel=1e-13)


@pytest.mark.parametrize(("slip", "critical", "torque"), [(30.0, 24.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, CRITICAL)])
def test_a_switched_off_supply_and_one_of_0_hz_have_no_torque(slip, critical, torque):
    p = blank_record()
    p.direction, p.speed, p.slip_speed, p.torque = 1.0, slip, critical, torque
    assert motor_torque(0, 0.0, 0.0, p) == 0.0


#: Speeds beyond the synchronous ones, below, at rest, and against them (rad/s).
SPEEDS = (-210.0, -80.0, -1e-3, 0.0, 1e-3, 95.0, 210.0)


def test_torque_under_a_rising_supply_is_that_of_the_frequency_then():
    """The second motor keeps its critical slip, the first the critical slip speed of its rated frequency."""
    scene = scene_of(0, "rising")
    p = parameters(scene, TIME)
    assert p.since == 1.0
    assert p.slip_ramp[0] == 0.0 < p.slip_ramp[1] < p.speed_ramp[1]
    for i, motor in enumerate(scene.exciters):
        fastest = 2.0 * p.torque[i] * p.speed_ramp[i] / p.slip_speed[i]
        direction = -1.0 if motor.rotation == "clockwise" else 1.0
        for time, speed in product((1.0, TIME, 2.9999), SPEEDS):
            torque = motor_torque(i, time, speed, p)
            expected = torque_by_quotient(motor, 30.0 + 19.0 * (time - 1.0), direction, speed)
            assert torque == pytest.approx(expected, rel=1e-13)
            assert motor_powers(np.full(1, time), np.full((1, 2), speed), p)[0, i] == torque * speed
        for v in SPEEDS:
            numerical = central_difference(lambda change, i=i, v=v: motor_torque(i, TIME + change, v, p), step=1e-3)
            assert torque_rate(i, TIME, v, p) == pytest.approx(numerical, abs=1e-11 * fastest)


def start(frequency=0.0, **motor):
    """Return the parameters at the first moment of a start from 0 Hz; it has been 0 Hz for a second."""
    entries = [(0.0, frequency), (1.0, frequency), (3.0, 50.0)]
    program = [{"t_s": t, "supply_frequency_hz": f} for t, f in entries]
    return parameters(Scene(motor=motor, drive={"program": program}), 0.5)


@pytest.mark.parametrize("motor", [{}, {"rated_frequency_hz": 50.0}], ids=["critical slip", "critical slip speed"])
def test_supply_of_0_hz_brakes_like_direct_current(motor):
    """Whatever turns is braked. The critical slip speed stays above 0, at 1/1000 of the largest."""
    p = start(**motor)
    assert (p.speed == 0.0).all()
    assert motor_torque(0, 0.5, 0.0, p) == torque_rate(0, 0.5, 0.0, p) == 0.0
    for speed in (1e-9, 0.02, 3.0, 160.0):
        assert motor_torque(0, 0.5, speed, p) < 0.0
        assert motor_torque(0, 0.5, -speed, p) == -motor_torque(0, 0.5, speed, p)
    least = start(0.05, **motor).slip_speed
    assert (p.slip_speed == least).all()
    assert motor or least[0] == pytest.approx(0.15 * 2.0 * np.pi * 0.05 / 2, rel=1e-14)


@pytest.mark.parametrize("still", [True, False])
def test_equations_have_finite_derivatives_at_0_hz(still):
    p, system = start(), SYSTEMS[0]
    (state,) = random_states(seed=15, count=1)
    state[7:] *= not still
    y, yp, ypp = system.unknowns(state), np.empty(system.size), np.empty(system.size)
    assert accelerations(system.index, 0.0, y, yp, p)
    assert second_derivatives(system.index, 0.0, y, yp, ypp, p)
    jac = np.empty((system.size, system.size))
    jacobian(system.index, 0.0, y, yp, 1e3, jac, p)
    assert all(np.isfinite(found).all() for found in (y, yp, ypp, jac))
