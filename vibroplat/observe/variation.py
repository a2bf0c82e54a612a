"""The derivative of a motion's state by its start and by keys of its scene, carried along steps and through jumps.

Within a piece the variational equations are solved by collocation (:mod:`vibroplat.observe.collocation`), with
derivatives of the model along the polynomials of the steps. At an event the time changes with the start as well: with
t_e its derivative and f⁻, f⁺ the rates before and after, S⁻ + f⁻ t_e goes through the derivative of the jump and comes
out as S⁺ + f⁺ t_e (the saltation matrix of Aizerman and Gantmakher 1958; Müller 1995). A liftoff needs none of this:
all rates are continuous there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import carray  # type: ignore[attr-defined]

from vibroplat.hybrid.modes import ATTACHED, CHATTER, IMPACT
from vibroplat.hybrid.state import Automaton, Steps
from vibroplat.kernels.compiled import FloatArray, borrow, compiled, copy, inlined, pointer, quick_call
from vibroplat.kernels.elimination import whole_lanes
from vibroplat.kernels.polynomial import values
from vibroplat.model.accelerations import accelerations, linearize
from vibroplat.model.equations import rows
from vibroplat.model.impact import chatter_map, impact
from vibroplat.model.parameters import Parameters
from vibroplat.model.sensitivity import COMPLEX, IMAGINARY, flat
from vibroplat.model.systems import ALGEBRAIC, DIFFERENTIAL, FULL_SIZE, GAP, GAP_RATE, PLACES, SIZES, gather, scatter
from vibroplat.observe.collocation import (
    GROWTH,
    METHODS,
    POINT,
    POINTS,
    Linear,
    Radau,
    collocate,
    linear,
    step_of,
    steps_of,
)

#: Size of a derivative beyond which it says nothing.
SENSELESS = 1e24
#: Longest step of the collocation, over a step of the engine that lies in it: of high order, and of a low one, whose
#: polynomials have at most that degree.
REACH, FAR_REACH, LOW_DEGREE = 1.0, 8.0, 8
#: Part of a piece that round-off may leave.
_LEFT = 1e-12


class VariationalState(NamedTuple):
    """What the kernels carry along; what follows ``rough`` is overwritten at each step of the collocation.

    Attributes
    ----------
    s
        Derivative of the full state, shape (14, columns) in whole lanes: at a fixed time, or at the last event.
    event_time_derivative
        Derivative of that event's time, shape (columns,).
    at_event
        Whether ``s`` is that at the event, shape (1,).
    rates
        Of the full state where the derivative has last left an event or arrived, shape (14,).
    step
        First and longest step of the collocation in a piece (s), shape (2,).
    perturbed_parameters
        Parameters p + ih dp, shape (1 + keys,): the first is without dp.
    numbers, directions
        Their numbers, shape (1 + keys, n), and dp, shape (1 + keys, n).
    methods
        One for each entry of POINTS.
    rough
        1 to have the second of them in the longest steps too, at a third of the cost; shape (1,).
    y, yp
        Unknowns of a system and their rates.
    residual
        What the parameters' derivatives leave of the equations, complex, shape (14,).
    equations
        The linear system of a step.
    part
        Rows of ``s`` that the system has, shape (14, columns).
    """

    s: FloatArray
    event_time_derivative: FloatArray
    at_event: Any
    rates: FloatArray
    step: FloatArray
    perturbed_parameters: Any
    numbers: Any
    directions: FloatArray
    methods: tuple[Radau, ...]
    rough: Any
    y: FloatArray
    yp: FloatArray
    residual: Any
    equations: Linear
    part: FloatArray


class Variation:
    """Observes a motion: carries the derivative of its state along.

    Parameters
    ----------
    directions
        Derivatives of the parameters by keys: see :func:`vibroplat.model.sensitivity.parameter_direction`.
    rough
        Whether errors of 3e-5 in a turn will do.
    """

    def __init__(self, directions: Sequence[Parameters] = (), *, rough: bool = False) -> None:
        self._follow, self._arrive, self._perturb = quick_call(follow), quick_call(arrive), quick_call(perturb)
        perturbed = np.zeros(1 + len(directions), COMPLEX)
        numbers = flat(perturbed)
        self._columns = FULL_SIZE + len(directions)
        columns = whole_lanes(self._columns)
        self.carried = VariationalState(
            s=np.zeros((FULL_SIZE, columns)),
            event_time_derivative=np.zeros(columns),
            at_event=np.zeros(1, np.int64),
            rates=np.zeros(FULL_SIZE),
            step=np.ones(2),
            perturbed_parameters=perturbed,
            numbers=numbers,
            directions=np.zeros(numbers.shape),
            methods=METHODS,
            rough=np.array([int(rough)]),
            y=np.zeros(FULL_SIZE),
            yp=np.zeros(FULL_SIZE),
            residual=np.zeros(FULL_SIZE, np.complex128),
            equations=linear(columns, len(directions)),
            part=np.zeros((FULL_SIZE, columns)),
        )
        self.begin(np.eye(FULL_SIZE), [flat(direction) for direction in directions])

    def begin(self, start: FloatArray, directions: Sequence[FloatArray] = ()) -> None:
        """Begin anew with the derivative of the full state by up to 14 numbers, shape (14, m).

        If they are given, directions are other ones, as :func:`vibroplat.model.sensitivity.flat` views them.
        """
        carried = self.carried
        carried.s[:], carried.event_time_derivative[:], carried.at_event[0] = 0.0, 0.0, 0
        carried.s[:, : start.shape[1]] = start
        self.turn(directions)

    def turn(self, directions: Sequence[FloatArray]) -> None:
        """Let directions be other ones, if they are given."""
        for row, direction in enumerate(directions, 1):
            self.carried.directions[row] = direction

    def read(self, h: Automaton) -> None:
        """Go along the closed pieces, and through the events."""
        self.update_parameters(h)
        self._follow(h, self.carried)

    def derivative(self, h: Automaton) -> FloatArray:
        """Find the derivative of the motion's full state now, shape (14, 14 + keys)."""
        self.update_parameters(h)
        self._arrive(h, self.carried)
        return self.arrived

    @property
    def arrived(self) -> FloatArray:
        """The last :meth:`derivative` that was asked for, or that compiled code has left."""
        derivative: FloatArray = self.carried.s[:, : self._columns].copy()
        return derivative

    @property
    def rates(self) -> FloatArray:
        """Rates of the full state, shape (14,), where the last :meth:`derivative` was asked for."""
        return self.carried.rates.copy()

    def update_parameters(self, h: Automaton) -> None:
        """Follow the parameters, which a drive's program changes."""
        self._perturb(h, self.carried)


