"""The hybrid automaton: how a segment begins and what follows its end, for every engine.

All of a run is in arrays that compiled code reads and changes, so that an engine may go through many
segments without the interpreter. An engine calls :func:`begin`, integrates from the consistent state
that it prepares, writes the ends of its steps on the tape, and calls :func:`conclude`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.hybrid.scales import ROUND_OFF, halvings
from vibroplat.hybrid.transitions import (
    ATTACH,
    FLY,
    LATCH,
    RETURN_SHARE,
    after_impact,
    curvature_step,
    excursion,
    presses,
)
from vibroplat.integrate import tape as tp
from vibroplat.integrate.tape import Tape
from vibroplat.kernels.compiled import compiled, copy, inlined
from vibroplat.model.accelerations import accelerations, second_derivatives
from vibroplat.model.impact import impact, impacts_left, latch
from vibroplat.model.parameters import FloatArray, Parameters
from vibroplat.model.systems import (
    DIFFERENTIAL,
    FULL_SIZE,
    GAP,
    GAP_RATE,
    PLACES,
    SIZES,
    gather,
    spread,
)
from vibroplat.observe import statistics as m

# Modes, as :class:`vibroplat.scene.Mode` numbers them. Integers of numpy: a function that is called with them is
# compiled once, not once for each.
_NUMBERS: Any = np.arange(3)
ATTACHED, FLIGHT, BARE = _NUMBERS

# Why a segment ended.
AT_GUARD, AT_TIME, FAILED, NOT_FINITE = range(4)

# Outcomes of a run.
RUNNING, OK, SOLVER_FAILURE, NON_FINITE, INCONSISTENT, EVENT_STORM, BEYOND_MODEL = range(7)

# Kinds of events.
LIFTOFF, IMPACT, CLOSING = _NUMBERS
_NO_IMPACT, _ONE_IMPACT = _NUMBERS[:2]

#: ``JOINED_ON`` where a full tape has cut a segment in two.
_CUT = 2

# Places in ``Hybrid.clock`` (s, but for GAP_SCALE in m, SLOWEST in m/s, TOLERANCE without unit, FORCE_NOISE in N).
(
    NOW,  # where the run is
    ORIGIN,  # when the segment began
    DURATION,  # of the run
    UNTIL,  # longest the segment may take
    LONGEST,  # segment without an event
    PERIOD,  # turn of the larger synchronous speed
    FIRST_STEP,
    GAP_SCALE,
    SLOWEST,  # impact with a rebound
    TOLERANCE,  # of the run
    FORCE_NOISE,  # contact forces below this are round-off of larger ones
) = range(11)
CLOCKS = 11

# Places in ``Hybrid.flags``.
(
    MODE,
    OUTCOME,
    ENDS,  # whether reaching UNTIL ends the run
    JOINED_ON,  # whether the segment goes on from the one before without an event, or is the same, cut
    PREPARED,  # mode whose start belongs to the present state, or −1
    EVENTS,  # rows in the event list
    RESTARTS,
) = range(7)
FLAGS = 7

# Columns of ``Hybrid.events``.
T, KIND, RATE_BEFORE, RATE_AFTER, IMPULSE, LOSS, FORCE_AFTER, MODE_AFTER, IMPACTS = range(9)

#: Largest relative change of the gap's acceleration in a flight that is known from its first terms.
STEADY = 0.1

#: Farthest that the end of contact is moved, over the last two steps.
REFINED = 0.1

_TURN = 2.0 * math.pi
_EPS = float(np.finfo(float).eps)


class Hybrid(NamedTuple):
    """Where a run is.

    Attributes
    ----------
    p, p_dead
        Parameters, and the same without restitution.
    systems
        Number of the system of each mode, shape (3,); −1 for a mode that the scene does not have.
    tolerances
        Absolute tolerances of each mode's unknowns, shape (3, 14).
    state, turns
        Full state, shape (14,), and the whole turns taken off its exciter angles (rad), shape (2,).
    clock, flags
        Numbers and integers by the names above.
    y, yp, ypp
        Consistent start of each mode, shape (3, 14).
    atol
        Absolute tolerances of the segment, shape (14,).
    recent
        Times of the last restarts (s), as many as may lie within a period.
    events
        Events since the list was read, a row each.
    measures
        What is summed while the run goes.
    """

    p: Parameters
    p_dead: Parameters
    systems: npt.NDArray[np.int64]
    tolerances: FloatArray
    state: FloatArray
    turns: FloatArray
    clock: FloatArray
    flags: npt.NDArray[np.int64]
    y: FloatArray
    yp: FloatArray
    ypp: FloatArray
    atol: FloatArray
    recent: FloatArray
    events: FloatArray
    measures: m.Measures


# -- the beginning of a segment ---------------------------------------------------------------------------


@compiled
def begin(h: Hybrid) -> bool:
    """Prepare a segment: consistent start, tolerances, first step, longest duration.

    Returns False, with the outcome set, where the run ends instead.
    """
    if h.clock[NOW] >= h.clock[DURATION]:  # the last event was at the very end
        h.flags[OUTCOME] = OK
        return False
    if not count_restart(h):
        return False
    mode = h.flags[MODE]
    take_off_turns(h.state, h.turns)
    if h.flags[PREPARED] == mode:
        gather(h.systems[mode], h.state, h.y[mode])  # the turns
    elif not prepare(h, mode):
        return False
    h.flags[PREPARED] = -1  # soon the state will be another
    left = h.clock[DURATION] - h.clock[NOW]
    h.clock[ORIGIN] = h.clock[NOW]
    h.clock[UNTIL] = min(left, h.clock[LONGEST])
    h.flags[ENDS] = left <= h.clock[LONGEST]
    control(h)
    return True


@inlined
def count_restart(h: Hybrid) -> bool:
    """End the run when restarts pile up; all of them count, so that nothing can go on for ever."""
    most = h.recent.size
    oldest = h.flags[RESTARTS] % most
    if h.flags[RESTARTS] >= most and h.clock[NOW] - h.recent[oldest] < h.clock[PERIOD]:
        h.flags[OUTCOME] = EVENT_STORM
        return False
    h.recent[oldest] = h.clock[NOW]
    h.flags[RESTARTS] += 1
    return True


@compiled
def take_off_turns(state: FloatArray, turns: FloatArray) -> None:
    """Move whole turns of both exciter angles from the state into ``turns`` (rad), in place."""
    for exciter in range(2):
        whole = _TURN * math.floor(state[3 + exciter] / _TURN)
        state[3 + exciter] -= whole
        turns[exciter] += whole


@compiled
def prepare(h: Hybrid, mode: int) -> bool:
    """Make the present state a consistent start of a mode; False, with the outcome set, if there is none."""
    system = h.systems[mode]
    gather(system, h.state, h.y[mode])
    size = SIZES[system]
    found = consistent(h, system, h.y[mode, :size], h.yp[mode, :size], h.ypp[mode, :size])
    h.flags[PREPARED] = mode
    if not found:
        h.flags[OUTCOME] = BEYOND_MODEL if turned_far(h) else INCONSISTENT
        return False
    return True


@compiled
def consistent(h: Hybrid, system: int, y: FloatArray, yp: FloatArray, ypp: FloatArray) -> bool:
    """Fill y′, F_c, F_c′ and y″ of a state; False if there are none."""
    return accelerations(system, h.clock[NOW], y, yp, h.p) and second_derivatives(system, h.clock[NOW], y, yp, ypp, h.p)


@inlined
def control(h: Hybrid) -> None:
    """Choose tolerances and first step of a segment.

    The step follows from the curvature, and ends well before the gap can have closed again.
    """
    mode = h.flags[MODE]
    size = SIZES[h.systems[mode]]
    copy(h.tolerances[mode], h.atol)
    step = min(0.1 * h.clock[PERIOD], curvature_step(h.ypp[mode, :size], h.atol[:size]))
    if mode == FLIGHT:
        duration, height, sure = expected_flight(h, 1e-3 * step)
        step = min(step, RETURN_SHARE * duration)
        tighter = 2.0 ** -halvings(h.clock[TOLERANCE], height, h.clock[GAP_SCALE], sure)
        h.atol[GAP] *= tighter * tighter
        h.atol[size // 2 + GAP] *= tighter
    step = min(step, curvature_step(h.ypp[mode, :size], h.atol[:size]))
    h.clock[FIRST_STEP] = max(step, ROUND_OFF * h.clock[PERIOD])


@inlined
def expected_flight(h: Hybrid, small: float) -> tuple[float, float, bool]:
    """Duration (s) and height (m) of the flight that begins, inf where its first terms do not end it.

    The third value says whether that is sure: a rebound under an acceleration that hardly changes. ``small`` is
    a time (s) over which derivatives change little, also those of a stiff layer.
    """
    rates = SIZES[h.systems[FLIGHT]] // 2
    gap, rate = h.y[FLIGHT, GAP], h.y[FLIGHT, rates + GAP]
    acceleration, jerk = h.yp[FLIGHT, rates + GAP], h.ypp[FLIGHT, rates + GAP]
    if gap > 0.0:  # begun in the air, not at a contact
        if acceleration >= 0.0:
            return np.inf, np.inf, False
        return math.sqrt(2.0 * gap / -acceleration), gap + 0.5 * rate * rate / -acceleration, False
    fourth = snap(h, small) if rate == 0.0 else 0.0  # a rebound does not need it
    duration, height = excursion(rate, acceleration, jerk, fourth)
    return duration, height, rate > 0.0 and abs(jerk) * duration <= STEADY * -acceleration


@inlined
def snap(h: Hybrid, small: float) -> float:
    """Fourth derivative of the gap, as the difference of jerks a small step along the motion."""
    system = h.systems[FLIGHT]
    size = SIZES[system]
    ahead, yp, ypp = np.empty(size), np.empty(size), np.empty(size)
    for i in range(size):
        ahead[i] = h.y[FLIGHT, i] + small * h.yp[FLIGHT, i] + 0.5 * small * small * h.ypp[FLIGHT, i]
    consistent(h, system, ahead, yp, ypp)
    return (ypp[size // 2 + GAP] - h.ypp[FLIGHT, size // 2 + GAP]) / small


@compiled
def first_mode(h: Hybrid) -> None:
    """Choose the mode of a state, which may say itself that it flies: its gap is open or opening."""
    if h.systems[BARE] >= 0:
        h.flags[MODE] = BARE
    elif h.state[GAP] > 0.0 or h.state[GAP_RATE] > 0.0:
        h.flags[MODE] = FLIGHT
    elif prepare(h, ATTACHED):
        h.flags[MODE] = ATTACHED if pressing(h) else FLIGHT


@inlined
def pressing(h: Hybrid) -> bool:
    """Whether contact holds at the start prepared for it."""
    force = SIZES[h.systems[ATTACHED]] - 1
    return presses(h.y[ATTACHED, force], h.yp[ATTACHED, force], h.clock[FORCE_NOISE], h.p)


# -- the end of a segment ---------------------------------------------------------------------------------


@compiled
def conclude(h: Hybrid, tape: Tape, stop: int) -> None:
    """Record the open piece of the tape and make the transition at its end."""
    mode, last = h.flags[MODE], tape.used[tp.ROWS] - 1
    if stop == AT_GUARD and mode == ATTACHED:
        refine(h, tape)
    elif stop == AT_GUARD:
        tape.y[last, GAP] = 0.0  # the root is found to round-off
    ends = stop == AT_TIME and h.flags[ENDS] == 1
    close_piece(h, tape, h.clock[DURATION] if ends else h.clock[ORIGIN] + tape.t[last], False)
    if h.flags[OUTCOME] != RUNNING:
        return
    if ends:
        h.flags[OUTCOME] = OK
    elif stop == AT_TIME:
        h.flags[JOINED_ON] = 1
    elif stop == FAILED:
        h.flags[OUTCOME] = BEYOND_MODEL if turned_far(h) else SOLVER_FAILURE
    elif stop == NOT_FINITE:
        h.flags[OUTCOME] = BEYOND_MODEL if turned_far(h) else NON_FINITE
    elif mode == ATTACHED:
        force_root(h)
    elif gap_root(h):
        close_impacts(h, tape)


@inlined
def turned_far(h: Hybrid) -> bool:
    """Whether the platform has turned so far that the model may have no motion there."""
    return abs(h.state[2]) > h.p.safe_rotation


@inlined
def refine(h: Hybrid, tape: Tape) -> None:
    """Move the end of contact to where F_c by the algebra is 0.

    The integrator finds the root of its interpolated F_c, which satisfies the equations only to its
    tolerance; flight must begin without a force, or the gap begins with an acceleration. Leaves the
    start of contact prepared there.
    """
    system, last = h.systems[ATTACHED], tape.used[tp.ROWS] - 1
    size = SIZES[system]
    spread(system, tape.y[last], h.state)
    if not prepare(h, ATTACHED):
        return
    force, rate = h.y[ATTACHED, size - 1], h.yp[ATTACHED, size - 1]
    shift = -force / rate if rate < 0.0 else 0.0
    end = tape.t[last] + shift
    # a longer way is none of the integrator's error: F_c and its rate by the algebra do not belong together, as
    # where a stiff layer turns an error of its rate, which the tolerance allows, into a force
    near = REFINED * (tape.t[last] - tape.t[max(last - 2, tape.used[tp.FIRST])])
    if abs(shift) > near or not tape.t[last - 1] < end <= h.clock[UNTIL]:
        return
    for i in range(DIFFERENTIAL[system]):
        h.state[PLACES[system, i]] += shift * (h.yp[ATTACHED, i] + 0.5 * shift * h.ypp[ATTACHED, i])
    if not prepare(h, ATTACHED):
        return
    if abs(h.y[ATTACHED, size - 1]) > abs(force):  # no better there
        spread(system, tape.y[last], h.state)
        prepare(h, ATTACHED)
        return
    tape.t[last] = end
    copy(h.y[ATTACHED, :size], tape.y[last])
    copy(h.yp[ATTACHED, :size], tape.yp[last])


@compiled
def close_piece(h: Hybrid, tape: Tape, end: float, cut: bool) -> None:
    """Add the open piece to the sums and to the list of pieces, and move to its end, where it may only be cut."""
    mode = h.flags[MODE]
    system = h.systems[mode]
    first, last = tape.used[tp.FIRST], tape.used[tp.ROWS] - 1
    if SIZES[system] > DIFFERENTIAL[system]:
        tp.calm(tape, SIZES[system] - 1, h.flags[JOINED_ON] != _CUT, not cut)
    m.accumulate(h.measures, tape, system, mode == FLIGHT, h.clock[ORIGIN], h.turns, h.p)
    piece = tape.pieces[tape.used[tp.PIECES]]
    piece[tp.FIRST_ROW], piece[tp.LAST_ROW], piece[tp.SYSTEM] = first, last, system
    piece[tp.ORIGIN], piece[tp.END] = h.clock[ORIGIN], end
    piece[tp.TURNS_1], piece[tp.TURNS_2] = h.turns[0], h.turns[1]
    piece[tp.JOINED] = h.flags[JOINED_ON]
    tape.used[tp.PIECES] += 1
    tape.used[tp.FIRST] = tape.used[tp.ROWS]
    h.flags[JOINED_ON] = 0
    h.clock[NOW] = end
    spread(system, tape.y[last], h.state)


@compiled
def split_piece(h: Hybrid, tape: Tape) -> None:
    """Close the open piece of a tape that is full; the next goes on from its last row."""
    last = tape.used[tp.ROWS] - 1
    close_piece(h, tape, h.clock[ORIGIN] + tape.t[last], True)
    h.flags[JOINED_ON] = _CUT
    tape.used[tp.FIRST] = last


@inlined
def force_root(h: Hybrid) -> None:
    """Lift off where F_c has fallen through zero, or go on if it only touched."""
    if h.yp[ATTACHED, SIZES[h.systems[ATTACHED]] - 1] >= 0.0 and pressing(h):
        h.flags[JOINED_ON] = 1
        return
    h.flags[MODE] = FLIGHT
    add_event(h, LIFTOFF, 0.0, 0.0, 0.0, 0.0, 0.0, _NO_IMPACT)


@inlined
def gap_root(h: Hybrid) -> bool:
    """Let the lower layer strike where the gap has fallen through zero; True if the impacts to come may be closed."""
    h.state[GAP] = 0.0
    before = min(h.state[GAP_RATE], 0.0)
    h.state[GAP_RATE] = before
    struck = h.state.copy()
    resolved = -before >= h.clock[SLOWEST]
    p = h.p_dead if -before < h.p.sticking_speed else h.p
    impulse, loss, pressure, following = strike(h, struck, p, resolved)
    if following == FLY and not resolved:
        # a rebound that round-off of the platform's motion could not resolve is none
        impulse, loss, pressure, following = strike(h, struck, h.p_dead, resolved)
    if following < 0:
        return False
    rebound = h.state[GAP_RATE]
    h.flags[MODE] = h.flags[PREPARED] = ATTACHED if following == ATTACH else FLIGHT
    add_event(h, IMPACT, before, rebound, impulse, loss, pressure if following == ATTACH else 0.0, _ONE_IMPACT)
    return following == LATCH


@compiled
def strike(h: Hybrid, struck: FloatArray, p: Parameters, resolved: bool) -> tuple[float, float, float, int]:
    """Move to the state after an impact; impulse, loss, F_c if attached then, and what follows, −1 if nothing can."""
    after = np.empty(FULL_SIZE)
    impulse, loss = impact(struck, after, p)
    copy(after, h.state)
    if not (prepare(h, ATTACHED) and prepare(h, FLIGHT)):
        return impulse, loss, 0.0, -1
    force, place = SIZES[h.systems[ATTACHED]] - 1, SIZES[h.systems[FLIGHT]] // 2 + GAP
    pressure, force_rate = h.y[ATTACHED, force], h.yp[ATTACHED, force]
    acceleration, jerk = h.yp[FLIGHT, place], h.ypp[FLIGHT, place]
    tolerance, noise = h.clock[TOLERANCE], h.clock[FORCE_NOISE]
    following = after_impact(after[GAP_RATE], pressure, force_rate, acceleration, jerk, resolved, tolerance, noise, p)
    return impulse, loss, pressure, following


@inlined
def close_impacts(h: Hybrid, tape: Tape) -> None:
    """Close the impacts that accumulate, and carry the run to where they do."""
    system = h.systems[FLIGHT]
    size = SIZES[system]
    after, rates = np.empty(FULL_SIZE), np.empty(FULL_SIZE)
    start, slope = np.empty(size), np.empty(size)
    copy(h.y[FLIGHT, :size], start)
    copy(h.yp[FLIGHT, :size], slope)
    spread(system, slope, rates)
    duration, impulse, loss = latch(h.state, rates[7:], after, h.p)
    if h.clock[NOW] + duration >= h.clock[DURATION]:
        return  # the run ends before they have closed: follow them
    rebound = h.state[GAP_RATE]
    h.clock[ORIGIN] = h.clock[NOW]
    tp.write(tape, 0.0, start, slope)
    gather(system, after, start)
    copy(start[size // 2 :], slope)
    tp.write(tape, duration, start, slope)
    close_piece(h, tape, h.clock[NOW] + duration, False)
    copy(after, h.state)
    if not prepare(h, ATTACHED):
        return
    h.flags[MODE] = ATTACHED if pressing(h) else FLIGHT
    force = h.y[ATTACHED, SIZES[h.systems[ATTACHED]] - 1] if h.flags[MODE] == ATTACHED else 0.0
    skipped = math.ceil(min(impacts_left(rebound, h.p), math.log(_EPS) / math.log(h.p.restitution)))
    add_event(h, CLOSING, -rebound, 0.0, impulse, loss, force, skipped)


@compiled
def add_event(
    h: Hybrid, kind: int, before: float, after: float, impulse: float, loss: float, force: float, impacts: int
) -> None:
    """Write an event and add it to the totals; the mode is already the one after it."""
    row = h.events[h.flags[EVENTS]]
    row[T], row[KIND], row[RATE_BEFORE], row[RATE_AFTER] = h.clock[NOW], kind, before, after
    row[IMPULSE], row[LOSS], row[FORCE_AFTER] = impulse, loss, force
    row[MODE_AFTER], row[IMPACTS] = h.flags[MODE], impacts
    h.flags[EVENTS] += 1
    m.count_event(h.measures, kind, h.clock[NOW], impulse, loss)
