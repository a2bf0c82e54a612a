"""Engine ``sundae``: SUNDIALS through scikit-sundae. The one module that imports its IDA."""

from __future__ import annotations

import io
import math
import os
from contextlib import redirect_stdout, suppress
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

# A guard that is zero throughout (no weight, no motion) makes SUNDIALS warn on the C standard error.
os.environ.setdefault("SUNLOGGER_WARNING_FILENAME", os.devnull)

from sksundae.ida import IDA

from vibroplat.config.scene import Scene
from vibroplat.hybrid.loop import AT_GUARD, AT_TIME, FAILED, NOT_FINITE, begin_segment, end_segment
from vibroplat.hybrid.modes import COUNTS, guard_value
from vibroplat.hybrid.starts import cut_piece
from vibroplat.hybrid.state import CUBIC, MARGIN, ROUND_OFF, Automaton, rewind
from vibroplat.integrate.interface import WORK, count_from, count_within_period
from vibroplat.integrate.multistep import begin_steps, empty_step, limit_force_slopes, prepare_first_step, transcribe
from vibroplat.kernels.compiled import NOWHERE, Callee, FloatArray
from vibroplat.model.equations import jacobian as fill_jacobian
from vibroplat.model.equations import residual as fill_residual
from vibroplat.model.parameters import Parameters
from vibroplat.model.systems import SYSTEMS, System
from vibroplat.system.forks import lock

_ROOT = 2

#: What scikit-sundae counts.
COUNTED = tuple(WORK)[:3]

#: Residual calls within a period after which the integrator is taken to be stuck, usual are some 10³, and those that
#: each segment adds to what is left of them. A call takes 60 µs, so that it is found in some seconds.
MAX_CALLS, CALLS_PER_SEGMENT = 100_000, 60

#: Fraction of the way to a failure that is gone again, to have what was before it.
RETAINED_FRACTION = 0.999

_SOLVING = lock()


class _GivenUpError(ArithmeticError):
    """Raised through the residual: why the segment ends, and the reason in words."""

    def __init__(self, stop: int, detail: str) -> None:
        super().__init__(detail)
        self.stop, self.detail = stop, detail


@dataclass
class _Budget:
    """Residual calls within a period; apart from the engine, so that callbacks make no reference cycle."""

    period: float = math.inf
    origin: float = 0.0
    counted: float = 0.0
    since: float = 0.0
    reached: float = 0.0

    def begin(self, origin: float, period: float) -> None:
        """Begin a segment at a time of the run."""
        self.origin, self.period, self.reached = origin, period, 0.0
        self.counted, self.since = count_from(max(self.counted - CALLS_PER_SEGMENT, 0.0), self.since, origin)

    def count(self, t: float) -> None:
        """Count a call at a time of the segment; raises where there are more than any segment or period needs."""
        self.reached = max(self.reached, t)
        self.counted, self.since = count_within_period(self.counted + 1.0, self.since, self.origin + t, self.period)
        if self.counted > MAX_CALLS:
            raise _GivenUpError(FAILED, f"SUNDIALS: more than {MAX_CALLS} residual calls within a period")


class _Ends(NamedTuple):
    """Ends of a segment's steps that are not transcribed yet: times, unknowns, derivatives, why it stopped."""

    t: FloatArray
    y: FloatArray
    yp: FloatArray
    stop: int


