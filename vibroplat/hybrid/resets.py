"""Resets of the automaton: liftoff, slip, stick and reversal, impact, chatter, and a corner of the supply's program.

With transport and without they are the same: what differs is the mode of contact.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibroplat.hybrid.modes import (
    ATTACHED,
    BARE,
    CHATTER,
    FLIGHT,
    IMPACT,
    LIFTOFF,
    REVERSAL,
    SLIP,
    SLIP_MINUS,
    SLIP_PLUS,
    STICK,
    STOP,
    SUPPLY,
    guard_form,
)
from vibroplat.hybrid.starts import (
    close_piece,
    contact_force,
    contact_holds_at_start,
    forget_starts,
    may_shift,
    move_to,
    prepare_consistent_start,
)
from vibroplat.hybrid.state import AFTER_EVENT, DIFFERENTIATED, RESTARTED, RUNNING, Automaton, end_at, fill_cubic
from vibroplat.hybrid.transitions import ACCUMULATE, ATTACH, FLY, after_impact
from vibroplat.kernels.compiled import FloatArray, compiled, copy, inlined
from vibroplat.model.impact import remaining_impacts
from vibroplat.model.sliding import Blow, chatter, strike
from vibroplat.model.systems import (
    ALGEBRAIC,
    ALONG_RATE,
    DIFFERENTIAL,
    GAP,
    GAP_RATE,
    MOVING_SIZE,
    SENSE,
    SIZES,
    gather,
    scatter,
)

#: Impacts that an event stands for; integers of numpy, see :mod:`vibroplat.hybrid.modes`.
_COUNTS: Any = np.arange(2)
_NONE, _ONE = _COUNTS

_EPS = float(np.finfo(float).eps)


@inlined
def guard_at_start(h: Automaton) -> tuple[float, float]:
    """Value and rate of the guard that has fallen, at the prepared start of the present mode."""
    run = h.run
    first, weight, second, other = guard_form(run.systems[run.mode], run.fallen, h.p)
    y, yp = run.y[run.mode], run.yp[run.mode]
    return weight * y[first] + other * y[second], weight * yp[first] + other * yp[second]


@inlined
def meet_guard(h: Automaton, last: int) -> None:
    """Let the last step end exactly where the guard falls: gap or ṡ are 0 there, forces by the algebra at their limit.

    The integrator finds the root of forces as it interpolates them, which satisfy the equations only to its tolerance;
    flight must begin without a force, or the gap begins with an acceleration.
    """
    run, steps, mode = h.run, h.steps, h.run.mode
    system = run.systems[mode]
    place = guard_form(system, run.fallen, h.p)[0]
    if place < DIFFERENTIAL[system]:
        steps.ends[last, place] = 0.0  # the root is found to round-off
        return
    move_to(h, system, steps.ends[last])
    if not prepare_consistent_start(h, mode, DIFFERENTIATED):
        return
    value, rate = guard_at_start(h)
    shift = -value / rate if rate < 0.0 else 0.0
    if not may_shift(h, shift):
        return
    length, moved = steps.length[last] + shift, np.empty(SIZES[system])
    run.now += shift
    for i in range(DIFFERENTIAL[system]):
        moved[i] = run.y[mode, i] + shift * (run.yp[mode, i] + 0.5 * shift * run.ypp[mode, i])
    move_to(h, system, moved)
    # no better there
    if not prepare_consistent_start(h, mode, DIFFERENTIATED) or abs(guard_at_start(h)[0]) > abs(value):
        run.outcome = RUNNING
        run.now -= shift
        move_to(h, system, steps.ends[last])
        return
    end_at(steps, last, length / steps.length[last], run.y[mode, : SIZES[system]])


@compiled
def contact_mode(h: Automaton) -> int:
    """Find the mode of the present state, whose gap is 0 and closed, FLIGHT if nothing presses the layer on.

    Its start is prepared; −1, with the outcome set, where there is none. A material that rests sticks while static
    friction holds it, and otherwise slips against the force that would be needed.
    """
    mode = mode_by_slip(h)
    if not prepare_consistent_start(h, mode, DIFFERENTIATED):
        return -1
    if mode == STICK and not friction_holds(h):
        # where sticking would pull, slipping may press all the same: the force then needed has the sense of the slip
        mode = SLIP_MINUS if friction_force(h, STICK) > 0.0 else SLIP_PLUS
        if not prepare_consistent_start(h, mode, DIFFERENTIATED):
            return -1
    return mode if contact_holds_at_start(h, mode) else FLIGHT


@inlined
def mode_by_slip(h: Automaton) -> int:
    """Mode of contact by the sense of slip; on a smooth deck slip has none, and without transport there is no slip."""
    slip = h.run.state[ALONG_RATE]
    if h.run.systems[STICK] < 0:
        return ATTACHED
    if slip > 0.0 or h.p.static_friction == 0.0:
        return SLIP_PLUS
    return SLIP_MINUS if slip < 0.0 else STICK


@inlined
def friction_force(h: Automaton, mode: int) -> float:
    """F_t at the prepared start of a mode of contact with friction (N)."""
    return h.run.y[mode, DIFFERENTIAL[h.run.systems[mode]] + 1]


@inlined
def friction_holds(h: Automaton) -> bool:
    """Whether static friction holds the material at the prepared start of stick."""
    limit = h.p.static_friction * contact_force(h, STICK)[0]
    return contact_holds_at_start(h, STICK) and abs(friction_force(h, STICK)) <= limit


@inlined
def take_mode(h: Automaton, mode: int) -> None:
    """Begin a mode at a closed gap: contact, or flight that opens it."""
    run = h.run
    run.mode = mode
    run.zeros = 2 if mode == FLIGHT else 0  # gap and its rate
    run.other_zeros = 1 if SENSE[run.systems[mode]] != 0.0 and run.state[ALONG_RATE] == 0.0 else 0


@inlined
def change_of(before: int, mode: int) -> int:
    """Kind of the event by which one mode of contact becomes another mode."""
    if mode == FLIGHT:
        return LIFTOFF
    if mode == STICK:
        return STOP
    return SLIP if before == STICK else REVERSAL


@inlined
def go_on(h: Automaton) -> None:
    """Go on in the same mode after the guard has only touched 0."""
    h.run.joined = RESTARTED
    if h.run.fallen == 0:
        h.run.zeros = 1
    else:
        h.run.other_zeros = 1


@inlined
def lift(h: Automaton) -> None:
    """End contact where F_c is 0."""
    h.run.mode = FLIGHT
    h.run.zeros = 3  # gap, its rate and its acceleration
    add_event(h, LIFTOFF, 0.0, h.run.state[ALONG_RATE], Blow(0.0, 0.0, 0.0), _NONE)


@inlined
def apply_liftoff(h: Automaton) -> None:
    """End contact where F_c has fallen through zero, or go on if it only touched."""
    mode = h.run.mode
    if not prepare_consistent_start(h, mode, DIFFERENTIATED):
        return
    if contact_force(h, mode)[1] >= 0.0 and contact_holds_at_start(h, mode):
        go_on(h)
    else:
        lift(h)


@compiled
def end_stick(h: Automaton) -> None:
    """Let the material slip where F_t has left its cone, or lift off if F_c has fallen as well.

    Where friction has nothing to hold, as in a symmetric machine, both guards fall at once, but for errors of F_t that
    the tolerance allows. With one coefficient of friction s̈ is 0 there, and ṡ begins with t²; with two with t.
    """
    run = h.run
    if not prepare_consistent_start(h, STICK, DIFFERENTIATED):
        return
    force, rate = contact_force(h, STICK)
    if force <= run.force_error and rate < 0.0:
        lift(h)
        return
    if guard_at_start(h)[1] >= 0.0:
        go_on(h)
        return
    mode = SLIP_MINUS if run.fallen == 0 else SLIP_PLUS
    if not prepare_consistent_start(h, mode, DIFFERENTIATED):
        return
    if not contact_holds_at_start(h, mode):
        lift(h)
        return
    run.mode = mode
    run.other_zeros = 2 if h.p.static_friction == h.p.kinetic_friction else 1
    add_event(h, SLIP, 0.0, 0.0, Blow(0.0, 0.0, 0.0), _NONE)


@compiled
def end_slip(h: Automaton) -> None:
    """Let the material stick where slip has ended, slip the other way, or go on if its rate only touched 0."""
    run = h.run
    before = run.mode
    run.state[ALONG_RATE] = 0.0
    mode = contact_mode(h)
    if mode < 0:
        return
    if mode == before:
        go_on(h)
        return
    take_mode(h, mode)
    add_event(h, change_of(before, mode), 0.0, 0.0, Blow(0.0, 0.0, 0.0), _NONE)


@inlined
def apply_impact(h: Automaton) -> None:
    """Let the lower layer strike where the gap has fallen through zero."""
    run = h.run
    run.state[GAP] = 0.0
    slip = run.state[ALONG_RATE]
    before = min(run.state[GAP_RATE], 0.0)
    run.state[GAP_RATE] = before
    struck = run.state.copy()
    resolved = -before >= run.slowest
    restitution = 0.0 if -before < h.p.sticking_speed else h.p.restitution
    blow, following, mode = rebound_from(h, struck, restitution, resolved)
    if following == FLY and not resolved:
        # a rebound that round-off of the platform's motion could not resolve is none
        blow, following, mode = rebound_from(h, struck, 0.0, resolved)
    if following < 0:
        return
    if following == ATTACH:
        take_mode(h, mode)
    else:
        run.mode, run.zeros = FLIGHT, 1 if run.state[GAP_RATE] > 0.0 else 2
    add_event(h, IMPACT, before, slip, blow, _ONE)
    if following == ACCUMULATE and run.outcome == RUNNING:
        apply_chatter(h)
    elif following == ACCUMULATE:  # the run stops here
        run.accumulating = 1


@compiled
def rebound_from(h: Automaton, struck: FloatArray, restitution: float, resolved: bool) -> tuple[Blow, int, int]:
    """Move to the state after an impact; what follows, −1 if nothing can, and the mode of contact."""
    run = h.run
    blow = strike(struck, run.state, restitution, h.p)
    forget_starts(h)
    mode = contact_mode(h)
    if mode < 0 or not prepare_consistent_start(h, FLIGHT, DIFFERENTIATED):
        return blow, -1, mode
    place = SIZES[run.systems[FLIGHT]] // 2 + GAP
    acceleration, jerk = run.yp[FLIGHT, place], run.ypp[FLIGHT, place]
    rate, pressed = run.state[GAP_RATE], mode != FLIGHT
    following = after_impact(rate, acceleration, jerk, resolved, pressed, run.tolerance, run.speed, h.p)
    return blow, following, mode


@compiled
def close_chatter(h: Automaton, duration: float, end: FloatArray) -> None:
    """Write impacts that accumulate as one step, a cubic to the unknowns in flight at its end, and close the piece."""
    run, steps, row, size = h.run, h.steps, h.steps.used.steps, end.size
    start, start_slope, slope, half = run.y[FLIGHT, :size], run.yp[FLIGHT, :size], np.empty(size), size // 2
    steps.start[row], steps.length[row] = 0.0, duration
    for i in range(half):
        slope[i], slope[half + i] = end[half + i], start_slope[half + i]
    fill_cubic(steps.c[row], duration, start, end, start_slope, slope)
    copy(end, steps.ends[row])
    steps.used.steps = row + 1
    run.origin = run.now
    close_piece(h, run.now + duration)


@compiled
def apply_chatter(h: Automaton) -> None:
    """Carry the run through the impacts that accumulate, to where they end."""
    run = h.run
    system = run.systems[FLIGHT]
    after, rates, end = np.empty(MOVING_SIZE), np.empty(MOVING_SIZE), np.empty(SIZES[system])
    scatter(system, run.yp[FLIGHT], rates)
    duration, blow = chatter(run.state.copy(), rates, after, h.p)
    if run.now + duration >= run.end:
        return  # the run ends before they do: follow them
    rebound, slip = run.state[GAP_RATE], run.state[ALONG_RATE]
    gather(system, after, end)
    close_chatter(h, duration, end)
    copy(after, run.state)
    forget_starts(h)
    mode = contact_mode(h)
    if mode < 0:
        return
    take_mode(h, mode)
    skipped = math.ceil(min(remaining_impacts(rebound, h.p), math.log(_EPS) / math.log(h.p.restitution)))
    add_event(h, CHATTER, -rebound, slip, blow, skipped)


@compiled
def apply_supply_corner(h: Automaton, listed: bool) -> None:
    """Go on under another supply, which the parameters hold already: torques may jump, and with them F_c and F_t.

    ``listed`` says whether the corner is an event of the list.
    """
    run, none = h.run, Blow(0.0, 0.0, 0.0)
    before = run.mode
    forget_starts(h)
    if before not in (FLIGHT, BARE):
        mode = contact_mode(h)
        if mode < 0:
            return
        if mode != before:
            take_mode(h, mode)
    changes = run.mode != before
    if listed or changes:
        run.joined = AFTER_EVENT
    if listed:
        add_event(h, SUPPLY, 0.0, run.state[ALONG_RATE], none, _NONE)
        h.events[run.events - 1].mode_after = before
    if changes:
        add_event(h, change_of(before, run.mode), 0.0, run.state[ALONG_RATE], none, _NONE)


@compiled
def record_restart_events(h: Automaton, attached: bool, corner: bool) -> None:
    """List what happens where a run continues from another: a corner of the supply, the end of contact."""
    slip, none = h.run.state[ALONG_RATE], Blow(0.0, 0.0, 0.0)
    if corner:
        add_event(h, SUPPLY, 0.0, slip, none, _NONE)
    if attached and h.run.mode == FLIGHT:
        add_event(h, LIFTOFF, 0.0, slip, none, _NONE)


@compiled
def add_event(h: Automaton, kind: int, before: float, slip: float, blow: Blow, impacts: int) -> None:
    """Write an event, with rates of gap and slip before it; the mode is the one after it, its start prepared."""
    run = h.run
    mode, event = run.mode, h.events[run.events]
    system = run.systems[mode]
    touches = ALGEBRAIC[system]
    event.t, event.kind, event.rate_before = run.now, kind, before
    event.rate_after = run.state[GAP_RATE] if kind == IMPACT else 0.0
    event.impulse, event.loss, event.friction_impulse = blow.normal, blow.loss, blow.along
    event.force_after = contact_force(h, mode)[0] if touches else 0.0
    event.friction_after = friction_force(h, mode) if touches else 0.0
    event.mode_after, event.impacts = mode, impacts
    event.slip_before, event.slip_after = slip, run.state[ALONG_RATE]
    run.events += 1


@inlined
def apply_reset(h: Automaton) -> None:
    """Apply the reset of the mode whose guard has fallen."""
    if h.run.mode == FLIGHT:
        apply_impact(h)
    elif h.run.mode == STICK:
        end_stick(h)
    elif h.run.fallen == 1:
        end_slip(h)
    else:
        apply_liftoff(h)
