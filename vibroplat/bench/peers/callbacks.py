"""IDA of SUNDIALS through scikit-sundae with Python callbacks, as its documentation suggests.

Residual and Jacobian are the package's compiled kernels; what differs from the engine ``sundae`` is what a
user of it cannot change: IDA's own first step, and its error test, in which F_c takes part.
"""

from __future__ import annotations

import io
import time
from contextlib import redirect_stdout
from typing import Any

import numpy as np
from sksundae.ida import IDA

from vibroplat.hybrid.scales import FORCE_SHARE, ROUND_OFF
from vibroplat.hybrid.steps import CUBIC, fill_cubic
from vibroplat.integrate.seam import WORK, IntegrationError
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.accelerations import accelerations
from vibroplat.model.equations import jacobian as jacobian_kernel
from vibroplat.model.equations import residual as residual_kernel
from vibroplat.model.parameters import parameters
from vibroplat.model.systems import System
from vibroplat.scene import Scene


class Callbacks:
    """One IDA object for each mode, re-initialised at every restart; cubics through the ends of its steps."""

    name, degree = "scikit-sundae, Python callbacks", CUBIC

    def __init__(self, scene: Scene, tolerance: float) -> None:
        self.work, self.alone_s = dict.fromkeys(WORK), 0.0
        self._p = parameters(scene)
        self._force = tolerance * FORCE_SHARE * scene.force_scale
        self._solvers: dict[int, IDA] = {}

    def start(self, system: System, t: float, y: FloatArray, atol: FloatArray) -> None:
        """Begin a segment, whose time is 0."""
        if system.index not in self._solvers:
            self._solvers[system.index] = self._solver(system, atol)
        self._solver_now, self._differential, self._t = self._solvers[system.index], system.differential, 0.0
        self._y, self._yp = np.append(y, np.zeros(system.size - y.size)), np.empty(system.size)
        accelerations(system.index, t, self._y, self._yp, self._p)
        began = time.perf_counter()
        self._solver_now.init_step(0.0, self._y, self._yp)
        self.alone_s += time.perf_counter() - began

    def steps(self, longest: float) -> tuple[FloatArray, FloatArray]:
        """Take a step."""
        began = time.perf_counter()
        with redirect_stdout(io.StringIO()):  # what the status says is printed as well
            found = self._solver_now.step(self._t + longest, method="onestep")
        self.alone_s += time.perf_counter() - began
        if found.status < 0:
            raise IntegrationError(f"IDA: {found.message}")
        t, y, yp = float(found.t), found.y.copy(), found.yp.copy()
        length, coefficients = t - self._t, np.empty((1, CUBIC + 1, y.size))
        fill_cubic(coefficients[0], length, self._y, y, self._yp, yp)
        self._t, self._y, self._yp = t, y, yp
        return np.array([length]), coefficients[:, :, : self._differential]

    def _solver(self, system: System, atol: FloatArray) -> IDA:
        """Make the IDA object of a system."""
        number, p = system.index, self._p

        def residual(t: float, y: FloatArray, yp: FloatArray, res: FloatArray) -> None:
            residual_kernel(number, t, y, yp, res, p)

        def jacobian(t: float, y: FloatArray, yp: FloatArray, res: FloatArray, cj: float, jac: FloatArray) -> None:
            jacobian_kernel(number, t, y, yp, cj, jac, p)

        tolerances = np.append(atol, np.full(system.size - atol.size, self._force))
        options: dict[str, Any] = {"jacfn": jacobian, "rtol": ROUND_OFF, "atol": tolerances}
        if system.algebraic:
            options["algebraic_idx"] = [system.differential]
        return IDA(residual, **options)
