"""Newton's method for periodic orbits: unknowns, residual, Jacobian, Floquet multipliers.

An orbit is a fixed point of a shot: from a state on the section, where exciter 1 stands at a given angle, for exactly
the period T, which is unknown too. The angle's place among the unknowns is taken by T.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from vibroplat.continuation.shooting import TURN, Shooter, Shot, canonical_sequence
from vibroplat.kernels.compiled import FloatArray
from vibroplat.kernels.linear import (
    broyden_update,
    closing_residual,
    eliminate,
    largest_size,
    project_to_section,
    take_scaled,
)
from vibroplat.model.systems import GAP, GAP_RATE, SYSTEMS

#: Residual, in scaled units, beyond which the iteration is given up.
MAX_RESIDUAL = 1e3
#: An old Jacobian serves for another iteration while the last one divided the residual by this.
MIN_CONVERGENCE = 10.0
#: What an iteration is expected to divide the residual by: the shot after it is measured at once.
EXPECTED_CONVERGENCE = 300.0
#: Steps longer than this, in units of the unknowns, are checked for directions that the equations do not determine:
#: those with singular values below the other number.
MAX_STEP, SINGULAR = 1.0, 1e-8
#: Distance of a multiplier from the unit circle that counts: its own error is far smaller.
UNIT_CIRCLE_DISTANCE = 1e-6
#: Residual after half of the period, over the tolerance, within which an orbit repeats there.
HALF_PERIOD_RESIDUAL_RATIO = 1e3
#: Largest lengths of the second, the third, … step relative to the first one, and largest residuals after the first,
#: the second, … step relative to the one before: beyond them, the last ones for all later steps, it is given up.
Limits = tuple[Sequence[float], Sequence[float]]
NO_LIMITS: Limits = ((), ())
#: Place of the angle of exciter 1 in the full state.
ANGLE_INDEX = 3


class NoConvergenceError(ArithmeticError):
    """No orbit was found: why, in a clause, and the residuals of all iterations, in scaled units.

    It may be because of where the ``section`` lies, beside an event.
    """

    def __init__(self, why: str, residuals: Sequence[float] = (), *, section: bool = False) -> None:
        super().__init__(why)
        self.why = why
        self.residuals = tuple(residuals)
        self.section = section


class Chart:
    """Unknowns of orbits near a state on the section, in scales: the state without the angle, the period, and keys.

    Parameters
    ----------
    base, system
        Full state on the section, shape (14,), whose angle of exciter 1 says where that is, and number of its system.
    scales, speed, units
        Of full states, shape (14,), of exciters (rad/s), and of keys.

    Attributes
    ----------
    places, phase
        Places of the unknowns in the full state, shape (m,), and which of them is the period, at the angle's place.
    """

    def __init__(
        self, base: FloatArray, system: int, scales: FloatArray, speed: float, units: Sequence[float] = ()
    ) -> None:
        self.base, self.system, self.speed, self.units = base, system, speed, tuple(units)
        self.places: npt.NDArray[np.int64] = np.sort(SYSTEMS[system].places)
        self.phase = int(np.searchsorted(self.places, ANGLE_INDEX))
        self.scales: FloatArray = scales[self.places]
        self._columns = np.append(self.places, np.arange(scales.size, scales.size + len(self.units)))
        self._sizes = np.append(self.scales, self.units) / self.scales[:, np.newaxis]

    def pack(self, state: FloatArray, period: float, values: Sequence[float] = ()) -> FloatArray:
        """Write a state on the section, the period (s) and the values of the keys as a vector of unknowns."""
        m = self.places.size
        u = np.empty(m + len(self.units))
        u[:m] = state[self.places] / self.scales
        u[self.phase] = period * self.speed
        u[m:] = [value / unit for value, unit in zip(values, self.units, strict=True)]
        return u

    def unpack(self, u: FloatArray) -> tuple[FloatArray, float, list[float]]:
        """Read state, period (s) and values from a vector of unknowns."""
        state, m = self.base.copy(), self.places.size
        state[self.places] = u[:m] * self.scales
        state[ANGLE_INDEX] = self.base[ANGLE_INDEX]
        values = [v * unit for v, unit in zip(u[m:].tolist(), self.units, strict=True)]
        return state, float(u[self.phase]) / self.speed, values

    def derivative(self, shot: Shot) -> tuple[FloatArray, FloatArray]:
        """Return the derivative of a shot's end by start and keys, shape (m, m + keys), and the rates there, (m,)."""
        assert shot.derivative is not None
        assert shot.rates is not None
        found = np.empty(self._sizes.shape)
        take_scaled(shot.derivative, self.places, self._columns, self._sizes, found)
        return found, shot.rates[self.places] / self.scales

    def section_map(self, shot: Shot) -> FloatArray:
        """Differentiate the map from section to section, shape (m − 1, m − 1)."""
        derivative, along = self.derivative(shot)
        found = np.empty((along.size - 1, along.size - 1))
        project_to_section(derivative, along, self.phase, found)
        return found


