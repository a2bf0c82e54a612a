"""The derivative of a motion's state by its start and by keys of its scene, carried along steps and through jumps.

Within a piece the variational equations Ṡ = (∂f/∂x) S + ∂f/∂p are solved by collocation at Radau's points, whose
derivatives come from the model along the polynomials of the steps; the method is L-stable, so that a stiff layer does
no harm. At an event the time changes with the start as well: with t_e its derivative and f⁻, f⁺ the rates before and
after, S⁻ + f⁻ t_e goes through the derivative of the jump and comes out as S⁺ + f⁺ t_e (the saltation matrix of
Aizerman and Gantmakher 1958; Müller 1995). A liftoff needs none of this: all rates are continuous there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from vibroplat.hybrid.modes import ATTACHED, IMPACT, LATCH
from vibroplat.hybrid.state import Automaton, Steps
from vibroplat.kernels.compiled import FloatArray, borrow, compiled, copy, fused, inlined
from vibroplat.kernels.lanes import in_lines, reduce_16
from vibroplat.kernels.linear import pivot_row
from vibroplat.kernels.polynomial import values
from vibroplat.model.accelerations import accelerations, linearize, solve
from vibroplat.model.equations import rows
from vibroplat.model.impact import impact, latch
from vibroplat.model.parameters import Parameters
from vibroplat.model.sensitivity import CHOICES, COMPLEX, IMAGINARY, flat
from vibroplat.model.systems import (
    DIFFERENTIAL,
    FULL_SIZE,
    GAP,
    GAP_RATE,
    PLACES,
    SIZES,
    gather,
    scatter,
)

#: Parameters by which a state is differentiated at a time, and columns: those of the start, then of the parameters.
MOST_KEYS = 2
COLUMNS = FULL_SIZE + MOST_KEYS
#: Columns that are reduced at once: those of the right-hand sides are as many.
LANE = 16

#: Longest step of the collocation, as a part of a turn of the synchronous speed and times the quickest natural
#: frequency (rad/s), and its points. Beside differences, derivatives over a turn are good to 1e-9 with 16 steps in a
#: turn at 50 Hz, of 5 points, and to 3e-6 with 3 points; with 1.4 rad in a step they were good to 1e-6 only. Pieces
#: much shorter than a step, as between impacts that accumulate, take fewer points.
STEP, ANGLE = 1.0 / 10.0, 0.9
#: What decays quickly is large after an event, and matters: the first step of a piece is at most ANGLE over the
#: quickest decay rate, and each is at most so many times as long as the one before. Without, derivatives beside a
#: critically damped layer of 1000 Hz were wrong by 3 %.
GROWTH = 2.0
POINTS = ((1.0 / 40.0, 2), (1.0 / 6.0, 3), (math.inf, 5))
_MOST_POINTS = POINTS[-1][1]

#: Part of a piece that round-off may leave.
_LEFT = 1e-12
#: Critical slip speed below which a motor's steepness is not followed (rad/s).
_SLOWEST = 1e-3


class Radau(NamedTuple):
    """Radau IIA collocation with so many points on (0, 1], the last of them 1.

    Attributes
    ----------
    nodes
        The points, shape (n,).
    once, twice
        Integrals of the Lagrange polynomials from 0 to each point, and integrals of these, shape (n, n).
    """

    nodes: FloatArray
    once: FloatArray
    twice: FloatArray


def radau(points: int) -> Radau:
    """Find the points of Radau IIA, zeros of P_n − P_{n−1} shifted to [0, 1] (Hairer and Wanner 1996, IV.5)."""
    legendre = np.polynomial.legendre.Legendre.basis
    nodes = np.sort((legendre(points) - legendre(points - 1)).roots().real) * 0.5 + 0.5
    nodes[-1] = 1.0
    powers = np.arange(points)
    once = (nodes[:, np.newaxis] ** (powers + 1) / (powers + 1)) @ np.linalg.inv(nodes[:, np.newaxis] ** powers)
    return Radau(nodes, once, once @ once)


METHODS = tuple(radau(points) for _, points in POINTS)
#: The same with 3 points in the longest steps too, at a third of the cost.
ROUGH_METHODS = (*METHODS[:2], METHODS[1])


class Room(NamedTuple):
    """What is overwritten at each step of the collocation."""

    y: FloatArray
    yp: FloatArray
    slopes: FloatArray
    a: FloatArray  # (points, 7, 14) derivatives of the accelerations by the unknowns
    b: FloatArray  # (points, 7, MOST_KEYS) by the parameters
    matrix: FloatArray  # (points · 7, whole lanes for points · 7, then COLUMNS)
    part: FloatArray  # (14, COLUMNS) unknowns of the system


class Carried(NamedTuple):
    """What the kernels carry along.

    Attributes
    ----------
    s
        Derivative of the full state, shape (14, COLUMNS): at a fixed time, or at the last event.
    late
        Derivative of that event's time, shape (COLUMNS,).
    at_event
        Whether ``s`` is that at the event, shape (1,).
    step
        First and longest step of the collocation in a piece (s), shape (2,).
    turned
        Parameters p + ih dp, shape (2, 1 + keys): the first column is without dp, the second row without restitution.
    room
        See :class:`Room`.
    methods
        One for each entry of POINTS.
    """

    s: FloatArray
    late: FloatArray
    at_event: Any
    step: FloatArray
    turned: Any
    room: Room
    methods: tuple[Radau, ...]


def _room() -> Room:
    equations = _MOST_POINTS * FULL_SIZE // 2
    return Room(
        np.zeros(FULL_SIZE),
        np.zeros(FULL_SIZE),
        np.zeros((FULL_SIZE, FULL_SIZE)),
        np.zeros((_MOST_POINTS, FULL_SIZE // 2, FULL_SIZE)),
        np.zeros((_MOST_POINTS, FULL_SIZE // 2, MOST_KEYS)),
        in_lines((equations, behind(equations) + COLUMNS)),
        np.zeros((FULL_SIZE, COLUMNS)),
    )


class Variation:
    """Observes a motion: carries the derivative of its state along.

    Parameters
    ----------
    directions
        Derivatives of the parameters by keys, at most two; see :func:`vibroplat.model.sensitivity.parameter_direction`.
    rough
        Whether errors of 3e-5 in a turn will do.
    """

    def __init__(self, directions: Sequence[Parameters] = (), *, rough: bool = False) -> None:
        self._of = b""  # the parameters that ``turned`` was made of
        self._given: tuple[Any, ...] = ()  # their records, and views of their numbers
        turned = np.zeros((2, 1 + len(directions)), COMPLEX)
        self._numbers = flat(turned)
        self._directions: FloatArray = np.zeros(self._numbers.shape[1:])
        self._columns = FULL_SIZE + len(directions)
        methods = ROUGH_METHODS if rough else METHODS
        self._carried = Carried(
            np.zeros((FULL_SIZE, COLUMNS)),
            np.zeros(COLUMNS),
            np.zeros(1, np.int64),
            np.ones(2),
            turned,
            _room(),
            methods,
        )
        self.begin(np.eye(FULL_SIZE), directions)

    def begin(self, start: FloatArray, directions: Sequence[Parameters] | None = None) -> None:
        """Begin anew with the derivative of the full state by up to 14 numbers, shape (14, m); other keys if given."""
        carried = self._carried
        carried.s[:], carried.late[:], carried.at_event[0] = 0.0, 0.0, 0
        carried.s[:, : start.shape[1]] = start
        if directions is not None:
            for row, direction in zip(self._directions[1:], directions, strict=True):
                row[:] = flat(direction)
            self._of = b""

    def read(self, h: Automaton) -> None:
        """Go along the closed pieces, and through the events."""
        self._turn(h)
        follow(h, self._carried)

    def derivative(self, h: Automaton) -> FloatArray:
        """Find the derivative of the motion's full state now, shape (14, 14 + keys)."""
        self._turn(h)
        arrive(h, self._carried)
        found: FloatArray = self._carried.s[:, : self._columns].copy()
        return found

    def _turn(self, h: Automaton) -> None:
        """Follow the parameters, which a drive's program changes."""
        now = h.p.tobytes()
        if now == self._of:
            return
        self._of, turned = now, self._carried.turned
        self._carried.step[:] = steps_of(h.p, float(h.run["period"]))
        if not self._given or self._given[0] is not h.p:
            self._given = h.p, flat(h.p), flat(h.inelastic)
        self._numbers.imag = IMAGINARY * self._directions
        self._numbers.real[0], self._numbers.real[1] = self._given[1:]
        for name in CHOICES:
            turned[name] = h.p[name]
        turned["restitution"][1] = 0.0


