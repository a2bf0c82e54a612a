"""How close a motion is to further events: turning points of contact force and gap."""

from __future__ import annotations

from typing import Any

import numpy as np

from vibroplat.hybrid.modes import ATTACHED, FLIGHT, GUARDS, MODES
from vibroplat.hybrid.state import Automaton, Steps
from vibroplat.kernels.compiled import FloatArray, borrow, compiled
from vibroplat.kernels.polynomial import HALVINGS, slope, values
from vibroplat.model.accelerations import accelerations
from vibroplat.model.parameters import Parameters
from vibroplat.model.systems import ALGEBRAIC, SIZES


@compiled
def update_minima(owned_h: Automaton, least: FloatArray) -> None:
    """Update the smallest minima of F_c (N) and of the gap in flight (m) with those in the closed pieces."""
    h = borrow(owned_h)
    for k in range(h.steps.used.pieces):
        piece = h.steps.pieces[k]
        mode = MODES[piece.system]
        if mode == ATTACHED:
            least[0] = min(least[0], min_at_turn(h.steps, piece, h.p))
        elif mode == FLIGHT:
            least[1] = min(least[1], min_at_turn(h.steps, piece, h.p))


@compiled
def min_at_turn(steps: Steps, piece: Any, p: Parameters) -> float:
    """Smallest minimum of a piece's guard inside of the piece; inf if there is none.

    The contact force is evaluated by the equations at the state there, more accurately than by its own polynomial.
    """
    j, degree, least = GUARDS[piece.system], steps.c.shape[1] - 1, np.inf
    points = max(degree, 4)
    falling = False
    for row in range(piece.first, piece.end):
        c = steps.c[row]
        for i in range(points + 1):
            s = i / points
            rate = slope(c, degree, j, s)
            if falling and rate > 0.0:
                low, high = max(s - 1.0 / points, 0.0), s
                for _ in range(HALVINGS):
                    middle = 0.5 * (low + high)
                    if slope(c, degree, j, middle) < 0.0:
                        low = middle
                    else:
                        high = middle
                least = min(least, guard_at(steps, piece, row, high, p))
            falling = rate < 0.0
    return least


@compiled
def guard_at(steps: Steps, piece: Any, row: int, s: float, p: Parameters) -> float:
    """Evaluate a piece's guard at a fraction of a step."""
    system, size = piece.system, SIZES[piece.system]
    y, yp = np.empty(size), np.empty(size)
    values(steps.c[row], steps.c.shape[1] - 1, s, y)
    if ALGEBRAIC[system]:
        accelerations(system, piece.origin + steps.start[row] + s * steps.length[row], y, yp, p)
    return y[GUARDS[system]]