@compiled
def perturb(h: Automaton, v: VariationalState) -> None:
    """Let the parameters that are varied, and what follows from them, be those of a motion now."""
    p, width = carray(pointer(h.parameters), (v.directions.shape[1],)), v.directions.shape[1]
    v.step[0], v.step[1] = steps_of(h.p, h.run.period)
    for k in range(v.directions.shape[0]):
        for j in range(width):
            v.numbers[k, j] = p[j] + 1j * IMAGINARY * v.directions[k, j]
        v.perturbed_parameters[k].safe_rotation = h.p.safe_rotation
        v.perturbed_parameters[k].impact_law = h.p.impact_law


@inlined
def begin_full(v: VariationalState) -> None:
    """Begin anew with the derivative of the full state by all of its numbers."""
    v.at_event[0] = 0
    for j in range(v.event_time_derivative.size):
        v.event_time_derivative[j] = 0.0
        for i in range(FULL_SIZE):
            v.s[i, j] = 1.0 if i == j else 0.0


@compiled
def follow(owned_h: Automaton, owned_v: VariationalState) -> None:
    """Go along the closed pieces of a motion and through the events between them."""
    h, v = borrow(owned_h), borrow(owned_v)
    steps, count, event = h.steps, h.run.events, 0
    for k in range(steps.used.pieces):
        piece = steps.pieces[k]
        after = steps.pieces[k + 1].events if k + 1 < steps.used.pieces else count
        event = piece.events
        if event < after and h.events[event].kind == CHATTER:
            through_chatter(steps, piece, h.p, v)
            event += 1
        else:
            enter_piece(piece.system, piece.origin + steps.start[piece.first], steps.c[piece.first, 0], h.p, v)
            carry_along_piece(steps, piece, h.p, v)
        drop_overflowed_columns(v)
        while event < after:
            if h.events[event].kind == IMPACT:
                through_impact(steps, piece, h.events[event], h.run.slowest, h.p, v)
            event += 1


@inlined
def drop_overflowed_columns(v: VariationalState) -> None:
    """Leave no number in columns that have grown beyond sense: imaginary parts would no longer be small at an impact.

    A change of 1e-16 has long become larger than the platform by then.
    """
    for j in range(v.event_time_derivative.size):
        largest = 0.0
        for i in range(FULL_SIZE):
            largest = max(largest, abs(v.s[i, j]))
        for i in range(FULL_SIZE if largest > SENSELESS else 0):
            v.s[i, j] = np.nan


@compiled
def arrive(owned_h: Automaton, owned_v: VariationalState) -> None:
    """Leave the last event, if the motion has ended there, with the rates of the end."""
    h, v = borrow(owned_h), borrow(owned_v)
    system = h.run.systems[h.run.mode]
    gather(system, h.run.state, v.yp)
    rates_of(system, h.run.now, v.yp, v.rates, h.p, v)
    to_fixed_time(v)


