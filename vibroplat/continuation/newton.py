"""Newton's method for periodic orbits: unknowns, residual, Jacobian, Floquet multipliers.

An orbit is a fixed point of a shot: from a state on the section, where exciter 1 stands at a given angle, for exactly
the period T, which is unknown too. The angle's place among the unknowns is taken by T.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
import numpy.typing as npt

from vibroplat.config.coordinates import TURN
from vibroplat.continuation.shooting import Shooter, Shot, canonical_sequence
from vibroplat.kernels.compiled import FloatArray
from vibroplat.kernels.linear import eliminate
from vibroplat.model.systems import GAP, GAP_RATE, SYSTEMS
from vibroplat.motion.motion import Simulator
from vibroplat.shooting.multipliers import Stability, multipliers_of, stability
from vibroplat.shooting.orbits import (
    ANGLE_INDEX,
    BEYOND_LIMITS,
    CLOSED,
    CONVERGED,
    DIVERGED,
    ENDED,
    MAX_STEP,
    NO_PERIOD,
    OTHER_MODE,
    RAISED,
    UNFINISHED,
    Chart,
    Search,
)
from vibroplat.shooting.shots import SOLVE

#: Singular values below which directions are not determined by the equations.
RANK_LIMIT = 1e-8
#: Residual after half of the period, over the tolerance, within which an orbit repeats there.
HALF_PERIOD_RESIDUAL_RATIO = 1e3


class NoConvergenceError(ArithmeticError):
    """No orbit was found: why, in a clause, and the residuals of all iterations, in scaled units.

    It may be because of where the ``section`` lies, beside an event.
    """

    def __init__(self, why: str, residuals: Sequence[float] = (), *, section: bool = False) -> None:
        super().__init__(why)
        self.why = why
        self.residuals = tuple(residuals)
        self.section = section


@dataclass
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

    @property
    def multipliers(self) -> npt.NDArray[np.complex128]:
        """Floquet multipliers but the 1 along the motion, the largest first; of a pair that above the real axis."""
        return self._stability[0]

    @property
    def stability(self) -> Stability:
        """Test functions and counts of the multipliers."""
        return self._stability[1]

    @cached_property
    def _stability(self) -> tuple[npt.NDArray[np.complex128], Stability]:
        try:
            multipliers = multipliers_of(self.chart.section_map(self.shot))
        except np.linalg.LinAlgError as error:
            raise NoConvergenceError("the multipliers are not finite") from error
        return multipliers, stability(multipliers)

    @cached_property
    def event_sequence(self) -> str:
        """Sequence of events, wherever the period begins."""
        return canonical_sequence(self.shot.event_sequence)

    def newton_step(self, border: FloatArray) -> FloatArray:
        """Newton's last step in the directions that a border leaves free, which needs no further shot."""
        zeros = np.zeros(self.u.size - self.residual.size)
        return solve(add_border(self.jacobian, border), -np.append(self.residual, zeros), MAX_STEP)

    @property
    def value(self) -> float:
        """Value of the only key."""
        return float(self.u[-1] * self.chart.units[0])


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

    Attributes
    ----------
    turned
        What a period adds to a full state, shape (14,).
    """

    def __init__(
        self, shooter: Shooter, turns: Sequence[int], units: Sequence[float] = (), tolerance: float = 1e-8
    ) -> None:
        self.shooter = shooter
        self.turns = (turns[0], turns[1])
        self.units: FloatArray = np.array(units, float)
        self.tolerance = tolerance
        self.turned = np.zeros(shooter.scales.size)
        self.turned[ANGLE_INDEX : ANGLE_INDEX + 2] = TURN * np.array(self.turns)

    def chart(self, base: FloatArray, system: int | None = None) -> Chart:
        """Make the chart about a state on the section, in a system or else in that of a motion from there."""
        system = self.shooter.shot(base, 0.0).begins if system is None else system
        return Chart.at(base, system, self.shooter.scene.speed_scale, self.units, self.shooter.scales)

    def shoot(self, chart: Chart, u: FloatArray) -> NewtonResult:
        """Take a full shot from a vector of unknowns: its residual and Jacobian, whatever the residual is.

        Raises
        ------
        NoConvergenceError
            It does not end, or begins or ends in another mode than the section's.
        """
        return correct(self, chart, u, np.empty((0, u.size)), max_iterations=1, tolerance=math.inf)

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
        difference -= 0.5 * self.turned
        return bool(np.abs(difference / self.shooter.scales).max() < HALF_PERIOD_RESIDUAL_RATIO * self.tolerance)

    def move_from_events(
        self, orbit: NewtonResult, *directions: FloatArray, longest: bool = False
    ) -> tuple[Chart, FloatArray, list[FloatArray]] | None:
        """Move the section of an orbit to the middle of a piece between events; None if it need not or cannot be.

        See :meth:`vibroplat.continuation.shooting.Shot.section_time` for where it goes. Returns the orbit as chart
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
        change += way.derivative[:, scales.size :] @ (direction[count:] * self.units)
        change -= way.rates * change[ANGLE_INDEX] / way.rates[ANGLE_INDEX]  # to the section
        carried = (change / scales)[there.places]
        carried[there.phase] = direction[here.phase]
        carried = np.append(carried, direction[count:])
        return np.asarray(carried / length_of(carried))


def length_of(vector: FloatArray) -> float:
    """Euclidean length, in a fraction of the time that numpy takes to see what it is given."""
    return math.sqrt(vector @ vector)