@dataclass(frozen=True)
class NewtonResult:
    """A periodic orbit as Newton's method leaves it.

    Attributes
    ----------
    shot, jacobian
        The measured shot from the unknowns u, and the derivative of its residual by them.
    residual, residuals, slack
        Of the shot, shape (m,), and the largest of all iterations; how much of a vector there is in the last one, if
        that was allowed.
    """

    chart: Chart
    u: FloatArray
    shot: Shot
    jacobian: FloatArray
    residual: FloatArray
    residuals: Sequence[float]
    slack: float

    @cached_property
    def multipliers(self) -> npt.NDArray[np.complex128]:
        """Floquet multipliers but the 1 along the motion, the largest first; of a pair that above the real axis."""
        found = np.linalg.eigvals(self.chart.section_map(self.shot)).astype(complex)
        return found[np.lexsort((-found.imag, -np.abs(found).round(12)))]

    @cached_property
    def event_sequence(self) -> str:
        """Sequence of events, wherever the period begins."""
        return canonical_sequence(self.shot.event_sequence)

    def newton_step(self, border: FloatArray) -> FloatArray:
        """Newton's last step in the directions that a border leaves free, which needs no further shot."""
        held = np.zeros(self.u.size - self.residual.size)
        return solve(add_border(self.jacobian, border), -np.append(self.residual, held), MAX_STEP)

    @property
    def value(self) -> float:
        """Value of the only key."""
        return float(self.u[-1]) * self.chart.units[0]


def n_unstable(multipliers: npt.NDArray[np.complex128]) -> int:
    """Count the multipliers outside the unit circle."""
    return int((np.abs(multipliers) > 1.0 + UNIT_CIRCLE_DISTANCE).sum())


