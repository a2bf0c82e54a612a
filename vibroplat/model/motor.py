"""Torque of the induction motors and resistance to rotation."""

from __future__ import annotations

from vibroplat.kernels.compiled import compiled
from vibroplat.model.parameters import Parameters


@compiled
def kloss_torque(speed: float, direction: float, torque: float, slip: float, synchronous: float) -> float:
    """Motor torque L = 2σ M_c s_c s/(s_c² + s²), s = (ω₀ − σφ̇)/ω₀ (N·m).

    The paper's (1) has lost the slip s in the denominator (`model.md`, first row of departures);
    this is the formula of Kloss (1901).
    """
    s = 1.0 - direction * speed / synchronous
    return 2.0 * direction * torque * slip * s / (slip * slip + s * s)


@compiled
def kloss_slope(speed: float, direction: float, torque: float, slip: float, synchronous: float) -> float:
    """Slope dL/dφ̇ of :func:`kloss_torque` (N·m·s)."""
    s = 1.0 - direction * speed / synchronous
    square = slip * slip + s * s
    return -2.0 * torque * slip * (slip * slip - s * s) / (square * square * synchronous)


@compiled
def resistance(speed: float, friction: float) -> float:
    """Resistance L_R = k_R k φ̇|φ̇| (N·m), proportional to the centrifugal force."""
    return friction * speed * abs(speed)


@compiled
def resistance_slope(speed: float, friction: float) -> float:
    """Slope dL_R/dφ̇ (N·m·s)."""
    return 2.0 * friction * abs(speed)


@compiled
def motor_torque(i: int, t: float, speed: float, p: Parameters) -> float:
    """Torque L_i of exciter i's motor at a time and a speed (N·m). The supply is constant, so t is not read."""
    return kloss_torque(speed, p.direction[i], p.torque[i], p.slip[i], p.speed[i])


@compiled
def net_slope(i: int, t: float, speed: float, p: Parameters) -> float:
    """Slope d(L_i − L_Ri)/dφ̇_i of motor torque less resistance (N·m·s)."""
    slope = kloss_slope(speed, p.direction[i], p.torque[i], p.slip[i], p.speed[i])
    return slope - resistance_slope(speed, p.friction[i])