@compiled
def enter_piece(system: int, t: float, start: FloatArray, p: Parameters, v: VariationalState) -> None:
    """Leave an event, if the derivative is at one, for the piece that begins with these unknowns."""
    if v.at_event[0] == 1:
        rates_of(system, t, start, v.rates, p, v)
        to_fixed_time(v)


@compiled
def to_fixed_time(v: VariationalState) -> None:
    """Turn a derivative at an event into one at a fixed time, by the rates after the event."""
    if v.at_event[0] == 0:
        return
    v.at_event[0] = 0
    for i in range(FULL_SIZE):
        for j in range(v.event_time_derivative.size):
            v.s[i, j] -= v.rates[i] * v.event_time_derivative[j]


@compiled
def rates_of(
    system: int, t: float, unknowns: FloatArray, rates: FloatArray, p: Parameters, v: VariationalState
) -> None:
    """Fill the rates of the full state at a system's unknowns; ``v.y`` and ``v.yp`` are left with them, consistent."""
    size = SIZES[system]
    y, yp = v.y[:size], v.yp[:size]
    for i in range(DIFFERENTIAL[system]):
        y[i] = unknowns[i]
    accelerations(system, t, y, yp, p)
    scatter(system, yp, rates)


@compiled
def carry_along_piece(steps: Steps, piece: Any, p: Parameters, v: VariationalState) -> None:
    """Carry the derivative along the steps of a piece."""
    system, first, last = piece.system, piece.first, piece.end - 1
    begin = steps.start[first]
    duration = steps.start[last] + steps.length[last] - begin
    if duration <= 0.0:
        return
    row, n = first, DIFFERENTIAL[system] // 2
    method = v.methods[2]
    if duration < POINTS[0][0] * v.step[0]:
        method = v.methods[0]
    elif v.rough[0] == 1 or duration < POINTS[1][0] * v.step[0]:
        method = v.methods[1]
    for i in range(2 * n):
        copy(v.s[PLACES[system, i]], v.part[i])
    done, step = 0.0, v.step[0]
    while duration - done > _LEFT * duration:
        length = limit_to_steps(steps, row, last, begin + done, step_of(step, duration - done, v.step[1]))
        for i in range(method.nodes.size):
            at = begin + done + method.nodes[i] * length
            while row < last and at > steps.start[row] + steps.length[row]:
                row += 1
            share = min((at - steps.start[row]) / steps.length[row], 1.0)
            values(steps.c[row], steps.c.shape[1] - 1, share, v.y[: 2 * n])
            differentiate(system, piece.origin + at, i, p, v)
        collocate(n, length, method, v.equations, v.part)
        done += length
        step *= GROWTH
    for i in range(FULL_SIZE):
        for j in range(v.event_time_derivative.size):
            v.s[i, j] = 0.0
    for i in range(2 * n):
        copy(v.part[i], v.s[PLACES[system, i]])


@inlined
def limit_to_steps(steps: Steps, row: int, last: int, now: float, length: float) -> float:
    """Shorten a step of the collocation to what the engine's own steps allow, the first of which is ``row`` or later.

    These are short where a motion changes quickly, as where a stiff motor passes its critical slip or an exciter turns
    faster than its supply. The last one was cut, and says nothing.
    """
    reach = REACH if steps.c.shape[1] - 1 > LOW_DEGREE else FAR_REACH
    while row < last and steps.start[row] < now + length:
        if steps.start[row] + steps.length[row] > now:
            length = min(length, max(steps.start[row] - now, 0.0) + reach * steps.length[row])
        row += 1
    return length


@compiled
def differentiate(system: int, t: float, point: int, p: Parameters, v: VariationalState) -> None:
    """Linearize the equations of motion at the unknowns in ``v.y``, and differentiate them by the parameters."""
    size = SIZES[system]
    n = size // 2
    y, yp, e = v.y[:size], v.yp[:size], v.equations
    linearize(system, t, y, yp, e.jac[point], e.mass[point], p)
    if v.perturbed_parameters.size == 1:
        return
    for k in range(v.perturbed_parameters.size - 1):
        rows(system, t, y, yp, v.residual, v.perturbed_parameters[k + 1])
        for r in range(n):
            e.forced[point, r, k] = -v.residual[n + r].imag / IMAGINARY
        if ALGEBRAIC[system]:
            e.forced[point, 1, k] -= v.residual[2 * n].imag / IMAGINARY


@inlined
def is_zero(s: FloatArray, j: int) -> bool:
    """Whether nothing is carried in a column, as where few directions are followed: so it stays."""
    i = 0
    while i < FULL_SIZE and s[i, j] == 0.0:
        i += 1
    return i == FULL_SIZE


