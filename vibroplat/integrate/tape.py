"""The tape: where an engine writes the ends of its steps, piece by piece.

A tape has a fixed length, so a run needs no memory that grows with it: whoever keeps a trajectory
copies the pieces before the tape is rewound, whoever wants statistics alone does not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.integrate.interpolation import dip_below_zero, interpolate
from vibroplat.kernels.compiled import compiled, copy
from vibroplat.model.parameters import FloatArray
from vibroplat.model.systems import FULL_SIZE

#: Rows that one segment may need after its last step: the two ends of a closed accumulation, and one spare.
MARGIN = 3

# Places in ``Tape.used``.
ROWS, FIRST, PIECES = range(3)

# Columns of ``Tape.pieces``: rows [FIRST_ROW, LAST_ROW], where they belong, when the times' origin and
# the piece's end are, turns taken off both angles, whether it goes on from the piece before.
FIRST_ROW, LAST_ROW, SYSTEM, ORIGIN, END, TURNS_1, TURNS_2, JOINED = range(8)


class Tape(NamedTuple):
    """Ends of steps and the pieces they make.

    Attributes
    ----------
    t
        Times since the origin of the piece (s), shape (rows,).
    y, yp
        Unknowns and derivatives there, shape (rows, 14); a system of fewer unknowns uses the first columns.
    pieces
        A row for each piece.
    used
        Rows and pieces written, and where the open piece begins.
    """

    t: FloatArray
    y: FloatArray
    yp: FloatArray
    pieces: FloatArray
    used: npt.NDArray[np.int64]


def blank_tape(rows: int) -> Tape:
    """Make an empty tape."""
    size = (rows, FULL_SIZE)
    return Tape(
        np.empty(rows), np.zeros(size), np.zeros(size), np.empty((rows, JOINED + 1)), np.zeros(3, dtype=np.int64)
    )


@compiled
def write(tape: Tape, now: float, y: FloatArray, yp: FloatArray) -> None:
    """Append the end of a step."""
    append(tape.t, tape.y, tape.yp, tape.used, now, y, yp)


@compiled
def append(
    t: FloatArray,
    rows: FloatArray,
    slopes: FloatArray,
    used: npt.NDArray[np.int64],
    now: float,
    y: FloatArray,
    yp: FloatArray,
) -> None:
    """Append the end of a step to the arrays of a tape."""
    row = used[ROWS]
    t[row] = now
    for i in range(y.size):
        rows[row, i] = y[i]
        slopes[row, i] = yp[i]
    used[ROWS] = row + 1


@compiled
def rewind(tape: Tape) -> None:
    """Make room: forget the closed pieces; where one is open, its last end becomes the first row."""
    rows, first = tape.used[ROWS], tape.used[FIRST]
    for i in range(first, rows):
        tape.t[i - first] = tape.t[i]
        copy(tape.y[i], tape.y[i - first])
        copy(tape.yp[i], tape.yp[i - first])
    tape.used[ROWS] = rows - first
    tape.used[FIRST] = 0
    tape.used[PIECES] = 0


@compiled
def cut_at_fall(tape: Tape, guard: int) -> bool:
    """End the tape where a guard falls through zero within the last step, unseen by signs at its ends."""
    k = tape.used[ROWS] - 2
    step = tape.t[k + 1] - tape.t[k]
    y0, y1, yp0, yp1 = tape.y[k], tape.y[k + 1], tape.yp[k], tape.yp[k + 1]
    if not (y1[guard] < 0.0 or yp0[guard] < 0.0 < yp1[guard]):
        return False
    share = dip_below_zero(step, y0[guard], y1[guard], yp0[guard], yp1[guard])
    if share < 0.0:
        return False
    y, yp = np.empty(FULL_SIZE), np.empty(FULL_SIZE)
    interpolate(share, step, y0, y1, yp0, yp1, y, yp)
    tape.t[k + 1] = tape.t[k] + share * step
    copy(y, tape.y[k + 1])
    copy(yp, tape.yp[k + 1])
    return True


@compiled
def calm(tape: Tape, force: int, begins: bool, ends: bool) -> None:
    """Limit the slopes of F_c in the open piece, so that its interpolant does not leave what its values say.

    F_c is not integrated: a stiff layer or motor turns errors of rates, which the tolerance allows, into larger
    ones of F_c and much larger ones of its slope. A slope that belongs to the values is at most about the
    larger of the secants beside it. What is 0 or more at both ends of a step stays so within it where slopes
    are at least −3 F_c/h at its beginning and at most 3 F_c/h at its end (Schmidt and Hess 1988).

    ``begins`` and ``ends`` say whether contact does so with the piece; where a piece was only cut, the secant on
    the other side is not known.
    """
    t, y, yp = tape.t, tape.y, tape.yp
    first, last = tape.used[FIRST], tape.used[ROWS] - 1
    for k in range(first, last + 1):
        before = t[k] - t[k - 1] if k > first else 0.0
        after = t[k + 1] - t[k] if k < last else 0.0
        steepest = 0.0
        if before > 0.0:
            steepest = abs(y[k, force] - y[k - 1, force]) / before
        if after > 0.0:
            steepest = max(steepest, abs(y[k + 1, force] - y[k, force]) / after)
        if (k == first and not begins) or (k == last and not ends):
            steepest = np.inf
        slope = min(max(yp[k, force], -3.0 * steepest), 3.0 * steepest)
        value = max(y[k, force], 0.0)
        if after > 0.0:
            slope = max(slope, -3.0 * value / after)
        if before > 0.0:
            slope = min(slope, 3.0 * value / before)
        yp[k, force] = slope


@compiled
def transcribe(tape: Tape, t: FloatArray, y: FloatArray, yp: FloatArray, guard: int, at_guard: bool) -> bool:
    """Write steps up to where a guard first falls through zero.

    Parameters
    ----------
    guard
        Its index among the unknowns; −1 for none.
    at_guard
        Whether the integrator has found a fall itself, at the last step's end.

    Returns
    -------
    bool
        Whether the tape ends at the guard.
    """
    for k in range(t.size):
        write(tape, t[k], y[k], yp[k])
        if guard >= 0 and k > 0 and not (at_guard and k == t.size - 1) and cut_at_fall(tape, guard):
            return True
    return at_guard
