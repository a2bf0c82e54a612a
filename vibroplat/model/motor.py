"""Torque of the induction motors and resistance to rotation, for what reads a run."""

from __future__ import annotations

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, fused_inline, inlined
from vibroplat.kernels.lanes import Lanes, Pair, join, select
from vibroplat.kernels.on_demand import written
from vibroplat.model import straight
from vibroplat.model.parameters import Parameters


@inlined
def both(numbers: FloatArray) -> Pair:
    """Put the numbers of both exciters side by side."""
    return join(numbers[0], numbers[1])


@inlined
def sense_of(x: Lanes) -> Lanes:
    """Sense of a number, ±1; 0 for none."""
    return select(x > 0.0, 1.0, select(x < 0.0, -1.0, 0.0))


@compiled
def motor_torque(i: int, t: float, speed: float, p: Parameters) -> float:
    """Torque L_i of exciter i's motor at a time and a speed (N·m), counter-clockwise."""
    return torque_of_one(i, t, speed, p)


@inlined
@written(straight.torque_of_one)
def torque_of_one(i: int, t: float, speed: float, p: Parameters) -> float:  # type: ignore[empty-body]
    """Do as :func:`motor_torque`."""


@fused_inline
@written(straight.torques)
def motor_torques(t: Lanes, speed: Lanes, p: Parameters) -> Lanes:  # type: ignore[empty-body]
    """Do as :func:`motor_torque` for both exciters side by side, once or at several times."""


@fused_inline
@written(straight.resistances)
def resistances(speed: Lanes, p: Parameters) -> Lanes:  # type: ignore[empty-body]
    """Resistance k_R k φ̇|φ̇| of both exciters side by side (N·m), proportional to the centrifugal force.

    Its second derivative jumps where an exciter stops: multistep methods pass that without an event, and
    ``tests/motion/test_standstill.py`` says what it costs; the Taylor series ends a step there.
    """


@compiled
def motor_powers(times: FloatArray, speeds: FloatArray, p: Parameters) -> FloatArray:
    """Power of both motors (W), shape (n, 2), at times (s) and speeds (rad/s) of shape (n,) and (n, 2)."""
    power = np.empty(speeds.shape)
    for k in range(times.size):
        for i in range(2):
            power[k, i] = motor_torque(i, times[k], speeds[k, i], p) * speeds[k, i] + 0.0  # never −0
    return power
