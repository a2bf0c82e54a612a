"""A scene in Siconos, run by the interpreter whose Siconos it is; imports nothing of this package.

Reads one JSON object from standard input and writes one to standard output; see :func:`main`. Coordinates are
absolute, (x, y, φ, φ₁, φ₂, z₁, z₂) with z₁ = y + gap, so that the mass matrix is that of separate bodies and
the one unilateral constraint is z₁ − y ≥ 0.
"""

from __future__ import annotations

import json
import math
import os
import sys
import time
from typing import Any

import numpy as np
import siconos.kernel as sk

#: Iterations and residual of Newton's method within a time step.
MOST_ITERATIONS, RESIDUAL = 20, 1e-8

#: Weight of a step's end in the θ method: second order where the motion is smooth.
THETA = 0.5

#: Gap below which a time step holds the contact (m), and approach from which it is an impact (m/s): a gap that
#: is closed is zero up to round-off.
TOUCHING, APPROACH = 1e-12, 1e-9

#: Any function in a library makes Siconos take a mass matrix for one that changes; it is not called.
PLUGIN = sk._kernel.__file__.removesuffix(".so") + ":PyInit__kernel"

#: Most of LSODAR's steps between two events.
MOST_STEPS = 1_000_000

#: LSODAR asks the system for its Jacobian, which is left at zero: it stays with Adams' methods, the better ones here.
JACOBIAN = 1

#: What counts as contact (m, m/s, N), over the tolerance and at least; landings are found no better than that.
CONTACT_SHARE, CONTACT = 1e-2, 2e-12

#: LSODAR's report of a root.
ROOT = 3

#: Share of Newton's rebound from which a contact counts as one that was left at once.
REBOUND = 0.5


class Platform(sk.LagrangianDS):  # type: ignore[misc]
    """Platform, exciters and layers; ``c`` holds the scene's parameters by name."""

    def __init__(self, q: list[float], v: list[float], c: dict[str, Any]) -> None:
        self.c, self.n = c, len(q)
        super().__init__(np.array(q), np.array(v), PLUGIN)
        self.allocateFInt()
        self.inertia, self.loads = self.mass(), self.fInt()
        self.inertia[:] = np.diag([c["mass"], c["mass"], c["inertia"], *2 * [c["exciter_inertia"]], *c["layers"]])
        #: Where a time step has begun: its mass matrix is that of the middle, which makes it of second order.
        self.before: list[float] | None = None
        self.filled: list[float] = []

    def arms(self, phi: float, i: int, sine: float, cosine: float) -> tuple[float, float]:
        """Projections of an exciter's axis, turned with the platform."""
        c = self.c
        x0 = (1.0, -1.0)[i] * c["axis"][0]
        x, y = x0 - phi * c["axis"][1], c["axis"][1] + phi * x0
        return x * cosine + y * sine, x * sine - y * cosine

    def computeMass(self, position: Any = None) -> None:  # noqa: N802
        """Fill the mass matrix."""
        q = (self.q() if position is None else position).tolist()
        if self.before is not None:
            q = [0.5 * (a + b) for a, b in zip(self.before, q, strict=True)]
        if q == self.filled:  # a time step asks several times
            return
        self.filled = q
        k, matrix = self.c["unbalance"], self.inertia
        for i in range(2):
            sine, cosine = math.sin(q[3 + i]), math.cos(q[3 + i])
            arm, _ = self.arms(q[2], i, sine, cosine)
            column = (-k * sine, k * cosine, k * arm)
            matrix[:3, 3 + i] = column
            matrix[3 + i, :3] = column

    def computeFInt(self, t: float, position: Any = None, velocity: Any = None) -> None:  # noqa: N802
        """Fill what Siconos takes to the left-hand side: minus all forces but the contact's."""
        c = self.c
        q = (self.q() if position is None else position).tolist()
        v = (self.velocity() if velocity is None else velocity).tolist()
        k, g = c["unbalance"], c["gravity"]
        force = [-b * w - s * u for b, s, w, u in zip(c["damping"], c["stiffness"], v, q, strict=False)]
        force[1] -= c["mass"] * g
        for i, motor in enumerate(c["motors"]):
            side, w = (1.0, -1.0)[i], v[3 + i]
            sine, cosine = math.sin(q[3 + i]), math.cos(q[3 + i])
            _, d = self.arms(q[2], i, sine, cosine)
            force[0] += k * cosine * w * w
            force[1] += k * sine * w * w
            force[2] += k * d * w * w
            s, slip = motor["speed"] - side * w, motor["slip_speed"]
            torque = 2.0 * side * motor["torque"] * slip * s / (slip * slip + s * s)
            force.append(torque - motor["friction"] * w * abs(w) - k * (g * cosine + d * v[2] * v[2]))
        force += [-m * g for m in c["layers"]]
        if self.n == 7:
            spring = c["spring"][0] * (q[6] - q[5]) + c["spring"][1] * (v[6] - v[5])
            force[5] += spring
            force[6] -= spring
        self.loads[:] = [-f for f in force]


def model(c: dict[str, Any]) -> tuple[Any, Platform, Any]:
    """Make system, platform and, with material, the contact."""
    nsds = sk.NonSmoothDynamicalSystem(0.0, c["duration"])
    platform = Platform(c["q"], c["v"], c)
    nsds.insertDynamicalSystem(platform)
    if platform.n == 5:
        return nsds, platform, None
    gap = np.zeros((1, platform.n))
    gap[0, 1], gap[0, 5] = -1.0, 1.0
    contact = sk.Interaction(sk.NewtonImpactNSL(c["restitution"]), sk.LagrangianLinearTIR(gap))
    nsds.link(contact, platform)
    return nsds, platform, contact


