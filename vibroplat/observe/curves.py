"""Extremes of what is no polynomial of time over a run: torques and powers of motors, forces that are not linear."""

from __future__ import annotations

from typing import Any

import numpy as np

from vibroplat.kernels.compiled import compiled, inlined
from vibroplat.kernels.polynomial import value
from vibroplat.model.motor import motor_torque
from vibroplat.model.parameters import Parameters
from vibroplat.model.springs import foundation_forces_at
from vibroplat.model.systems import DIFFERENTIAL
from vibroplat.observe.extremes import (
    DRIVEN_1,
    POWER_1,
    PULL_X,
    SPEED_1,
    TORQUE_1,
    Span,
    place_of,
    remember,
    vertex,
)

#: Width of a search beside that of the one before.
CLOSER = 0.05


@compiled
def quantity_at(k: int, s: float, span: Span, p: Parameters) -> float:
    """Evaluate quantity k at a fraction of a step: a force into the foundation, a motor's torque or its power."""
    n, c, degree = DIFFERENTIAL[span.system] // 2, span.c, span.degree
    if PULL_X <= k < SPEED_1:
        x, y, phi = value(c, degree, 0, s), value(c, degree, 1, s), value(c, degree, 2, s)
        rates = value(c, degree, n, s), value(c, degree, n + 1, s), value(c, degree, n + 2, s)
        return foundation_forces_at(x, y, phi, rates[0], rates[1], rates[2], p)[k - PULL_X]
    i = k - POWER_1 if k >= POWER_1 else k - TORQUE_1
    return motor_quantity(k, i, value(c, degree, n + 3 + i, s), s, span, p)


@inlined
def motor_quantity(k: int, i: int, speed: float, s: float, span: Span, p: Parameters) -> float:
    """Torque of motor i in the direction of the drive, or its power, at a speed at a fraction of a step."""
    torque = motor_torque(i, span.begin + s * span.length, speed, p)
    return torque * speed if k >= POWER_1 else p.direction[i] * torque


@inlined
def sampled(k: int, i: int, place: float, room: Any, span: Span, p: Parameters) -> float:
    """Evaluate quantity k at sample i of a part of a step, which is at a fraction of the step."""
    if PULL_X <= k < SPEED_1:
        return float(room.quantities[i, k])
    motor = k - POWER_1 if k >= POWER_1 else k - TORQUE_1
    speed = room.samples[i, DIFFERENTIAL[span.system] // 2 + 3 + motor]
    return motor_quantity(k, motor, speed, place, span, p)


@compiled
def follow(extremes: Any, k: int, room: Any, span: Span, p: Parameters) -> None:
    """Let the extremes of quantity k cover a part of a step.

    They are among its samples, or at vertices of parabolas through three of them, found twice more from closer points.
    """
    low, middle, before, here = 0.0, 0.0, 0.0, 0.0
    for i in range(span.nodes + 2):
        high = place_of(i, span)
        after = sampled(k, i, high, room, span, p)
        remember(extremes, k, after, high, span)
        s, width = vertex((low, middle, high), (before, here, after)), high - low
        if i > 1 and low < s < high:
            for _ in range(2):
                width *= CLOSER
                left, right = max(s - width, span.first), min(s + width, span.last)
                values = quantity_at(k, left, span, p), quantity_at(k, s, span, p), quantity_at(k, right, span, p)
                s = min(max(vertex((left, s, right), values), left), right)
            remember(extremes, k, quantity_at(k, s, span, p), s, span)
        low, middle, before, here = middle, high, here, after


@inlined
def update_motor_extremes(
    extremes: Any, i: int, known: tuple[float, float], room: Any, span: Span, p: Parameters
) -> None:
    """Update the extremes of torque and power of motor i over a step, and those of its speed over all supplies.

    At a constant supply torque and power depend on the speed alone: they have new extremes only where the speed has,
    since the supply has changed, and between the speed's extremes before the step, ``known``, and after it.
    """
    k, followed = DRIVEN_1 + i, p.speed_ramp[i] != 0.0 or p.slip_ramp[i] != 0.0
    for speed, at, before in (
        (extremes.least[k], extremes.at_least[k], known[0]),
        (extremes.largest[k], extremes.at_largest[k], known[1]),
    ):
        if speed == before:
            continue
        s = (at - span.begin) / span.length
        remember(extremes, SPEED_1 + i, speed, s, span)
        for quantity in (TORQUE_1 + i, POWER_1 + i):
            reached = motor_quantity(quantity, i, speed, s, span, p)
            remember(extremes, quantity, reached, s, span)
            between = motor_quantity(quantity, i, 0.5 * (before + speed), s, span, p)
            values = motor_quantity(quantity, i, before, s, span, p), between, reached
            followed |= not 0.0 < abs(before) < np.inf or 0.0 < vertex((0.0, 0.5, 1.0), values) < 1.0
    if followed:
        follow(extremes, TORQUE_1 + i, room, span, p)
        follow(extremes, POWER_1 + i, room, span, p)
