"""Beginnings and ends of segments: the consistent start of a mode at the present state, and the piece that ends."""

from __future__ import annotations

from typing import Any

from numba import carray  # type: ignore[attr-defined]

from vibroplat.hybrid.state import (
    AFTER_EVENT,
    CONSISTENT,
    CUT,
    INCONSISTENT,
    OUTSIDE_MODEL,
    STALE,
    Automaton,
)
from vibroplat.hybrid.transitions import contact_holds
from vibroplat.kernels.compiled import FloatArray, call_int, callback, compiled, inlined
from vibroplat.model.accelerations import accelerations, second_derivatives
from vibroplat.model.parameters import PARAMETERS
from vibroplat.model.systems import ALONG_RATE, DIFFERENTIAL, SIZES, STICKS, gather, scatter


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
        gather(system, run.state, run.y[mode])
    if not derivatives(h, system, run.y[mode], run.yp[mode], run.ypp[mode], order):
        run.outcome = OUTSIDE_MODEL if is_outside_model(h) else INCONSISTENT
        return False
    run.fresh[mode] = order
    return True


@compiled
def move_to(h: Automaton, system: int, y: FloatArray) -> None:
    """Make a system's unknowns the present state; in stick nothing slips, but for round-off."""
    scatter(system, y, h.run.state)
    if STICKS[system]:
        h.run.state[ALONG_RATE] = 0.0
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