@compiled
def steps_of(p: Parameters, period: float) -> tuple[float, float]:
    """First and longest step of the collocation in a piece (s).

    The longest resolves turns of a period (s) and the oscillations of platform and layers, each taken alone; what is
    damped too strongly to oscillate does not shorten it.
    """
    layers = 1.0 + p.upper_mass / p.lower_mass if p.lower_mass > 0.0 else 0.0
    quickest, decay = 0.0, 0.0
    for stiffness, damping in (
        (p.stiffness_x / p.mass, p.damping_x / p.mass),
        (p.stiffness_y / p.mass, p.damping_y / p.mass),
        (p.stiffness_phi / p.inertia, p.damping_phi / p.inertia),
        (layers * p.layer_stiffness, layers * p.layer_damping),
    ):
        bend = stiffness - 0.25 * damping**2
        quickest = max(quickest, math.sqrt(max(bend, 0.0)))
        decay = max(decay, 0.5 * damping + math.sqrt(max(-bend, 0.0)))
    for i in range(2):
        decay = max(decay, 2.0 * p.torque[i] / max(p.slip_speed[i], _SLOWEST) / p.exciter_inertia[i])
    longest = min(STEP * period, ANGLE / quickest if quickest > 0.0 else math.inf)
    return min(longest, ANGLE / decay if decay > 0.0 else math.inf), longest


