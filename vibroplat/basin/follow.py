"""Follows motions from starts until each is surely in the basin of a periodic orbit, and finds the orbits on the way.

Every eight turns of exciter 1, later every sixteen, a motion is looked at: it is assigned to an orbit once it is in one
of its ellipsoids (:mod:`vibroplat.continuation.attraction`). One that takes several times as long as others may come to
an orbit that is not known yet: where its section nearly comes back to itself, Newton's method begins there.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from typing import Any

import numpy as np

from vibroplat.basin.starts import states_of
from vibroplat.columns import PHASE_COLUMN
from vibroplat.config.plans import SweepPlan
from vibroplat.config.questions import BasinsPlan
from vibroplat.config.scene import Scene
from vibroplat.continuation.newton import MissedError
from vibroplat.continuation.seeker import LONGEST, OrbitSeeker
from vibroplat.continuation.shooting import TURN
from vibroplat.hybrid.state import state_scales
from vibroplat.integrate import make_engine
from vibroplat.kernels.compiled import FloatArray, same_types
from vibroplat.model.parameters import parameters
from vibroplat.motion.motion import Motion
from vibroplat.observe.section import ellipsoid_of, section_points
from vibroplat.observe.summary import measured
from vibroplat.study.point import measure_point, on_orbit, row_of
from vibroplat.study.settling import KnownOrbit
from vibroplat.study.store import Record

#: Turns between two looks whether a motion is in an ellipsoid, in its first FIRST turns and later.
STRIDE, LATE_STRIDE = 8, 16
#: A motion that is in none after so many turns, or so many times the median of the others, is looked at for new orbits,
#: and again each time after twice as long.
FIRST, PATIENT, EXPERIENCED = 96, 4.0, 20
#: Turns of such a look, and the distance of a return from which Newton's method begins, in the scales of the scene.
LOOK, NEAR = 16, 0.05
#: Distance of the same orbit found twice, in the scales of the scene.
SAME = 1e-4
#: Turns over which a motion that does not repeat is measured to tell it from others.
MEASURED_TURNS = 256
#: What tells motions apart that do not repeat.
TOLD = ("rms_x_m", "rms_y_m", "rms_phi_rad")


def same_orbit(one: Record, other: Record, scales: FloatArray) -> bool:
    """Whether two records of attractors are of one orbit."""
    if one["row"]["period"] != other["row"]["period"]:
        return False
    away = np.array(other["centres"]) - one["state"]
    away[:, 3:5] -= TURN * np.round(away[:, 3:5] / TURN)
    return bool(np.abs(away / scales).max(axis=1).min(initial=np.inf) < SAME)


class Follower:
    """Follows motions of a scene.

    Parameters
    ----------
    scene, longest
        The scene, and turns after which a motion is given up.
    known, history
        Records of attractors, to which it adds, and turns that motions have taken.
    """

    def __init__(self, scene: Scene, longest: int, known: Sequence[Record], history: Sequence[int] = ()) -> None:
        self.scene, self.longest, self.attractors = scene, longest, list(known)
        p = parameters(scene)
        self._scales, self._turn = state_scales(scene), TURN / scene.speed_scale
        self._seeker, self._engine = OrbitSeeker(scene), make_engine(scene, p)
        self._motion = Motion(scene, p, self._engine)
        self._inside, self._history = same_types(ellipsoid_of), list(history)
        self._pack()

    def close(self) -> None:
        """Free what the engines hold."""
        self._seeker.close()
        self._engine.close()

    def follow(self, start: FloatArray) -> Record:
        """Follow a motion from a full state: number of its attractor, or None and what there is to tell; turns."""
        motion = self._motion
        motion.reset(start)
        self._seeker.forget()
        state, longest = motion.automaton.run["state"], 4.0 * (LATE_STRIDE + 1) * self._turn
        turns, look = 0, FIRST
        if len(self._history) >= EXPERIENCED:
            look = max(FIRST, min(int(PATIENT * np.median(self._history)), self.longest // 2))
        while turns < self.longest and motion.now < self.longest * self._turn:
            stride = STRIDE if turns < FIRST else LATE_STRIDE
            motion.to_section(stride, longest)
            turns += stride
            if motion.outcome != "ok":
                return {"attractor": None, "turns": turns, "outcome": motion.outcome, "detail": motion.detail}
            place = self._inside(state, motion.system.index, *self._packed)
            found = None if place < 0 else self._owners[place]
            if found is None and turns >= look:
                found = self._discovered()
                turns, look = turns + LOOK + 1, 2 * look
            if found is not None:
                self._history.append(turns)
                return {"attractor": found, "turns": turns}
        return {"attractor": None, "turns": turns, **self._restless()}

    def adopt_at(self, state: FloatArray, period: int) -> int:
        """Do the same with a stable orbit near a full state; raises :class:`MissedError` where there is none."""
        return self.adopt(self._seeker.known_orbit(state, period))

    def adopt(self, orbit: KnownOrbit) -> int:
        """Return the number of an orbit among the attractors; one that is not there yet is added."""
        row = on_orbit(self.scene, orbit, 0.0, self._seeker.work).row
        record: Record = {"row": row, "state": orbit.state.tolist(), "centres": [], "forms": [], "systems": []}
        for number, known in enumerate(self.attractors):
            if same_orbit(record, known, self._scales):
                return number
        try:
            around = self._seeker.crossings(orbit.state, orbit.period)
        except MissedError:
            around = []
        record["radius"] = min((radius for _, radius in around), default=0.0)
        record["centres"] = [crossing.state.tolist() for crossing, _ in around] or [record["state"]]
        for crossing, radius in around:
            record["forms"].append((crossing.form / max(radius, 1e-150) ** 2).tolist())
            record["systems"].append(crossing.system)
        self.attractors.append(record)
        self._pack()
        return len(self.attractors) - 1

    def _pack(self) -> None:
        """Gather the ellipsoids of all attractors for compiled code, and whose they are."""
        sizes = [len(known["forms"]) for known in self.attractors]
        self._owners = np.repeat(np.arange(len(sizes)), sizes).tolist()
        centres, forms, systems = (
            [part for known in self.attractors if known["forms"] for part in known[name]]
            for name in ("centres", "forms", "systems")
        )
        self._packed = (
            np.array(centres, dtype=float).reshape(-1, 14),
            np.array(forms, dtype=float).reshape(-1, 14, 14),
            np.array(systems, dtype=np.int64),
        )

    def _discovered(self) -> int | None:
        """Return the number of the orbit that the motion surely comes to, known or new; None without one."""
        part = self._motion.go_round(LOOK, 4.0 * (LOOK + 2) * self._turn)
        points = section_points(part.measures, self.scene)
        if self._motion.outcome != "ok" or len(points) <= LOOK:
            return None
        if min(np.abs(points[-1] - points[-1 - n]).max() for n in range(1, LONGEST + 1)) > NEAR:
            return None
        orbit = self._seeker.seek(self._motion, points, 0)
        return None if orbit is None else self.adopt(orbit)

    def _restless(self) -> Record:
        """Tell what a motion is like that has come to no orbit."""
        motion = self._motion
        part = motion.go_round(MEASURED_TURNS, 2.0 * (MEASURED_TURNS + 2) * self._turn)
        found: dict[str, Any] = {"outcome": motion.outcome, "detail": motion.detail}
        if motion.outcome == "ok":
            row = row_of(measured(part, self.scene), self.scene)
            found |= {
                "state": motion.state.tolist(),
                "row": {name: row[name] for name in (*TOLD, "flight_fraction", "sync", PHASE_COLUMN)},
            }
        return found


def follow_starts(
    scene: Scene, plan: BasinsPlan, first: int, count: int, known: Sequence[Record], history: Sequence[int] = ()
) -> Record:
    """Follow some starts; return what became of each, and the attractors that were found besides the known ones.

    ``history`` are turns that others have taken.
    """
    with closing(Follower(scene, plan.longest_turns, known, history)) as follower:
        starts = [follower.follow(state) for state in states_of(scene, plan, range(first, first + count))]
        return {"starts": starts, "known": len(known), "found": follower.attractors[len(known) :]}


def followed_alone(scene: Scene, plan: BasinsPlan, number: int) -> Record:
    """Follow a start without what others have found: the ``row`` of what it comes to."""
    with closing(Follower(scene, plan.longest_turns, [])) as follower:
        found = follower.follow(states_of(scene, plan, [number])[0])
        own = found if found["attractor"] is None else follower.attractors[found["attractor"]]
        return {"row": {"motion": None, "period": 0, **own.get("row", {})}}


def representative(scene: Scene, state: list[float]) -> Record:
    """Measure and classify a motion that has come to no orbit in the time given."""
    frequency = scene.drive.largest_frequency
    plan = {"supply_frequency_hz": {"start": frequency, "stop": frequency}, "perturbation": 0.0}
    point = measure_point(scene, SweepPlan.model_validate(plan), state, (0,))
    del point.row["wall_s"]
    centres = [] if point.state is None else [point.state]
    return {"row": point.row, "state": point.state, "centres": centres, "forms": [], "radius": None}
