"""Resets of contact with friction: slip, stick, reversal, liftoff out of slip, impacts and chatter with slip."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibroplat.hybrid.modes import (
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
from vibroplat.hybrid.resets import (
    add_event,
    close_chatter,
    contact_force,
    contact_holds_at_start,
    forget_starts,
    may_shift,
    move_to,
    prepare_consistent_start,
)
from vibroplat.hybrid.state import (
    AFTER_EVENT,
    DIFFERENTIATED,
    RESTARTED,
    RUNNING,
    Automaton,
    end_at,
    gather_unknowns,
)
from vibroplat.hybrid.transitions import ACCUMULATE, FLY, after_impact
from vibroplat.kernels.compiled import compiled, copy, inlined
from vibroplat.model.sliding import NO_REBOUND, Blow, sliding_chatter, sliding_impact
from vibroplat.model.systems import ALGEBRAIC, DIFFERENTIAL, GAP, GAP_RATE, SENSE, SIZES

# Impacts that an event stands for; integers of numpy, see :mod:`vibroplat.hybrid.modes`.
_COUNTS: Any = np.arange(2)
_NONE, _ONE = _COUNTS


@compiled
def contact_mode(h: Automaton) -> int:
    """Find the mode of the present state, whose gap is 0 and closed, FLIGHT if nothing presses the layer on.

    Its start is prepared; −1, with the outcome set, where there is none. A material that rests sticks while static
    friction holds it, and otherwise slips against the force that would be needed.
    """
    run, p = h.run, h.p
    rests = run.along[1] == 0.0
    mode = STICK if rests else (SLIP_PLUS if run.along[1] > 0.0 else SLIP_MINUS)
    if p.static_friction == 0.0:
        mode = SLIP_PLUS
    if not prepare_consistent_start(h, mode, DIFFERENTIATED):
        return -1
    if mode == STICK:
        force = DIFFERENTIAL[run.systems[STICK]]
        needed = run.y[STICK, force + 1]
        if contact_holds_at_start(h, STICK) and abs(needed) <= p.static_friction * run.y[STICK, force]:
            return STICK
        # where sticking would pull, slipping may press all the same: the force then needed has the sense of the slip
        mode = SLIP_MINUS if needed > 0.0 else SLIP_PLUS
        if not prepare_consistent_start(h, mode, DIFFERENTIATED):
            return -1
    return mode if contact_holds_at_start(h, mode) else FLIGHT


@compiled
def take_mode(h: Automaton, mode: int) -> None:
    """Begin a mode at a closed gap: contact, or flight that opens it."""
    run = h.run
    run.mode = mode
    run.zeros = 2 if mode == FLIGHT else 0  # gap and its rate
    slips = mode != FLIGHT and SENSE[run.systems[mode]] != 0.0
    run.other_zeros = 1 if slips and run.along[1] == 0.0 else 0


@compiled
def begin_sliding(h: Automaton) -> None:
    """Choose the mode of a state whose gap is 0 and is not opening."""
    mode = contact_mode(h)
    if mode >= 0:
        take_mode(h, mode)


@compiled
def friction_after(h: Automaton) -> float:
    """F_t in the present mode (N), whose start is prepared."""
    system = h.run.systems[h.run.mode]
    return h.run.y[h.run.mode, DIFFERENTIAL[system] + 1] if ALGEBRAIC[system] else 0.0


@compiled
def add_sliding_event(h: Automaton, kind: int, before: float, slip: float, blow: Blow, impacts: int) -> None:
    """Write an event of contact with friction, with rates of gap and slip before it; the mode is the one after it."""
    run = h.run
    force = contact_force(h, run.mode)[0] if ALGEBRAIC[run.systems[run.mode]] else 0.0
    event = h.events[run.events]
    event.slip_before, event.slip_after = slip, run.along[1]
    event.friction_impulse, event.friction_after = blow.along, friction_after(h)
    add_event(h, kind, before, run.state[GAP_RATE], blow.normal, blow.loss, force, impacts)


@inlined
def guard_by_algebra(h: Automaton) -> tuple[float, float]:
    """Value and rate of the guard that has fallen, by the prepared start of the present mode."""
    run = h.run
    first, weight, second, other = guard_form(run.systems[run.mode], run.fallen, h.p)
    y, yp = run.y[run.mode], run.yp[run.mode]
    return weight * y[first] + other * y[second], weight * yp[first] + other * yp[second]


@compiled
def prepare_sliding_end(h: Automaton) -> None:
    """Let the last step end exactly where its guard falls: gap or ṡ are 0 there, forces by the algebra at their limit.

    A guard of forces is found as the integrator interpolates them, see
    :func:`vibroplat.hybrid.loop.refine_liftoff_time`.
    """
    run, steps = h.run, h.steps
    mode, last = run.mode, h.steps.used.steps - 1
    system = run.systems[mode]
    if not ALGEBRAIC[system]:
        steps.ends[last, GAP] = 0.0
        return
    if mode != STICK and run.fallen == 1:
        steps.ends[last, DIFFERENTIAL[system] - 1] = 0.0
        return
    move_to(h, system, steps.ends[last])
    if not prepare_consistent_start(h, mode, DIFFERENTIATED):
        return
    value, rate = guard_by_algebra(h)
    shift = -value / rate if rate < 0.0 else 0.0
    if shift == 0.0 or not may_shift(h, shift):
        return
    run.now += shift
    moved = np.empty(SIZES[system])
    for i in range(DIFFERENTIAL[system]):
        moved[i] = run.y[mode, i] + shift * (run.yp[mode, i] + 0.5 * shift * run.ypp[mode, i])
    move_to(h, system, moved)
    if not prepare_consistent_start(h, mode, DIFFERENTIATED) or abs(guard_by_algebra(h)[0]) > abs(value):
        run.outcome = RUNNING
        run.now -= shift
        move_to(h, system, steps.ends[last])
        return
    end_at(steps, last, 1.0 + shift / steps.length[last], run.y[mode, : SIZES[system]])


@compiled
def apply_sliding_event(h: Automaton) -> None:
    """Apply the reset at the end of a segment whose guard has fallen."""
    run = h.run
    if run.mode == FLIGHT:
        apply_sliding_impact(h)
    elif run.mode == STICK:
        end_stick(h)
    elif run.fallen == 1:
        end_slip(h)
    elif prepare_consistent_start(h, run.mode, DIFFERENTIATED):
        if contact_force(h, run.mode)[1] >= 0.0 and contact_holds_at_start(h, run.mode):
            go_on(h)
        else:
            lift(h)


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
    add_sliding_event(h, LIFTOFF, 0.0, h.run.along[1], Blow(0.0, 0.0, 0.0), _NONE)


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
    if guard_by_algebra(h)[1] >= 0.0:
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
    add_sliding_event(h, SLIP, 0.0, 0.0, Blow(0.0, 0.0, 0.0), _NONE)


@compiled
def end_slip(h: Automaton) -> None:
    """Let the material stick where slip has ended, slip the other way, or go on if its rate only touched 0."""
    run = h.run
    before = run.mode
    run.along[1] = 0.0
    mode = contact_mode(h)
    if mode < 0:
        return
    if mode == before:
        go_on(h)
        return
    take_mode(h, mode)
    kind = LIFTOFF if mode == FLIGHT else (STOP if mode == STICK else REVERSAL)
    add_sliding_event(h, kind, 0.0, 0.0, Blow(0.0, 0.0, 0.0), _NONE)


@compiled
def apply_sliding_impact(h: Automaton) -> None:
    """Let the lower layer strike where the gap has fallen through zero, see ``apply_impact``."""
    run = h.run
    run.state[GAP] = 0.0
    before, slip = min(run.state[GAP_RATE], 0.0), run.along[1]
    run.state[GAP_RATE] = before
    struck, place = run.state.copy(), run.along[0]
    resolved = -before >= run.slowest
    restitution = 0.0 if -before < h.p.sticking_speed else h.p.restitution
    blow, following, mode = sliding_rebound(h, restitution, resolved)
    if following == FLY and not resolved:
        copy(struck, run.state)
        run.along[0], run.along[1] = place, slip
        blow, following, mode = sliding_rebound(h, 0.0, resolved)
    if following < 0:
        return
    rebound = run.state[GAP_RATE]
    if following in (FLY, ACCUMULATE):
        run.mode, run.zeros = FLIGHT, 1 if rebound > 0.0 else 2
    else:
        take_mode(h, mode)
    add_sliding_event(h, IMPACT, before, slip, blow, _ONE)
    if following == ACCUMULATE and run.outcome == RUNNING:
        apply_sliding_chatter(h)
    elif following == ACCUMULATE:  # the run stops here
        run.accumulating = 1


@compiled
def sliding_rebound(h: Automaton, restitution: float, resolved: bool) -> tuple[Blow, int, int]:
    """Move to the state after an impact; what follows, −1 if nothing can, and the mode of contact."""
    run = h.run
    blow = sliding_impact(run.state, run.along, restitution, h.p)
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
def apply_sliding_chatter(h: Automaton) -> None:
    """Carry the run through the impacts that accumulate, one by one, to where they end, see ``apply_chatter``."""
    run = h.run
    system = run.systems[FLIGHT]
    size = SIZES[system]
    half = size // 2
    a, state, along = np.zeros(8), run.state.copy(), run.along.copy()
    for i in range(GAP + 1):
        a[i] = run.yp[FLIGHT, half + i]
    if half > GAP + 2:
        a[6] = run.yp[FLIGHT, half + 6]
    a[7] = run.yp[FLIGHT, size - 1]
    duration, blow = sliding_chatter(state, along, a, h.p)
    if run.now + duration >= run.end:
        return  # the run ends before they do: follow them
    rebound, slip, end = run.state[GAP_RATE], run.along[1], np.empty(size)
    copy(state, run.state)
    copy(along, run.along)
    gather_unknowns(run, system, end)
    close_chatter(h, duration, end)
    copy(state, run.state)
    copy(along, run.along)
    forget_starts(h)
    mode = contact_mode(h)
    if mode < 0:
        return
    take_mode(h, mode)
    skipped = math.ceil(math.log(NO_REBOUND) / math.log(h.p.restitution))
    add_sliding_event(h, CHATTER, -rebound, slip, blow, skipped)


@compiled
def apply_sliding_corner(h: Automaton, listed: bool) -> None:
    """Go on under another supply, see :func:`vibroplat.hybrid.resets.apply_supply_corner`."""
    run, before, none = h.run, h.run.mode, Blow(0.0, 0.0, 0.0)
    forget_starts(h)
    if before != FLIGHT:
        mode = contact_mode(h)
        if mode < 0:
            return
        if mode != before:
            take_mode(h, mode)
    if listed:
        run.joined = AFTER_EVENT
        add_sliding_event(h, SUPPLY, 0.0, run.along[1], none, _NONE)
    if run.mode != before:
        run.joined = AFTER_EVENT
        add_sliding_event(h, LIFTOFF if run.mode == FLIGHT else SLIP, 0.0, run.along[1], none, _NONE)
