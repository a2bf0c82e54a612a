"""The motion that is reached at one value of a key, and how two of them differ."""

from __future__ import annotations

import math
import operator
import time
from contextlib import closing
from typing import Any, NamedTuple

import numpy as np

from vibroplat.config.plans import FREQUENCY
from vibroplat.config.questions import FindPlan
from vibroplat.config.scene import Scene
from vibroplat.continuation.newton import NEUTRAL
from vibroplat.continuation.orbit import TOLERANCE, orbit_near
from vibroplat.errors import VibroplatError
from vibroplat.hybrid.state import initial_state, perturbed
from vibroplat.integrate import make_engine
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.parameters import parameters
from vibroplat.motion.motion import Motion
from vibroplat.study.point import Point, lost, measure_point
from vibroplat.study.store import Record

#: Distance of an orbit from the motion that is on it, in the scales of the scene, at most.
ON_ORBIT = 0.1
_COMPARED = {">": operator.gt, ">=": operator.ge, "<": operator.lt, "<=": operator.le}


class Value(NamedTuple):
    """What was found at a value of the key.

    Attributes
    ----------
    at
        The value.
    stage
        Why it was looked at.
    row, state
        As of a point of a sweep.
    """

    at: float
    stage: str
    row: Record
    state: list[float] | None

    @property
    def failed(self) -> bool:
        """Whether nothing is known of the motion there."""
        return self.state is None

    @property
    def leaving(self) -> bool:
        """Whether it repeats on an unstable orbit, which it will leave."""
        return (self.row.get("multiplier_max") or 0.0) > 1.0 + NEUTRAL

    def outcome(self, plan: FindPlan) -> Any:
        """Return what is compared between two values: motion, synchronization, or whether the expression holds."""
        if plan.compared is not None:
            column, how, number = plan.compared
            return None if self.row.get(column) is None else bool(_COMPARED[how](self.row[column], number))
        sync = self.row["sync"]
        return sync if plan.outcome == "regime" else (sync, self.row["motion"], self.row["period"], self.leaving)

    @property
    def text(self) -> str:
        """The motion in words."""
        sync, motion, period = (self.row[name] for name in ("sync", "motion", "period"))
        parts = (sync, f"period {period}" if period else motion, "leaving an unstable orbit" if self.leaving else "")
        return ", ".join(filter(None, parts))


def apart(one: Value, other: Value, plan: FindPlan) -> float:
    """How much the measures of two values differ, as shares of them; that of the expression alone if there is one."""
    if plan.compared is not None:
        a, b = (value.row.get(plan.compared[0]) for value in (one, other))
        return math.inf if a is None or b is None else abs(a - b)
    amplitudes, speeds, phases = (
        np.array([[value.row[name] or 0.0 for name in names] for value in (one, other)])
        for names in (("rms_x_m", "rms_y_m"), ("excitation_frequency_hz",), ("phase_difference_rad",))
    )
    parts = [float(np.abs(a[1] - a[0]).max() / (np.hypot.reduce(a, axis=1).max() or 1.0)) for a in (amplitudes, speeds)]
    held = "none" not in (one.row["sync"], other.row["sync"])
    return max(*parts, abs(float(np.angle(np.exp(1j * (phases[1] - phases[0]))[0]))) / math.pi if held else 0.0)


def constant(scene: Scene) -> Scene:
    """Return the scene with the constant supply with which its program ends."""
    return scene if scene.drive.program is None else scene.replace({FREQUENCY: scene.drive.intervals[-1].frequency})


def evaluate(scene: Scene, plan: FindPlan, state: list[float] | None, times: int, key: tuple[int, ...]) -> Point:
    """Measure the motion that a scene reaches; see :func:`vibroplat.study.point.measure_point`.

    Without a state it begins with ``run.initial`` and follows the drive's program to its last entry. ``times`` is how
    many times the plan's settling and measuring time it has, ``key`` determines the perturbation. Motion that repeats
    without a known orbit is looked at once more: it may be leaving an unstable one.
    """
    began, share = time.perf_counter(), scene.start_perturbation
    if state is None:  # as a run of the scene begins
        begun = _followed(scene, perturbed(initial_state(scene), scene, share, key))
        if isinstance(begun, Point):
            return begun
        state, share = begun, 0.0
    settled = constant(scene)
    point = measure_point(settled, plan.measuring(times, share), state, key)
    row = point.row
    if point.state is not None and row["period"] and row.get("multiplier_max") is None:
        try:
            orbit = orbit_near(settled, point.state, row["period"], TOLERANCE)
        except VibroplatError:
            pass
        else:
            if orbit.distance < ON_ORBIT and orbit.multipliers.size:
                row["multiplier_max"] = float(abs(orbit.multipliers[0]))
    row["wall_s"] = time.perf_counter() - began
    return point


def _followed(scene: Scene, start: FloatArray) -> list[float] | Point:
    """Follow the program of a scene from a full state to its last entry; the state there, or how it failed."""
    if scene.drive.program is None:
        return [float(value) for value in start]
    p = parameters(scene)
    with closing(make_engine(scene, p)) as engine:
        motion = Motion(scene, p, engine, start)
        motion.to_time(scene.drive.program[-1].t_s)
        if motion.outcome != "ok":
            return Point(**lost(motion.detail, motion.outcome))
        state = motion.state.copy()
    state[3:5] %= 2.0 * math.pi
    return [float(value) for value in state]
