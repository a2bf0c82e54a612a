"""Engine ``native``: SUNDIALS IDA and CVODE without the interpreter in the loop.

The library of :mod:`vibroplat.integrate.sundials` is driven from compiled code through the addresses of its
functions; it calls back the C functions of :mod:`vibroplat.integrate.callbacks`. Between two readings of the
steps — some thousand, with all events in them — no Python runs and the interpreter's lock is free.
"""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Callable
from contextlib import closing
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.hybrid import loop
from vibroplat.hybrid.automaton import automaton
from vibroplat.hybrid.loop import AT_GUARD, AT_TARGET, AT_TIME, FAILED, NOT_FINITE
from vibroplat.hybrid.modes import GUARDS
from vibroplat.hybrid.pieces import cut_piece
from vibroplat.hybrid.state import OK, RUNNING, Automaton
from vibroplat.hybrid.steps import CUBIC, MARGIN, Steps, end_at, no_steps, rewind
from vibroplat.integrate import callbacks as cb
from vibroplat.integrate.methods import adams_modes
from vibroplat.integrate.multistep import (
    QUINTIC,
    Past,
    add_step,
    begin_steps,
    calm,
    no_past,
    prepare_first_step,
    stop_within,
)
from vibroplat.integrate.sundials import Library, UnavailableError
from vibroplat.kernels.compiled import FloatArray, compiled
from vibroplat.kernels.foreign import borrow, call_int
from vibroplat.model.equations import finite
from vibroplat.model.parameters import PARAMETERS, Parameters, parameters
from vibroplat.model.systems import DIFFERENTIAL, FULL_SIZE, SIZES, System, systems
from vibroplat.scene import Mode, Scene

IntArray = npt.NDArray[np.int64]
Records = npt.NDArray[np.void]

#: Steps between two returns to Python: many against what a return costs, few against the processor's cache.
ROWS = 2048
#: Tolerance below which Adams' steps are too long for cubics.
LONG_STEPS = 1e-7
#: Steps within a turn of the synchronous speed after which the integrator is taken to be stuck, and those for each
#: event that a scene allows within a turn, where that is more.
MAX_STEPS, STEPS_PER_EVENT = 300_000, 60

# How IDA chooses its steps. Means over nine tolerances around 1e-6, in contact and with 50 impacts a second:
#: Factors between which the step is kept rather than changed. IDA's own (1, 2) takes a sixth more steps.
ETA_FIXED = (0.9, 1.3)
#: Largest growth of a step, also while the order rises after a restart. With 3 instead of IDA's own 2 a
#: restart takes a sixth fewer steps; 8 fails more tests of the error than it saves.
ETA_MAX = 3.0
#: Change of the leading coefficient that asks for a new Jacobian. With IDA's own 0.25 the old one makes
#: Newton's iteration so slow that it takes a quarter more residuals; 0.05 takes more Jacobians for no fewer.
DELTA_CJ = 0.1

# Methods.
IDA, ADAMS = 0, 1

#: Addresses of the functions of a method, by their names in IDA and CVODE.
_NAMES = {
    "solve": ("IDASolve", "CVode"),
    "reinit": ("IDAReInit", "CVodeReInit"),
    "set_first_step": ("IDASetInitStep", "CVodeSetInitStep"),
    "derivative": ("IDAGetDky", "CVodeGetDky"),
    "error_failures": ("IDAGetNumErrTestFails", "CVodeGetNumErrTestFails"),
    "newton_failures": ("IDAGetNumNonlinSolvConvFails", "CVodeGetNumNonlinSolvConvFails"),
}
FUNCTIONS = np.dtype([(name, np.int64) for name in _NAMES], align=True)

#: Method of a mode, its solver memory, and its vectors of unknowns and derivatives.
HANDLES = np.dtype([(name, np.int64) for name in ("method", "memory", "y", "yp")], align=True)

#: Whether a segment is open, the last flag, what was counted, steps since the time of the run ``counted_from`` (s).
STATUS = np.dtype(
    [(name, np.int64) for name in ("open", "flag", "steps", "errors", "newtons", "counted", "most")]
    + [("counted_from", np.float64)],
    align=True,
)

# Of sundials_linearsolver.h: words of a SUNLinearSolver, of which the first is its content, and functions in its
# table of operations. Copies have room for more, which a later version would find empty: "not implemented".
_SOLVER_WORDS, _SOLVER_OPERATIONS, _SPARE = 4, 16, 48

# Of ida.h and cvode.h.
_ONE_STEP = 2
_ROOT_RETURN = 2
_ADAMS_METHOD = 1
#: IDA_RES_FAIL or CV_RHSFUNC_FAIL, and CV_FIRST_RHSFUNC_ERR: a callback said that something is not finite.
_CALLBACK_FAILURES = (-8, -9)

