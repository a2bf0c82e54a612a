"""Where a run is, in records that compiled code reads and changes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.hybrid.steps import Steps
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.systems import FULL_SIZE

# Outcomes of a run.
RUNNING, OK, SOLVER_FAILURE, NON_FINITE, INCONSISTENT, EVENT_STORM, BEYOND_MODEL, OUT_OF_MEMORY = range(8)

# How far the start of a mode at the present state is prepared; integers of numpy, see :mod:`vibroplat.hybrid.modes`.
_NUMBERS: Any = np.arange(3)
STALE, CONSISTENT, DIFFERENTIATED = _NUMBERS

#: A run (times in s).
RUN = np.dtype(
    [
        ("now", np.float64),
        ("end", np.float64),  # of the run, as far as it is asked for
        ("origin", np.float64),  # when the segment began
        ("until", np.float64),  # longest the segment may take
        ("longest", np.float64),  # segment without an event
        ("period", np.float64),  # turn of the larger synchronous speed
        ("speed", np.float64),  # the larger synchronous speed (rad/s)
        ("tolerance", np.float64),
        ("force_noise", np.float64),  # contact forces below this are round-off of larger ones (N)
        ("gap_scale", np.float64),  # (m)
        ("slowest", np.float64),  # impact with a rebound (m/s)
        ("target", np.float64),  # angle of exciter 1 with all its turns at which the run ends, or nan (rad)
        ("mode", np.int64),
        ("outcome", np.int64),
        ("final", np.int64),  # whether reaching ``until`` ends the run
        ("awaited", np.int64),  # kind of event that ends the run, or −1
        ("joined", np.int64),  # how the piece goes on from the one before
        ("zeros", np.int64),  # of the guard at the segment's start that are known
        ("accumulating", np.int64),  # whether impacts are to be latched before the next segment
        ("events", np.int64),  # rows in the event list
        ("restarts", np.int64),
        ("state", np.float64, FULL_SIZE),  # full state
        ("turns", np.float64, 2),  # whole turns taken off its exciter angles (rad)
        ("atol", np.float64, FULL_SIZE),  # absolute tolerances of the segment's unknowns
        ("systems", np.int64, 3),  # number of the system of each mode; −1 for a mode that the scene does not have
        ("tolerances", np.float64, (3, FULL_SIZE)),  # absolute tolerances of each mode's unknowns
        ("fresh", np.int64, 3),  # how far each mode's start is prepared
        ("y", np.float64, (3, FULL_SIZE)),  # start of each mode: unknowns, first and second derivatives
        ("yp", np.float64, (3, FULL_SIZE)),
        ("ypp", np.float64, (3, FULL_SIZE)),
    ],
    align=True,
)

#: An event: when (s), its kind, gap rates (m/s), impulse (N·s), energy lost (J), F_c after it (N), the mode then, and
#: the impacts it stands for.
EVENT = np.dtype(
    [
        ("t", np.float64),
        ("kind", np.int64),
        ("rate_before", np.float64),
        ("rate_after", np.float64),
        ("impulse", np.float64),
        ("loss", np.float64),
        ("force_after", np.float64),
        ("mode_after", np.int64),
        ("impacts", np.int64),
    ],
    align=True,
)


class Automaton(NamedTuple):
    """A run of the hybrid automaton.

    Attributes
    ----------
    p, inelastic
        Parameters of the scene, and the same without restitution.
    run
        A record of :data:`RUN`.
    recent
        Times of the last restarts (s), as many as may lie within a period.
    events
        Events since the list was read, records of :data:`EVENT`.
    steps
        Steps since they were read.
    start, parameters
        Addresses of :func:`vibroplat.hybrid.starts.start_callback` and of ``p``.
    """

    p: Any
    inelastic: Any
    run: Any
    recent: FloatArray
    events: npt.NDArray[np.void]
    steps: Steps
    start: int
    parameters: int
