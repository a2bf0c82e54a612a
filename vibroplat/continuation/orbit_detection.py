"""Orbit detection for sweeps: the orbit to which a motion converges while it settles.

After 16 turns of exciter 1, and at each look of :func:`vibroplat.study.settling.settle`, Newton's method begins where
the motion is. A stable orbit that attracts the motion from there is the one that it comes to
(:mod:`vibroplat.continuation.attraction`). Where the section does not repeat, it begins at returns of the section near
itself.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from vibroplat.config.coordinates import TURN
from vibroplat.config.scene import Scene
from vibroplat.continuation.attraction import AttractionEllipsoid
from vibroplat.continuation.first_orbit import smallest_period
from vibroplat.continuation.newton import (
    Limits,
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
from vibroplat.observe.section import distances, is_apart, scaled_points, section_points
from vibroplat.shooting.multipliers import UNIT_CIRCLE_DISTANCE
from vibroplat.study.settling import BLOCK, KnownOrbit, NearReturn, NearReturnOrbits

#: Maximum period searched for (turns of exciter 1), and maximum distance of points of the section (scaled units) at
#: which a search is worthwhile.
MAX_PERIOD_TURNS, MAX_SEARCH_DISTANCE = 8, 0.5
#: Least distance of the largest multiplier from the unit circle at which motion leaves an orbit in a time that counts.
UNSTABLE_MARGIN = 1e-4
#: Multiplier above which decay is slow. How far beyond the motion an orbit must attract where it is not.
SLOW_DECAY, ATTRACTION_RADIUS_RATIO = 0.9, 1.25
#: Largest multiplier of unstable orbits that are left to their sides, and of how many at most; how far from an orbit
#: motion begins, and how far it has left it, in scaled units; periods in which it settles then, and most
#: turns until Newton's method tries. Of 40 windows of chaos at 57 Hz, 21 show a saddle of multiplier 2.59, from one
#: side of which motion converges to the stable orbit of 6 turns.
MAX_SADDLE, SADDLES, OFFSET, DEPARTURE, SETTLING, MAX_TURNS = 3.0, 4, 1e-2, 0.3, 4, 256
#: Most iterations of Newton's method, and its limits: where a motion is expected to go, and from a return of chaotic
#: motion. Of 4963 trials from returns in 203 windows of chaos, 2003 lead to an orbit. Limits of residuals lose 147 of
#: these, among them 35 of 648 with a multiplier below 3 and no stable one, and save a third of all shots: 2539 of the
#: 2960 other trials end there, after 2.9 instead of 6.4 shots.
APPROACH: tuple[int, Limits] = 10, ((math.inf, math.inf, 1.0, math.inf), ())
RETURN: tuple[int, Limits] = 12, ((), (5.0, 2.0, 0.5, 0.2))
#: Largest number of turns of a few more returns: chaos that converges to an orbit of many turns passes near it before.
MAX_MORE_TURNS = 24
#: Largest distance of returns, in scaled units. How many are tried because they are the nearest of all, how
#: many because they are the nearest of a number of turns relative to returns after its divisors, and how many that are
#: longer. In chaos at 57 Hz nearly all returns after 6 turns belong to an orbit of 2 turns: those that are nearest show
#: a stable orbit of 6 turns, or the saddle beside it, in 0 of 40 windows, relative ones in 23.
MAX_DISTANCE, NEAREST_COUNT, RELATIVE_COUNT, MANY_TURNS_COUNT = 2.0, 6, 3, 2
#: Largest distance of a return relative to returns after divisors of its turns, which belong to shorter orbits.
MAX_RATIO = 0.7
#: How far apart returns of the same turns are, and how far from known orbits, relative to their own distances.
MIN_SEPARATION = 0.5
#: Growth of a distance until the next return, above which a relative return is not tried: an orbit near it is more
#: unstable than those whose sides are searched. In 200 windows of chaos of five scenes, this finds 134 instead of 137
#: stable orbits, by 2083 instead of 3014 trials.
MAX_GROWTH = 3.0
#: Returns that are candidates, for each number of turns.
MAX_CANDIDATES = 60


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

    def near_returns(self, points: FloatArray, states: FloatArray) -> list[NearReturn]:
        """Choose near returns of a section: its points, in scaled units, and full states, each shape (turns, 14)."""
        return [
            NearReturn(turns, float(np.abs(points[index + turns] - points[index]).max()), states[index].tolist())
            for turns, index in near_returns(points, MAX_PERIOD_TURNS)
        ]

    def search_near_returns(self, returns: Sequence[NearReturn]) -> NearReturnOrbits:
        """Search for a stable orbit from returns of a section that does not repeat, and beside the unstable ones.

        Returns near unstable orbits of the same turns are not tried. An unstable orbit that arose together with a
        stable one leads to it from one of its sides.
        """
        known, mild = list[tuple[int, FloatArray]](), dict[tuple[int, float], AttractionEllipsoid]()
        trials = 0
        for turns, distance, numbers in returns:
            state = np.array(numbers)
            (point,) = scaled_points(state[np.newaxis], self._shooter.scene)
            least = MIN_SEPARATION * distance
            if not all(is_apart(point, way, least) for period, way in known if turns % period == 0):
                continue
            trials += 1
            self._shooter.motion.reset(state)
            try:
                problem, result = self._orbit_near(state, self._shooter.motion.system.index, turns, RETURN)
            except NoConvergenceError:
                continue
            around, period = AttractionEllipsoid(result, turns), smallest_period(problem, result, turns)
            if around.spectral_radius < 1.0 - UNIT_CIRCLE_DISTANCE:
                orbit = (
                    self.known_orbit(around.state, period) if period < turns else self._known(problem, result, around)
                )
                return NearReturnOrbits(orbit, trials, 0)
            known.append((period, self._section(around.state, period)))
            if period == turns and 1.0 + UNSTABLE_MARGIN < around.spectral_radius < MAX_SADDLE:
                mild[turns, round(around.spectral_radius, 6)] = around
        left = sorted(mild.values(), key=lambda around: around.spectral_radius)[:SADDLES]
        orbits = (self._leave_saddle(state, around) for around in left for state in around.sides(OFFSET))
        return NearReturnOrbits(next((orbit for orbit in orbits if orbit is not None), None), trials, len(left))

    def _leave_saddle(self, state: FloatArray, around: AttractionEllipsoid) -> KnownOrbit | None:
        """Return the stable orbit to which motion converges soon from a full state beside an unstable orbit."""
        periods = SETTLING + math.log(DEPARTURE / OFFSET) / math.log(around.spectral_radius)
        turns = max(math.ceil(min(around.turns * periods, MAX_TURNS)), MAX_PERIOD_TURNS + 2)
        points = self._section(state, turns)
        return self._detect_at(_periods(points, around.turns)) if len(points) > turns else None

    def _section(self, state: FloatArray, turns: int) -> FloatArray:
        """Follow the shooter's motion from a full state for some turns; points of its section, in scales."""
        motion = self._shooter.motion
        motion.reset(state)
        part = motion.advance_turns(turns, self._max_time(turns), scope=SECTION_POINTS)
        return section_points(part.measures, self._shooter.scene)

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

    def _orbit_near(
        self, state: FloatArray, system: int, turns: int, effort: tuple[int, Limits] = APPROACH
    ) -> tuple[Problem, NewtonResult]:
        """Find an orbit by Newton's method from a full state on the section; ``effort`` is one of both above."""
        motion, here, (iterations, limits) = self._shooter.motion, state.copy(), effort
        here[3:5] -= TURN * np.round(here[3:5] / TURN)
        motion.reset(here)
        if not motion.to_section(turns, self._max_time(turns)):
            raise NoConvergenceError("exciter 1 does not turn")
        both = np.round((motion.state - here)[3:5] / TURN).astype(int).tolist()
        problem = Problem(self._shooter, both, (), TOLERANCE)
        chart = problem.chart(here, system)
        u = chart.pack(here, motion.now)
        result = correct_moving_section(problem, chart, u, iterations, limits)
        if result.chart is not chart:  # back to the section
            motion.reset(result.chart.unpack(result.u)[0])
            motion.to_section(1, self._max_time(1))
            back = motion.state
            back[3:5] -= TURN * np.round(back[3:5] / TURN)
            chart = problem.chart(back)
            result = correct(
                problem, chart, chart.pack(back, result.shot.duration), fixed_border(chart), max_iterations=iterations
            )
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


