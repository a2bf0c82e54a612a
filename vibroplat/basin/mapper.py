"""Follows motions from starts until each is surely in the basin of a periodic orbit, and finds the orbits on the way.

Every eight turns of exciter 1, later every sixteen, a motion is checked: once it is in an ellipsoid around an orbit
(:mod:`vibroplat.continuation.attraction`), and comes nearer to the orbit there, it is assigned to this orbit. One that
takes several times as long as others may converge to an orbit that is not known yet: where its section nearly comes
back to itself, Newton's method begins there. A motion that has converged to no orbit is measured in its last turns.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from vibroplat.basin.initial_conditions import initial_states
from vibroplat.basin.windows import MEASURES, same_motion
from vibroplat.columns import PHASE_COLUMN
from vibroplat.config.circular import wrap
from vibroplat.config.coordinates import TURN
from vibroplat.config.engine_choice import FAILED, with_second_engine
from vibroplat.config.plans import SweepPlan
from vibroplat.config.scene import Scene
from vibroplat.config.study_plans import BasinsPlan
from vibroplat.continuation.attraction import expected_decay
from vibroplat.continuation.newton import NoConvergenceError
from vibroplat.continuation.orbit_detection import MAX_PERIOD_TURNS, NewtonOrbitDetector
from vibroplat.hybrid.state import state_scales
from vibroplat.integrate import group_for, make_engine
from vibroplat.kernels.compiled import FloatArray, quick_call
from vibroplat.kernels.target import lanes
from vibroplat.model.parameters import parameters
from vibroplat.motion.motion import Simulator
from vibroplat.observe.measures import SECTION_POINTS, WITH_EXTREMES
from vibroplat.observe.section import section_points
from vibroplat.report.summary import MeasuredInterval, measure
from vibroplat.shooting.assignment import (
    ASSIGNED,
    ENDED,
    FOLLOWED,
    GO_ON,
    UNCONVERGED,
    Ellipsoids,
    Followers,
    Limits,
    decide,
    follow,
    numbers_of,
)
from vibroplat.study.classification import BLOCKS
from vibroplat.study.point import measure_point, on_orbit, row_of
from vibroplat.study.settling import KnownOrbit
from vibroplat.study.store import Record

#: Turns between two looks whether a motion is in an ellipsoid, in its first FIRST_SEARCH_TURNS turns and later.
CHECK_TURNS, LATE_CHECK_TURNS = 8, 16
#: A motion that is in none after so many turns, or so many times the median of the others, is searched for orbits,
#: and again each time after twice as long.
FIRST_SEARCH_TURNS, SEARCH_TURNS_RATIO, MIN_HISTORY = 96, 4.0, 20
#: Turns of such a look, and the distance of a return from which Newton's method begins, in scaled units.
SEARCH_TURNS, RETURN_DISTANCE = 16, 0.05
#: Periods in which a motion in an ellipsoid must come nearer to the orbit, unless it is this near already, over the
#: radius.
CONTRACTION_PERIODS, INNER_RADIUS_RATIO = 2, 0.1
#: Columns of windows other than measures; the last ones with transport.
DESCRIBING_COLUMNS = ("flight_fraction", "sync", PHASE_COLUMN, "stick_fraction", "conveying_speed_error_m_per_s")
#: Turns within which a motion must settle that is assigned without an orbit, if it has not taken as many already.
SETTLED_TURNS = 128
#: Precision of that, in scaled units, sufficient for measures to distinguish such motions; exponents do not matter.
CLOSE_SETTLING: Record = {"settle_tolerance": 1e-4, "lyapunov": False, "perturbation": 0.0}
#: Distance of the same orbit found twice, in scaled units.
SAME_ORBIT_DISTANCE = 1e-4
#: Windows in which a motion that has converged to no orbit is measured, and whole turns of each, a multiple of many
#: periods. They are its last ones; of a motion that is followed for few turns, half of these.
WINDOWS, WINDOW_TURNS = 4, 240


def same_orbit(one: Record, other: Record, scales: FloatArray) -> bool:
    """Whether two records of attractors are of one orbit, or of one motion that has settled."""
    if "multiplier_max" not in one["row"]:
        return same_motion(one["row"], other["row"], scales)
    if one["row"]["period"] != other["row"]["period"]:
        return False
    away = np.array(other["centres"]) - one["state"]
    away[:, 3:5] = wrap(away[:, 3:5])
    return bool(np.abs(away / scales).max(axis=1).min(initial=np.inf) < SAME_ORBIT_DISTANCE)


class AttractorMapper:
    """Follows motions of a scene.

    Parameters
    ----------
    scene, max_turns
        The scene, and turns after which a motion is given up.
    known, history
        Records of attractors, to which it adds, and turns that motions have taken.
    """

    def __init__(self, scene: Scene, max_turns: int, known: Sequence[Record], history: Sequence[int] = ()) -> None:
        self.scene, self.max_turns, self.attractors = scene, max_turns, list(known)
        p = parameters(scene)
        self._scales, self._turn = state_scales(scene), TURN / scene.speed_scale
        self._engine = make_engine(scene, p)
        self._motion = Simulator(scene, p, self._engine)
        self._group = group_for(self._engine, scene, p, lanes())
        self._follow, self._decide = quick_call(follow), quick_call(decide)
        self._search, self._settled = FIRST_SEARCH_TURNS, 0  # turns until a search, and those that one takes itself
        if len(history) >= MIN_HISTORY and scene.transport is None:
            after = min(int(SEARCH_TURNS_RATIO * np.median(history)), max_turns // 2)
            self._search = max(FIRST_SEARCH_TURNS, after)
        self._limits = Limits(
            early=CHECK_TURNS,
            later=LATE_CHECK_TURNS,
            late=FIRST_SEARCH_TURNS,
            unsearched=SEARCH_TURNS,
            most=max_turns - WINDOWS * (window_length(max_turns) + 1),
            turn=self._turn,
            longest=4.0 * self._turn,
            near=INNER_RADIUS_RATIO**2,
        )
        self._never = np.full(scene.solver.max_events_per_period, -np.inf)  # when other motions have restarted
        self._pack()

    def close(self) -> None:
        """Free what the engines hold."""
        if "_detector" in vars(self):
            self._detector.close()
        self._engine.close()

    @cached_property
    def _detector(self) -> NewtonOrbitDetector:
        """What searches for orbits; few blocks of starts need it."""
        return NewtonOrbitDetector(self.scene)

    def map_states(self, starts: FloatArray) -> list[Record]:
        """Map full states, shape (starts, 14), to their attractors.

        A record has the number of the attractor, or None and what was measured, and the turns it took.
        """
        count, motion = len(starts), self._motion
        runs, followed = motion.beginnings(starts), np.zeros(count, FOLLOWED)
        followed["place"], followed["fresh"], followed["search"] = -1, 1, self._search
        waiting, taken, lane_motions = np.arange(count), np.array([0, count]), np.full(lanes(), -1)
        in_lanes = np.zeros((0, 0)) if self._group is None else numbers_of(self._group.runs)
        arrays = (numbers_of(runs), in_lanes, followed, waiting, taken, lane_motions, self._never.copy())
        work, others = Followers(*arrays), dict[int, Record]()
        while (stopped := self._advance(work, runs))[0] >= 0:
            number, fate = stopped
            motion.resume(runs[number], work.recent)
            turns, more = (int(followed[number][name]) for name in ("turns", "more"))
            if "_detector" in vars(self):
                self._detector.reset()
            if fate == ENDED:
                ended = {"outcome": motion.outcome, "detail": motion.detail}
                others[number] = {"attractor": None, "turns": turns, **ended}
            elif fate == UNCONVERGED:
                others[number] = self._measure_unconverged(turns)
            else:
                until = 4.0 * (LATE_CHECK_TURNS + 1) * self._turn
                part = motion.advance_turns(SEARCH_TURNS, until, scope=SECTION_POINTS)
                orbit_number = self._search_new_orbit(part)
                if orbit_number is not None:
                    others[number] = {"attractor": orbit_number, "turns": min(turns + self._settled, self.max_turns)}
                    continue
                followed[number]["turns"] += more + SEARCH_TURNS + 1
                followed[number]["search"] *= 2
                runs[number] = motion.automaton.run
                taken[0] -= 1  # it goes on before the others
                waiting[taken[0]] = number
        places, turns_of = followed["place"].tolist(), followed["turns"].tolist()
        return [
            others.get(number) or {"attractor": self._owners[places[number]], "turns": turns_of[number]}
            for number in range(count)
        ]

    def _advance(self, work: Followers, runs: npt.NDArray[np.void]) -> tuple[int, int]:
        """Follow motions until one is not assigned but needs more: its number, −1 without one, and what it needs."""
        if self._group is not None:
            return self._follow(self._group, work, self._limits, self._ellipsoids)
        motion, run = self._motion, self._motion.automaton.run
        while work.taken[0] < work.taken[1]:
            number = int(work.waiting[work.taken[0]])
            work.taken[0] += 1
            motion.resume(runs[number], self._never)
            if work.followed[number]["fresh"]:
                work.followed[number]["fresh"] = 0
                motion.find_mode()
            while (fate := self._decide(run, work.followed[number], self._limits, self._ellipsoids)) == GO_ON:
                motion.to_time(float(run["end"]))
            run["target"] = np.nan
            runs[number] = run
            if fate != ASSIGNED:
                work.recent[:] = motion.automaton.recent
                return number, fate
        return -1, GO_ON

    def _find_ellipsoid(self) -> tuple[int | None, int]:
        """Return the number of the orbit in whose ellipsoid the motion is and comes nearer, and turns that this took.

        An ellipsoid was tested in some directions: beside chaos, it may still hold states of another basin.
        """
        motion, run, followed = self._motion, self._motion.automaton.run, np.zeros(1, FOLLOWED)[0]
        if motion.outcome != "ok":
            return None, 0
        followed["place"], followed["stride"], followed["turns"], followed["search"] = -1, 1, self.max_turns, 2**62
        turns = 0
        while (fate := self._decide(run, followed, self._limits, self._ellipsoids)) == GO_ON:
            index = int(followed["place"])
            turns = int(self._ellipsoids.turns[index])
            motion.to_time(float(run["end"]))
        run["target"] = np.nan
        return self._owners[index] if fate == ASSIGNED else None, turns

    def register_near(self, state: FloatArray, period: int) -> int:
        """Return the number of the stable orbit near a full state; raises :class:`NoConvergenceError` without one."""
        return self.register(self._detector.known_orbit(state, period))

    def register(self, orbit: KnownOrbit) -> int:
        """Return the number of an orbit among the attractors; one that is not there yet is added."""
        row = on_orbit(self.scene, orbit, 0.0, self._detector.work).row
        record: Record = {"row": row, "state": orbit.state.tolist(), "centres": [], "forms": [], "systems": []}
        if (number := self._number(record)) < len(self.attractors):
            return number
        try:
            around = self._detector.section_ellipsoids(orbit.state, orbit.period)
        except NoConvergenceError:
            around = []
        radii = [radius for _, radius in around if radius > 0.0]
        record |= {"radius": min(radii, default=0.0), "ellipsoids": len(radii)}
        record["centres"] = [crossing.state.tolist() for crossing, _ in around] or [record["state"]]
        for crossing, radius in around:
            record["forms"].append((crossing.form / max(radius, 1e-150) ** 2).tolist())
            record["systems"].append(crossing.system)
        return self._add(record)

    def _number(self, record: Record) -> int:
        """Return the number of an attractor, or that of a new one."""
        same = (n for n, known in enumerate(self.attractors) if same_orbit(record, known, self._scales))
        return next(same, len(self.attractors))

    def _add(self, record: Record) -> int:
        """Add an attractor unless it is known, and return its number."""
        if (number := self._number(record)) == len(self.attractors):
            self.attractors.append(record)
            self._pack()
        return number

    def _pack(self) -> None:
        """Gather the ellipsoids of all attractors for compiled code, and whose they are."""
        sizes = [len(known["forms"]) for known in self.attractors]
        self._owners = np.repeat(np.arange(len(sizes)), sizes).tolist()
        centres, forms, systems = (
            [part for known in self.attractors if known["forms"] for part in known[name]]
            for name in ("centres", "forms", "systems")
        )
        rows = [self.attractors[number]["row"] for number in self._owners]
        self._ellipsoids = Ellipsoids(
            np.array(centres, dtype=float).reshape(-1, 14),
            np.array(forms, dtype=float).reshape(-1, 14, 14),
            np.array(systems, dtype=np.int64),
            turns=np.array([CONTRACTION_PERIODS * row["period"] for row in rows], dtype=np.int64),
            bound=np.array([expected_decay(row["multiplier_max"], CONTRACTION_PERIODS) ** 2 for row in rows]),
        )

    def _search_new_orbit(self, part: MeasuredInterval) -> int | None:
        """Return the number of the orbit to which the motion converges after a part of it, or None; add a new one."""
        if self.scene.transport is not None:
            return self._search_settled()
        points = section_points(part.measures, self.scene)
        if self._motion.outcome != "ok" or len(points) <= MAX_PERIOD_TURNS:
            return None
        if min(np.abs(points[-1] - points[-1 - n]).max() for n in range(1, MAX_PERIOD_TURNS + 1)) > RETURN_DISTANCE:
            return None
        orbit = self._detector.detect(self._motion, points, 0)
        return None if orbit is None else self.register(orbit)

    def _search_settled(self) -> int | None:
        """Return the number of the repeating motion to which this one soon settles, or None; add a new one."""
        max_settle_s = max(SETTLED_TURNS * self._turn, self._motion.now)
        plan = SweepPlan.of_motion(max_settle_s=max_settle_s, measure_s=max_settle_s / BLOCKS, **CLOSE_SETTLING)
        point = measure_point(self.scene, plan, self._motion.state.tolist(), (0,))
        if not point.row.get("period") or point.row["settle_s"] >= max_settle_s:
            return None
        del point.row["wall_s"]
        self._settled = round(point.row["settle_s"] / self._turn)
        record = {"row": point.row, "state": point.state, "centres": [], "forms": [], "systems": []}
        return self._add(record | {"radius": 0.0, "ellipsoids": 0})

    def _measure_unconverged(self, turns: int) -> Record:
        """Measure a motion that has converged to no orbit, in windows; it may still converge to one."""
        motion, rows = self._motion, list[dict[str, Any]]()
        for left in range(WINDOWS, 0, -1):
            window = max((self.max_turns - turns) // left - 1, 1)
            part = motion.advance_turns(window, 2.0 * (window + 2) * self._turn, scope=WITH_EXTREMES)
            turns += window + 1
            orbit_number, more = self._find_ellipsoid()
            orbit_number = self._search_new_orbit(part) if orbit_number is None else orbit_number
            if motion.outcome != "ok":
                return {"attractor": None, "turns": turns, "outcome": motion.outcome, "detail": motion.detail}
            if orbit_number is not None:
                return {"attractor": orbit_number, "turns": turns}
            turns += more
            row = row_of(measure(part, self.scene), self.scene, period=0)
            rows.append({name: row[name] for name in (*MEASURES, *DESCRIBING_COLUMNS) if name in row})
        end = {"outcome": "ok", "detail": "", "state": motion.state.tolist(), "windows": rows}
        return {"attractor": None, "turns": self.max_turns, **end}

    def repeats(self, state: Sequence[float], period: int) -> bool:
        """Whether the motion from a full state repeats after a period already."""
        self._motion.reset(np.array(state))
        until = 4.0 * (2 * period + 2) * self._turn
        part = self._motion.advance_turns(2 * period, until, scope=SECTION_POINTS)
        points = section_points(part.measures, self.scene)[-2 * period :]
        return len(points) == 2 * period and bool(np.abs(points[period:] - points[:period]).max() < SAME_ORBIT_DISTANCE)


def window_length(max_turns: int) -> int:
    """Return the length of a window (turns) of motions that are followed for ``max_turns`` turns."""
    return min(WINDOW_TURNS, max_turns // (2 * WINDOWS) - 1)


def map_initial_conditions(
    scene: Scene, plan: BasinsPlan, first: int, count: int, known: Sequence[Record], history: Sequence[int] = ()
) -> Record:
    """Follow some starts; return what became of each, and the attractors that were found besides the known ones.

    ``history`` are turns that others have taken.
    """

    def follow_starts(tried: Scene) -> Record:
        with closing(AttractorMapper(tried, plan.max_turns, known, history)) as mapper:
            starts = mapper.map_states(initial_states(tried, plan, range(first, first + count)))
            return {"starts": starts, "known": len(known), "found": mapper.attractors[len(known) :]}

    return with_second_engine(
        scene, follow_starts, lambda record: any(start.get("outcome") in FAILED for start in record["starts"])
    )


def map_alone(scene: Scene, plan: BasinsPlan, number: int) -> Record:
    """Follow a start without what others have found: the ``row`` of what it comes to."""
    with closing(AttractorMapper(scene, plan.max_turns, [])) as mapper:
        record = mapper.map_states(initial_states(scene, plan, [number]))[0]
        if record["attractor"] is not None:
            return {"row": mapper.attractors[record["attractor"]]["row"]}
        return {"row": {"motion": None, "period": 0, **record.get("windows", [{"sync": None}])[-1]}}


def classify_unconverged(scene: Scene, state: list[float]) -> Record:
    """Measure and classify a motion that has converged to no orbit in the turns given."""
    plan = SweepPlan.of_motion(perturbation=0.0)
    point = measure_point(scene, plan, state, (0,))
    del point.row["wall_s"]
    return {"row": point.row, "state": point.state}


def repeats(scene: Scene, states: Sequence[Sequence[float]], period: int) -> Record:
    """Tell which motions from full states repeat after a period already."""
    with closing(AttractorMapper(scene, 0, [])) as mapper:
        return {"repeats": [mapper.repeats(state, period) for state in states]}
