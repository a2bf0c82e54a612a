"""Very long runs: nothing may drift, grow or lose resolution."""

from __future__ import annotations

import resource
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from common.known import TURN

from stability.checks import ENERGY, Limit, row, with_engine
from vibroplat.bench.scenes import kinds
from vibroplat.config.scene import Scene
from vibroplat.hybrid.modes import IMPACT
from vibroplat.hybrid.state import Automaton
from vibroplat.integrate import make_engine
from vibroplat.model.parameters import parameters
from vibroplat.motion.motion import Motion
from vibroplat.observe.summary import measured

#: The scenes: one without events, one with an impact in each turn, one with accumulating impacts.
SCENES = ("bare, f_e 50", "attached, f_e 46", "impacts, f_e 50")
#: Parts of a run that are compared with each other.
PARTS = 20
#: Largest relative difference of a statistic between parts; all motions here are periodic and settle in the first.
SAME = 1e-4
#: Energy residual of the last half of the parts over that of the first.
GROWTH = 2.0
#: Largest growth of memory after the first part (KiB), in which the list of its impacts takes 2000.
MEMORY = 1024.0
#: Relative change of the time between impacts from part to part.
INTERVAL = 2e-5
TOLERANCE = 1e-6


def endurance(count: int, engine: str) -> list[dict[str, Any]]:
    """Run scenes for a total number of turns, with statistics only."""
    scenes = kinds(TOLERANCE, 1.0)
    return [_long(name, with_engine(scenes[name], engine), count / len(SCENES)) for name in SCENES]


def _long(name: str, scene: Scene, turns: float) -> dict[str, Any]:
    """Compare the parts of one run: energy, statistics, times of events, memory."""
    seconds = turns * TURN / scene.speed_scale / PARTS
    p = parameters(scene)
    parts = []
    with closing(make_engine(scene, p)) as engine:
        motion = Motion(scene, p, engine)
        motion.advance(max(10.0, 0.1 * seconds))  # let it settle
        memory = []
        steps = engine.work["steps"] or 0
        for _ in range(PARTS):
            times = Impacts([])
            found = measured(motion.advance(seconds, observers=[times]))
            found["interval_spread"] = times.spread
            steps, before = engine.work["steps"] or 0, steps
            parts.append(found | {"steps": steps - before})
            memory.append(resident())
        outcome, state = motion.outcome, motion.automaton.run["state"]
    limits: dict[str, Limit] = {
        "memory_growth_kib": (memory[-1] - memory[0], MEMORY),
        "angle_rad": (float(np.abs(state[3:5]).max()), 1001.0 * TURN),
        "energy_residual": (max(found["energy_residual"] for found in parts), ENERGY * TOLERANCE * parts[0]["steps"]),
        "residual_growth": (_growth(parts), GROWTH),
    }
    for key in ("rms_y_m", "excitation_frequency_hz", "flight_fraction", "impacts_per_period"):
        if parts[0][key]:
            limits[f"{key}_drift"] = (_spread(parts, key, parts[0][key]), SAME)
    if scene.has_contact:
        lost = max(abs(found["liftoffs"] - found["impacts"]) for found in parts)
        if parts[0]["impacts"]:
            # impact times lose digits as time grows, but must not lose more than that
            limits["interval_spread"] = (parts[-1]["interval_spread"], parts[0]["interval_spread"] + INTERVAL)
        limits["events_lost"] = (lost if parts[0]["liftoffs"] else 0.0, 1.0)
        limits["gap_below_m"] = (abs(min(found["gap_min_m"] for found in parts)), 0.0)
    total = PARTS * seconds
    return row(f"{name}, {turns:.0f} turns, {total:.0f} s", outcome, limits)


class Impacts(NamedTuple):
    """Observes a motion: the times of its impacts (s)."""

    times: list[float]

    def read(self, h: Automaton) -> None:
        """Add those in the list of events."""
        rows = h.events[: h.run["events"]]
        self.times.extend(rows["t"][rows["kind"] == IMPACT].tolist())

    @property
    def spread(self) -> float:
        """Largest relative deviation of the time between impacts from its median."""
        between = np.diff(self.times)
        return float(np.abs(between / np.median(between) - 1.0).max()) if len(between) else 0.0


def resident() -> float:
    """Memory in use (KiB), or its maximum so far if the system does not report it."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1])
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return pages * resource.getpagesize() / 1024.0


def _growth(parts: list[dict[str, Any]]) -> float:
    """Median energy residual of the last half of the parts over that of the first.

    Medians are used because single parts may be outliers.
    """
    residuals = np.array([found["energy_residual"] for found in parts])
    return float(np.median(residuals[PARTS // 2 :]) / np.median(residuals[: PARTS // 2]))


def _spread(parts: list[dict[str, Any]], key: str, scale: float) -> float:
    """Largest deviation of a value from its median over the parts, relative to a scale."""
    values = np.array([found[key] for found in parts])
    return float(np.abs(values - np.median(values)).max() / abs(scale))
