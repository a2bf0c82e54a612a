"""Engine ``native``: SUNDIALS IDA without the interpreter in the loop.

The library of :mod:`vibroplat.integrate.sundials` is driven from compiled code, :mod:`vibroplat.integrate.ida`, through
the addresses of its functions. Between two readings of the steps — some thousand, with all events in them — no Python
runs and the interpreter's lock is free.
"""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Callable
from contextlib import closing
from typing import Any

import numpy as np

from vibroplat.config.coordinates import Mode
from vibroplat.config.scene import Scene
from vibroplat.hybrid import loop
from vibroplat.hybrid.loop import automaton
from vibroplat.hybrid.modes import GUARDS
from vibroplat.hybrid.state import CUBIC, OK, Automaton, empty_steps
from vibroplat.integrate import ida
from vibroplat.integrate.interface import most_steps
from vibroplat.integrate.sundials import Library, UnavailableError, library
from vibroplat.kernels.compiled import Callee, FloatArray, address_of, quick_call
from vibroplat.model.parameters import Parameters, parameters, record_address
from vibroplat.model.systems import System, systems

# How IDA chooses its steps. Means over nine tolerances around 1e-6, in contact and with 50 impacts a second.
# What does not pay: a first step half or a quarter as long makes errors 1.06 and 0.98 times as large, over 300 random
# scenes. If Newton's iteration may leave a tenth of a step's error instead of a third, a quarter fewer scenes are
# inaccurate at loose tolerances, where motors are stiff, but at 1e-8 it takes 30 % more residuals.
#: Factors between which the step is kept rather than changed. IDA's own (1, 2) takes a sixth more steps. With these,
#: and steps that shrink by 0.8 at once instead of 0.9, errors over 600 random scenes are 0.44 times as large in 7 %
#: more time, but a sweep takes a fifth more.
ETA_FIXED = (0.9, 1.3)
#: Largest growth of a step, also while the order rises after a restart. With 3 instead of IDA's own 2 a
#: restart takes a sixth fewer steps; 8 fails more tests of the error than it saves.
ETA_MAX = 3.0
#: Change of the leading coefficient that asks for a new Jacobian. With IDA's own 0.25 the old one makes
#: Newton's iteration so slow that it takes a quarter more residuals; 0.05 takes more Jacobians for no fewer.
DELTA_CJ = 0.1

# Of sundials_linearsolver.h: words of a SUNLinearSolver, of which the first is its content, and functions in its
# table of operations. Copies have room for more, which a later version would find empty: "not implemented".
_SOLVER_WORDS, _SOLVER_OPERATIONS, _SPARE = 4, 16, 48

_MEANINGS = {
    -2: "too much accuracy asked for",
    -3: "error test failed too often",
    -4: "Newton iteration failed too often",
    -5: "linear solver could not be set up",
    -6: "Jacobian could not be evaluated or factorized",
    -7: "linear system could not be solved",
}


