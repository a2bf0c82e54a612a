"""Torque of the induction motors and resistance to rotation."""

from __future__ import annotations

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, inlined
from vibroplat.model.parameters import Parameters


@compiled
def kloss_torque(slip: float, critical: float, torque: float) -> float:
    """Motor torque in its own direction L = 2 M_c Δ u/(Δ² + u²) (N·m), with slip speed u and critical slip speed Δ.

    This is the formula of Kloss (1901) with the slip s = u/ω₀ and s_c = Δ/ω₀, multiplied out so that a supply of 0 Hz
    divides nothing. The paper's (1) has lost the slip in the denominator.

    Parameters
    ----------
    slip
        u = ω₀ − σφ̇: how much slower than its synchronous speed the motor turns (rad/s).
    critical
        Δ (rad/s).
    torque
        M_c (N·m).
    """
    square = critical * critical + slip * slip
    if square == 0.0:  # at rest at 0 Hz, where the torque has no limit: none
        return 0.0 * torque
    return 2.0 * torque * critical * slip / square


@compiled
def kloss_slope(slip: float, critical: float, torque: float) -> float:
    """Slope ∂L/∂u of :func:`kloss_torque` over Δ: ∂L/∂u = Δ times it, ∂L/∂Δ = −u times it (N·m·s²)."""
    square = critical * critical + slip * slip
    if square == 0.0:
        return 0.0 * torque
    return 2.0 * torque * (critical * critical - slip * slip) / (square * square)


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


@compiled
def motor_powers(times: FloatArray, speeds: FloatArray, p: Parameters) -> FloatArray:
    """Power of both motors (W), shape (n, 2), at times (s) and speeds (rad/s) of shape (n,) and (n, 2)."""
    found = np.empty(speeds.shape)
    for k in range(times.size):
        for i in range(2):
            found[k, i] = motor_torque(i, times[k], speeds[k, i], p) * speeds[k, i] + 0.0  # never −0
    return found


@compiled
def torque_rate(i: int, t: float, speed: float, p: Parameters) -> float:
    """Rate ∂L_i/∂t at constant speed (N·m/s): the supply changes."""
    slip, critical = slip_speeds(i, t, speed, p)
    turning = critical * p.speed_ramp[i] - slip * p.slip_ramp[i]
    return p.direction[i] * kloss_slope(slip, critical, p.torque[i]) * turning


@compiled
def resistance(speed: float, friction: float) -> float:
    """Resistance L_R = k_R k φ̇|φ̇| (N·m), proportional to the centrifugal force.

    Its second derivative jumps where the exciter stops, without an event; ``tests/flow/test_standstill.py`` says what
    that costs.
    """
    return friction * speed * abs(speed)


@compiled
def resistance_slope(speed: float, friction: float) -> float:
    """Slope dL_R/dφ̇ (N·m·s)."""
    return 2.0 * friction * abs(speed)


@compiled
def net_slope(i: int, t: float, speed: float, p: Parameters) -> float:
    """Slope d(L_i − L_Ri)/dφ̇_i of motor torque less resistance (N·m·s)."""
    slip, critical = slip_speeds(i, t, speed, p)
    return -critical * kloss_slope(slip, critical, p.torque[i]) - resistance_slope(speed, p.friction[i])