@compiled
def follow(owned_h: Automaton, owned_v: Carried) -> None:
    """Go along the closed pieces of a motion and through the events between them."""
    h, v = borrow(owned_h), borrow(owned_v)
    steps, count, event = h.steps, h.run.events, 0
    for k in range(steps.used.pieces):
        piece = steps.pieces[k]
        after = steps.pieces[k + 1].events if k + 1 < steps.used.pieces else count
        event = piece.events
        if event < after and h.events[event].kind == LATCH:
            through_latch(steps, piece, h.p, v)
            event += 1
        else:
            settle(piece.system, piece.origin + steps.start[piece.first], steps.c[piece.first, 0], h.p, v)
            along(steps, piece, h.p, v)
        while event < after:
            if h.events[event].kind == IMPACT:
                through_impact(steps, piece, h.events[event], h.run.slowest, h.p, v)
            event += 1


@compiled
def arrive(owned_h: Automaton, owned_v: Carried) -> None:
    """Leave the last event, if the motion has ended there."""
    h, v = borrow(owned_h), borrow(owned_v)
    system = h.run.systems[h.run.mode]
    gather(system, h.run.state, v.room.yp)
    settle(system, h.run.now, v.room.yp, h.p, v)


@compiled
def settle(system: int, t: float, start: FloatArray, p: Parameters, v: Carried) -> None:
    """Turn a derivative at an event into one at a fixed time, by the rates of the piece that begins."""
    if v.at_event[0] == 0:
        return
    v.at_event[0] = 0
    rates = np.empty(FULL_SIZE)
    rates_of(system, t, start, rates, p, v.room)
    for i in range(FULL_SIZE):
        for j in range(COLUMNS):
            v.s[i, j] -= rates[i] * v.late[j]


@compiled
def rates_of(system: int, t: float, unknowns: FloatArray, rates: FloatArray, p: Parameters, room: Room) -> None:
    """Fill the rates of the full state at a system's unknowns; ``room`` is left with them, consistent."""
    size = SIZES[system]
    y, yp = room.y[:size], room.yp[:size]
    for i in range(DIFFERENTIAL[system]):
        y[i] = unknowns[i]
    accelerations(system, t, y, yp, p)
    scatter(system, yp, rates)


@compiled
def along(steps: Steps, piece: Any, p: Parameters, v: Carried) -> None:
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
    elif duration < POINTS[1][0] * v.step[0]:
        method = v.methods[1]
    for i in range(2 * n):
        copy(v.s[PLACES[system, i]], v.room.part[i])
    done, step = 0.0, v.step[0]
    while duration - done > _LEFT * duration:
        length = step_of(step, duration - done, v.step[1])
        for i in range(method.nodes.size):
            at = begin + done + method.nodes[i] * length
            while row < last and at > steps.start[row] + steps.length[row]:
                row += 1
            share = min((at - steps.start[row]) / steps.length[row], 1.0)
            values(steps.c[row], steps.c.shape[1] - 1, share, v.room.y[: 2 * n])
            differentiate(system, piece.origin + at, i, p, v)
        collocate(n, length, method, v.room)
        done += length
        step *= GROWTH
    for i in range(FULL_SIZE):
        for j in range(COLUMNS):
            v.s[i, j] = 0.0
    for i in range(2 * n):
        copy(v.room.part[i], v.s[PLACES[system, i]])


