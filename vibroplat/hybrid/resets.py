"""Resets of the automaton: liftoff, impact, chatter, and a corner of the supply's program.

Before them what they need: the consistent start of a mode at the present state, and the piece that ends there.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import carray  # type: ignore[attr-defined]

from vibroplat.hybrid.modes import ATTACHED, CHATTER, FLIGHT, IMPACT, LIFTOFF, SUPPLY
from vibroplat.hybrid.state import (
    AFTER_EVENT,
    CONSISTENT,
    CUT,
    DIFFERENTIATED,
    INCONSISTENT,
    OUTSIDE_MODEL,
    RESTARTED,
    RUNNING,
    STALE,
    Automaton,
    fill_cubic,
    gather_unknowns,
    scatter_unknowns,
)
from vibroplat.hybrid.transitions import ACCUMULATE, ATTACH, FLY, after_impact, contact_holds
from vibroplat.kernels.compiled import FloatArray, call_int, callback, compiled, copy, inlined
from vibroplat.model.accelerations import accelerations, second_derivatives
from vibroplat.model.impact import chatter_map, impact, remaining_impacts
from vibroplat.model.parameters import PARAMETERS
from vibroplat.model.systems import DIFFERENTIAL, FULL_SIZE, GAP, GAP_RATE, SIZES, gather, scatter


@callback("int32(int64, float64, CPointer(float64), CPointer(float64), CPointer(float64), voidptr, int64)")
def start_callback(system: int, t: float, y: Any, yp: Any, ypp: Any, parameters: Any, order: int) -> int:
    """Fill F_c and first derivatives, with ``order`` DIFFERENTIATED second ones too; 0 where there are none."""
    size = SIZES[system]
    p = carray(parameters, (1,), dtype=PARAMETERS)[0]
    unknowns, rates = carray(y, (size,)), carray(yp, (size,))
    if not accelerations(system, t, unknowns, rates, p):
        return 0
    if order == CONSISTENT:
        return 1
    return 1 if second_derivatives(system, t, unknowns, rates, carray(ypp, (size,)), p) else 0


@compiled
def derivatives(h: Automaton, system: int, y: FloatArray, yp: FloatArray, ypp: FloatArray, order: int) -> bool:
    """Call :func:`start_callback` by address, so that the model is compiled into one place only."""
    addresses = (y.ctypes.data, yp.ctypes.data, ypp.ctypes.data)
    return call_int(h.start, (system, h.run.now, *addresses, h.parameters, order)) != 0


@compiled
def prepare_consistent_start(h: Automaton, mode: int, order: int) -> bool:
    """Prepare the start of a mode at the present state; False, with the outcome set, if there is none.

    ``order`` is CONSISTENT (F_c and first derivatives) or DIFFERENTIATED (second derivatives as well).
    """
    run = h.run
    system = run.systems[mode]
    if run.fresh[mode] >= order:
        return True
    if run.fresh[mode] == STALE:
        gather_unknowns(run, system, run.y[mode])
    if not derivatives(h, system, run.y[mode], run.yp[mode], run.ypp[mode], order):
        run.outcome = OUTSIDE_MODEL if is_outside_model(h) else INCONSISTENT
        return False
    run.fresh[mode] = order
    return True


@compiled
def move_to(h: Automaton, system: int, y: FloatArray) -> None:
    """Make a system's unknowns the present state."""
    scatter_unknowns(h.run, system, y)
    forget_starts(h)


#: Rate of the platform's rotation, over the synchronous speed, that only a motion has which runs away in finite time.
#: It is about to turn too far, and an engine may fail on its way there.
RUNAWAY = 1e6


@inlined
def forget_starts(h: Automaton) -> None:
    """Say that the present state is another."""
    for mode in range(h.run.fresh.size):
        h.run.fresh[mode] = STALE


@inlined
def is_outside_model(h: Automaton) -> bool:
    """Whether the platform has turned so far that the model may have no motion there, or is about to in no time."""
    return abs(h.run.state[2]) > h.p.safe_rotation or abs(h.run.state[9]) > RUNAWAY * h.run.speed


@inlined
def contact_force(h: Automaton, mode: int) -> tuple[float, float]:
    """F_c and its rate at the prepared start of a mode of contact (N, N/s)."""
    force = DIFFERENTIAL[h.run.systems[mode]]
    return h.run.y[mode, force], h.run.yp[mode, force]


