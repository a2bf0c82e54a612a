"""IDA from compiled code: what it calls back, and the loop of segments, steps and resets without the interpreter.

The callbacks are C functions: residual, Jacobian and its solutions, weights, guard. Their user data are a record of
addresses and what else a callback must know of its system. The kernels are those of :mod:`vibroplat.model`; a callback
only finds the arrays behind the vectors.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import carray  # type: ignore[attr-defined]

from vibroplat.hybrid import loop
from vibroplat.hybrid.loop import AT_GUARD, AT_TARGET, AT_TIME, FAILED, NOT_FINITE
from vibroplat.hybrid.modes import GUARDS, Form, guard_form
from vibroplat.hybrid.starts import cut_piece
from vibroplat.hybrid.state import MARGIN, MODE_COUNT, ROUND_OFF, RUNNING, Automaton, end_at, rewind
from vibroplat.integrate.interface import count_from, count_within_period
from vibroplat.integrate.multistep import (
    PreviousStep,
    add_step,
    begin_steps,
    empty_step,
    limit_force_slopes,
    prepare_first_step,
    stop_within,
)
from vibroplat.kernels.compiled import (
    FloatArray,
    borrow,
    call_address,
    call_int,
    callback,
    compiled,
    inlined,
    pointer,
    void_pointer,
)
from vibroplat.kernels.linear import condense, solve_condensed
from vibroplat.model.equations import finite
from vibroplat.model.equations import jacobian as fill_jacobian
from vibroplat.model.equations import residual as fill_residual
from vibroplat.model.parameters import PARAMETERS
from vibroplat.model.systems import ALGEBRAIC, SIZES, SLIDES, UNKNOWNS

#: What a callback knows of its mode: addresses, the system with its size and guard, calls counted, and matrices of
#: the Jacobian's last evaluation with their c_j.
LINKS = np.dtype(
    [
        ("vector", np.int64),  # N_VGetArrayPointer
        ("parameters", np.int64),
        ("tolerances", np.int64),
        ("origin", np.float64),  # of the segment's times (s)
        ("system", np.int64),
        ("size", np.int64),
        ("half", np.int64),  # coordinates, whose rates follow them
        ("guard", np.int64),
        ("residuals", np.int64),
        ("jacobians", np.int64),
        ("solver", np.int64),  # of ``condensed``
        ("cj", np.float64),
        ("condensed", np.float64, UNKNOWNS * UNKNOWNS),
        ("rows", np.float64, UNKNOWNS * UNKNOWNS),
        ("dynamic", np.float64, UNKNOWNS * UNKNOWNS),
    ],
    align=True,
)

#: Place of the links' address in the content of a SUNLinearSolver, after the three words of a dense one.
USER_DATA = 3

#: SUNDIALS gives up at once on a negative value, and says which function it came from; it takes a smaller step
#: on a positive one.
_OK, _NOT_FINITE, _SINGULAR = 0, -1, 1


@compiled
def _values(vector: int, links: Any) -> FloatArray:
    return carray(pointer(call_address(links.vector, (vector,))), (links.size,))


@inlined
def _parameters(links: Any) -> Any:
    return carray(void_pointer(links.parameters), (1,), dtype=PARAMETERS)[0]


@callback("int32(float64, intp, intp, intp, voidptr)")
def residual(t: float, y: int, yp: int, res: int, data: Any) -> int:
    """IDAResFn."""
    links = carray(data, (1,), dtype=LINKS)[0]
    links.residuals += 1
    values, slopes, p = _values(y, links), _values(yp, links), _parameters(links)
    whole = fill_residual(links.system, links.origin + t, values, slopes, _values(res, links), p)
    return _OK if whole else _NOT_FINITE


@compiled
def _condensed(links: Any) -> FloatArray:
    return carray(pointer(links.solver), (links.size - links.half, links.size))


@callback("int32(float64, float64, intp, intp, intp, intp, voidptr, intp, intp, intp)")
def jacobian(
    t: float, cj: float, y: int, yp: int, res: int, matrix: int, data: Any, work_1: int, work_2: int, work_3: int
) -> int:
    """IDALsJacFn; leaves the library's matrix alone and prepares :func:`solve`."""
    links = carray(data, (1,), dtype=LINKS)[0]
    links.jacobians += 1
    size = links.size
    m = size - links.half
    rows, dynamic = links.rows[: size * size].reshape((size, size)), links.dynamic[: m * m].reshape((m, m))
    fill_jacobian(links.system, links.origin + t, _values(y, links), _values(yp, links), cj, rows, _parameters(links))
    links.cj = cj
    return _OK if condense(rows, cj, dynamic, _condensed(links)) else _SINGULAR


