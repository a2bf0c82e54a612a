"""Kloss's formula, for numbers, arrays, and the expressions that kernels are written from."""

from __future__ import annotations

from typing import Any


def kloss(slip: Any, critical: Any, torque: Any) -> Any:
    """Return the torque of a motor 2 M_c Δ u/(Δ² + u²) (N·m), with slip speed u, critical slip speed Δ and torque M_c.

    u = ω₀ − σφ̇ says how much slower than its synchronous speed the motor turns (rad/s). This is the formula of Kloss
    (1901) with the slip s = u/ω₀ and s_c = Δ/ω₀, multiplied out so that a supply of 0 Hz divides nothing.
    """
    return 2.0 * torque * (critical * slip) / (critical * critical + slip * slip)