@inlined
def contact_holds_at_start(h: Automaton, mode: int) -> bool:
    """Whether contact holds at the prepared start of a mode of it."""
    force, rate = contact_force(h, mode)
    return contact_holds(force, rate, h.run.force_noise, h.run.speed)


@inlined
def last_end(h: Automaton) -> float:
    """When the last step ends (s), in the time of the run."""
    row = h.steps.used.steps - 1
    return h.run.origin + (h.steps.start[row] + h.steps.length[row])


#: Farthest that the end of contact is moved, over the last two steps.
MAX_SHIFT = 0.1


@inlined
def may_shift(h: Automaton, shift: float) -> bool:
    """Whether the end of the last step may be moved by a time (s) to where forces by the algebra reach their limit.

    A longer way is none of the integrator's error: F_c and its rate by the algebra do not belong together, as where a
    stiff layer turns an error of its rate, which the tolerance allows, into a force.
    """
    steps, last = h.steps, h.steps.used.steps - 1
    length = steps.length[last] + shift
    longest = MAX_SHIFT * (steps.length[last] + (steps.length[last - 1] if last > steps.used.first else 0.0))
    return abs(shift) <= longest and min(length, steps.length[last]) > 0.0 and steps.start[last] + length <= h.run.until


@compiled
def close_piece(h: Automaton, end: float) -> None:
    """Add the open piece to the list of pieces, and move to its end, a time of the run (s)."""
    run, used = h.run, h.steps.used
    system = run.systems[run.mode]
    piece = h.steps.pieces[used.pieces]
    piece.first, piece.end, piece.system = used.first, used.steps, system
    piece.origin, piece.until = run.origin, end
    piece.turns[0], piece.turns[1] = run.turns[0], run.turns[1]
    piece.joined, piece.events = run.joined, run.events
    used.pieces += 1
    used.first = used.steps
    run.joined, run.zeros, run.other_zeros = AFTER_EVENT, 0, 0
    run.now = end
    if piece.end > piece.first:
        move_to(h, system, h.steps.ends[used.steps - 1])


@compiled
def cut_piece(h: Automaton) -> None:
    """Close the open piece because there is no room for more steps; the next one continues from its end."""
    if h.steps.used.steps > h.steps.used.first:
        close_piece(h, last_end(h))
        h.run.joined = CUT


#: Impacts that an event stands for; integers of numpy, see :mod:`vibroplat.hybrid.modes`.
_COUNTS: Any = np.arange(2)
_NONE, _ONE = _COUNTS

_EPS = float(np.finfo(float).eps)


@inlined
def apply_liftoff(h: Automaton) -> None:
    """End contact where F_c has fallen through zero, or go on if it only touched."""
    if not prepare_consistent_start(h, ATTACHED, DIFFERENTIATED):
        return
    if contact_force(h, ATTACHED)[1] >= 0.0 and contact_holds_at_start(h, ATTACHED):
        h.run.joined = RESTARTED
        h.run.zeros = 1
        return
    h.run.mode = FLIGHT
    h.run.zeros = 3  # gap, its rate and its acceleration
    add_event(h, LIFTOFF, 0.0, 0.0, 0.0, 0.0, 0.0, _NONE)


@inlined
def apply_impact(h: Automaton) -> None:
    """Let the lower layer strike where the gap has fallen through zero."""
    run = h.run
    run.state[GAP] = 0.0
    before = min(run.state[GAP_RATE], 0.0)
    run.state[GAP_RATE] = before
    struck = run.state.copy()
    resolved = -before >= run.slowest
    restitution = 0.0 if -before < h.p.sticking_speed else h.p.restitution
    impulse, loss, following = rebound_from(h, struck, restitution, resolved)
    if following == FLY and not resolved:
        # a rebound that round-off of the platform's motion could not resolve is none
        impulse, loss, following = rebound_from(h, struck, 0.0, resolved)
    if following < 0:
        return
    rebound = run.state[GAP_RATE]
    run.mode = ATTACHED if following == ATTACH else FLIGHT
    if run.mode == FLIGHT:
        run.zeros = 1 if rebound > 0.0 else 2
    force = contact_force(h, ATTACHED)[0] if following == ATTACH else 0.0
    add_event(h, IMPACT, before, rebound, impulse, loss, force, _ONE)
    if following == ACCUMULATE and run.outcome == RUNNING:
        apply_chatter(h)
    elif following == ACCUMULATE:  # the run stops here
        run.accumulating = 1


