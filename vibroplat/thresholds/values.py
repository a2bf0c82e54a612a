"""The motion at one value of a key, and the difference of two motions."""

from __future__ import annotations

import math
import operator
import time
from collections.abc import Sequence
from contextlib import closing
from typing import Any, NamedTuple

import numpy as np

from vibroplat.columns import PHASE_COLUMN, is_angle, name_regime
from vibroplat.config.circular import beyond, bound_scale
from vibroplat.config.coordinates import TURN
from vibroplat.config.engine_choice import with_second_engine
from vibroplat.config.plans import FREQUENCY
from vibroplat.config.scene import Scene
from vibroplat.config.study_plans import FindPlan
from vibroplat.continuation.orbit import TOLERANCE, orbit_near
from vibroplat.errors import VibroplatError
from vibroplat.hybrid.state import initial_state, perturb_state
from vibroplat.integrate import make_engine
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.parameters import parameters
from vibroplat.motion.motion import Simulator
from vibroplat.motion.run import simulate
from vibroplat.report.notes import slow_motors
from vibroplat.report.synchronization import STAYING_TURNS
from vibroplat.shooting.multipliers import UNIT_CIRCLE_DISTANCE
from vibroplat.study.classification import NOT_SETTLED
from vibroplat.study.point import (
    ANTIPHASE,
    ANTIPHASE_OF_ORBITS,
    ERRORS,
    SweepPoint,
    failed_record,
    has_failed,
    measure_point,
)
from vibroplat.study.store import Record

#: Distance of an orbit from the motion that is on it, in scaled units, at most.
MAX_ORBIT_DISTANCE = 0.1
#: Number of joint standard errors up to which two measures may differ by chance, and the same of measures without
#: errors, relative to them: ten times what remains of a motion after settling on its orbit.
NOISE_ERRORS, SETTLING_ERROR = 3.0, 1e-7
#: Ratio to which the difference across a change falls if the measure is continuous there, and halvings after the first
#: move of both ends until then: a measure that grows with the square root of the distance falls to 0.18.
MEETING_RATIO, MEETING_HALVINGS = 0.25, 6
#: Kinds of thresholds at which measures meet: the level is crossed, or an angle passes the opposite of the level.
LEVEL_CROSSING, OPPOSITE_CROSSING = "level-crossing", "opposite-crossing"
_COMPARED = {">": operator.gt, ">=": operator.ge, "<": operator.lt, "<=": operator.le}


class ScanPoint(NamedTuple):
    """What was found at a value of the key.

    Attributes
    ----------
    value
        Value of the key.
    reason
        Why it was evaluated.
    row, state
        As of a point of a sweep.
    seed
        Seed of the perturbation of its start.
    """

    value: float
    reason: str
    row: Record
    state: list[float] | None
    seed: int = 0

    @property
    def failed(self) -> bool:
        """Whether nothing is known of the motion there."""
        return self.state is None

    @property
    def leaving(self) -> bool:
        """Whether it repeats on an unstable orbit, which it will leave."""
        return (self.row.get("multiplier_max") or 0.0) > 1.0 + UNIT_CIRCLE_DISTANCE

    def outcome(self, plan: FindPlan) -> Any:
        """Return what is compared between two values: motion, synchronization, or whether the expression holds."""
        if plan.compared is not None:
            column, how, number = plan.compared
            measure = self.row.get(column)
            return None if measure is None else bool(_COMPARED[how](beyond(column, measure, number), 0.0))
        sync = self.row["sync"]
        return sync if plan.compare == "regime" else (sync, self.row["motion"], self.row["period"], self.leaving)

    @property
    def unsettled(self) -> bool:
        """Whether it was measured in a transient: it leaves an unstable orbit, drifts, or has no clear class.

        Motion without turns of exciter 1 has no period, rather than 0: the exciter hangs.
        """
        return self.leaving or (self.row.get("motion") == "undecided" and self.row.get("period") is not None)

    def is_classified(self, plan: FindPlan) -> bool:
        """Whether it has an outcome.

        It has none if the run failed, if the motion is undecided and attractors are compared, or if an angle may be on
        either side.
        """
        undecided = plan.of_motion and self.row.get("motion") == "undecided"
        return not (self.failed or undecided or self.is_either_side(plan))

    @property
    def pi_margin(self) -> float:
        """How far the phase difference may be above −π although its row shows π (rad); 0 if the row does not."""
        return self.row.get("pi_margin", ANTIPHASE) if self.row.get(PHASE_COLUMN) == math.pi else 0.0

    def is_either_side(self, plan: FindPlan) -> bool:
        """Whether a phase difference shown as π may be on either side of the level, or of the level's opposite."""
        if plan.compared is None or plan.compared[0] != PHASE_COLUMN:
            return False
        away = abs(beyond(PHASE_COLUMN, math.pi, plan.compared[2]))
        return bool(min(away, math.pi - away) < self.pi_margin)

    @property
    def hangs(self) -> bool:
        """Whether an exciter stays far below its synchronous speed."""
        return bool(self.row.get("slow"))

    @property
    def text(self) -> str:
        """The motion in words."""
        unsettled = {"motion": "not settled"} if self.row.get("detail") == NOT_SETTLED else {}
        return name_regime({**self.row, **unsettled}) + ", leaving an unstable orbit" * self.leaving


