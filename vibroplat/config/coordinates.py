"""A turn, and the numbers of modes, coordinates and points: constants that are compiled into kernels.

They stand apart from all else that a scene is, so that no change of a key compiles the kernels anew.
"""

from __future__ import annotations

import math
from enum import IntEnum

#: A turn (rad).
TURN = 2.0 * math.pi


class Mode(IntEnum):
    """Modes of smooth motion; compiled code uses the numbers."""

    ATTACHED = 0
    FLIGHT = 1
    BARE = 2
    STICK = 3
    SLIP_PLUS = 4
    SLIP_MINUS = 5

    @property
    def label(self) -> str:
        """The mode's name in tables."""
        return self.name.lower().replace("_plus", "+").replace("_minus", "-")


#: Keys of a state in the order of the state vector: coordinates, then their rates.
COORDINATES = ("x_m", "y_m", "phi_rad", "phi1_rad", "phi2_rad", "gap_m", "upper_m")
RATES = (
    "x_rate_m_per_s",
    "y_rate_m_per_s",
    "phi_rate_rad_per_s",
    "phi1_rate_rad_per_s",
    "phi2_rate_rad_per_s",
    "gap_rate_m_per_s",
    "upper_rate_m_per_s",
)

#: Keys of where material is along the deck, with its rate, in scenes with ``transport``.
ALONG = ("along_m", "along_rate_m_per_s")

#: Maximum number of named points of the platform.
MAX_NAMED_POINTS = 8
