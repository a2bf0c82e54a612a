"""Smooth stretches of a run with dense output."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vibroplat.hybrid.state import Automaton
from vibroplat.kernels.compiled import FloatArray, compiled, copy
from vibroplat.kernels.polynomial import values
from vibroplat.model.systems import SYSTEMS, System

#: Memory that an array takes besides its numbers (bytes).
OVERHEAD = 150


@dataclass(frozen=True)
class Segment:
    """A smooth stretch of one mode.

    Attributes
    ----------
    start, end
        When it began and ended (s).
    t, length
        Beginnings of its steps since ``start``, and their durations (s), shape (m,).
    c
        Coefficients of their polynomials in the fraction of the step, shape (m, degree + 1, size).
    ends
        Unknowns at the ends of the steps, shape (m, size).
    turns
        Angles taken off φ₁ and φ₂ before the segment (rad), shape (2,).
    joined
        Whether it goes on from the segment before without an event between them.
    """

    system: System
    start: float
    end: float
    t: FloatArray
    length: FloatArray
    c: FloatArray
    ends: FloatArray
    turns: FloatArray
    joined: bool

    def __call__(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Full states (len(times), 14) and contact forces (len(times),) at absolute ascending times."""
        elapsed = np.where(times >= self.end, np.inf, times - self.start)  # its end is that of its last step, exactly
        unknowns = sample(self.t, self.length, self.c, self.ends, elapsed)
        states = self.system.full(unknowns)
        states[:, 3:5] += self.turns
        return states, unknowns[:, -1] if self.system.algebraic else np.zeros(len(unknowns))

    @property
    def nbytes(self) -> int:
        """Memory that it takes (bytes)."""
        return sum(array.nbytes + OVERHEAD for array in (self.t, self.length, self.c, self.ends, self.turns))


@compiled
def sample(start: FloatArray, length: FloatArray, c: FloatArray, ends: FloatArray, times: FloatArray) -> FloatArray:
    """Evaluate steps at ascending times; returns shape (len(times), unknowns)."""
    out = np.empty((times.size, ends.shape[1]))
    row, last = 0, start.size - 1
    for i in range(times.size):
        while row < last and times[i] > start[row] + length[row]:
            row += 1
        if times[i] >= start[row] + length[row]:
            copy(ends[row], out[i])
        else:
            s = max(times[i] - start[row], 0.0) / length[row]
            values(c[row], c.shape[1] - 1, s, out[i])
    return out


def closed(h: Automaton) -> Iterator[Segment]:
    """Copy the closed pieces of a motion."""
    steps = h.steps
    for piece in steps.pieces[: steps.used["pieces"]]:
        system = SYSTEMS[piece["system"]]
        rows = slice(int(piece["first"]), int(piece["end"]))
        offset = steps.start[rows.start]
        yield Segment(
            system=system,
            start=float(piece["origin"] + offset),
            end=float(piece["until"]),
            t=steps.start[rows] - offset,
            length=steps.length[rows].copy(),
            c=steps.c[rows, :, : system.size].copy(),
            ends=steps.ends[rows, : system.size].copy(),
            turns=piece["turns"].copy(),
            joined=bool(piece["joined"]),
        )
