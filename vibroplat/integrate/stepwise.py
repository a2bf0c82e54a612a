"""An engine of any integrator: the loop around its steps, with guards as roots of their polynomials."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vibroplat.errors import ConfigError
from vibroplat.hybrid.loop import AT_GUARD, AT_TARGET, AT_TIME, FAILED, NOT_FINITE, begin_segment, end_segment
from vibroplat.hybrid.modes import GUARDS
from vibroplat.hybrid.resets import cut_piece
from vibroplat.hybrid.state import CUBIC, MARGIN, RUNNING, Automaton, Steps, rewind
from vibroplat.integrate.interface import IntegrationError, Integrator
from vibroplat.kernels.compiled import NOWHERE, Callee, FloatArray, compiled
from vibroplat.kernels.engines import ENGINES
from vibroplat.kernels.polynomial import Fit, crossing, first_downcrossing, fit, fit_column, stretch, values
from vibroplat.model.accelerations import accelerations
from vibroplat.model.equations import finite
from vibroplat.model.parameters import Parameters
from vibroplat.model.systems import DIFFERENTIAL, SIZES, SYSTEMS

#: Most steps within a turn of the synchronous speed; an integrator that takes more is stuck.
MAX_STEPS = 100_000

#: The segment goes on.
_ON = -1


class Stepwise:
    """Drives the automaton with an integrator that hands over steps."""

    rows = 512
    turns_per_segment: float = 1000

    def __init__(self, integrator: Integrator, p: Parameters) -> None:
        self.name = integrator.name
        self.degree = max(integrator.degree, CUBIC)  # chatter is a cubic
        self.detail = ""
        self._integrator, self._p = integrator, p
        self._fit = fit(self.degree)
        self._open = False
        self._done = 0.0  # time of the segment up to the last step (s)
        self._counted, self._counted_from = 0, 0.0
        self._taken: tuple[FloatArray, FloatArray] = np.empty(0), np.empty((0, 0, 0))
        self._next = 0  # of the steps taken

    @property
    def work(self) -> Mapping[str, int | None]:
        """How much was done so far."""
        return self._integrator.work

    def compiled_loop(self, h: Automaton) -> Callee:
        """Return none: its loop is Python's."""
        return Callee(NOWHERE)

    def close(self) -> None:
        """Do nothing: Python frees what an integrator holds."""

    def advance(self, h: Automaton) -> None:
        """Carry a run on until there is no room for more steps; see :class:`vibroplat.integrate.interface.Engine`."""
        rewind(h.steps)
        while h.run["outcome"] == RUNNING:
            if h.steps.used["steps"] + MARGIN >= self.rows or not (self._open or self._begin(h)):
                return
            stop = self._go_on(h)
            if stop == _ON:
                cut_piece(h)
                return
            self._open = False
            end_segment(h, stop)

    def _begin(self, h: Automaton) -> bool:
        """Begin a segment; whether there is one."""
        if not begin_segment(h):
            return False
        run = h.run
        system = SYSTEMS[run["systems"][run["mode"]]]
        if system.slides:  # two guards and a second force
            raise ConfigError(f"engine {self.name} does not go with transport; allowed: {', '.join(ENGINES)}")
        start, atol = (values[: system.differential].copy() for values in (run["y"][run["mode"]], run["atol"]))
        self._integrator.start(system, float(run["origin"]), start, atol)
        self._open, self._done = True, 0.0
        self._counted, self._counted_from = 0, 0.0
        self._next = len(self._taken[0])  # what was taken beyond the end of the last segment is dropped
        return True

    def _go_on(self, h: Automaton) -> int:
        """Add steps until the segment ends, and say why, or until there is no room for more."""
        until, period = float(h.run["until"]), float(h.run["period"])
        while h.steps.used["steps"] + MARGIN < self.rows:
            if self._next == len(self._taken[0]):
                if self._counted > MAX_STEPS:
                    self.detail = f"{self.name}: more than {MAX_STEPS} steps within a period"
                    return FAILED
                try:
                    self._taken = self._integrator.steps(until - self._done)
                except IntegrationError as error:
                    self.detail = f"{self.name}: {error}"
                    return FAILED
                self._next = 0
                self._counted += len(self._taken[0])
            stop, self._next, self._done = add_steps(
                h.run, h.steps, self._next, self._done, *self._taken, self._fit, self._p
            )
            if stop == NOT_FINITE:
                self.detail = f"{self.name}: a step is not finite"
            if stop != _ON:
                return int(stop)
            if self._done - self._counted_from >= period:
                self._counted, self._counted_from = 0, self._done
        return _ON


