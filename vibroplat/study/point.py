"""One point of a sweep: the motion settles, is measured and classified."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from vibroplat.columns import COUNT, TEXT, Column, Columns, split
from vibroplat.config.circular import shown_angle
from vibroplat.config.coordinates import TURN
from vibroplat.config.engine_choice import FAILED, with_second_engine
from vibroplat.config.plans import SweepPlan
from vibroplat.config.plausibility import WARNING
from vibroplat.config.scene import Scene
from vibroplat.extensions import load_provided
from vibroplat.hybrid.modes import IMPACT
from vibroplat.hybrid.state import Automaton, initial_state, perturb_state, state_scales
from vibroplat.integrate import make_engine
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.parameters import parameters
from vibroplat.motion.motion import Observer, Simulator
from vibroplat.observe.conveying import OF_SPEED
from vibroplat.observe.measures import SECTION_POINTS, WITH_EXTREMES
from vibroplat.observe.section import section_points, section_rows, whole_periods
from vibroplat.report.data_sheet import columns
from vibroplat.report.notes import notes_on_measures, stiffness
from vibroplat.report.summary import (
    INACCURATE,
    MAX_DRIFT,
    MeasuredInterval,
    block_errors,
    inaccuracy,
    measure,
    synchronization,
)
from vibroplat.study.classification import (
    BLOCKS,
    MotionClass,
    classify,
    compared_values,
    rare_events,
    transience,
)
from vibroplat.study.pool import Task
from vibroplat.study.settling import KnownOrbit, OrbitDetector, SettlingResult, settle
from vibroplat.study.store import Record
from vibroplat.system.memory import NO_MORE

#: Distance from −π (rad) up to which a phase difference is reported as π: a few times the error left by settling.
ANTIPHASE = 5e-3
#: The same of orbits.
ANTIPHASE_OF_ORBITS = 1e-6
#: Fewest periods that are measured of motion that repeats: each half must show that it does.
MIN_PERIODS = 4
#: A motion whose neighbours converge will repeat: it may settle this many times ``max_settle_s``.
SETTLE_EXTENSION = 4.0
#: Aperiodic motion that changes from half to half of its measuring interval is measured again, so many times as long.
LONGER = 3
#: How many of the last points of the Poincaré section and impacts a bifurcation diagram shows at each point.
DIAGRAM_POINTS = 64

#: Measures of a point in the order of the table.
MOTION_MEASURES = (
    *("excitation_frequency_hz", "frequency_split_hz", "rms_x_m", "rms_y_m", "rms_phi_rad", "amplitude_y_m"),
    *("phase_difference_rad", "phase_coherence"),
)
LOAD_MEASURES = (
    *("flight_fraction", "impacts_per_period", "gap_max_m"),
    *("contact_force_max_n", "impulse_max_n_s", "motor_power_w", "energy_residual"),
)
MEASURED = (*MOTION_MEASURES, *LOAD_MEASURES)
#: Measures that have a standard error if the motion does not repeat, and the columns of these errors.
ERRORS = {
    name: name.replace(base := split(name)[0], f"{base}_error")
    for name in (
        *("excitation_frequency_hz", "rms_x_m", "rms_y_m", "rms_phi_rad", "phase_difference_rad"),
        *("flight_fraction", "impacts_per_period", "motor_power_w", "amplitude_y_m"),
        *("contact_force_max_n", "gap_max_m", "impulse_max_n_s"),
    )
}

#: Columns that a point has besides :data:`vibroplat.report.summary.MEASURES`.
POINT: Columns = {
    "relative_rotation": Column("counter-rotating or co-rotating exciters", kind=TEXT),
    "sync": Column(
        "synchronization of the exciters",
        "antiphase: phase difference within pi/3 of pi; in-phase: within pi/3 of 0; intermediate: between; none: "
        "it drifts or is incoherent. Counter-rotating exciters in antiphase vibrate the platform along y; in "
        "phase, along x with rocking",
        kind=TEXT,
    ),
    "motion": Column(
        "kind of motion",
        "periodic: repeats after period turns; otherwise chaotic or quasi-periodic, by the largest Lyapunov "
        "exponent, or undecided; non-periodic if there is no exponent, as with transport",
        kind=TEXT,
    ),
    "period": Column("period of the motion, in turns of exciter 1", "0: none found", kind=COUNT),
    "multiplier_max": Column(
        "magnitude of the largest Floquet multiplier",
        "without the trivial multiplier 1; empty if the orbit is not known",
    ),
    "lyapunov_per_s": Column("largest Lyapunov exponent", "of aperiodic motion"),
    "lyapunov_error_per_s": Column("standard error of lyapunov_per_s"),
    **{
        error: Column(
            f"standard error of {name}",
            "from the scatter over blocks of aperiodic motion; changes too rare for the measuring interval are not "
            "covered; empty if the motion is undecided or may be a transient, and for events that do not occur in each "
            "half of the measuring interval",
        )
        for name, error in ERRORS.items()
    },
    "settle_s": Column("settling time before the measuring interval"),
    "outcome": Column("ok, or the reason why the point ended early or is inaccurate", kind=TEXT),
    "detail": Column("time, place and cause, unless the outcome is ok; or why the motion is undecided", kind=TEXT),
    "notes": Column("warnings", kind=TEXT),
    "simulated_s": Column("simulated time"),
    "wall_s": Column("wall-clock time of the computation"),
}


@dataclass(frozen=True)
class SweepPoint:
    """A finished point.

    Attributes
    ----------
    row
        Values by column of the sweep table.
    state
        Full state at its end, with which the next point begins, shape (14,); None if the motion ended early or is
        inaccurate.
    section_y, impact_speeds
        y at whole turns of exciter 1 (m) and speeds of the impacts (m/s), for a bifurcation diagram.
    """

    row: dict[str, Any]
    state: list[float] | None
    section_y: list[float] = field(default_factory=list)
    impact_speeds: list[float] = field(default_factory=list)


def point_task(scene: Scene, plan: SweepPlan, state: list[float] | None, key: tuple[int, ...]) -> Task:
    """Return the task of :func:`measure_point`; a point whose worker is lost has the outcome ``worker-lost``."""
    return Task(measure_point, (scene, plan, state, key), failed_record)


def failed_record(reason: str, outcome: str = "worker-lost") -> Record:
    """Return the record of a point whose worker was lost, or of which nothing is known for another reason."""
    work = {"steps": 0, "residual_calls": 0, "events": 0, "simulated_s": 0.0, "settle_s": 0.0, "wall_s": 0.0}
    return vars(SweepPoint({"outcome": outcome, "detail": reason} | work, None))


def measure_point(scene: Scene, plan: SweepPlan, state: list[float] | None, key: tuple[int, ...]) -> SweepPoint:
    """Settle and measure one point of a sweep.

    Parameters
    ----------
    scene
        The scene with the point's frequency and values.
    plan
        How to settle and measure.
    state
        Full state at the end of the point before, shape (14,); without it the point begins with ``run.initial``.
    key
        Numbers that, with the plan's seed, determine the perturbation; see
        :meth:`vibroplat.study.branches.SweepBranch.perturbation_key`.

    Returns
    -------
    SweepPoint
        With outcome ``out-of-memory`` if there is not enough for it.
    """
    return with_second_engine(
        scene,
        lambda tried: _measure_by_engine(tried, plan, state, key),
        has_failed,
        reason=lambda point: (point.row, "detail"),
    )


def has_failed(point: object) -> bool:
    """Return whether a point is one for whose outcome the engine is to blame."""
    return isinstance(point, SweepPoint) and point.row["outcome"] in FAILED


def _measure_by_engine(scene: Scene, plan: SweepPlan, state: list[float] | None, key: tuple[int, ...]) -> SweepPoint:
    """Settle and measure one point of a sweep by one engine (:func:`measure_point`)."""
    began = time.perf_counter()
    try:
        start = initial_state(scene) if state is None else np.array(state)
        start = perturb_state(start, scene, plan.perturbation, (plan.seed, *key))
        if plan.settle_by == "section" or scene.transport is not None:
            point = _measure_by_simulation(scene, plan, start)
        else:
            with closing(load_provided("NewtonOrbitDetector")(scene)) as detector:
                point = _settle_and_measure(scene, plan, start, detector)
    except MemoryError:
        return SweepPoint(**failed_record(NO_MORE, "out-of-memory"))
    point.row["wall_s"] = time.perf_counter() - began
    return point


def _settle_and_measure(scene: Scene, plan: SweepPlan, start: FloatArray, detector: OrbitDetector) -> SweepPoint:
    """Search for the orbit that a motion converges to at once, and while it settles; measure what does not converge."""
    orbit = detector.first(start)
    if orbit is not None and detector.end_state is not None:
        return on_orbit(scene, orbit, detector.end_state[1], detector.work)
    return _measure_by_simulation(scene, plan, *(detector.end_state or (start, 0.0)), detector)


def on_orbit(
    scene: Scene, orbit: KnownOrbit, settled: float, work: Mapping[str, int | None], events: int = 0
) -> SweepPoint:
    """Tell what is known of the orbit that a motion comes to, which has settled for a time (s), with some events."""
    measures = orbit.measures
    row = _row_of_work(scene, settled, settled + orbit.period * orbit.turn, events + measures["events"], work)
    doubt = inaccuracy(measures, scene)
    if doubt:
        row |= {"outcome": INACCURATE, "detail": doubt, "energy_residual": measures["energy_residual"]}
        return SweepPoint(row, None)
    row |= row_of(measures, scene, near=ANTIPHASE_OF_ORBITS) | columns_of(MotionClass("periodic", orbit.period))
    row["multiplier_max"] = orbit.multiplier
    return SweepPoint(row, orbit.state.tolist(), orbit.section_y, orbit.impact_speeds)


def _measure_by_simulation(
    scene: Scene,
    plan: SweepPlan,
    start: FloatArray,
    began: float = 0.0,
    detector: OrbitDetector | None = None,
) -> SweepPoint:
    """Follow a motion from a full state and a time (s) until it has settled; see :func:`_settle_and_measure`."""
    p = parameters(scene)
    impacts = _Impacts() if plan.kind == "bifurcation" else None
    with closing(make_engine(scene, p)) as engine:
        motion = Simulator(scene, p, engine, start, began)
        settling, part, kind = _settle_then_measure(motion, plan, [] if impacts is None else [impacts], detector)
        work = engine.work
        stiff = stiffness(scene, engine.name, work["steps"], motion.restarts, motion.now - began)
    if settling.orbit is not None:
        return on_orbit(scene, settling.orbit, settling.seconds, work, motion.events)
    row = _row_of_work(scene, settling.seconds, motion.now, motion.events, work)
    row |= {"outcome": motion.outcome, "detail": motion.detail}
    final: list[float] | None = None
    heights: list[float] = []
    measures = whole_periods(part.measures, (kind and kind.period) or 1)
    values = measure(part._replace(measures=measures), scene)
    doubt = inaccuracy(values, scene) if kind is not None else ""
    if doubt:
        row |= {"outcome": INACCURATE, "detail": doubt, "energy_residual": values["energy_residual"]}
    elif kind is not None:
        end = motion.state.copy()
        end[3:5] %= TURN
        final = end.tolist()
        blocks = () if kind.drifts else part.blocks
        errors = {ERRORS[name]: error for name, error in block_errors(blocks, tuple(ERRORS)).items()}
        if blocks and kind.motion != "quasi-periodic":
            errors |= dict.fromkeys(ERRORS[name] for name in rare_events(compared_values(blocks)))
        row |= row_of(values, scene, errors, settling.slip, period=kind.period) | columns_of(kind)
        row["notes"] = "; ".join(note for note in (row["notes"], kind.note, stiff) if note)
        if impacts is not None:
            points = section_points(part.measures, scene)
            heights = (points[-DIAGRAM_POINTS:, 1] * state_scales(scene)[1]).tolist()
    return SweepPoint(row, final, heights, list(impacts.speeds) if final and impacts else [])


class _Impacts:
    """Collects the speeds of the last impacts (m/s) while a motion advances."""

    def __init__(self) -> None:
        self.speeds: deque[float] = deque(maxlen=DIAGRAM_POINTS)

    def read(self, h: Automaton) -> None:
        """Take the impacts from the list of events."""
        events = h.events[: h.run["events"]]
        self.speeds.extend((-events["rate_before"][events["kind"] == IMPACT]).tolist())


def _settle_then_measure(
    motion: Simulator,
    plan: SweepPlan,
    observers: Sequence[Observer],
    detector: OrbitDetector | None = None,
) -> tuple[SettlingResult, MeasuredInterval, MotionClass | None]:
    """Settle, measure and classify a motion; settle again if it turns out not to have settled.

    Motion that does not repeat is measured in blocks, from which the errors of its measures follow. A motion that
    ended early has no kind.
    """
    limit = plan.max_settle_s
    while True:
        settling = settle(motion, plan, limit, detector)
        if settling.orbit is not None:  # it is measured already
            return settling, motion.advance(0.0, scope=SECTION_POINTS), None
        if settling.reason == "maximum":
            seconds = BLOCKS * plan.measure_s
            part = motion.advance(seconds, blocks=BLOCKS, observers=observers, scope=WITH_EXTREMES)
        else:
            part = _measure(motion, plan.measure_s, settling, observers)
        if motion.outcome != "ok":
            return settling, part, None
        points = section_points(part.measures, motion.scene)
        kind = classify(motion.scene, plan, settling, points, motion.state, last=limit > plan.max_settle_s)
        if kind is not None:
            break
        if settling.reason == "maximum":
            limit = SETTLE_EXTENSION * plan.max_settle_s
    if kind.period == 0 and kind.motion != "undecided" and part.blocks:
        part, longer_kind = _measure_longer(motion, plan, settling, part, kind, observers)
        if longer_kind is None:
            return settling, part, None
        kind, points = longer_kind, section_points(part.measures, motion.scene)
    orbit = detector.detect(motion, points, kind.period) if kind.period and detector is not None else None
    if orbit is not None:
        return settling._replace(seconds=motion.now, orbit=orbit), part, kind
    if kind.period and part.blocks:  # it repeats after all: measure whole periods
        if settling.reason == "maximum":
            settling = settling._replace(seconds=motion.now)
        times = section_rows(part.measures)["t"]
        turn = float(times[-1] - times[0]) / (len(times) - 1)
        part = _measure(motion, plan.measure_s, settling._replace(period=kind.period, turn=turn), observers)
    return settling, part, kind if motion.outcome == "ok" else None


def _measure_longer(
    motion: Simulator,
    plan: SweepPlan,
    settling: SettlingResult,
    part: MeasuredInterval,
    kind: MotionClass,
    observers: Sequence[Observer],
) -> tuple[MeasuredInterval, MotionClass | None]:
    """Measure an aperiodic motion LONGER if it changes from half to half; it may be a transient if it still does."""
    scene = motion.scene
    if not transience(scene, plan, kind, compared_values(part.blocks)):
        return part, kind
    blocks = LONGER * BLOCKS
    part = motion.advance(blocks * plan.measure_s, blocks=blocks, observers=observers, scope=WITH_EXTREMES)
    if motion.outcome != "ok":
        return part, None
    again = classify(scene, plan, settling, section_points(part.measures, scene), motion.state, last=True)
    if again is not None and again.period == 0 and again.motion != "undecided":
        changes = transience(scene, plan, again, compared_values(part.blocks))
        if changes:
            note = f"{WARNING}may be a transient: {changes} changes as it is measured, so there are no errors"
            again = again._replace(drifts=True, note=note)
    return part, again


def _measure(
    motion: Simulator, min_seconds: float, settling: SettlingResult, observers: Sequence[Observer]
) -> MeasuredInterval:
    """Measure a motion for at least a time (s), and for whole periods if it repeats."""
    if settling.turn == 0.0:
        return motion.advance(min_seconds, observers=observers, scope=WITH_EXTREMES)
    turns = settling.period * max(math.ceil(min_seconds / (settling.period * settling.turn)), MIN_PERIODS)
    return motion.advance_turns(turns, 2.0 * (turns + 1) * settling.turn, observers, scope=WITH_EXTREMES)


def _row_of_work(
    scene: Scene, settled: float, simulated: float, events: int, work: Mapping[str, int | None]
) -> dict[str, Any]:
    """Return the columns that do not depend on what was measured, of a motion that has not ended early."""
    return {
        "relative_rotation": scene.rotation,
        "settle_s": settled,
        "outcome": "ok",
        "detail": "",
        "steps": work["steps"],
        "residual_calls": work["residual_calls"],
        "events": events,
        "simulated_s": simulated,
    }


def row_of(
    measures: dict[str, Any],
    scene: Scene,
    errors: Mapping[str, float | None] = MappingProxyType({}),
    slip: float = 0.0,
    near: float = ANTIPHASE,
    period: int | None = None,
) -> dict[str, Any]:
    """Return the columns of measures that were found: with their errors, the notes on them and the synchronization.

    ``slip`` is the change of the phase difference while the motion settled (rad), if it has not become periodic. What
    is no farther than ``near`` from −π (rad), or than two standard errors if there is one, is π. Without a ``period``
    (0) material may run away, and has no speed.
    """
    row: dict[str, Any] = {name: measures[name] for name in (*MEASURED, *columns(scene))} | dict(errors)
    error = errors.get(ERRORS["phase_difference_rad"])
    row |= shown_statistics(measures, scene, near if error is None else max(ANTIPHASE_OF_ORBITS, 2.0 * error))
    if scene.transport is not None and scene.transport.runs_away and period == 0:
        row |= dict.fromkeys(OF_SPEED)
    row["notes"] = "; ".join(notes_on_measures(scene, measures))
    if abs(slip) > MAX_DRIFT:
        row["sync"] = "none"
    return row


def shown_statistics(measures: Mapping[str, Any], scene: Scene, near: float) -> dict[str, Any]:
    """Return the statistics that tables show in another way than they were found, and the synchronization.

    The gap of material that never flew is 0; what is no farther than ``near`` from −π (rad) is π.
    """
    gap, phase = measures["gap_max_m"], measures["phase_difference_rad"]
    return {
        "gap_max_m": 0.0 if gap is None and scene.has_contact else gap,
        "phase_difference_rad": None if phase is None else shown_angle(phase, near),
        "sync": synchronization(measures),
    }


def columns_of(kind: MotionClass) -> dict[str, Any]:
    """Return the columns of the kind of motion; ``detail`` says why it is undecided."""
    row: dict[str, Any] = {"motion": kind.motion, "period": kind.period, "detail": kind.reason}
    if kind.exponent is not None and math.isfinite(kind.exponent.value):
        row |= {"lyapunov_per_s": kind.exponent.value, "lyapunov_error_per_s": kind.exponent.error}
    return row
