"""Engine ``sundae``: SUNDIALS IDA through scikit-sundae. The one module that imports its IDA."""

from __future__ import annotations

import io
import math
import os
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import dataclass
from typing import Any

import numpy as np

# A guard that is zero throughout (no weight, no motion) makes SUNDIALS warn on the C standard error.
os.environ.setdefault("SUNLOGGER_WARNING_FILENAME", os.devnull)

from sksundae.ida import IDA

from vibroplat.physics.parameters import FloatArray
from vibroplat.physics.systems import System
from vibroplat.solver.engine import Control, Counters, Stop, Stretch
from vibroplat.solver.interpolation import interpolate, missed_fall
from vibroplat.solver.scales import ROUND_OFF

_ROOT = 2


#: Residual calls in one stretch after which the integrator is taken to be stuck; usual are some 10⁴.
MAX_CALLS = 300_000


class _NonFiniteError(ArithmeticError):
    """A residual that is not finite, raised through the callback."""


class _StuckError(RuntimeError):
    """More residual calls than any stretch needs, raised through the callback."""


@dataclass
class _Budget:
    """Residual calls left in a stretch; apart from the engine, so that callbacks make no reference cycle."""

    left: int = MAX_CALLS


@dataclass(frozen=True)
class _Integrator:
    """One IDA object and the event function whose buffers it fills."""

    ida: IDA
    guard: Callable[..., None] | None

    def forget_events(self) -> None:
        # scikit-sundae 1.2 keeps every event on the function object and never clears it: the next
        # solve would stop at once, and each event would make it slower.
        if self.guard is not None:
            buffers: Any = self.guard
            for name in ("_i", "_t", "_y", "_yp"):
                getattr(buffers, name).clear()
            buffers._i_cnt[:] = 0


class SundaeEngine:
    """IDA through scikit-sundae with compiled residual and Jacobian.

    scikit-sundae fixes tolerances and first step when an IDA object is made, so there is one for each
    combination of system, tolerances and first step that occurs (the latter two in powers of 4, so
    there are few), made once and reused by re-initialisation.

    Parameters
    ----------
    p
        Parameter vector of the scene.
    """

    name = "sundae"

    def __init__(self, p: FloatArray) -> None:
        self.counters = Counters()
        self._p = p
        self._budget = _Budget()
        self._integrators: dict[tuple[int, bytes, float], _Integrator] = {}

    def advance(self, system: System, y: FloatArray, yp: FloatArray, control: Control, until: float) -> Stretch:
        """Integrate to the guard or to ``until``; see :class:`vibroplat.solver.engine.Engine`."""
        integrator = self._integrator(system, control)
        self.counters.restarts += 1
        self._budget.left = MAX_CALLS
        here = np.zeros(1), y[np.newaxis], yp[np.newaxis]
        try:
            with redirect_stdout(io.StringIO()):  # where scikit-sundae prints what the status says as well
                result = integrator.ida.solve([0.0, until], y, yp)
        except _NonFiniteError:
            return Stretch(*here, Stop.NON_FINITE, "the residual is not finite")
        except _StuckError:
            return Stretch(*here, Stop.FAILURE, f"IDA: no end of the stretch within {MAX_CALLS} residual calls")
        finally:
            integrator.forget_events()
        self.counters.steps += len(result.t) - 1
        self.counters.residual_calls += result.nfev
        self.counters.jacobian_calls += result.njev
        return _stretch(result, system.guard)

    def _integrator(self, system: System, control: Control) -> _Integrator:
        first_step = 4.0 ** round(math.log(control.first_step, 4.0))
        key = (system.index, control.atol.tobytes(), first_step)
        if key not in self._integrators:
            self._integrators[key] = self._make(system, control.atol, first_step)
        return self._integrators[key]

    def _make(self, system: System, atol: FloatArray, first_step: float) -> _Integrator:
        p, budget = self._p, self._budget
        residual_kernel, jacobian_kernel = system.residual, system.jacobian

        def residual(t: float, y: FloatArray, yp: FloatArray, res: FloatArray) -> None:
            if not residual_kernel(y, yp, res, p):
                raise _NonFiniteError
            budget.left -= 1
            if budget.left < 0:
                raise _StuckError

        def jacobian(t: float, y: FloatArray, yp: FloatArray, res: FloatArray, cj: float, jac: FloatArray) -> None:
            jacobian_kernel(y, yp, cj, jac, p)

        options: dict[str, Any] = {
            "jacfn": jacobian,
            # the absolute tolerances do the work; this keeps what is asked of a component above round-off
            "rtol": ROUND_OFF,
            "atol": atol.copy(),
            "first_step": first_step,
        }
        if system.algebraic:
            options["algebraic_idx"] = [system.differential]
        guard = _guard(system.guard) if system.guard is not None else None
        if guard is not None:
            options |= {"eventsfn": guard, "num_events": 1}
        return _Integrator(IDA(residual, **options), guard)


def _guard(index: int) -> Callable[..., None]:
    """Make the event function of one IDA object: an unknown that falls through zero."""

    def guard(t: float, y: FloatArray, yp: FloatArray, events: FloatArray) -> None:
        events[0] = y[index]

    guard.terminal = [True]  # type: ignore[attr-defined]
    guard.direction = [-1]  # type: ignore[attr-defined]
    return guard


def _stretch(result: Any, guard: int | None) -> Stretch:
    """Read IDA's steps and why they ended, and look inside them for what its signs do not show."""
    t, y, yp = result.t, result.y, result.yp
    stop, detail = (Stop.GUARD if result.status == _ROOT else Stop.TIME), ""
    if result.status < 0:
        stop, detail = Stop.FAILURE, f"IDA: {result.message}"
    if not math.isfinite(y[-1].sum()):
        stop, detail = Stop.NON_FINITE, "the state is not finite"
    if guard is not None:
        step, share = missed_fall(t, y[:, guard], yp[:, guard])
        if step >= 0 and not (stop is Stop.GUARD and step == len(t) - 2):
            length = t[step + 1] - t[step]
            inside, slope = np.empty_like(y[0]), np.empty_like(y[0])
            interpolate(share, length, y[step], y[step + 1], yp[step], yp[step + 1], inside, slope)
            last = step + 1
            t, y, yp = (
                np.append(t[:last], t[step] + share * length),
                np.vstack([y[:last], inside]),
                np.vstack([yp[:last], slope]),
            )
            stop, detail = Stop.GUARD, ""
    return Stretch(t, y, yp, stop, detail)
