"""Transition rules: what a guard's fall and an impact mean, as pure functions of numbers."""

from __future__ import annotations

import math
from typing import Any

from vibroplat.kernels.compiled import compiled
from vibroplat.model.impact import chatter_duration, remaining_impacts

#: What follows an impact.
ATTACH, FLY, ACCUMULATE = range(3)


@compiled
def contact_holds(force: float, force_rate: float, noise: float, speed: float) -> bool:
    """Whether contact holds: F_c > 0 (N), or F_c = 0 up to its round-off ``noise`` and not about to fall.

    At a root of F_c that does not fall, this tells a touch, after which contact goes on, from a liftoff.
    ``speed`` is the synchronous one (rad/s).
    """
    if abs(force) > noise:
        return force > 0.0
    return force_rate >= -noise * speed


@compiled
def is_chatter(
    rebound: float, acceleration: float, jerk: float, resolved: bool, tolerance: float, speed: float, p: Any
) -> bool:
    """Whether the impacts to come are chatter that may be summed up as a geometric series.

    The sum takes the gap's acceleration a as constant over their duration τ = 2v(1−Rⁿ)/((1−R)|a|), n the number
    of impacts until one sticks; the jerk j changes it by jτ, which shifts t∞ by at most |j|τ²/|a|. They are summed
    up once this shift and τ² ω₀ itself are below the tolerance in units of 1/ω₀: ω₀τ ≤ √tol and ω₀ |j| τ² ≤ tol |a|.
    The error in time is then below tol/ω₀ and that of rates and coordinates, by the same neglected
    jerk, below tol in scaled units. An impact whose speed is the sticking speed up to such errors may
    stick or rebound, as it may when it is followed. Impacts too slow to be ``resolved`` are summed up where a changes
    by less than a hundredth until t∞. R = 1 does not accumulate.
    """
    if rebound < 0.0 or acceleration >= 0.0 or p.restitution >= 1.0:
        return False
    restitution = p.restitution
    duration = chatter_duration(rebound, acceleration, restitution, restitution ** remaining_impacts(rebound, p))
    if not resolved:
        return speed * duration <= 0.1 and abs(jerk) * duration <= 0.01 * -acceleration
    return (
        speed * duration <= math.sqrt(tolerance)
        and speed * abs(jerk) * duration * duration <= tolerance * -acceleration
    )


@compiled
def after_impact(
    rebound: float,
    acceleration: float,
    jerk: float,
    resolved: bool,
    pressed: bool,
    tolerance: float,
    speed: float,
    p: Any,
) -> int:
    """Choose what follows an impact.

    Parameters
    ----------
    rebound, acceleration, jerk
        Derivatives of the gap in flight after the impact; the first is ≥ 0 (m/s).
    resolved, pressed
        Whether impacts as slow as this one stand out from round-off, and contact would hold if the layer were attached.
    tolerance, speed
        Tolerance of the run, and synchronous speed (rad/s).
    """
    if rebound == 0.0:
        return ATTACH if pressed else FLY
    return ACCUMULATE if is_chatter(rebound, acceleration, jerk, resolved, tolerance, speed, p) else FLY