def relative_difference(one: ScanPoint, other: ScanPoint, plan: FindPlan) -> float:
    """How much the measures of two values differ, relative to them; that of the expression alone if there is one."""
    if plan.compared is not None:
        a, b = (value.row.get(plan.compared[0]) for value in (one, other))
        return math.inf if a is None or b is None else float(abs(beyond(plan.compared[0], a, b)))
    amplitudes, speeds, phases = (
        np.array([[value.row[name] or 0.0 for name in names] for value in (one, other)])
        for names in (("rms_x_m", "rms_y_m"), ("excitation_frequency_hz",), (PHASE_COLUMN,))
    )
    parts = [float(np.abs(a[1] - a[0]).max() / (np.hypot.reduce(a, axis=1).max() or 1.0)) for a in (amplitudes, speeds)]
    synchronized = "none" not in (one.row["sync"], other.row["sync"])
    return max(*parts, float(abs(beyond(PHASE_COLUMN, *phases[::-1, 0]))) / math.pi if synchronized else 0.0)


def scale_of(one: ScanPoint, other: ScanPoint, plan: FindPlan) -> float:
    """Return to what :func:`relative_difference` is relative: the column of the expression, or 1 for ratios."""
    if plan.compared is None:
        return 1.0
    column = plan.compared[0]
    return max(bound_scale(column, float(value.row.get(column) or 0.0)) for value in (one, other))


def has_errors(one: ScanPoint, other: ScanPoint, plan: FindPlan) -> bool:
    """Return whether standard errors tell how far two values differ by chance, as they do where motion is chaotic."""
    return uncertainty(one, other, plan) > SETTLING_ERROR * scale_of(one, other, plan)


def uncertainty(one: ScanPoint, other: ScanPoint, plan: FindPlan) -> float:
    """Return up to which :func:`relative_difference` differs by chance, as far as standard errors tell."""
    columns = ("rms_x_m", "rms_y_m", "excitation_frequency_hz", "phase_difference_rad")
    names = columns if plan.compared is None else plan.compared[:1]
    errors = {name: [value.row.get(ERRORS.get(name, "")) or 0.0 for value in (one, other)] for name in names}
    parts = {name: math.hypot(*pair) for name, pair in errors.items()}
    margin = max(one.pi_margin, other.pi_margin)
    parts = {name: max(part, margin * is_angle(name)) for name, part in parts.items()}
    if plan.compared is None:
        amplitude = max(math.hypot(*(value.row[name] or 0.0 for name in columns[:2])) for value in (one, other))
        speed = max(value.row[columns[2]] or 0.0 for value in (one, other))
        scales = (amplitude, amplitude, speed, math.pi)
        parts = {name: parts[name] / (scale or 1.0) for name, scale in zip(columns, scales, strict=True)}
    return max(NOISE_ERRORS * max(parts.values()), SETTLING_ERROR * scale_of(one, other, plan))


def measures_meet(brackets: Sequence[tuple[ScanPoint, ScanPoint]], plan: FindPlan) -> bool | None:
    """Return whether the measures on both sides of a change meet as the interval between them is halved.

    Parameters
    ----------
    brackets
        The ends of the interval, before the first halving and after each.
    plan
        What is compared.

    Returns
    -------
    bool or None
        True if their difference has fallen to :data:`MEETING_RATIO` of what it was, or below its uncertainty. False if
        it has not although both ends have moved long enough. A measure that leaves its value at the threshold as
        steeply as a square root falls to sqrt(2 / 2**MEETING_HALVINGS) of it by then. None if neither is known yet.
    """
    before, now = (relative_difference(*brackets[index], plan) for index in (0, -1))
    if not math.isfinite(now):
        return False
    if now <= max(MEETING_RATIO * before if len(brackets) > 1 else 0.0, uncertainty(*brackets[-1], plan)):
        return True
    since = brackets[: max(len(brackets) - MEETING_HALVINGS, 1)]
    return False if all(since[0][end].value != since[-1][end].value for end in (0, 1)) else None


