"""What is summed over a run while it goes: statistics of the measured part, powers for the audit, the section.

All integrals use Gauss quadrature of the steps' polynomials, so nothing of the trajectory need be kept. The measured
part is cut to whole turns of exciter 1 where there is one.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.hybrid.modes import FLIGHT, IMPACT, KINDS, MODES
from vibroplat.hybrid.state import WIDTH, Automaton, Steps
from vibroplat.kernels.compiled import FloatArray, borrow, compiled, copy, inlined, same_types
from vibroplat.kernels.lanes import horner_16, horner_pair_16, in_lines, means_16
from vibroplat.kernels.polynomial import crossing, slope
from vibroplat.kernels.sines import sines
from vibroplat.model.energy import FORCE_SIZE, POWERS, exciter_powers, powers
from vibroplat.model.motor import motor_torque
from vibroplat.model.parameters import Parameters
from vibroplat.model.series import HIGHEST
from vibroplat.model.systems import DIFFERENTIAL, FULL_SIZE, LAYERS, PLACES, SIZES
from vibroplat.observe.extremes import MOST_NODES, NODES, PEAKS, WEIGHTS, Span, no_peaks, widen_peaks
from vibroplat.observe.loads import COLUMNS, Equations, add_forces, widen

N_POWERS = len(POWERS)
N_WORK = FORCE_SIZE + 1
DISSIPATIONS = 2  # first of the powers that dampers take

#: Integrals over a part of a run (s, and the units of what is integrated times s).
SUMS = (
    *("time", "x", "xx", "y", "yy", "phi", "phi_phi", "cosine", "sine", "flying", "power_1", "power_2"),
    *("torque_1", "torque_2", "speed_1", "speed_2", "force_x", "force_y", "moment"),
    *("force_x_force_x", "force_y_force_y", "moment_moment"),
)
TIME, X, XX, Y, YY, PHI, PHI_PHI, COSINE, SINE, FLYING, POWER = range(11)
TORQUE, SPEED, PULL = 12, 14, 16

#: Into how many sorts phase differences and speeds are put; those of speeds reach to the largest synchronous speed
#: times FASTEST.
SORTS, FASTEST = 96, 1.5

#: A point of the Poincaré section: time (s), full state, F_c (N); measured impacts, and sums over whole turns, so far.
SECTION = np.dtype(
    [("t", float), ("state", float, FULL_SIZE), ("force", float), ("impacts", float), ("sums", float, len(SUMS))],
    align=True,
)

#: Points of the Poincaré section that are kept, the last ones, where nothing else is said.
SECTION_ROWS = 1024

#: What is remembered from step to step.
MARKS = np.dtype(
    [
        ("window", np.float64),  # when the measured part begins (s)
        ("until", np.float64),  # when the last step ended (s)
        ("passed", np.float64),  # whole turns of exciter 1 until now, nan before the first step
        ("turns", np.int64),  # points of the section so far
        ("first", np.float64, 4),  # at its first point: time (s), angles of both exciters (rad), measured impacts
        ("last", np.float64, 4),  # at its last point
        ("way", np.float64),  # in which exciter 1 has passed angle 0 the last time
        ("exchanged", np.float64),  # energy that motors and dampers have exchanged, all of it positive (J)
        ("counts", np.int64, len(KINDS)),  # events of each kind
        ("measured", np.int64, len(KINDS)),  # those in the measured part
        ("impact_loss", np.float64),  # (J)
        ("impulse_sum", np.float64),  # (N·s)
        ("impulse_max", np.float64),  # of the measured part
    ],
    align=True,
)
#: Place of φ₁ among the unknowns. An integer of numpy, so that functions are compiled once for all.
_ANGLE = np.array([3])[0]

#: Change of the phase difference within a step (rad) up to which its mean and variance say cosine and sine: what they
#: leave out, the third moment, is below 1e-7 there.
STILL = 0.02

_TURN = 2.0 * math.pi
#: Part of a turn that may be missing by round-off.
_COMPLETE = 1e-12
#: Turns of exciter 1 within a step beyond which none of them is counted: the motion makes no sense any more.
_MOST_TURNS = 1000.0

#: What is overwritten at each step: unknowns and phase differences at the nodes; means of the unknowns, of their
#: squares and their sizes, of products with the rates, and of the powers; a full state; stiffnesses and dampings; a sum
#: of two unknowns, and its values at the nodes; squares of mean accelerations; unknowns and rates. What stays is what
#: the known extremes are, for which system and record, and how many named points there are.
ROOM = np.dtype(
    [
        ("samples", float, (MOST_NODES, WIDTH)),
        ("means", float, (4, WIDTH)),
        ("full", float, FULL_SIZE),
        ("power", float, N_WORK),
        ("phases", float, MOST_NODES),
        ("springs", float, (2, 4)),
        ("form", float, (HIGHEST + 1, 1)),
        ("form_samples", float, (MOST_NODES, 1)),
        ("squares", float, MOST_NODES + 1),
        ("y", float, FULL_SIZE),
        ("yp", float, FULL_SIZE),
        ("limits", float, (2, COLUMNS)),
        ("limited", np.int64),
        ("named", np.int64),
    ],
    align=True,
)


class Measures(NamedTuple):
    """Sums over a run.

    Attributes
    ----------
    work
        Integrals of the powers (J) and of the vertical force from outside and its size (N·s), shape (N_WORK,).
    plain, open_turn, whole
        :data:`SUMS` over the measured part: before the first whole turn of exciter 1, since the last one, over whole
        turns.
    marks
        A record of :data:`MARKS`: counts and what is remembered from step to step.
    early, late
        Records of :data:`vibroplat.observe.extremes.PEAKS`: of the steps that begin before the measured part, and of
        that.
    seen
        When each sort of phase difference, and of speed of exciters 1 and 2, was last met (s), and the motors' work
        until then (J), shape (3, SORTS, 2).
    section
        Poincaré section: records of :data:`SECTION` at the whole turns of exciter 1 in the measured part, the last
        of them, turn n in row n modulo their number.
    """

    work: FloatArray
    plain: FloatArray
    open_turn: FloatArray
    whole: FloatArray
    marks: Any
    early: Any
    late: Any
    seen: FloatArray
    section: npt.NDArray[np.void]


def no_measures(window: float, points: int = SECTION_ROWS) -> Measures:
    """Make empty sums whose measured part begins at a time (s), with room for points of the Poincaré section."""
    marks = np.zeros(1, MARKS)[0]
    marks["window"], marks["until"], marks["passed"] = window, window, math.nan
    plain, open_turn, whole = np.zeros((3, len(SUMS)))
    seen = np.zeros((3, SORTS, 2))
    seen[..., 0] = -math.inf
    peaks = no_peaks(), no_peaks()
    return Measures(np.zeros(N_WORK), plain, open_turn, whole, marks, *peaks, seen, np.zeros(points, SECTION))


def copied(ms: Measures) -> Measures:
    """Copy what changes from turn to turn of the sums over whole turns, and the extremes."""
    return ms._replace(whole=ms.whole.copy(), marks=ms.marks.copy(), late=ms.late.copy())


def forget_extremes(ms: Measures) -> None:
    """Forget the extremes of the measured part so far."""
    none = no_peaks()
    for name in PEAKS.names or ():
        ms.late[name] = none[name]
    ms.marks["impulse_max"] = 0.0


def widen_extremes(ms: Measures, other: Measures) -> None:
    """Let the extremes be those of another part too."""
    widen_peaks(ms.late, other.late)
    ms.late["square"] = np.maximum(ms.late["square"], other.late["square"])
    ms.marks["impulse_max"] = max(ms.marks["impulse_max"], other.marks["impulse_max"])


def between(earlier: Measures, later: Measures) -> Measures:
    """Subtract two copies: sums over whole turns of exciter 1 between them; extremes are the later's, counts of all."""
    marks = later.marks.copy()
    marks["turns"] += 1 - earlier.marks["turns"]  # the last turn before is the first mark
    marks["first"] = earlier.marks["last"]
    plain, open_turn = np.zeros((2, len(SUMS)))
    return later._replace(plain=plain, open_turn=open_turn, whole=later.whole - earlier.whole, marks=marks)