#: Why ``advance`` stopped, besides the reasons of the loop: there is no room for more steps.
_FULL = 9

_MEANINGS = {
    -2: "too much accuracy asked for",
    -3: "error test failed too often",
    -4: "Newton iteration failed too often",
    -5: "linear solver could not be set up",
    -6: "Jacobian could not be evaluated or factorized",
    -7: "linear system could not be solved",
}


class Native(NamedTuple):
    """What compiled code needs of the engine.

    Attributes
    ----------
    functions
        Records of :data:`FUNCTIONS` by method.
    handles
        Records of :data:`HANDLES` by mode.
    links
        User data of each mode's callbacks.
    y, yp, atol
        What is behind the vectors, shape (3, 14).
    past
        The last ends of steps.
    status
        A record of :data:`STATUS`.
    time, number
        What the library writes times (s) and counters to, shape (1,).
    """

    functions: Records
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
    size, handle = SIZES[h.run.systems[mode]], n.handles[mode]
    functions = n.functions[handle.method]
    for i in range(size):
        n.y[mode, i], n.yp[mode, i], n.atol[mode, i] = h.run.y[mode, i], h.run.yp[mode, i], h.run.atol[i]
    n.links[mode].origin = h.run.origin
    if handle.method == IDA:
        n.status.flag = call_int(functions.reinit, (handle.memory, 0.0, handle.y, handle.yp))
    else:
        n.status.flag = call_int(functions.reinit, (handle.memory, 0.0, handle.y))
    call_int(functions.set_first_step, (handle.memory, first_step))
    n.status.open = 1
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
    method, clock = handle.method, time.ctypes.data
    solve, derivative = n.functions[method].solve, n.functions[method].derivative
    while status.flag >= 0 and used.steps + MARGIN < rows:
        flag = step(method, solve, derivative, handles, until, clock, time)
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
    return NOT_FINITE if status.flag in _CALLBACK_FAILURES else FAILED


@compiled
def step(
    method: int,
    solve: int,
    derivative: int,
    handles: tuple[int, int, int],
    until: float,
    clock: int,
    time: FloatArray,
) -> int:
    """Take one step; leaves time, unknowns and derivatives at its end, or at the guard's root in it."""
    memory, y, yp = handles
    if method == IDA:
        return call_int(solve, (memory, until, clock, y, yp, np.int32(_ONE_STEP)))
    flag = call_int(solve, (memory, until, y, clock, np.int32(_ONE_STEP)))
    if flag >= 0:
        call_int(derivative, (memory, time[0], np.int32(1), yp))
    return flag


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
    handle = n.handles[mode]
    functions, number = n.functions[handle.method], n.number.ctypes.data
    call_int(functions.error_failures, (handle.memory, number))
    n.status.errors += n.number[0]
    call_int(functions.newton_failures, (handle.memory, number))
    n.status.newtons += n.number[0]


