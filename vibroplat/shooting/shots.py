"""Short motions with their observers in compiled code, each in one call: shots, and motion that is to come nearer.

What is large is called by its address, the engine's loop and the observers, so it is compiled once. An engine without a
compiled loop is called through Python, as is what else compiled code cannot do.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.config.coordinates import TURN
from vibroplat.hybrid.loop import first_mode
from vibroplat.hybrid.modes import FLIGHT, MODES
from vibroplat.hybrid.state import EVENT, OK, RUNNING, Automaton, rewind
from vibroplat.kernels.compiled import (
    NOWHERE,
    Address,
    Callee,
    FloatArray,
    address_of,
    borrow,
    call_int,
    call_kernel,
    compiled,
    copy,
    inlined,
)
from vibroplat.model.energy import energies
from vibroplat.model.parameters import record_words
from vibroplat.model.sensitivity import Course, go_along
from vibroplat.model.systems import FULL_SIZE, GAP
from vibroplat.observe.measures import Accumulators
from vibroplat.observe.section import ON_SECTION, offset_of, section_angle
from vibroplat.observe.statistics import Statistics
from vibroplat.observe.variation import Variation, VariationalState, arrive, begin_full, follow, perturb
from vibroplat.shooting.guard_margins import update_minima

#: Parts of measures that a shot needs; the others belong to a Poincaré section.
MEASURED_FIELDS = 6
#: Events and pieces of a shot for which there is room at first.
MAX_EVENTS = 256

#: What Python is asked for: to carry the motion on, to set the parameters of the next shot, with their directions too,
#: and to solve equations that are nearly singular.
ADVANCE, SET, SET_DIRECTIONS, SOLVE = range(4)

#: What a shot leaves beside its arrays: numbers of the systems at its ends, how many events and pieces it has, and
#: turns of exciter 1 in all shots.
SHOT = np.dtype(
    [
        ("begins", np.int64),
        ("ends", np.int64),
        ("events", np.int64),
        ("pieces", np.int64),
        ("turns", np.float64),
    ],
    align=True,
)

#: System, beginning and end (s) of a piece.
PART = np.dtype([("system", np.int64), ("begin", np.float64), ("end", np.float64)], align=True)


class ShotRecords(NamedTuple):
    """What compiled shots read and change.

    Attributes
    ----------
    shoot
        Address of :func:`shoot`, for compiled callers.
    run, beginning
        The record ``h.run``, whole, as numbers: now, and where each motion begins.
    engine, python
        The engine's loop, and the address of a :class:`vibroplat.kernels.compiled.PythonFunction`.
    variation, follow, arrive
        The derivative that is carried along, and addresses of its kernels.
    look, least
        Address of :func:`vibroplat.shooting.guard_margins.update_minima`, and what it lowers.
    statistics, blank, measured
        Kernel and arguments of :class:`vibroplat.observe.statistics.Statistics`; its measures at the beginning, and
        now, as numbers, one part after the other.
    energies
        What :func:`vibroplat.model.energy.energies` says of both ends of a measured shot, shape (2, 6).
    events, pieces
        Room for records of :data:`vibroplat.hybrid.state.EVENT` and of :data:`PART`.
    shot, end
        A record of :data:`SHOT`, and the full state at the end of the last motion, with all turns, shape (14,).
    values, held
        Values of keys that Python is asked to set, and those that it has set.
    course, parameters
        Parameters over the only key, and those of all who hold them, as numbers, shape (3, words); see
        :func:`set_parameters`.
    """

    h: Automaton
    shoot: Address
    run: FloatArray
    beginning: FloatArray
    engine: Callee
    python: int
    variation: VariationalState
    follow: Address
    arrive: Address
    look: Address
    least: FloatArray
    statistics: Callee
    blank: FloatArray
    measured: FloatArray
    energies: FloatArray
    events: npt.NDArray[np.void]
    pieces: npt.NDArray[np.void]
    shot: Any
    end: FloatArray
    values: FloatArray
    held: FloatArray
    course: Course
    parameters: tuple[FloatArray, FloatArray]


def shot_records(
    h: Automaton,
    beginning: Any,
    engine: Callee,
    python: int,
    variation: Variation,
    statistics: Statistics,
    measured: FloatArray,
    course: Course,
    parameters: tuple[FloatArray, FloatArray],
) -> ShotRecords:
    """Gather what shots need of a motion that always has the same ``beginning``, a record of RUN, and its observers.

    ``measured`` are the numbers of the measures of ``statistics``; see :func:`packed`.
    """
    keys = variation.carried.directions.shape[0] - 1
    carried, least = variation.carried, np.empty(2)
    return ShotRecords(
        h=h,
        shoot=NOWHERE,
        run=record_words(h.run),
        beginning=record_words(beginning),
        engine=engine,
        python=python,
        variation=carried,
        follow=address_of(follow, h, carried),
        arrive=address_of(arrive, h, carried),
        look=address_of(update_minima, h, least),
        least=least,
        statistics=statistics.callee(h),
        blank=measured.copy(),
        measured=measured,
        energies=np.empty((2, 6)),
        events=np.zeros(MAX_EVENTS, EVENT),
        pieces=np.empty(MAX_EVENTS, PART),
        shot=np.zeros(1, SHOT)[0],
        end=np.zeros(FULL_SIZE),
        values=np.zeros(keys),
        held=np.full(keys, np.nan),
        course=course,
        parameters=parameters,
    )


def packed(measures: Accumulators) -> npt.NDArray[np.void]:
    """Put what a shot measures side by side into one record, which is copied at once as numbers: an array of one."""
    parts = dict(zip(Accumulators._fields, measures[:MEASURED_FIELDS], strict=False))
    record = np.zeros(1, [(name, part.dtype, np.shape(part)) for name, part in parts.items()])
    for name, part in parts.items():
        record[name] = part
    return record


def unpacked(record: npt.NDArray[np.void], like: Accumulators) -> Accumulators:
    """View such a record as measures, whose other parts are those of others like them."""
    parts = record[0]
    return Accumulators(*(parts[name] for name in Accumulators._fields[:MEASURED_FIELDS]), *like[MEASURED_FIELDS:])


@compiled
def shoot(owned_k: ShotRecords, state: FloatArray, duration: float, full: bool, measured: bool, noted: bool) -> None:
    """Follow the motion from a full state for a duration (s), until an engine in Python has raised.

    It is ``measured``, carries the ``full`` derivative along, roughly if it is not measured, and its events are
    ``noted``, with its pieces and margins if it is full: as many as there is room for.
    """
    k = borrow(owned_k)
    h, run, shot = k.h, k.h.run, k.shot
    begin_at(k, state)
    shot.begins = run.systems[run.mode]
    shot.events = shot.pieces = 0
    k.least[0] = k.least[1] = np.inf
    if full:
        k.variation.rough[0] = 0 if measured else 1
        perturb(h, k.variation)
        begin_full(k.variation)
    if measured:
        copy(k.blank, k.measured)
        note_energies(k, 0)
    run.end, run.outcome, run.unread = duration, RUNNING, 0 if full or measured or noted else 1
    while run.outcome == RUNNING and advance(k):
        if full:
            call_kernel(k.follow, (h, k.variation))
        if noted:
            note_events(k)
        if noted and full:
            call_kernel(k.look, (h, k.least))
        if measured:
            events = h.events[: run.events]
            first, others = k.statistics.arguments[:1], k.statistics.arguments[1:]
            call_kernel(k.statistics.place, first + (h.steps, events) + others + (h.p,))  # noqa: RUF005
        run.events = 0
    leave(k)
    if measured:
        note_energies(k, 1)
    shot.ends = run.systems[run.mode]
    shot.turns += abs(k.end[3] - state[3]) / TURN
    if full:
        call_kernel(k.arrive, (h, k.variation))


@compiled
def set_parameters(k: ShotRecords, value: float) -> bool:
    """Set the parameters at a value of the only key, and their direction; False if none are known there."""
    if not go_along(k.course, value, k.variation.directions[1]):
        return False
    for held in k.parameters:
        copy(k.course.words, held)
    k.held[0] = value
    return True


@inlined
def begin_at(k: ShotRecords, state: FloatArray) -> None:
    """Begin anew at a full state; see :meth:`vibroplat.motion.motion.Simulator.reset`."""
    copy(k.beginning, k.run)
    copy(state, k.h.run.state)
    first_mode(k.h)


@inlined
def advance(k: ShotRecords) -> bool:
    """Carry the motion on until its steps are to be read; False if Python has raised."""
    rewind(k.h.steps)
    if len(k.engine.arguments) == 0:
        return ask(k, ADVANCE)
    call_kernel(k.engine.place, (k.h,) + k.engine.arguments)  # noqa: RUF005
    return True


@inlined
def ask(k: ShotRecords, wish: int) -> bool:
    """Ask Python for something; False if it has raised."""
    return call_int(k.python, (np.int32(wish),)) != 0


@inlined
def leave(k: ShotRecords) -> None:
    """Note where the motion has ended."""
    copy(k.h.run.state[: k.end.size], k.end)
    for i in range(2):
        k.end[3 + i] += k.h.run.turns[i]


@inlined
def note_energies(k: ShotRecords, end: int) -> None:
    """Note the energies of the present state as those of an end."""
    numbers = energies(k.h.run.state, k.h.p)
    for i in range(len(numbers)):
        k.energies[end, i] = numbers[i]


@inlined
def note_events(k: ShotRecords) -> None:
    """Copy the new events and closed pieces, as far as there is room, and count them all."""
    shot, steps = k.shot, k.h.steps
    for i in range(k.h.run.events):
        if shot.events < k.events.size:
            k.events[shot.events] = k.h.events[i]
        shot.events += 1
    for i in range(steps.used.pieces):
        piece = steps.pieces[i]
        if shot.pieces < k.pieces.size:
            part = k.pieces[shot.pieces]
            part.system, part.begin, part.end = piece.system, piece.origin + steps.start[piece.first], piece.until
        shot.pieces += 1


@compiled
def distance(state: FloatArray, centre: FloatArray, norm: FloatArray) -> float:
    """How far a full state is from another on the section, ‖W ξ‖ with this W of the difference, shape (n, 14)."""
    square = 0.0
    for i in range(norm.shape[0]):
        part = 0.0
        for j in range(centre.size):
            part += norm[i, j] * offset_of(state, centre, j)
        square += part**2
    return math.sqrt(square)


@compiled
def contracts(
    owned_k: ShotRecords,
    centre: FloatArray,
    system: int,
    norm: FloatArray,
    starts: FloatArray,
    looks: int,
    turns: int,
    longest: float,
    bound: float,
    noise: float,
) -> bool:
    """Whether motion from some full states comes nearer to a centre: by a factor from look to look, or down to noise.

    Between two looks exciter 1 makes whole ``turns``, in less than a time (s). Motion does not come nearer where the
    layer is within the platform, or where it is in another system than the centre.
    """
    k = borrow(owned_k)
    run = k.h.run
    for i in range(starts.shape[0]):
        if MODES[system] == FLIGHT and starts[i, GAP] <= 0.0:
            return False
        begin_at(k, starts[i])
        if run.systems[run.mode] != system:
            return False
        far = distance(starts[i], centre, norm)
        for _ in range(looks):
            if not to_section(k, turns, longest) or run.systems[run.mode] != system:
                return False
            near = distance(k.end, centre, norm)
            if not near <= bound * far:  # nor where it is no number
                return False
            far = near
            if far < noise:
                break
    return True


@inlined
def to_section(k: ShotRecords, turns: int, longest: float) -> bool:
    """Carry the motion on for whole turns of exciter 1, in less than a time (s); return whether it got there.

    See :meth:`vibroplat.motion.motion.Simulator.to_section`.
    """
    run = k.h.run
    run.target = target = section_angle(run.state[3] + run.turns[0], turns)
    run.end, run.outcome, run.unread = run.now + longest, RUNNING, 1
    while run.outcome == RUNNING and advance(k):
        run.events = 0
    run.target = math.nan
    leave(k)
    return run.outcome == OK and k.end[3] > target - TURN * ON_SECTION