@compiled
def through_impact(steps: Steps, piece: Any, event: Any, slowest: float, p: Parameters, v: VariationalState) -> None:
    """Carry the derivative through an impact, to the event.

    An impact slower than ``slowest`` that ends in contact is treated as uninterrupted contact. An impact of zero speed
    leaves the derivative unchanged.
    """
    attached = event.mode_after == ATTACHED
    if -event.rate_before < slowest and event.rate_after == 0.0 and attached:
        for j in range(v.event_time_derivative.size):
            v.s[GAP, j] = v.s[GAP_RATE, j] = 0.0
        return
    if event.rate_before == 0.0:
        return
    state, rates = np.empty(FULL_SIZE), np.empty(FULL_SIZE)
    ends = steps.ends[piece.end - 1]
    scatter(piece.system, ends, state)
    rates_of(piece.system, event.t, ends, rates, p, v)
    state[GAP], state[GAP_RATE] = 0.0, event.rate_before
    rates[GAP] = event.rate_before
    before: Any = np.empty(FULL_SIZE, np.complex128)
    after: Any = np.empty(FULL_SIZE, np.complex128)
    sticks = -event.rate_before < p.sticking_speed or (event.rate_after == 0.0 and p.restitution > 0.0)
    v.at_event[0] = 1
    for j in range(FULL_SIZE + v.perturbed_parameters.size - 1):
        if j < FULL_SIZE and is_zero(v.s, j):
            v.event_time_derivative[j] = 0.0
            continue
        delay = -v.s[GAP, j] / event.rate_before
        v.event_time_derivative[j] = delay
        for i in range(FULL_SIZE):
            before[i] = state[i] + 1j * IMAGINARY * (v.s[i, j] + rates[i] * delay)
        before[GAP] = 0.0
        perturbed = v.perturbed_parameters[max(j - FULL_SIZE + 1, 0)]
        restitution = 0.0 * perturbed.restitution if sticks else perturbed.restitution
        impact(before, after, restitution, perturbed)
        for i in range(FULL_SIZE):
            v.s[i, j] = after[i].imag / IMAGINARY
    if not sticks and event.rate_after == 0.0 and attached:
        # what a restitution beside 0 would add to an inelastic impact: impacts that accumulate at once
        for i in range(FULL_SIZE):
            state[i] = after[i].real
        differentiate_chatter(piece.system, event.t, state, FULL_SIZE, p, v)


@compiled
def through_chatter(steps: Steps, piece: Any, p: Parameters, v: VariationalState) -> None:
    """Carry the derivative through impacts that accumulate, from the event at which they begin to where they end."""
    state = np.empty(FULL_SIZE)
    first = piece.first
    scatter(piece.system, steps.c[first, 0], state)
    state[GAP] = 0.0
    if v.at_event[0] == 0:  # the motion began with them
        v.at_event[0] = 1
        for j in range(v.event_time_derivative.size):
            v.event_time_derivative[j] = 0.0
    differentiate_chatter(piece.system, piece.origin + steps.start[first], state, 0, p, v)


@compiled
def differentiate_chatter(
    system: int, t: float, state: FloatArray, first: int, p: Parameters, v: VariationalState
) -> None:
    """Differentiate chatter, from the event before it to that at its end, in the columns from the first on."""
    n = DIFFERENTIAL[system] // 2
    start, rates = np.empty(FULL_SIZE), np.empty(FULL_SIZE)
    gather(system, state, start)
    rates_of(system, t, start, rates, p, v)
    differentiate(system, t, 0, p, v)
    for i in range(2 * n):
        copy(v.s[PLACES[system, i]], v.part[i])
    collocate(n, 0.0, POINT, v.equations, v.part)
    moved: Any = np.empty(FULL_SIZE, np.complex128)
    after: Any = np.empty(FULL_SIZE, np.complex128)
    perturbed: Any = np.empty(FULL_SIZE // 2, np.complex128)
    change = np.zeros(FULL_SIZE)
    for j in range(first, FULL_SIZE + v.perturbed_parameters.size - 1):
        if j < FULL_SIZE and is_zero(v.s, j):
            continue
        for i in range(n):
            change[PLACES[system, n + i]] = v.equations.matrix[i, whole_lanes(n) + j]
        for i in range(FULL_SIZE):
            moved[i] = state[i] + 1j * IMAGINARY * v.s[i, j]
        for i in range(FULL_SIZE // 2):
            perturbed[i] = rates[7 + i] + 1j * IMAGINARY * change[7 + i]
        duration, _, _ = chatter_map(moved, perturbed, after, v.perturbed_parameters[max(j - FULL_SIZE + 1, 0)])
        v.event_time_derivative[j] += duration.imag / IMAGINARY
        for i in range(FULL_SIZE):
            v.s[i, j] = after[i].imag / IMAGINARY