class NativeEngine:
    """IDA and CVODE driven from compiled code.

    One context and one solver for each mode belong to a run, and with them to its thread; :meth:`close`
    frees them.

    Parameters
    ----------
    scene
        Its modes, and which of them Adams' method integrates.
    p
        Parameter vector of the scene.
    library
        The SUNDIALS library.

    Raises
    ------
    MemoryError
        SUNDIALS could not make one of its objects.
    """

    name = "native"
    rows = ROWS
    #: Long, for a restart costs some thirty steps; not for ever, for angles lose digits as they grow.
    turns_per_segment: float = 1000

    def __init__(self, scene: Scene, p: Parameters, library: Library) -> None:
        self._lib = library
        self._free: list[Callable[[], object]] = []
        self._finalizer = weakref.finalize(self, _free_all, self._free)
        self._alive: list[Any] = []  # what the library holds addresses of
        self._p = np.array([p], PARAMETERS)
        self._status = np.zeros(1, STATUS)
        shape = (3, FULL_SIZE)
        self._n = Native(
            functions=np.array(
                [tuple(library.address(names[method]) for names in _NAMES.values()) for method in (IDA, ADAMS)],
                FUNCTIONS,
            ),
            handles=np.zeros(3, HANDLES),
            links=np.zeros(3, cb.LINKS),
            y=np.zeros(shape),
            yp=np.zeros(shape),
            atol=np.ones(shape),
            past=no_past(),
            status=self._status[0],
            time=np.zeros(1),
            number=np.zeros(1, dtype=np.int64),
        )
        self._status["most"] = max(MAX_STEPS, STEPS_PER_EVENT * scene.solver.max_events_per_period)
        self._direction = np.array([-1], dtype=np.int32)
        self._context = self._make_context()
        for mode, system in systems(scene).items():
            (self._make_adams if mode in adams_modes(scene) else self._make_ida)(mode, system)
        long_steps = bool(adams_modes(scene)) and scene.solver.tolerance < LONG_STEPS
        self.degree = QUINTIC if long_steps else CUBIC

    @property
    def work(self) -> dict[str, int | None]:
        """How much was done so far."""
        links, status = self._n.links, self._status[0]
        return {
            "steps": int(status["steps"]),
            "residual_calls": int(links["residuals"].sum()),
            "jacobian_calls": int(links["jacobians"].sum()),
            "error_test_failures": int(status["errors"]),
            "newton_failures": int(status["newtons"]),
        }

    @property
    def detail(self) -> str:
        """Why the integrator failed."""
        status = self._status[0]
        flag = int(status["flag"])
        if flag >= 0:
            most = int(status["most"])
            stuck = status["counted"] > most
            return f"SUNDIALS: more than {most} steps within a period" if stuck else "the state is not finite"
        if flag in _CALLBACK_FAILURES:
            return "the residual is not finite"
        return f"SUNDIALS: {_MEANINGS.get(flag, 'failure')} (flag {flag})"

    def advance(self, h: Automaton) -> None:
        """Go on with a run; see :class:`vibroplat.integrate.seam.Engine`."""
        drive(h, self._n)

    def close(self) -> None:
        """Free solvers, vectors, matrices and the context."""
        self._finalizer()

    # -- the library's objects ----------------------------------------------------------------------

    def _made(self, handle: int | None, free: Callable[..., object], *, by_reference: bool = False) -> int:
        if not handle:
            raise MemoryError("SUNDIALS could not make an object")
        cell = ctypes.c_void_p(handle)
        self._free.append(lambda: free(ctypes.byref(cell) if by_reference else cell))
        return handle

    def _make_context(self) -> int:
        lib, cell, logger = self._lib, ctypes.c_void_p(), ctypes.c_void_p()
        _check(lib.SUNContext_Create(0, ctypes.byref(cell)))
        context = self._made(cell.value, lib.SUNContext_Free, by_reference=True)
        # a failure is an outcome with a name, not a line on the terminal
        _check(lib.SUNContext_ClearErrHandlers(context))
        _check(lib.SUNContext_GetLogger(context, ctypes.byref(logger)))
        for silence in (lib.SUNLogger_SetErrorFilename, lib.SUNLogger_SetWarningFilename):
            _check(silence(logger, None))
        return context

    def _vector(self, values: FloatArray) -> int:
        lib = self._lib
        vector = self._made(lib.N_VMake_Serial(values.size, values.ctypes.data, self._context), lib.N_VDestroy)
        _check(lib.N_VEnableFusedOps_Serial(vector, 1))  # what the solver clones from it inherits this
        return vector

    def _vectors(self, mode: Mode, system: System) -> tuple[int, int]:
        """Make the vectors of a mode and fill its callbacks' user data."""
        n, lib = self._n, self._lib
        links = n.links[mode]
        links["vector"] = lib.address("N_VGetArrayPointer")
        links["parameters"] = self._p.ctypes.data
        links["tolerances"] = n.atol[mode].ctypes.data
        links["solver"] = links["condensed"].ctypes.data
        links["system"], links["size"], links["guard"] = system.index, system.size, GUARDS[system.index]
        y, yp = (self._vector(array[mode, : system.size]) for array in (n.y, n.yp))
        return y, yp

    def _links(self, mode: Mode) -> int:
        """Address of a mode's links."""
        return int(self._n.links[mode : mode + 1].ctypes.data)

    def _linear_solver(self, mode: Mode, system: System, y: int) -> tuple[int, int]:
        """Make a SUNLinearSolver whose setup and solve are ours, a copy of the library's dense one, and its matrix."""
        lib = self._lib
        matrix = self._made(lib.SUNDenseMatrix(system.size, system.size, self._context), lib.SUNMatDestroy)
        dense = self._made(lib.SUNLinSol_Dense(y, matrix, self._context), lib.SUNLinSolFree)
        head = _words(dense, _SOLVER_WORDS)
        place = np.flatnonzero(head == self._context)  # the table of operations is before it, its place differs
        operations = _words(int(head[place[0] - 1]), _SOLVER_OPERATIONS) if place.size == 1 and place[0] > 1 else head
        for name, ours in (("SUNLinSolSetup_Dense", cb.setup), ("SUNLinSolSolve_Dense", cb.solve)):
            found = operations == lib.address(name)
            if found.sum() != 1:
                raise UnavailableError(f"{name} is not found among the operations of its dense linear solver")
            operations[found] = ours.address
        content = _words(int(head[0]), cb.USER_DATA)
        content[cb.USER_DATA] = self._links(mode)
        head[0], head[place[0] - 1] = content.ctypes.data, operations.ctypes.data
        self._alive += [head, content, operations]
        return head.ctypes.data, matrix

    def _make_ida(self, mode: Mode, system: System) -> None:
        lib, n = self._lib, self._n
        y, yp = self._vectors(mode, system)
        memory = self._made(lib.IDACreate(self._context), lib.IDAFree, by_reference=True)
        _check(lib.IDAInit(memory, cb.residual.address, 0.0, y, yp))
        _check(lib.IDAWFtolerances(memory, cb.weights.address))
        _check(lib.IDASetUserData(memory, self._links(mode)))
        _check(lib.IDASetLinearSolver(memory, *self._linear_solver(mode, system, y)))
        _check(lib.IDASetJacFn(memory, cb.jacobian.address))
        _check(lib.IDASetEtaFixedStepBounds(memory, *ETA_FIXED))
        _check(lib.IDASetEtaMax(memory, ETA_MAX))
        _check(lib.IDASetDeltaCjLSetup(memory, DELTA_CJ))
        if system.algebraic:
            differential = np.ones(system.size)
            differential[system.differential :] = 0.0
            self._alive.append(differential)
            _check(lib.IDASetId(memory, self._vector(differential)))
            # F_c stays in the Newton norm and leaves the error test: its error is that of the state
            _check(lib.IDASetSuppressAlg(memory, 1))
        if GUARDS[system.index] >= 0:
            _check(lib.IDARootInit(memory, 1, cb.ida_guard.address))
            _check(lib.IDASetRootDirection(memory, self._direction.ctypes.data))
            _check(lib.IDASetNoInactiveRootWarn(memory))
        n.handles[mode] = (IDA, memory, y, yp)

    def _make_adams(self, mode: Mode, system: System) -> None:
        lib, n = self._lib, self._n
        y, yp = self._vectors(mode, system)
        memory = self._made(lib.CVodeCreate(_ADAMS_METHOD, self._context), lib.CVodeFree, by_reference=True)
        _check(lib.CVodeInit(memory, cb.right_hand_side.address, 0.0, y))
        _check(lib.CVodeWFtolerances(memory, cb.weights.address))
        _check(lib.CVodeSetUserData(memory, self._links(mode)))
        # Newton's iteration: fixed-point iteration, which needs no Jacobian, takes half as many steps again and more
        # than twice the right-hand sides
        _check(lib.CVodeSetLinearSolver(memory, *self._linear_solver(mode, system, y)))
        _check(lib.CVodeSetLinSysFn(memory, cb.linear_system.address))
        if GUARDS[system.index] >= 0:
            _check(lib.CVodeRootInit(memory, 1, cb.cvode_guard.address))
            _check(lib.CVodeSetRootDirection(memory, self._direction.ctypes.data))
            _check(lib.CVodeSetNoInactiveRootWarn(memory))
        n.handles[mode] = (ADAMS, memory, y, yp)


