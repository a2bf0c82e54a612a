"""An independent integration of the hybrid model: DOP853 at round-off, events by bisection.

It shares with the package only the right-hand side and the impact map, both checked on their own. Run
as a program it writes the events of the reference cases with R > 0 (``NAME.closed.events.csv``).

Why they are needed: the reference trajectories do not keep momentum where they close accumulating
impacts. Their motion afterwards is that of an impulse (1 + 2R) m_red v with the gap rate then set to 0;
a last impact that is inelastic, as here, has the impulse m_red v. The outcome here is the same for
closing speeds of 2e-7 and 1e-5 m/s. Up to the first closing both agree to 1e-13 s; after it they part by
1.5e-9 s (R = 0.5), and the motion amplifies that.
"""

from __future__ import annotations

import csv
import math
import sys
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from vibroplat import load_config
from vibroplat.hybrid.initial import initial_state
from vibroplat.model.accelerations import accelerations
from vibroplat.model.impact import impact
from vibroplat.model.parameters import parameters
from vibroplat.model.systems import GAP, GAP_RATE, systems
from vibroplat.scene import Mode, Scene

REFERENCE = Path(__file__).parent / "reference"
CLOSED_CASES = ("onelayer-R03-mu01-fe48", "restitution05-mu02-fe51.5")
#: Rebounds slower than this are closed by an inelastic impact (m/s).
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
            lambda _, u, s=system: _derivative(s, u, p)[0],
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


def _derivative(system, unknowns, p):
    y, yp = np.zeros(system.size), np.empty(system.size)
    y[: system.differential] = unknowns
    accelerations(system.index, 0.0, y, yp, p)
    return yp[: system.differential], y


def _guard(system, state, start, p):
    """Event function and longest step; a flight's guard begins after a part of the way up."""
    if system.mode is Mode.ATTACHED:

        def guard(_, unknowns):
            return _derivative(system, unknowns, p)[1][-1]

        longest = 2e-4
    else:
        fall = abs(_derivative(system, state[system.places], p)[0][system.differential // 2 + GAP])
        rise = state[GAP_RATE] / fall if state[GAP_RATE] > 0.0 else math.inf
        begin = start + min(0.5 * rise, 1e-4 if math.isfinite(rise) else 1e-5)

        def guard(t, unknowns):
            return 1.0 if t < begin else unknowns[GAP]

        longest = min(2e-4, 0.4 * rise)
    guard.terminal, guard.direction = True, -1
    return guard, longest


def main() -> None:
    for name in CLOSED_CASES:
        rows = events(load_config(REFERENCE / f"{name}.yaml"))
        with (REFERENCE / f"{name}.closed.events.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(("t_s", "kind", "gap_rate_before_m_per_s"))
            writer.writerows((repr(t), kind, repr(rate)) for t, kind, rate in rows)


if __name__ == "__main__":
    sys.exit(main())