def kind_of_crossing(one: ScanPoint, other: ScanPoint, plan: FindPlan) -> str:
    """Return the kind of a change at which measures meet; an angle may pass half a turn from the level."""
    if plan.compared is not None and is_angle(plan.compared[0]):
        column, _, level = plan.compared
        if sum(abs(beyond(column, value.row[column], level)) for value in (one, other)) > math.pi:
            return OPPOSITE_CROSSING
    return LEVEL_CROSSING


def sure_around(
    low: ScanPoint, high: ScanPoint, values: Sequence[ScanPoint], plan: FindPlan
) -> tuple[ScanPoint, ScanPoint]:
    """Return both ends of an interval, or the nearest values beyond them if an angle there may be on either side."""
    sure = [value for value in values if not (value.failed or value.is_either_side(plan))]
    if low.is_either_side(plan):
        low = max((one for one in sure if one.value < low.value), key=lambda one: one.value, default=low)
    if high.is_either_side(plan):
        high = min((one for one in sure if one.value > high.value), key=lambda one: one.value, default=high)
    return low, high


def with_final_supply(scene: Scene) -> Scene:
    """Return the scene with the constant supply with which its program ends."""
    return scene if scene.drive.program is None else scene.replace({FREQUENCY: scene.drive.intervals[-1].frequency})


def evaluate(scene: Scene, plan: FindPlan, state: list[float] | None, times: int, key: tuple[int, ...]) -> SweepPoint:
    """Measure the motion that a scene reaches; see :func:`vibroplat.study.point.measure_point`.

    Without a state it begins with ``run.initial`` and follows the drive's program to its last entry. ``times`` is how
    many times the plan's settling and measuring time it has, ``key`` determines the perturbation. Motion that repeats
    without a known orbit is evaluated once more: it may be leaving an unstable one.
    """
    began, perturbation = time.perf_counter(), scene.start_perturbation
    if state is None:  # as a run of the scene begins
        begin = perturb_state(initial_state(scene), scene, perturbation, key)
        start = with_second_engine(scene, lambda tried: _follow_program(tried, begin), has_failed)
        if isinstance(start, SweepPoint):
            return start
        state, perturbation = start, 0.0
    settled = with_final_supply(scene)
    point = measure_point(settled, plan.measuring(times, perturbation), state, key)
    row = point.row
    error = row.get(ERRORS[PHASE_COLUMN])
    row["pi_margin"] = ANTIPHASE if error is None else max(ANTIPHASE_OF_ORBITS, 2.0 * error)
    if row.get("multiplier_max") is not None:
        row["pi_margin"] = ANTIPHASE_OF_ORBITS
    if point.state is not None:
        measured = {"measured_from_s": row["settle_s"], "measured_to_s": row["simulated_s"]}
        row["slow"] = bool(slow_motors(settled, row | measured))
    if point.state is not None and row["period"] and row.get("multiplier_max") is None:
        try:
            orbit = orbit_near(settled, point.state, row["period"], TOLERANCE)
        except VibroplatError:
            pass
        else:
            if orbit.distance < MAX_ORBIT_DISTANCE and orbit.multipliers.size:
                row["multiplier_max"] = float(abs(orbit.multipliers[0]))
    row["wall_s"] = time.perf_counter() - began
    return point


def start_time(scene: Scene, seconds: float) -> Record:
    """Return the time from which the exciters of a scene stay synchronized (s), if they do so within so many seconds.

    Half of the run is needed to see whether they do.
    """
    turns = TURN * STAYING_TURNS / scene.speed_scale
    last = 0.0 if scene.drive.program is None else scene.drive.program[-1].t_s
    found = simulate(scene.replace({"run.duration_s": 2.0 * (last + seconds + 2.0 * turns)}), keep="summary").summary
    return {"seconds": None if slow_motors(scene, found) else found["synchronized_at_s"]}


def _follow_program(scene: Scene, start: FloatArray) -> list[float] | SweepPoint:
    """Follow the program of a scene from a full state to its last entry; the state there, or how it failed."""
    if scene.drive.program is None:
        return [float(value) for value in start]
    p = parameters(scene)
    with closing(make_engine(scene, p)) as engine:
        motion = Simulator(scene, p, engine, start)
        motion.to_time(scene.drive.program[-1].t_s)
        if motion.outcome != "ok":
            return SweepPoint(**failed_record(motion.detail, motion.outcome))
        state = motion.state.copy()
    state[3:5] %= TURN
    return [float(value) for value in state]
