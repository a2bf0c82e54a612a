"""The engine seam: what the hybrid solver asks of an integrator.

An engine integrates one system from a consistent state until the system's guard falls through zero or
a time is reached. Time starts at 0. What it returns are the steps' ends with states and derivatives,
of which cubic Hermite interpolation makes dense output. Implement :class:`Engine` and everything else
works.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from vibroplat.physics.parameters import FloatArray
from vibroplat.physics.systems import System


class Stop(Enum):
    """Why a stretch ended."""

    GUARD = "guard"
    TIME = "time"
    FAILURE = "failure"
    NON_FINITE = "non-finite"


@dataclass(frozen=True)
class Control:
    """How a stretch is integrated.

    Attributes
    ----------
    atol
        Absolute local tolerances of the unknowns, shape (size,).
    first_step
        The step to try first (s).
    """

    atol: FloatArray
    first_step: float


@dataclass(frozen=True)
class Stretch:
    """Consecutive steps of one system.

    Attributes
    ----------
    t
        Times since the start, shape (m,), m ≥ 1; the first is where the stretch began.
    y, yp
        Unknowns and their derivatives there, shape (m, size).
    stop
        Why it ended; at the guard or the time asked for, the last entry is exactly there.
    detail
        For a failure, what the integrator says.
    """

    t: FloatArray
    y: FloatArray
    yp: FloatArray
    stop: Stop
    detail: str = ""


@dataclass
class Counters:
    """Work done so far."""

    steps: int = 0
    residual_calls: int = 0
    jacobian_calls: int = 0
    restarts: int = 0


class Engine(Protocol):
    """An integrator for the systems of one scene."""

    name: str
    counters: Counters

    def advance(self, system: System, y: FloatArray, yp: FloatArray, control: Control, until: float) -> Stretch:
        """Integrate from a consistent state at t = 0 to the guard's fall through zero, at most to ``until``."""
        ...
