"""What is summed over a run while it goes: statistics of the measured part, powers for the audit, the section.

Integrals are Gauss quadratures of the steps' polynomials. What is measured is cut to whole turns of exciter 1.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from vibroplat.config.coordinates import TURN
from vibroplat.hybrid.modes import CHATTER, FLIGHT, IMPACT, MODES
from vibroplat.hybrid.state import Automaton, Steps
from vibroplat.kernels.compiled import Callee, FloatArray, address_of, borrow, compiled, copy, inlined, quick_call
from vibroplat.kernels.lanes import join, load_2, load_4, load_16, part, store, total, zero
from vibroplat.kernels.lines import in_lines
from vibroplat.kernels.polynomial import crossing, value
from vibroplat.kernels.rows_of_16 import horner_16, horner_pair_16, means_16
from vibroplat.kernels.sines import sincos_pair
from vibroplat.model.energy import DISSIPATIONS, FRICTION, exciter_powers, powers
from vibroplat.model.motor import both, motor_torques
from vibroplat.model.parameters import Parameters
from vibroplat.model.springs import curved_means, has_beyond, slopes
from vibroplat.model.systems import (
    ALONG,
    ALONG_RATE,
    DIFFERENTIAL,
    FULL_SIZE,
    PLACES,
    SIZES,
    SLIDES,
)
from vibroplat.observe.conveying import find_sliding
from vibroplat.observe.extremes import IMPULSE, MAX_NODES, NODES, WEIGHTS, Equations, Span, set_pace
from vibroplat.observe.loads import add_forces, update_step_extremes
from vibroplat.observe.measures import (
    BINS,
    COSINE,
    EARLY,
    FASTEST,
    FLYING,
    FRICTION_LOSS,
    N_POWERS,
    N_WORK,
    POWER,
    PULL,
    SECTION_ROWS,
    SINE,
    SPEED,
    STICK_TIME,
    SUMMED,
    TIME,
    TORQUE,
    WHOLE_RUN,
    WITH_EXTREMES,
    XX,
    Accumulators,
    X,
    empty_accumulators,
    last_closed,
)
from vibroplat.observe.room import ROOM

#: Place of φ₁ among the unknowns. An integer of numpy, so that functions are compiled once for all.
_ANGLE = np.array([3])[0]

#: Change of the phase difference within a step (rad) up to which its mean and variance determine cosine and sine: the
#: neglected third moment is below 1e-7 there.
STILL = 0.02

#: Part of a turn that may be missing by round-off.
_COMPLETE = 1e-12
#: Turns of exciter 1 within a step beyond which none of them is counted: the motion makes no sense any more.
_MAX_TURNS = 1000.0


class Statistics:
    """Observes a run: reads its steps and events into :class:`Accumulators`.

    Parameters
    ----------
    window
        When the measured part begins (s).
    points
        Number of the last points of the Poincaré section that are kept; 0: measures are not cut to whole turns.
    named
        Number of the scene's points that are measured.
    blocks
        In how many parts a motion is measured, each with its own extremes; see :meth:`end_block`.
    scope
        Scope of the measures, from :data:`vibroplat.observe.measures.SECTION_POINTS` to ``WHOLE_RUN``.
    """

    def __init__(
        self, window: float, points: int = SECTION_ROWS, named: int = 0, blocks: int = 1, scope: int = WHOLE_RUN
    ) -> None:
        self._room = in_lines((1,), ROOM)[0]
        self._room["named"] = named
        self._add_pieces = quick_call(add_pieces)
        self.begin(window, points, blocks, scope)

    def begin(self, window: float, points: int = SECTION_ROWS, blocks: int = 1, scope: int = WHOLE_RUN) -> Accumulators:
        """Begin with empty accumulators and return them; the previous ones stay unchanged for their holders."""
        self.measures = empty_accumulators(window, points, blocks, scope)
        return self.measures

    def end_block(self) -> Accumulators:
        """Copy the accumulators; from the next whole turn on, extremes are those of the next block."""
        ms = self.measures
        copied = ms._replace(whole=ms.whole.copy(), marks=ms.marks.copy(), closed=last_closed(ms).copy())
        ms.marks["due"] = min(ms.marks["row"] + 1, len(ms.extremes) - 1)
        return copied

    def read(self, h: Automaton) -> None:
        """Add the steps and events since the last reading."""
        self._add_pieces(self.measures, h.steps, h.events[: h.run["events"]], *self._constants(h), h.p)

    def callee(self, h: Automaton) -> Callee:
        """Return the kernel that adds them, for compiled callers, with the arguments that stay the same in a motion.

        It is called with the first of these, steps and events, the others, and parameters.
        """
        constants = self._constants(h)
        place = address_of(add_pieces, self.measures, h.steps, h.events[:0], *constants, h.p)
        return Callee(place, (self.measures, *constants))

    def _constants(self, h: Automaton) -> tuple[Any, int, float, Equations]:
        """Room, number of nodes, fastest speed and equations.

        A step has pairs of Gauss nodes: enough to keep the order of its polynomials, fewer if their degree is high.
        """
        degree = h.steps.degree
        nodes = (degree + 1) // 2 if degree <= 8 else (degree + 1) // 3
        nodes = min(nodes + nodes % 2, MAX_NODES)
        return self._room, nodes, FASTEST * float(h.run["speed"]), Equations(h.start, h.parameters)


@compiled
def add_pieces(
    owned_ms: Accumulators,
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
    counted, degree, full, room.limited = 0, steps.c.shape[1] - 1, room.full, 0
    stiffness, damping = slopes(p)
    for j in range(3):
        room.springs[0, j], room.springs[1, j] = stiffness[j], damping[j]
    room.springs[1, 1] = p.suspension_damping_y
    room.springs[0, 3] = np.nan
    room.beyond = has_beyond(p)
    for j in range(room.means.shape[1]):
        room.means[4, j] = 0.0
    for i in range(steps.used.pieces):
        piece = steps.pieces[i]
        while counted < piece.events:
            count_event(ms, events[counted])
            counted += 1
        for j in range(full.size):
            full[j] = 0.0
        for row in range(piece.first, piece.end):
            if steps.length[row] > 0.0:
                add_step(ms, steps, row, piece, degree, nodes, room, equations, p)
                if ms.marks.scope >= WHOLE_RUN:
                    now = piece.origin + steps.start[row] + steps.length[row]
                    mark_bins(ms, steps.ends[row], now, piece.system, fastest, p)
                    follow_turn(ms, steps, row, piece, degree)
        ms.marks.until = piece.until
    while counted < events.size:
        count_event(ms, events[counted])
        counted += 1


@compiled
def count_event(ms: Accumulators, event: Any) -> None:
    """Add an event to the counts of the whole, and to those of the measured part if it lies there."""
    marks = ms.marks
    marks.counts[event.kind] += 1
    rubbed = 0.0  # friction of impacts, which the sums over steps do not see
    if event.kind in (IMPACT, CHATTER):
        rubbed = -0.5 * event.friction_impulse * (event.slip_before + event.slip_after)
    ms.work[FRICTION] += rubbed
    marks.impact_loss += event.loss - rubbed
    marks.impulse_sum += event.impulse
    if event.t >= marks.window:
        marks.measured[event.kind] += 1
        ms.open_turn[FRICTION_LOSS] += rubbed
        extremes = ms.extremes[marks.row]
        extremes.largest[IMPULSE] = max(extremes.largest[IMPULSE], event.impulse)


@inlined
def add_step(
    ms: Accumulators,
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
    begin, length, turns = piece.origin + steps.start[row], steps.length[row], piece.turns
    turn, last = marks.passed, whole_turns(end[3], turns[0])
    if math.isnan(turn):
        turn = whole_turns(c[0, 3], turns[0])
    if ms.section.size == 0 or not abs(last - turn) <= _MAX_TURNS:
        turn = last
    marks.passed = last
    first, now, begins, rate = 0.0, begin, c[0], DIFFERENTIAL[piece.system] // 2 + 3
    while turn != last or first < 1.0:
        since, cut, way, now = now, 1.0, 0.0, begin + length
        if turn != last:
            way = 1.0 if last > turn else -1.0
            cut = max(crossing(c, degree, _ANGLE, TURN * max(turn, turn + way) - turns[0], end[3]), first)
            now = begin + cut * length
        if since < marks.window < now:
            cut, way, now = max((marks.window - begin) / length, first), 0.0, marks.window
        at = end
        if cut < 1.0:
            horner_16(c, degree, cut, room.at)
            at = room.at[0]
        if first < cut and marks.scope >= SUMMED:
            span = Span(begin, length, c, degree, first, cut, piece.system, nodes, equations)
            add_part(ms, span, begins, at, since >= marks.window, room, p)
        first, turn = cut, turn + way
        if cut < 1.0:
            begins = room.begins[0]
            store(load_16(at, 0, 0), begins, 0, 0)
        if way == 0.0:
            continue
        passes = math.copysign(1.0, at[rate])
        same = marks.way != -passes  # as the last time: one that swings completes no turn
        marks.way = passes
        if same and now >= marks.window:
            close_turn(ms, now, turns, at, piece.system, room)


@inlined
def follow_turn(ms: Accumulators, steps: Steps, row: int, piece: Any, degree: int) -> None:
    """Note where a step ends, and complete the present turn of the faster exciter if it ends there."""
    turn, turns, c, end = ms.marks.turn, piece.turns, steps.c[row], steps.ends[row]
    begin, length = piece.origin + steps.start[row], steps.length[row]
    if math.isnan(turn[2, 0]):
        for i in range(2):
            turn[i, 0], turn[i, 1], turn[i, 2] = begin, c[0, 3] + turns[0], c[0, 4] + turns[1]
    turn[2, 0], turn[2, 1], turn[2, 2] = begin + length, end[3] + turns[0], end[4] + turns[1]
    if abs(turn[2, 1] - turn[1, 1]) >= TURN or abs(turn[2, 2] - turn[1, 2]) >= TURN:
        complete_turn(ms, steps, row, piece, degree)


@compiled
def complete_turn(ms: Accumulators, steps: Steps, row: int, piece: Any, degree: int) -> None:
    """Complete the present turn of the faster exciter in a step, and give its extremes their pace."""
    marks, turn, turns, c, cut = ms.marks, ms.marks.turn, piece.turns, steps.c[row], 1.0
    length, rates = steps.length[row], DIFFERENTIAL[piece.system] // 2 + 3
    for i in range(2):
        way = turn[2, 1 + i] - turn[1, 1 + i]
        if abs(way) >= TURN:
            level = turn[1, 1 + i] + math.copysign(TURN * math.floor(abs(way) / TURN), way)
            angle, angle_after = c[0, 3 + i] + turns[i], turn[2, 1 + i]
            cut = min(cut, place_of_angle(level, angle, angle_after, c[1, 3 + i], length * steps.ends[row][rates + i]))
    for i in range(3):
        turn[0, i] = turn[1, i]
    turn[1, 0] = piece.origin + steps.start[row] + cut * length
    turn[1, 1], turn[1, 2] = value(c, degree, 3, cut) + turns[0], value(c, degree, 4, cut) + turns[1]
    for i in (EARLY, max(marks.row - 1, EARLY), marks.row):  # a turn may reach from before the measured part into it
        set_pace(ms.extremes[i], turn[0], turn[1])


@inlined
def place_of_angle(level: float, angle: float, angle_after: float, first: float, last: float) -> float:
    """Fraction of a step at which an angle passes a level, from the angle and its rate (rad/step) at both ends.

    By the cubic of the fraction over the angle, with slopes that keep it monotone; it is off by less than 1e-4.
    """
    way = angle_after - angle
    u = (level - angle) / way
    if not 0.0 < u < 1.0:
        return 1.0 if u >= 1.0 else 0.0
    slope_0 = min(way / first, 3.0) if way * first > 0.0 else 3.0
    slope_1 = min(way / last, 3.0) if way * last > 0.0 else 3.0
    v = 1.0 - u
    return u * u * (3.0 - 2.0 * u) + u * v * (v * slope_0 - u * slope_1)


@inlined
def add_part(
    ms: Accumulators, span: Span, begins: FloatArray, end: FloatArray, measured: bool, room: Any, p: Parameters
) -> None:
    """Add a step, or a part of it that is measured as a whole or not at all.

    ``begins`` holds the unknowns at its beginning, ``end`` the last ones.
    """
    width, row, samples, nodes = span.last - span.first, ms.marks.row if measured else EARLY, room.samples, span.nodes
    if room.widened != row:
        room.widened, room.limited = row, 0
    store(load_16(begins, 0, 0), samples, 0, 0)
    store(load_16(end, 0, 0), samples, nodes + 1, 0)
    for i in range(0, nodes, 2):  # they are even in number
        places = span.first + width * NODES[nodes, i], span.first + width * NODES[nodes, i + 1]
        horner_pair_16(span.c, span.degree, places[0], places[1], i + 1, samples)
    if ms.marks.scope >= WITH_EXTREMES:
        update_step_extremes(ms.extremes[row], room, span, p)
    integrate(ms, span, measured, room, p)


@inlined
def whole_turns(angle: float, turns: float) -> float:
    """Whole turns of an exciter; a turn at whose end the motion was stopped counts, in spite of round-off."""
    return math.floor((angle + turns) / TURN + _COMPLETE)


@inlined
def mark_bins(ms: Accumulators, end: FloatArray, now: float, system: int, fastest: float, p: Parameters) -> None:
    """Note that the phase difference and the speeds at the end of a step have been met."""
    n = DIFFERENTIAL[system] // 2
    turns = (end[3] - p.direction[0] * p.direction[1] * end[4]) / TURN
    which = (turns - np.floor(turns), min(abs(end[n + 3]) / fastest, 1.0), min(abs(end[n + 4]) / fastest, 1.0))
    for i in range(3):
        place = ms.seen[i, min(int(BINS * which[i]), BINS - 1)]
        place[0], place[1] = now, ms.work[0]


@inlined
def integrate(ms: Accumulators, span: Span, measured: bool, room: Any, p: Parameters) -> None:
    """Add a part of a step with samples in ``room``: work and, if measured, statistics."""
    begin, duration = span.begin + span.first * span.length, (span.last - span.first) * span.length
    system, nodes, n = span.system, span.nodes, DIFFERENTIAL[span.system] // 2
    marks, sums, means, power = ms.marks, ms.open_turn, room.means, room.power
    samples, exchanged = room.samples, 0.0
    torque = motor = held = truncated = resisted = zero(load_4(samples, 0, 0))
    for i in range(0, nodes, 2):  # both exciters at two nodes side by side
        now = begin + duration * alternate(NODES[nodes, i], NODES[nodes, i + 1])
        weight = alternate(WEIGHTS[nodes, i], WEIGHTS[nodes, i + 1])
        speed = join(load_2(samples, i + 1, n + 3), load_2(samples, i + 2, n + 3))
        angle = join(load_2(samples, i + 1, 3), load_2(samples, i + 2, 3))
        phi = alternate(samples[i + 1, 2], samples[i + 2, 2])
        turning = alternate(samples[i + 1, n + 2], samples[i + 2, n + 2])
        driving = motor_torques(now, speed, p)
        found = exciter_powers(driving, speed, angle, phi, turning, p)
        torque, motor, held = torque + weight * driving, motor + weight * found.motor, held + weight * found.held
        truncated, resisted = truncated + weight * found.truncation, resisted + weight * found.resistance
        first, second = part(weight * found.motor)
        exchanged += abs(total(first)) + abs(total(second))
    means_16(samples, WEIGHTS[nodes], 1, nodes, n, means)
    taken = total(total(motor - held)), total(total(truncated)), total(total(resisted))
    if room.beyond != 0:
        curved_means(samples, WEIGHTS[nodes], nodes, system, means[4], p)
    powers(taken, means, n, system, power, p)
    if SLIDES[system]:
        find_sliding(samples, WEIGHTS[nodes], nodes, means, system, room.sliding, power, p)
        exchanged += power[FRICTION]
    for j in range(N_WORK):
        ms.work[j] += duration * power[j]
    for j in range(DISSIPATIONS, N_POWERS):
        exchanged += power[j]
    marks.exchanged += duration * exchanged
    if measured:
        for k in range(3):  # of x, y and φ
            sums[X + 2 * k] += duration * means[0, k]
            sums[XX + 2 * k] += duration * means[1, k]
        store(load_2(sums, 0, POWER) + duration * total(motor), sums, 0, POWER)
        store(load_2(sums, 0, TORQUE) + duration * total(both(p.direction) * torque), sums, 0, TORQUE)
        for i in range(2):
            sums[SPEED + i] += duration * means[0, n + 3 + i]
        add_forces(sums[PULL:], means, room.springs, n, duration)
        sums[TIME] += duration
        sums[FLYING] += duration if MODES[system] == FLIGHT else 0.0
        for j in range(room.sliding.size if SLIDES[system] else 0):
            sums[STICK_TIME + j] += duration * room.sliding[j]
        add_phase(sums, room, n, duration, nodes, -p.direction[0] * p.direction[1])


@inlined
def alternate(first: float, second: float) -> Any:
    """Put two numbers side by side, each once for both exciters."""
    return join(join(first, first), join(second, second))


@inlined
def add_phase(sums: FloatArray, room: Any, n: int, duration: float, nodes: int, sense: float) -> None:
    """Add cosine and sine of the phase difference φ₁ + sense φ₂ over a part of a step (s), from the samples.

    Where it changes little, they follow from its mean and its variance.
    """
    samples, phases, mean, drift = room.samples, room.phases, 0.0, 0.0
    for i in range(nodes):
        phases[i] = samples[i + 1, 3] + sense * samples[i + 1, 4]
        mean += WEIGHTS[nodes, i] * phases[i]
        drift = max(drift, duration * abs(samples[i + 1, n + 3] + sense * samples[i + 1, n + 4]))
    cosine, sine, variance = 0.0, 0.0, 0.0
    if drift > STILL:
        for i in range(0, nodes, 2):
            sine_1, cosine_1, sine_2, cosine_2 = sincos_pair(phases[i], phases[i + 1])
            cosine += WEIGHTS[nodes, i] * cosine_1 + WEIGHTS[nodes, i + 1] * cosine_2
            sine += WEIGHTS[nodes, i] * sine_1 + WEIGHTS[nodes, i + 1] * sine_2
    else:
        for i in range(nodes):
            variance += WEIGHTS[nodes, i] * (phases[i] - mean) ** 2
        sine, cosine, _, _ = sincos_pair(mean, 0.0)
        cosine, sine = (1.0 - 0.5 * variance) * cosine, (1.0 - 0.5 * variance) * sine
    sums[COSINE] += duration * cosine
    sums[SINE] += duration * sine


@compiled
def close_turn(ms: Accumulators, now: float, turns: FloatArray, at: FloatArray, system: int, room: Any) -> None:
    """Close a turn of exciter 1 in the measured part, at the unknowns ``at``: its sums join those of whole turns."""
    marks, full, force = ms.marks, room.full, DIFFERENTIAL[system]
    for j in range(force):
        full[PLACES[system, j]] = at[j]
    point = ms.section[marks.turns % ms.section.size]
    point.t, point.force, marks.last[0] = now, at[force] if SIZES[system] > force else 0.0, now
    for j in range(FULL_SIZE):
        point.state[j] = full[j]
    point.along[0], point.along[1] = full[ALONG], full[ALONG_RATE]
    for i in range(2):
        point.state[3 + i] += turns[i]
        marks.last[1 + i] = point.state[3 + i]
    for kind in range(marks.measured.size):
        point.counts[kind] = marks.last[3 + kind] = marks.measured[kind]
    sums = ms.whole
    if marks.turns == 0:
        copy(marks.last, marks.first)
        sums = ms.plain
    for i in range(sums.size):
        sums[i] += ms.open_turn[i]
        ms.open_turn[i] = 0.0
    copy(ms.whole, point.sums)
    if marks.scope >= WITH_EXTREMES:
        ms.closed[marks.turns % ms.closed.size] = ms.extremes[marks.row]
    marks.turns += 1
    marks.row = marks.due
