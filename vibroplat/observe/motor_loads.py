"""Largest torques and powers of the motors over a run, found step by step from their speeds."""

from __future__ import annotations

from typing import Any

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, inlined
from vibroplat.kernels.polynomial import crossing
from vibroplat.model.motor import motor_torque, slip_speeds
from vibroplat.model.parameters import Parameters
from vibroplat.observe.extremes import DRIVEN_1, POWER_1, SPEED_1, TORQUE_1, Span, cover, margin, remember


@inlined
def drive_at(peaks: Any, i: int, speed: float, s: float, span: Span, p: Parameters) -> None:
    """Let the extremes of torque, in the direction of the drive, and power cover those of motor i at a speed."""
    torque = motor_torque(i, span.begin + s * span.length, speed, p)
    remember(peaks, TORQUE_1 + i, p.direction[i] * torque, s, span)
    remember(peaks, POWER_1 + i, torque * speed, s, span)


@inlined
def cover_motor(
    peaks: Any,
    i: int,
    samples: FloatArray,
    nodes: int,
    n: int,
    span: Span,
    p: Parameters,
) -> None:
    """Let the extremes of speed, torque and power of motor i cover a step.

    At a constant supply torque and power depend on the speed alone: they have extremes at new extremes of the speed
    since the supply has changed, at the critical slip, and for the power where u² + 2uΔ²/ω₀ = Δ², with slip speed u and
    critical slip speed Δ.
    """
    k, j = DRIVEN_1 + i, n + 3 + i
    least, largest = peaks.least[k], peaks.largest[k]
    last = span.end[j]
    cover(peaks, k, span.c, span.degree, samples, nodes, j, (span.begun[j], last), span, margin(peaks, k), False)
    for speed, at, new in (
        (peaks.least[k], peaks.at_least[k], peaks.least[k] < least),
        (peaks.largest[k], peaks.at_largest[k], peaks.largest[k] > largest),
    ):
        if new:
            s = (at - span.begin) / span.length
            remember(peaks, SPEED_1 + i, speed, s, span)
            drive_at(peaks, i, speed, s, span, p)
    if peaks.least[k] < least or peaks.largest[k] > largest:
        critical = slip_speeds(i, span.begin, last, p)[1]
        synchronous = slip_speeds(i, span.begin + span.length, last, p)[0] + p.direction[i] * last
        pass_levels(peaks, i, j, synchronous, critical, span, p)


@compiled
def pass_levels(
    peaks: Any,
    i: int,
    j: int,
    synchronous: float,
    critical: float,
    span: Span,
    p: Parameters,
) -> None:
    """Let the extremes of motor i cover the slips of largest torque and power that a step passes."""
    ratio = critical / synchronous if synchronous != 0.0 else 0.0
    root = np.sqrt(1.0 + ratio * ratio)
    for slip in (critical, -critical, critical * (root - ratio), -critical * (root + ratio)):
        level = p.direction[i] * (synchronous - slip)
        if (span.begun[j] - level) * (span.end[j] - level) < 0.0:
            s = crossing(span.c, span.degree, j, level)
            if span.first <= s <= span.last:
                drive_at(peaks, i, level, s, span, p)
