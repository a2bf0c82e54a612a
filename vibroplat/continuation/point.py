"""Points of branches, and what tells where special points lie between them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import numpy.typing as npt

from vibroplat.continuation.event_sequence import turned
from vibroplat.continuation.newton import Found, Frame, bordered, leaving
from vibroplat.continuation.shooting import Shot
from vibroplat.kernels.compiled import FloatArray

#: Imaginary part up to which a multiplier is real, but for round-off.
REAL = 1e-9


@dataclass(frozen=True)
class Point:
    """A point of a branch.

    Attributes
    ----------
    frame, found
        The orbit.
    tangent
        Of the branch in the space of unknowns, of length 1.
    multipliers
        But the 1 along the motion.
    value
        Of the key.
    step
        Length of the step to here.
    """

    frame: Frame
    found: Found
    tangent: FloatArray
    multipliers: npt.NDArray[np.complex128]
    value: float
    step: float = 0.0

    @property
    def u(self) -> FloatArray:
        """Unknowns."""
        return self.found.u

    @property
    def shot(self) -> Shot:
        """Over the period."""
        return self.found.shot

    @cached_property
    def word(self) -> str:
        """Sequence of events, wherever the period begins."""
        return turned(self.shot.word)

    @property
    def unstable(self) -> int:
        """Number of multipliers outside the unit circle."""
        return leaving(self.multipliers)

    @cached_property
    def outside(self) -> tuple[int, int, int]:
        """Count the multipliers above 1, the complex ones outside the unit circle, and those below −1."""
        m = self.multipliers
        paired = np.abs(m.imag) > REAL
        several = ~paired & (m.real > 1.0), paired & (np.abs(m) > 1.0), ~paired & (m.real < -1.0)
        above, around, below = (int(np.count_nonzero(found)) for found in several)
        return above, around, below

    @cached_property
    def products(self) -> npt.NDArray[np.complex128]:
        """Products of each pair of multipliers, in the order of :func:`pairs`."""
        one, other = pairs(self.multipliers.size)
        found: npt.NDArray[np.complex128] = self.multipliers[one] * self.multipliers[other]
        return found

    @property
    def fold(self) -> float:
        """Component of the tangent along the key, 0 at a fold."""
        return float(self.tangent[-1])

    @cached_property
    def branching(self) -> float:
        """Determinant of the Jacobian with the tangent, which changes its sign where branches cross."""
        sign, size = np.linalg.slogdet(bordered(self.found.jacobian, self.tangent))
        return float(sign * math.exp(min(size, 700.0)))

    @cached_property
    def doubling(self) -> float:
        """Product of 1 + multipliers, 0 where the period doubles."""
        return float(np.prod(1.0 + self.multipliers).real)

    @cached_property
    def torus(self) -> float:
        """Product of 1 − :attr:`products`, 0 also where a real multiplier is the inverse of another."""
        return float(np.prod(1.0 - self.products).real)


@cache
def pairs(count: int) -> npt.NDArray[np.int64]:
    """All pairs of different numbers below a count, shape (2, pairs)."""
    return np.array(np.triu_indices(count, 1))
