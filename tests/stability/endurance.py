"""Very long runs: nothing may drift, grow or lose resolution."""

import numpy as np
import psutil
from common.known import TURN, motion_of

from stability.checks import RESIDUAL, row, with_engine
from vibroplat.bench.measure import kinds
from vibroplat.hybrid.modes import IMPACT
from vibroplat.report.summary import measure

#: The scenes: one without events, one attached, one with an impact in each turn.
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
#: Statistics that stay the same, and others that are looked at.
STEADY = ("rms_y_m", "excitation_frequency_hz", "flight_fraction", "impacts_per_period")
OTHERS = ("energy_residual", "impacts", "liftoffs", "gap_min_m", "interval")


def endurance(count, engine):
    """Run scenes for a total number of turns, with statistics only."""
    scenes = kinds(TOLERANCE, 1.0)
    return [_long(name, with_engine(scenes[name], engine), count / len(SCENES)) for name in SCENES]


class Impacts:
    """Observes a motion: the times of its impacts (s)."""

    def __init__(self):
        self.times = []

    def read(self, h):
        rows = h.events[: h.run["events"]]
        self.times.extend(rows["t"][rows["kind"] == IMPACT].tolist())

    @property
    def spread(self):
        """Largest relative deviation of the time between impacts from its median."""
        between = np.diff(self.times)
        return float(np.abs(between / np.median(between) - 1.0).max()) if len(between) else 0.0


def _long(name, scene, turns):
    """Compare the parts of one run: energy, statistics, times of events, memory."""
    seconds = turns * TURN / scene.speed_scale / PARTS
    parts, memory = [], []
    with motion_of(scene) as motion:
        motion.advance(max(10.0, 0.1 * seconds))  # let it settle
        steps = motion.engine.work["steps"]
        for _ in range(PARTS):
            impacts = Impacts()
            parts.append(measure(motion.advance(seconds, observers=[impacts]), scene) | {"interval": impacts.spread})
            memory.append(psutil.Process().memory_info().rss / 1024.0)
        steps = (motion.engine.work["steps"] - steps) / PARTS
        outcome, state = motion.outcome, motion.automaton.run["state"]
    by = {key: np.array([found[key] or 0.0 for found in parts]) for key in (*STEADY, *OTHERS)}
    residuals = by["energy_residual"]
    growth = np.median(residuals[PARTS // 2 :]) / np.median(residuals[: PARTS // 2])
    limits = {
        "memory_growth_kib": (memory[-1] - memory[0], MEMORY),
        "angle_rad": (float(np.abs(state[3:5]).max()), 1001.0 * TURN),
        "energy_residual": (residuals.max(), RESIDUAL * TOLERANCE * steps),
        "residual_growth": (growth, GROWTH),  # of medians: single parts may be outliers
    }
    for key in STEADY:
        if by[key][0]:
            limits[f"{key}_drift"] = (np.abs(by[key] - np.median(by[key])).max() / abs(by[key][0]), SAME)
    if scene.has_contact:
        if by["impacts"][0]:
            # impact times lose digits as time grows, but must not lose more than that
            limits["interval_spread"] = (by["interval"][-1], by["interval"][0] + INTERVAL)
        limits["events_lost"] = (np.abs(by["liftoffs"] - by["impacts"]).max() if by["liftoffs"][0] else 0.0, 1.0)
        limits["gap_below_m"] = (abs(by["gap_min_m"].min()), 0.0)
    return row(f"{name}, {turns:.0f} turns, {PARTS * seconds:.0f} s", outcome, limits)
