"""Working memory of the statistics for one step."""

from __future__ import annotations

import numpy as np

from vibroplat.config.coordinates import MAX_NAMED_POINTS
from vibroplat.hybrid.state import WIDTH
from vibroplat.model.systems import MOVING_SIZE, UNKNOWNS
from vibroplat.observe.extremes import MAX_NODES
from vibroplat.observe.measures import N_WORK, STICK_TIME, SUMS
from vibroplat.observe.peaks import COLUMNS, TOPS

#: Fields are overwritten at each step, except limits, stiffnesses, dampings, beyond, levers and the number of points.
ROOM = np.dtype(
    [
        ("samples", float, (MAX_NODES + 2, WIDTH)),  # unknowns at beginning, nodes and end
        ("quantities", float, (MAX_NODES + 2, COLUMNS)),  # what has extremes, there
        ("limits", float, (2, COLUMNS)),  # least and largest values so far
        ("square_limits", float, 2),  # those of squares of accelerations, of x and y and of y alone
        ("squares", float, MAX_NODES + 1),  # of mean accelerations
        ("springs", float, (2, 4)),  # stiffnesses and dampings of x, y, φ, then nan
        ("levers", float, 2 * MAX_NAMED_POINTS),  # of points: what φ adds to x and y
        ("means", float, (5, WIDTH)),  # of unknowns, squares, sizes, products with rates, what is not linear
        ("power", float, N_WORK),
        ("sliding", float, len(SUMS) - STICK_TIME),  # what :func:`vibroplat.observe.conveying.find_sliding` fills
        ("phases", float, MAX_NODES),
        ("driven", float, (2, 2)),  # extremes of speeds before a step
        ("full", float, MOVING_SIZE),
        ("y", float, UNKNOWNS),
        ("yp", float, UNKNOWNS),
        ("begins", float, (1, WIDTH)),  # unknowns where a part of a step begins, and ends
        ("at", float, (1, WIDTH)),
        ("limited", np.int64),
        ("widened", np.int64),
        ("beyond", np.int64),  # whether forces are more than slopes times coordinates and rates
        ("named", np.int64),
        *TOPS,
    ],
    align=True,
)
