"""An engine of any integrator that hands over steps: the loop around them, with guards as roots of their polynomials.

An integrator has a ``name``, the ``degree`` of its steps' polynomials, and counts its ``work`` by the names of WORK.
``start(system, t, y, atol)`` begins a segment at a time of the run, from differential unknowns with their tolerances.
``steps(longest)`` takes a step, or some at once, which may go beyond the time that is left of the segment: their
durations, shape (m,), and coefficients of the differential unknowns in powers of the fraction of a step, shape
(m, degree + 1, 2n). F_c follows from them by the algebra. It raises an IntegrationError where no step can be taken.
"""

import numpy as np

from vibroplat.config.engines import ENGINES
from vibroplat.errors import ConfigError
from vibroplat.hybrid.loop import AT_GUARD, AT_TARGET, AT_TIME, FAILED, NOT_FINITE, begin_segment, end_segment
from vibroplat.hybrid.modes import GUARDS
from vibroplat.hybrid.starts import cut_piece
from vibroplat.hybrid.state import CUBIC, MARGIN, RUNNING, rewind
from vibroplat.integrate.interface import count_within_period
from vibroplat.kernels.compiled import NOWHERE, Callee
from vibroplat.kernels.polynomial import crossing, first_downcrossing, stretch, values
from vibroplat.model.accelerations import accelerations
from vibroplat.model.systems import SYSTEMS

#: Most steps within a turn of the synchronous speed; an integrator that takes more is stuck.
MAX_STEPS = 100_000

#: The segment goes on.
_ON = -1


class IntegrationError(ArithmeticError):
    """An integrator could not take a step; the message says why."""


class Stepwise:
    """Drives the automaton with an integrator."""

    rows = 512
    turns_per_segment = 1000.0

    def __init__(self, integrator, p):
        self.name = integrator.name
        self.degree = max(integrator.degree, CUBIC)  # chatter is a cubic
        self.detail = ""
        self._integrator, self._p = integrator, p
        self._nodes = 0.5 - 0.5 * np.cos(np.pi * np.arange(self.degree + 1) / self.degree)
        self._powers = self._nodes[:, np.newaxis] ** np.arange(self.degree + 1)
        self._open = False
        self._done = 0.0  # time of the segment up to the last step (s)
        self._counted, self._counted_from = 0.0, 0.0
        self._taken = []  # steps that are not added yet

    @property
    def work(self):
        return self._integrator.work

    def compiled_loop(self, h):
        return Callee(NOWHERE)

    def close(self):
        pass

    def advance(self, h):
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

    def _begin(self, h):
        """Begin a segment; whether there is one."""
        if not begin_segment(h):
            return False
        run = h.run
        system = SYSTEMS[run["systems"][run["mode"]]]
        if system.slides:  # two guards and a second force
            raise ConfigError(f"engine {self.name} does not go with transport; allowed: {', '.join(ENGINES)}")
        start, atol = (numbers[: system.differential].copy() for numbers in (run["y"][run["mode"]], run["atol"]))
        self._integrator.start(system, float(run["origin"]), start, atol)
        self._open, self._done = True, 0.0
        self._counted, self._counted_from = 0.0, 0.0
        self._taken = []  # what was taken beyond the end of the last segment is dropped
        return True

    def _go_on(self, h):
        """Add steps until the segment ends, and say why, or until there is no room for more."""
        until, period, stop = float(h.run["until"]), float(h.run["period"]), _ON
        while stop == _ON and h.steps.used["steps"] + MARGIN < self.rows:
            if not self._taken:
                if self._counted > MAX_STEPS:
                    self.detail = f"{self.name}: more than {MAX_STEPS} steps within a period"
                    return FAILED
                try:
                    self._taken = [*zip(*self._integrator.steps(until - self._done), strict=True)]
                except IntegrationError as error:
                    self.detail = f"{self.name}: {error}"
                    return FAILED
                self._counted += len(self._taken)
            stop = self._add(h, *self._taken.pop(0))
            counted, since = self._counted, self._counted_from
            self._counted, self._counted_from = count_within_period(counted, since, self._done, period)
        return stop

    def _add(self, h, length, coefficients):
        """Add a step up to the segment's time, its guard's fall or the run's target; why the segment ends, or _ON."""
        run, steps, start = h.run, h.steps, self._done
        row, system = int(steps.used["steps"]), SYSTEMS[run["systems"][run["mode"]]]
        c, end, degree = steps.c[row], steps.ends[row][: system.size], steps.c.shape[1] - 1
        c[:] = 0.0
        c[: len(coefficients), : system.differential] = coefficients
        stop, until = _ON, float(run["until"])
        if start + length >= until:
            stop = AT_TIME
            stretch(c, degree, (until - start) / length)
            length = until - start
        finite = np.isfinite(c).all() and length > 0.0
        if not finite or (system.algebraic and not self._add_force(system, float(run["origin"]) + start, length, c)):
            self.detail = f"{self.name}: a step is not finite"
            return NOT_FINITE
        guard, target = int(GUARDS[system.index]), float(run["target"] - run["turns"][0])
        fall = first_downcrossing(c, degree, guard, int(run["zeros"])) if guard >= 0 else -1.0
        run["zeros"] = 0  # they were of the segment's start
        if fall >= 0.0:
            stop = AT_GUARD
            stretch(c, degree, fall)
            length *= fall
        values(c, degree, 1.0, end)
        if end[3] >= target:
            stop = AT_TARGET
            share = crossing(c, degree, 3, target, float(end[3]))
            stretch(c, degree, share)
            length *= share
            values(c, degree, 1.0, end)
        steps.start[row], steps.length[row] = start, length
        steps.used["steps"] = row + 1
        self._done = start + length
        return stop

    def _add_force(self, system, t, length, c):
        """Fill the column of F_c by the algebra at nodes of a step that begins at t; whether it exists at all."""
        force = system.differential
        y, yp, forces = np.empty(force + 1), np.empty(force + 1), np.empty(len(self._nodes))
        for i, s in enumerate(self._nodes):
            values(c, len(c) - 1, float(s), y)
            if not accelerations(system.index, t + s * length, y, yp, self._p):
                return False
            forces[i] = y[force]
        c[:, force] = np.linalg.solve(self._powers, forces)
        return True
