"""Other solvers behind the interface: each integrates a mode up to its event, the package's automaton does the rest.

Modes, impacts and chatters are the automaton's own, so that solvers differ in how they integrate and in nothing else.
``python tests/bench/peers.py`` compares them with the engines at equal error.
"""

import time
from functools import partial
from itertools import starmap
from pathlib import Path

import numpy as np
import typer
from common.explicit import explicit

from vibroplat.bench.measure import TimedEngine, cases, of_engine, precision, show_precision, truth
from vibroplat.config.coordinates import Mode
from vibroplat.hybrid.loop import AT_GUARD, AT_TIME, begin_segment, end_segment
from vibroplat.hybrid.state import RUNNING, rewind, state_scales
from vibroplat.integrate.interface import WORK
from vibroplat.model.parameters import parameters
from vibroplat.model.systems import GAP, SYSTEMS, systems
from vibroplat.results.tables import result_directory

#: Least tolerance of the automaton; that of a peer may be lower.
FINEST = 1e-12
#: Gap with which a flight begins (m): a root at its very beginning would hide the landing.
BARELY = 1e-25
#: First and longest step of scipy where an event may come, in turns. Longer ones could pass over a short flight; with
#: 0.05 turns DOP853 is a thousand times as exact as it is asked to be, and takes 2.4 times as long.
FIRST, LONGEST = 0.002, 0.2


class Peer(TimedEngine):
    """A solver by a library that finds events itself; its points at the times ``wanted`` (s) are joined by lines.

    It is its own engine. Its leg integrates a system from a time and its unknowns to its guard or to another time. The
    leg returns the times wanted and that of the end, the unknowns there, and whether the guard fell through zero.
    """

    detail, degree, rows, turns_per_segment = "", 3, 4096, 50.0
    work = dict.fromkeys(WORK)

    def __init__(self, name, scene, tolerance):
        super().__init__(scene.replace({"solver.tolerance": max(tolerance, FINEST)}), lambda *_: self)
        self.inside_s = 0.0
        self.name, self.p = name, parameters(self.scene)
        self.leg = PEERS[name](self.scene, self.p, tolerance)

    def run(self, times):
        self.wanted = np.asarray(times)
        return super().run(times)

    def timed(self, column):
        self.wanted, self.inside_s = np.empty(0), 0.0
        seconds, part = super().timed(column)
        return self.inside_s if self.name.endswith(" alone") else seconds, part

    def close(self):
        """Do nothing: Python frees what the library holds."""

    def advance(self, h):
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
            began = time.process_time()
            times, points, fell = self.leg(system, t, y, until, wanted)
            self.inside_s += time.process_time() - began
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


def solver_of(name, scene, tolerance):
    """Return a solver by a peer, or by an engine of the package."""
    return (Peer if name in PEERS else of_engine)(name, scene, tolerance)


def scipy_leg(scene, p, tolerance, method):
    """Use ``solve_ivp`` with an event function; its right-hand side is compiled."""
    from scipy.integrate import solve_ivp

    scales, turn = state_scales(scene), 2.0 * np.pi / scene.speed_scale

    def leg(system, t, y, until, wanted):
        def guard(t, y):
            return float(y[GAP] if system.mode is Mode.FLIGHT else explicit(system.index, t, y, p)[-1])

        guard.terminal, guard.direction = True, -1
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


def heyoka_leg(scene, p, tolerance):
    """Use adaptive Taylor series with terminal events, compiled for the scene (Biscani and Izzo 2021, 2022)."""
    import heyoka as hk

    made = {}
    for system in systems(scene).values():
        equations, force = _equations(hk, system, p)
        falling = force if system.mode is Mode.ATTACHED else equations[GAP][0]
        events = [hk.t_event(falling, direction=hk.event_direction.negative)] if system.layers else []
        made[system.index] = hk.taylor_adaptive(equations, [0.0] * len(equations), tol=tolerance, t_events=events)

    def leg(system, t, y, until, wanted):
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


def _equations(hk, system, p):
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


def _platform(hk, u, v, p, lower, load):
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

    def through(one, other):
        return sum(w * a * b for w, a, b in zip(inverse, one, other, strict=True))

    first, second = columns
    m11, m22 = (inertia - through(c, c) for inertia, c in zip(p.exciter_inertia, columns, strict=True))
    m12 = -through(first, second)
    r1, r2 = (force - through(c, forces) for force, c in zip(own, columns, strict=True))
    determinant = m11 * m22 - m12 * m12
    a1, a2 = (m22 * r1 - m12 * r2) / determinant, (m11 * r2 - m12 * r1) / determinant
    return [*(w * (f - c * a1 - e * a2) for w, f, c, e in zip(inverse, forces, first, second, strict=True)), a1, a2]


#: Makers of legs, by the names of peers; of the last one only the time inside heyoka counts.
PEERS = {
    "scipy DOP853": partial(scipy_leg, method="DOP853"),
    "scipy LSODA": partial(scipy_leg, method="LSODA"),
    "heyoka": heyoka_leg,
    "heyoka, integrator alone": heyoka_leg,
}


def main(out: Path = Path("results"), repeats: int = 5):
    """Write and print tables and a figure of engines and peers to OUT/benchmarks."""
    directory = result_directory(out, "benchmarks")
    tolerances = [10.0**-n for n in range(3, 13)]
    known = starmap(truth, cases().items())
    table = precision(known, ["taylor", "native", *PEERS], tolerances, repeats, solver_of)
    show_precision(table, directory, "taylor")


if __name__ == "__main__":
    typer.run(main)
