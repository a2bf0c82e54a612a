"""Orbit detection for sweeps: the orbit to which a motion converges while it settles.

After 16 turns of exciter 1, and at each look of :func:`vibroplat.study.settling.settle`, Newton's method begins where
the motion is. A stable orbit that attracts the motion from there is the one that it comes to
(:mod:`vibroplat.continuation.attraction`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np

from vibroplat.config.coordinates import TURN
from vibroplat.config.scene import Scene
from vibroplat.continuation.attraction import AttractionEllipsoid
from vibroplat.continuation.first_orbit import smallest_period
from vibroplat.continuation.newton import (
    NewtonResult,
    NoConvergenceError,
    Problem,
    correct,
    correct_moving_section,
    fixed_border,
)
from vibroplat.continuation.orbit import TOLERANCE, measure_period, with_orbit_tolerance
from vibroplat.continuation.shooting import Shooter
from vibroplat.hybrid.modes import IMPACT
from vibroplat.kernels.compiled import FloatArray
from vibroplat.motion.motion import Simulator
from vibroplat.observe.measures import SECTION_POINTS
from vibroplat.observe.section import distances, section_points
from vibroplat.shooting.multipliers import UNIT_CIRCLE_DISTANCE
from vibroplat.study.settling import BLOCK, KnownOrbit

#: Maximum period searched for (turns of exciter 1), and maximum distance of points of the section (scaled units) at
#: which a search is worthwhile.
MAX_PERIOD_TURNS, MAX_SEARCH_DISTANCE = 8, 0.5
#: Least distance of the largest multiplier from the unit circle at which motion leaves an orbit in a time that counts.
UNSTABLE_MARGIN = 1e-4
#: Multiplier above which decay is slow. How far beyond the motion an orbit must attract where it is not.
SLOW_DECAY, ATTRACTION_RADIUS_RATIO = 0.9, 1.25
#: Most iterations of Newton's method, and limits of its steps, where a motion is expected to go.
MAX_ITERATIONS, LIMITS = 10, (math.inf, math.inf, 1.0, math.inf)


class NewtonOrbitDetector:
    """Searches for the orbit to which a motion of a scene converges; see :class:`.OrbitDetector`."""

    def __init__(self, scene: Scene) -> None:
        self._shooter, self._turn = Shooter.borrow(with_orbit_tolerance(scene, TOLERANCE)), TURN / scene.speed_scale
        self.end_state: tuple[FloatArray, float] | None = None
        self.near_unstable_orbit = False
        self._doubling, self._until = 0.0, 0.0  # of a distance, and until when it is not worth another look (s)

    def close(self) -> None:
        """Free what the engine holds, or leave it to the next detector."""
        self._shooter.give_back()

    @property
    def work(self) -> Mapping[str, int | None]:
        """How much was done so far."""
        return self._shooter.engine.work

    def reset(self) -> None:
        """Be ready for another motion."""
        self._until, self.end_state = 0.0, None

    def first(self, start: FloatArray) -> KnownOrbit | None:
        """Follow a motion from a full state for BLOCK turns, and return the orbit that it is shown to converge to."""
        self.reset()
        motion = self._shooter.motion
        motion.reset(start)
        part = motion.advance_turns(BLOCK, self._max_time(BLOCK), scope=SECTION_POINTS)
        points = section_points(part.measures, self._shooter.scene)
        if len(points) <= BLOCK:
            return None
        self.end_state = motion.state, motion.now
        return self._detect_at(_periods(points, 0))

    def detect(self, motion: Simulator, points: FloatArray, period: int) -> KnownOrbit | None:
        """Return the orbit that a motion is shown to converge to, with a period in which it contracts, or 0."""
        own = self._shooter.motion
        if motion.now < self._until:
            return None
        self.near_unstable_orbit = False
        periods = _periods(points, period)
        if not periods:
            return None
        own.reset(motion.state)
        orbit = self._detect_at(periods) if own.to_section(1, self._max_time(1)) else None
        if self.near_unstable_orbit:
            self._until = motion.now + self._doubling
        return orbit

    def known_orbit(self, state: FloatArray, period: int) -> KnownOrbit:
        """Return the orbit near a full state; raises :class:`NoConvergenceError` where there is none of this period."""
        motion = self._shooter.motion
        motion.reset(state)
        motion.to_section(1, self._max_time(1))
        problem, result = self._orbit_near(motion.state, motion.system.index, period)
        return self._known(problem, result, AttractionEllipsoid(result, period))

    def section_ellipsoids(self, state: FloatArray, period: int) -> list[tuple[AttractionEllipsoid, float]]:
        """Return the surroundings of a stable orbit, one for each turn, and the radii from which they surely attract.

        Raises
        ------
        NoConvergenceError
            There is none of this period near the full state on the section.
        """
        ellipsoids, motion = list[tuple[AttractionEllipsoid, float]](), self._shooter.motion
        motion.reset(state)
        for _ in range(period):
            around = AttractionEllipsoid(self._orbit_near(motion.state, motion.system.index, period)[1], period)
            ellipsoids.append((around, around.radius(self._shooter)))
            motion.reset(around.state)
            motion.to_section(1, self._max_time(1))
        return ellipsoids

    def _detect_at(self, periods: Iterable[int]) -> KnownOrbit | None:
        """Return the orbit that the shooter's motion converges to from where it is on the section."""
        motion, judged = self._shooter.motion, set[int]()
        state, system = motion.state, motion.system.index
        self.near_unstable_orbit = False
        for turns in periods:
            try:
                problem, result = self._orbit_near(state, system, turns)
                shortest, around = smallest_period(problem, result, turns), AttractionEllipsoid(result, turns)
                if shortest in judged:
                    continue
                if shortest < turns and around.spectral_radius < 1.0:  # motion that swings may repeat later alone
                    problem, result = self._orbit_near(around.state, around.system, shortest)
                    around = AttractionEllipsoid(result, shortest)
            except NoConvergenceError:
                continue
            judged.add(shortest)
            if around.spectral_radius > 1.0 - UNIT_CIRCLE_DISTANCE:
                self.near_unstable_orbit = around.spectral_radius > 1.0 + UNSTABLE_MARGIN
                self._doubling = (
                    math.log(2.0) / math.log(max(around.spectral_radius, 1.0 + UNSTABLE_MARGIN)) * result.shot.duration
                )
            elif (
                around.contracts_along_trajectory(self._shooter, state)
                if around.spectral_radius > SLOW_DECAY
                else around.contracts_on_shells(self._shooter, ATTRACTION_RADIUS_RATIO * around.distance(state, system))
            ):
                return self._known(problem, result, around)
        return None

    def _orbit_near(self, state: FloatArray, system: int, turns: int) -> tuple[Problem, NewtonResult]:
        """Find an orbit by Newton's method from a full state on the section."""
        motion, here = self._shooter.motion, state.copy()
        here[3:5] -= TURN * np.round(here[3:5] / TURN)
        motion.reset(here)
        if not motion.to_section(turns, self._max_time(turns)):
            raise NoConvergenceError("exciter 1 does not turn")
        both = np.round((motion.state - here)[3:5] / TURN).astype(int).tolist()
        problem = Problem(self._shooter, both, (), TOLERANCE)
        chart = problem.chart(here, system)
        u = chart.pack(here, motion.now)
        result = correct_moving_section(problem, chart, u, MAX_ITERATIONS, LIMITS)
        if result.chart is not chart:  # back to the section
            motion.reset(result.chart.unpack(result.u)[0])
            motion.to_section(1, self._max_time(1))
            back = motion.state
            back[3:5] -= TURN * np.round(back[3:5] / TURN)
            chart = problem.chart(back)
            u = chart.pack(back, result.shot.duration)
            result = correct(problem, chart, u, fixed_border(chart), max_iterations=MAX_ITERATIONS)
        return problem, result

    def _known(self, problem: Problem, result: NewtonResult, around: AttractionEllipsoid) -> KnownOrbit:
        """Gather what a sweep tells of an orbit."""
        motion, heights = self._shooter.motion, [float(around.state[1])]
        motion.reset(around.state)
        for _ in range(1, around.turns):
            motion.to_section(1, self._max_time(1))
            heights.append(float(motion.state[1]))
        events = result.shot.events
        return KnownOrbit(
            state=around.state,
            period=around.turns,
            turn=result.shot.duration / around.turns,
            multiplier=around.spectral_radius,
            measures=measure_period(problem, result.shot, self._shooter.scene),
            section_y=heights,
            impact_speeds=(-events["rate_before"][events["kind"] == IMPACT]).tolist(),
        )

    def _max_time(self, turns: int) -> float:
        """Time within which exciter 1 must make so many turns (s)."""
        return 4.0 * (turns + 1) * self._turn


def _periods(points: FloatArray, period: int) -> list[int]:
    """List what the period of a section may be: 1, that after which its last points are near, and a given one."""
    if len(points) < MAX_PERIOD_TURNS + 2:
        return []
    last = distances(points[-MAX_PERIOD_TURNS - 2 :], MAX_PERIOD_TURNS)
    near = np.array([row[-n - 2 : -n].max() for n, row in enumerate(last[1:], 1)])
    shortest = int(np.flatnonzero(near <= 2.0 * near.min())[0]) + 1
    likely = [n for n in dict.fromkeys((1, shortest)) if near[n - 1] < MAX_SEARCH_DISTANCE]
    return [*likely, period] if period > 1 and period != shortest else likely