@inlined
def step_of(step: float, left: float, longest: float) -> float:
    """Length of a step that may grow up to the longest; from there on the time left is divided evenly (s)."""
    if step >= longest:
        return left / math.ceil(left / longest)
    return min(step, left)


@compiled
def differentiate(system: int, t: float, point: int, p: Parameters, v: Carried) -> None:
    """Differentiate the accelerations at the unknowns in ``room.y`` by these and by the parameters."""
    size = SIZES[system]
    n = size // 2
    room = v.room
    y, yp = room.y[:size], room.yp[:size]
    accelerations(system, t, y, yp, p)
    linearize(system, t, y, yp, room.slopes[: 2 * n, :size], p)
    for i in range(n):
        for j in range(2 * n):
            room.a[point, i, j] = room.slopes[j, n + i]
    if v.turned.shape[1] > 1:
        by_parameters(system, t, point, y, yp, p, v)


@compiled
def by_parameters(system: int, t: float, point: int, y: FloatArray, yp: FloatArray, p: Parameters, v: Carried) -> None:
    """Differentiate the accelerations by the parameters: A ∂z/∂p = −∂F/∂p at a fixed state."""
    size = y.size
    n = size // 2
    residual: Any = np.empty(size, np.complex128)
    z = np.empty(size)
    for k in range(v.turned.shape[1] - 1):
        rows(system, t, y, yp, residual, v.turned[0, k + 1])
        for i in range(size):
            z[i] = -residual[i].imag / IMAGINARY if i >= n else 0.0
        solve(system, y, z, p)
        for i in range(n):
            v.room.b[point, i, k] = z[n + i]


@fused
def collocate(n: int, h: float, method: Radau, room: Room) -> None:
    """Carry the derivatives of n coordinates and their rates, in ``room.part``, over a step.

    The unknowns of the linear system are the derivatives of the accelerations at the points.
    """
    points, s = method.nodes.size, room.part
    m = points * n
    right = behind(m)
    for i in range(points):
        lead = h * method.nodes[i]
        for r in range(n):
            row = room.matrix[i * n + r]
            for j in range(points):
                twice, once = h * h * method.twice[i, j], h * method.once[i, j]
                for c in range(n):
                    row[j * n + c] = -twice * room.a[i, r, c] - once * room.a[i, r, n + c]
            row[i * n + r] += 1.0
            for k in range(COLUMNS):
                row[right + k] = 0.0
            for c in range(n):
                stiffness, damping = room.a[i, r, c], room.a[i, r, n + c] + lead * room.a[i, r, c]
                for k in range(COLUMNS):
                    row[right + k] += stiffness * s[c, k] + damping * s[n + c, k]
            for k in range(MOST_KEYS):
                row[right + FULL_SIZE + k] += room.b[i, r, k]
    eliminate(room.matrix, m)
    last = points - 1
    for c in range(n):
        for k in range(COLUMNS):
            s[c, k] += h * s[n + c, k]
        for i in range(points):
            twice, once = h * h * method.twice[last, i], h * method.once[last, i]
            for k in range(COLUMNS):
                found = room.matrix[i * n + c, right + k]
                s[c, k] += twice * found
                s[n + c, k] += once * found


