"""Largest torques and powers of the motors over a run, found step by step from their speeds."""

from __future__ import annotations

from typing import Any

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, inlined
from vibroplat.kernels.polynomial import crossing, value
from vibroplat.model.motor import motor_torque, slip_speeds
from vibroplat.model.parameters import Parameters
from vibroplat.observe.extremes import (
    DRIVEN_1,
    POWER_1,
    SPEED_1,
    TORQUE_1,
    Span,
    cover,
    margin,
    place_of,
    remember,
    sample,
    vertex,
)


@inlined
def drive(i: int, speed: float, s: float, span: Span, p: Parameters) -> tuple[float, float]:
    """Torque of motor i in the direction of the drive, and its power, at a speed at a fraction of a step."""
    torque = motor_torque(i, span.begin + s * span.length, speed, p)
    return p.direction[i] * torque, torque * speed


@inlined
def drive_at(peaks: Any, i: int, speed: float, s: float, span: Span, p: Parameters) -> None:
    """Let the extremes of torque and power cover those of motor i at a speed."""
    torque, power = drive(i, speed, s, span, p)
    remember(peaks, TORQUE_1 + i, torque, s, span)
    remember(peaks, POWER_1 + i, power, s, span)


@inlined
def cover_motor(peaks: Any, i: int, samples: FloatArray, nodes: int, n: int, span: Span, p: Parameters) -> None:
    """Let the extremes of speed, torque and power of motor i cover a step.

    At a constant supply torque and power depend on the speed alone: they have extremes at new extremes of the speed
    since the supply has changed, at the critical slip, and for the power where u² + 2uΔ²/ω₀ = Δ², with slip speed u and
    critical slip speed Δ. While the supply changes they are looked for among samples.
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
    if p.speed_ramp[i] != 0.0 or p.slip_ramp[i] != 0.0:
        follow_ramp(peaks, i, j, samples, nodes, span, p)


@compiled
def pass_levels(peaks: Any, i: int, j: int, synchronous: float, critical: float, span: Span, p: Parameters) -> None:
    """Let the extremes of motor i cover the slips of largest torque and power that a step passes."""
    ratio = critical / synchronous if synchronous != 0.0 else 0.0
    root = np.sqrt(1.0 + ratio * ratio)
    for slip in (critical, -critical, critical * (root - ratio), -critical * (root + ratio)):
        level = p.direction[i] * (synchronous - slip)
        if (span.begun[j] - level) * (span.end[j] - level) < 0.0:
            s = crossing(span.c, span.degree, j, level)
            if span.first <= s <= span.last:
                drive_at(peaks, i, level, s, span, p)


@compiled
def follow_ramp(peaks: Any, i: int, j: int, samples: FloatArray, nodes: int, span: Span, p: Parameters) -> None:
    """Let the extremes of motor i cover torque and power at samples of its speed, in column j, and between them.

    Between three samples of which the middle one is largest or least, the extreme is at the vertex of a parabola.
    """
    ends = span.begun[j], span.end[j]
    low, middle, before, here = 0.0, 0.0, (0.0, 0.0), (0.0, 0.0)
    for k in range(nodes + 2):
        high, speed = place_of(k, nodes, span), sample(samples, nodes, ends, k, j)
        after = drive(i, speed, high, span, p)
        drive_at(peaks, i, speed, high, span, p)
        for q in range(2):
            if k > 1 and (here[q] - before[q]) * (after[q] - here[q]) < 0.0:
                s, width = vertex((low, middle, high), (before[q], here[q], after[q])), high - low
                for _ in range(2):  # through closer points
                    width *= 0.05
                    places = max(s - width, span.first), s, min(s + width, span.last)
                    of = [drive(i, value(span.c, span.degree, j, place), place, span, p)[q] for place in places]
                    s = min(max(vertex(places, (of[0], of[1], of[2])), places[0]), places[2])
                drive_at(peaks, i, value(span.c, span.degree, j, s), s, span, p)
        low, middle, before, here = middle, high, here, after
