"""heyoka: adaptive Taylor series with terminal events (Biscani and Izzo 2021, 2022).

Its kernels are compiled for a scene when a peer is made, which is not part of a run. At tolerance 1e-16
it is the oracle for scenes without a reference of their own.
"""

from __future__ import annotations

from typing import Any

import heyoka as hk
import numpy as np

from vibroplat.bench.peers.following import Leg, Legs, straight
from vibroplat.config.coordinates import Mode
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import CUBIC
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.parameters import Parameters, parameters
from vibroplat.model.systems import GAP, System, systems

#: Outcome of an integration that its only terminal event has ended.
_FIRST_EVENT = -1

#: Gap with which a flight begins (m).
BARELY = 1e-25

_NAMES = ("x", "y", "f", "f1", "f2")


class Taylor(Legs):
    """One integrator for each mode, with its own events; its steps are the Taylor polynomials."""

    name = "heyoka"

    def __init__(self, scene: Scene, tolerance: float) -> None:
        super().__init__()
        p = parameters(scene)
        self.integrators = {mode: _integrator(system, p, tolerance) for mode, system in systems(scene).items()}
        self.degree = max(CUBIC, *(ta.order for ta in self.integrators.values()))

    def leg(self, mode: Mode, t: float, y: FloatArray, until: float) -> Leg:
        """See :class:`vibroplat.bench.peers.following.Legs`."""
        ta = self.integrators[mode]
        ta.time = t
        ta.state[:] = y
        if mode is Mode.FLIGHT and y[GAP] == 0.0 < y[y.size // 2 + GAP]:
            ta.state[GAP] = BARELY  # after a rebound a root at the very beginning would hide those in the first step
        if mode is not Mode.BARE:
            ta.reset_cooldowns()
        if self.times is None:
            outcome = ta.propagate_until(until)[0]
            return straight([y, ta.state.copy()], [ta.time - t], _fell(outcome))
        outcome, *_, output, _ = ta.propagate_until(until, c_output=True)
        lengths = np.diff(output.times)
        powers = lengths[:, np.newaxis] ** np.arange(ta.order + 1)
        return Leg(_fell(outcome), ta.state.copy(), lengths, output.tcs.transpose(0, 2, 1) * powers[:, :, np.newaxis])


def _fell(outcome: Any) -> bool:
    """Whether the terminal event ended the integration; raises where it failed."""
    if outcome == hk.taylor_outcome.time_limit:
        return False
    if int(outcome) == _FIRST_EVENT:
        return True
    raise RuntimeError(f"heyoka: {outcome}")


def _integrator(system: System, p: Parameters, tolerance: float) -> Any:
    """Make the integrator of a system."""
    equations, force = _equations(system, p)
    events = []
    if system.mode is not Mode.BARE:
        falling = force if system.mode is Mode.ATTACHED else equations[GAP][0]
        events = [hk.t_event(falling, direction=hk.event_direction.negative)]
    return hk.taylor_adaptive(equations, np.zeros(system.differential), tol=tolerance, t_events=events)


def _equations(system: System, p: Parameters) -> tuple[list[Any], Any]:
    """Return (unknown, derivative) of a system, and F_c where it is attached.

    Platform and exciters are eliminated as in :func:`vibroplat.model.platform.solve_platform`.
    """
    n = system.differential // 2
    names = [*_NAMES, *["w1", "w2"][: n - 5]] if system.mode is Mode.FLIGHT else [*_NAMES, "w2"][:n]
    u = hk.make_vars(*names)
    v = hk.make_vars(*("v" + name for name in names))
    attached = system.mode is Mode.ATTACHED
    lower = p.lower_mass if attached else 0.0
    spring = p.layer_stiffness * u[n - 1] + p.layer_damping * v[n - 1] if system.layers == 2 else 0.0
    load = lower * p.gravity - p.upper_mass * spring if attached else 0.0
    a = _platform(u, v, p, lower, load)
    if attached:
        force = lower * (a[1] + p.gravity) - p.upper_mass * spring
        a += [-a[1] - p.gravity - spring][: n - 5]
    else:
        force = None
        share = p.upper_mass / p.lower_mass if system.layers else 0.0
        a += [share * spring - p.gravity - a[1], -(1.0 + share) * spring][: n - 5]
    return [*zip(u, v, strict=True), *zip(v, a, strict=True)], force


def _platform(u: Any, v: Any, p: Parameters, lower: float, load: Any) -> list[Any]:
    """Accelerations of platform and exciters, the mass ``lower`` moving with y and ``load`` pressing on it."""
    g = p.gravity
    mass, inertia = (p.mass, p.mass + lower), p.inertia
    rows = []  # of each exciter: its column of the mass matrix and its force
    forces = [
        -p.damping_x * v[0] - p.stiffness_x * u[0],
        -p.damping_y * v[1] - p.stiffness_y * u[1] - p.mass * g - load,
        -p.damping_phi * v[2] - p.stiffness_phi * u[2],
    ]
    for i, side in enumerate(p.direction):
        torque, slip, speed, friction = (p[name][i] for name in ("torque", "slip_speed", "speed", "friction"))
        angle, w = u[3 + i], v[3 + i]
        sine, cosine = hk.sin(angle), hk.cos(angle)
        x0, y0, k = p.axis_x[i], p.axis_y[i], p.unbalance[i]
        x, y = x0 - u[2] * y0, y0 + u[2] * x0
        b, d = x * cosine + y * sine, x * sine - y * cosine
        s = speed - side * w
        motor = 2.0 * side * torque * slip * s / (slip * slip + s * s)
        forces[0] += k * cosine * w * w
        forces[1] += k * sine * w * w
        forces[2] += k * d * w * w
        # exciters keep their sense of rotation in every scene here: |w| = side·w
        own = motor - friction * side * w * w - k * (g * cosine + d * v[2] * v[2])
        rows.append(((-k * sine, k * cosine, k * b), own))
    (c1, f1), (c2, f2) = rows
    inverse = (1.0 / mass[0], 1.0 / mass[1], 1.0 / inertia)
    m11 = p.exciter_inertia[0] - sum(w * c * c for w, c in zip(inverse, c1, strict=True))
    m22 = p.exciter_inertia[1] - sum(w * c * c for w, c in zip(inverse, c2, strict=True))
    m12 = -sum(w * c * e for w, c, e in zip(inverse, c1, c2, strict=True))
    r1 = f1 - sum(w * c * f for w, c, f in zip(inverse, c1, forces, strict=True))
    r2 = f2 - sum(w * c * f for w, c, f in zip(inverse, c2, forces, strict=True))
    determinant = m11 * m22 - m12 * m12
    a1 = (m22 * r1 - m12 * r2) / determinant
    a2 = (m11 * r2 - m12 * r1) / determinant
    platform = [w * (f - c * a1 - e * a2) for w, f, c, e in zip(inverse, forces, c1, c2, strict=True)]
    return [*platform, a1, a2]
