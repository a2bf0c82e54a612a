"""Engine ``native``: SUNDIALS IDA and CVODE without the interpreter in the loop.

The library of :mod:`vibroplat.integrate.sundials` is driven from compiled code through the addresses of its
functions; it calls back the C functions of :mod:`vibroplat.integrate.callbacks`. Between two readings of the
tape — some thousand steps, with all events in them — no Python runs and the interpreter's lock is free.
"""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Callable
from contextlib import closing
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.flow.motion import Motion
from vibroplat.hybrid import loop as hy
from vibroplat.hybrid.loop import AT_GUARD, AT_TIME, FAILED, NOT_FINITE, Hybrid
from vibroplat.integrate import callbacks as cb
from vibroplat.integrate import tape as tp
from vibroplat.integrate.sundials import Library, UnavailableError
from vibroplat.integrate.tape import Tape
from vibroplat.kernels.compiled import compiled
from vibroplat.kernels.foreign import borrow, call_int
from vibroplat.model.equations import finite
from vibroplat.model.parameters import FloatArray, Parameters, parameters
from vibroplat.model.systems import BARE, FULL_SIZE, GUARDS, PLACES, SIZES, System, systems
from vibroplat.scene import Mode, Scene

IntArray = npt.NDArray[np.int64]

#: Rows of the tape: large against what a return to Python costs, small against the processor's cache.
TAPE_ROWS = 2048
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

# Rows of ``Native.functions``, columns the method.
SOLVE, REINIT, SET_FIRST_STEP, DERIVATIVE, ERROR_FAILURES, NEWTON_FAILURES = range(6)
_NAMES = (
    ("IDASolve", "CVode"),
    ("IDAReInit", "CVodeReInit"),
    ("IDASetInitStep", "CVodeSetInitStep"),
    ("IDAGetDky", "CVodeGetDky"),
    ("IDAGetNumErrTestFails", "CVodeGetNumErrTestFails"),
    ("IDAGetNumNonlinSolvConvFails", "CVodeGetNumNonlinSolvConvFails"),
)

# Columns of ``Native.handles``.
METHOD, MEMORY, Y, YP = range(4)

# Places in ``Native.status``.
OPEN, FLAG, STEPS, ERRORS, NEWTONS, STEPS_MARK, MOST_STEPS = range(7)

# Of sundials_linearsolver.h: words of a SUNLinearSolver, of which the first is its content, and functions in its
# table of operations. Copies have room for more, which a later version would find empty: "not implemented".
_SOLVER_WORDS, _SOLVER_OPERATIONS, _SPARE = 4, 16, 48

# Of ida.h and cvode.h.
_ONE_STEP = 2
_ROOT_RETURN = 2
_ADAMS_METHOD = 1
#: IDA_RES_FAIL or CV_RHSFUNC_FAIL, and CV_FIRST_RHSFUNC_ERR: a callback said that something is not finite.
_CALLBACK_FAILURES = (-8, -9)

