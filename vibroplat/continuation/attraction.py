"""The attraction of a stable periodic orbit: states from which convergence to it has been tested.

M is the derivative of the return map at the orbit, in scaled units and without the angle of exciter 1. W holds the left
eigenvectors of M as rows of length 1. Let ξ be the offset of a state from the orbit: in the linearization, the distance
‖W ξ‖ shrinks by the largest multiplier in every period. Trajectories from shells around the orbit show how far this
holds. If decay is slow, the ellipsoids are thin, because fast modes excite slow ones. A motion in which only slow modes
remain is therefore tested along its own trajectory.
"""

from __future__ import annotations

import math
from contextlib import suppress
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from vibroplat.config.coordinates import TURN
from vibroplat.continuation.newton import NewtonResult
from vibroplat.continuation.shooting import Shooter
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.systems import FULL_SIZE
from vibroplat.shooting.shots import distance

#: Condition number of the eigenvectors, by Frobenius' norm, above which they are too nearly parallel to measure
#: distances.
MAX_CONDITION = 1e8
#: Shells on which an ellipsoid is tested, each SHELL_RATIO times as large as the one before, and directions on each
#: besides both along the slowest decay.
SHELL_COUNT, SHELL_RATIO, DIRECTIONS = 3, 0.25, 4
#: Minimum contraction per period, as a fraction of that predicted by the linearization.
MIN_DECAY_RATIO = 0.5
#: The same on a motion's own way; the periods in each of which it must be seen from where the motion is; the turns, and
#: the least number of periods, over which it must be seen from places on the way; and the number of all places, each
#: SHELL_RATIO times as far from the orbit as the one before. The way is curved and the places lie on a straight line:
#: quick oscillations begin there. With a multiplier of 0.99987 one period in four may not show the decay; 16 turns do.
#: Fewer suffice where a distance falls by VISIBLE_DECAY in them: of 862 tests along motions of Figs. 3 and 6 and of a
#: map 147 fail, all of them in the first periods, from the present state.
MIN_DECAY_RATIO_ON_WAY, FIRST_PERIODS, TURNS, PERIODS, MAX_PLACES = 0.25, 16, 16, 4, 4
VISIBLE_DECAY = 0.1
#: Most halvings of an ellipsoid that is to hold no state of another basin, and directions in which it is tested. They
#: are even in the ellipsoid: with directions even in the scales of the state, whose ellipsoids had conditions of 53 to
#: 273, a saddle lay inside at half the radius, and 101 of 395 starts were assigned wrongly.
MAX_HALVINGS, TEST_DIRECTIONS = 14, 48
#: Periods after which motion from there must be nearer: at first, where the slowest decay curves, it may go away.
LATE_PERIODS = 16
#: Smallest distance that says anything, over the tolerance of the integrator.
NOISE_TOLERANCE_RATIO = 1e4
#: Places of the exciters' angles in the full state.
_ANGLES = slice(3, 5)


