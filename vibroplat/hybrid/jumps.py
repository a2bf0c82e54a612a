"""Jumps of the automaton: liftoff, impact, latch, and a corner of the drive's program."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibroplat.hybrid.modes import ATTACHED, DRIVE, FLIGHT, IMPACT, LATCH, LIFTOFF
from vibroplat.hybrid.pieces import close_piece
from vibroplat.hybrid.rules import ACCUMULATE, ATTACH, FLY, after_impact
from vibroplat.hybrid.starts import contact_force, forget_starts, prepare, pressing
from vibroplat.hybrid.state import DIFFERENTIATED, OK, RUNNING, Automaton
from vibroplat.hybrid.steps import AFTER_EVENT, RESTARTED, fill_cubic
from vibroplat.kernels.compiled import FloatArray, compiled, copy, inlined
from vibroplat.model.impact import impact, impacts_left, latch
from vibroplat.model.systems import FULL_SIZE, GAP, GAP_RATE, SIZES, gather, scatter

#: Impacts that an event stands for; integers of numpy, see :mod:`vibroplat.hybrid.modes`.
_COUNTS: Any = np.arange(2)
_NONE, _ONE = _COUNTS

_EPS = float(np.finfo(float).eps)


@inlined
def lift_off(h: Automaton) -> None:
    """End contact where F_c has fallen through zero, or go on if it only touched."""
    if not prepare(h, ATTACHED, DIFFERENTIATED):
        return
    if contact_force(h)[1] >= 0.0 and pressing(h):
        h.run.joined = RESTARTED
        h.run.zeros = 1
        return
    h.run.mode = FLIGHT
    h.run.zeros = 3  # gap, its rate and its acceleration
    add_event(h, LIFTOFF, 0.0, 0.0, 0.0, 0.0, 0.0, _NONE)


@inlined
def strike(h: Automaton) -> None:
    """Let the lower layer strike where the gap has fallen through zero."""
    run = h.run
    run.state[GAP] = 0.0
    before = min(run.state[GAP_RATE], 0.0)
    run.state[GAP_RATE] = before
    struck = run.state.copy()
    resolved = -before >= run.slowest
    p = h.inelastic if -before < h.p.sticking_speed else h.p
    impulse, loss, following = rebound_from(h, struck, p, resolved)
    if following == FLY and not resolved:
        # a rebound that round-off of the platform's motion could not resolve is none
        impulse, loss, following = rebound_from(h, struck, h.inelastic, resolved)
    if following < 0:
        return
    rebound = run.state[GAP_RATE]
    run.mode = ATTACHED if following == ATTACH else FLIGHT
    if run.mode == FLIGHT:
        run.zeros = 1 if rebound > 0.0 else 2
    force = contact_force(h)[0] if following == ATTACH else 0.0
    add_event(h, IMPACT, before, rebound, impulse, loss, force, _ONE)
    if following == ACCUMULATE and run.outcome == RUNNING:
        latch_impacts(h)
    elif following == ACCUMULATE:  # the run stops here
        run.accumulating = 1


@compiled
def rebound_from(h: Automaton, struck: FloatArray, p: Any, resolved: bool) -> tuple[float, float, int]:
    """Move to the state after an impact; its impulse (N·s) and loss (J) and what follows, −1 if nothing can."""
    run = h.run
    after = np.empty(FULL_SIZE)
    impulse, loss = impact(struck, after, p)
    copy(after, run.state)
    forget_starts(h)
    if not (prepare(h, ATTACHED, DIFFERENTIATED) and prepare(h, FLIGHT, DIFFERENTIATED)):
        return impulse, loss, -1
    place = SIZES[run.systems[FLIGHT]] // 2 + GAP
    acceleration, jerk = run.yp[FLIGHT, place], run.ypp[FLIGHT, place]
    following = after_impact(after[GAP_RATE], acceleration, jerk, resolved, pressing(h), run.tolerance, run.speed, h.p)
    return impulse, loss, following


@compiled
def latch_impacts(h: Automaton) -> None:
    """Sum up the impacts that accumulate, and carry the run to where they end."""
    run, steps = h.run, h.steps
    system = run.systems[FLIGHT]
    size = SIZES[system]
    after, rates = np.empty(FULL_SIZE), np.empty(FULL_SIZE)
    end, slope = np.empty(size), np.empty(size)
    scatter(system, run.yp[FLIGHT], rates)
    duration, impulse, loss = latch(run.state.copy(), rates[7:], after, h.p)
    if run.now + duration >= run.end:
        return  # the run ends before they do: follow them
    rebound = run.state[GAP_RATE]
    row = steps.used.steps
    steps.start[row], steps.length[row] = 0.0, duration
    start, start_slope = run.y[FLIGHT, :size], run.yp[FLIGHT, :size]
    gather(system, after, end)
    half = size // 2
    for i in range(half):
        slope[i], slope[half + i] = end[half + i], start_slope[half + i]
    fill_cubic(steps.c[row], duration, start, end, start_slope, slope)
    copy(end, steps.ends[row])
    steps.used.steps = row + 1
    run.origin = run.now
    close_piece(h, run.now + duration)
    copy(after, run.state)
    forget_starts(h)
    if not prepare(h, ATTACHED, DIFFERENTIATED):
        return
    run.mode = ATTACHED if pressing(h) else FLIGHT
    run.zeros = 2 if run.mode == FLIGHT else 0
    force = contact_force(h)[0] if run.mode == ATTACHED else 0.0
    skipped = math.ceil(min(impacts_left(rebound, h.p), math.log(_EPS) / math.log(h.p.restitution)))
    add_event(h, LATCH, -rebound, 0.0, impulse, loss, force, skipped)


@compiled
def turn_corner(h: Automaton, told: bool) -> None:
    """Go on under another supply, which the parameters hold already: torques may jump, and with them F_c.

    ``told`` says whether the corner is listed as an event.
    """
    run = h.run
    forget_starts(h)
    force, lifts = 0.0, False
    if run.mode == ATTACHED:
        if not prepare(h, ATTACHED, DIFFERENTIATED):
            return
        lifts = not pressing(h)
        force = 0.0 if lifts else contact_force(h)[0]
    if told:
        run.joined = AFTER_EVENT
        add_event(h, DRIVE, 0.0, 0.0, 0.0, 0.0, force, _NONE)
    if lifts:
        run.joined = AFTER_EVENT
        run.mode = FLIGHT
        run.zeros = 2  # gap and its rate
        add_event(h, LIFTOFF, 0.0, 0.0, 0.0, 0.0, 0.0, _NONE)


@compiled
def join(h: Automaton, attached: bool, corner: bool) -> None:
    """List what happens where a run goes on from another: a corner of the supply, the end of contact."""
    run = h.run
    lifts = attached and run.mode == FLIGHT
    force = contact_force(h)[0] if run.mode == ATTACHED else 0.0
    if corner:
        add_event(h, DRIVE, 0.0, 0.0, 0.0, 0.0, force, _NONE)
    if lifts:
        add_event(h, LIFTOFF, 0.0, 0.0, 0.0, 0.0, 0.0, _NONE)


@compiled
def add_event(
    h: Automaton, kind: int, before: float, after: float, impulse: float, loss: float, force: float, impacts: int
) -> None:
    """Write an event; the mode is already the one after it. The run ends with the kind that it waits for."""
    run = h.run
    event = h.events[run.events]
    event.t, event.kind, event.rate_before, event.rate_after = run.now, kind, before, after
    event.impulse, event.loss, event.force_after = impulse, loss, force
    event.mode_after, event.impacts = run.mode, impacts
    run.events += 1
    if run.awaited == kind:
        run.outcome, run.awaited = OK, -1
