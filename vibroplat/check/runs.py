"""A run is checked: another engine runs the same scene, and both are compared in time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd

from vibroplat.check import MAX_RATIO, MIN_ALLOWED, Other, with_other_engine, with_other_tolerance
from vibroplat.check.events import ErrorBound, EventMatches, compared_events, marginal_events, match_events
from vibroplat.config.arguments import validated
from vibroplat.config.coordinates import ALONG, COORDINATES, TURN
from vibroplat.config.digits import given, number, pair, quantity
from vibroplat.config.scene import Scene, SceneArgument
from vibroplat.hybrid.state import force_spread, state_scales
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.systems import ALONG as ALONG_PLACE
from vibroplat.model.systems import GAP_RATE
from vibroplat.motion.initial_condition import Start
from vibroplat.motion.recorder import Sink
from vibroplat.motion.run import simulate
from vibroplat.report.summary import INACCURATE
from vibroplat.results.run import RunResult
from vibroplat.system.memory import MemoryBudget

#: Difference, in scaled units, up to which engines are said to agree.
MAX_AGREEING_DIFFERENCE: Final = 1e-3
#: Allowed difference, in scaled units, from which on nothing is compared any more.
MAX_ALLOWED_DIFFERENCE: Final = 0.3
#: Most samples of a run that are compared; they are those of the trajectory table, or every second, third … of them.
MAX_SAMPLES: Final = 100_000
#: How many times a scene is run besides the run that is checked.
MORE_RUNS: Final = 5
#: Name of the quantity that is the time of an event.
EVENT_TIME: Final = "event time"

_FORCE: Final = "contact_force_n"

#: Called with the time reached (s) and the number of events.
Progress = Callable[[float, int], None]


class Difference(NamedTuple):
    """A difference of a quantity between two engines.

    Attributes
    ----------
    quantity
        Column of the trajectory table, or EVENT_TIME.
    t_s, place
        When, and in which mode or at which event of the first engine's run.
    first, other
        Both values, in the quantity's unit.
    difference, allowed
        In its scale; that of event times is 1/ω₀.
    scale
        In the quantity's unit.
    """

    quantity: str
    t_s: float
    place: str
    first: float
    other: float
    difference: float
    allowed: float
    scale: float


@dataclass(frozen=True)
class RunCheck:
    """What the check of a run has found.

    Attributes
    ----------
    engine, other
        Names of the engine of the run and of that which checked it.
    outcomes
        How the runs of both ended.
    compared_until_s
        Until when they were compared: until a run ended, or until what is allowed had grown to MAX_ALLOWED_DIFFERENCE.
    agree_until_s
        Until when no coordinate, and not the contact force, differed by more than MAX_AGREEING_DIFFERENCE of its scale.
    amplification
        Largest change under a repetition until then, over the tolerance, in scaled units.
    events
        Number of events that both have until then.
    largest
        The largest difference of each quantity.
    disagreement
        What amplification does not explain, where it first shows; empty if the engines agree.
    """

    engine: str
    other: str
    outcomes: tuple[str, str]
    compared_until_s: float
    agree_until_s: float
    amplification: float
    events: int
    largest: tuple[Difference, ...]
    disagreement: str

    @property
    def agrees(self) -> bool:
        """Whether amplification explains all differences."""
        return not self.disagreement

    def to_tree(self) -> dict[str, Any]:
        """Return all of it as nested plain values."""
        largest = {d.quantity: {k: v for k, v in d._asdict().items() if k != "quantity"} for d in self.largest}
        return asdict(self) | {"largest": largest, "agrees": self.agrees}

    def lines(self) -> dict[str, str]:
        """Summarize it in a few lines: label and text."""
        lines = {
            "checked by": f"engine {self.other}, up to {quantity(self.compared_until_s, 's')}; by then, errors the "
            f"size of the tolerance are amplified {number(self.amplification, 2)} times"
        }
        states = [d for d in self.largest if d.quantity != EVENT_TIME]
        if states:
            worst = max(states, key=lambda d: d.difference)
            lines["largest difference"] = (
                f"{worst.quantity}, {number(worst.difference, 2)} of its scaled unit at {quantity(worst.t_s, 's')}; "
                f"all within {given(MAX_AGREEING_DIFFERENCE)} up to {quantity(self.agree_until_s, 's')}"
            )
        for d in self.largest[len(states) :]:
            lines["events of both"] = (
                f"{self.events}, their times within {quantity(abs(d.first - d.other), 's', digits=2)}"
            )
        return lines


@validated(scene=SceneArgument, other=Callable[..., Any], progress=Callable[..., Any] | None)
def check_run(scene: Scene, *, other: Other = with_other_engine, progress: Progress | None = None) -> RunCheck:
    """Run a scene with two engines and compare coordinates, contact force and events in time.

    Parameters
    ----------
    scene
        Scene to simulate.
    other
        Function that makes the scene of the cross-check. Default: the same scene with another engine.
    progress
        Called now and then with the time reached in all runs together (s) and the number of events in this one.

    Raises
    ------
    ConfigError
        The initial condition of the scene is not possible.

    Examples
    --------
    >>> from vibroplat import Scene, check_run
    >>> check_run(Scene().replace({"run.duration_s": 0.1})).agrees
    True
    """
    return compare_run(SampledRun(scene, progress), other=other, progress=_later(progress, scene.run.duration_s))


def compare_run(first: SampledRun, *, other: Other = with_other_engine, progress: Progress | None = None) -> RunCheck:
    """Compare a finished run with that of another engine; see :func:`check_run`."""
    scene = first.scene
    scenes = [other(scene), with_other_tolerance(other(scene)), *perturbed_scenes(scene)]
    runs = [SampledRun(s, _later(progress, n * scene.run.duration_s)) for n, s in enumerate(scenes)]
    return _Comparison(first, runs[0], runs[1], runs[2:]).result()


def perturbed_scenes(scene: Scene) -> list[Scene]:
    """List the scenes that show what a motion makes of errors: another tolerance, and starts that are off by it."""
    perturbation, tolerance = scene.start_perturbation, scene.solver.tolerance
    way = 1.0 if perturbation < 0.5 else -1.0
    starts = [scene.replace({"run.perturbation": perturbation + way * n * tolerance}) for n in (1.0, 2.0)]
    return [with_other_tolerance(scene), *starts]


def _later(progress: Progress | None, seconds: float) -> Progress | None:
    """Tell the progress of a run after others that took some simulated seconds."""
    return None if progress is None else lambda reached, events: progress(seconds + reached, events)


# -- what is compared -------------------------------------------------------------------------------------


class SampledRun:
    """What is compared of a run: samples of its trajectory, and its events, collected during the run.

    Parameters
    ----------
    scene
        What is run.
    progress, start
        As in :func:`vibroplat.simulate`.
    also
        Is given all of the trajectory table and the event table.

    Attributes
    ----------
    names, scales
        The sampled quantities, coordinates and contact force, and their scales. That of the force is its change when
        the state changes by its scales.
    result
        The run; its tables are not kept.
    """

    def __init__(
        self, scene: Scene, progress: Progress | None = None, also: Sink | None = None, start: Start | None = None
    ) -> None:
        self.scene = scene
        self.scales = {COORDINATES[i]: float(state_scales(scene)[i]) for i in scene.coordinates}
        if scene.transport is not None:
            self.scales[ALONG[0]] = float(state_scales(scene)[ALONG_PLACE])
        if scene.has_contact:
            self.scales[_FORCE] = force_spread(scene)
        self.names = list(self.scales)
        self._also = also
        self._budget = MemoryBudget("shorten run.duration_s, or leave out --check")
        self._samples: list[pd.DataFrame] = []
        self._events: list[pd.DataFrame] = []
        sink = self._take_trajectory, self._take_events
        self.result: RunResult = simulate(scene, keep="summary", sink=sink, progress=progress, start=start)

    def _take_trajectory(self, part: pd.DataFrame) -> None:
        """Keep the rows on the output grid, and the last one."""
        if self._also is not None:
            self._also[0](part)
        rate, times = self.scene.output.sample_rate_hz, part["t_s"].to_numpy()
        every = max(1, math.ceil(self.scene.run.duration_s * rate / MAX_SAMPLES))
        numbers = np.rint(times * rate)
        wanted = (numbers / rate == times) & (numbers % every == 0)
        wanted[-1:] = True
        self._keep(self._samples, part.loc[wanted, ["t_s", "mode", *self.names]])

    def _take_events(self, part: pd.DataFrame) -> None:
        if self._also is not None:
            self._also[1](part)
        self._keep(self._events, part[["t_s", "kind", "gap_rate_before_m_per_s"]])

    def _keep(self, parts: list[pd.DataFrame], part: pd.DataFrame) -> None:
        self._budget.take(int(part.memory_usage(index=False).sum()))
        parts.append(part)

    @cached_property
    def samples(self) -> pd.DataFrame:
        """Samples by time, one for each time, of quantities in their scales."""
        samples = pd.concat(self._samples).drop_duplicates("t_s", keep="last").set_index("t_s")
        samples[self.names] /= list(self.scales.values())
        return samples

    @cached_property
    def events(self) -> pd.DataFrame:
        """Events that are compared."""
        return compared_events(pd.concat(self._events))

    @property
    def outcome(self) -> str:
        """How the run ended; energy that was lost is not what is compared."""
        return "ok" if self.result.outcome == INACCURATE else self.result.outcome

    @property
    def engine(self) -> str:
        """Name of the engine that ran it."""
        return str(self.result.summary["engine"])

    @property
    def end(self) -> float:
        """When it ended (s); 0 if it has no sample, as it gave up at once."""
        return float(self.samples.index[-1]) if len(self.samples) else 0.0


def differences(one: SampledRun, two: SampledRun, times: pd.Index) -> FloatArray:
    """Differences of two runs at times of the first, shape (times, quantities), in scaled units.

    They are nan where the second has no sample, and those of the contact force where not both are in contact.
    """
    a, b = one.samples.reindex(times), two.samples.reindex(times)
    distances: FloatArray = np.abs(a[one.names].to_numpy() - b[one.names].to_numpy())
    if _FORCE in one.names:
        apart = ((a["mode"] == "flight") | (b["mode"] == "flight")).to_numpy()
        distances[apart, one.names.index(_FORCE)] = math.nan
    return distances


# -- the comparison ---------------------------------------------------------------------------------------


class _Comparison:
    """The comparison of two runs with their repetitions: ``again`` of the other one, ``changed`` of the first."""

    def __init__(self, first: SampledRun, other: SampledRun, again: SampledRun, changed: Sequence[SampledRun]) -> None:
        self._first, self._other, self._again, self._changed = first, other, again, changed
        self._scene = first.scene
        self._tolerance = first.scene.solver.tolerance
        times = first.samples.index
        self._repeated = [*((first, course) for course in changed), (other, again)]
        change = np.fmax.reduce([_running_maximum(differences(*pair, times)) for pair in self._repeated])
        allowed = MIN_ALLOWED * self._tolerance + MAX_RATIO * change
        if _FORCE in first.names:  # which differs as much as the state, also where repetitions were rarely in contact
            allowed[:, first.names.index(_FORCE)] = allowed.max(axis=1)
        lost = times[allowed.max(axis=1) >= MAX_ALLOWED_DIFFERENCE]
        self._lost = float(lost[0]) if len(lost) else math.inf
        self._until = min(self._lost, *(course.end for course in (first, other, *changed)))
        within = (times <= self._until) & (times < self._lost)
        self._times = times[within].to_numpy()
        self._samples = [course.samples.reindex(times)[within] for course in (first, other)]
        self._allowed, self._change = allowed[within], change[within]
        self._errors = ErrorBound(self._times, self._allowed.max(axis=1))
        self._found = differences(first, other, times)[within]

    def result(self) -> RunCheck:
        """Compare samples, events and ends."""
        pairs, moved = self._events() if self._times.size else (EventMatches(np.empty((0, 2), np.int64)), [])
        apart = np.flatnonzero((self._found > MAX_AGREEING_DIFFERENCE).any(axis=1))
        columns = [k for k in range(self._found.shape[1]) if np.isfinite(self._found[:, k]).any()]
        largest = [self._sample(int(np.nanargmax(self._found[:, k])), k) for k in columns]
        largest += sorted(moved, key=lambda d: d.difference)[-1:]
        return RunCheck(
            engine=self._first.engine,
            other=self._other.engine,
            outcomes=(self._first.outcome, self._other.outcome),
            compared_until_s=float(self._until),
            agree_until_s=float(self._times[apart[0]] if apart.size else self._until),
            amplification=float(self._change.max(initial=0.0)) / self._tolerance,
            events=len(pairs.rows),
            largest=tuple(largest),
            disagreement=min(self._disagreements(pairs, moved), default=(0.0, ""))[1],
        )

    def _disagreements(self, pairs: EventMatches, moved: Sequence[Difference]) -> Iterator[tuple[float, str]]:
        """Yield when engines disagree, in what, and what was allowed."""
        first, other = self._first, self._other
        beyond = [d for d in moved if d.difference > d.allowed]
        rows = np.flatnonzero((self._found > self._allowed).any(axis=1))
        if rows.size:  # the first sample beyond what is allowed, in the quantity where it is farthest beyond
            row = int(rows[0])
            beyond.append(self._sample(row, int(np.nanargmax(self._found[row] / self._allowed[row]))))
        for d in beyond:
            one, two = pair(d.first, d.other)
            yield (
                d.t_s,
                f"at {given(d.t_s)} s, {d.place}: {d.quantity} = {one} ({first.engine}) and {two} "
                f"({other.engine}); allowed difference {number(d.allowed * d.scale, 2)}",
            )
        # another sequence of events, unless that of a repetition differs by then
        turn = TURN / self._scene.speed_scale
        if math.isfinite(pairs.differ_s) and not any(
            self._match(*pair).differ_s <= pairs.differ_s + turn for pair in self._repeated
        ):
            one, two = (f"{why} ({c.engine})" for why, c in zip(pairs.why, (first, other), strict=True))
            yield (
                pairs.differ_s,
                f"at {given(pairs.differ_s)} s: sequence of events, {one} and {two}; allowed: the same",
            )
        # another end, unless a repetition of either ends as the other or nothing was compared so late
        ended = min(first.end, other.end)
        outcomes = {first.outcome, *(course.outcome for course in self._changed)}
        if other.outcome not in outcomes and self._again.outcome != first.outcome and self._lost > ended:
            ends = f"outcome {first.outcome} ({first.engine}) and {other.outcome} ({other.engine})"
            yield ended, f"at {given(ended)} s: {ends}; allowed: the same"

    def _sample(self, row: int, column: int) -> Difference:
        """Describe the difference of a quantity in a sample."""
        name, time = self._first.names[column], float(self._times[row])
        scale = self._first.scales[name]
        one, two = (float(samples[name].iloc[row]) * scale for samples in self._samples)
        mode = str(self._samples[0]["mode"].iloc[row])
        difference, allowed = float(self._found[row, column]), float(self._allowed[row, column])
        return Difference(name, time, mode, one, two, difference, allowed, scale)

    def _events(self) -> tuple[EventMatches, list[Difference]]:
        """Pair the events of both, and compare their times."""
        one, two = self._first.events, self._other.events
        pairs = self._match(self._first, self._other)
        i, j = pairs.rows.T
        speed = self._scene.speed_scale
        change = np.fmax(self._shifts(self._first, *self._changed)[i], self._shifts(self._other, self._again)[j])
        least = MIN_ALLOWED * self._tolerance * self._least(one["gap_rate_before_m_per_s"].to_numpy()[i])
        allowed = least + MAX_RATIO * _running_maximum(speed * change)
        clear = ~marginal_events(one.iloc[i], self._errors, self._scene)
        columns = one["t_s"].to_numpy()[i], two["t_s"].to_numpy()[j], one["kind"].to_numpy()[i], allowed
        return pairs, [
            Difference(EVENT_TIME, a, f"at {kind}", a, b, speed * abs(a - b), most, 1.0 / speed)
            for a, b, kind, most in zip(*(column[clear].tolist() for column in columns), strict=True)
        ]

    def _shifts(self, one: SampledRun, *others: SampledRun) -> FloatArray:
        """Return how far repetitions move each event of a run in time (s); nan where none has it."""
        shifts = np.full(len(one.events), math.nan)
        for course in others:
            i, j = self._match(one, course).rows.T
            times = one.events["t_s"].to_numpy()[i], course.events["t_s"].to_numpy()[j]
            shifts[i] = np.fmax(shifts[i], np.abs(times[0] - times[1]))
        return shifts

    def _least(self, speeds: FloatArray) -> FloatArray:
        """Return how many times an error of the state, in its scales, moves an event in time, in 1/ω₀.

        Impacts are moved by the error of the gap over their speed. Liftoffs, whose speed is 0, are moved by the error
        of the contact force over its rate, about its scale times ω₀.
        """
        scene = self._scene
        relative = np.abs(speeds) / state_scales(scene)[GAP_RATE]
        force = force_spread(scene) / scene.force_scale if scene.has_contact else 1.0
        return np.where(relative > 0.0, 1.0 / np.clip(relative, 1e-12, 1.0), force)

    def _match(self, one: SampledRun, two: SampledRun) -> EventMatches:
        return match_events(one.events, two.events, self._errors, self._scene, min(self._until, two.end))


def _running_maximum(changes: FloatArray) -> FloatArray:
    """Return the largest values up to each row; nan counts as nothing."""
    return np.asarray(np.maximum.accumulate(np.nan_to_num(changes), axis=0))
