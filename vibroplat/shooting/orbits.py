"""Newton's iteration for periodic orbits in compiled code, in one call: shots, Jacobian, steps.

What it finds, and why it ends, it leaves in records; see :func:`vibroplat.continuation.newton.correct`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.hybrid.modes import FLIGHT, MODES
from vibroplat.hybrid.state import OK
from vibroplat.kernels.compiled import FloatArray, borrow, call_kernel, compiled, copy, inlined
from vibroplat.kernels.linear import (
    broyden_update,
    closing_residual,
    eliminate,
    largest_size,
    project_to_section,
    take_scaled,
)
from vibroplat.model.systems import GAP, SYSTEMS
from vibroplat.shooting.shots import SET, SET_DIRECTIONS, SOLVE, ShotRecords, ask, set_parameters

#: Residual, in scaled units, beyond which the iteration is given up; longest period, in radians at the synchronous
#: speed.
MAX_RESIDUAL, MAX_PERIOD = 1e3, 1e4
#: An old Jacobian serves for another iteration while the last one divided the residual by this.
MIN_CONVERGENCE = 10.0
#: What an iteration is expected to divide the residual by: the shot after it is measured at once.
EXPECTED_CONVERGENCE = 300.0
#: Steps longer than this, in units of the unknowns, are checked for directions that the equations do not determine.
MAX_STEP = 1.0
#: Place of the angle of exciter 1 in the full state.
ANGLE_INDEX = 3

#: Why an iteration has ended: an orbit is found; there were too many iterations, or the steps do not become shorter;
#: no period, a gap that is closed, another mode on the section, a motion that ended, a residual that diverged; Python
#: has raised.
CONVERGED, UNFINISHED, BEYOND_LIMITS, NO_PERIOD, CLOSED, OTHER_MODE, ENDED, DIVERGED, RAISED = range(9)


class Chart(NamedTuple):
    """Unknowns of orbits near a state on the section, in scales: the state without the angle, the period, and keys.

    Attributes
    ----------
    base, system
        Full state on the section, shape (14,), whose angle of exciter 1 says where that is, and number of its system.
    speed, units
        Units of the period (1/s) and of the keys.
    places, scales, phase
        Places of the unknowns in the full state, their scales, shape (m,), and which of them is the period, at the
        angle's place.
    columns, sizes
        Columns of a shot's derivative that belong to the unknowns, shape (m + keys,), and its units, (m, m + keys).
    """

    base: FloatArray
    system: int
    speed: float
    units: FloatArray
    places: npt.NDArray[np.int64]
    scales: FloatArray
    phase: int
    columns: npt.NDArray[np.int64]
    sizes: FloatArray

    @classmethod
    def at(cls, base: FloatArray, system: int, speed: float, units: FloatArray, scales: FloatArray) -> Chart:
        """Make the chart about a full state in a system; the scales are those of full states, shape (14,)."""
        places = np.sort(SYSTEMS[system].places)
        phase, own = int(np.searchsorted(places, ANGLE_INDEX)), scales[places]
        columns = np.append(places, np.arange(scales.size, scales.size + units.size))
        base, sizes = np.ascontiguousarray(base), np.append(own, units) / own[:, np.newaxis]
        return cls(base, system, speed, units, places, own, phase, columns, sizes)

    def pack(self, state: FloatArray, period: float, values: Sequence[float] = ()) -> FloatArray:
        """Write a state on the section, the period (s) and the values of the keys as a vector of unknowns."""
        u = np.append(state[self.places] / self.scales, np.array(values, float) / self.units)
        u[self.phase] = period * self.speed
        return u

    def unpack(self, u: FloatArray) -> tuple[FloatArray, float, list[float]]:
        """Read state, period (s) and values from a vector of unknowns."""
        state, m = self.base.copy(), self.places.size
        state[self.places] = u[:m] * self.scales
        state[ANGLE_INDEX] = self.base[ANGLE_INDEX]
        return state, float(u[self.phase]) / self.speed, (u[m:] * self.units).tolist()

    def section_map(self, shot: Any) -> FloatArray:
        """Differentiate the map from section to section by the derivative and rates of a shot, shape (m − 1, m − 1)."""
        derivative, found = np.empty(self.sizes.shape), np.empty((self.places.size - 1,) * 2)
        take_scaled(shot.derivative, self.places, self.columns, self.sizes, derivative)
        project_to_section(derivative, shot.rates[self.places] / self.scales, self.phase, found)
        return found


class Search(NamedTuple):
    """What the iteration reads and changes.

    Attributes
    ----------
    u, turned
        Unknowns, and what a period adds to a full state, shape (14,).
    jacobian, border, slack
        Nearly the Jacobian, shape (m, m + keys), the rows under it, and the column beside it: empty, or shape (m,).
    residual, residuals
        Of the last shot, with its slack, shape (m,), and the largest of each iteration: nan for those not taken.
    limits
        Of the lengths of steps; see :func:`vibroplat.continuation.newton.correct`.
    matrix, right
        The linear equations of a step, and then their solution.
    much
        How much of the slack there is in the residual, shape (1,).
    """

    u: FloatArray
    turned: FloatArray
    jacobian: FloatArray
    border: FloatArray
    slack: FloatArray
    residual: FloatArray
    residuals: FloatArray
    limits: FloatArray
    matrix: FloatArray
    right: FloatArray
    much: FloatArray


@compiled
def newton(owned_k: ShotRecords, owned_c: Chart, owned_s: Search, known: bool, halvings: int, tolerance: float) -> int:
    """Find an orbit near the unknowns, with a residual below a tolerance; say why the iteration has ended.

    ``known`` is whether a Jacobian is. A step after which an event has passed the section is halved, so often at most.
    Only the last shot is measured; derivatives of those before may be rough.
    """
    k, c, s = borrow(owned_k), borrow(owned_c), borrow(owned_s)
    m, free = s.residual.size, s.u.size
    begun, step, raw, before = s.u.copy(), np.zeros(free), np.zeros(m), np.zeros(m)
    full, final, steps, first, length, last = not known, s.residuals.size == 1, 0, 0.0, 0.0, np.inf
    for iteration in range(s.residuals.size):
        why, full = shoot_halving(k, c, s, step, full, final, halvings if length > 0.0 else 0, raw)
        if why != CONVERGED:
            return why
        s.residuals[iteration] = size = fill_residual(s, raw)
        slow, last = size > last / MIN_CONVERGENCE, size
        if full:
            differentiate(k, c, s.jacobian)
            if size < tolerance and final:
                return CONVERGED
        if size < tolerance or (slow and not full):
            full, final = True, size < tolerance
            continue
        if length > 0.0 and not full:
            for i in range(m):
                before[i] = raw[i] - before[i]
            broyden_update(s.jacobian, step, before)
        copy(raw, before)
        if not solve_step(k, s, begun):
            return RAISED
        copy(s.right[:free], step)
        length = length_of(step)
        first, steps = length if steps == 0 else first, steps + 1
        if is_beyond(length, first, steps - 1, s.limits):
            return BEYOND_LIMITS
        for i in range(free):
            s.u[i] += step[i]
        if s.slack.size > 0:
            s.much[0] += s.right[free]
        full = final = size < EXPECTED_CONVERGENCE * tolerance
    return UNFINISHED


@inlined
def fill_residual(s: Search, raw: FloatArray) -> float:
    """Fill the residual with its slack, and return its size."""
    for i in range(raw.size):
        s.residual[i] = raw[i] + s.much[0] * s.slack[i] if s.slack.size > 0 else raw[i]
    return largest_size(s.residual)


@inlined
def is_beyond(size: float, first: float, number: int, limits: FloatArray) -> bool:
    """Whether a size is beyond the limit of its number, relative to the first one, number 0."""
    return number > 0 and limits.size > 0 and size > first * limits[min(number, limits.size) - 1]


@inlined
def shoot_halving(
    k: ShotRecords, c: Chart, s: Search, step: FloatArray, full: bool, final: bool, left: int, residual: FloatArray
) -> tuple[int, bool]:
    """Take a shot after a step, which is halved, so often at most, while an event has passed the section.

    Returns what is the matter, CONVERGED for nothing, and whether the shot is full.
    """
    why = take_shot(k, c, s, full, final, residual)
    while why in (CLOSED, OTHER_MODE) and left > 0:
        left, full = left - 1, True
        for i in range(step.size):
            step[i] *= 0.5
            s.u[i] -= step[i]
        why = take_shot(k, c, s, full, final, residual)
    return why, full


@compiled
def take_shot(k: ShotRecords, c: Chart, s: Search, full: bool, final: bool, residual: FloatArray) -> int:
    """Take a shot from the unknowns, ``full`` with derivative, ``final`` measured; what is the matter, or CONVERGED."""
    m, state = residual.size, c.base.copy()
    for i in range(m):
        state[c.places[i]] = s.u[i] * c.scales[i]
    state[ANGLE_INDEX] = c.base[ANGLE_INDEX]
    period = s.u[c.phase] / c.speed
    if not period > 0.0 or period * c.speed > MAX_PERIOD:
        return NO_PERIOD
    if MODES[c.system] == FLIGHT and state[GAP] <= 0.0:
        return CLOSED
    for i in range(c.units.size):
        k.values[i] = s.u[m + i] * c.units[i]
    if c.units.size > 0 and not (set_parameters(k, k.values[0]) or ask(k, SET_DIRECTIONS if full else SET)):
        return RAISED
    call_kernel(k.shoot, (k, state, period, full, final, final))
    if k.h.run.outcome != OK:
        return ENDED
    if not k.shot.begins == k.shot.ends == c.system:
        return OTHER_MODE
    closing_residual(k.end, state, s.turned, c.places, c.scales, residual)
    return CONVERGED if largest_size(residual) < MAX_RESIDUAL else DIVERGED


@inlined
def differentiate(k: ShotRecords, c: Chart, jacobian: FloatArray) -> None:
    """Differentiate the residual of a full shot by the unknowns."""
    take_scaled(k.variation.s, c.places, c.columns, c.sizes, jacobian)
    for i in range(c.places.size):
        jacobian[i, i] -= 1.0
    for i in range(c.places.size):
        jacobian[i, c.phase] = k.variation.rates[c.places[i]] / c.scales[i] / c.speed


@inlined
def solve_step(k: ShotRecords, s: Search, begun: FloatArray) -> bool:
    """Solve for Newton's step, by Python where the equations are nearly singular; False if it has raised."""
    m, free, n = s.residual.size, s.u.size, s.right.size
    for i in range(m):
        s.right[i] = -s.residual[i]
        for j in range(free):
            s.matrix[i, j] = s.jacobian[i, j]
        if n > free:
            s.matrix[i, free] = s.slack[i]
    for i in range(n - m):
        away = 0.0
        for j in range(free):
            s.matrix[m + i, j] = s.border[i, j]
            away += s.border[i, j] * (s.u[j] - begun[j])
        s.right[m + i] = -away
    found = s.right.copy()
    if abs(eliminate(s.matrix.copy(), found)) > 0.0 and length_of(found) <= MAX_STEP:
        copy(found, s.right)
        return True
    return ask(k, SOLVE)


@inlined
def length_of(values: FloatArray) -> float:
    """Euclidean length."""
    square = 0.0
    for value in values:
        square += value**2
    return math.sqrt(square)
