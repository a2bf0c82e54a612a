"""An engine of any one-step integrator: the loop around its steps, guards as roots of their polynomials."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vibroplat.hybrid.loop import AT_GUARD, AT_TARGET, AT_TIME, FAILED, NOT_FINITE, begin, conclude
from vibroplat.hybrid.modes import GUARDS
from vibroplat.hybrid.pieces import cut_piece
from vibroplat.hybrid.state import RUNNING, Hybrid
from vibroplat.hybrid.steps import MARGIN, rewind
from vibroplat.integrate.seam import IntegrationError, Integrator
from vibroplat.kernels.compiled import FloatArray, compiled
from vibroplat.kernels.polynomial import crossing, first_fall, stretch, values
from vibroplat.model.accelerations import accelerations
from vibroplat.model.parameters import Parameters
from vibroplat.model.systems import SIZES, SYSTEMS

#: Most steps within a turn of the synchronous speed.
MAX_STEPS = 100_000


class Stepwise:
    """Drives the automaton with an integrator that takes one step at a time.

    Parameters
    ----------
    integrator
        What takes the steps.
    p
        Parameters of the scene.
    """

    rows = 512
    turns_per_segment: float = 1000

    def __init__(self, integrator: Integrator, p: Parameters) -> None:
        self._integrator = integrator
        self._p = p
        self._open = False
        self._first = True
        self._counted, self._counted_from = 0, 0.0
        self.name = integrator.name
        self.degree = integrator.degree
        self.detail = ""
        # nodes where F_c is evaluated, and what turns its values into coefficients
        self._nodes = 0.5 - 0.5 * np.cos(np.pi * np.arange(self.degree + 1) / self.degree)
        self._to_coefficients = np.linalg.inv(np.vander(self._nodes, increasing=True))

    @property
    def work(self) -> Mapping[str, int | None]:
        """How much was done so far."""
        return self._integrator.work

    def close(self) -> None:
        """Do nothing: Python frees what an integrator holds."""

    def advance(self, h: Hybrid) -> None:
        """Carry a run on until there is no room for more steps; see :class:`vibroplat.integrate.seam.Engine`."""
        rewind(h.steps)
        run, used = h.run, h.steps.used
        while run["outcome"] == RUNNING:
            full = used["steps"] + 1 + MARGIN > self.rows
            if not self._open:
                if full or run["events"] + 2 > len(h.events) or not begin(h):
                    return
                system = SYSTEMS[run["systems"][run["mode"]]]
                y = run["y"][run["mode"], : system.differential].copy()
                self._integrator.start(system, float(run["now"]), y, run["atol"][: system.differential].copy())
                self._open = self._first = True
            stop = self._steps(h)
            if stop is None:
                cut_piece(h)
                return
            self._open = False
            conclude(h, stop)

    def _steps(self, h: Hybrid) -> int | None:
        """Take steps until the segment ends; None where there is no room for more."""
        run, used, done = h.run, h.steps.used, 0.0
        if not self._first and used["steps"] == used["first"]:
            done = float(run["now"] - run["origin"])
        while used["steps"] + MARGIN < self.rows:
            try:
                length, coefficients = self._integrator.step(float(run["until"]) - done)
            except IntegrationError as error:
                self.detail = str(error)
                return FAILED
            if not (np.isfinite(coefficients).all() and length > 0.0):
                self.detail = "a step is not finite"
                return NOT_FINITE
            stop = self._add(h, done, length, coefficients)
            self._first = False
            row = used["steps"] - 1
            done = float(h.steps.start[row] + h.steps.length[row])
            if stop >= 0:
                return stop
            if run["origin"] + done - self._counted_from >= run["period"]:
                self._counted, self._counted_from = 0, float(run["origin"]) + done
            self._counted += 1
            if self._counted > MAX_STEPS:
                self.detail = f"more than {MAX_STEPS} steps within a period"
                return FAILED
        return None

    def _add(self, h: Hybrid, start: float, length: float, coefficients: FloatArray) -> int:
        """Add a step; why the segment ends with it, or −1."""
        run, steps = h.run, h.steps
        system = SYSTEMS[run["systems"][run["mode"]]]
        row, differential = int(steps.used["steps"]), system.differential
        c = steps.c[row]
        c[:] = 0.0
        c[:, :differential] = coefficients
        stop, share = -1, 1.0
        if start + length >= run["until"]:
            stop, share = AT_TIME, (float(run["until"]) - start) / length
            stretch(c, self.degree, share)
            length = float(run["until"]) - start
        if system.algebraic:
            forces = np.empty(self.degree + 1)
            contact_forces(system.index, float(run["origin"]) + start, length, c, self._nodes, forces, self._p)
            c[:, differential] = self._to_coefficients @ forces
        guard = int(GUARDS[system.index])
        share = first_fall(c, self.degree, guard, int(run["zeros"]) if self._first else 0) if guard >= 0 else -1.0
        if share >= 0.0:
            stop = AT_GUARD
        target = float(run["target"] - run["turns"][0])
        ends = np.zeros(system.size)
        values(c, self.degree, share if share >= 0.0 else 1.0, ends)
        if ends[3] >= target:
            stop, share = AT_TARGET, crossing(c, self.degree, 3, target)
        if share >= 0.0:
            stretch(c, self.degree, share)
            length *= share
        values(c, self.degree, 1.0, ends)
        steps.start[row], steps.length[row] = start, length
        steps.ends[row, : system.size] = ends
        steps.used["steps"] = row + 1
        return stop


@compiled
def contact_forces(
    system: int, t: float, length: float, c: FloatArray, nodes: FloatArray, forces: FloatArray, p: Parameters
) -> None:
    """Fill F_c by the algebra at fractions of a step of an attached system (N)."""
    size = SIZES[system]
    y, yp = np.empty(size), np.empty(size)
    for i in range(nodes.size):
        values(c, c.shape[0] - 1, nodes[i], y)
        accelerations(system, t + nodes[i] * length, y, yp, p)
        forces[i] = y[size - 1]
