"""scipy's DOP853 behind the interface: all that a one-step method needs."""

import numpy as np
from common.explicit import explicit
from scipy.integrate import DOP853

from integrate.stepwise import IntegrationError
from vibroplat.integrate.interface import WORK

#: Powers of s in the terms of its dense output: s, s(1 − s), s²(1 − s), … s⁴(1 − s)³.
POWERS = np.zeros((8, 7))
_TERM = np.polynomial.Polynomial([1.0])
for _k in range(7):
    _TERM *= np.polynomial.Polynomial([0.0, 1.0] if _k % 2 == 0 else [1.0, -1.0])
    POWERS[: _k + 2, _k] = _TERM.coef


class Dop853:
    """Runge and Kutta's method of order 8, its dense output of degree 7."""

    name, degree = "DOP853", 7

    def __init__(self, p):
        self.p = p
        self.work = dict.fromkeys(WORK) | {"steps": 0}

    def start(self, system, t, y, atol):
        def flow(t, y):
            return explicit(system.index, t, y, self.p)[: y.size]

        self.solver = DOP853(flow, t, y, np.inf, rtol=1e-13, atol=atol)

    def steps(self, longest):
        solver = self.solver
        before = solver.y
        with np.errstate(all="ignore"):  # a stage that is not finite makes the step shorter
            message = solver.step()
        if message:
            raise IntegrationError(message)
        self.work["steps"] += 1
        coefficients = POWERS @ solver.dense_output().F
        coefficients[0] = before
        return np.array([solver.step_size]), coefficients[np.newaxis]
