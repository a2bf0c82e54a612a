"""Transition rules: what follows a guard, and how a segment begins.

Pure functions of numbers and arrays, compiled, without Python objects, so that every engine calls the
same ones. They know nothing of integrators; they read states, derivatives and parameters.
"""

from __future__ import annotations

import math

import numpy as np

from vibroplat.kernels.compiled import compiled
from vibroplat.model.impact import closing_time, impacts_left
from vibroplat.model.parameters import FloatArray, Parameters

ATTACH, FLY, LATCH = 0, 1, 2

#: First step over the time until the gap closes again, by its Taylor polynomial.
RETURN_SHARE = 0.05


@compiled
def presses(force: float, force_rate: float, noise: float, p: Parameters) -> bool:
    """Whether contact holds: F_c > 0, or F_c = 0 up to round-off and not about to fall.

    At a root of F_c that does not fall, this tells a touch, after which contact goes on, from a liftoff.
    """
    if abs(force) > noise:
        return force > 0.0
    return force_rate >= -noise * max(p.speed[0], p.speed[1])


@compiled
def accumulates(
    rebound: float, acceleration: float, jerk: float, resolved: bool, tolerance: float, p: Parameters
) -> bool:
    """Whether the impacts to come may be closed by the geometric sum.

    The sum takes the gap's acceleration a as constant over the closing time τ = 2v(1−Rⁿ)/((1−R)|a|), n the number
    of impacts until one sticks; the jerk j changes it by jτ, which shifts t∞ by at most |j|τ²/|a|. Impacts are closed
    once this shift and τ² ω₀ itself are below the tolerance in units of 1/ω₀: ω₀τ ≤ √tol and ω₀ |j| τ² ≤ tol |a|.
    The error in time is then below tol/ω₀ and that of rates and coordinates, by the same neglected
    jerk, below tol in the scales of the scene. An impact whose speed is the sticking speed up to such errors may
    stick or rebound, as it may when it is followed. Impacts too slow to be ``resolved`` are closed where a changes
    by less than a hundredth until t∞. R = 1 does not accumulate.
    """
    if rebound < 0.0 or acceleration >= 0.0 or p.restitution >= 1.0:
        return False
    restitution = p.restitution
    duration = closing_time(rebound, acceleration, restitution, restitution ** impacts_left(rebound, p))
    speed = max(p.speed[0], p.speed[1])
    if not resolved:
        return speed * duration <= 0.1 and abs(jerk) * duration <= 0.01 * -acceleration
    return (
        speed * duration <= math.sqrt(tolerance)
        and speed * abs(jerk) * duration * duration <= tolerance * -acceleration
    )


@compiled
def after_impact(
    rebound: float,
    force: float,
    force_rate: float,
    acceleration: float,
    jerk: float,
    resolved: bool,
    tolerance: float,
    noise: float,
    p: Parameters,
) -> int:
    """Choose what follows an impact.

    Parameters
    ----------
    rebound
        Gap rate after the impact, ≥ 0 (m/s).
    force, force_rate
        F_c and F_c′ if the layer were attached (N, N/s).
    acceleration, jerk
        Second and third derivative of the gap in flight.
    resolved
        Whether impacts as slow as this one stand out from round-off.
    tolerance, noise
        That of the run, and contact forces that are round-off of larger ones (N).
    """
    if rebound == 0.0:
        return ATTACH if presses(force, force_rate, noise, p) else FLY
    return LATCH if accumulates(rebound, acceleration, jerk, resolved, tolerance, p) else FLY


@compiled
def curvature_step(ypp: FloatArray, atol: FloatArray) -> float:
    """First step 2/√‖y″‖ of an order-1 start, ‖·‖ the root mean square weighted by 1/atol (inf if y″ = 0)."""
    total = 0.0
    for i in range(ypp.size):
        total += (ypp[i] / atol[i]) ** 2
    return 2.0 / math.sqrt(math.sqrt(total / ypp.size)) if total > 0.0 else np.inf


@compiled
def excursion(rate: float, acceleration: float, jerk: float, snap: float) -> tuple[float, float]:
    """Duration and height of a flight that begins now, by the gap's leading Taylor terms.

    After a rebound gap ≈ vt + at²/2; where a > 0 drives the layer off but falls, gap ≈ vt + at²/2 + jt³/6;
    at release v = a = 0 and gap ≈ jt³/6 + st⁴/24. Both are inf where these terms do not bring the gap back.
    """
    if rate > 0.0 and acceleration < 0.0:
        return 2.0 * rate / -acceleration, 0.5 * rate * rate / -acceleration
    if rate >= 0.0 and acceleration > 0.0 and jerk < 0.0:
        duration = (1.5 * acceleration + math.sqrt(2.25 * acceleration * acceleration - 6.0 * rate * jerk)) / -jerk
        top = 2.0 / 3.0 * duration
        return duration, top * (rate + top * (0.5 * acceleration + top * jerk / 6.0))
    if rate == 0.0 and jerk > 0.0 and snap < 0.0:
        ratio = jerk / -snap
        return 4.0 * ratio, 1.125 * jerk * ratio * ratio * ratio
    return np.inf, np.inf
