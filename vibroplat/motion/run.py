"""A run: build the automaton of a scene, let an engine drive it, record what was asked for."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from functools import partial
from typing import Any

import numpy as np
from pydantic import InstanceOf

from vibroplat.columns import COUNT, TEXT, Column, Columns, name_regime
from vibroplat.config.arguments import TrueOrKeys, validated
from vibroplat.config.circular import wrap
from vibroplat.config.coordinates import TURN
from vibroplat.config.digits import given, percent, quantity
from vibroplat.config.engine_choice import FAILED, both_reasons, engines_to_try
from vibroplat.config.plausibility import WARNING, notes_on_input, set_in_vain
from vibroplat.config.scene import Scene, SceneArgument
from vibroplat.hybrid.loop import automaton
from vibroplat.hybrid.state import CUBIC, Automaton, empty_steps, force_noise, static_rest
from vibroplat.inspection.balance import phases_at, supply_at
from vibroplat.integrate import make_engine
from vibroplat.integrate.interface import WORK, Engine
from vibroplat.model.parameters import Parameters, parameters
from vibroplat.motion.initial_condition import Start, initial_condition
from vibroplat.motion.motion import Observer, Simulator
from vibroplat.motion.recorder import Files, Keep, Recorder, Sink, SinkArgument
from vibroplat.motion.variation import key_tuple, parameter_directions
from vibroplat.observe.section import (
    MAX_PERIOD,
    latest_repetition,
    section_points,
    section_rows,
    whole_periods,
)
from vibroplat.observe.statistics import Statistics
from vibroplat.observe.tables import named_derivative, require_room
from vibroplat.observe.variation import Variation
from vibroplat.report.data_sheet import SHEET, WHOLE, columns, whole_run
from vibroplat.report.notes import (
    MIN_STROKE,
    change,
    drift,
    free_swing,
    notes_on_measures,
    slow_motors,
    stiffness,
    symmetry,
    unfinished_stop,
)
from vibroplat.report.summary import INACCURATE, MEASURES, MeasuredInterval, inaccuracy, measure, synchronization
from vibroplat.report.synchronization import stays_synchronized
from vibroplat.report.transients import Transient, transients
from vibroplat.results.run import RunResult
from vibroplat.results.run_answer import SETTLED, kind_of_motion, repetition_text
from vibroplat.results.tables import TableFile

#: The measured part is what follows this fraction of the duration, cut to whole turns of exciter 1.
SETTLE_FRACTION = 0.5
#: Measured turns from which a motion has shown itself whether it stays; distance (rad) of its phase difference from one
#: that the mean torques hold.
MANY_TURNS, OTHER_PHASE = 2000, 1.0

#: The summary of a run.
SUMMARY: Columns = {
    "name": Column("name of the scene", kind=TEXT),
    "outcome": Column("ok, or the reason why the run ended early or is inaccurate", kind=TEXT),
    "detail": Column("time, place and cause, unless the outcome is ok; or why a period is undecided", kind=TEXT),
    "begins_s": Column("time at which the run begins"),
    "simulated_s": Column("simulated time"),
    "relative_rotation": Column("counter-rotating or co-rotating exciters", kind=TEXT),
    "perturbation": Column("random change of the initial rates", "scaled units"),
    "static_sag_m": Column(
        "static sag of the springs", "the machine rests at y = -static_sag_m; figures show y relative to this"
    ),
    "sync": Column(
        "synchronization of the exciters", "as in a sweep: antiphase, in-phase, intermediate or none", kind=TEXT
    ),
    "motion": Column(
        "kind of motion",
        "periodic; non-periodic: no period is found; undecided: a transient is left, or too few turns show no period; "
        "empty without whole turns",
        kind=TEXT,
    ),
    "regime": Column("synchronization and kind of motion", "as of the samples of a design", kind=TEXT),
    "period": Column(
        "period of the motion, in turns of exciter 1",
        f"0: none up to {MAX_PERIOD}, not settled, or too few turns to tell; near a doubling a note has both; means "
        "are over whole periods",
        kind=COUNT,
    ),
    "stroke_change": Column(
        "transient in the strokes", "largest transient along x or y / larger stroke; empty without whole turns"
    ),
    **{
        f"transient_{axis}_m": Column(
            f"part of the range of {axis} that is a transient",
            "range of places at whole turns that repeat, at the start of the measuring interval; if it does not "
            "decay in the interval, at most what the damping leaves of the largest range of the run",
        )
        for axis in "xy"
    },
    **MEASURES,
    "contact_force_noise_n": Column("magnitude up to which contact forces are noise"),
    "engine": Column("integrator that was used"),
    "tolerance": Column("tolerance of the integrator", "local error (scaled units)"),
    **WORK,
    "restarts": Column("number of restarts of the integrator", "including the first start; one after each event"),
    "wall_s": Column("wall-clock time of the computation"),
    "notes": Column("warnings", kind=TEXT),
    **SHEET,
    **WHOLE,
}


@validated(
    scene=SceneArgument,
    keep=Keep,
    progress=Callable[..., Any] | None,
    variation=TrueOrKeys,
    sink=SinkArgument | None,
    start=InstanceOf[Start] | None,
    engine=Callable[..., Any] | None,
)
def simulate(
    scene: Scene,
    *,
    keep: Keep = "segments",
    progress: Callable[[float, int], None] | None = None,
    sink: Sink | Files | None = None,
    variation: bool | str | Sequence[str] = False,
    start: Start | None = None,
    engine: Callable[[Scene, Parameters], Engine] | None = None,
) -> RunResult:
    """Integrate a scene in time, from its initial condition for ``run.duration_s``; the summary has what it measures.

    Parameters
    ----------
    scene
        Scene to simulate, with duration and accuracy.
    keep
        Data kept in memory besides the summary. ``segments``: data for tables and dense output; ``table``: trajectory
        and event table; ``events``: event table; ``summary``: nothing, memory does not grow with the length of the run.
        Dense output of more than 1 GiB is given up for the trajectory table; a note says so.
    progress
        Function that is called from time to time with the time reached (s) and the number of events so far.
    sink
        Two functions, or two files (:class:`vibroplat.results.tables.TableFile`), that receive the trajectory table and
        the event table part by part during the run, independent of ``keep``.
    variation
        True: also compute the derivative of the final state by the initial state,
        :attr:`vibroplat.results.run.RunResult.monodromy`.
        Dotted keys: also the derivative by these keys, :attr:`RunResult.variation`.
    start
        Initial condition, if it is known already. Default: the initial condition of the scene.
    engine
        Function that makes the engine. Default: ``solver.engine``; ``auto`` is ``native``, or with ``variation`` the
        engine of derivatives, and the other one where it fails, unless a ``sink`` of functions has received tables.

    Returns
    -------
    RunResult
        The result, also if the run ended early; see :attr:`RunResult.outcome`.

    Raises
    ------
    ConfigError
        An argument is none of these, the kept table does not fit into memory, the initial condition is not possible,
        or a key cannot vary.
    """
    if keep == "table":
        require_room(scene)
    keys = None if variation is False else key_tuple(() if variation is True else variation)
    start = initial_condition(scene) if start is None else start
    makers = _makers(scene, run=keys is None) if engine is None else [engine]
    files = [file for file in sink or () if isinstance(file, TableFile)]

    def run_by(maker: Callable[[Scene, Parameters], Engine]) -> RunResult:
        for file in files:
            file.clear()
        return _simulate(scene, maker, start, Recorder(scene, keep, sink), keys, progress)

    return _first_finished(scene, makers if files or sink is None else makers[:1], run_by, run=keys is None)


def _first_finished(
    scene: Scene,
    makers: Sequence[Callable[[Scene, Parameters], Engine]],
    run_by: Callable[[Callable[[Scene, Parameters], Engine]], RunResult],
    *,
    run: bool,
) -> RunResult:
    """Run by one engine after the other up to one that does not fail; the last one says why each of them did."""
    reasons = list[str]()
    for maker in makers:
        result = run_by(maker)
        if result.outcome not in FAILED:
            return result
        reasons.append(result.summary["detail"])
    if len(reasons) > 1:
        result.summary["detail"] = both_reasons(engines_to_try(scene, run=run), *reasons)
    return result


def _makers(scene: Scene, *, run: bool) -> list[Callable[[Scene, Parameters], Engine]]:
    """Return what makes the engine of a scene, and the one that is tried where it fails."""
    return [partial(make_engine, name=name) for name in engines_to_try(scene, run=run)]


def _simulate(
    scene: Scene,
    engine: Callable[[Scene, Parameters], Engine],
    start: Start,
    recorder: Recorder,
    keys: Sequence[str] | None,
    progress: Callable[[float, int], None] | None,
) -> RunResult:
    """Integrate a scene in time by one engine (:func:`simulate`)."""
    p = parameters(scene)
    began = time.perf_counter()
    with closing(engine(scene, p)) as driver:
        motion = Simulator(scene, p, driver, start.state, start.time, start.mode)
        run = _run(motion, start, recorder, keys, [] if progress is None else [_Progress(progress, motion.now)])
    run.summary["wall_s"] = time.perf_counter() - began
    return run


def _run(
    motion: Simulator, start: Start, recorder: Recorder, keys: Sequence[str] | None, others: Sequence[Observer]
) -> RunResult:
    """Carry a motion on to the end of its run; with its derivative by keys and by its start, unless they are None."""
    scene, duration = motion.scene, motion.scene.run.duration_s
    variations = [] if keys is None else [Variation(parameter_directions(scene, keys))]
    part = motion.advance(duration, settle=SETTLE_FRACTION * duration, observers=[recorder, *others, *variations])
    recorder.finish()
    derivative = None
    if keys is not None and motion.outcome == "ok":
        derivative = named_derivative(variations[0].derivative(motion.automaton), scene, keys)
    summary, left, said = _summary(motion, part, start.time)
    return RunResult(
        scene=scene,
        summary=summary,
        remarks=partial(_notes, scene, summary, left, (*said, recorder.note)),
        origin=start.origin,
        segments=recorder.segments,
        event_rows=recorder.events,
        end=motion.state,
        measures=part.measures,
        table=recorder.table,
        derivative=derivative,
    )


def _summary(
    motion: Simulator, part: MeasuredInterval, start: float
) -> tuple[dict[str, Any], Sequence[Transient], Sequence[str]]:
    """Return the summary of a run that began at a time (s), transients along x and y, and notes on the motion."""
    scene, engine, seconds = motion.scene, motion.engine, motion.now - start
    repetition = latest_repetition(section_points(part.measures, scene))
    repeats = max(repetition.turns, repetition.finer)
    measures = measure(part._replace(measures=whole_periods(part.measures, max(repeats, 1))), scene)
    sheet = {name: measures.pop(name) for name in columns(scene)}
    doubt = inaccuracy(measures, scene) if motion.outcome == "ok" else ""
    locked = synchronization(measures) != "none" and stays_synchronized(part.measures, scene)
    since, until = measures["measured_from_s"], measures["measured_to_s"]
    changed = scene.drive.last_change(until)
    left, unsteady = [Transient(0.0, 0.0)] * 2, free_swing(scene, measures, section_rows(part.measures), start)
    unsteady = unsteady or unfinished_stop(scene, measures, motion.state)
    if changed <= since and any(scene.driven(since, until)) and not unsteady:
        left = transients(part.measures, scene, max(start, changed), repeats)
    stroke = max(sheet["stroke_x_m"] or 0.0, sheet["stroke_y_m"] or 0.0)
    moved = max(left[0].size, left[1].size) / stroke if stroke > MIN_STROKE and not unsteady else None
    whole = whole_run(part.measures, scene, start, slow_motors(scene, measures), locked)
    kinds = {
        "sync": synchronization(measures) if measures["phase_coherence"] is not None else "",
        "motion": kind_of_motion(measures, repeats, moved),
    }
    regime = name_regime({**kinds, "period": repetition.turns}) if kinds["motion"] else ""
    return (
        {
            "name": scene.name,
            "outcome": INACCURATE if doubt else motion.outcome,
            "detail": doubt or motion.detail or repetition_text({**measures, "period": repetition.turns}),
            "begins_s": start,
            "simulated_s": seconds,
            "relative_rotation": scene.rotation,
            "perturbation": scene.start_perturbation,
            "static_sag_m": 0.0 - float(static_rest(scene, motion.automaton.p)[1]),
            **kinds,
            "regime": regime,
            "period": repetition.turns,
            "stroke_change": moved,
            "transient_x_m": left[0].size,
            "transient_y_m": left[1].size,
            **measures,
            "contact_force_noise_n": force_noise(scene, motion.automaton.p) if scene.has_contact else None,
            "engine": engine.name,
            "tolerance": scene.solver.tolerance,
            **engine.work,
            "restarts": motion.restarts,
            "wall_s": 0.0,
            **sheet,
            **whole,
        },
        left,
        [unsteady, repetition.note],
    )


def _notes(scene: Scene, summary: Mapping[str, Any], left: Sequence[Transient], said: Sequence[str]) -> list[str]:
    """Return the notes on a run with these transients along x and y, with those that are ``said`` already."""
    begin, seconds = summary["begins_s"], summary["simulated_s"]
    notes = (
        *notes_on_measures(scene, summary),
        *said,
        _settling(left, summary),
        _unbalanced(scene, summary),
        drift(summary) if all(scene.driven(summary["measured_from_s"], summary["measured_to_s"])) else "",
        change(scene, summary, begin),
        symmetry(scene, {axis: summary[f"whole_stroke_{axis}_m"] for axis in "xy"}, begin, begin + seconds),
        *set_in_vain(scene.set_keys, "run"),
        *notes_on_input(scene, ends=begin + scene.run.duration_s),
        stiffness(scene, summary["engine"], summary["steps"], summary["restarts"], seconds),
    )
    return [note for note in notes if note]


def _settling(left: Sequence[Transient], summary: Mapping[str, Any]) -> str:
    """Return the note on transients along x and y in the strokes of a run, or an empty text."""
    stroke = max(summary["stroke_x_m"] or 0.0, summary["stroke_y_m"] or 0.0)
    axis, largest = max(zip("xy", left, strict=True), key=lambda one: one[1].size)
    if stroke < MIN_STROKE or largest.size <= SETTLED * stroke:
        return ""
    text = "is left from the start, for nothing damps it, and is in the forces, too"
    if largest.rate:
        longer = summary["simulated_s"] + 2.0 / largest.rate * math.log(largest.size / (0.5 * SETTLED * stroke))
        text = (
            "may be a transient that decays while it is measured, and is in the forces, too: "
            f"run.duration_s = {given(float(f'{longer:.2g}'))} leaves about {percent(0.5 * SETTLED)}"
        )
    size = quantity(largest.size, "m")
    return f"{WARNING}{percent(largest.size / stroke)} of the stroke, {size} along {axis}, {text}"


def _unbalanced(scene: Scene, measures: Mapping[str, Any]) -> str:
    """Return the note on a short run in a synchronization that the mean torques do not hold, or an empty text.

    Of 460 settled motions without material none had it, of 662 with material 25, all near a resonance that the layers
    shift; a run in antiphase that leaves it after thousands of turns has it.
    """
    name, begin, end = synchronization(measures), measures["measured_from_s"], measures["measured_to_s"]
    steady = scene.drive.last_change(end) <= begin and all(scene.driven(begin, end))
    short = 0 < measures["measured_turns"] < MANY_TURNS
    if not (steady and short) or name not in ("antiphase", "in-phase") or scene.transport is not None:
        return ""
    phases = phases_at(scene, supply_at(scene, end), TURN * measures["excitation_frequency_hz"])
    apart = np.abs(wrap(phases - measures["phase_difference_rad"]))
    if not apart.size or apart.min() < OTHER_PHASE:
        return ""
    return (
        f"{WARNING}the mean torques on the empty machine do not hold {name}: it may be unstable and "
        "lost over many turns; a longer run.duration_s or vibroplat orbits shows whether it persists"
    )


class _Progress:
    """Tells how far a run is: the time since its start (s) and the number of events so far."""

    def __init__(self, tell: Callable[[float, int], None], start: float) -> None:
        self._tell = tell
        self._start = start
        self._events = 0

    def read(self, h: Automaton) -> None:
        """Tell it."""
        self._events += int(h.run["events"])
        self._tell(float(h.run["now"]) - self._start, self._events)


def load_kernels(engine: str = "native") -> None:
    """Compile or load all that a motion needs, by the engine of a name.

    The engine's loop comes last: where it is on disk, all others are.
    """
    scene = Scene().replace({"material": {"mass_ratio": 0.1, "layers": 1}, "solver.engine": engine})
    p = parameters(scene)
    Statistics(0.0).read(automaton(scene, p, empty_steps(1, CUBIC), 1.0))
    with closing(make_engine(scene, p)) as made:
        Simulator(scene, p, made).advance(1e-3)
