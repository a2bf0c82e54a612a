"""How long a motion settles before it is measured.

Every 16 turns of exciter 1, the Poincaré section of the last 32 turns is compared with that of the 32 turns before. If
points n ≤ 16 turns apart converge, the remaining distance D q/(1−q) follows from a geometric series, with the
ratio q of the later spread D to the earlier one. It must stay small in two consecutive checks, as a quick transient may
hide a slow one at the first. A motion that does not settle is followed for as long as the plan allows: long chaotic
transients end in periodic motion, and only time distinguishes them from chaos.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np

from vibroplat.config.coordinates import TURN
from vibroplat.config.plans import SweepPlan
from vibroplat.config.scene import Scene
from vibroplat.model.parameters import FloatArray
from vibroplat.motion.motion import Simulator
from vibroplat.observe.measures import SECTION_POINTS
from vibroplat.observe.section import section_points, section_rows, spreads

#: Turns of exciter 1 that are compared with as many before, and turns between two checks.
TURNS, BLOCK = 32, 16
#: Number of checks after which the next ones are LATE_BLOCK turns apart: what has not settled by then takes long.
EARLY_CHECKS, LATE_BLOCK = 40, 64
#: Largest spread, in units of the settling tolerance, from which the remaining distance is extrapolated.
EXTRAPOLATION_LIMIT = 30.0
#: Spread, in units of the solver's tolerance, that counts as noise of the solver.
NOISE_TOLERANCE_RATIO = 30.0
#: Turns before the measured part over which the drift of the phase difference is taken.
DRIFT_TURNS = 192
#: With orbit detection, a motion whose section does not contract is advanced without observation by this fraction of
#: the elapsed time.
UNCHECKED_FRACTION = 0.5


class KnownOrbit(NamedTuple):
    """A stable periodic orbit that a motion converges to.

    Attributes
    ----------
    state
        Full state on it, on the Poincaré section, shape (14,).
    period, turn
        Turns of exciter 1 in a period, and the mean duration of one (s).
    multiplier
        Size of the largest Floquet multiplier but the 1 along the motion.
    measures
        What :func:`vibroplat.report.summary.measure` gathers over a period.
    section_y, impact_speeds
        y where it crosses the section (m), and speeds of the impacts in a period (m/s).
    """

    state: FloatArray
    period: int
    turn: float
    multiplier: float
    measures: dict[str, Any]
    section_y: list[float]
    impact_speeds: list[float]


class OrbitDetector(Protocol):
    """Searches for the orbit that a motion converges to."""

    @property
    def end_state(self) -> tuple[FloatArray, float] | None:
        """Full state at the end of the first turns, shape (14,), and time that they took (s); None without them."""

    @property
    def near_unstable_orbit(self) -> bool:
        """Whether the motion was near an orbit that is unstable when it was last looked for."""

    @property
    def work(self) -> Mapping[str, int | None]:
        """How much was done so far; see :data:`vibroplat.integrate.interface.WORK`."""

    def first(self, start: FloatArray) -> KnownOrbit | None:
        """Follow a motion for BLOCK turns from a full state, and return the orbit that it is shown to converge to."""

    def detect(self, motion: Simulator, points: FloatArray, period: int) -> KnownOrbit | None:
        """Return the orbit that a motion is shown to converge to.

        Its section has these points, in scaled units, and contracts after a period (turns), or 0.
        """

    def close(self) -> None:
        """Free what the engine holds."""


class SettlingResult(NamedTuple):
    """How a motion settled.

    Attributes
    ----------
    reason
        ``periodic``, ``orbit`` (it converges to a known one), ``maximum`` (not within the time that the plan allows),
        ``fixed`` (for a given time), or ``unfinished`` (it ended early).
    seconds
        Settling time (s).
    period
        Turns of exciter 1 after which it repeats if it is periodic; otherwise 1.
    turn
        Duration of a turn at the end (s); 0 if it is not known.
    slip
        Change of the phase difference over the last DRIFT_TURNS turns (rad) if the motion is not periodic.
    orbit
        The orbit that it comes to, if that is known.
    """

    reason: str
    seconds: float
    period: int = 1
    turn: float = 0.0
    slip: float = 0.0
    orbit: KnownOrbit | None = None

    @property
    def late(self) -> bool:
        """Whether the motion became periodic only after a long transient, so that it may not stay periodic."""
        return self.reason == "periodic" and self.turn > 0.0 and self.seconds > EARLY_CHECKS * BLOCK * self.turn


def settle(motion: Simulator, plan: SweepPlan, limit: float, detector: OrbitDetector | None = None) -> SettlingResult:
    """Advance a motion until it has settled as the plan says, or reaches an orbit that a detector knows, or ends early.

    ``limit`` limits the settling (s). It is counted from the beginning of the motion, so that one that
    turns out not to have settled can settle for the remaining time.
    """
    turn = TURN / motion.scene.speed_scale
    points, times = np.empty((0, motion.state.size)), np.empty(0)
    phases: list[float] = []  # differences
    close = 0
    while (remaining := limit - motion.now) > 1e-9 * limit:
        block = BLOCK if motion.now < EARLY_CHECKS * BLOCK * turn else LATE_BLOCK
        if detector is not None and len(points) == 2 * TURNS and not close:
            block = 2 * TURNS + BLOCK
            unseen = min(UNCHECKED_FRACTION * motion.now, remaining - DRIFT_TURNS * turn)
            if unseen > 0.0:
                motion.to_time(motion.now + unseen)
                points, times, phases = points[:0], times[:0], [phase_difference(motion)]
                remaining -= unseen
        part = motion.advance(min(block * turn, remaining), scope=SECTION_POINTS)
        if motion.outcome != "ok":
            return SettlingResult("unfinished", motion.now)
        points = np.concatenate([points, section_points(part.measures, motion.scene)])[-2 * TURNS :]
        times = np.concatenate([times, section_rows(part.measures)["t"]])[-2 * TURNS :]
        phases = [*phases, phase_difference(motion)][-math.ceil(DRIFT_TURNS / block) - 1 :]
        was_close = close
        close = contraction_period(points, motion.scene, plan) if len(points) == 2 * TURNS else 0
        orbit = None if detector is None else detector.detect(motion, points, close)
        if orbit is not None:
            return SettlingResult("orbit", motion.now, orbit.period, orbit.turn, orbit=orbit)
        if close and was_close and not (detector is not None and detector.near_unstable_orbit):
            return SettlingResult("periodic", motion.now, close, float(times[-1] - times[TURNS]) / (TURNS - 1))
    return SettlingResult("maximum", motion.now, slip=phases[-1] - phases[0] if phases else 0.0)


def phase_difference(motion: Simulator) -> float:
    """Phase difference of a motion, with all whole turns (rad)."""
    return float(motion.state[3:5] @ motion.scene.phase_weights)


def contraction_period(points: FloatArray, scene: Scene, plan: SweepPlan) -> int:
    """Return the shortest period (turns) to which the remaining distance is within the tolerance; 0 if there is none.

    The second half of the points, shape (turns, 14), is compared with the first.
    """
    tolerance = plan.settle_tolerance
    noise = min(NOISE_TOLERANCE_RATIO * scene.solver.tolerance, tolerance)
    half = len(points) // 2
    now, before = spreads(points[-half:]), spreads(points[-2 * half : -half])
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = now / before
        remaining = np.where(ratio < 1.0, now * ratio / (1.0 - ratio), np.inf)
    near = np.flatnonzero((now <= noise) | ((now <= EXTRAPOLATION_LIMIT * tolerance) & (remaining <= tolerance)))
    return int(near[0]) + 1 if near.size else 0