@compiled
def add_steps(
    run: Any, steps: Steps, k: int, done: float, lengths: FloatArray, coefficients: FloatArray, fit: Fit, p: Parameters
) -> tuple[int, int, float]:
    """Add an integrator's steps from number ``k`` on, at time ``done`` of the segment (s), while there is room.

    Returns why the segment ends with the last of them, or _ON, the number of the next one, and the time then.
    """
    used = steps.used
    while k < lengths.size and used.steps + MARGIN < steps.start.size:
        stop = add_step(run, steps, done, lengths[k], coefficients[k], fit, p)
        k += 1
        if stop == NOT_FINITE:
            return stop, k, done
        done = steps.start[used.steps - 1] + steps.length[used.steps - 1]
        if stop != _ON:
            return stop, k, done
    return _ON, k, done


@compiled
def add_step(
    run: Any, steps: Steps, start: float, length: float, coefficients: FloatArray, fit: Fit, p: Parameters
) -> int:
    """Add a step up to the segment's time, its guard's fall or the run's target; why the segment ends, or _ON."""
    row = steps.used.steps
    c, end, degree = steps.c[row], steps.ends[row], steps.c.shape[1] - 1
    system = run.systems[run.mode]
    size, differential = SIZES[system], DIFFERENTIAL[system]
    for i in range(degree + 1):
        for j in range(size):
            c[i, j] = coefficients[i, j] if i < coefficients.shape[0] and j < differential else 0.0
    for i in range(degree + 1):
        if not (finite(c[i]) and length > 0.0):
            return NOT_FINITE
    stop = _ON
    if start + length >= run.until:
        stop = AT_TIME
        stretch(c, degree, (run.until - start) / length)
        length = run.until - start
    if size > differential and not add_force(system, run.origin + start, length, c, fit, p):
        return NOT_FINITE
    guard, target = GUARDS[system], run.target - run.turns[0]
    fall = first_downcrossing(c, degree, guard, run.zeros) if guard >= 0 else -1.0
    run.zeros = 0  # they were of the segment's start
    if fall >= 0.0:
        stop = AT_GUARD
        stretch(c, degree, fall)
        length *= fall
    values(c, degree, 1.0, end[:size])
    if end[3] >= target:
        stop = AT_TARGET
        share = crossing(c, degree, 3, target, end[3])
        stretch(c, degree, share)
        length *= share
        values(c, degree, 1.0, end[:size])
    steps.start[row], steps.length[row] = start, length
    steps.used.steps = row + 1
    return stop


@compiled
def add_force(system: int, t: float, length: float, c: FloatArray, fit: Fit, p: Parameters) -> bool:
    """Fill the column of F_c by the algebra at nodes of a step that begins at t; whether it exists at all of them."""
    degree, force = c.shape[0] - 1, DIFFERENTIAL[system]
    y, yp, forces = np.empty(force + 1), np.empty(force + 1), np.empty(degree + 1)
    for i in range(degree + 1):
        values(c, degree, fit.nodes[i], y)
        if not accelerations(system, t + fit.nodes[i] * length, y, yp, p):
            return False
        forces[i] = y[force]
    fit_column(fit, forces, c, force)
    return True