class Statistics:
    """Observes a run: reads its steps and events into :class:`Measures`.

    Parameters
    ----------
    window
        When the measured part begins (s).
    points
        Points of the Poincaré section that are kept, the last ones.
    named
        Number of the scene's named points.
    """

    def __init__(self, window: float, points: int = SECTION_ROWS, named: int = 0) -> None:
        self._points, self._add_pieces = points, same_types(add_pieces)
        self._room = in_lines((ROOM.itemsize // 8,)).view(ROOM)[0]
        self._room["named"] = named
        self.begin(window)

    def begin(self, window: float) -> None:
        """Begin anew; what was measured before stays as it is with those who hold it."""
        self.measures = no_measures(window, self._points)

    def read(self, h: Automaton) -> None:
        """Add the steps and events since the last reading.

        A step has Gauss nodes in pairs: as many as keep the order of its polynomials, fewer where their degree is high.
        """
        degree = h.steps.degree
        nodes = (degree + 1) // 2 if degree <= 8 else (degree + 1) // 3
        nodes = min(nodes + nodes % 2, MOST_NODES)
        equations = Equations(h.start, h.parameters)
        fastest = FASTEST * float(h.run["speed"])
        self._add_pieces(
            self.measures, h.steps, h.events[: h.run["events"]], self._room, nodes, fastest, equations, h.p
        )


@compiled
def add_pieces(
    owned_ms: Measures,
    owned_steps: Steps,
    owned_events: npt.NDArray[np.void],
    room: Any,
    nodes: int,
    fastest: float,
    equations: Equations,
    p: Parameters,
) -> None:
    """Add all closed pieces and events in the order of time; ``room`` is overwritten."""
    ms, steps, events = borrow(owned_ms), borrow(owned_steps), borrow(owned_events)
    counted, degree, full, room.limited = 0, steps.c.shape[1] - 1, room.full, -1
    stiffnesses = (p.stiffness_x, p.stiffness_y, p.stiffness_phi), (p.damping_x, p.damping_y, p.damping_phi)
    for i in range(2):
        for j in range(3):
            room.springs[i, j] = stiffnesses[i][j]
    for i in range(steps.used.pieces):
        piece = steps.pieces[i]
        while counted < piece.events:
            count_event(ms.marks, events[counted])
            counted += 1
        for j in range(FULL_SIZE):
            full[j] = 0.0
        for row in range(piece.first, piece.end):
            if steps.length[row] > 0.0:
                add_step(ms, steps, row, piece, degree, nodes, room, equations, p)
                sort(ms, steps.ends[row], piece.origin + steps.start[row] + steps.length[row], piece.system, fastest, p)
        ms.marks.until = piece.until
    while counted < events.size:
        count_event(ms.marks, events[counted])
        counted += 1


@compiled
def count_event(marks: Any, event: Any) -> None:
    """Add an event to the counts of the whole, and to those of the measured part if it lies there."""
    marks.counts[event.kind] += 1
    marks.impact_loss += event.loss
    marks.impulse_sum += event.impulse
    if event.t >= marks.window:
        marks.measured[event.kind] += 1
        marks.impulse_max = max(marks.impulse_max, event.impulse)


@inlined
def add_step(
    ms: Measures,
    steps: Steps,
    row: int,
    piece: Any,
    degree: int,
    nodes: int,
    room: Any,
    equations: Equations,
    p: Parameters,
) -> None:
    """Add a step, in parts where the measured part begins and where exciter 1 completes turns within it."""
    marks, c, end = ms.marks, steps.c[row], steps.ends[row]
    system, force = piece.system, DIFFERENTIAL[piece.system]
    begin, length = piece.origin + steps.start[row], steps.length[row]
    since = (marks.window - begin) / length if begin < marks.window else 0.0  # fraction from which it is measured
    fill_nodes(c, degree, 0.0, 1.0, nodes, room)
    span = Span(begin, length, c, degree, force // 2 + 3)
    widen(ms.early, ms.late, c, degree, room, nodes, system, since, end, span, equations, p)
    turn, last = marks.passed, whole_turns(end[3], piece.turns[0])
    if math.isnan(turn):
        turn = whole_turns(c[0, 3], piece.turns[0])
    if not abs(last - turn) <= _MOST_TURNS:
        turn = last
    marks.passed = last
    begun, whole = 0.0, True
    while begun < 1.0 or turn != last:
        cut, way = 1.0, 0.0
        if turn != last:
            way = 1.0 if last > turn else -1.0
            cut = crossing(c, degree, _ANGLE, _TURN * max(turn, turn + way) - piece.turns[0])
        if begun < since < cut:
            cut, way = since, 0.0
        if not whole or cut < 1.0:  # otherwise the samples are those of the whole step still
            fill_nodes(c, degree, begun, cut, nodes, room)
            whole = False
        integrate(ms, begun, cut, begin, length, system, begun >= since, nodes, room, p)
        begun, turn, now = cut, turn + way, begin + cut * length
        if way == 0.0:
            continue
        passes = math.copysign(1.0, slope(c, degree, 3, cut))
        same = marks.way != -passes  # as the last time: one that swings completes no turn
        marks.way = passes
        if same and now >= marks.window:
            horner_16(c, degree, cut, room.samples[0])
            for j in range(force):
                room.full[PLACES[system, j]] = room.samples[0, j]
            close_turn(ms, now, piece.turns, room.full, room.samples[0, force] if SIZES[system] > force else 0.0)


@inlined
def fill_nodes(c: FloatArray, degree: int, start: float, end: float, nodes: int, room: Any) -> None:
    """Fill the samples: unknowns at the nodes of a part of a step."""
    for i in range(0, nodes, 2):  # they are even in number
        width = end - start
        first, second = start + width * NODES[nodes, i], start + width * NODES[nodes, i + 1]
        horner_pair_16(c, degree, first, second, room.samples[i : i + 2])


@inlined
def whole_turns(angle: float, turns: float) -> float:
    """Whole turns of an exciter; one that a motion was stopped at is complete, though round-off may say less."""
    return math.floor((angle + turns) / _TURN + _COMPLETE)


@inlined
def sort(ms: Measures, end: FloatArray, now: float, system: int, fastest: float, p: Parameters) -> None:
    """Note that the phase difference and the speeds at the end of a step have been met."""
    n = DIFFERENTIAL[system] // 2
    turns = (end[3] - p.direction[0] * p.direction[1] * end[4]) / _TURN
    which = (turns - math.floor(turns), min(abs(end[n + 3]) / fastest, 1.0), min(abs(end[n + 4]) / fastest, 1.0))
    for i in range(3):
        place = ms.seen[i, min(int(SORTS * which[i]), SORTS - 1)]
        place[0], place[1] = now, ms.work[0]


@inlined
def integrate(
    ms: Measures,
    start: float,
    end: float,
    begin: float,
    length: float,
    system: int,
    measured: bool,
    nodes: int,
    room: Any,
    p: Parameters,
) -> None:
    """Add the part [start, end] of a step: its work and, if it is measured, its statistics.

    ``start`` and ``end`` are fractions of the step, which begins at time ``begin`` and takes ``length`` (s); ``room``
    holds the samples at its nodes.
    """
    marks, sums, means, power, n = ms.marks, ms.open_turn, room.means, room.power, DIFFERENTIAL[system] // 2
    duration, motor, truncated, resisted, exchanged = (end - start) * length, 0.0, 0.0, 0.0, 0.0
    first = torque_1 = torque_2 = 0.0
    for i in range(nodes):
        now, weight = begin + (start + (end - start) * NODES[nodes, i]) * length, WEIGHTS[nodes, i]
        w_1, w_2 = room.samples[i, n + 3], room.samples[i, n + 4]
        l_1, l_2 = motor_torque(0, now, w_1, p), motor_torque(1, now, w_2, p)
        fed, turned, lost = exciter_powers(l_1 * w_1, l_2 * w_2, room.samples[i], n, p)
        torque_1 += weight * l_1
        torque_2 += weight * l_2
        first += weight * l_1 * w_1
        motor += weight * fed
        truncated += weight * turned
        resisted += weight * lost
        exchanged += weight * abs(fed)
    means_16(room.samples, WEIGHTS[nodes], nodes, n, means)
    powers((motor, truncated, resisted), means, n, LAYERS[system], power, p)
    for j in range(N_WORK):
        ms.work[j] += duration * power[j]
    for j in range(DISSIPATIONS, N_POWERS):
        exchanged += power[j]
    marks.exchanged += duration * exchanged
    if measured and duration > 0.0:
        for k in range(3):  # of x, y and φ
            sums[X + 2 * k] += duration * means[0, k]
            sums[XX + 2 * k] += duration * means[1, k]
        sums[POWER] += duration * first
        sums[POWER + 1] += duration * (motor - first)
        sums[TORQUE] += duration * p.direction[0] * torque_1
        sums[TORQUE + 1] += duration * p.direction[1] * torque_2
        for i in range(2):
            sums[SPEED + i] += duration * means[0, n + 3 + i]
        add_forces(sums[PULL:], means, room.springs, n, duration)
        sums[TIME] += duration
        sums[FLYING] += duration if MODES[system] == FLIGHT else 0.0
        add_phase(sums, room, n, duration, nodes, -p.direction[0] * p.direction[1])


@inlined
def add_phase(sums: FloatArray, room: Any, n: int, duration: float, nodes: int, sense: float) -> None:
    """Add cosine and sine of the phase difference φ₁ + sense φ₂ over a part of a step (s), from the samples.

    Where it changes little, they follow from its mean and its variance.
    """
    samples, phases, mean, drift = room.samples, room.phases, 0.0, 0.0
    for i in range(nodes):
        phases[i] = samples[i, 3] + sense * samples[i, 4]
        mean += WEIGHTS[nodes, i] * phases[i]
        drift = max(drift, duration * abs(samples[i, n + 3] + sense * samples[i, n + 4]))
    cosine, sine, variance = 0.0, 0.0, 0.0
    if drift > STILL:
        for i in range(nodes):
            sine_i, cosine_i, _, _ = sines(phases[i], 0.0)
            cosine += WEIGHTS[nodes, i] * cosine_i
            sine += WEIGHTS[nodes, i] * sine_i
    else:
        for i in range(nodes):
            variance += WEIGHTS[nodes, i] * (phases[i] - mean) ** 2
        sine, cosine, _, _ = sines(mean, 0.0)
        cosine, sine = (1.0 - 0.5 * variance) * cosine, (1.0 - 0.5 * variance) * sine
    sums[COSINE] += duration * cosine
    sums[SINE] += duration * sine


@compiled
def close_turn(ms: Measures, now: float, turns: FloatArray, full: FloatArray, force: float) -> None:
    """Exciter 1 has completed a turn in the measured part: what was open since the last one is whole."""
    marks = ms.marks
    point = ms.section[marks.turns % ms.section.size]
    point.t, point.force, point.impacts = now, force, marks.measured[IMPACT]
    copy(full, point.state)
    marks.last[0], marks.last[3] = now, marks.measured[IMPACT]
    for i in range(2):
        point.state[3 + i] += turns[i]
        marks.last[1 + i] = point.state[3 + i]
    sums = ms.whole
    if marks.turns == 0:
        copy(marks.last, marks.first)
        sums = ms.plain
    for i in range(sums.size):
        sums[i] += ms.open_turn[i]
        ms.open_turn[i] = 0.0
    copy(ms.whole, point.sums)
    marks.turns += 1
