"""Largest torques and powers of the motors over a run, found step by step from their speeds."""

from __future__ import annotations

from typing import Any

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, inlined
from vibroplat.kernels.polynomial import crossing, value
from vibroplat.model.motor import motor_torque, slip_speeds
from vibroplat.model.parameters import Parameters
from vibroplat.model.systems import DIFFERENTIAL
from vibroplat.observe.extremes import (
    DRIVEN_1,
    POWER_1,
    SPEED_1,
    TORQUE_1,
    Span,
    place_of,
    remember,
    vertex,
)


@inlined
def torque_and_power(i: int, speed: float, s: float, span: Span, p: Parameters) -> tuple[float, float]:
    """Torque of motor i in the direction of the drive, and its power, at a speed at a fraction of a step."""
    torque = motor_torque(i, span.begin + s * span.length, speed, p)
    return p.direction[i] * torque, torque * speed


@inlined
def update_motor_at(extremes: Any, i: int, speed: float, s: float, span: Span, p: Parameters) -> None:
    """Update the extremes of torque and power of motor i with their values at a speed."""
    torque, power = torque_and_power(i, speed, s, span, p)
    remember(extremes, TORQUE_1 + i, torque, s, span)
    remember(extremes, POWER_1 + i, power, s, span)


@inlined
def update_motor_extremes(
    extremes: Any, i: int, known: tuple[float, float], samples: FloatArray, span: Span, p: Parameters
) -> None:
    """Update the extremes of torque and power of motor i over a step, and those of its speed over all supplies.

    At a constant supply torque and power depend on the speed alone: they have extremes at new extremes of the speed
    since the supply has changed, at the critical slip, and for the power where u² + 2uΔ²/ω₀ = Δ², with slip speed u and
    critical slip speed Δ. While the supply changes they are searched for among samples. Extremes of the speed before
    the step are ``known``.
    """
    k, j, (least, largest) = DRIVEN_1 + i, DIFFERENTIAL[span.system] // 2 + 3 + i, known
    last = samples[span.nodes + 1, j]
    for speed, at, new in (
        (extremes.least[k], extremes.at_least[k], extremes.least[k] < least),
        (extremes.largest[k], extremes.at_largest[k], extremes.largest[k] > largest),
    ):
        if new:
            s = (at - span.begin) / span.length
            remember(extremes, SPEED_1 + i, speed, s, span)
            update_motor_at(extremes, i, speed, s, span, p)
    if extremes.least[k] < least or extremes.largest[k] > largest:
        critical = slip_speeds(i, span.begin, last, p)[1]
        synchronous = slip_speeds(i, span.begin + span.length, last, p)[0] + p.direction[i] * last
        pass_levels(extremes, i, (samples[0, j], last), synchronous, critical, span, p)
    if p.speed_ramp[i] != 0.0 or p.slip_ramp[i] != 0.0:
        follow_ramp(extremes, i, j, samples, span, p)


@compiled
def pass_levels(
    extremes: Any, i: int, ends: tuple[float, float], synchronous: float, critical: float, span: Span, p: Parameters
) -> None:
    """Let the extremes of motor i cover the slips of largest torque and power that a step passes."""
    j, ratio = DIFFERENTIAL[span.system] // 2 + 3 + i, critical / synchronous if synchronous != 0.0 else 0.0
    root = np.sqrt(1.0 + ratio * ratio)
    for slip in (critical, -critical, critical * (root - ratio), -critical * (root + ratio)):
        level = p.direction[i] * (synchronous - slip)
        if (ends[0] - level) * (ends[1] - level) < 0.0:
            s = crossing(span.c, span.degree, j, level, value(span.c, span.degree, j, 1.0))
            if span.first <= s <= span.last:
                update_motor_at(extremes, i, level, s, span, p)


@compiled
def follow_ramp(extremes: Any, i: int, j: int, samples: FloatArray, span: Span, p: Parameters) -> None:
    """Update the extremes of motor i with torque and power at samples of its speed, in column j, and between them.

    If the middle one of three samples is the largest or smallest, the extreme is at the vertex of a parabola.
    """
    low, middle, before, here = 0.0, 0.0, (0.0, 0.0), (0.0, 0.0)
    for k in range(span.nodes + 2):
        high, speed = place_of(k, span), samples[k, j]
        after = torque_and_power(i, speed, high, span, p)
        update_motor_at(extremes, i, speed, high, span, p)
        for q in range(2):
            if k > 1 and (here[q] - before[q]) * (after[q] - here[q]) < 0.0:
                s, width = vertex((low, middle, high), (before[q], here[q], after[q])), high - low
                for _ in range(2):  # through closer points
                    width *= 0.05
                    places = max(s - width, span.first), s, min(s + width, span.last)
                    speeds = [value(span.c, span.degree, j, place) for place in places]
                    of = [torque_and_power(i, speeds[m], places[m], span, p)[q] for m in range(3)]
                    s = min(max(vertex(places, (of[0], of[1], of[2])), places[0]), places[2])
                update_motor_at(extremes, i, value(span.c, span.degree, j, s), s, span, p)
        low, middle, before, here = middle, high, here, after
