"""Torque of the induction motors and resistance to rotation, and the terms of their Taylor series."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, fused_inline, inlined
from vibroplat.kernels.vectors import Lanes, Pair, join, select, size
from vibroplat.model.parameters import Parameters


@compiled
def kloss_torque(slip: float, critical: float, torque: float) -> float:
    """Motor torque in its own direction L = 2 M_c Δ u/(Δ² + u²) (N·m), with slip speed u and critical slip speed Δ.

    u = ω₀ − σφ̇ says how much slower than its synchronous speed the motor turns (rad/s). This is the formula of Kloss
    (1901) with the slip s = u/ω₀ and s_c = Δ/ω₀, multiplied out so that a supply of 0 Hz divides nothing. The paper's
    (1) has lost the slip in the denominator.
    """
    square = critical * critical + slip * slip
    if square == 0.0:  # at rest at 0 Hz, where the torque has no limit: none
        return 0.0 * torque
    return 2.0 * torque * critical * slip / square


class MotorTerms(NamedTuple):
    """What the terms of a motor's torque are made of: slip speed u and critical slip speed Δ, linear in time."""

    slip: float  # u and Δ now (rad/s)
    critical: float
    slip_ramp: float  # rates of the supply in them (rad/s²): u′ = slip_ramp − σφ̈
    critical_ramp: float
    square: float  # Δ² + u² (rad²/s²)
    share: float  # one over it; 0 for a motor at rest at 0 Hz, which has no torque


@fused_inline
def motor_at(i: int, t: float, speed: float, p: Parameters) -> MotorTerms:
    """Prepare the terms of exciter i's torque at a time and a speed (rad/s)."""
    slip, critical = slip_speeds(i, t, speed, p)
    square = critical * critical + slip * slip
    share = select(square > 0.0, 1.0 / square, 0.0)
    return MotorTerms(slip, critical, p.speed_ramp[i], p.slip_ramp[i], square, share)


@fused_inline
def square_term(k: int, slip_square: float, motor: MotorTerms) -> float:
    """Term k of Δ² + u² from that of u²."""
    if k == 0:
        return motor.square
    if k == 1:
        return slip_square + 2.0 * motor.critical * motor.critical_ramp
    return slip_square + motor.critical_ramp * motor.critical_ramp if k == 2 else slip_square


@fused_inline
def kloss_term(slip: float, slip_before: float, products: float, motor: MotorTerms, torque: float) -> float:
    """Term k of :func:`kloss_torque`, by (Δ² + u²) L = 2 M_c Δ u, from terms k and k − 1 of u.

    ``products`` is the sum of the terms j of Δ² + u² times k − j of L, j from 1 to k; ``torque`` is M_c (N·m).
    """
    driving = 2.0 * torque * (motor.critical * slip + motor.critical_ramp * slip_before)
    return (driving - products) * motor.share


@inlined
def slip_speeds(i: int, t: float, speed: float, p: Parameters) -> tuple[float, float]:
    """Slip speed and critical slip speed of exciter i's motor at a time and a speed (rad/s)."""
    elapsed = t - p.since
    synchronous = p.speed[i] + p.speed_ramp[i] * elapsed
    return synchronous - p.direction[i] * speed, p.slip_speed[i] + p.slip_ramp[i] * elapsed


@compiled
def motor_torque(i: int, t: float, speed: float, p: Parameters) -> float:
    """Torque L_i of exciter i's motor at a time and a speed (N·m), counter-clockwise."""
    slip, critical = slip_speeds(i, t, speed, p)
    return p.direction[i] * kloss_torque(slip, critical, p.torque[i])


@inlined
def both(numbers: FloatArray) -> Pair:
    """Put the numbers of both exciters side by side."""
    return join(numbers[0], numbers[1])


@fused_inline
def motor_torques(t: Lanes, speed: Lanes, p: Parameters) -> Lanes:
    """Do as :func:`motor_torque` for both exciters side by side, once or at several times."""
    elapsed = t - p.since
    slip = both(p.speed) + both(p.speed_ramp) * elapsed - both(p.direction) * speed
    critical = both(p.slip_speed) + both(p.slip_ramp) * elapsed
    square = critical * critical + slip * slip
    share = select(square > 0.0, 1.0 / square, 0.0)
    return both(p.direction) * (2.0 * both(p.torque) * critical * slip * share)


@fused_inline
def resistances(speed: Lanes, p: Parameters) -> Lanes:
    """Do as :func:`resistance` for both exciters side by side."""
    return both(p.friction) * speed * size(speed)


@compiled
def motor_powers(times: FloatArray, speeds: FloatArray, p: Parameters) -> FloatArray:
    """Power of both motors (W), shape (n, 2), at times (s) and speeds (rad/s) of shape (n,) and (n, 2)."""
    power = np.empty(speeds.shape)
    for k in range(times.size):
        for i in range(2):
            power[k, i] = motor_torque(i, times[k], speeds[k, i], p) * speeds[k, i] + 0.0  # never −0
    return power


@fused_inline
def resistance_term(square: float, sense: float, friction: float) -> float:
    """Term of :func:`resistance` from that of φ̇², while the exciter turns in a sense (±1)."""
    return friction * sense * square