class Problem:
    """Orbits of one period, at any values of the shooter's keys.

    Parameters
    ----------
    turns
        Whole turns of both exciters in a period, with their signs.
    units
        Of the keys in the vector of unknowns.
    tolerance
        Residual, in scaled units, at which an orbit is found.
    """

    def __init__(
        self, shooter: Shooter, turns: Sequence[int], units: Sequence[float] = (), tolerance: float = 1e-8
    ) -> None:
        self.shooter = shooter
        self.turns = (turns[0], turns[1])
        self.units = tuple(units)
        self.tolerance = tolerance
        self._turned = np.zeros(shooter.scales.size)  # what a period adds to a full state
        self._turned[ANGLE_INDEX : ANGLE_INDEX + 2] = TURN * np.array(self.turns)

    def chart(self, base: FloatArray, system: int | None = None) -> Chart:
        """Make the chart about a state on the section, in a system or else in that of a motion from there."""
        system = self.shooter.shot(base, 0.0).begins if system is None else system
        return Chart(base, system, self.shooter.scales, self.shooter.scene.speed_scale, self.units)

    def shoot(self, chart: Chart, u: FloatArray, *, full: bool) -> tuple[FloatArray, Shot]:
        """Take a shot from a vector of unknowns; its residual, and the shot, with derivative and measures if ``full``.

        Raises
        ------
        NoConvergenceError
            It does not end, or begins or ends in another mode than the section's.
        """
        state, period, values = chart.unpack(u)
        if not period > 0.0 or period * chart.speed > 1e4:
            raise NoConvergenceError(f"Newton's method converged to a period of {period:.3g} s")
        if GAP in chart.places and state[GAP] <= 0.0:
            raise NoConvergenceError("the gap closed on the section", section=True)
        try:
            self.shooter.set(values)
        except ValueError as error:
            raise NoConvergenceError(f"no scene has these values: {error}") from None
        shot = self.shooter.shot(state, period, full=full)
        if shot.outcome != "ok":
            raise NoConvergenceError(f"{shot.outcome}: {shot.detail}")
        if not shot.begins == shot.ends == chart.system:
            raise NoConvergenceError("the mode on the section changed", section=True)
        residual = np.empty(chart.scales.size)
        closing_residual(shot.state, state, self._turned, chart.places, chart.scales, residual)
        if not largest_size(residual) < MAX_RESIDUAL:
            raise NoConvergenceError("the residual diverged")
        return residual, shot

    def jacobian(self, chart: Chart, shot: Shot) -> FloatArray:
        """Differentiate the residual by the unknowns, shape (m, m + keys)."""
        found, along = chart.derivative(shot)
        found.reshape(-1)[: along.size * found.shape[1] : found.shape[1] + 1] -= 1.0
        found[:, chart.phase] = along / chart.speed
        return found

    def describe(self, orbit: NewtonResult) -> dict[str, Any]:
        """Say as plain values where an orbit is: a row of tables, from which another worker can go on."""
        state, seconds, values = orbit.chart.unpack(orbit.u)
        turns = abs(self.turns[0])
        return {
            "value": values[0],
            "excitation_frequency_hz": turns / seconds,
            "period": turns,
            "period_s": seconds,
            "turns": list(self.turns),
            "word": orbit.event_sequence,
            "state": state.tolist(),
        }

    def repeats_after_half(self, orbit: NewtonResult) -> bool:
        """Whether an orbit repeats after half of its period already."""
        if any(turns % 2 for turns in self.turns):
            return False
        state, seconds, values = orbit.chart.unpack(orbit.u)
        self.shooter.set(values)
        difference = self.shooter.shot(state, 0.5 * seconds).state - state
        difference -= 0.5 * self._turned
        return bool(np.abs(difference / self.shooter.scales).max() < HALF_PERIOD_RESIDUAL_RATIO * self.tolerance)

    def move_from_events(
        self, orbit: NewtonResult, *directions: FloatArray, longest: bool = False
    ) -> tuple[Chart, FloatArray, list[FloatArray]] | None:
        """Move the section of an orbit to the middle of a piece between events; None if it need not or cannot be.

        See :meth:`vibroplat.continuation.shooting.Shot.far_from_events` for where it goes. Returns the orbit as chart
        and unknowns, and the directions carried along it, of length 1.
        """
        when = orbit.shot.section_time(longest=longest)
        moved = self.move_section(orbit.chart, orbit.u, when) if when > 0.0 else None
        if moved is None:
            return None
        there, u, way = moved
        return there, u, [self._carry_direction(orbit.chart, there, way, d) for d in directions]

    def move_section(self, chart: Chart, u: FloatArray, when: float) -> tuple[Chart, FloatArray, Shot] | None:
        """Move the section to a later time of a motion (s): chart, unknowns and the way there; None if it ends."""
        state, period, values = chart.unpack(u)
        self.shooter.set(values)
        way = self.shooter.shot(state, when, full=True)
        if way.outcome != "ok":
            return None
        moved = way.state.copy()
        moved[3:5] -= TURN * np.floor(moved[3:5] / TURN)
        if GAP not in SYSTEMS[way.ends].places:
            moved[[GAP, GAP_RATE]] = 0.0
        there = self.chart(moved, way.ends)
        return there, there.pack(moved, period, values), way

    def _carry_direction(self, here: Chart, there: Chart, way: Shot, direction: FloatArray) -> FloatArray:
        """Carry a direction of unknowns along a part of an orbit, to another section."""
        assert way.derivative is not None
        assert way.rates is not None
        scales, count = self.shooter.scales, here.places.size
        start = np.zeros(scales.size)
        start[here.places] = direction[:count]
        start[ANGLE_INDEX] = 0.0
        change = way.derivative[:, : scales.size] @ (start * scales)
        change += way.derivative[:, scales.size :] @ (direction[count:] * np.array(self.units))
        change -= way.rates * change[ANGLE_INDEX] / way.rates[ANGLE_INDEX]  # to the section
        carried = (change / scales)[there.places]
        carried[there.phase] = direction[here.phase]
        carried = np.append(carried, direction[count:])
        return np.asarray(carried / np.linalg.norm(carried))


