"""Taylor series of a motion: the rows of the equations, order by order.

The coefficients of order k of all accelerations and of F_c solve the dynamic rows of
:mod:`vibroplat.model.equations` with the mass matrix of the state, which is inverted once; what the rows hold besides
comes from lower orders. This is the index-reduced DAE itself with F_c as an unknown of every order. The recurrences are
written by :mod:`vibroplat.model.recurrences`; ``python -m vibroplat.model.written`` prints them.

One source serves one motion and several side by side (:mod:`vibroplat.kernels.lanes`). The mode is data, not a
branch, so that motions in contact and in flight may stand beside each other. What is computed for each exciter is
computed for both at once.

Literature: Jorba and Zou, A software package for the numerical integration of ODEs by means of high-order Taylor
methods, 2005; Pryce, Solving high-index DAEs by Taylor series, 1998.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vibroplat.kernels.compiled import fused, fused_inline
from vibroplat.kernels.lanes import lanes_record
from vibroplat.kernels.on_demand import written
from vibroplat.kernels.polynomial import MAX_DEGREE
from vibroplat.model import recurrences
from vibroplat.model.parameters import PARAMETERS, Parameters

#: Column of F_c among the coefficients; before it stand the seven coordinates of the full state.
FORCE_COLUMN = 7

_ROWS = MAX_DEGREE + 2

#: 1/k; of k = 0 nothing is asked.
SHARE = np.concatenate([[0.0], 1.0 / np.arange(1.0, MAX_DEGREE + 2.0)])

#: A motion: coordinates and rates, then 0; the time (s); its mode by three factors, each 0 or 1: whether the layer is
#: attached, whether it flies, whether there are two layers; one over the lower layer's mass, 0 without it (1/kg).
MOTION = {"y": (8, 1), "v": (8, 1), "t": (1,), "attached": (1,), "flying": (1,), "two": (1,), "lower_share": (1,)}

#: Where a series is formed. ``q`` has the coefficients in powers of time (SI units), coordinates and F_c, which has two
#: orders less. Then the factors of products, of both exciters and of the platform.
SERIES = (
    {"q": (_ROWS, 8, 1)}
    | {f"pair_{i}": (_ROWS, 2) for i in range(recurrences.PAIRS)}
    | {f"single_{i}": (_ROWS, 1) for i in range(recurrences.SINGLES)}
)
#: Coefficients of four coordinates side by side.
QUADS = {"quads": ("q", (_ROWS, 2, 4))}

#: The same with transport: the mode has besides whether the material sticks and μ_k σ where it slips, g_x, h, and one
#: over m_w; column 8 is that of s, column 9 that of F_t, with two orders less, and two more make whole vectors.
MOTION_ALONG = MOTION | {"y": (12, 1), "v": (12, 1)}
MOTION_ALONG |= dict.fromkeys(("stuck", "sliding", "slope", "height", "share"), (1,))
SERIES_ALONG, QUADS_ALONG = SERIES | {"q": (_ROWS, 12, 1)}, {"quads": ("q", (_ROWS, 3, 4))}

#: Columns of s and F_t.
ALONG_COLUMN, FRICTION_COLUMN = 8, 9

#: The parameters of a series, the first of :data:`vibroplat.model.parameters.PARAMETERS`, and all of them as rows.
_NAMES = (PARAMETERS.names or ())[: (PARAMETERS.names or ()).index("restitution")]
PARAMETER_ROWS = {name: (*PARAMETERS[name].shape, 1) for name in _NAMES}
WORDS = sum(PARAMETERS[name].itemsize for name in _NAMES) // 8


def room(width: int = 1, *, moving: bool = False) -> Any:
    """Make room for the series of so many motions, with transport or without."""
    return lanes_record(width, SERIES_ALONG if moving else SERIES, QUADS_ALONG if moving else QUADS)


def parameter_rows(width: int = 1) -> Any:
    """Make room for the parameters of so many motions."""
    return lanes_record(width, PARAMETER_ROWS, {"words": (_NAMES[0], (WORDS, 1))})


@fused_inline
def expand(motion: Any, degree: int, room: Any, p: Parameters, moving: Any) -> None:
    """Fill ``room.q`` with the coefficients of motions at their states, coordinates to this degree, F_c to degree − 2.

    All records are those of lanes: a :data:`MOTION`, a :data:`SERIES` and :data:`PARAMETER_ROWS`. The degree is from 2
    to MAX_DEGREE. Where an exciter is at rest, its resistance is that of the sense in which it is about to turn.

    With transport (``moving`` is not None) an order is first solved without friction, which the mode's law then adds.
    """
    if moving is not None:
        expand_along(motion, degree, room, p)
    else:
        expand_plain(motion, degree, room, p)


@fused
@written(recurrences.plain)
def expand_plain(motion: Any, degree: int, room: Any, p: Parameters) -> None:
    """Do as :func:`expand` without transport."""


@fused
@written(recurrences.along)
def expand_along(motion: Any, degree: int, room: Any, p: Parameters) -> None:
    """Do as :func:`expand` with transport."""
