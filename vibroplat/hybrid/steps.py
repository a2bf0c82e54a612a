"""Steps: what an integrator hands over, each with a polynomial of its own.

A step holds every unknown as a polynomial in the fraction of the step, so its readers need not know the method. Steps
are written to arrays of fixed length, which are overwritten as the run goes on: memory does not grow with the run. An
observer that keeps a trajectory copies them. A *piece* is a sequence of steps in one mode, without an event between
them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.kernels.compiled import FloatArray, compiled, copy
from vibroplat.kernels.lanes import in_lines
from vibroplat.kernels.polynomial import stretch
from vibroplat.model.systems import FULL_SIZE

#: Steps that one segment may need after its last one: that of a latch, and one to spare.
MARGIN = 2

#: Columns of polynomials: as many as the largest system has unknowns, made up to whole vectors of the processor.
WIDTH = 16

#: Least degree of the polynomials, that of a latch.
CUBIC = 3

# How a piece goes on from the one before.
AFTER_EVENT, RESTARTED, CUT = range(3)

#: A piece: its steps [first, end) in one system, the origin of their times and when the piece ends (s), the whole
#: turns taken off both exciter angles (rad), how it goes on from the piece before, and the events in the list then.
PIECE = np.dtype(
    [
        ("first", np.int64),
        ("end", np.int64),
        ("system", np.int64),
        ("origin", np.float64),
        ("until", np.float64),
        ("turns", np.float64, 2),
        ("joined", np.int64),
        ("events", np.int64),
    ],
    align=True,
)

#: Steps and closed pieces so far, and where the open piece begins.
USED = np.dtype([("steps", np.int64), ("first", np.int64), ("pieces", np.int64)], align=True)


class Steps(NamedTuple):
    """Steps and the pieces they make.

    Attributes
    ----------
    start, length
        Beginning of each step since the origin of its piece, and its duration (s), shape (rows,).
    c
        Coefficients of each step's polynomial in s = (t − start)/length, shape (rows, degree + 1, WIDTH); a system
        uses the first columns, and what is in the others means nothing.
    ends
        Unknowns at the ends of the steps, shape (rows, 14).
    pieces
        Closed pieces, records of :data:`PIECE`.
    used
        A record of :data:`USED`.
    """

    start: FloatArray
    length: FloatArray
    c: FloatArray
    ends: FloatArray
    pieces: npt.NDArray[np.void]
    used: Any

    @property
    def degree(self) -> int:
        """Degree of the polynomials."""
        return self.c.shape[1] - 1


def no_steps(rows: int, degree: int) -> Steps:
    """Make room for steps with polynomials of a degree."""
    return Steps(
        np.zeros(rows),
        np.zeros(rows),
        in_lines((rows, degree + 1, WIDTH)),
        np.zeros((rows, FULL_SIZE)),
        np.zeros(rows, PIECE),
        np.zeros(1, USED)[0],
    )


@compiled
def rewind(steps: Steps) -> None:
    """Forget the steps; an open piece goes on with the next ones."""
    steps.used.steps = steps.used.first = steps.used.pieces = 0


@compiled
def end_at(steps: Steps, row: int, share: float, end: FloatArray) -> None:
    """Let a step end at fraction ``share`` of it, or beyond, with the unknowns ``end`` there."""
    c, degree = steps.c[row], steps.c.shape[1] - 1
    stretch(c, degree, share)
    steps.length[row] *= share
    for j in range(end.size):
        reached = c[0, j]
        for k in range(1, degree + 1):
            reached += c[k, j]
        c[2, j] += end[j] - reached
    copy(end, steps.ends[row])


@compiled
def fill_cubic(c: FloatArray, step: float, y0: FloatArray, y1: FloatArray, yp0: FloatArray, yp1: FloatArray) -> None:
    """Fill the coefficients of the cubic through values and rates at both ends of a step; higher ones are 0."""
    for j in range(y0.size):
        rise, rate_0, rate_1 = y1[j] - y0[j], step * yp0[j], step * yp1[j]
        c[0, j], c[1, j] = y0[j], rate_0
        c[2, j] = 3.0 * rise - 2.0 * rate_0 - rate_1
        c[3, j] = rate_0 + rate_1 - 2.0 * rise
    for k in range(4, c.shape[0]):
        for j in range(y0.size):
            c[k, j] = 0.0
