"""Other solvers behind the interface: each integrates a mode up to its event, the package's automaton does the rest.

Modes, impacts and latches are the automaton's own, so that solvers differ in how they integrate and in nothing else.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from vibroplat.config.coordinates import Mode
from vibroplat.config.scene import Scene
from vibroplat.hybrid.loop import AT_GUARD, AT_TIME, begin_segment, end_segment
from vibroplat.hybrid.state import RUNNING, Automaton, rewind, state_scales
from vibroplat.integrate.interface import WORK
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.accelerations import explicit
from vibroplat.model.parameters import Parameters
from vibroplat.model.systems import GAP, SYSTEMS, System, systems

#: Gap with which a flight begins (m): a root at its very beginning would hide the landing.
BARELY = 1e-25
#: First and longest step of scipy where an event may come, in turns: longer ones could pass over a short flight.
FIRST, LONGEST = 0.002, 0.05

#: Integrates a system from a time and its unknowns to its guard or to another time; returns the times wanted and that
#: of the end, the unknowns there, and whether the guard fell through zero. RuntimeError if it fails.
Leg = Callable[[System, float, FloatArray, float, list[float]], tuple[list[float], FloatArray, bool]]


class Peer:
    """An engine of a library that finds events itself; its points at the times ``wanted`` (s) are joined by lines.

    ``alone_s`` is the time spent in the library (s).
    """

    detail, degree, rows, turns_per_segment = "", 3, 4096, 50.0
    work: Mapping[str, int | None] = dict.fromkeys(WORK)

    def __init__(self, name: str, scene: Scene, p: Parameters, tolerance: float) -> None:
        self.name, self.p, self.leg = name, p, PEERS[name](scene, p, tolerance)
        self.wanted, self.alone_s = np.empty(0), 0.0

    def close(self) -> None:
        """Do nothing: Python frees what the library holds."""

    def advance(self, h: Automaton) -> None:
        """Carry a run on; see :class:`vibroplat.integrate.interface.Engine`."""
        rewind(h.steps)
        run, used = h.run, h.steps.used
        while run["outcome"] == RUNNING and 2 * used["steps"] < self.rows and begin_segment(h):
            mode, t = Mode(int(run["mode"])), float(run["origin"])
            system, until = SYSTEMS[run["systems"][mode]], t + float(run["until"])
            y = run["y"][mode, : system.differential].copy()
            if mode is Mode.FLIGHT and y[GAP] == 0.0 < y[y.size // 2 + GAP]:
                y[GAP] = BARELY
            wanted = self.wanted[(self.wanted > t) & (self.wanted < until)].tolist()
            began = time.perf_counter()
            times, points, fell = self.leg(system, t, y, until, wanted)
            self.alone_s += time.perf_counter() - began
            points = np.vstack([y, points])
            if system.algebraic:
                points = np.column_stack([points, [explicit(system.index, t, each, self.p)[-1] for each in points]])
            ends = np.array([t, *times])
            rows, size = slice(int(used["steps"]), int(used["steps"]) + len(times)), points.shape[1]
            used["steps"] = rows.stop
            h.steps.start[rows], h.steps.length[rows] = ends[:-1] - t, np.diff(ends)
            h.steps.c[rows] = 0.0
            h.steps.c[rows, 0, :size], h.steps.c[rows, 1, :size] = points[:-1], np.diff(points, axis=0)
            h.steps.ends[rows, :size] = points[1:]
            end_segment(h, AT_GUARD if fell else AT_TIME)


def scipy_leg(scene: Scene, p: Parameters, tolerance: float, method: str) -> Leg:
    """Use ``solve_ivp`` with an event function; its right-hand side is compiled."""
    from scipy.integrate import solve_ivp  # noqa: PLC0415

    scales, turn = state_scales(scene), 2.0 * np.pi / scene.speed_scale

    def leg(system: System, t: float, y: FloatArray, until: float, wanted: list[float]) -> Any:
        def guard(t: float, y: FloatArray) -> float:
            return float(y[GAP] if system.mode is Mode.FLIGHT else explicit(system.index, t, y, p)[-1])

        guard.terminal, guard.direction = True, -1  # type: ignore[attr-defined]
        bare = system.mode is Mode.BARE
        found = solve_ivp(
            lambda t, y: explicit(system.index, t, y, p)[: y.size],
            (t, until),
            y,
            method,
            t_eval=[*wanted, until],
            events=None if bare else guard,
            first_step=min(FIRST * turn, until - t),
            max_step=np.inf if bare else LONGEST * turn,
            rtol=max(1e-3 * tolerance, 3e-14),
            atol=tolerance * scales[system.places],
        )
        if found.status < 0:
            raise RuntimeError(found.message)
        if not found.status:
            return [*wanted, until], found.y.T, False
        end = found.t_events[0][0]
        times = [each for each in wanted if each < end]
        return [*times, end], np.vstack([*np.transpose(found.y)[: len(times)], *found.y_events[0]]), True

    return leg


def heyoka_leg(scene: Scene, p: Parameters, tolerance: float) -> Leg:
    """Use adaptive Taylor series with terminal events, compiled for the scene (Biscani and Izzo 2021, 2022)."""
    import heyoka as hk  # noqa: PLC0415  (optional)

    made = {}
    for system in systems(scene).values():
        equations, force = _equations(hk, system, p)
        falling = force if system.mode is Mode.ATTACHED else equations[GAP][0]
        events = [hk.t_event(falling, direction=hk.event_direction.negative)] if system.layers else []
        made[system.index] = hk.taylor_adaptive(equations, [0.0] * len(equations), tol=tolerance, t_events=events)

    def leg(system: System, t: float, y: FloatArray, until: float, wanted: list[float]) -> Any:
        ta = made[system.index]
        ta.time = t
        ta.state[:] = y
        if system.layers:
            ta.reset_cooldowns()
        outcome, *_, output, _ = ta.propagate_until(until, c_output=bool(wanted))
        fell = int(outcome) == -1  # its first terminal event
        if not fell and outcome != hk.taylor_outcome.time_limit:
            raise RuntimeError(f"heyoka: {outcome}")
        times = [each for each in wanted if each < ta.time]
        return [*times, ta.time], np.array([*(output(each).copy() for each in times), ta.state]), fell

    return leg


def ensemble(system: System, p: Parameters, tolerance: float, batch: int) -> Callable[[FloatArray, float], FloatArray]:
    """Return what follows unknowns of a system without events, shape (motions, size), for a time by heyoka, on a core.

    ``batch`` motions at a time are in one vector; their number is a multiple of it.
    """
    import heyoka as hk  # noqa: PLC0415  (optional)

    equations, _ = _equations(hk, system, p)
    size = len(equations)
    if batch == 1:
        made = hk.taylor_adaptive(equations, [0.0] * size, tol=tolerance)
    else:
        made = hk.taylor_adaptive_batch(equations, np.zeros((size, batch)), tol=tolerance)

    def follow(unknowns: FloatArray, seconds: float) -> FloatArray:
        groups = unknowns.reshape(-1, batch, size).transpose(0, 2, 1)

        def begun(ta: Any, number: int) -> Any:
            ta.state[:] = groups[number].reshape(ta.state.shape)
            return ta

        found = hk.ensemble_propagate_until(made, seconds, len(groups), begun, max_workers=1)
        ends = np.array([ta.state.reshape(size, batch) for ta, *_ in found])
        return ends.transpose(0, 2, 1).reshape(unknowns.shape)

    return follow


def _equations(hk: Any, system: System, p: Parameters) -> tuple[list[Any], Any]:
    """Return (unknown, derivative) of a system, and F_c where it is attached, as heyoka's expressions.

    Platform and exciters are eliminated as in :func:`vibroplat.model.platform.solve_platform`.
    """
    n, attached = system.differential // 2, system.mode is Mode.ATTACHED
    names = ["x", "y", "f", "f1", "f2", *(["w1", "w2"] if system.mode is Mode.FLIGHT else ["w2"])][:n]
    u, v = hk.make_vars(*names), hk.make_vars(*("v" + name for name in names))
    lower = p.lower_mass if attached else 0.0
    spring = p.layer_stiffness * u[n - 1] + p.layer_damping * v[n - 1] if system.layers == 2 else 0.0
    a = _platform(hk, u, v, p, lower, lower * p.gravity - p.upper_mass * spring if attached else 0.0)
    force = None
    if attached:
        force = lower * (a[1] + p.gravity) - p.upper_mass * spring
        a += [-a[1] - p.gravity - spring][: n - 5]
    elif system.layers:
        share = p.upper_mass / p.lower_mass
        a += [share * spring - p.gravity - a[1], -(1.0 + share) * spring][: n - 5]
    return [*zip(u, v, strict=True), *zip(v, a, strict=True)], force


def _platform(hk: Any, u: Any, v: Any, p: Parameters, lower: float, load: Any) -> list[Any]:
    """Accelerations of platform and exciters, the mass ``lower`` moving with y and ``load`` pressing on it."""
    g, columns, own = p.gravity, [], []  # of each exciter: its column of the mass matrix, and its force
    forces = [
        -p.damping_x * v[0] - p.stiffness_x * u[0],
        -p.damping_y * v[1] - p.stiffness_y * u[1] - p.mass * g - load,
        -p.damping_phi * v[2] - p.stiffness_phi * u[2],
    ]
    for i, side in enumerate(p.direction):
        torque, slip, friction, k = (p[name][i] for name in ("torque", "slip_speed", "friction", "unbalance"))
        sine, cosine, w = hk.sin(u[3 + i]), hk.cos(u[3 + i]), v[3 + i]
        x, y = p.axis_x[i] - u[2] * p.axis_y[i], p.axis_y[i] + u[2] * p.axis_x[i]
        b, d = x * cosine + y * sine, x * sine - y * cosine
        s = p.speed[i] - side * w
        motor = 2.0 * side * torque * slip * s / (slip * slip + s * s)
        forces = [f + k * each * w * w for f, each in zip(forces, (cosine, sine, d), strict=True)]
        # exciters keep their sense of rotation in every scene here: |w| = side·w
        own.append(motor - friction * side * w * w - k * (g * cosine + d * v[2] * v[2]))
        columns.append((-k * sine, k * cosine, k * b))
    inverse = (1.0 / p.mass, 1.0 / (p.mass + lower), 1.0 / p.inertia)

    def through(one: Any, other: Any) -> Any:
        return sum(w * a * b for w, a, b in zip(inverse, one, other, strict=True))

    first, second = columns
    m11, m22 = (inertia - through(c, c) for inertia, c in zip(p.exciter_inertia, columns, strict=True))
    m12 = -through(first, second)
    r1, r2 = (force - through(c, forces) for force, c in zip(own, columns, strict=True))
    determinant = m11 * m22 - m12 * m12
    a1, a2 = (m22 * r1 - m12 * r2) / determinant, (m11 * r2 - m12 * r1) / determinant
    return [*(w * (f - c * a1 - e * a2) for w, f, c, e in zip(inverse, forces, first, second, strict=True)), a1, a2]


#: Makers of legs, by the names of peers.
PEERS: dict[str, Callable[[Scene, Parameters, float], Leg]] = {
    "scipy DOP853": partial(scipy_leg, method="DOP853"),
    "scipy LSODA": partial(scipy_leg, method="LSODA"),
    "heyoka": heyoka_leg,
}