def time_stepping(c: dict[str, Any]) -> dict[str, Any]:
    """Moreau and Jean's scheme; states at wanted times lie on the line between those of two steps."""
    nsds, platform, contact = model(c)
    h = c["accuracy"]
    steps = math.ceil(c["duration"] / h - 1e-9)
    h = c["duration"] / steps
    scheme = sk.MoreauJeanOSI(THETA)
    scheme.setConstraintActivationThreshold(TOUCHING)
    stepping = sk.TimeStepping(nsds, sk.TimeDiscretisation(0.0, h), scheme, sk.LCP())
    stepping.setNewtonMaxIteration(MOST_ITERATIONS)
    stepping.setNewtonTolerance(RESIDUAL)
    q, v, times = platform.q(), platform.velocity(), c["times"]
    states: list[list[float]] = []
    modes: list[bool] = []
    events: list[tuple[float, str, float]] = []
    touching = True if contact is not None and q[5] - q[1] <= 0.0 else None
    before, rate = [*q.tolist(), *v.tolist()], 0.0
    platform.before = before[: platform.n]
    began = time.perf_counter()
    for step in range(steps):
        stepping.computeOneStep()
        end = (step + 1) * h
        if contact is not None:
            old, rate = rate, v[5] - v[1]
            touches = contact.lambda_(1)[0] > 0.0
            if touches and old < -APPROACH:
                events.append((end - 0.5 * h, "impact", old))
                touches = rate < -REBOUND * c["restitution"] * old or rate < APPROACH
            elif touching and not touches:
                events.append((end - 0.5 * h, "liftoff", 0.0))
            touching = touches
        after = [*q.tolist(), *v.tolist()]
        while len(states) < len(times) and times[len(states)] <= end + 1e-9 * h:
            share = (times[len(states)] - end) / h
            states.append([b + share * (b - a) for a, b in zip(before, after, strict=True)])
            modes.append(bool(touching))
        before, platform.before = after, after[: platform.n]
        stepping.nextStep()
    return {"states": states, "attached": modes, "events": events, "wall_s": time.perf_counter() - began}


class Fresh(sk.LCP):  # type: ignore[misc]
    """A contact problem at the state that it is asked for: LSODAR's would have masses and forces of its last."""

    def __init__(self, integrator: Any) -> None:
        super().__init__()
        self.integrator = integrator

    def compute(self, t: float) -> int:
        """Solve it."""
        self.integrator.computeRhs(t)
        return int(sk.LCP.compute(self, t))


def event_driven(c: dict[str, Any]) -> dict[str, Any]:
    """LSODAR between events: impacts, liftoffs and ticks, on which the times at which states are wanted must lie."""
    nsds, platform, contact = model(c)
    lsodar = sk.LsodarOSI()
    times = c["times"]
    tick = min([b - a for a, b in zip([0.0, *times], times, strict=False)], default=c["duration"])
    driven = sk.EventDriven(nsds, sk.TimeDiscretisation(0.0, tick))
    driven.insertIntegrator(lsodar)
    impacts, forces = Fresh(lsodar), Fresh(lsodar)
    driven.insertNonSmoothProblem(impacts, sk.SICONOS_OSNSP_ED_IMPACT)
    driven.insertNonSmoothProblem(forces, sk.SICONOS_OSNSP_ED_SMOOTH_ACC)
    driven.setToleranceED(max(CONTACT_SHARE * c["accuracy"], CONTACT))
    driven.initialize()
    lsodar.setTol(1, c["accuracy"], c["accuracy"])
    lsodar.setMaxNstep(MOST_STEPS)
    lsodar.setJT(JACOBIAN)
    q, v = platform.q(), platform.velocity()
    found: dict[str, Any] = {"states": [], "attached": [], "events": []}
    began = time.perf_counter()
    while driven.hasNextEvent():
        driven.advanceToEvent()
        now, rate = driven.nextTime(), 0.0 if contact is None else v[5] - v[1]
        root = driven.istate() == ROOT
        driven.processEvents()
        if root:
            struck = contact.lambda_(1)[0] > 0.0
            found["events"].append((now, "impact" if struck else "liftoff", rate if struck else 0.0))
        elif len(found["states"]) < len(times) and abs(times[len(found["states"])] - now) < 1e-6 * tick:
            found["states"].append([*q.tolist(), *v.tolist()])
            found["attached"].append(contact is not None and bool(contact.lambda_(2)[0] > 0.0))
        if now >= c["duration"] - 1e-6 * tick:  # it would go on for another tick
            break
    if len(found["states"]) < len(times):
        raise ValueError("times at which states are wanted are not multiples of their smallest distance")
    return found | {"wall_s": time.perf_counter() - began}


KINDS = {"time-stepping": time_stepping, "event-driven": event_driven}


def main() -> None:
    """Run what standard input asks for; Siconos' own messages go to standard error."""
    request = json.load(sys.stdin)
    answer = os.dup(1)
    os.dup2(2, 1)
    found = KINDS[request["kind"]](request)
    with os.fdopen(answer, "w") as stream:
        json.dump(found, stream)


if __name__ == "__main__":
    main()