def add_border(jacobian: FloatArray, border: FloatArray, column: FloatArray | None = None) -> FloatArray:
    """Put a row or several under a Jacobian and, where one is given, a column beside it with zeros below."""
    m, free = jacobian.shape
    found = np.zeros((m + border.size // free, free + (column is not None)))
    found[:m, :free], found[m:, :free] = jacobian, border
    if column is not None:
        found[:m, free] = column
    return found


def solve(matrix: FloatArray, right: FloatArray, longest: float) -> FloatArray:
    """Solve linear equations; where the solution is longer than is sensible, leave out what they hardly determine.

    Exciters without motors, or a platform without dampers, leave directions in which orbits are not isolated.

    Raises
    ------
    NoConvergenceError
        The matrix is not finite.
    """
    found = right.copy()
    if abs(eliminate(matrix.copy(), found)) > 0.0 and math.sqrt(found @ found) <= longest:
        return found
    if not np.isfinite(matrix).all():
        raise NoConvergenceError("the Jacobian is not finite")
    left, sizes, turned = np.linalg.svd(matrix)
    kept = sizes > SINGULAR
    least: FloatArray = turned[kept].T @ ((left.T @ right)[kept] / sizes[kept])
    return least


def correct(
    problem: Problem,
    chart: Chart,
    u: FloatArray,
    border: FloatArray,
    jacobian: FloatArray | None = None,
    max_iterations: int = 12,
    slack: FloatArray | None = None,
    halvings: int = 0,
    limits: Limits = NO_LIMITS,
) -> NewtonResult:
    """Find an orbit near a vector of unknowns, in the directions that a border leaves free.

    Parameters
    ----------
    border
        Directions in which the unknowns stay, one for each key, shape (keys, m + keys).
    jacobian
        Nearly that of the orbit, to begin with (Broyden 1965); a new one is made where it serves no longer.
    max_iterations, limits
        Largest number of iterations, and limits of their course.
    slack
        A vector, of which the residual may have as much as it needs; then the border has a row more.
    halvings
        How often a step is halved, at most, after which an event has passed the section.

    Raises
    ------
    NoConvergenceError
        There is none.
    """
    begun, residuals, steps = u, list[float](), list[float]()
    full, step, left, much = jacobian is None, np.zeros_like(u), np.zeros(0), 0.0
    try:
        while len(residuals) < max_iterations:
            residual, shot, u, step, full = _shoot_halving(problem, chart, u, step, halvings, full=full)
            missing = residual if slack is None else residual + much * slack
            residuals.append(size := largest_size(missing))
            _check(size, residuals[0], len(steps), limits[1])
            if full:
                jacobian = problem.jacobian(chart, shot)
                if size < problem.tolerance:
                    return NewtonResult(chart, u, shot, jacobian, missing, residuals, much)
            elif size < problem.tolerance or (len(residuals) > 1 and size > residuals[-2] / MIN_CONVERGENCE):
                full = True
                continue
            assert jacobian is not None
            if not full and step.any():
                jacobian = jacobian.copy()
                broyden_update(jacobian, step, residual - left)
            found = solve(add_border(jacobian, border, slack), -np.append(missing, border @ (u - begun)), MAX_STEP)
            step, more = found[: u.size], float(found[u.size :].sum())
            steps.append(long := float(np.linalg.norm(step)))
            _check(long, steps[0], len(steps) - 1, limits[0])
            u, left, much = u + step, residual, much + more
            full = size < EXPECTED_CONVERGENCE * problem.tolerance
    except NoConvergenceError as error:
        raise NoConvergenceError(error.why, residuals, section=error.section) from None
    raise NoConvergenceError(f"no convergence in {max_iterations} iterations", residuals)


def _check(size: float, first: float, number: int, limits: Sequence[float]) -> None:
    """Refuse a size that is beyond the limit of its number, relative to the first one, number 0."""
    if limits and number > 0 and size > first * limits[min(number, len(limits)) - 1]:
        raise NoConvergenceError("the iteration does not converge")


def _shoot_halving(
    problem: Problem, chart: Chart, u: FloatArray, step: FloatArray, halvings: int, *, full: bool
) -> tuple[FloatArray, Shot, FloatArray, FloatArray, bool]:
    """Take a shot after a step, which is halved, so often at most, while an event has passed the section.

    Returns residual and shot, and the vector of unknowns, the step and ``full`` that they are of.
    """
    while True:
        try:
            return (*problem.shoot(chart, u, full=full), u, step, full)
        except NoConvergenceError as error:
            if not (error.section and step.any() and halvings > 0):
                raise
        halvings, step, full = halvings - 1, 0.5 * step, True
        u = u - step


def correct_moving_section(
    problem: Problem, chart: Chart, u: FloatArray, max_iterations: int, limits: Limits = NO_LIMITS
) -> NewtonResult:
    """Find an orbit near a vector of unknowns with its keys held; if an event passes the section, on another section.

    That is what happens to guesses from chaotic motion. The other one lies in the middle of a piece between events.
    Limits of residuals hold there too.

    Raises
    ------
    NoConvergenceError
        There is none.
    """
    try:
        return correct(problem, chart, u, fixed_border(chart), max_iterations=max_iterations, limits=limits)
    except NoConvergenceError as error:
        if not error.section:
            raise
        state, period, values = chart.unpack(u)
        problem.shooter.set(values)
        guess = problem.shooter.shot(state, period, full=True)
        moved = problem.move_section(chart, u, guess.section_time(elsewhere=True)) if guess.outcome == "ok" else None
        if moved is None:
            raise
    chart, u, limits = *moved[:2], ((), limits[1])
    return correct(problem, chart, u, fixed_border(chart), max_iterations=2 * max_iterations, halvings=4, limits=limits)


def fixed_border(chart: Chart) -> FloatArray:
    """Return the border with which the keys keep their values, shape (keys, m + keys)."""
    m = chart.places.size
    return np.eye(m + len(chart.units))[m:]
