"""IDA of SUNDIALS through scikit-sundae with Python callbacks, as its documentation suggests.

Residual and Jacobian are the package's compiled kernels; what differs from the engine ``sundae`` is what a
user of it cannot change: IDA's own first step, and its error test, in which F_c takes part.
"""

from __future__ import annotations

import io
from contextlib import redirect_stdout
from typing import Any

import numpy as np
from sksundae.ida import IDA

from vibroplat.bench.peers.following import Leg, Legs, straight
from vibroplat.config.coordinates import Mode
from vibroplat.config.scene import Scene
from vibroplat.hybrid.modes import GUARDS
from vibroplat.hybrid.state import FORCE_SHARE, ROUND_OFF, fill_cubic, state_scales
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.accelerations import accelerations
from vibroplat.model.equations import jacobian as jacobian_kernel
from vibroplat.model.equations import residual as residual_kernel
from vibroplat.model.parameters import Parameters, parameters
from vibroplat.model.systems import System, systems

#: Longest step in flight, in turns: a longer one could pass over a short flight.
FLIGHT_STEP = 0.05

#: Most steps between two outputs; scikit-sundae's own 500 ends runs without an exception.
MOST_STEPS = 1_000_000

_ROOT = 2


class Callbacks(Legs):
    """One IDA object for each mode, re-initialised at every restart; cubics through the ends of its steps."""

    name = "scikit-sundae, Python callbacks"
    rows, turns_per_segment = 16384, 25.0

    def __init__(self, scene: Scene, tolerance: float) -> None:
        super().__init__()
        self.p = parameters(scene)
        self.systems = systems(scene)
        self.solvers: dict[Mode, tuple[IDA, Any]] = {}
        for mode, system in self.systems.items():
            scales = np.full(system.size, FORCE_SHARE * scene.force_scale)
            scales[: system.differential] = state_scales(scene)[system.places]
            longest = FLIGHT_STEP * 2.0 * np.pi / scene.speed_scale if mode is Mode.FLIGHT else 0.0
            self.solvers[mode] = _solver(system, self.p, tolerance * scales, longest)

    def leg(self, mode: Mode, t: float, y: FloatArray, until: float) -> Leg:
        """See :class:`vibroplat.bench.peers.following.Legs`."""
        system = self.systems[mode]
        solver, guard = self.solvers[mode]
        start, slope = np.zeros(system.size), np.empty(system.size)
        start[: system.differential] = y
        accelerations(system.index, t, start, slope, self.p)
        with redirect_stdout(io.StringIO()):  # what the status says is printed as well
            found = solver.solve([t, until], start, slope)
        _forget(guard)
        if found.status < 0:
            raise RuntimeError(f"IDA: {found.message}")
        fell, ends, rates = found.status == _ROOT, found.y[:, : system.differential], found.yp
        if self.times is None:
            return straight([y, ends[-1].copy()], [float(found.t[-1]) - t], fell)
        lengths = np.diff(found.t)
        coefficients = np.zeros((lengths.size, self.degree + 1, system.differential))
        for k, c in enumerate(coefficients):
            fill_cubic(c, lengths[k], ends[k], ends[k + 1], rates[k], rates[k + 1])
        return Leg(fell, ends[-1], lengths, coefficients)


def _solver(system: System, p: Parameters, atol: FloatArray, longest: float) -> tuple[IDA, Any]:
    """Make the IDA object of a system, and its event function if it has one."""
    number, place = system.index, int(GUARDS[system.index])

    def residual(t: float, y: FloatArray, yp: FloatArray, res: FloatArray) -> None:
        residual_kernel(number, t, y, yp, res, p)

    def jacobian(t: float, y: FloatArray, yp: FloatArray, res: FloatArray, cj: float, jac: FloatArray) -> None:
        jacobian_kernel(number, t, y, yp, cj, jac, p)

    def guard(t: float, y: FloatArray, yp: FloatArray, events: FloatArray) -> None:
        events[0] = y[place]

    options: dict[str, Any] = {
        "jacfn": jacobian,
        "rtol": ROUND_OFF,
        "atol": atol,
        "max_step": longest,
        "max_num_steps": MOST_STEPS,
    }
    if system.algebraic:
        options["algebraic_idx"] = [system.differential]
    if place < 0:
        return IDA(residual, **options), None
    guard.terminal, guard.direction = [True], [-1]  # type: ignore[attr-defined]
    return IDA(residual, eventsfn=guard, num_events=1, **options), guard


def _forget(guard: Any) -> None:
    """Clear the events that scikit-sundae keeps on the function: the next solve would stop at once."""
    if guard is not None:
        for name in ("_i", "_t", "_y", "_yp"):
            getattr(guard, name).clear()
        guard._i_cnt[:] = 0