@compiled
def rebound_from(h: Automaton, struck: FloatArray, restitution: float, resolved: bool) -> tuple[float, float, int]:
    """Move to the state after an impact; its impulse (N·s) and loss (J) and what follows, −1 if nothing can."""
    run = h.run
    after = np.empty(FULL_SIZE)
    impulse, loss = impact(struck, after, restitution, h.p)
    copy(after, run.state)
    forget_starts(h)
    for mode in (ATTACHED, FLIGHT):
        if not prepare_consistent_start(h, mode, DIFFERENTIATED):
            return impulse, loss, -1
    place = SIZES[run.systems[FLIGHT]] // 2 + GAP
    acceleration, jerk = run.yp[FLIGHT, place], run.ypp[FLIGHT, place]
    pressed, rate = contact_holds_at_start(h, ATTACHED), after[GAP_RATE]
    following = after_impact(rate, acceleration, jerk, resolved, pressed, run.tolerance, run.speed, h.p)
    return impulse, loss, following


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
    """Sum up the impacts that accumulate, and carry the run to where they end."""
    run = h.run
    system = run.systems[FLIGHT]
    size = SIZES[system]
    after, rates, end = np.empty(FULL_SIZE), np.empty(FULL_SIZE), np.empty(size)
    scatter(system, run.yp[FLIGHT], rates)
    duration, impulse, loss = chatter_map(run.state.copy(), rates[7:], after, h.p)
    if run.now + duration >= run.end:
        return  # the run ends before they do: follow them
    rebound = run.state[GAP_RATE]
    gather(system, after, end)
    close_chatter(h, duration, end)
    copy(after, run.state)
    forget_starts(h)
    if not prepare_consistent_start(h, ATTACHED, DIFFERENTIATED):
        return
    run.mode = ATTACHED if contact_holds_at_start(h, ATTACHED) else FLIGHT
    run.zeros = 2 if run.mode == FLIGHT else 0
    force = contact_force(h, ATTACHED)[0] if run.mode == ATTACHED else 0.0
    skipped = math.ceil(min(remaining_impacts(rebound, h.p), math.log(_EPS) / math.log(h.p.restitution)))
    add_event(h, CHATTER, -rebound, 0.0, impulse, loss, force, skipped)


@compiled
def apply_supply_corner(h: Automaton, listed: bool) -> None:
    """Go on under another supply, which the parameters hold already: torques may jump, and with them F_c.

    ``listed`` says whether the corner is an event of the list.
    """
    run = h.run
    forget_starts(h)
    force, lifts = 0.0, False
    if run.mode == ATTACHED:
        if not prepare_consistent_start(h, ATTACHED, DIFFERENTIATED):
            return
        lifts = not contact_holds_at_start(h, ATTACHED)
        force = 0.0 if lifts else contact_force(h, ATTACHED)[0]
    if listed:
        run.joined = AFTER_EVENT
        add_event(h, SUPPLY, 0.0, 0.0, 0.0, 0.0, force, _NONE)
    if lifts:
        run.joined = AFTER_EVENT
        run.mode = FLIGHT
        run.zeros = 2  # gap and its rate
        add_event(h, LIFTOFF, 0.0, 0.0, 0.0, 0.0, 0.0, _NONE)


@compiled
def record_restart_events(h: Automaton, attached: bool, corner: bool) -> None:
    """List what happens where a run continues from another: a corner of the supply, the end of contact."""
    run = h.run
    lifts = attached and run.mode == FLIGHT
    force = contact_force(h, ATTACHED)[0] if run.mode == ATTACHED else 0.0
    if corner:
        add_event(h, SUPPLY, 0.0, 0.0, 0.0, 0.0, force, _NONE)
    if lifts:
        add_event(h, LIFTOFF, 0.0, 0.0, 0.0, 0.0, 0.0, _NONE)


@compiled
def add_event(
    h: Automaton, kind: int, before: float, after: float, impulse: float, loss: float, force: float, impacts: int
) -> None:
    """Write an event; the mode is already the one after it."""
    run = h.run
    event = h.events[run.events]
    event.t, event.kind, event.rate_before, event.rate_after = run.now, kind, before, after
    event.impulse, event.loss, event.force_after = impulse, loss, force
    event.mode_after, event.impacts = run.mode, impacts
    run.events += 1