# States of ``advance`` besides those of the automaton: the tape is full.
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
        Addresses of the library's functions, shape (6, 2).
    handles
        Method, solver memory and vectors of each mode, shape (3, 4).
    links
        User data of each mode's callbacks, shape (3, LINKS).
    y, yp, atol
        What is behind the vectors, shape (3, 14).
    status
        Whether a segment is open; the last flag; counters.
    time
        Where the integrator stands in the segment (s), and when in the run steps began to be counted (s).
    number
        What counters are read into.
    """

    functions: IntArray
    handles: IntArray
    links: IntArray
    y: FloatArray
    yp: FloatArray
    atol: FloatArray
    status: IntArray
    time: FloatArray
    number: IntArray


@compiled
def drive(owned_h: Hybrid, owned_tape: Tape, owned_n: Native) -> None:
    """Go through segments and transitions until the tape is full or the run has ended."""
    h, tape, n = borrow(owned_h), borrow(owned_tape), borrow(owned_n)
    tp.rewind(tape)
    while h.flags[hy.OUTCOME] == hy.RUNNING:
        mode = h.flags[hy.MODE]
        if n.status[OPEN] == 0:
            full = tape.used[tp.ROWS] + 2 + tp.MARGIN > tape.t.size or h.flags[hy.EVENTS] + 2 > h.events.shape[0]
            if full or not hy.begin(h):
                return
            start(h, tape, n)
        stop = advance(h, tape, n)
        if stop == _FULL:
            hy.split_piece(h, tape)
            return
        n.status[OPEN] = 0
        count(mode, n)
        hy.conclude(h, tape, stop)


@compiled
def start(h: Hybrid, tape: Tape, n: Native) -> None:
    """Restart the integrator of a mode at the consistent state that the automaton has prepared."""
    mode = h.flags[hy.MODE]
    size = SIZES[h.systems[mode]]
    method, memory = n.handles[mode, METHOD], n.handles[mode, MEMORY]
    for i in range(size):
        n.y[mode, i], n.yp[mode, i], n.atol[mode, i] = h.y[mode, i], h.yp[mode, i], h.atol[i]
    if method == IDA:
        n.status[FLAG] = call_int(n.functions[REINIT, IDA], (memory, 0.0, n.handles[mode, Y], n.handles[mode, YP]))
    else:
        n.status[FLAG] = call_int(n.functions[REINIT, ADAMS], (memory, 0.0, n.handles[mode, Y]))
    call_int(n.functions[SET_FIRST_STEP, method], (memory, h.clock[hy.FIRST_STEP]))
    n.status[OPEN] = 1
    n.time[0] = 0.0
    tp.write(tape, 0.0, n.y[mode, :size], n.yp[mode, :size])


@compiled
def advance(h: Hybrid, tape: Tape, n: Native) -> int:  # noqa: PLR0911  (each stop has its reason)
    """Take steps to the guard, the segment's time, a failure, or the end of the tape."""
    # the loop's arrays by name: taking them from their tuples in each step costs more than the step's tests
    t, rows, slopes, used, status, time = tape.t, tape.y, tape.yp, tape.used, n.status, n.time
    mode, origin = h.flags[hy.MODE], h.clock[hy.ORIGIN]
    until, period = h.clock[hy.UNTIL], h.clock[hy.PERIOD]
    system = h.systems[mode]
    guard, size = GUARDS[system], SIZES[system]
    y, yp = n.y[mode, :size], n.yp[mode, :size]
    handles = (n.handles[mode, MEMORY], n.handles[mode, Y], n.handles[mode, YP])
    method, clock = n.handles[mode, METHOD], time.ctypes.data
    solve, derivative = n.functions[SOLVE, method], n.functions[DERIVATIVE, method]
    flag = status[FLAG]
    while flag >= 0 and used[tp.ROWS] + tp.MARGIN < t.size:
        flag = step(method, solve, derivative, handles, until, clock, time)
        status[FLAG] = flag
        status[STEPS] += 1
        status[STEPS_MARK] += 1
        if flag < 0:
            break
        ended = time[0] >= until
        if ended:  # ends never shorten steps: the last one goes beyond
            interpolate_at(until, derivative, handles)
            time[0] = until
        if not (finite(y) and finite(yp)):
            return NOT_FINITE
        tp.append(t, rows, slopes, used, time[0], y, yp)
        if flag == _ROOT_RETURN and not ended:
            return AT_GUARD
        if guard >= 0 and (y[guard] < 0.0 or yp[guard] > 0.0) and tp.cut_at_fall(tape, guard):
            cut_with(derivative, handles, tape, y, yp)
            return AT_GUARD
        if ended:
            return AT_TIME
        if origin + time[0] - time[1] >= period:
            time[1] = origin + time[0]
            status[STEPS_MARK] = 0
        elif status[STEPS_MARK] > status[MOST_STEPS]:
            return FAILED
    if flag >= 0:
        return _FULL
    return NOT_FINITE if flag in _CALLBACK_FAILURES else FAILED


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
def cut_with(derivative: int, handles: tuple[int, int, int], tape: Tape, y: FloatArray, yp: FloatArray) -> None:
    """Let the tape end, where it was cut, with what the integrator says of that time.

    Its polynomial is smooth where slopes at the ends of a step carry the errors of a stiff layer.
    """
    last = tape.used[tp.ROWS] - 1
    interpolate_at(tape.t[last], derivative, handles)
    for i in range(y.size):
        tape.y[last, i], tape.yp[last, i] = y[i], yp[i]


@compiled
def interpolate_at(t: float, derivative: int, handles: tuple[int, int, int]) -> None:
    """Put unknowns and derivatives at a time inside the last step."""
    memory, y, yp = handles
    call_int(derivative, (memory, t, np.int32(0), y))
    call_int(derivative, (memory, t, np.int32(1), yp))


@compiled
def count(mode: int, n: Native) -> None:
    """Add what the integrator has counted since its restart."""
    method, memory = n.handles[mode, METHOD], n.handles[mode, MEMORY]
    for function, place in ((ERROR_FAILURES, ERRORS), (NEWTON_FAILURES, NEWTONS)):
        call_int(n.functions[function, method], (memory, n.number.ctypes.data))
        n.status[place] += n.number[0]


