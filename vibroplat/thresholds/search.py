"""Thresholds of a key: a scan shows where the outcome changes, and each change is narrowed in a chain of its own.

Where motion on one side repeats, its orbit is followed over the key first: where it loses its stability inside the
interval, and motion comes to it up to there, that point is the threshold. Elsewhere the interval is bisected.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple, TypeVar

import numpy as np
import pandas as pd

from vibroplat.config.plans import OrbitsPlan, StepPlan
from vibroplat.config.questions import FindPlan
from vibroplat.config.scene import Scene
from vibroplat.continuation.orbit import accurate, beginning_at
from vibroplat.continuation.special_points import BRANCH_POINT, DOUBLING, FOLD, NEIMARK_SACKER
from vibroplat.continuation.worker import Known, part
from vibroplat.errors import ConfigError
from vibroplat.model.sensitivity import parameter_direction, value_of
from vibroplat.study.bands import jumps
from vibroplat.study.branches import carried, column_of
from vibroplat.study.point import lost
from vibroplat.study.pool import Pool, StoredChain, Task, Tasks, run_stored
from vibroplat.study.question import Progress
from vibroplat.study.store import Record, Store
from vibroplat.thresholds.values import Value, apart, constant, evaluate

#: Where the motion beside the end of an orbit's stability is measured, over the distance to the end of the interval.
BESIDE = 0.02
#: Change of the measures across a threshold that is a jump, over that between the scan's values, by how much narrower
#: it is: more than the root of it, as beside a fold, times this.
STEEP = 2.0
#: How many times narrower than the scan an interval is at least, which tells a jump from a level that is crossed.
NARROWER = 16.0
#: Pairs of values beside a threshold, over which part of the range they lie, and their distances.
PAIRS, AROUND, DISTANCES = 12, 0.1, (1e-2, 1e-3, 1e-4)
#: Fewest pairs that differ at the smallest distance where the border is fractal, and their least part of those that
#: do at the largest.
FRACTAL, LASTING = 2, 0.25
#: Special points at which an orbit loses its stability; beyond one, change of the measures that is no jump.
SMOOTH, GRADUAL = (FOLD, DOUBLING, NEIMARK_SACKER, BRANCH_POINT), 0.1
#: Record of an orbit that cannot be followed.
NOTHING: Record = {"rows": [], "special": []}

T = TypeVar("T")


class Threshold(NamedTuple):
    """A value of the key at which the outcome changes.

    Attributes
    ----------
    low, high
        What was found below and above.
    value
        The threshold: the special point, or the middle.
    kind
        See the table.
    special
        Kind of the special point, or "".
    """

    low: Value
    high: Value
    value: float
    kind: str
    special: str


def start_key(scene: Scene) -> tuple[int, ...]:
    """Return what determines the perturbation of all starts: that of a run of the scene as given."""
    return scene.run.seed, 0, round(1e6 * scene.drive.largest_frequency)


@dataclass
class Search:
    """Looks for the thresholds of a section ``find``, in chains of tasks.

    Attributes
    ----------
    scene, plan
        A scene and its section.
    store, workers, progress
        As :meth:`vibroplat.study.question.Question.answer` gets them.
    seen
        All values that were looked at besides those of the scan, in the order of chains.
    """

    scene: Scene
    plan: FindPlan
    store: Store
    workers: Pool
    progress: Progress
    seen: list[Value] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._key = start_key(self.scene)
        self._done = self._known = 0

    def thresholds(self) -> tuple[list[Value], list[Threshold]]:
        """Return the values of the scan in ascending order, and the thresholds between them."""
        if self.plan.from_ == "neighbour":
            return self._outward()
        scan = self._run("scan", [self._single(at, "scan") for at in self.plan.over.upward])
        found = self._run("border", [self._border(low, high) for low, high in self._changes(scan)])
        return scan, [threshold for threshold in found if threshold is not None]

    def _run(self, name: str, chains: Sequence[Tasks[tuple[T, list[Value]]]]) -> list[T]:
        """Run chains side by side, and gather what they have seen in their order."""
        stored = [StoredChain(chain, self.store, f"{name}-{number}") for number, chain in enumerate(chains)]
        self._known += len(stored)
        done = self._done
        found = run_stored(stored, self.workers, lambda ended: self.progress(done + ended, self._known))
        self._done += len(stored)
        for _, seen in found:
            self.seen += seen
        return [result for result, _ in found]

    # -- values --------------------------------------------------------------------------------------------------------

    def _single(self, at: float, stage: str) -> Tasks[tuple[Value, list[Value]]]:
        """Look at one value."""
        value = yield from self._value(at, stage)
        return value, [] if stage == "scan" else [value]

    def _value(self, at: float, stage: str, near: Value | None = None, times: int = 1) -> Tasks[Value]:
        """Look at a value of the key; with neighbours the motion is carried on from ``near``."""
        scene, state = self.scene.replace({self.plan.key: at}), None
        if near is not None and near.state is not None and self.plan.from_ == "neighbour":
            before = self.scene.replace({self.plan.key: near.at})
            scene, state = constant(scene), carried(near.state, before, scene)
        record = yield Task(evaluate, (scene, self.plan, state, times, self._key), lost)
        return Value(at, stage, record["row"], record["state"])

    @property
    def _of_motion(self) -> bool:
        """Whether it is the motion that is to change, and not its synchronization or a measure alone."""
        return self.plan.expression is None and self.plan.outcome == "attractor"

    def _alike(self, one: Value, other: Value) -> bool:
        return bool(one.outcome(self.plan) == other.outcome(self.plan))

    def _changes(self, scan: Sequence[Value]) -> list[tuple[Value, Value]]:
        """Return the neighbours between which the outcome changes, or measures leap; failed ones are left out."""
        good = [value for value in scan if not value.failed]
        leaps = [False] * (len(good) - 1)
        if self._of_motion:
            leaps = jumps(pd.DataFrame([{column_of(self.plan.key): value.at, **value.row} for value in good])).tolist()
        return [ends for ends, leap in zip(pairwise(good), leaps, strict=False) if leap or not self._alike(*ends)]

    # -- from neighbour to neighbour -----------------------------------------------------------------------------------

    def _outward(self) -> tuple[list[Value], list[Threshold]]:
        """Carry the motion on from the scene's own value of the key in both directions."""
        plan = self.plan
        own = value_of(self.scene, plan.key)
        own = plan.start if own is None else min(max(own, plan.start), plan.stop)
        first = self._run("own", [self._single(own, "scan")])[0]
        if first.failed:
            return [first], []
        above = [value for value in plan.over.upward if value > own]
        below = [value for value in reversed(plan.over.upward) if value < own]
        ways = self._run("way", [self._way(first, way) for way in (below, above) if way])
        scan = sorted([first, *(value for values, _ in ways for value in values)], key=lambda value: value.at)
        return scan, [threshold for _, threshold in ways if threshold is not None]

    def _way(
        self, first: Value, way: Sequence[float]
    ) -> Tasks[tuple[tuple[list[Value], Threshold | None], list[Value]]]:
        """Carry the motion on along a way until the outcome changes; values up to there, and the threshold."""
        seen: list[Value] = []
        values = [first]
        point = None
        ahead = [at for at in way if self._continuous(at)]
        if ahead and self.plan.expression is None:
            point = yield from self._orbit_boundary(first, ahead[-1], abs(way[0] - first.at), seen)
        if point is not None:
            return ([], point), seen
        for at in way:
            value = yield from self._value(at, "scan", values[-1])
            values.append(value)
            if value.failed or not self._alike(values[-2], value):
                break
        threshold = None
        if not values[-1].failed and not self._alike(*values[-2:]):
            threshold, more = yield from self._border(*values[-2:])
            seen += more
        return (values[1:], threshold), seen

    # -- one change ----------------------------------------------------------------------------------------------------

    def _border(self, one: Value, other: Value) -> Tasks[tuple[Threshold | None, list[Value]]]:
        """Narrow a change between two values, the motion of the first of which is carried on with neighbours.

        There is none where measures that leap between values of the scan meet as they draw nearer.
        """
        seen: list[Value] = []
        wide = apart(one, other, self.plan), abs(other.at - one.at)
        for begin, end in ((one, other), (other, one)):
            point = yield from self._orbit_boundary(begin, end.at, wide[1], seen)
            if point is not None:
                return point, seen
            if self.plan.from_ == "neighbour":
                break
        first, narrow = one, min(self.plan.narrow, wide[1] / NARROWER)
        while abs(other.at - one.at) > narrow:
            middle = yield from self._value(0.5 * (one.at + other.at), "bisection", one)
            seen.append(middle)
            if middle.failed or middle.at in (one.at, other.at):
                break
            if self._alike(one, other):
                near = apart(one, middle, self.plan) < apart(middle, other, self.plan)
            else:
                near = self._alike(one, middle)
            one, other = (middle, other) if near else (one, middle)
        steep = STEEP * math.sqrt(abs(other.at - one.at) / wide[1]) * wide[0]
        meet = apart(one, other, self.plan) <= steep
        if meet and self._alike(one, other):
            return None, seen
        kind = "level crossing" if meet else "jump"
        for end in (one, other):
            longer = yield from self._value(
                end.at, "twice as long", first if self.plan.from_ == "neighbour" else None, 2
            )
            seen.append(longer)
            if longer.failed or not self._alike(longer, end):
                kind = "depends on how long"
        low, high = sorted((one, other), key=lambda value: value.at)
        return Threshold(low, high, 0.5 * (low.at + high.at), kind, ""), seen

    def _continuous(self, at: float) -> bool:
        """Whether orbits can be followed over the key at a value of it; not where it takes the layers away."""
        try:
            parameter_direction(self.scene.replace({self.plan.key: float(at)}), self.plan.key)
        except ConfigError:
            return False
        return True

    def _orbit_boundary(self, begin: Value, end: float, step: float, seen: list[Value]) -> Tasks[Threshold | None]:
        """Follow the orbit of a value towards another one; the threshold where it loses its stability.

        It is one if the motion comes to the orbit just before, and has another outcome just beyond.
        """
        period = begin.row["period"]
        known = period and begin.row["multiplier_max"] and not begin.leaving
        if not (known and self._continuous(begin.at) and self._continuous(end)):
            return None
        span = abs(end - begin.at)
        steps = StepPlan(first=0.25 * min(step, 0.5 * span), largest=min(step, 0.5 * span))
        orbits = OrbitsPlan(
            key=self.plan.key, start=begin.at, stop=end, period=period, from_="state", switch=[], step=steps
        )
        scene = constant(self.scene.replace({self.plan.key: begin.at}))
        start = accurate(beginning_at(scene, np.array(begin.state)), orbits.tolerance)
        record = yield Task(part, (start, orbits, None, Known([], [], [])), lambda reason: NOTHING)
        rows = record["rows"]
        ends = next((place for place, row in enumerate(rows) if not row["stable"]), 0)
        special = [one for one in record["special"] if one["after"] == ends and one["kind"] in SMOOTH]
        if not ends or not special:
            return None
        told = {"motion": "periodic", "outcome": "ok"}
        branch = [Value(row["value"], "orbit", {**row, **told}, row["state"]) for row in rows[:ends]]
        if self.plan.from_ == "neighbour":
            seen += branch[1:]
        at = special[0]["value"]
        inner = yield from self._value(at + BESIDE * (begin.at - at), "beside", branch[-1])
        beyond = min(BESIDE * span, 0.5 * abs(end - at))
        outer = yield from self._value(at + math.copysign(beyond, end - at), "beside", inner)
        seen += [inner, outer]
        lingers = self._alike(inner, outer) or outer.leaving or outer.row["motion"] == "undecided"
        if inner.failed or outer.failed or not self._alike(begin, inner) or (lingers and not self._of_motion):
            return None
        kind = "level crossing" if apart(inner, outer, self.plan) < GRADUAL else "jump"
        low, high = sorted((inner, outer), key=lambda value: value.at)
        return Threshold(low, high, at, "depends on how long" if lingers else kind, special[0]["kind"])

    # -- fractal borders -----------------------------------------------------------------------------------------------

    def shares(self, thresholds: Sequence[Threshold]) -> list[tuple[float, ...]]:
        """Return which shares of pairs beside each threshold differ at the distances, the largest first.

        Pairs on both sides of a threshold do not count. The smaller distances are looked at only if pairs differ at the
        largest, as a border that is finer there would show at this one too. Nothing is looked at with neighbours, at
        special points, and where measures meet: none of these is a border between starts.
        """
        known = [threshold.value for threshold in thresholds]
        found = []
        for number, (at, threshold) in enumerate(zip(known, thresholds, strict=True)):
            shares: tuple[float, ...] = ()
            if self.plan.from_ == "neighbour" or threshold.special or threshold.kind == "level crossing":
                found.append(shares)
                continue
            begins = self._run(f"pair-{number}", [self._single(self._moved(p), "pair") for p in self._places(at)])
            for distance in DISTANCES:
                places = [place + distance for place in self._places(at)]
                chains = [self._single(self._moved(place), "pair") for place in places]
                ends = self._run(f"pair-{number}-{distance:g}", chains)
                different = [
                    not (one.failed or other.failed or self._alike(one, other))
                    and not any(one.at <= value <= other.at for value in known)
                    for one, other in zip(begins, ends, strict=True)
                ]
                shares = (*shares, sum(different) / PAIRS)
                if not shares[0]:
                    break
            found.append(shares)
        return found

    def _places(self, value: float) -> list[float]:
        """Return places beside a threshold, from 0 at the start of the range to 1 at its stop."""
        plan = self.plan
        log = plan.scale == "log"
        place = (
            math.log(value / plan.start, plan.stop / plan.start)
            if log
            else (value - plan.start) / (plan.stop - plan.start)
        )
        first = min(max(place - 0.5 * AROUND, 0.0), 1.0 - AROUND - DISTANCES[0])
        return [first + (i + 0.5) / PAIRS * AROUND for i in range(PAIRS)]

    def _moved(self, place: float) -> float:
        """Return the value of the key at a place of the range."""
        start, stop = self.plan.start, self.plan.stop
        return float(start * (stop / start) ** place if self.plan.scale == "log" else start + place * (stop - start))
