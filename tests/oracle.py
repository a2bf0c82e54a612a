"""An independent integration of the hybrid model: DOP853 at round-off, events by bisection.

It shares with the package only the right-hand side and the impact map, both checked on their own.
"""

import math

import numpy as np
from common.references import REFERENCES as REFERENCE  # noqa: F401
from scipy.integrate import solve_ivp

from vibroplat.config.coordinates import Mode
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import initial_state
from vibroplat.model.accelerations import accelerations
from vibroplat.model.impact import impact
from vibroplat.model.parameters import parameters
from vibroplat.model.systems import GAP, GAP_RATE, systems

#: Rebounds slower than this end with an inelastic impact (m/s).
SLOWEST = 2e-7


def events(scene: Scene) -> list[tuple[float, str, float]]:
    """Times, kinds and gap rates before impact of a scene that begins in contact, R > 0."""
    p = parameters(scene)
    by_mode = systems(scene)
    inelastic = p.copy()
    inelastic.restitution = 0.0
    t, state, mode = 0.0, initial_state(scene), Mode.ATTACHED
    found = []
    while t < scene.run.duration_s:
        system = by_mode[mode]
        guard, longest = _guard(system, state, t, p)
        solution = solve_ivp(
            lambda _, u, s=system: derivative(s, u, p)[0],
            (t, scene.run.duration_s),
            state[system.places],
            method="DOP853",
            rtol=3e-14,
            atol=1e-19,
            max_step=longest,
            events=guard,
        )
        if solution.status != 1:
            break
        t = float(solution.t[-1])
        state = np.zeros(14)
        state[system.places] = solution.y[:, -1]
        if mode is Mode.ATTACHED:
            found.append((t, "liftoff", 0.0))
            mode = Mode.FLIGHT
            continue
        state[GAP] = 0.0
        after = np.empty(14)
        found.append((t, "impact", float(state[GAP_RATE])))
        impact(state, after, p)
        if after[GAP_RATE] < SLOWEST:
            impact(state, after, inelastic)
            mode = Mode.ATTACHED
        state = after
    return found


def derivative(system, unknowns, p):
    """Derivatives of the differential unknowns, and all unknowns, F_c the last of them in contact."""
    y, yp = np.zeros(system.size), np.empty(system.size)
    y[: system.differential] = unknowns
    accelerations(system.index, 0.0, y, yp, p)
    return yp[: system.differential], y


def _guard(system, state, start, p):
    """Event function and longest step; a flight's guard begins after a part of the way up."""
    if system.mode is Mode.ATTACHED:

        def guard(_, unknowns):
            return derivative(system, unknowns, p)[1][-1]

        longest = 2e-4
    else:
        fall = abs(derivative(system, state[system.places], p)[0][system.differential // 2 + GAP])
        rise = state[GAP_RATE] / fall if state[GAP_RATE] > 0.0 else math.inf
        begin = start + min(0.5 * rise, 1e-4 if math.isfinite(rise) else 1e-5)

        def guard(t, unknowns):
            return 1.0 if t < begin else unknowns[GAP]

        longest = min(2e-4, 0.4 * rise)
    guard.terminal, guard.direction = True, -1
    return guard, longest