def near_returns(points: FloatArray, longest: int) -> Iterator[tuple[int, int]]:
    """Yield numbers of turns and places after which a section comes back to itself, for a trial each.

    First the nearest of all; then in rounds the nearest of each number of turns relative to its divisors, without those
    that MAX_GROWTH excludes; then long ones.

    Parameters
    ----------
    points
        Of the section, in scaled units, shape (turns, 14).
    longest
        Largest number of turns of most returns.
    """
    away = distances(points, min(MAX_MORE_TURNS, len(points) - 1))
    away[away > MAX_DISTANCE] = np.inf
    tried: list[tuple[int, int]] = []

    def fresh(turns: int, place: int) -> bool:
        ways = [points[k : k + n] for n, k in tried if n == turns]
        return all(is_apart(points[place], way, MIN_SEPARATION * away[turns, place]) for way in ways)

    def mild(trial: tuple[int, int]) -> bool:
        turns, place = trial
        again = place + turns
        return again >= len(points) - turns or bool(away[turns, again] <= MAX_GROWTH * away[trial])

    def some(candidates: Iterable[tuple[int, int]], most: int) -> Iterator[tuple[int, int]]:
        for trial in itertools.islice((one for one in candidates if fresh(*one)), most):
            tried.append(trial)
            yield trial

    short, own = range(1, min(longest, len(away) - 1) + 1), _relative(away)
    yield from some(_nearest(away, short), NEAREST_COUNT)
    rounds = {turns: _nearest(own, [turns]) for turns in short}
    for _ in range(RELATIVE_COUNT):
        for candidates in rounds.values():
            yield from filter(mild, some(candidates, 1))
    long = np.where(own < MAX_RATIO, away, np.inf)
    yield from some(_nearest(long, range(longest + 1, len(away))), MANY_TURNS_COUNT)


def _relative(away: FloatArray) -> FloatArray:
    """Distances relative to the least after a divisor of as many turns, or to MAX_DISTANCE; inf if beyond MAX_RATIO."""
    relative = np.full_like(away, np.inf)
    for turns in range(1, len(away)):
        shorter = [away[n] for n in range(1, turns) if turns % n == 0]
        least = np.minimum(np.min(shorter, axis=0), MAX_DISTANCE) if shorter else MAX_DISTANCE
        relative[turns] = away[turns] / np.maximum(least, np.finfo(float).tiny)
    relative[relative > MAX_RATIO] = np.inf
    return relative


def _nearest(away: FloatArray, lengths: Iterable[int]) -> Iterator[tuple[int, int]]:
    """Yield turns and places of some lengths, the nearest first."""
    candidates = [(away[n, k], n, int(k)) for n in lengths for k in np.argsort(away[n])[:MAX_CANDIDATES]]
    yield from ((turns, index) for distance, turns, index in sorted(candidates) if distance < np.inf)
