"""What is measured of a run: sums over it, extremes, counts and the Poincaré section, and how they are cut to turns."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.hybrid.modes import KINDS
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.energy import ALONG_SIZE, POWERS
from vibroplat.model.systems import FULL_SIZE
from vibroplat.observe.extremes import EXTREMES, empty_extremes, merge_extremes

N_POWERS = len(POWERS)
N_WORK = ALONG_SIZE + 1

#: Integrals over a part of a run (s, and the units of what is integrated times s).
SUMS = (
    *("time", "x", "xx", "y", "yy", "phi", "phi_phi", "cosine", "sine", "flying", "power_1", "power_2"),
    *("torque_1", "torque_2", "speed_1", "speed_2", "force_x", "force_y", "moment"),
    *("force_x_force_x", "force_y_force_y", "moment_moment"),
    *("stick", "slip_plus", "slip_minus", "friction_loss", "sheared"),
)
TIME, X, XX, Y, YY, PHI, PHI_PHI, COSINE, SINE, FLYING, POWER = range(11)
TORQUE, SPEED, PULL = 12, 14, 16
STICK_TIME, FRICTION_LOSS = 22, 25

#: Into how many sorts phase differences and speeds are put; those of speeds reach to the largest synchronous speed
#: times FASTEST.
BINS, FASTEST = 96, 1.5

#: A point of the Poincaré section: time (s), full state, F_c (N); events of each kind in the measured part so far, and
#: sums over whole turns; with transport s and its rate.
SECTION = np.dtype(
    [
        *(("t", float), ("state", float, FULL_SIZE), ("force", float)),
        *(("counts", float, len(KINDS)), ("sums", float, len(SUMS)), ("along", float, 2)),
    ],
    align=True,
)

#: Points of the Poincaré section that are kept, the last ones, where nothing else is said.
SECTION_ROWS = 1024

#: What is measured of a motion, each with all before it:
#:
#: * points of the section and counts of events: whether a motion repeats, for settling and searches for orbits;
#: * sums: means and RMS values, which tell motions from each other;
#: * extremes: all that :func:`vibroplat.report.summary.measure` gathers, for rows of tables and orbits;
#: * the whole run: pace at extremes, and when phase differences and speeds were met, for the sheet of a run.
SECTION_POINTS, SUMMED, WITH_EXTREMES, WHOLE_RUN = range(4)
#: Longest period, in turns of exciter 1, that is searched for at the end of a motion; so many of the last points of the
#: section have the extremes until then.
MAX_FINAL_PERIOD = 64

#: Extremes before the measured part, in it before its first whole turn, and from there on: in one row, or in one for
#: each block.
EARLY, AHEAD, WHOLE = range(3)

#: What is remembered from step to step.
MARKS = np.dtype(
    [
        ("scope", np.int64),  # what is measured, from SECTION_POINTS to WHOLE_RUN
        ("window", np.float64),  # when the measured part begins (s)
        ("until", np.float64),  # when the last step ended (s)
        ("passed", np.float64),  # whole turns of exciter 1 until now, nan before the first step
        ("turns", np.int64),  # points of the section so far
        ("first", np.float64, 3 + len(KINDS)),  # at its first point: time (s), both angles (rad), measured events
        ("last", np.float64, 3 + len(KINDS)),  # at its last point
        ("row", np.int64),  # of the extremes that steps of the measured part widen
        ("due", np.int64),  # the row from the next whole turn on
        ("way", np.float64),  # in which exciter 1 has passed angle 0 the last time
        # time (s) and both angles with all turns, where the last turn of the faster exciter began, where the present
        # one began, and now; nan before the first step
        ("turn", np.float64, (3, 3)),
        ("exchanged", np.float64),  # energy that motors and dampers have exchanged, all of it positive (J)
        ("counts", np.int64, len(KINDS)),  # events of each kind
        ("measured", np.int64, len(KINDS)),  # those in the measured part
        ("impact_loss", np.float64),  # (J)
        ("impulse_sum", np.float64),  # (N·s)
    ],
    align=True,
)


class Accumulators(NamedTuple):
    """Sums over a run.

    Attributes
    ----------
    work
        Integrals of the powers (J) and of the vertical force from outside and its size (N·s), shape (N_WORK,).
    plain, open_turn, whole
        :data:`SUMS` over the measured part: before the first whole turn of exciter 1, since the last one, over whole
        turns.
    marks
        A record of :data:`MARKS`: counts and what is remembered from step to step.
    extremes
        Records of :data:`vibroplat.observe.extremes.EXTREMES`: rows EARLY and AHEAD, and from WHOLE on one for each
        block.
    closed
        What the last row was at whole turns, the last of them, turn n in row n modulo their number.
    seen
        When each sort of phase difference, and of speed of exciters 1 and 2, was last met (s), and the motors' work
        until then (J), shape (3, BINS, 2).
    section
        Poincaré section: records of :data:`SECTION` at the whole turns of exciter 1 in the measured part, the last
        of them, as ``closed``. Without room for any, nothing is cut to whole turns.
    """

    work: FloatArray
    plain: FloatArray
    open_turn: FloatArray
    whole: FloatArray
    marks: Any
    extremes: npt.NDArray[np.void]
    closed: npt.NDArray[np.void]
    seen: FloatArray
    section: npt.NDArray[np.void]


_MARKS, _SEEN = np.zeros(1, MARKS), np.zeros((3, BINS, 2))
_MARKS["passed"], _MARKS["row"], _MARKS["due"], _MARKS["turn"] = math.nan, AHEAD, WHOLE, math.nan
_SEEN[..., 0] = -math.inf
#: Marks and extremes before the first step, as plain numbers: numpy copies these five times as quickly as records.
_PLAIN_MARKS, _PLAIN_EXTREMES = _MARKS.view(np.uint8), empty_extremes(1).view(np.float64)


def empty_accumulators(
    window: float, points: int = SECTION_ROWS, blocks: int = 1, scope: int = WHOLE_RUN
) -> Accumulators:
    """Make empty sums whose measured part begins at a time (s), with room for points of the Poincaré section.

    What the scope leaves out stays as it is before the first step.
    """
    marks = _PLAIN_MARKS.copy().view(MARKS)[0]
    marks["scope"], marks["window"], marks["until"] = scope, window, window
    plain, open_turn, whole = np.zeros((3, len(SUMS)))
    extremes = np.concatenate([_PLAIN_EXTREMES] * (WHOLE + blocks)).view(EXTREMES)
    closed = extremes[:1]
    if scope >= WITH_EXTREMES:
        closed = np.zeros(min(points, MAX_FINAL_PERIOD), EXTREMES)
    seen = _SEEN.copy() if scope >= WHOLE_RUN else _SEEN
    return Accumulators(
        np.zeros(N_WORK), plain, open_turn, whole, marks, extremes, closed, seen, np.zeros(points, SECTION)
    )


def require(ms: Accumulators, scope: int) -> None:
    """Raise ValueError if less was measured than a scope, so that nothing is taken for 0 that was left out."""
    if ms.marks["scope"] < scope:
        raise ValueError(f"measured up to scope {ms.marks['scope']}, but {scope} is needed")


def block_difference(earlier: Accumulators, later: Accumulators) -> Accumulators:
    """Return the accumulators of one block, from copies at its two ends.

    Sums cover the whole turns of exciter 1 in the block, counts the whole block. Extremes are those of the block's row,
    which starts at the first whole turn in the block.
    """
    marks, whole = later.marks.copy(), later.whole - earlier.whole
    marks["turns"] += 1 - earlier.marks["turns"]  # the last turn before is the first mark
    marks["first"] = earlier.marks["last"]
    extremes = later.extremes[sorted({*range(WHOLE), int(marks["row"])})]
    marks["row"] = len(extremes) - 1
    plain, open_turn = np.zeros((2, len(SUMS)))
    return later._replace(plain=plain, open_turn=open_turn, whole=whole, marks=marks, extremes=extremes)


def measured_extremes(ms: Accumulators) -> Any:
    """Return the extremes of the whole turns of exciter 1, or without any those of the whole measured part."""
    if ms.whole[TIME] <= 0.0:
        return merge_extremes(ms.extremes[AHEAD:])
    return merge_extremes(ms.extremes[WHOLE : ms.marks["row"]], last_closed(ms))


def last_closed(ms: Accumulators) -> npt.NDArray[np.void]:
    """Return what the last row of extremes was at the last whole turn: one record."""
    last = int(ms.marks["turns"] - 1) % ms.closed.size
    return ms.closed[last : last + 1]
