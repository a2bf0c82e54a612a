"""Kloss's torque and the resistance at points where their values are known."""

import numpy as np
import pytest

from vibroplat.model.motor import kloss_slope, kloss_torque, resistance, resistance_slope

from .helpers import central_difference

CRITICAL, SLIP, SYNCHRONOUS = 1.2, 0.15, 160.0

each_direction = pytest.mark.parametrize("direction", [1.0, -1.0])


def torque(speed, direction):
    return kloss_torque(speed, direction, CRITICAL, SLIP, SYNCHRONOUS)


def speed_at(slip, direction):
    return direction * (1.0 - slip) * SYNCHRONOUS


@each_direction
def test_torque_is_critical_at_critical_slip(direction):
    assert torque(speed_at(SLIP, direction), direction) == pytest.approx(direction * CRITICAL, rel=1e-13)
    assert torque(speed_at(-SLIP, direction), direction) == pytest.approx(-direction * CRITICAL, rel=1e-13)


@each_direction
def test_torque_is_nowhere_larger(direction):
    speeds = np.linspace(-2.0, 3.0, 1001) * SYNCHRONOUS
    assert max(abs(torque(speed, direction)) for speed in speeds) <= CRITICAL * (1.0 + 1e-13)


@each_direction
def test_torque_is_zero_at_synchronous_speed(direction):
    assert torque(speed_at(0.0, direction), direction) == 0.0


@each_direction
def test_torque_drives_below_synchronous_speed_and_brakes_above(direction):
    # standstill and counter-rotation included
    for slip in (0.01, SLIP, 1.0, 1.7):
        assert direction * torque(speed_at(slip, direction), direction) > 0.0
        assert direction * torque(speed_at(-slip, direction), direction) < 0.0


@each_direction
def test_starting_torque(direction):
    # s = 1: L = 2 M_c / (1/s_c + s_c)
    expected = direction * 2.0 * CRITICAL / (1.0 / SLIP + SLIP)
    assert torque(0.0, direction) == pytest.approx(expected, rel=1e-13)


def test_directions_mirror_each_other():
    for speed in (-200.0, -31.0, 0.0, 12.0, 155.0):
        assert torque(-speed, -1.0) == -torque(speed, 1.0)


@each_direction
@pytest.mark.parametrize("slip", [-2.0, -SLIP, -0.05, 0.0, 0.02, SLIP, 0.4, 1.0])
def test_slope_of_torque(direction, slip):
    speed = speed_at(slip, direction)
    numerical = central_difference(lambda change: torque(speed + change, direction), step=0.05)
    steepest = 2.0 * CRITICAL / (SLIP * SYNCHRONOUS)
    # step / (s_c ω₀) = 0.002: sixth-order error and round-off are both below 1e-12 of the steepest slope
    assert kloss_slope(speed, direction, CRITICAL, SLIP, SYNCHRONOUS) == pytest.approx(numerical, abs=1e-11 * steepest)


@each_direction
def test_slope_at_synchronous_speed_brakes(direction):
    slope = kloss_slope(direction * SYNCHRONOUS, direction, CRITICAL, SLIP, SYNCHRONOUS)
    assert slope == pytest.approx(-2.0 * CRITICAL / (SLIP * SYNCHRONOUS), rel=1e-13)


def test_no_critical_torque_is_a_switched_off_supply():
    assert kloss_torque(50.0, 1.0, 0.0, SLIP, SYNCHRONOUS) == 0.0
    assert kloss_slope(50.0, 1.0, 0.0, SLIP, SYNCHRONOUS) == 0.0


@pytest.mark.parametrize("speed", [-150.0, -0.3, 0.3, 150.0])
def test_resistance_is_against_the_rotation(speed):
    friction = 2e-7
    # the equations have −L_R, so L_R has the sign of the speed
    assert resistance(speed, friction) == pytest.approx(np.sign(speed) * friction * speed**2, rel=1e-15)
    assert resistance(speed, friction) * speed > 0.0


def test_resistance_vanishes_at_standstill():
    assert resistance(0.0, 2e-7) == 0.0
    assert resistance_slope(0.0, 2e-7) == 0.0


@pytest.mark.parametrize("speed", [-150.0, -2.0, 2.0, 150.0])
def test_slope_of_resistance(speed):
    numerical = central_difference(lambda change: resistance(speed + change, 2e-7), step=0.1)
    assert resistance_slope(speed, 2e-7) == pytest.approx(numerical, rel=1e-11)
