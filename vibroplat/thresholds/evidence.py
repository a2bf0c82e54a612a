"""What all evaluated values together say about thresholds: where outcomes are mixed, and beyond which value they agree.

All of it follows from the values alone; nothing is simulated here.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from vibroplat.config.study_plans import FindPlan
from vibroplat.thresholds.values import LEVEL_CROSSING, OPPOSITE_CROSSING, ScanPoint, has_errors

#: Largest number of rounds.
MAX_ROUNDS = 10
#: Where all of :data:`STARTS` starts with new seeds have one outcome, the fraction of starts that have another is at
#: most the first, but for the second probability: without a failure of n starts the fraction p has the probability
#: (1 - p)**n, and each of the rounds may be the one that errs.
MAX_OTHER_FRACTION, ERROR_PROBABILITY = 0.05, 0.05
STARTS = math.ceil(math.log(ERROR_PROBABILITY / MAX_ROUNDS) / math.log1p(-MAX_OTHER_FRACTION))
#: Starts in the first batch at a value.
FIRST_STARTS = 8
#: Distance of these starts from an end of a mixed interval, relative to its width. It is twice, three times … as far if
#: one, two … values near the end have been contradicted by such starts, and at least the square root of half of the
#: fraction of outcomes near the end that differ, up to the second ratio. Fractions fall about exponentially beyond an
#: end. Against 8 % each time, with batches of 8, 24 and 72, the mean evaluations of three made-up machines fall from
#: 1653, 2297 and 992 (four draws each) to 817, 675 and 452 (16 draws); a clear value is up to half of the width away.
CLEAR_DISTANCE_RATIO, MAX_DISTANCE_RATIO = 0.08, 0.5
#: Largest distance relative to that of the next change or the end of the range: what is nearer to that is its own.
MAX_WAY = 0.45
#: Part of a mixed interval next to its end in which outcomes are counted.
END_RATIO = 0.25
#: Values of the first round and of each later one, up to the end of the range, with distances that form a geometric
#: series.
VALUES_PER_ROUND, LATER_VALUES = 30, 4
#: Values all over the range that begin with other seeds, and where the first is in its part of the range: not in the
#: middle, where one of the scan may be.
VALUES_BETWEEN, FIRST_OFFSET = 12, 0.382
#: Kind of a change that is not narrowed, as attractors cannot be told apart.
NOT_NARROWED = "not-narrowed"


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

    low: ScanPoint
    high: ScanPoint
    value: float
    kind: str
    special: str


def may_depend_on_seed(one: Threshold, plan: FindPlan) -> bool:
    """Whether a threshold may depend on the seed: not where a sure measure crosses a level, or passes its opposite.

    Without an expression the measures are sure where an orbit is known on both sides. Where an orbit loses stability
    it may: starts may be captured long before.
    """
    orbits = not one.special and all(end.row.get("multiplier_max") is not None for end in (one.low, one.high))
    crosses = one.kind in (LEVEL_CROSSING, OPPOSITE_CROSSING) and (plan.expression is not None or orbits)
    return not (crosses and not has_errors(one.low, one.high, plan))


def not_narrowed(low: ScanPoint, high: ScanPoint) -> Threshold:
    """Return the change between two values as it is."""
    return Threshold(low, high, 0.5 * (low.value + high.value), NOT_NARROWED, "")


class ClearRange(NamedTuple):
    """Values on one side of a threshold, up to the next threshold or the end of the range, that have one outcome.

    Attributes
    ----------
    all_starts
        One value for each start, with another value of the key or another seed, the nearest to the threshold first.
        The first ones are at the value at which many starts were made, or else at any; empty if there is none.
    unknown
        Number of values at which the outcome is unknown; they are not in ``all_starts``.
    limit
        Where the next threshold or mixed interval begins, or the end of the range.
    """

    all_starts: Sequence[ScanPoint]
    unknown: int
    limit: float

    @property
    def nearest(self) -> ScanPoint | None:
        """The first of them; None if there is none."""
        return self.all_starts[0] if self.all_starts else None

    @property
    def last(self) -> float:
        """Value of the key that is farthest from the threshold."""
        return self.all_starts[-1].value if self.all_starts else math.nan

    @property
    def starts(self) -> int:
        """Number of starts at the nearest value, each with another seed."""
        return sum(value.value == self.all_starts[0].value for value in self.all_starts)

    @property
    def tried(self) -> int:
        """Number of these starts and of those beyond."""
        return len(self.all_starts)

    @property
    def slow(self) -> int:
        """Number of starts there after which an exciter stays far below its synchronous speed."""
        return sum(value.hangs for value in self.all_starts)

    @property
    def sure(self) -> bool:
        """Whether so many starts were made at the nearest value that they tell of others."""
        return self.starts > STARTS // 2

    @property
    def max_other_fraction(self) -> float:
        """Largest fraction of starts at the nearest value that may have another outcome."""
        return float(1.0 - (ERROR_PROBABILITY / MAX_ROUNDS) ** (1.0 / self.starts))


class Zone(NamedTuple):
    """One threshold, or several with an interval in which outcomes are mixed.

    Attributes
    ----------
    thresholds
        The thresholds that were narrowed there, in ascending order.
    mixed
        All values in the mixed interval, in ascending order; empty if no value contradicts the threshold.
    below, above
        The values on both sides.
    open_ended
        Whether its ends still moved when the search ended.
    """

    thresholds: Sequence[Threshold]
    mixed: Sequence[ScanPoint]
    below: ClearRange
    above: ClearRange
    open_ended: bool = False

    @property
    def ends(self) -> tuple[float, float] | None:
        """The smallest and the largest value of the key in the mixed interval; None if nothing is mixed."""
        return (self.mixed[0].value, self.mixed[-1].value) if self.mixed else None

    def side(self, upward: bool) -> ClearRange:
        """Return the values above or below."""
        return self.above if upward else self.below

    def clear_distance_ratio(self, upward: bool, plan: FindPlan) -> float:
        """Return how far beyond an end many starts shall be made, relative to the width; see CLEAR_DISTANCE_RATIO."""
        nearest, ends = self.side(upward).nearest, self.ends
        if ends is None or nearest is None:
            return CLEAR_DISTANCE_RATIO
        length = END_RATIO * (ends[1] - ends[0])
        near = [one for one in self.mixed if one.is_classified(plan) and abs(one.value - ends[upward]) <= length]
        others = sum(one.outcome(plan) != nearest.outcome(plan) for one in near)
        fraction = max(others - 1, 0) / max(len(near) - 1, 1)  # one of them is there because it differs
        tests = sum(starts >= FIRST_STARTS for starts in Counter(one.value for one in near).values())
        return min(max((1 + tests) * CLEAR_DISTANCE_RATIO, math.sqrt(0.5 * fraction)), MAX_DISTANCE_RATIO)

    @property
    def edges(self) -> tuple[float, float]:
        """The ends of the mixed interval, or the values between which a sharp threshold is."""
        return self.ends or (self.thresholds[0].low.value, self.thresholds[-1].high.value)


class _Hull:
    """A threshold and the changes that contradict it."""

    def __init__(self, threshold: Threshold) -> None:
        self.thresholds = [threshold]
        self.changes: list[tuple[ScanPoint, ScanPoint]] = []
        self.contradicted = False

    @property
    def core(self) -> tuple[float, float]:
        """The ends of the mixed interval, or the values between which a sharp threshold is."""
        return self._ends if self.is_mixed else self.edges

    @property
    def is_mixed(self) -> bool:
        """Whether outcomes of both sides were found at a value or alternate."""
        return self.contradicted and self._ends[0] <= self._ends[1]

    @property
    def _ends(self) -> tuple[float, float]:
        """The smallest value with an outcome other than below, and the largest with one other than above."""
        firsts = [one.high.value for one in self.thresholds] + [above.value for _, above in self.changes]
        lasts = [one.low.value for one in self.thresholds] + [below.value for below, _ in self.changes]
        return min(firsts), max(lasts)

    @property
    def edges(self) -> tuple[float, float]:
        """The values of the key between which all its changes are."""
        lows = [one.low.value for one in self.thresholds] + [below.value for below, _ in self.changes]
        highs = [one.high.value for one in self.thresholds] + [above.value for _, above in self.changes]
        return min(lows), max(highs)

    def reaches(self, after: _Hull) -> bool:
        """Whether another one begins where this one ends, in a mixed interval of one of the two."""
        at = self.edges[1]
        mixed = (self.is_mixed and self.core[1] == at) or (after.is_mixed and after.core[0] == at)
        return after.edges[0] == at and mixed

    def take(self, other: _Hull) -> None:
        """Take what another one has."""
        self.thresholds += other.thresholds
        self.changes += other.changes
        self.contradicted = self.contradicted or other.contradicted


def zones(values: Sequence[ScanPoint], thresholds: Sequence[Threshold], plan: FindPlan) -> list[Zone]:
    """Attach each change between evaluated values to a threshold, and return what is known around the thresholds.

    A change within the interval to which a threshold was narrowed is this threshold. Every other change contradicts
    the nearest threshold, if possible one that is no special point of an orbit. Two outcomes at one value, one of them
    after twice the time, contradict it too. Orbits of branches are no evidence, as no motion need converge to them;
    neither are failed runs, and undecided motion where attractors are compared.
    """
    known = sorted((value for value in values if value.reason != "orbit"), key=lambda value: value.value)
    good = [value for value in known if value.is_classified(plan)]
    hulls = [_Hull(one) for one in sorted(thresholds, key=lambda one: one.value)]
    owners = [hull for hull in hulls if not hull.thresholds[0].special] or hulls
    for change in pairwise(good):
        if not hulls or change[0].outcome(plan) == change[1].outcome(plan):
            continue
        owner = next((hull for hull in hulls if _is_within(change, hull.thresholds[0])), None)
        if owner is None:
            owner = min(
                owners, key=lambda hull: abs(hull.thresholds[0].value - 0.5 * (change[0].value + change[1].value))
            )
            owner.contradicted = True
        owner.changes.append(change)
    hulls = _merge(hulls)
    return [_zone(hull, known, plan, *around) for hull, around in zip(hulls, _neighbours(hulls), strict=True)]


def _is_within(change: tuple[ScanPoint, ScanPoint], threshold: Threshold) -> bool:
    return threshold.low.value <= change[0].value < change[1].value <= threshold.high.value


def _merge(hulls: Sequence[_Hull]) -> list[_Hull]:
    """Join those that overlap, or that share a value with several outcomes."""
    merged: list[_Hull] = []
    for hull in sorted(hulls, key=lambda hull: hull.edges):
        if merged and (hull.edges[0] < merged[-1].edges[1] or merged[-1].reaches(hull) or _is_near(merged[-1], hull)):
            merged[-1].take(hull)
        else:
            merged.append(hull)
    return merged


def _is_near(before: _Hull, after: _Hull) -> bool:
    """Whether less is between a mixed interval and the next change than between it and a value that is clear of it."""
    width = max((hull.core[1] - hull.core[0] for hull in (before, after) if hull.is_mixed), default=0.0)
    return after.core[0] - before.core[1] < CLEAR_DISTANCE_RATIO * width


def _neighbours(hulls: Sequence[_Hull]) -> list[tuple[_Hull | None, _Hull | None]]:
    """Return the hulls before and after each."""
    return list(zip([None, *hulls[:-1]], [*hulls[1:], None], strict=True)) if hulls else []


def _zone(hull: _Hull, known: Sequence[ScanPoint], plan: FindPlan, before: _Hull | None, after: _Hull | None) -> Zone:
    """Return what is known around a hull, from ``known`` values in ascending order, up to the hulls next to it."""
    first, last = hull.core
    mixed = [value for value in known if hull.is_mixed and first <= value.value <= last]
    begin = plan.start if before is None else before.core[1]
    end = plan.stop if after is None else after.core[0]
    lower = [value for value in known if _is_clear(value.value, before, hull)]
    upper = [value for value in known if _is_clear(value.value, hull, after)]
    below, above = _clear(lower[::-1], plan, first, begin), _clear(upper, plan, last, end)
    return Zone(sorted(hull.thresholds, key=lambda one: one.value), mixed, below, above)


def _is_clear(at: float, before: _Hull | None, after: _Hull | None) -> bool:
    """Whether a value is between two hulls: the ends of a mixed interval are not, those of a sharp threshold are."""
    above = before is None or at > before.core[1] or (at == before.core[1] and not before.is_mixed)
    below = after is None or at < after.core[0] or (at == after.core[0] and not after.is_mixed)
    return above and below


def _clear(values: Sequence[ScanPoint], plan: FindPlan, edge: float, limit: float) -> ClearRange:
    """Summarize values with one outcome between an edge and a limit, the nearest to the edge first.

    Many starts beyond the middle belong to the next threshold.
    """
    good = {(value.value, value.seed): value for value in values if value.is_classified(plan)}
    starts = Counter(at for at, _ in good)
    near = [at for at in starts if abs(at - edge) <= abs(at - limit)]
    at = next((at for at in near if starts[at] > STARTS // 2), next(iter(starts), math.nan))
    there = [value for value in good.values() if abs(value.value - limit) <= abs(at - limit)]
    return ClearRange(there, sum(not value.is_classified(plan) for value in values), limit)


# -- where further values are evaluated ------------------------------------------------------------------------------


class ScaledKey:
    """Values of the key of a plan as places: 0 at the start of its range, 1 at its stop."""

    def __init__(self, plan: FindPlan) -> None:
        self.plan = plan

    def place_of(self, at: float) -> float:
        """Return the place of a value of the key."""
        start, stop = self.plan.start, self.plan.stop
        return math.log(at / start, stop / start) if self.plan.scale == "log" else (at - start) / (stop - start)

    def value(self, part: float) -> float:
        """Return the value of the key at a place."""
        start, stop = self.plan.start, self.plan.stop
        return float(start * (stop / start) ** part if self.plan.scale == "log" else start + part * (stop - start))

    def between(self) -> list[float]:
        """Return values of the key all over its range."""
        return [self.value((k + FIRST_OFFSET) / VALUES_BETWEEN) for k in range(VALUES_BETWEEN)]

    def beyond(self, zone: Zone, upward: bool, number: int = 0) -> list[float]:
        """Return the values of a round, by its number, beyond the lower or the upper end of a zone, the nearest first.

        The nearest has no more digits than the tolerance, unless no such value is before the limit.
        """
        low, high = map(self.place_of, zone.edges)
        edge, clear = high if upward else low, zone.side(upward)
        length = abs(self.place_of(clear.limit) - edge)
        if length == 0.0:
            return []
        narrow = self.place_of(zone.edges[upward] + self.plan.narrow) - edge
        ratio = zone.clear_distance_ratio(upward, self.plan)
        first = min(max(ratio * (high - low), narrow), MAX_WAY * length)
        values = LATER_VALUES if number else VALUES_PER_ROUND
        distances = [first * (length / first) ** (k / values) for k in range(values)]
        nearest, *others = (self.value(edge + distance if upward else edge - distance) for distance in distances)
        decimals = -math.floor(math.log10(self.plan.narrow))
        steps = nearest * 10.0**decimals
        rounded = round((math.ceil(steps - 1e-6) if upward else math.floor(steps + 1e-6)) / 10.0**decimals, decimals)
        begin, end = sorted((zone.edges[upward], clear.limit))
        return [rounded if begin < rounded < end else nearest, *others]


def is_wanted(zone: Zone, upward: bool, plan: FindPlan) -> bool:
    """Return whether the asker wants the outcome above or below a threshold: any but that an expression is false."""
    nearest = zone.side(upward).nearest
    return nearest is not None and nearest.outcome(plan) not in (False, None)


def facts(zone: Zone) -> dict[str, Any]:
    """Return the columns of the table of thresholds that are the same for all thresholds of a zone."""
    low, high = zone.ends or (None, None)
    return {
        "mixed_low": low,
        "mixed_high": high,
        "clear_below": zone.below.nearest and zone.below.nearest.value,
        "starts_below": zone.below.starts,
        "tried_below": zone.below.tried,
        "tried_down_to": zone.below.last,
        "clear_above": zone.above.nearest and zone.above.nearest.value,
        "starts_above": zone.above.starts,
        "tried_above": zone.above.tried,
        "tried_up_to": zone.above.last,
    }