@callback("int32(CPointer(intp), intp)")
def setup(solver: Any, matrix: int) -> int:
    """Do nothing, as setup of a SUNLinearSolver: all was done with the Jacobian."""
    return _OK


@callback("int32(CPointer(intp), intp, intp, intp, float64)")
def solve(solver: Any, matrix: int, solution: int, right: int, tolerance: float) -> int:
    """Solve, as a SUNLinearSolver whose content ends with the address of the links."""
    content = carray(pointer(solver[0]), (USER_DATA + 1,)).view(np.int64)
    links = carray(void_pointer(content[USER_DATA]), (1,), dtype=LINKS)[0]
    solve_condensed(_condensed(links), links.cj, _values(right, links), _values(solution, links))
    return _OK


@callback("int32(intp, intp, voidptr)")
def weights(y: int, ewt: int, data: Any) -> int:
    """IDAEwtFn: one over the tolerances, absolute and that of round-off."""
    links = carray(data, (1,), dtype=LINKS)[0]
    values, weight = _values(y, links), _values(ewt, links)
    atol = carray(pointer(links.tolerances), (links.size,))
    for i in range(values.size):
        weight[i] = 1.0 / (ROUND_OFF * abs(values[i]) + atol[i])
    return _OK


@callback("int32(float64, intp, intp, CPointer(float64), voidptr)")
def guard(t: float, y: int, yp: int, value: Any, data: Any) -> int:
    """IDARootFn: the unknown whose fall through zero ends the mode."""
    links = carray(data, (1,), dtype=LINKS)[0]
    value[0] = _values(y, links)[links.guard]
    return _OK


#: Addresses of IDAGetDky, of a solver's memory and of its vectors: what interpolates in its last step.
Inside = tuple[int, int, int, int]

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
    [(name, np.int64) for name in ("open", "flag", "steps", "errors", "newtons", "max_steps")]
    + [("counted", np.float64), ("counted_from", np.float64)],
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
    """What compiled code needs of the engine."""

    functions: Any  # a record of FUNCTIONS
    handles: Records  # of HANDLES by mode
    links: Records  # user data of each mode's callbacks
    y: FloatArray  # what is behind the vectors, shape (MODE_COUNT, UNKNOWNS)
    yp: FloatArray
    atol: FloatArray
    past: PreviousStep  # the last end of a step
    status: Any  # a record of STATUS
    time: FloatArray  # what the library writes times (s) and counters to, shape (1,)
    number: IntArray


def empty_records() -> Native:
    """Make what compiled code needs of the engine, empty."""
    return Native(
        functions=np.zeros(1, FUNCTIONS)[0],
        handles=np.zeros(MODE_COUNT, HANDLES),
        links=np.zeros(MODE_COUNT, LINKS),
        y=np.zeros((MODE_COUNT, UNKNOWNS)),
        yp=np.zeros((MODE_COUNT, UNKNOWNS)),
        atol=np.ones((MODE_COUNT, UNKNOWNS)),
        past=empty_step(),
        status=np.zeros(1, STATUS)[0],
        time=np.zeros(1),
        number=np.zeros(1, dtype=np.int64),
    )


@compiled
def run_loop(owned_h: Automaton, owned_n: Native) -> None:
    """Go through segments and resets until there is no room for more steps or the run has ended."""
    h, n = borrow(owned_h), borrow(owned_n)
    rewind(h.steps)
    while h.run.outcome == RUNNING:
        if n.status.open == 0:
            full = h.steps.used.steps + 1 + MARGIN > h.steps.start.size or h.run.events + 2 > h.events.size
            if full or not loop.begin_segment(h) or not start(h, n):
                return
        stop = advance(h, n)
        if ALGEBRAIC[h.run.systems[h.run.mode]]:
            limit_force_slopes(h, stop == _FULL)
        if stop == _FULL:
            cut_piece(h)
            return
        n.status.open = 0
        memory, number = n.handles[h.run.mode].memory, n.number.ctypes.data
        call_int(n.functions.error_failures, (memory, number))  # since the integrator's restart
        n.status.errors += n.number[0]
        call_int(n.functions.newton_failures, (memory, number))
        n.status.newtons += n.number[0]
        loop.end_segment(h, stop)


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
    n.status.counted, n.status.counted_from = count_from(n.status.counted, n.status.counted_from, h.run.origin)
    n.time[0] = 0.0
    begin_steps(n.past, n.y[mode, :size], n.yp[mode, :size])
    return True


