"""How close a motion comes to other events than it has: turning points of contact force and gap."""

from __future__ import annotations

import math

import numpy as np

from vibroplat.hybrid.modes import ATTACHED, FLIGHT, GUARDS, MODES
from vibroplat.hybrid.state import Automaton
from vibroplat.hybrid.steps import Steps
from vibroplat.kernels.compiled import FloatArray, compiled
from vibroplat.kernels.foreign import borrow
from vibroplat.kernels.polynomial import slope, turning_value, value


class Closeness:
    """Observes a motion: its pieces, and the least values at which F_c and the gap turn from falling to rising.

    Attributes
    ----------
    pieces
        System, beginning and end (s) of each piece.
    """

    def __init__(self) -> None:
        self.pieces: list[tuple[int, float, float]] = []
        self._least = np.full(2, math.inf)

    def read(self, h: Automaton) -> None:
        """Look at the closed pieces."""
        steps = h.steps
        for piece in steps.pieces[: steps.used["pieces"]]:
            begin = float(piece["origin"] + steps.start[piece["first"]])
            self.pieces.append((int(piece["system"]), begin, float(piece["until"])))
        look(h, self._least)

    @property
    def least_force(self) -> float:
        """Least F_c at a turning point (N); inf without one."""
        return float(self._least[0])

    @property
    def least_gap(self) -> float:
        """Least gap at a turning point in flight (m); inf without one."""
        return float(self._least[1])


@compiled
def look(owned_h: Automaton, least: FloatArray) -> None:
    """Lower the least values by those of the closed pieces."""
    h = borrow(owned_h)
    for k in range(h.steps.used.pieces):
        piece = h.steps.pieces[k]
        mode = MODES[piece.system]
        if mode == ATTACHED:
            least[0] = min(least[0], least_turn(h.steps, piece.first, piece.end, GUARDS[piece.system]))
        elif mode == FLIGHT:
            least[1] = min(least[1], least_turn(h.steps, piece.first, piece.end, GUARDS[piece.system]))


@compiled
def least_turn(steps: Steps, first: int, end: int, j: int) -> float:
    """Least value of unknown j where it turns from falling to rising in some steps; inf where it does not."""
    least, degree = np.inf, steps.c.shape[1] - 1
    points = max(degree, 4)
    falling = False
    for row in range(first, end):
        c = steps.c[row]
        for i in range(points + 1):
            s = i / points
            rate = slope(c, degree, j, s)
            if falling and rate > 0.0:
                found = value(c, degree, j, s)
                if i > 0:
                    found = turning_value(c, degree, j, s - 0.5 / points, s - 1.0 / points, s, found)
                least = min(least, found)
            falling = rate < 0.0
    return least
