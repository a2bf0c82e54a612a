"""The compiled loop of engine ``native``: segments, steps and jumps without the interpreter."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.hybrid import loop
from vibroplat.hybrid.loop import AT_GUARD, AT_TARGET, AT_TIME, FAILED, NOT_FINITE
from vibroplat.hybrid.modes import GUARDS
from vibroplat.hybrid.pieces import cut_piece
from vibroplat.hybrid.state import RUNNING, Automaton
from vibroplat.hybrid.steps import MARGIN, Steps, end_at, rewind
from vibroplat.integrate.multistep import Past, add_step, begin_steps, calm, prepare_first_step, stop_within
from vibroplat.kernels.compiled import FloatArray, compiled
from vibroplat.kernels.foreign import borrow, call_int
from vibroplat.model.equations import finite
from vibroplat.model.systems import DIFFERENTIAL, SIZES

IntArray = npt.NDArray[np.int64]
Records = npt.NDArray[np.void]

#: Functions of IDA whose addresses are called, by what they do.
NAMES = {
    "solve": "IDASolve",
    "reinit": "IDAReInit",
    "set_first_step": "IDASetInitStep",
    "derivative": "IDAGetDky",
    "error_failures": "IDAGetNumErrTestFails",
    "newton_failures": "IDAGetNumNonlinSolvConvFails",
}
FUNCTIONS = np.dtype([(name, np.int64) for name in NAMES], align=True)

#: A mode's solver memory, and its vectors of unknowns and derivatives.
HANDLES = np.dtype([(name, np.int64) for name in ("memory", "y", "yp")], align=True)

#: Whether a segment is open, the last flag, what was counted, steps since the time of the run ``counted_from`` (s).
STATUS = np.dtype(
    [(name, np.int64) for name in ("open", "flag", "steps", "errors", "newtons", "counted", "most")]
    + [("counted_from", np.float64)],
    align=True,
)

# Of ida.h.
_ONE_STEP = 2
_ROOT_RETURN = 2
#: IDA_RES_FAIL: the residual said that something is not finite.
RESIDUAL_FAILURE = -8

#: Why ``advance`` stopped, besides the reasons of the loop: there is no room for more steps.
_FULL = 9


class Native(NamedTuple):
    """What compiled code needs of the engine.

    Attributes
    ----------
    functions
        A record of :data:`FUNCTIONS`.
    handles
        Records of :data:`HANDLES` by mode.
    links
        User data of each mode's callbacks.
    y, yp, atol
        What is behind the vectors, shape (3, 14).
    past
        The last end of a step.
    status
        A record of :data:`STATUS`.
    time, number
        What the library writes times (s) and counters to, shape (1,).
    """

    functions: Any
    handles: Records
    links: Records
    y: FloatArray
    yp: FloatArray
    atol: FloatArray
    past: Past
    status: Any
    time: FloatArray
    number: IntArray


@compiled
def drive(owned_h: Automaton, owned_n: Native) -> None:
    """Go through segments and jumps until there is no room for more steps or the run has ended."""
    h, n = borrow(owned_h), borrow(owned_n)
    rewind(h.steps)
    while h.run.outcome == RUNNING:
        if n.status.open == 0:
            full = h.steps.used.steps + 1 + MARGIN > h.steps.start.size or h.run.events + 2 > h.events.size
            if full or not loop.begin(h) or not start(h, n):
                return
        stop = advance(h, n)
        algebraic = SIZES[h.run.systems[h.run.mode]] > DIFFERENTIAL[h.run.systems[h.run.mode]]
        if algebraic:
            calm(h, stop == _FULL)
        if stop == _FULL:
            cut_piece(h)
            return
        n.status.open = 0
        count(h.run.mode, n)
        loop.conclude(h, stop)


@compiled
def start(h: Automaton, n: Native) -> bool:
    """Restart the integrator of a mode at the consistent state that the automaton has prepared."""
    mode = h.run.mode
    first_step = prepare_first_step(h)
    if first_step < 0.0:
        return False
    size, handle, functions = SIZES[h.run.systems[mode]], n.handles[mode], n.functions
    for i in range(size):
        n.y[mode, i], n.yp[mode, i], n.atol[mode, i] = h.run.y[mode, i], h.run.yp[mode, i], h.run.atol[i]
    n.links[mode].origin = h.run.origin
    n.status.flag = call_int(functions.reinit, (handle.memory, 0.0, handle.y, handle.yp))
    call_int(functions.set_first_step, (handle.memory, first_step))
    n.status.open = 1
    if h.run.origin <= n.status.counted_from:  # the motion has begun, or begun again
        n.status.counted, n.status.counted_from = 0, h.run.origin
    n.time[0] = 0.0
    begin_steps(n.past, n.y[mode, :size], n.yp[mode, :size])
    return True


@compiled
def advance(h: Automaton, n: Native) -> int:
    """Take steps to the guard, the segment's time, the run's target, a failure, or until there is no more room."""
    run, status, steps, time = h.run, n.status, h.steps, n.time
    mode, used = run.mode, h.steps.used
    system = run.systems[mode]
    guard, size = GUARDS[system], SIZES[system]
    until, target, rows = run.until, run.target - run.turns[0], steps.start.size
    starts, lengths, c, ends = steps.start, steps.length, steps.c, steps.ends
    past_t, past_y, past_yp = n.past.t, n.past.y, n.past.yp
    origin, period, counted_until = run.origin, run.period, status.counted_from + run.period
    all_y, all_yp = n.y[mode], n.yp[mode]
    y, yp = all_y[:size], all_yp[:size]
    handle = n.handles[mode]
    handles = (handle.memory, handle.y, handle.yp)
    clock, solve, derivative = time.ctypes.data, n.functions.solve, n.functions.derivative
    while status.flag >= 0 and used.steps + MARGIN < rows:
        flag = call_int(solve, (handle.memory, until, clock, handle.y, handle.yp, np.int32(_ONE_STEP)))
        status.flag = flag
        status.steps += 1
        status.counted += 1
        if flag < 0:
            break
        ended = time[0] >= until
        if ended:  # ends never shorten steps: the last one goes beyond
            interpolate_at(until, derivative, handles)
            time[0] = until
        if not (finite(y) and finite(yp)):
            return NOT_FINITE
        row = used.steps
        add_step(time[0], all_y, all_yp, row, starts, lengths, c, ends, past_t, past_y, past_yp)
        used.steps = row + 1
        found = flag == _ROOT_RETURN and not ended
        dips = guard >= 0 and (y[guard] < 0.0 or c[row, 1, guard] < 0.0 < yp[guard])
        if found or y[3] >= target or dips:
            stop, share = stop_within(steps, guard, found, target, y, yp)
            if stop == AT_TARGET:
                end_at_angle(target, share, derivative, handles, steps, y, yp)
            elif stop == AT_GUARD and not found:
                end_step(share, derivative, handles, steps, y)
            if stop >= 0:
                return stop
        if ended:
            return AT_TIME
        if origin + time[0] >= counted_until:
            counted_until = origin + time[0] + period
            status.counted_from = origin + time[0]
            status.counted = 0
        elif status.counted > status.most:
            return FAILED
    if status.flag >= 0:
        return _FULL
    return NOT_FINITE if status.flag == RESIDUAL_FAILURE else FAILED


@compiled
def end_step(share: float, derivative: int, handles: tuple[int, int, int], steps: Steps, y: FloatArray) -> None:
    """Let the last step end at a fraction of it, with what the integrator says of that time.

    Its polynomial is smooth where slopes at the ends of a step carry the errors of a stiff layer.
    """
    row = steps.used.steps - 1
    interpolate_at(steps.start[row] + share * steps.length[row], derivative, handles)
    end_at(steps, row, share, y)


@compiled
def end_at_angle(
    target: float,
    share: float,
    derivative: int,
    handles: tuple[int, int, int],
    steps: Steps,
    y: FloatArray,
    yp: FloatArray,
) -> None:
    """Let the last step end where the integrator says that exciter 1 has an angle (rad), near a fraction of it."""
    row = steps.used.steps - 1
    start, length = steps.start[row], steps.length[row]
    interpolate_at(start + share * length, derivative, handles)
    for _ in range(2):  # the polynomial has this angle elsewhere, by as much as the tolerance allows
        if yp[3] > 0.0:
            share = min(max(share - (y[3] - target) / (yp[3] * length), 0.0), 1.0)
        interpolate_at(start + share * length, derivative, handles)
    y[3] = target
    end_at(steps, row, share, y)


@compiled
def interpolate_at(t: float, derivative: int, handles: tuple[int, int, int]) -> None:
    """Put unknowns and derivatives at a time inside the last step."""
    memory, y, yp = handles
    call_int(derivative, (memory, t, np.int32(0), y))
    call_int(derivative, (memory, t, np.int32(1), yp))


@compiled
def count(mode: int, n: Native) -> None:
    """Add what the integrator has counted since its restart."""
    handle, functions, number = n.handles[mode], n.functions, n.number.ctypes.data
    call_int(functions.error_failures, (handle.memory, number))
    n.status.errors += n.number[0]
    call_int(functions.newton_failures, (handle.memory, number))
    n.status.newtons += n.number[0]