@compiled
def advance(h: Automaton, n: Native) -> int:
    """Take steps to the guard, the segment's time, the run's target, a failure, or until there is no more room."""
    run, status, steps, time = h.run, n.status, h.steps, n.time
    mode, used = run.mode, h.steps.used
    system = run.systems[mode]
    guard, size, slides = GUARDS[system], SIZES[system], SLIDES[system]
    forms = guard_form(system, 0, h.p), guard_form(system, 1, h.p)
    until, target, rows = run.until, run.target - run.turns[0], steps.start.size
    starts, lengths, c, ends = steps.start, steps.length, steps.c, steps.ends
    past_t, past_y, past_yp = n.past.t, n.past.y, n.past.yp
    origin, period = run.origin, run.period
    all_y, all_yp = n.y[mode], n.yp[mode]
    y, yp = all_y[:size], all_yp[:size]
    handle = n.handles[mode]
    inside = (n.functions.derivative, handle.memory, handle.y, handle.yp)
    clock, solve = time.ctypes.data, n.functions.solve
    while status.flag >= 0 and used.steps + MARGIN < rows:
        flag = call_int(solve, (handle.memory, until, clock, handle.y, handle.yp, np.int32(_ONE_STEP)))
        status.flag = flag
        status.steps += 1
        status.counted += 1
        if flag < 0:
            break
        ended = time[0] >= until
        if ended:  # ends never shorten steps: the last one goes beyond
            interpolate_at(until, inside)
            time[0] = until
        if not (finite(y) and finite(yp)):
            return NOT_FINITE
        row = used.steps
        add_step(time[0], all_y, all_yp, row, starts, lengths, c, ends, past_t, past_y, past_yp)
        used.steps = row + 1
        root_found = flag == _ROOT_RETURN and not ended
        if slides:
            dips = may_fall(forms[0], c, row, y, yp) or may_fall(forms[1], c, row, y, yp)
        else:
            dips = guard >= 0 and (y[guard] < 0.0 or c[row, 1, guard] < 0.0 < yp[guard])
        if root_found or y[3] >= target or dips:
            stop = end_within(h, root_found, inside, y)
            if stop >= 0:
                return stop
        if ended:
            return AT_TIME
        since = status.counted_from
        status.counted, status.counted_from = count_within_period(status.counted, since, origin + time[0], period)
        if status.counted > status.max_steps:
            return FAILED
    if status.flag >= 0:
        return _FULL
    return NOT_FINITE if status.flag == RESIDUAL_FAILURE else FAILED


@compiled
def end_within(h: Automaton, root_found: bool, inside: Inside, y: FloatArray) -> int:
    """Shorten the last step to a falling guard or to the target of exciter 1: AT_GUARD, AT_TARGET, or −1."""
    run, steps = h.run, h.steps
    target, row = run.target - run.turns[0], steps.used.steps - 1
    stop, share = stop_within(h, root_found, target, y)
    if stop == AT_TARGET or (stop == AT_GUARD and not root_found):
        # the integrator's polynomial is smooth where slopes at the ends of a step carry errors of a stiff layer
        interpolate_at(steps.start[row] + share * steps.length[row], inside)
        if stop == AT_TARGET:
            y[3] = target  # but for an error far within the tolerance
        end_at(steps, row, share, y)
    return stop


@inlined
def may_fall(form: Form, c: FloatArray, row: int, y: FloatArray, yp: FloatArray) -> bool:
    """Whether a guard, a linear form of unknowns, may fall in the last step, which ends with these and their rates."""
    first, weight, second, other = form
    if weight * y[first] + other * y[second] < 0.0:
        return True
    return weight * c[row, 1, first] + other * c[row, 1, second] < 0.0 < weight * yp[first] + other * yp[second]


@compiled
def interpolate_at(t: float, inside: Inside) -> None:
    """Put unknowns and derivatives at a time inside the last step."""
    derivative, memory, y, yp = inside
    call_int(derivative, (memory, t, np.int32(0), y))
    call_int(derivative, (memory, t, np.int32(1), yp))
