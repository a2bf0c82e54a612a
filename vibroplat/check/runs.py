"""A run is checked: another engine runs the same scene, and both are compared in time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np

from vibroplat.check.agreement import CLOSE, EVENT_TIME, Difference, RunCheck
from vibroplat.check.changes import (
    FLOOR,
    MULTIPLE,
    Other,
    by_other_engine,
    with_other_tolerance,
)
from vibroplat.check.courses import Course, Progress, differences, scales_of
from vibroplat.check.events import Errors, Pairs, paired, slight
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import force_spread, state_scales
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.systems import GAP_RATE

#: Allowed difference, in the scales of the scene, from which on nothing is compared any more.
LOST: Final = 0.3
#: How many times a scene is run besides the run that is checked.
RUNS: Final = 5


def check_run(scene: Scene, *, other: Other = by_other_engine, progress: Progress | None = None) -> RunCheck:
    """Run a scene with two engines and compare coordinates, contact force and events in time.

    Parameters
    ----------
    scene
        What is run.
    other
        Returns the scene that checks it; by default the same one with another engine.
    progress
        Called now and then with the time reached in all runs together (s) and the number of events in this one.

    Raises
    ------
    ConfigError
        The scene cannot begin as it says.

    Examples
    --------
    >>> from vibroplat import Scene, check_run
    >>> check_run(Scene().replace({"run.duration_s": 0.1})).agrees
    True
    """
    return compared(Course(scene).run(progress), other=other, progress=_later(progress, scene.run.duration_s))


def compared(first: Course, *, other: Other = by_other_engine, progress: Progress | None = None) -> RunCheck:
    """Compare a finished run with that of another engine; see :func:`check_run`."""
    scene = first.scene
    scenes = [other(scene), with_other_tolerance(other(scene)), *repetitions(scene)]
    seconds = scene.run.duration_s
    runs = [Course(s).run(_later(progress, n * seconds)) for n, s in enumerate(scenes)]
    return _Comparison(first, runs[0], runs[1], runs[2:]).result()


def repetitions(scene: Scene) -> list[Scene]:
    """List the scenes that show what a motion makes of errors: another tolerance, and starts that are off by it."""
    share, tolerance = scene.run.start_perturbation, scene.solver.tolerance
    way = 1.0 if share < 0.5 else -1.0
    starts = [scene.replace({"run.perturbation": share + way * n * tolerance}) for n in (1.0, 2.0)]
    return [with_other_tolerance(scene), *starts]


def _later(progress: Progress | None, seconds: float) -> Progress | None:
    """Tell the progress of a run after others that took some simulated seconds."""
    return None if progress is None else lambda reached, events: progress(seconds + reached, events)


class _Comparison:
    """The comparison of two engines' runs.

    Parameters
    ----------
    first, other
        The runs.
    again
        The other run with another tolerance.
    changed
        Repetitions of the first run.
    """

    def __init__(self, first: Course, other: Course, again: Course, changed: Sequence[Course]) -> None:
        self._first, self._other, self._again, self._changed = first, other, again, changed
        self._scene = first.scene
        self._tolerance = first.scene.solver.tolerance
        times = first.samples.index
        pairs = [*((first, course) for course in changed), (other, again)]
        change = np.fmax.reduce([_so_far(differences(*pair, times)) for pair in pairs])
        allowed = FLOOR * self._tolerance + MULTIPLE * change
        lost = times[allowed.max(axis=1) >= LOST]
        self._lost = float(lost[0]) if len(lost) else math.inf
        self._until = min(self._lost, *(course.end for course in (first, other, *changed)))
        within = (times <= self._until) & (times < self._lost)
        self._times = times[within].to_numpy()
        self._samples = [course.samples.reindex(times)[within] for course in (first, other)]
        self._allowed, self._change = allowed[within], change[within]
        self._found = differences(first, other, times)[within]

    def result(self) -> RunCheck:
        """Compare samples, events and ends."""
        pairs, moved = self._events() if self._times.size else (Pairs(np.empty((0, 2), np.int64)), [])
        told = [(d.t_s, self._told(d)) for d in (*self._beyond(), *moved) if d.difference > d.allowed]
        told += [*self._other_sequence(pairs), *self._other_end()]
        apart = np.flatnonzero((self._found > CLOSE).any(axis=1))
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
            disagreement=min(told, default=(0.0, ""))[1],
        )

    def _beyond(self) -> Iterator[Difference]:
        """Yield the first sample beyond what is allowed, in the quantity where it is farthest beyond."""
        rows = np.flatnonzero((self._found > self._allowed).any(axis=1))
        if rows.size:
            row = int(rows[0])
            yield self._sample(row, int(np.nanargmax(self._found[row] / self._allowed[row])))

    def _sample(self, row: int, column: int) -> Difference:
        """Describe the difference of a quantity in a sample."""
        name, time = self._first.names[column], float(self._times[row])
        scale = scales_of(self._scene)[name]
        one, two = (float(samples[name].iloc[row]) * scale for samples in self._samples)
        mode = str(self._samples[0]["mode"].iloc[row])
        difference, allowed = float(self._found[row, column]), float(self._allowed[row, column])
        return Difference(name, time, mode, one, two, difference, allowed, scale)

    def _events(self) -> tuple[Pairs, list[Difference]]:
        """Pair the events of both, and compare their times."""
        one, two = self._first.events, self._other.events
        pairs = self._paired(self._first, self._other)
        change = np.full(len(one), math.nan)
        for course in self._changed:
            i, j = self._paired(self._first, course).rows.T
            change[i] = np.fmax(change[i], _apart(one, i, course.events, j))
        of_other = np.full(len(two), math.nan)
        i, j = self._paired(self._other, self._again).rows.T
        of_other[i] = _apart(two, i, self._again.events, j)
        i, j = pairs.rows.T
        speed = self._scene.speed_scale
        so_far = _so_far(speed * np.fmax(change[i], of_other[j]))
        allowed = FLOOR * self._tolerance * self._least(one.iloc[i]["gap_rate_before_m_per_s"]) + MULTIPLE * so_far
        found = speed * _apart(one, i, two, j)
        clear = ~slight(one.iloc[i], self._errors, self._scene)
        times = one["t_s"].to_numpy()[i], two["t_s"].to_numpy()[j]
        kinds = one["kind"].to_numpy()[i]
        return pairs, [
            Difference(EVENT_TIME, a, f"at {kind}", a, b, d, most, 1.0 / speed)
            for a, b, kind, d, most in zip(*(v[clear].tolist() for v in (*times, kinds, found, allowed)), strict=True)
        ]

    def _least(self, speeds: Any) -> FloatArray:
        """Return how many times an error of the state, in its scales, moves an event in time, in 1/ω₀.

        Impacts are moved by the error of the gap over their speed. Liftoffs, whose speed is 0, are moved by the error
        of the contact force over its rate, about its scale times ω₀.
        """
        scene = self._scene
        relative = np.abs(np.asarray(speeds, dtype=float)) / state_scales(scene)[GAP_RATE]
        force = force_spread(scene) / scene.force_scale if scene.has_contact else 1.0
        return np.where(relative > 0.0, 1.0 / np.clip(relative, 1e-12, 1.0), force)

    @property
    def _errors(self) -> Errors:
        return Errors(self._times, self._allowed.max(axis=1))

    def _paired(self, one: Course, two: Course) -> Pairs:
        return paired(one.events, two.events, self._errors, self._scene, self._until)

    def _other_sequence(self, pairs: Pairs) -> list[tuple[float, str]]:
        """Say when the sequence of events differs, unless that of a repetition has by then."""
        if not math.isfinite(pairs.differ_s):
            return []
        turn = 2.0 * math.pi / self._scene.speed_scale
        if any(self._paired(self._first, course).differ_s <= pairs.differ_s + turn for course in self._changed):
            return []
        one, two = (f"{why} ({c.engine})" for why, c in zip(pairs.why, (self._first, self._other), strict=True))
        return [(pairs.differ_s, f"at {pairs.differ_s:.9g} s: sequence of events, {one} and {two}; allowed: the same")]

    def _other_end(self) -> list[tuple[float, str]]:
        """Say that the other run ended otherwise, unless a repetition has or nothing was compared so late."""
        first, other = self._first, self._other
        ended = min(first.end, other.end)
        if first.outcome == other.outcome or self._lost <= ended:
            return []
        if any(course.outcome == other.outcome for course in self._changed):
            return []
        ends = f"outcome {first.outcome} ({first.engine}) and {other.outcome} ({other.engine})"
        return [(ended, f"at {ended:.9g} s: {ends}; allowed: the same")]

    def _told(self, d: Difference) -> str:
        """Say where engines disagree, in what, and what was allowed."""
        return (
            f"at {d.t_s:.9g} s, {d.place}: {d.quantity} = {d.first:.12g} ({self._first.engine}) and {d.other:.12g} "
            f"({self._other.engine}); allowed difference {d.allowed * d.scale:.2g}"
        )


def _so_far(changes: FloatArray) -> FloatArray:
    """Return the largest values up to each row; nan counts as nothing."""
    return np.asarray(np.maximum.accumulate(np.nan_to_num(changes), axis=0))


def _apart(one: Any, i: Any, two: Any, j: Any) -> FloatArray:
    """Return how far the times of paired events are apart (s)."""
    return np.asarray(np.abs(one["t_s"].to_numpy()[i] - two["t_s"].to_numpy()[j]))