class SundaeEngine:
    """IDA through scikit-sundae with compiled residual and Jacobian.

    scikit-sundae fixes tolerances and first step when an IDA object is made, so there is one for each
    combination of system, tolerances and first step that occurs (the latter two in powers of 4, so
    there are few), made once and reused by re-initialisation.
    """

    name = "sundae"
    rows, degree = 4096, CUBIC
    #: A segment's steps are all held in memory, and its progress is told at its end.
    turns_per_segment: float = 100

    def __init__(self, p: Parameters) -> None:
        self._counts = dict.fromkeys(COUNTED, 0)
        self.detail = ""
        self._p = p
        self._budget = _Budget()
        self._integrators: dict[tuple[int, bytes, float], tuple[IDA, Any]] = {}
        self._past = empty_step()
        self._pending: _Ends | None = None

    @property
    def work(self) -> dict[str, int | None]:
        """How much was done so far; scikit-sundae does not tell of failed steps."""
        return dict.fromkeys(WORK) | self._counts

    def compiled_loop(self, h: Automaton) -> Callee:
        """Return none: its loop is Python's."""
        return Callee(NOWHERE)

    def close(self) -> None:
        """Free the solver objects."""
        self._integrators.clear()

    def advance(self, h: Automaton) -> None:
        """Carry a run on for one segment, or part of it; see :class:`vibroplat.integrate.interface.Engine`."""
        rewind(h.steps)
        if self._pending is None:
            first_step = prepare_first_step(h) if begin_segment(h) else -1.0
            if first_step < 0.0:
                return
            self._pending = self._integrate(h, first_step)
        system, ends, room = SYSTEMS[h.run["systems"][h.run["mode"]]], self._pending, self.rows - MARGIN
        target = float(h.run["target"] - h.run["turns"][0])
        root_found = ends.stop == AT_GUARD and len(ends.t) <= room
        stop = transcribe(h, self._past, ends.t[:room], ends.y[:room], ends.yp[:room], root_found, target)
        cut = stop < 0 and len(ends.t) > room
        if system.algebraic:
            limit_force_slopes(h, cut)
        if cut:
            self._pending = _Ends(ends.t[room:], ends.y[room:], ends.yp[room:], ends.stop)
            cut_piece(h)
        else:
            self._pending = None
            end_segment(h, ends.stop if stop < 0 else stop)

    def _integrate(self, h: Automaton, first_step: float) -> _Ends:
        """Integrate the segment that begins."""
        run, budget = h.run, self._budget
        mode = run["mode"]
        system = SYSTEMS[run["systems"][mode]]
        start, slope = run["y"][mode, : system.size].copy(), run["yp"][mode, : system.size].copy()
        integrator = self._integrator(system, run["atol"][: system.size].copy(), first_step)
        budget.begin(float(run["origin"]), float(run["period"]))
        result = None
        try:
            result = self._solve(integrator, float(run["until"]), start, slope)
        except _GivenUpError as error:
            stop, self.detail = error.stop, error.detail
            until, budget.counted = RETAINED_FRACTION * budget.reached, 0.0
            if until > 0.0:  # what there was until shortly before
                with suppress(_GivenUpError):
                    result = self._solve(integrator, until, start, slope)
        else:
            stop, self.detail = AT_GUARD if result.status == _ROOT else AT_TIME, ""
            if result.status < 0:
                stop, self.detail = FAILED, f"SUNDIALS: {result.message}"
            elif not math.isfinite(result.y[-1].sum()):
                stop, self.detail = NOT_FINITE, "the state is not finite"
        t, y, yp = np.zeros(1), start[np.newaxis], slope[np.newaxis]
        if result is not None:
            t, y, yp = result.t, result.y, result.yp
            for name, count in zip(COUNTED, (len(t) - 1, result.nfev, result.njev), strict=True):
                self._counts[name] += count
        whole = np.isfinite(y.sum(axis=1)) & np.isfinite(yp.sum(axis=1))
        rows = len(t) if whole.all() else int(np.argmin(whole))
        begin_steps(self._past, y[0], yp[0])
        return _Ends(t[1:rows], y[1:rows], yp[1:rows], stop)

    def _solve(self, integrator: tuple[IDA, Any], until: float, start: FloatArray, slope: FloatArray) -> Any:
        """Integrate from a segment's start until a time in it, or the guard."""
        solver, guard = integrator
        try:
            # scikit-sundae prints what the status says as well; standard output is that of all threads, and
            # callbacks hold the interpreter's lock, so that waiting for each other costs them nothing
            with _SOLVING, redirect_stdout(io.StringIO()):
                return solver.solve([0.0, until], start.copy(), slope.copy())
        finally:
            # scikit-sundae 1.2 keeps every event on the function object and never clears it: the next
            # solve would stop at once, and each event would make it slower
            if guard is not None:
                for name in ("_i", "_t", "_y", "_yp"):
                    getattr(guard, name).clear()
                guard._i_cnt[:] = 0

    def _integrator(self, system: System, atol: FloatArray, first_step: float) -> tuple[IDA, Any]:
        """Find or make the IDA object of a system with these tolerances, and the guard whose events it keeps."""
        first_step = 4.0 ** round(math.log(first_step, 4.0))
        key = (system.index, atol.tobytes(), first_step)
        if key in self._integrators:
            return self._integrators[key]
        p, budget, number, count = self._p, self._budget, system.index, int(COUNTS[system.index])

        def residual(t: float, y: FloatArray, yp: FloatArray, res: FloatArray) -> None:
            if not fill_residual(number, budget.origin + t, y, yp, res, p):
                raise _GivenUpError(NOT_FINITE, "the residual is not finite")
            budget.count(t)

        def jacobian(t: float, y: FloatArray, yp: FloatArray, res: FloatArray, cj: float, jac: FloatArray) -> None:
            fill_jacobian(number, budget.origin + t, y, yp, cj, jac, p)

        def guard(t: float, y: FloatArray, yp: FloatArray, events: FloatArray) -> None:
            for which in range(count):
                events[which] = guard_value(number, which, y, p)

        guard.terminal, guard.direction = [True] * count, [-1] * count  # type: ignore[attr-defined]
        options: dict[str, Any] = {
            "jacfn": jacobian,
            # the absolute tolerances do the work; this keeps what is asked of a component above round-off
            "rtol": ROUND_OFF,
            "atol": atol,
            "first_step": first_step,
        }
        if system.algebraic:
            options["algebraic_idx"] = [*range(system.differential, system.size)]
        if count:
            options |= {"eventsfn": guard, "num_events": count}
        self._integrators[key] = IDA(residual, **options), guard if count else None
        return self._integrators[key]


def make_sundae(_: Scene, p: Parameters) -> SundaeEngine:
    """Make the engine, which knows its scene by the parameters alone."""
    return SundaeEngine(p)