def self_check(library: Library) -> None:
    """Take a few steps with both methods and compare them with the motion's Taylor polynomial.

    Raises
    ------
    UnavailableError
        The library does not integrate as it should.
    """
    duration = 1e-5
    for method in ("ida", "adams"):
        scene = Scene().replace({"solver": {"tolerance": 1e-11, "smooth_modes": method}})
        p = parameters(scene)
        with closing(NativeEngine(scene, p, library)) as engine:
            h = automaton(scene, p, no_steps(engine.rows, engine.degree), engine.turns_per_segment)
            loop.first_mode(h)
            h.run["end"] = duration
            engine.advance(h)
        y, yp, ypp = (h.run[name][Mode.BARE, :10] for name in ("y", "yp", "ypp"))
        expected = y + duration * yp + 0.5 * duration**2 * ypp
        error = np.abs(h.run["state"][systems(scene)[Mode.BARE].places] - expected).max()
        if h.run["outcome"] != OK or not error < 1e-7:
            raise UnavailableError(f"its {method} fails the self-check (error {error:.3g})")


def _words(address: int, count: int) -> IntArray:
    """Copy machine words, with zeros behind them."""
    return np.append(np.array((ctypes.c_int64 * count).from_address(address)), np.zeros(_SPARE, dtype=np.int64))


def _free_all(stack: list[Callable[[], object]]) -> None:
    """Free in the reverse order of making."""
    while stack:
        stack.pop()()


def _check(flag: Any) -> None:
    if flag != 0:
        raise MemoryError(f"SUNDIALS refused its setup (flag {flag})")