class AttractionEllipsoid:
    """The surroundings of an orbit where it crosses the section.

    Parameters
    ----------
    found
        The orbit as Newton's method leaves it.
    turns
        Of exciter 1 in a period.

    Attributes
    ----------
    state, system
        Of the orbit on the section: full state, shape (14,), and number of its system.
    rate
        What a period multiplies distances by, as far as the derivative is all that matters.
    """

    def __init__(self, result: NewtonResult, turns: int) -> None:
        chart, section_map = result.chart, result.chart.section_map(result.shot)
        free = np.arange(chart.places.size) != chart.phase
        self.state, self.system, self.turns = chart.unpack(result.u)[0], chart.system, turns
        self._places, self._scales, self._turn = chart.places[free], chart.scales[free], TURN / chart.speed
        values, right = self._eigen = np.linalg.eig(section_map)
        self._map = section_map
        largest = int(np.abs(values).argmax())
        self.spectral_radius = float(np.abs(values[largest]))
        self._slowest: FloatArray = right[:, largest].real

    @cached_property
    def _root(self) -> FloatArray:
        """W for offsets in scaled units, shape (n, n)."""
        return contracting_norm(self._map, *self._eigen)

    @cached_property
    def norm(self) -> FloatArray:
        """W for full states' differences, angles less than half a turn apart, shape (n, 14)."""
        norm = np.zeros((self._scales.size, FULL_SIZE))
        norm[:, self._places] = self._root / self._scales
        return norm

    def distance(self, state: FloatArray, system: int) -> float:
        """How far a full state on the section is away, ‖W ξ‖; inf in another system."""
        return distance(state, self.state, self.norm) if system == self.system else math.inf

    @cached_property
    def form(self) -> FloatArray:
        """The quadratic form of full states' differences, angles less than half a turn apart, that is ‖W ξ‖²."""
        return self.norm.T @ self.norm

    def radius(self, shooter: Shooter) -> float:
        """Return the radius of the attraction ellipsoid, within which convergence was tested; 0 if none is known."""
        sizes = (0.5**halvings for halvings in range(MAX_HALVINGS))
        return next(
            (size for size in sizes if self.contracts_on_shells(shooter, size, TEST_DIRECTIONS, LATE_PERIODS)), 0.0
        )

    def contracts_on_shells(
        self, shooter: Shooter, radius: float, directions: int = DIRECTIONS, periods: int = 1
    ) -> bool:
        """Whether motion from so far away, and from nearer, comes nearer in a period, or in some of them.

        It must do so from some directions on each shell, and be in the same system afterwards.
        """
        random, bound = np.random.default_rng(0), expected_decay(self.spectral_radius, periods)
        # even in the ellipsoid: drawn evenly in the scales of the state, they would miss its long axes
        sphere = random.standard_normal((SHELL_COUNT, self._scales.size, directions))
        evenly = np.linalg.solve(self._root, sphere)
        starts = list[FloatArray]()
        for shell in range(SHELL_COUNT):
            size = max(radius * SHELL_RATIO**shell, NOISE_TOLERANCE_RATIO * shooter.scene.solver.tolerance)
            for way in (self._slowest, -self._slowest, *evenly[shell].T):
                starts.append(self._displace(way * (size / np.linalg.norm(self._root @ way))))
        return self._contracts(shooter, np.array(starts), 1, bound, periods)

    def contracts_along_trajectory(self, shooter: Shooter, state: FloatArray) -> bool:
        """Whether motion comes nearer on the way from a full state on the section.

        It must do so in each period: motion that goes round a stable orbit far away comes nearer now and then, too.
        Nearer to the orbit, it must do so over some periods.
        """
        offset, bound = state - self.state, 1.0 - MIN_DECAY_RATIO_ON_WAY * (1.0 - self.spectral_radius)
        offset[_ANGLES] -= TURN * np.round(offset[_ANGLES] / TURN)
        visible = min(TURNS / self.turns, VISIBLE_DECAY / (1.0 - self.spectral_radius))
        several = max(PERIODS, math.ceil(visible))
        for shell in range(MAX_PLACES):
            start = self._displace(SHELL_RATIO**shell * offset[self._places] / self._scales)
            if self.distance(start, self.system) < NOISE_TOLERANCE_RATIO * shooter.scene.solver.tolerance:
                break
            looks, periods = (1, several) if shell else (FIRST_PERIODS, 1)
            if not self._contracts(shooter, start[np.newaxis], looks, bound**periods, periods):
                return False
        return True

    def _displace(self, offset: FloatArray) -> FloatArray:
        state = self.state.copy()
        state[self._places] += offset * self._scales
        return state

    def _contracts(self, shooter: Shooter, starts: FloatArray, looks: int, bound: float, periods: int) -> bool:
        """Whether distances from full states are multiplied by less than a bound from look to look.

        ``periods`` are those between two looks.
        """
        turns, noise = periods * self.turns, NOISE_TOLERANCE_RATIO * shooter.scene.solver.tolerance
        longest, orbit = 2.0 * (turns + 1) * self._turn, (self.state, self.system, self.norm)
        return shooter.call(shooter.contracts, *orbit, starts, looks, turns, longest, bound, noise)


def expected_decay(rate: float, periods: int) -> float:
    """Return the largest factor of a distance over some periods, for the factor of one by the derivative."""
    return float((1.0 - MIN_DECAY_RATIO * (1.0 - rate)) ** periods)


def contracting_norm(section_map: FloatArray, values: npt.NDArray[Any], right: npt.NDArray[Any]) -> FloatArray:
    """Return W with ‖W M ξ‖ ≤ |λ₁| ‖W ξ‖ for M of these eigenvalues and eigenvectors.

    It is real: of a complex pair of left eigenvectors it holds real and imaginary part, √2 times. Where the
    eigenvectors are nearly parallel, W is the root of Σ (Mᵀ)ᵏ Mᵏ / ρ²ᵏ, with ρ half way from |λ₁| to 1.
    """
    with suppress(np.linalg.LinAlgError):
        left = np.linalg.inv(right)
        sizes = np.linalg.norm(left, axis=1)
        if math.sqrt(sizes.size * (sizes @ sizes)) < MAX_CONDITION:
            weights = np.where(values.imag == 0.0, 1.0, math.sqrt(2.0)) / sizes
            rows = np.where(values.imag[:, np.newaxis] < 0.0, left.imag, left.real)
            return np.asarray(weights[:, np.newaxis] * rows)
    power, total = section_map / (0.5 * (1.0 + np.abs(values).max())), np.eye(len(values))
    while np.abs(power).max() > 1e-9:
        total = total + power.T @ total @ power
        power = power @ power
    return np.asarray(np.linalg.cholesky(total).T / math.sqrt(np.abs(total).max()))