def add_border(jacobian: FloatArray, border: FloatArray, column: FloatArray | None = None) -> FloatArray:
    """Put a row or several under a Jacobian and, where one is given, a column beside it with zeros below."""
    m, free = jacobian.shape
    bordered = np.zeros((m + border.size // free, free + (column is not None)))
    bordered[:m, :free], bordered[m:, :free] = jacobian, border
    if column is not None:
        bordered[:m, free] = column
    return bordered


def solve(matrix: FloatArray, right: FloatArray, max_length: float) -> FloatArray:
    """Solve linear equations; where the solution is longer than is sensible, leave out what they hardly determine.

    Exciters without motors, or a platform without dampers, leave directions in which orbits are not isolated.

    Raises
    ------
    NoConvergenceError
        The matrix is not finite.
    """
    solution = right.copy()
    if abs(eliminate(matrix.copy(), solution)) > 0.0 and length_of(solution) <= max_length:
        return solution
    return solve_determined(matrix, right)


def solve_determined(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solve linear equations in the directions that they determine; the solution is 0 in the others.

    Raises
    ------
    NoConvergenceError
        The matrix is not finite.
    """
    if not np.isfinite(matrix).all():
        raise NoConvergenceError("the Jacobian is not finite")
    left, sizes, turned = np.linalg.svd(matrix)
    determined = sizes > RANK_LIMIT
    least: FloatArray = turned[determined].T @ ((left.T @ right)[determined] / sizes[determined])
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
    limits: Sequence[float] = (),
    tolerance: float | None = None,
) -> NewtonResult:
    """Find an orbit near a vector of unknowns, in the directions that a border leaves free.

    Parameters
    ----------
    border
        Directions in which the unknowns stay, one for each key, shape (keys, m + keys).
    jacobian
        Nearly that of the orbit, to begin with (Broyden 1965); a new one is made where it serves no longer.
    max_iterations, limits
        Largest number of iterations, and largest lengths of the second, the third, … step relative to the first:
        beyond them, the last one for all later steps, it is given up.
    slack
        A vector, of which the residual may have as much as it needs; then the border has a row more.
    halvings
        How often a step is halved, at most, after which an event has passed the section.
    tolerance
        Residual at which an orbit is found, if it is not that of the problem.

    Raises
    ------
    NoConvergenceError
        There is none.
    """
    shooter = problem.shooter
    while True:
        search = _search(problem, u, border, jacobian, max_iterations, slack, limits)
        shooter.answers[SOLVE] = partial(_solve_in_place, search)
        how = jacobian is not None, halvings, problem.tolerance if tolerance is None else tolerance
        try:
            why, reason = shooter.call(shooter.newton, chart, search, *how), ""
        except NoConvergenceError as error:
            why, reason = RAISED, error.why
        except ValueError as error:
            why, reason = RAISED, f"no scene has these values: {error}"
        if why != CONVERGED or shooter.has_room():
            break
    residuals, period = [r for r in search.residuals.tolist() if r >= 0.0], float(search.u[chart.phase]) / chart.speed
    if why != CONVERGED:
        reason = reason or _reason(shooter.motion, why, period, max_iterations)
        raise NoConvergenceError(reason, residuals, section=why in (CLOSED, OTHER_MODE))
    shot = shooter.last_shot(period, full=True, measured=True)
    return NewtonResult(chart, search.u, shot, search.jacobian, search.residual, residuals, float(search.much[0]))


def _search(
    problem: Problem,
    u: FloatArray,
    border: FloatArray,
    jacobian: FloatArray | None,
    iterations: int,
    slack: FloatArray | None,
    limits: Sequence[float],
) -> Search:
    """Make room for an iteration; see :func:`correct`."""
    m, n = u.size - problem.units.size, u.size + (slack is not None)
    return Search(
        u=u.copy(),
        turned=problem.turned,
        jacobian=np.empty((m, u.size)) if jacobian is None else jacobian.copy(),
        border=np.ascontiguousarray(border),
        slack=np.empty(0) if slack is None else np.ascontiguousarray(slack),
        residual=np.empty(m),
        residuals=np.full(iterations, np.nan),
        limits=np.array(limits, float),
        matrix=np.zeros((n, n)),
        right=np.zeros(n),
        much=np.zeros(1),
    )


def _solve_in_place(search: Search) -> None:
    """Solve the equations of a step in the directions that they determine."""
    search.right[:] = solve_determined(search.matrix, search.right)


def _reason(motion: Simulator, why: int, period: float, iterations: int) -> str:
    """Say why compiled code has found no orbit."""
    return {
        UNFINISHED: f"no convergence in {iterations} iterations",
        BEYOND_LIMITS: "the iteration does not converge",
        NO_PERIOD: f"Newton's method converged to a period of {period:.3g} s",
        CLOSED: "the gap closed on the section",
        OTHER_MODE: "the mode on the section changed",
        ENDED: f"{motion.outcome}: {motion.detail}",
        DIVERGED: "the residual diverged",
    }[why]


def correct_moving_section(
    problem: Problem, chart: Chart, u: FloatArray, max_iterations: int, limits: Sequence[float] = ()
) -> NewtonResult:
    """Find an orbit near a vector of unknowns with its keys held; if an event passes the section, on another section.

    That is what happens to guesses from chaotic motion. The other one lies in the middle of a piece between events.

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
    chart, u = moved[:2]
    return correct(problem, chart, u, fixed_border(chart), max_iterations=2 * max_iterations, halvings=4)


def fixed_border(chart: Chart) -> FloatArray:
    """Return the border with which the keys keep their values, shape (keys, m + keys)."""
    m = chart.places.size
    return np.eye(m + chart.units.size)[m:]