class NativeEngine:
    """IDA driven from compiled code.

    One context and one solver for each mode belong to a run, and with them to its thread; :meth:`close`
    frees them.

    Raises
    ------
    MemoryError
        SUNDIALS could not make one of its objects.
    """

    name = "native"
    #: Many steps against what a return to Python costs, few against the processor's cache.
    rows, degree = 2048, CUBIC
    #: Long, for a restart costs some thirty steps; not for ever, for angles lose digits as they grow.
    turns_per_segment: float = 1000

    def __init__(self, scene: Scene, p: Parameters, library: Library) -> None:
        self._lib = library
        self._free: list[Callable[[], object]] = []
        self._finalizer = weakref.finalize(self, _free_all, self._free)
        self._alive: list[Any] = []  # what the library holds addresses of
        self._p = p  # not a copy: a drive's program changes it in place
        self._run_loop = quick_call(ida.run_loop)
        self._n = ida.empty_records()
        for name, function in ida.NAMES.items():
            self._n.functions[name] = library.address(function)
        self._n.status["max_steps"] = most_steps(scene)
        self._direction = np.array([-1], dtype=np.int32)
        self._context = self._make_context()
        for mode, system in systems(scene).items():
            self._make_solver(mode, system)

    @property
    def work(self) -> dict[str, int | None]:
        """How much was done so far."""
        links, status = self._n.links, self._n.status
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
        status = self._n.status
        flag, max_steps = int(status["flag"]), int(status["max_steps"])
        if flag >= 0:
            stuck = status["counted"] > max_steps
            return f"SUNDIALS: more than {max_steps} steps within a period" if stuck else "the state is not finite"
        if flag == ida.RESIDUAL_FAILURE:
            return "the residual is not finite"
        return f"SUNDIALS: {_MEANINGS.get(flag, 'failure')} (flag {flag})"

    def advance(self, h: Automaton) -> None:
        """Go on with a run; see :class:`vibroplat.integrate.interface.Engine`."""
        self._run_loop(h, self._n)

    def compiled_loop(self, h: Automaton) -> Callee:
        """Return what :meth:`advance` calls."""
        return Callee(address_of(ida.run_loop, h, self._n), (self._n,))

    def close(self) -> None:
        """Free solvers, vectors, matrices and the context."""
        self._finalizer()

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

    def _make_solver(self, mode: Mode, system: System) -> None:
        """Make the solver of a mode, and fill its callbacks' user data."""
        lib, n = self._lib, self._n
        links, user = n.links[mode], int(n.links[mode : mode + 1].ctypes.data)
        links["vector"] = lib.address("N_VGetArrayPointer")
        links["parameters"] = record_address(self._p)
        links["tolerances"] = n.atol[mode].ctypes.data
        links["solver"] = links["condensed"].ctypes.data
        links["system"], links["size"], links["guard"] = system.index, system.size, GUARDS[system.index]
        links["half"] = system.differential // 2
        y, yp = (self._vector(array[mode, : system.size]) for array in (n.y, n.yp))
        memory = self._made(lib.IDACreate(self._context), lib.IDAFree, by_reference=True)
        _check(lib.IDAInit(memory, ida.residual.address, 0.0, y, yp))
        _check(lib.IDAWFtolerances(memory, ida.weights.address))
        _check(lib.IDASetUserData(memory, user))
        _check(lib.IDASetLinearSolver(memory, *self._linear_solver(system.size, y, user)))
        _check(lib.IDASetJacFn(memory, ida.jacobian.address))
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
        if GUARDS[system.index] >= 0 and not system.slides:  # linear forms are looked at after each step
            _check(lib.IDARootInit(memory, 1, ida.guard.address))
            _check(lib.IDASetRootDirection(memory, self._direction.ctypes.data))
            _check(lib.IDASetNoInactiveRootWarn(memory))
        n.handles[mode] = (memory, y, yp)

    def _linear_solver(self, size: int, y: int, user: int) -> tuple[int, int]:
        """Make a SUNLinearSolver whose setup and solve are ours, a copy of the library's dense one, and its matrix."""
        lib = self._lib
        matrix = self._made(lib.SUNDenseMatrix(size, size, self._context), lib.SUNMatDestroy)
        dense = self._made(lib.SUNLinSol_Dense(y, matrix, self._context), lib.SUNLinSolFree)
        head = _words(dense, _SOLVER_WORDS)
        place = np.flatnonzero(head == self._context)  # the table of operations is before it, its place differs
        operations = _words(int(head[place[0] - 1]), _SOLVER_OPERATIONS) if place.size == 1 and place[0] > 1 else head
        for name, ours in (("SUNLinSolSetup_Dense", ida.setup), ("SUNLinSolSolve_Dense", ida.solve)):
            places = operations == lib.address(name)
            if places.sum() != 1:
                raise UnavailableError(f"{name} is not found among the operations of its dense linear solver")
            operations[places] = ours.address
        content = _words(int(head[0]), ida.USER_DATA)
        content[ida.USER_DATA] = user
        head[0], head[place[0] - 1] = content.ctypes.data, operations.ctypes.data
        self._alive += [head, content, operations]
        return head.ctypes.data, matrix


def self_check(library: Library) -> None:
    """Take a few steps and compare them with the motion's Taylor polynomial.

    Raises
    ------
    UnavailableError
        The library does not integrate as it should.
    """
    duration = 1e-5
    scene = Scene().replace({"solver.tolerance": 1e-11})
    p = parameters(scene)
    with closing(NativeEngine(scene, p, library)) as engine:
        h = automaton(scene, p, empty_steps(engine.rows, engine.degree), engine.turns_per_segment)
        loop.first_mode(h)
        h.run["end"] = duration
        engine.advance(h)
    y, yp, ypp = (h.run[name][Mode.BARE, :10] for name in ("y", "yp", "ypp"))
    expected = y + duration * yp + 0.5 * duration**2 * ypp
    error = np.abs(h.run["state"][systems(scene)[Mode.BARE].places] - expected).max()
    if h.run["outcome"] != OK or not error < 1e-7:
        raise UnavailableError(f"it fails the self-check (error {error:.3g})")


def _words(address: int, count: int) -> ida.IntArray:
    """Copy machine words, with zeros behind them."""
    return np.append(np.array((ctypes.c_int64 * count).from_address(address)), np.zeros(_SPARE, dtype=np.int64))


def _free_all(stack: list[Callable[[], object]]) -> None:
    """Free in the reverse order of making."""
    while stack:
        stack.pop()()


def _check(flag: Any) -> None:
    if flag != 0:
        raise MemoryError(f"SUNDIALS refused its setup (flag {flag})")


def make_native(scene: Scene, p: Parameters) -> NativeEngine:
    """Make the engine with the library of scikit-sundae."""
    return NativeEngine(scene, p, library())