@inlined
def behind(m: int) -> int:
    """Column at which the right-hand sides of m equations begin."""
    return -(-m // LANE) * LANE


@fused
def eliminate(matrix: FloatArray, m: int) -> None:
    """Solve m linear equations for COLUMNS right-hand sides, which stand behind the matrix and become the solutions.

    Rows are reduced in whole lanes: what that leaves before the diagonal is never read.
    """
    right = behind(m)
    for k in range(m):
        first = k // LANE * LANE
        best = pivot_row(matrix[:m], k)
        if best != k:
            for j in range(first, right + COLUMNS):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
        inverse = 1.0 / matrix[k, k]
        for i in range(k + 1, m):
            factor = matrix[i, k] * inverse
            for j in range(first, right + COLUMNS, LANE):
                reduce_16(matrix, i, k, j, factor)
    for k in range(m - 1, -1, -1):
        inverse = 1.0 / matrix[k, k]
        for j in range(right, right + COLUMNS):
            matrix[k, j] *= inverse
        for i in range(k):
            reduce_16(matrix, i, k, right, matrix[i, k])


@compiled
def through_impact(steps: Steps, piece: Any, event: Any, slowest: float, p: Parameters, v: Carried) -> None:
    """Carry the derivative through an impact, to the event.

    One too slow to move anything, with contact after it, is contact that goes on; one without speed, none.
    """
    attached = event.mode_after == ATTACHED
    if -event.rate_before < slowest and event.rate_after == 0.0 and attached:
        for j in range(COLUMNS):
            v.s[GAP, j] = v.s[GAP_RATE, j] = 0.0
        return
    if event.rate_before == 0.0:
        return
    state, rates = np.empty(FULL_SIZE), np.empty(FULL_SIZE)
    ends = steps.ends[piece.end - 1]
    scatter(piece.system, ends, state)
    rates_of(piece.system, event.t, ends, rates, p, v.room)
    state[GAP], state[GAP_RATE] = 0.0, event.rate_before
    rates[GAP] = event.rate_before
    before: Any = np.empty(FULL_SIZE, np.complex128)
    after: Any = np.empty(FULL_SIZE, np.complex128)
    law = 1 if -event.rate_before < p.sticking_speed or (event.rate_after == 0.0 and p.restitution > 0.0) else 0
    v.at_event[0] = 1
    for j in range(FULL_SIZE + v.turned.shape[1] - 1):
        late = -v.s[GAP, j] / event.rate_before
        v.late[j] = late
        for i in range(FULL_SIZE):
            before[i] = state[i] + 1j * IMAGINARY * (v.s[i, j] + rates[i] * late)
        before[GAP] = 0.0
        impact(before, after, v.turned[law, max(j - FULL_SIZE + 1, 0)])
        for i in range(FULL_SIZE):
            v.s[i, j] = after[i].imag / IMAGINARY
    if law == 0 and event.rate_after == 0.0 and attached:
        through_small_impacts(piece.system, event.t, state, after, p, v)


@compiled
def through_small_impacts(system: int, t: float, state: FloatArray, after: Any, p: Parameters, v: Carried) -> None:
    """Add to an inelastic impact what a restitution beside 0 would: impacts that accumulate at once."""
    for i in range(FULL_SIZE):
        state[i] = after[i].real
    by_latch(system, t, state, FULL_SIZE, p, v)


@compiled
def through_latch(steps: Steps, piece: Any, p: Parameters, v: Carried) -> None:
    """Carry the derivative through impacts that accumulate, from the event at which they begin to where they end."""
    state = np.empty(FULL_SIZE)
    first = piece.first
    scatter(piece.system, steps.c[first, 0], state)
    state[GAP] = 0.0
    if v.at_event[0] == 0:  # the motion began with them
        v.at_event[0] = 1
        for j in range(COLUMNS):
            v.late[j] = 0.0
    by_latch(piece.system, piece.origin + steps.start[first], state, 0, p, v)


@compiled
def by_latch(system: int, t: float, state: FloatArray, first: int, p: Parameters, v: Carried) -> None:
    """Differentiate a latch, from the event before it to that at its end, in the columns from the first on."""
    n, room = DIFFERENTIAL[system] // 2, v.room
    start, rates = np.empty(FULL_SIZE), np.empty(FULL_SIZE)
    gather(system, state, start)
    rates_of(system, t, start, rates, p, room)
    differentiate(system, t, 0, p, v)
    moved: Any = np.empty(FULL_SIZE, np.complex128)
    after: Any = np.empty(FULL_SIZE, np.complex128)
    turned: Any = np.empty(FULL_SIZE // 2, np.complex128)
    change = np.zeros(FULL_SIZE)
    for j in range(first, FULL_SIZE + v.turned.shape[1] - 1):
        for i in range(n):
            place = PLACES[system, n + i]
            change[place] = room.b[0, i, j - FULL_SIZE] if j >= FULL_SIZE else 0.0
            for k in range(2 * n):
                change[place] += room.a[0, i, k] * v.s[PLACES[system, k], j]
        for i in range(FULL_SIZE):
            moved[i] = state[i] + 1j * IMAGINARY * v.s[i, j]
        for i in range(FULL_SIZE // 2):
            turned[i] = rates[7 + i] + 1j * IMAGINARY * change[7 + i]
        duration, _, _ = latch(moved, turned, after, v.turned[0, max(j - FULL_SIZE + 1, 0)])
        v.late[j] += duration.imag / IMAGINARY
        for i in range(FULL_SIZE):
            v.s[i, j] = after[i].imag / IMAGINARY