class NativeEngine:
    """IDA and CVODE driven from compiled code.

    One context and one solver for each mode belong to a run, and with them to its thread; :meth:`close`
    frees them.

    Parameters
    ----------
    scene
        Its modes, and which of them Adams' method integrates.
    p
        Parameters of the scene.
    library
        The SUNDIALS library.

    Raises
    ------
    MemoryError
        SUNDIALS could not make one of its objects.
    """

    name = "native"
    #: Long, for a restart costs some thirty steps; not for ever, for angles lose digits as they grow.
    turns_per_segment: float = 1000

    def __init__(self, scene: Scene, p: Parameters, library: Library) -> None:
        self._lib = library
        self._free: list[Callable[[], object]] = []
        self._finalizer = weakref.finalize(self, _free_all, self._free)
        self._alive: list[npt.NDArray[Any]] = [np.asarray(p.base)]  # what the library holds addresses of
        self._tape = tp.blank_tape(TAPE_ROWS)
        names = [[library.address(name) for name in row] for row in _NAMES]
        shape = (3, FULL_SIZE)
        self._n = Native(
            functions=np.array(names),
            handles=np.zeros((3, YP + 1), dtype=np.int64),
            links=np.zeros((3, cb.LINKS), dtype=np.int64),
            y=np.zeros(shape),
            yp=np.zeros(shape),
            atol=np.ones(shape),
            status=np.zeros(MOST_STEPS + 1, dtype=np.int64),
            time=np.zeros(2),
            number=np.zeros(1, dtype=np.int64),
        )
        self._n.status[MOST_STEPS] = max(MAX_STEPS, STEPS_PER_EVENT * scene.solver.max_events_per_period)
        self._room = np.zeros((3, cb.ROOM_SIZE))
        self._direction = np.array([-1], dtype=np.int32)
        self._context = self._make_context()
        for mode, system in systems(scene).items():
            (self._make_adams if mode in scene.adams_modes else self._make_ida)(mode, system)

    @property
    def work(self) -> dict[str, int | None]:
        """How much was done so far."""
        links, status = self._n.links, self._n.status
        return {
            "steps": int(status[STEPS]),
            "residual_calls": int(links[:, cb.RESIDUALS].sum()),
            "jacobian_calls": int(links[:, cb.JACOBIANS].sum()),
            "error_test_failures": int(status[ERRORS]),
            "newton_failures": int(status[NEWTONS]),
        }

    @property
    def detail(self) -> str:
        """Why the integrator failed."""
        flag = int(self._n.status[FLAG])
        if flag >= 0:
            most = int(self._n.status[MOST_STEPS])
            stuck = self._n.status[STEPS_MARK] > most
            return f"SUNDIALS: more than {most} steps within a period" if stuck else "the state is not finite"
        if flag in _CALLBACK_FAILURES:
            return "the residual is not finite"
        return f"SUNDIALS: {_MEANINGS.get(flag, 'failure')} (flag {flag})"

    def advance(self, h: Hybrid) -> Tape:
        """Go on with a run until the tape is full; see :class:`vibroplat.integrate.seam.Engine`."""
        drive(h, self._tape, self._n)
        return self._tape

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
        n.links[mode] = (
            lib.address("N_VGetArrayPointer"),
            self._alive[0].ctypes.data,
            n.atol[mode].ctypes.data,
            self._room[mode].ctypes.data,
            system.index,
            system.size,
            -1 if system.guard is None else system.guard,
            0,
            0,
        )
        y, yp = (self._vector(array[mode, : system.size]) for array in (n.y, n.yp))
        return y, yp

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
        content[cb.USER_DATA] = self._n.links[mode].ctypes.data
        head[0], head[place[0] - 1] = content.ctypes.data, operations.ctypes.data
        self._alive += [head, content, operations]
        return head.ctypes.data, matrix

    def _make_ida(self, mode: Mode, system: System) -> None:
        lib, n = self._lib, self._n
        y, yp = self._vectors(mode, system)
        memory = self._made(lib.IDACreate(self._context), lib.IDAFree, by_reference=True)
        _check(lib.IDAInit(memory, cb.residual.address, 0.0, y, yp))
        _check(lib.IDAWFtolerances(memory, cb.weights.address))
        _check(lib.IDASetUserData(memory, n.links[mode].ctypes.data))
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
        if system.guard is not None:
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
        _check(lib.CVodeSetUserData(memory, n.links[mode].ctypes.data))
        # Newton's iteration: fixed-point iteration, which needs no Jacobian, takes half as many steps again and more
        # than twice the right-hand sides
        _check(lib.CVodeSetLinearSolver(memory, *self._linear_solver(mode, system, y)))
        _check(lib.CVodeSetLinSysFn(memory, cb.linear_system.address))
        if system.guard is not None:
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
            motion = Motion(scene, p, engine)
            motion.go_on(duration)
        h = motion.automaton
        y, yp, ypp = (array[Mode.BARE, :10] for array in (h.y, h.yp, h.ypp))
        expected = y + duration * yp + 0.5 * duration**2 * ypp
        error = np.abs(h.state[PLACES[BARE, :10]] - expected).max()
        if motion.outcome != "ok" or not error < 1e-7:
            raise UnavailableError(f"its {method} fails the self-check (outcome {motion.outcome}, error {error:.3g})")


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
