"""Newton's method for periodic orbits: unknowns, residual, multipliers.

An orbit is found as a fixed point of a shot: from a state on the section, where exciter 1 stands at a given angle, for
exactly the period T, which is unknown too. The angle's place among the unknowns is taken by T.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.config.coordinates import Mode
from vibroplat.continuation.shooting import Shooter, Shot
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.systems import GAP, SYSTEMS

#: Residual, in the scales of the scene, beyond which an iteration has left all sense.
FAR = 1e3
#: An iteration with an old Jacobian goes on while it divides the residual by this.
SLOW = 10.0
#: What an iteration is expected to divide the residual by: the shot after it is measured at once.
QUICK = 300.0

#: Steps longer than this, in units of the unknowns, are checked for directions that the equations do not determine:
#: those with singular values below the other number.
LONGEST, UNDETERMINED = 1.0, 1e-8

#: Distance of a multiplier from the unit circle that counts: its own error is far smaller.
NEUTRAL = 1e-6
#: Residual after half of the period, over the tolerance, within which an orbit repeats there.
HALVED = 1e3

#: Place of the angle of exciter 1 in the full state.
ANGLE = 3


class MissedError(ArithmeticError):
    """No orbit was found.

    Attributes
    ----------
    why
        In a clause.
    residuals
        Of all iterations, in the scales of the scene.
    """

    def __init__(self, why: str, residuals: Sequence[float] = ()) -> None:
        super().__init__(why)
        self.why = why
        self.residuals = tuple(residuals)


@dataclass(frozen=True)
class Frame:
    """The unknowns of orbits near one of them.

    Attributes
    ----------
    base
        A full state on the section, shape (14,); its angle of exciter 1 says where the section is.
    system
        Number of the system there.
    """

    base: FloatArray
    system: int

    @cached_property
    def places(self) -> npt.NDArray[np.int64]:
        """Places of the unknowns in the full state, that of the angle for the period."""
        return np.sort(SYSTEMS[self.system].places)

    @cached_property
    def phase(self) -> int:
        """Which of the unknowns is the period."""
        return int(np.searchsorted(self.places, ANGLE))

    @cached_property
    def flying(self) -> bool:
        """Whether the section lies in flight."""
        return SYSTEMS[self.system].mode is Mode.FLIGHT


class Layout(NamedTuple):
    """How the unknowns of a frame lie in the full state and in its derivative.

    Attributes
    ----------
    frame
        The frame.
    scales
        Of the unknowns, shape (m,).
    rows, columns
        Places of the unknowns, and of these with the keys behind them, as indices of a matrix.
    sizes
        Scales and units of the columns over the scales of the rows, shape (m, m + keys).
    """

    frame: Frame
    scales: FloatArray
    rows: npt.NDArray[np.int64]
    columns: npt.NDArray[np.int64]
    sizes: FloatArray


class Problem:
    """Orbits of one period, at any values of the shooter's keys.

    Parameters
    ----------
    shooter
        Takes the shots.
    turns
        Whole turns of both exciters in a period, with their signs.
    units
        Units of the keys in the vector of unknowns.
    tolerance
        Residual, in the scales of the scene, at which an orbit is found.
    """

    def __init__(
        self, shooter: Shooter, turns: tuple[int, int], units: Sequence[float] = (), tolerance: float = 1e-8
    ) -> None:
        self.shooter = shooter
        self.turns = turns
        self.units = tuple(units)
        self.tolerance = tolerance
        self._speed = shooter.scene.speed_scale
        self._angles = 2.0 * np.pi * np.array(turns)
        self._layout: Layout | None = None

    def _laid(self, frame: Frame) -> Layout:
        """Find the layout of a frame, usually the one that was asked for last."""
        if self._layout is None or self._layout.frame is not frame:
            places, all_scales = frame.places, self.shooter.scales
            scales = all_scales[places]
            columns = np.append(places, np.arange(all_scales.size, all_scales.size + len(self.units)))
            sizes = np.append(scales, self.units) / scales[:, np.newaxis]
            self._layout = Layout(frame, scales, places[:, np.newaxis], columns, sizes)
        return self._layout

    def pack(self, frame: Frame, state: FloatArray, period: float, values: Sequence[float] = ()) -> FloatArray:
        """Write a state on the section, the period (s) and the values of the keys as a vector of unknowns."""
        found = state[frame.places] / self._laid(frame).scales
        found[frame.phase] = period * self._speed
        return np.append(found, [value / unit for value, unit in zip(values, self.units, strict=True)])

    def unpack(self, frame: Frame, u: FloatArray) -> tuple[FloatArray, float, list[float]]:
        """Read state, period (s) and values from a vector of unknowns."""
        state, m = frame.base.copy(), frame.places.size
        state[frame.places] = u[:m] * self._laid(frame).scales
        state[ANGLE] = frame.base[ANGLE]
        values = [v * unit for v, unit in zip(u[m:].tolist(), self.units, strict=True)]
        return state, float(u[frame.phase]) / self._speed, values

    def shoot(self, frame: Frame, u: FloatArray, *, full: bool) -> tuple[FloatArray, Shot]:
        """Take a shot from a vector of unknowns; its residual, and the shot, with derivative and measures if ``full``.

        Raises
        ------
        MissedError
            It does not end, or begins or ends in another mode than the section's.
        """
        state, period, values = self.unpack(frame, u)
        if not period > 0.0 or period * self._speed > 1e4:
            raise MissedError(f"the search went astray, to a period of {period:.3g} s")
        if frame.flying and state[GAP] <= 0.0:
            raise MissedError("the gap closed on the section")
        try:
            self.shooter.set(dict(zip(self.shooter.keys, values, strict=True)))
        except ValueError as error:
            raise MissedError(f"no scene has these values: {error}") from None
        shot = self.shooter.shot(state, period, varied=full, measured=full)
        if shot.outcome != "ok":
            raise MissedError(f"{shot.outcome}: {shot.detail}")
        if not shot.begins == shot.ends == frame.system:
            raise MissedError("the mode on the section changed")
        difference = shot.state - state
        difference[3:5] -= self._angles
        residual = difference[frame.places] / self._laid(frame).scales
        if not np.abs(residual).max() < FAR:
            raise MissedError("the residual grew beyond all bounds")
        return residual, shot

    def jacobian(self, frame: Frame, shot: Shot) -> FloatArray:
        """Differentiate the residual by the unknowns, shape (m, m + keys)."""
        found = self._derivative(frame, shot)
        m = frame.places.size
        found[np.arange(m), np.arange(m)] -= 1.0
        found[:, frame.phase] = self._along(frame, shot) / self._speed
        return found

    def halves(self, frame: Frame, u: FloatArray) -> bool:
        """Whether an orbit repeats after half of its period already."""
        if any(turns % 2 for turns in self.turns):
            return False
        state, seconds, values = self.unpack(frame, u)
        self.shooter.set(dict(zip(self.shooter.keys, values, strict=True)))
        difference = self.shooter.shot(state, 0.5 * seconds).state - state
        difference[3:5] -= 0.5 * self._angles
        return bool(np.abs(difference / self.shooter.scales).max() < HALVED * self.tolerance)

    def _derivative(self, frame: Frame, shot: Shot) -> FloatArray:
        """Differentiate the end by the start and by the keys, in scales and units, shape (m, m + keys)."""
        assert shot.derivative is not None
        laid = self._laid(frame)
        return np.asarray(shot.derivative[laid.rows, laid.columns] * laid.sizes)

    def _along(self, frame: Frame, shot: Shot) -> FloatArray:
        """Rates at the end, in scales, shape (m,)."""
        assert shot.rates is not None
        return np.asarray(shot.rates[frame.places] / self._laid(frame).scales)

    def multipliers(self, frame: Frame, shot: Shot) -> npt.NDArray[np.complex128]:
        """Floquet multipliers but the 1 along the motion, the largest first: of the map from section to section."""
        return sorted_multipliers(self.section_map(frame, shot))

    def section_map(self, frame: Frame, shot: Shot) -> FloatArray:
        """Differentiate the map from section to section, shape (m − 1, m − 1)."""
        along, i = self._along(frame, shot), frame.phase
        whole = self._derivative(frame, shot)[:, : along.size]
        whole = whole - np.outer(along / along[i], whole[i])
        others = np.flatnonzero(np.arange(along.size) != i)
        return np.asarray(whole[others[:, np.newaxis], others])


def sorted_multipliers(section_map: FloatArray) -> npt.NDArray[np.complex128]:
    """Eigenvalues by size, the largest first; of a pair that with the positive imaginary part."""
    found = np.linalg.eigvals(section_map).astype(complex)
    return found[np.lexsort((-found.imag, -np.round(np.abs(found), 12)))]


def leaving(multipliers: npt.NDArray[np.complex128]) -> int:
    """Count the multipliers outside the unit circle."""
    return int((np.abs(multipliers) > 1.0 + NEUTRAL).sum())


def bordered(jacobian: FloatArray, border: FloatArray, columns: int = 0) -> FloatArray:
    """Put a row or several under a Jacobian, and columns of zeros beside both."""
    m, free = jacobian.shape
    found = np.zeros((m + border.size // free, free + columns))
    found[:m, :free], found[m:, :free] = jacobian, border
    return found


def solved(matrix: FloatArray, right: FloatArray, longest: float) -> FloatArray:
    """Solve linear equations; where the solution is longer than is sensible, leave out what they hardly determine.

    Exciters without motors, or a platform without dampers, leave directions in which orbits are not isolated.

    Raises
    ------
    MissedError
        The matrix is not finite.
    """
    if not np.isfinite(matrix).all():
        raise MissedError("the Jacobian is not finite")
    try:
        found: FloatArray = np.asarray(np.linalg.solve(matrix, right), dtype=float)
        if math.sqrt(found @ found) <= longest:
            return found
    except np.linalg.LinAlgError:
        pass
    left, sizes, turned = np.linalg.svd(matrix)
    kept = sizes > UNDETERMINED
    least: FloatArray = turned[kept].T @ ((left.T @ right)[kept] / sizes[kept])
    return least


@dataclass
class Found:
    """A periodic orbit as Newton's method leaves it.

    Attributes
    ----------
    u, shot, jacobian
        Unknowns, the measured shot from them, and the derivative of its residual by them.
    residuals
        Of all iterations.
    slack
        How much of a vector there is in the residual, if one was allowed.
    """

    u: FloatArray
    shot: Shot
    jacobian: FloatArray
    residuals: list[float]
    slack: float = 0.0


def correct(
    problem: Problem,
    frame: Frame,
    u: FloatArray,
    border: FloatArray,
    jacobian: FloatArray | None = None,
    most: int = 12,
    slack: FloatArray | None = None,
) -> Found:
    """Find an orbit near a vector of unknowns, in the directions that a border leaves free.

    Parameters
    ----------
    border
        Directions in which the unknowns stay, one for each key, shape (keys, m + keys).
    jacobian
        Nearly that of the orbit, to begin with (Broyden 1965); a new one is made where it serves no longer.
    most
        Largest number of iterations.
    slack
        A vector, of which the residual may have as much as it needs; then the border has a row more.

    Raises
    ------
    MissedError
        There is none.
    """
    begun, residuals = u, list[float]()
    full = jacobian is None
    step, left, much = np.zeros_like(u), np.zeros(0), 0.0
    while len(residuals) < most:
        try:
            residual, shot = problem.shoot(frame, u, full=full)
            missing = residual if slack is None else residual + much * slack
            size = float(np.abs(missing).max())
            residuals.append(size)
            slow = len(residuals) > 1 and size > residuals[-2] / SLOW
            if full:
                jacobian = problem.jacobian(frame, shot)
                if size < problem.tolerance:
                    return Found(u, shot, jacobian, residuals, much)
            elif size < problem.tolerance or slow:
                full = True
                continue
            assert jacobian is not None
            if not full and step.any():
                jacobian = jacobian + np.outer(residual - left - jacobian @ step, step) / (step @ step)
            step, more = _step(jacobian, border, slack, -np.append(missing, border @ (u - begun)))
        except MissedError as error:
            raise MissedError(error.why, residuals) from None
        u, left, much = u + step, residual, much + more
        full = size < QUICK * problem.tolerance
    raise MissedError(f"no convergence in {most} iterations", residuals)


def _step(
    jacobian: FloatArray, border: FloatArray, slack: FloatArray | None, right: FloatArray
) -> tuple[FloatArray, float]:
    """Solve for a step of Newton's method, and for how much more of the slack it needs."""
    if slack is None:
        return solved(bordered(jacobian, border), right, LONGEST), 0.0
    matrix = bordered(jacobian, border, columns=1)
    matrix[: slack.size, -1] = slack
    found = solved(matrix, right, LONGEST)
    return found[:-1], float(found[-1])
