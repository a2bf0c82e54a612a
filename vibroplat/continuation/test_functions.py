"""Special points by kind, and the functions of an orbit that are zero there (Kuznetsov 2004, chapter 10).

Those of smooth bifurcations change their sign on a branch. The contact force and the gap are known on one side only: an
orbit that has lifted off no longer has the turning point of F_c that fell to zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cache, cached_property
from operator import attrgetter
from typing import Self

import numpy as np
import numpy.typing as npt

from vibroplat.continuation.newton import NewtonResult, bordered, solved
from vibroplat.kernels.compiled import FloatArray

FOLD, DOUBLING, NEIMARK_SACKER, BRANCH_POINT = "fold", "period-doubling", "neimark-sacker", "branch-point"
LIFTOFF, END_OF_STICKING, GRAZING = "liftoff", "end-of-sticking", "grazing"
#: What happens at each kind, for people.
KINDS = {
    FOLD: "two orbits merge and vanish",
    DOUBLING: "an orbit of twice the period branches off",
    NEIMARK_SACKER: "quasi-periodic motion branches off",
    BRANCH_POINT: "another branch crosses, as where symmetry breaks",
    LIFTOFF: "contact is lost for the first time",
    END_OF_STICKING: "the material no longer stays on the platform after it lands",
    GRAZING: "an impact appears or vanishes with zero speed",
}

#: Imaginary part up to which a multiplier is real, but for round-off.
REAL = 1e-9
#: Distance of a multiplier from the unit circle that counts, beside the one that passes it.
OUTSIDE = 1e-3
#: Length of the new tangent over its part along the old one, beyond which it is checked as a step is.
BENT = 1e3


@dataclass(frozen=True)
class Point(NewtonResult):
    """A point of a branch, or of a curve in two keys, with its tangent, its test functions, and the step to here."""

    tangent: FloatArray
    step: float = 0.0

    @classmethod
    def of(cls, orbit: NewtonResult, tangent: FloatArray) -> Self:
        """Give an orbit a tangent."""
        return cls(**{field.name: getattr(orbit, field.name) for field in fields(NewtonResult)}, tangent=tangent)

    @property
    def along_key(self) -> float:
        """Component of the tangent along the key, 0 at a fold of the branch."""
        return float(self.tangent[-1])

    @cached_property
    def branching(self) -> float:
        """Determinant of the Jacobian with the tangent, which changes its sign where branches cross."""
        sign, size = np.linalg.slogdet(bordered(self.jacobian, self.tangent))
        return float(sign * math.exp(min(size, 700.0)))

    @cached_property
    def fold(self) -> float:
        """Product of 1 − multipliers, 0 at a fold over any key."""
        return float(np.prod(1.0 - self.multipliers).real)

    @cached_property
    def doubling(self) -> float:
        """Product of 1 + multipliers, 0 where the period doubles."""
        return float(np.prod(1.0 + self.multipliers).real)

    @cached_property
    def neimark_sacker(self) -> float:
        """Product of 1 − those of two multipliers, 0 also where a real one is the inverse of another."""
        return float(np.prod(1.0 - self._products).real)

    @cached_property
    def _products(self) -> npt.NDArray[np.complex128]:
        one, other = _pairs(self.multipliers.size)
        found: npt.NDArray[np.complex128] = self.multipliers[one] * self.multipliers[other]
        return found

    @property
    def complex_pair(self) -> bool:
        """Whether the two multipliers whose product is next to 1 are complex."""
        if not self._products.size:
            return False
        nearest = _pairs(self.multipliers.size)[:, np.argmin(np.abs(1.0 - self._products))]
        return bool((np.abs(self.multipliers[nearest].imag) > REAL).all())

    @cached_property
    def outside(self) -> tuple[int, int, int]:
        """Count the multipliers above 1, the complex ones outside the unit circle, and those below −1."""
        m = self.multipliers
        paired = np.abs(m.imag) > REAL
        several = ~paired & (m.real > 1.0), paired & (np.abs(m) > 1.0), ~paired & (m.real < -1.0)
        above, around, below = (int(np.count_nonzero(found)) for found in several)
        return above, around, below


@cache
def _pairs(count: int) -> npt.NDArray[np.int64]:
    """All pairs of different numbers below a count, shape (2, pairs)."""
    return np.array(np.triu_indices(count, 1))


#: Functions of points.
Test = Callable[[Point], float]
#: Those that change their sign on a branch between points with the same sequence of events.
SMOOTH: dict[str, Test] = {
    FOLD: attrgetter("along_key"),
    DOUBLING: attrgetter("doubling"),
    NEIMARK_SACKER: attrgetter("neimark_sacker"),
    BRANCH_POINT: attrgetter("branching"),
}
#: Those that are positive on the side where the event is not there yet, and unknown on the other.
ONE_SIDED: dict[str, Test] = {
    LIFTOFF: attrgetter("shot.least_force"),
    END_OF_STICKING: attrgetter("shot.landing_force"),
    GRAZING: attrgetter("shot.least_gap"),
}


#: Those of curves in two keys.
IN_TWO_KEYS: dict[str, Test] = {
    FOLD: attrgetter("fold"),
    DOUBLING: attrgetter("doubling"),
    NEIMARK_SACKER: lambda point: point.neimark_sacker if point.complex_pair else math.nan,
    **ONE_SIDED,
}


@dataclass
class Special:
    """A special point of a kind, at a value of the key.

    Attributes
    ----------
    point
        The orbit there, or next to it.
    direction
        Of the branch there, from neighbour to neighbour: where branches cross, a point has no single tangent.
    across
        Direction of the other branch at a branch point.
    mirrors
        Whether this branch turns back: beyond are the mirror images of the orbits before or, where it is one of doubled
        periods and has come to their end, the same orbits begun half a period later.
    """

    kind: str
    point: Point
    value: float
    direction: FloatArray
    across: FloatArray | None = None
    mirrors: bool = False


def tangent_of(jacobian: FloatArray, near: FloatArray) -> FloatArray:
    """Direction of length 1 in which the residual does not change, on the side of a given one."""
    right = np.zeros(near.size)
    right[-1] = 1.0
    found = solved(bordered(jacobian, near), right, BENT)
    return np.asarray(found / np.linalg.norm(found))


def coming(near: Point, far: Point) -> str | None:
    """Tell which discontinuity is on the way from one orbit to another, if its distance is known; None if it is not."""
    if near.word.count("S") > far.word.count("S") and far.word:
        return END_OF_STICKING
    if len(near.word) >= len(far.word):
        return None
    return LIFTOFF if far.word.count("L") > near.word.count("L") else GRAZING


def others_outside(kind: str, multipliers: npt.NDArray[np.complex128]) -> int:
    """Count the multipliers outside the unit circle but those that pass it at a special point of a kind."""
    critical, rest = {FOLD: 1.0, BRANCH_POINT: 1.0, DOUBLING: -1.0}, multipliers
    if kind in critical and rest.size:
        rest = np.delete(rest, np.argmin(np.abs(rest - critical[kind])))
    elif kind == NEIMARK_SACKER:
        pairs = np.flatnonzero(np.abs(rest.imag) > 0.0)
        rest = np.delete(rest, pairs[np.argsort(np.abs(np.abs(rest[pairs]) - 1.0))[:2]])
    return int((np.abs(rest) > 1.0 + OUTSIDE).sum())
