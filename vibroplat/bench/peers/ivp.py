"""scipy's ``solve_ivp`` with events, restarted at each, its right-hand side compiled."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from vibroplat.bench.peers.equations import flow, guard, jacobian
from vibroplat.bench.peers.hybrid import FLIGHT_STEP, Leg
from vibroplat.hybrid.scales import state_scales
from vibroplat.model.parameters import FloatArray, Parameters, parameters
from vibroplat.model.systems import systems
from vibroplat.scene import Mode, Scene


class SolveIvp:
    """One of scipy's methods; absolute tolerances from the scene's scales, as vibroplat's."""

    def __init__(self, scene: Scene, tolerance: float, method: str, longest: float = FLIGHT_STEP) -> None:
        self.p = parameters(scene)
        self.systems = systems(scene)
        self.scales = state_scales(scene)
        self.period = 2.0 * np.pi / scene.speed_scale
        self.tolerance = tolerance
        self.method = method
        self.longest = longest * self.period

    def advance(self, mode: Mode, t: float, y: FloatArray, until: float, times: FloatArray) -> Leg:
        """See :class:`vibroplat.bench.peers.hybrid.Integrator`."""
        system, p = self.systems[mode], self.p
        number = system.index
        more: dict[str, Any] = {}
        if mode is not Mode.BARE:
            more["events"] = _falling(number, t, p)
        if mode is Mode.FLIGHT:
            more["max_step"] = self.longest
            more["first_step"] = min(1e-3 * self.period, until - t)
        if self.method == "Radau":
            more["jac"] = lambda t, u: jacobian(number, t, u, p)
        found = solve_ivp(
            lambda t, u: flow(number, t, u, p),
            (t, until),
            y,
            method=self.method,
            rtol=max(1e-3 * self.tolerance, 3e-14),
            atol=self.tolerance * self.scales[system.places],
            dense_output=bool(times.size),
            **more,
        )
        if found.status < 0:
            raise RuntimeError(f"scipy {self.method}: {found.message}")
        end, fell = float(found.t[-1]), found.status == 1
        inside = times[times <= end]
        samples = found.sol(inside).T if inside.size else np.empty((0, y.size))
        return Leg(end, found.y[:, -1], fell, samples)


def _falling(system: int, start: float, p: Parameters) -> Any:
    """Make the terminal event of a mode, which cannot be at its very beginning."""

    def event(t: float, y: FloatArray) -> float:
        return guard(system, t, y, p) if t > start else 1.0

    event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
    return event


DOP853, LSODA, RADAU = (partial(SolveIvp, method=method) for method in ("DOP853", "LSODA", "Radau"))
#: Quicker where flights are long, but it passes over impacts where many are short.
DOP853_LONG = partial(SolveIvp, method="DOP853", longest=0.2)
