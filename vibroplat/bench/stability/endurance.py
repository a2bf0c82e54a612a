"""Very long runs: nothing may drift, grow, or lose its resolution."""

from __future__ import annotations

import resource
from contextlib import closing
from typing import Any

import numpy as np

from vibroplat.bench.known import TURN
from vibroplat.bench.scenes import kinds
from vibroplat.bench.stability.checks import ENERGY, Limit, row
from vibroplat.physics.parameters import parameters
from vibroplat.scene import Scene
from vibroplat.solver.engines import make_engine
from vibroplat.solver.motion import Motion
from vibroplat.solver.summary import measured

#: The scenes: one without events, one with an impact in each turn, one with impacts that close.
SCENES = ("bare, f_e 50", "attached, f_e 46", "impacts, f_e 50")
#: Parts of a run that are compared with each other.
PARTS = 20
#: Relative difference of a statistic between parts: all motions here are periodic, and settled in the first part.
SAME = 1e-4
#: Energy residual of the last half of the parts over that of the first.
GROWTH = 2.0
#: Growth of the memory that is allowed over a run (KiB).
MEMORY = 1024.0
TOLERANCE = 1e-6


def endurance(count: int) -> list[dict[str, Any]]:
    """Run scenes for so many turns of the excitation in all, statistics alone."""
    scenes = kinds(TOLERANCE, 1.0)
    return [_long(name, scenes[name], count / len(SCENES)) for name in SCENES]


def _long(name: str, scene: Scene, turns: float) -> dict[str, Any]:
    """Compare the parts of one run: energy, statistics, times of events, memory."""
    seconds = turns * TURN / scene.speed_scale / PARTS
    p = parameters(scene)
    parts = []
    with closing(make_engine(scene, p)) as engine:
        motion = Motion(scene, p, engine)
        motion.go_on(max(10.0, 0.1 * seconds))  # settles
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        steps = engine.work["steps"] or 0
        for _ in range(PARTS):
            found = measured(motion.go_on(seconds))
            steps, before = engine.work["steps"] or 0, steps
            parts.append(found | {"steps": steps - before})
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory
        outcome, state = motion.outcome, motion.automaton.state
    limits: dict[str, Limit] = {
        "memory_growth_kib": (memory, MEMORY),
        "angle_rad": (float(np.abs(state[3:5]).max()), 1001.0 * TURN),
        "energy_residual": (max(found["energy_residual"] for found in parts), ENERGY * TOLERANCE * parts[0]["steps"]),
        "residual_growth": (_growth(parts), GROWTH),
    }
    for key in ("rms_y_m", "excitation_frequency_hz", "flight_fraction", "impacts_per_period"):
        if parts[0][key]:
            limits[f"{key}_drift"] = (_spread(parts, key, parts[0][key]), SAME)
    if scene.has_contact:
        lost = max(abs(found["liftoffs"] - found["impacts"]) for found in parts)
        limits["events_lost"] = (lost if parts[0]["liftoffs"] else 0.0, 1.0)
        limits["gap_below_m"] = (abs(min(found["gap_min_m"] for found in parts)), 0.0)
    total = PARTS * seconds
    return row(f"{name}, {turns:.0f} turns, {total:.0f} s", outcome, limits)


def _growth(parts: list[dict[str, Any]]) -> float:
    """Mean energy residual of the last half of the parts over that of the first."""
    residuals = np.array([found["energy_residual"] for found in parts])
    return float(residuals[PARTS // 2 :].mean() / residuals[: PARTS // 2].mean())


def _spread(parts: list[dict[str, Any]], key: str, scale: float) -> float:
    """Largest difference of a figure from its median over the parts, over a scale."""
    values = np.array([found[key] for found in parts])
    return float(np.abs(values - np.median(values)).max() / abs(scale))
