"""Thresholds of a key: a scan shows where the outcome changes, and each change is narrowed in a chain of its own.

Where motion on one side repeats, its orbit is followed over the key first: where it loses its stability inside the
interval, and motion converges to it up to there, that point is the threshold. Elsewhere the interval is bisected.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count, islice, pairwise
from typing import TypeVar

import numpy as np
import pandas as pd

from vibroplat.config.plans import OrbitsPlan, StepPlan
from vibroplat.config.scene import Scene
from vibroplat.config.study_plans import FindPlan
from vibroplat.continuation.branch_tasks import KnownPoints, compute_part
from vibroplat.continuation.orbit import with_initial_state, with_orbit_tolerance
from vibroplat.continuation.special_points import SMOOTH_LOSSES
from vibroplat.errors import ConfigError
from vibroplat.model.sensitivity import parameter_direction, value_of
from vibroplat.study.bands import find_jumps
from vibroplat.study.branches import column_of, convert_state
from vibroplat.study.point import failed_record
from vibroplat.study.pool import Pool, StoredChain, Task, Tasks, run_stored
from vibroplat.study.store import Record, Store
from vibroplat.study.study import Progress
from vibroplat.thresholds.distinct import Indistinct, Pair, indistinct, is_doubtful, repeat_outward
from vibroplat.thresholds.evidence import (
    FIRST_STARTS,
    MAX_ROUNDS,
    STARTS,
    VALUES_BETWEEN,
    ScaledKey,
    Threshold,
    Zone,
    is_wanted,
    may_depend_on_seed,
    not_narrowed,
    zones,
)
from vibroplat.thresholds.values import (
    ScanPoint,
    evaluate,
    kind_of_crossing,
    measures_meet,
    relative_difference,
    scale_of,
    start_time,
    sure_around,
    with_final_supply,
)

#: Where the motion beside the end of an orbit's stability is measured, over the distance to the end of the interval.
CHECK_OFFSET = 0.02
#: Most halvings that tell a jump from a level that is crossed.
MAX_HALVINGS = 20
#: Change of the measures beyond a special point where stability is lost that is no jump.
MAX_GRADUAL = 0.1
#: Longest period of an orbit that is followed beside chaos: motion comes to a longer one by luck, in a narrow window,
#: and its branch may take as long as a sweep (64 turns: 7 s).
MAX_PERIOD = 8
#: Most starts whose time is measured, and chains in which those of a round are made: each chain ends at its first
#: contradiction.
TIMED_STARTS, CHAINS = 20, FIRST_STARTS
#: Starts at the nearest value of a round in batches, each after the one before has found no contradiction. Where every
#: second start differs, 8 show it in 255 of 256 cases, and where every tenth does, in 4 of 7.
BATCHES = (CHAINS, CHAINS, 2 * CHAINS, 2 * CHAINS, 3 * CHAINS, STARTS - 9 * CHAINS)
#: Batch in which a start is made at each other value of a later round: after the first starts at the nearest value,
#: which may still be in the mixed interval. In the first round they tell how far outcomes are mixed.
LATER_BATCH_OF_OTHERS = 1
#: Record of an orbit that cannot be followed.
EMPTY_RECORD: Record = {"rows": [], "special": []}

T = TypeVar("T")
Ends = Sequence[tuple[Zone, bool]]


def start_key(scene: Scene, seed: int | None = None) -> tuple[int, ...]:
    """Return what determines the perturbation of a start: that of a run of the scene, as given or with another seed."""
    return scene.run.seed if seed is None else seed, 0, round(1e6 * scene.drive.largest_frequency)


@dataclass
class ThresholdSearch:
    """Searches for the thresholds of a section ``find``, in chains of tasks.

    Attributes
    ----------
    scene, plan
        A scene and its section.
    store, workers, progress
        As :meth:`vibroplat.study.study.Study.run` gets them.
    evaluated
        All values that were evaluated besides those of the scan, in the order of chains.
    indistinct
        Where attractors cannot be told apart, so that changes are not narrowed; None if they can.
    """

    scene: Scene
    plan: FindPlan
    store: Store
    workers: Pool
    progress: Progress
    evaluated: list[ScanPoint] = field(default_factory=list)
    indistinct: Indistinct | None = None

    def __post_init__(self) -> None:
        self._places = ScaledKey(self.plan)
        self._done = self._known = 0
        self._beside_chaos = False
        #: Seeds after that of the scene, each for one start only: none that was seen says how another fares.
        self._seeds = count(1)

    def thresholds(self) -> tuple[list[ScanPoint], list[Threshold]]:
        """Return the values of the scan in ascending order, and the thresholds between them."""
        if self.plan.from_ == "previous":
            return self._scan_outward()
        scan = self._run("scan", [self._single(at, "scan") for at in self.plan.over.upward])
        changes = self._changes(scan)
        if self.disturbed and not any(map(self._is_doubtful, changes)):
            others = self._run("seed", [self._single(at, "seed", next(self._seeds)) for at in self._places.between()])
            every = self._changes(sorted([*scan, *others], key=lambda value: value.value))
            if not changes or any(map(self._is_doubtful, every)):  # what the seed of the scene alone does not show
                changes = every
        self._beside_chaos = any(map(self._is_doubtful, changes))
        located = self._run("branch", [self._locate(*change) for change in changes])
        left = [change for change, point in zip(changes, located, strict=True) if point is None]
        narrowed: list[Threshold | None] = [not_narrowed(*change) for change in left]
        if not any(map(self._is_doubtful, left)):
            narrowed = self._run("border", [self._bisect(*change) for change in left])
        thresholds = [threshold for threshold in (*located, *narrowed) if threshold is not None]
        self.indistinct = indistinct(thresholds, [*scan, *self.evaluated], self.plan)
        if self.indistinct is not None and self.disturbed:
            ways = self.indistinct.outward([*scan, *self.evaluated])
            self._run("side", [self._repeat_outward(way) for way in ways])
            self.indistinct = indistinct(thresholds, [*scan, *self.evaluated], self.plan)
        return scan, thresholds

    def _repeat_outward(self, way: Sequence[ScanPoint]) -> Tasks[tuple[bool, list[ScanPoint]]]:
        seeds = count(VALUES_BETWEEN + 1)
        return repeat_outward(way, lambda at: self._value(at, "seed", other=next(seeds)), self.plan)

    def _is_doubtful(self, change: Pair) -> bool:
        """Whether attractors are compared, and those on both sides of a change cannot be told apart."""
        return self.plan.of_motion and self.plan.from_ == "initial" and is_doubtful(change)

    @property
    def disturbed(self) -> bool:
        """Whether the seed decides how motion starts at each value."""
        return self.plan.from_ == "initial" and self.scene.start_perturbation > 0.0

    def _run(self, name: str, chains: Sequence[Tasks[tuple[T, list[ScanPoint]]]]) -> list[T]:
        """Run chains side by side, and gather what they have seen in their order."""
        stored = [StoredChain(chain, self.store, f"{name}-{number}") for number, chain in enumerate(chains)]
        self._known += len(stored)
        done = self._done
        results = run_stored(stored, self.workers, lambda ended: self.progress(done + ended, self._known))
        self._done += len(stored)
        for _, evaluated in results:
            self.evaluated += evaluated
        return [result for result, _ in results]

    # -- values --------------------------------------------------------------------------------------------------------

    def _single(
        self, at: float, stage: str, other: int = 0, times: int = 1
    ) -> Tasks[tuple[ScanPoint, list[ScanPoint]]]:
        """Look at one value, with the seed of the scene or the ``other``-th after it."""
        value = yield from self._value(at, stage, times=times, other=other)
        return value, [] if stage == "scan" else [value]

    def _value(
        self, at: float, stage: str, near: ScanPoint | None = None, times: int = 1, other: int = 0
    ) -> Tasks[ScanPoint]:
        """Evaluate a value of the key; with ``previous`` the motion continues from ``near``."""
        scene, state = self.scene.replace({self.plan.key: at}), None
        if near is not None and near.state is not None and self.plan.from_ == "previous":
            before = self.scene.replace({self.plan.key: near.value})
            scene, state = with_final_supply(scene), convert_state(near.state, before, scene)
        seed = self.scene.run.seed + other
        record = yield Task(evaluate, (scene, self.plan, state, times, start_key(self.scene, seed)), failed_record)
        return ScanPoint(at, stage, record["row"], record["state"], seed)

    def _alike(self, one: ScanPoint, other: ScanPoint) -> bool:
        return bool(one.outcome(self.plan) == other.outcome(self.plan))

    def _differ(self, one: ScanPoint, other: ScanPoint) -> bool:
        return one.is_classified(self.plan) and other.is_classified(self.plan) and not self._alike(one, other)

    def _changes(self, scan: Sequence[ScanPoint]) -> list[Pair]:
        """Return the neighbours, of those with an outcome, between which it changes, or measures leap."""
        good = [value for value in scan if not (value.failed or value.is_either_side(self.plan))]
        leaps = [False] * (len(good) - 1)
        if self.plan.of_motion:
            rows = [{column_of(self.plan.key): value.value, **value.row} for value in good]
            leaps = find_jumps(pd.DataFrame(rows)).tolist()
        return [ends for ends, leap in zip(pairwise(good), leaps, strict=False) if leap or not self._alike(*ends)]

    # -- from value to value -------------------------------------------------------------------------------------------

    def _scan_outward(self) -> tuple[list[ScanPoint], list[Threshold]]:
        """Carry the motion on from the scene's own value of the key in both directions."""
        plan = self.plan
        own = value_of(self.scene, plan.key)
        own = plan.start if own is None else min(max(own, plan.start), plan.stop)
        first = self._run("own", [self._single(own, "scan")])[0]
        if first.failed:
            return [first], []
        above = [value for value in plan.over.upward if value > own]
        below = [value for value in reversed(plan.over.upward) if value < own]
        ways = self._run("way", [self._scan_one_way(first, way) for way in (below, above) if way])
        scan = sorted([first, *(value for values, _ in ways for value in values)], key=lambda value: value.value)
        return scan, [threshold for _, threshold in ways if threshold is not None]

    def _scan_one_way(
        self, first: ScanPoint, way: Sequence[float]
    ) -> Tasks[tuple[tuple[list[ScanPoint], Threshold | None], list[ScanPoint]]]:
        """Carry the motion on along a way until the outcome changes; values up to there, and the threshold."""
        evaluated: list[ScanPoint] = []
        values = [first]
        point = None
        ahead = [at for at in way if self._continuous(at)]
        if ahead and self.plan.expression is None:
            point = yield from self._locate_on_branch(first, ahead[-1], abs(way[0] - first.value), evaluated)
        if point is not None:
            return ([], point), evaluated
        before, threshold = first, None
        for at in way:
            value = yield from self._value(at, "scan", values[-1])
            values.append(value)
            if value.failed:
                break
            if value.is_either_side(self.plan):
                continue
            if not self._alike(before, value):
                threshold, more = yield from self._locate(before, value)
                evaluated += more
                if threshold is None:
                    threshold, more = yield from self._bisect(before, value)
                    evaluated += more
                break
            before = value
        return (values[1:], threshold), evaluated

    # -- one change ----------------------------------------------------------------------------------------------------

    def _locate(self, one: ScanPoint, other: ScanPoint) -> Tasks[tuple[Threshold | None, list[ScanPoint]]]:
        """Look for a change between two values on the branch of an orbit, with ``previous`` on that of the first."""
        evaluated: list[ScanPoint] = []
        for begin, end in ((one, other), (other, one)):
            if self._is_doubtful((one, other)) and begin.row["period"] > MAX_PERIOD:
                continue
            point = yield from self._locate_on_branch(begin, end.value, abs(other.value - one.value), evaluated)
            if point is not None:
                return point, evaluated
            if self.plan.from_ == "previous":
                break
        return None, evaluated

    def _bisect(self, one: ScanPoint, other: ScanPoint) -> Tasks[tuple[Threshold | None, list[ScanPoint]]]:
        """Narrow a change between two values, the motion of the first of which is continued with ``previous``.

        There is none where measures that leap between values of the scan meet as they draw nearer. It is not narrowed
        further where attractors on both sides cannot be told apart.
        """
        evaluated: list[ScanPoint] = []
        ends, before = (one, other), one if self.plan.from_ == "previous" else None
        while abs(other.value - one.value) > self.plan.narrow and not self._is_doubtful((one, other)):
            nearer = yield from self._halve(one, other, evaluated)
            if nearer is None:
                break
            one, other = nearer
        if self._is_doubtful((one, other)):
            return not_narrowed(one, other), evaluated
        meet = yield from self._meet(one, other, evaluated)
        if meet and self._alike(one, other):
            return None, evaluated
        low, high = sorted((one, other), key=lambda value: value.value)
        low, high = sure_around(low, high, [*ends, *evaluated], self.plan)
        kind = kind_of_crossing(low, high, self.plan) if meet else "jump"
        for end in (low, high):
            longer = yield from self._value(end.value, "extended", before, 2)
            evaluated.append(longer)
            if longer.failed or not self._alike(longer, end):
                kind = "unresolved-transient"
        return Threshold(low, high, 0.5 * (low.value + high.value), kind, ""), evaluated

    def _halve(
        self, one: ScanPoint, other: ScanPoint, evaluated: list[ScanPoint]
    ) -> Tasks[tuple[ScanPoint, ScanPoint] | None]:
        """Return the half of an interval in which the change is, or the larger change; None if that is unknown."""
        middle = yield from self._value(0.5 * (one.value + other.value), "bisection", one)
        evaluated.append(middle)
        if middle.failed or middle.value in (one.value, other.value):
            return None
        if self._alike(one, other):
            near = relative_difference(one, middle, self.plan) < relative_difference(middle, other, self.plan)
        else:
            near = self._alike(one, middle)
        return (middle, other) if near else (one, middle)

    def _meet(self, one: ScanPoint, other: ScanPoint, evaluated: list[ScanPoint]) -> Tasks[bool]:
        """Halve an interval further until it is known whether the measures at its ends meet."""
        brackets = [(one, other)]
        meet = measures_meet(brackets, self.plan)
        while meet is None and len(brackets) <= MAX_HALVINGS:
            nearer = yield from self._halve(*brackets[-1], evaluated)
            if nearer is None:
                break
            brackets.append(nearer)
            meet = measures_meet(brackets, self.plan)
        return bool(meet)

    def _continuous(self, at: float) -> bool:
        """Whether orbits can be followed over the key at a value of it; not where it takes the layers away."""
        try:
            parameter_direction(self.scene.replace({self.plan.key: float(at)}), self.plan.key)
        except ConfigError:
            return False
        return True

    def _locate_on_branch(
        self, begin: ScanPoint, end: float, step: float, evaluated: list[ScanPoint]
    ) -> Tasks[Threshold | None]:
        """Follow the orbit of a value towards another one; the threshold where it loses its stability.

        It is one if the motion converges to the orbit just before, and has another outcome just beyond.
        """
        period = begin.row["period"]
        known = period and begin.row.get("multiplier_max") and not begin.leaving
        if not (known and self._continuous(begin.value) and self._continuous(end)):
            return None
        span = abs(end - begin.value)
        steps = StepPlan(first=0.25 * min(step, 0.5 * span), max=min(step, 0.5 * span))
        orbits = OrbitsPlan(
            key=self.plan.key, start=begin.value, stop=end, period=period, from_="state", switch=[], step=steps
        )
        scene = with_final_supply(self.scene.replace({self.plan.key: begin.value}))
        start = with_orbit_tolerance(with_initial_state(scene, np.array(begin.state)), orbits.tolerance)
        record = yield Task(compute_part, (start, orbits, None, KnownPoints([], [], [])), lambda reason: EMPTY_RECORD)
        rows = record["rows"]
        ends = next((index for index, row in enumerate(rows) if not row["stable"]), 0)
        special = [one for one in record["special"] if one["after"] == ends and one["kind"] in SMOOTH_LOSSES]
        if not ends or not special:
            return None
        columns = {"motion": "periodic", "outcome": "ok"}
        branch = [ScanPoint(row["value"], "orbit", {**row, **columns}, row["state"]) for row in rows[:ends]]
        if self.plan.from_ == "previous":
            evaluated += branch[1:]
        at = special[0]["value"]
        inner = yield from self._value(at + CHECK_OFFSET * (begin.value - at), "beside", branch[-1])
        evaluated.append(inner)
        if inner.failed or not self._alike(begin, inner):
            return None
        beyond = min(CHECK_OFFSET * span, 0.5 * abs(end - at))
        outer = yield from self._value(at + math.copysign(beyond, end - at), "beside", inner)
        evaluated.append(outer)
        lingers = self._alike(inner, outer) or outer.leaving or outer.row["motion"] == "undecided"
        if outer.failed or (lingers and not self.plan.of_motion):
            return None
        gradual = relative_difference(inner, outer, self.plan) < MAX_GRADUAL * scale_of(inner, outer, self.plan)
        kind = kind_of_crossing(inner, outer, self.plan) if gradual else "jump"
        low, high = sorted((inner, outer), key=lambda value: value.value)
        return Threshold(low, high, at, "unresolved-transient" if lingers else kind, special[0]["kind"])

    # -- mixed intervals -----------------------------------------------------------------------------------------------

    def evidence(self, scan: Sequence[ScanPoint], thresholds: Sequence[Threshold]) -> list[Zone]:
        """Return what all values say about the thresholds, and look for values that contradict them.

        Rounds of starts, each with a seed of its own, follow beyond both ends of a mixed interval and beyond both sides
        of a jump until none in a round contradicts, as a sharp threshold must not depend on the seed; so they do where
        measures meet within their standard errors, where a measure of chaos scatters around a level. Nothing is
        searched for with ``previous``, where the outcome at a value depends on the way to it, nor beside chaos.
        """
        if self.plan.from_ == "previous" or self._beside_chaos or self.indistinct is not None:
            return zones([*scan, *self.evaluated], thresholds, self.plan)
        searched: set[tuple[float, bool]] = set()
        for number in range(MAX_ROUNDS + 1):
            all_zones = zones([*scan, *self.evaluated], thresholds, self.plan)
            ends = [end for zone in all_zones for end in self._open_ends(zone, searched)]
            if not ends or number == MAX_ROUNDS or self.indistinct is not None:
                break
            searched |= {(zone.edges[upward], upward) for zone, upward in ends}
            self._make_round(number, ends, scan, thresholds)
        growing = [zone for zone, _ in ends]
        return [zone._replace(open_ended=any(zone is one for one in growing)) for zone in all_zones]

    def _open_ends(self, zone: Zone, searched: Collection[tuple[float, bool]]) -> list[tuple[Zone, bool]]:
        """Return a zone with each of its ends, True for the upper one, beyond which no round was."""
        if not (zone.mixed or any(may_depend_on_seed(one, self.plan) for one in zone.thresholds)):
            return []
        return [(zone, upward) for upward in (False, True) if (zone.edges[upward], upward) not in searched]

    def _make_round(self, number: int, ends: Ends, scan: Sequence[ScanPoint], thresholds: Sequence[Threshold]) -> None:
        """Make a round of starts beyond ends in batches, until one contradicts the end or shows chaos."""
        for batch in range(len(BATCHES)):
            clear = []
            for place, end in enumerate(ends):
                found = self._run(f"beyond-{number}-{batch}-{place}", list(self._beyond(*end, number, batch)))
                if not any(found):
                    clear.append(end)
                self.indistinct = indistinct(thresholds, [*scan, *self.evaluated], self.plan)
                if self.indistinct is not None:
                    return
            ends = clear

    def _beyond(
        self, zone: Zone, upward: bool, number: int, batch: int
    ) -> Iterator[Tasks[tuple[bool, list[ScanPoint]]]]:
        """Yield the chains of a batch beyond an end of a zone, in one batch also a start at each other value."""
        places = self._places.beyond(zone, upward, number)
        unsure = self.disturbed and is_wanted(zone, upward, self.plan) and not zone.side(upward).sure
        if places and (unsure or batch == 0):
            seeds = list(islice(self._seeds, BATCHES[batch] if unsure else 1))
            yield from (
                self._challenge(places[0], part, zone, upward) for k in range(CHAINS) if (part := seeds[k::CHAINS])
            )
        if batch == (LATER_BATCH_OF_OTHERS if number else 0):
            yield from (self._challenge(at, [next(self._seeds)], zone, upward) for at in places[1:])

    def _challenge(
        self, at: float, seeds: Sequence[int], zone: Zone, upward: bool
    ) -> Tasks[tuple[bool, list[ScanPoint]]]:
        """Evaluate a value with these seeds until one contradicts what is known beyond an end of a zone; whether so."""
        evaluated: list[ScanPoint] = []
        nearest = zone.side(upward).nearest
        for seed in seeds:
            evaluated.append((yield from self._value(at, "beyond", other=seed)))
            if nearest is None or self._differ(nearest, evaluated[-1]):
                return nearest is not None, evaluated
        return False, evaluated

    def start_times(self, at: float) -> list[float]:
        """Return how long starts at a value that was evaluated take (s), of those without a slow motor."""
        known = {value.seed: value.row for value in self.evaluated if value.value == at and not value.failed}
        seconds = max((row["settle_s"] for row in known.values()), default=self.plan.max_settle_s)
        seeds = islice(known, TIMED_STARTS)
        scenes = [self.scene.replace({self.plan.key: at, "run.seed": seed}) for seed in seeds]
        times = self._run(f"start-{at!r}", [self._start_time(scene, seconds) for scene in scenes])
        return sorted(time for time in times if time is not None)

    def _start_time(self, scene: Scene, seconds: float) -> Tasks[tuple[float | None, list[ScanPoint]]]:
        record = yield Task(start_time, (scene, seconds), lambda reason: {"seconds": None})
        return record["seconds"], []
