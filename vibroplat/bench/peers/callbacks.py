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

from vibroplat.bench.peers.hybrid import FLIGHT_STEP, Leg
from vibroplat.hybrid.scales import FORCE_SHARE, ROUND_OFF, state_scales
from vibroplat.model.accelerations import accelerations
from vibroplat.model.equations import jacobian as jacobian_kernel
from vibroplat.model.equations import residual as residual_kernel
from vibroplat.model.parameters import FloatArray, Parameters, parameters
from vibroplat.model.systems import System, systems
from vibroplat.scene import Mode, Scene

#: Most steps between two outputs; scikit-sundae's own 500 ends runs without an exception.
MOST_STEPS = 1_000_000

_ROOT = 2


class Callbacks:
    """One IDA object for each mode, re-initialised at every restart."""

    def __init__(self, scene: Scene, tolerance: float) -> None:
        self.p = parameters(scene)
        self.systems = systems(scene)
        scales, period = state_scales(scene), 2.0 * np.pi / scene.speed_scale
        self.solvers: dict[Mode, tuple[IDA, Any]] = {}
        for mode, system in self.systems.items():
            atol = np.full(system.size, FORCE_SHARE * scene.force_scale)
            atol[: system.differential] = scales[system.places]
            longest = FLIGHT_STEP * period if mode is Mode.FLIGHT else 0.0
            self.solvers[mode] = _solver(system, self.p, tolerance * atol, longest)

    def advance(self, mode: Mode, t: float, y: FloatArray, until: float, times: FloatArray) -> Leg:
        """See :class:`vibroplat.bench.peers.hybrid.Integrator`."""
        system = self.systems[mode]
        solver, guard = self.solvers[mode]
        start, slope = np.zeros(system.size), np.empty(system.size)
        start[: system.differential] = y
        accelerations(system.index, t, start, slope, self.p)
        # two times ask for every step, more for just these
        span = [t, *times[times < until], until]
        with redirect_stdout(io.StringIO()):  # what the status says is printed as well
            found = solver.solve(span, start, slope)
        _forget(guard)
        if found.status < 0:
            raise RuntimeError(f"IDA: {found.message}")
        fell, end = found.status == _ROOT, float(found.t[-1])
        states = found.y[:, : system.differential]
        samples = states[np.searchsorted(found.t, times[times <= end])]
        return Leg(end, states[-1].copy(), fell, samples)


def _solver(system: System, p: Parameters, atol: FloatArray, longest: float) -> tuple[IDA, Any]:
    """Make the IDA object of a system, and its event function if it has one."""
    number = system.index

    def residual(t: float, y: FloatArray, yp: FloatArray, res: FloatArray) -> None:
        residual_kernel(number, t, y, yp, res, p)

    def jacobian(t: float, y: FloatArray, yp: FloatArray, res: FloatArray, cj: float, jac: FloatArray) -> None:
        jacobian_kernel(number, t, y, yp, cj, jac, p)

    options: dict[str, Any] = {
        "jacfn": jacobian,
        "rtol": ROUND_OFF,
        "atol": atol,
        "max_step": longest,
        "max_num_steps": MOST_STEPS,
    }
    if system.algebraic:
        options["algebraic_idx"] = [system.differential]
    if system.guard is None:
        return IDA(residual, **options), None
    place = system.guard

    def guard(t: float, y: FloatArray, yp: FloatArray, events: FloatArray) -> None:
        events[0] = y[place]

    guard.terminal, guard.direction = [True], [-1]  # type: ignore[attr-defined]
    return IDA(residual, eventsfn=guard, num_events=1, **options), guard


def _forget(guard: Any) -> None:
    """Clear the events that scikit-sundae keeps on the function: the next solve would stop at once."""
    if guard is not None:
        for name in ("_i", "_t", "_y", "_yp"):
            getattr(guard, name).clear()
        guard._i_cnt[:] = 0
