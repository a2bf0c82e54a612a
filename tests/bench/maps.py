"""MapPy (Miino): periodic points of maps between modes, by derivatives that sympy makes and scipy's integrators.

It is no integrator for scenes of the package: the ball and the two masses are written for it as a user would, over a
table that moves as given. Lengths are in g/ω² and speeds in g/ω, times 1/LEAST: its absolute tolerance is that of
scipy, 1e-6, and cannot be changed.
"""

from __future__ import annotations

import importlib
import importlib.util
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vibroplat.kernels.compiled import FloatArray

#: What its absolute tolerance is of the units of length and speed.
LEAST = 1e-6
#: Relative tolerance of its integrators.
TOLERANCE = 1e-10

#: Steps in which it follows an orbit to a special point; it chooses none itself.
STEPS = 10

#: The section: impacts, in the coordinates of which the map is written.
_SECTION = "start"


@dataclass(frozen=True)
class Spring:
    """A second mass that the first one carries on a spring.

    Attributes
    ----------
    share
        Of the first mass in both.
    frequency
        √(c/m₂) over that of the table.
    damping
        Ratio of the damper.
    """

    share: float
    frequency: float
    damping: float


def missing() -> str:
    """Why it cannot be used here; empty if it can."""
    if importlib.util.find_spec("mappy") is None:
        return "mappy is not installed; clone https://github.com/Yuu-Miino/MapPy and add the directory to PYTHONPATH"
    try:
        np.array([1.0], dtype=np.floating)
    except TypeError:
        return f"mappy does not work with numpy {np.__version__}; numpy 2.2 is the last that it does"
    return ""


def _either(name: str) -> Callable[[Any], Any]:
    """Return a function of numbers, and of the symbols by which mappy differentiates."""
    numeric, symbolic = getattr(math, name), getattr(importlib.import_module("sympy"), name)
    return lambda x: numeric(x) if isinstance(x, float) else symbolic(x)


class Bouncing:
    """Bodies that hit a table which moves as Γ sin t, as a map from impact to impact.

    Parameters
    ----------
    restitution
        Of impacts.
    spring
        With a second mass; None for a ball.
    """

    def __init__(self, restitution: float, spring: Spring | None = None) -> None:
        self._root = importlib.import_module("mappy.root")
        self._restitution = restitution
        self.map = _map(spring)

    def orbit(self, phase: float, speed: float, gamma: float, rest: tuple[float, ...] = ()) -> Any:
        """Find the orbit with one impact a period near an impact at a phase and the speed after it (g/ω)."""
        start = np.array([phase, *(value / LEAST for value in (speed, *rest))])
        return self._found(self._root.find_cycle(self.map, start, self._given(gamma), m0=_SECTION))

    def special(self, orbit: FloatArray, gamma: float, beside: float, angle: float) -> float:
        """Follow an orbit to a Γ beside a special point, and find the Γ at which a multiplier is exp(i·angle)."""
        steps = self._root.trace_cycle(
            self.map, orbit, self._given(gamma), "gamma", beside, resolution=STEPS, m0=_SECTION
        )
        if len(steps) < STEPS:
            raise RuntimeError(f"mappy has lost the orbit after {len(steps)} of {STEPS} steps")
        search = self._root.find_local_bf
        found = self._found(search(self.map, steps[-1][0], self._given(beside), "gamma", angle, m0=_SECTION))
        return float(found.params["gamma"])

    def _given(self, gamma: float) -> dict[str, float]:
        return {"gamma": gamma, "restitution": self._restitution}

    def _found(self, result: Any) -> Any:
        if not result.success:
            raise RuntimeError(f"mappy has not converged; last residual {np.abs(result.err).max():.2g}")
        return result


def rebound(orbit: FloatArray, gamma: float) -> float:
    """Return the speed of an orbit from the table after its impact (g/ω)."""
    return float(orbit[1] * LEAST - gamma * math.cos(orbit[0]))


def _map(spring: Spring | None) -> Any:
    """Make the map from impact to impact: phase, speed, and the other mass's height and speed; in flight also height.

    A function of a mode must say how many coordinates it has, and which parameters.
    """
    mappy = importlib.import_module("mappy")
    continuous, discrete = mappy.ContinuousMode, mappy.DiscreteMode
    sine, cosine = _either("sin"), _either("cos")
    outer = 2 if spring is None else 4
    inner, names, unit = outer + 1, ["gamma", "restitution"], 1.0 / LEAST

    @continuous.function(inner, names)  # type: ignore[untyped-decorator]
    def flight(y: Any, _: Any) -> npt.NDArray[Any]:
        height, speed, *rest = y[:-1]
        if spring is None:
            return np.array([speed, -unit, 1.0])
        pull = spring.frequency**2 * (rest[0] - height) + 2.0 * spring.damping * spring.frequency * (rest[1] - speed)
        share = (1.0 - spring.share) / spring.share
        return np.array([speed, share * pull - unit, rest[1], -pull - unit, 1.0])

    @continuous.border(-1)  # type: ignore[untyped-decorator]
    def table(y: Any, p: Any) -> Any:
        return y[0] - unit * p["gamma"] * sine(y[outer])  # derivatives may follow the coordinates

    @discrete.function(outer, inner, names)  # type: ignore[untyped-decorator]
    def start(y: Any, p: Any) -> npt.NDArray[Any]:
        return np.array([unit * p["gamma"] * sine(y[0]), *y[1:], y[0]])

    @discrete.function(inner, outer, names)  # type: ignore[untyped-decorator]
    def impact(y: Any, p: Any) -> npt.NDArray[Any]:
        ratio = p["restitution"]
        speed = unit * (1.0 + ratio) * p["gamma"] * cosine(y[-1]) - ratio * y[1]
        return np.array([y[-1] - 2.0 * np.pi, speed, *y[2:-1]])

    modes = (continuous("flight", flight, [table]), discrete("impact", impact), discrete(_SECTION, start))
    order = {_SECTION: "flight", "flight": ["impact"], "impact": _SECTION}
    return mappy.PoincareMap(modes, order, _SECTION, rtol=TOLERANCE)
