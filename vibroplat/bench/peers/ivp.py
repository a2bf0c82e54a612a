"""scipy's integrators, one step at a time, their right-hand side compiled; their dense outputs as powers."""

from __future__ import annotations

import time
from functools import partial
from math import comb
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from scipy import integrate

from vibroplat.bench.peers.following import flow, jacobian
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import CUBIC
from vibroplat.integrate.seam import WORK, IntegrationError
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.parameters import parameters
from vibroplat.model.systems import System

#: Degrees of the methods' dense outputs, of LSODA's Adams methods at most.
DEGREES = {"DOP853": 7, "LSODA": 12, "Radau": 3}

#: DOP853's terms s, s(1 − s), s²(1 − s), … s⁴(1 − s)³, and powers of s − 1, as powers of s: one in each column.
_TERMS = np.zeros((8, 7))
for _k in range(7):
    _term = (Polynomial([0.0, 1.0]) ** (_k // 2 + 1) * Polynomial([1.0, -1.0]) ** ((_k + 1) // 2)).coef
    _TERMS[: _term.size, _k] = _term
_SHIFT = np.array([[comb(k, j) * (-1.0) ** (k - j) if j <= k else 0.0 for k in range(13)] for j in range(13)])

#: What is added to a polynomial in s to change its value and its slope at the start of a step, and nothing at its end.
_AT_START = np.array([[1.0, 0.0, -3.0, 2.0], [0.0, 1.0, -2.0, 1.0]])


class Scipy:
    """One of scipy's methods, with its own first step."""

    def __init__(self, scene: Scene, tolerance: float, method: str) -> None:
        self.name, self.degree, self.work, self.alone_s = f"scipy {method}", DEGREES[method], dict.fromkeys(WORK), 0.0
        self._p = parameters(scene)
        self._method = method
        self._rtol = max(1e-3 * tolerance, 3e-14)

    def start(self, system: System, t: float, y: FloatArray, atol: FloatArray) -> None:
        """Begin a segment, whose time is 0."""
        self._flow, self._solver = flow(system, self._p), None
        more = {"jac": jacobian(system, self._p)} if self._method == "Radau" else {}
        make: Any = getattr(integrate, self._method)
        self._make = partial(make, self._flow, 0.0, y, rtol=self._rtol, atol=atol, **more)

    def steps(self, longest: float) -> tuple[FloatArray, FloatArray]:
        """Take a step; its polynomial is the method's dense output, with value and rate of the state it began with."""
        began = time.perf_counter()
        solver: Any = self._solver or self._make(2.0 * longest)
        self._solver, before, y = solver, solver.t, solver.y
        with np.errstate(all="ignore"):  # a stage that is not finite makes the step shorter
            message = solver.step()
        self.alone_s += time.perf_counter() - began
        if message or solver.t == before:
            raise IntegrationError(message or "the step is too small")
        length, dense = solver.t - before, solver.dense_output()
        c = np.zeros((self.degree + 1, y.size))
        if self._method == "DOP853":
            c[:] = _TERMS @ dense.F
            c[0] = y
            return np.array([length]), c[np.newaxis]
        if self._method == "Radau":
            c[0], c[1:] = y, dense.Q.T
        else:
            n = dense.p.size
            c[:n] = _SHIFT[:n, :n] @ (dense.yh * (length / dense.h) ** dense.p).T
        c[: CUBIC + 1] += _AT_START.T @ (np.array([y, length * self._flow(before, y)]) - c[:2])
        return np.array([length]), c[np.newaxis]


DOP853, LSODA, RADAU = (partial(Scipy, method=method) for method in DEGREES)
