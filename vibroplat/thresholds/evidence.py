"""What all evaluated values together say about thresholds: where outcomes are mixed, and beyond which value they agree.

All of it follows from the values alone; nothing is simulated here.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from vibroplat.config.study_plans import FindPlan
from vibroplat.thresholds.values import ScanPoint

#: Values evaluated in a round beyond an end of a mixed interval, up to the end of the range, with distances that form a
#: geometric series. Where the asker wants the outcome beyond this end, N_EVEN of them first lie evenly, up to half of
#: the interval's width away: with the screen of the templates, outcomes that contradict are found there in windows of
#: 0.3 % to 1.5 % of the width, ever sparser outward.
VALUES_PER_ROUND, N_EVEN, EVEN_FRACTION = 20, 40, 0.5
#: Most seeds that failed near an end and are tried beyond it.
MAX_FAILING_SEEDS = 5
#: Largest number of rounds. Screen and feeder of the templates, with 4 and 6 poles, take at most six.
MAX_ROUNDS = 10
#: Values near a threshold that show whether it is the only change: their number on each side of a jump and of another
#: threshold, and the largest distance relative to the range. Their distances form a geometric series from the tolerance
#: on, as mixed intervals have all widths.
VALUES_NEAR_JUMP, VALUES_NEAR_OTHER, MAX_REACH = 12, 2, 0.1
#: Values all over the range that begin with other seeds, and where the first is in its part of the range: not in the
#: middle, where one of the scan may be.
VALUES_BETWEEN, FIRST_OFFSET = 8, 0.382
#: Pairs of values in a mixed interval, and the distances of their values relative to the width of the interval.
PAIRS, DISTANCES = 16, (1e-2, 1e-3, 1e-4)
#: Minimum number of pairs that differ at the smallest distance where the border is fractal, and their minimum ratio to
#: the number of those that differ at the largest.
MIN_PAIRS, MIN_RATIO = 2, 0.25


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


class ClearRange(NamedTuple):
    """Values on one side of a threshold, up to the next threshold or the end of the range, that have one outcome.

    Attributes
    ----------
    nearest
        The value nearest to the threshold; None if there is none.
    tried
        Number of different values of the key.
    seeds
        Number of different seeds with which these starts were perturbed.
    last
        Value of the key that is farthest from the threshold.
    unknown
        Number of values at which the outcome is unknown; they are not in ``tried``.
    limit
        Where the next threshold begins, or the end of the range.
    """

    nearest: ScanPoint | None
    tried: int
    seeds: int
    last: float
    unknown: int
    limit: float


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
    shares
        Fractions of pairs of values in the mixed interval that differ, for each distance.
    open_ended
        Whether the interval was still growing when the search ended.
    """

    thresholds: Sequence[Threshold]
    mixed: Sequence[ScanPoint]
    below: ClearRange
    above: ClearRange
    shares: tuple[float, ...] = ()
    open_ended: bool = False

    @property
    def ends(self) -> tuple[float, float] | None:
        """The smallest and the largest value of the key in the mixed interval; None if nothing is mixed."""
        return (self.mixed[0].value, self.mixed[-1].value) if self.mixed else None

    @property
    def fractal(self) -> bool:
        """Whether pairs of values differ however near they are."""
        return is_fractal(self.shares)


def is_fractal(shares: Sequence[float]) -> bool:
    """Return whether pairs differ at the smallest distance nearly as often as at the largest."""
    return len(shares) == len(DISTANCES) and shares[-1] * PAIRS >= max(MIN_PAIRS, MIN_RATIO * shares[0] * PAIRS)


class _Hull:
    """A threshold and the changes that contradict it."""

    def __init__(self, threshold: Threshold) -> None:
        self.thresholds = [threshold]
        self.changes: list[tuple[ScanPoint, ScanPoint]] = []
        self.contradicted = False

    @property
    def edges(self) -> tuple[float, float]:
        """The values of the key between which all its changes are."""
        lows = [one.low.value for one in self.thresholds] + [below.value for below, _ in self.changes]
        highs = [one.high.value for one in self.thresholds] + [above.value for _, above in self.changes]
        return min(lows), max(highs)

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
    begins = [plan.start, *(hull.edges[1] for hull in hulls)]
    ends = [*(hull.edges[0] for hull in hulls[1:]), plan.stop]
    return [_zone(hull, known, plan, *limits) for hull, *limits in zip(hulls, begins, ends, strict=False)]


def _is_within(change: tuple[ScanPoint, ScanPoint], threshold: Threshold) -> bool:
    return threshold.low.value <= change[0].value < change[1].value <= threshold.high.value


def _merge(hulls: Sequence[_Hull]) -> list[_Hull]:
    """Join those that overlap."""
    merged: list[_Hull] = []
    for hull in sorted(hulls, key=lambda hull: hull.edges):
        if merged and hull.edges[0] < merged[-1].edges[1]:
            merged[-1].take(hull)
        else:
            merged.append(hull)
    return merged


def _zone(hull: _Hull, known: Sequence[ScanPoint], plan: FindPlan, begin: float, end: float) -> Zone:
    """Return what is known around a hull, from ``known`` values in ascending order between two limits."""
    first, last = hull.edges
    mixed: list[ScanPoint] = []
    if hull.contradicted:
        first = min([*(one.high.value for one in hull.thresholds), *(above.value for _, above in hull.changes)])
        last = max([*(one.low.value for one in hull.thresholds), *(below.value for below, _ in hull.changes)])
        mixed = [value for value in known if first <= value.value <= last]
        lower = [value for value in known if begin <= value.value < first]
        upper = [value for value in known if last < value.value <= end]
    else:
        lower = [value for value in known if begin <= value.value <= first]
        upper = [value for value in known if last <= value.value <= end]
    below, above = _clear(lower[::-1], plan, begin), _clear(upper, plan, end)
    return Zone(sorted(hull.thresholds, key=lambda one: one.value), mixed, below, above)


def _clear(values: Sequence[ScanPoint], plan: FindPlan, limit: float) -> ClearRange:
    """Summarize values with one outcome, the nearest to the threshold first."""
    good = [value for value in values if value.is_classified(plan)]
    nearest, last = (good[0], good[-1].value) if good else (None, math.nan)
    tried, seeds = ({getattr(value, name) for value in good} for name in ("value", "seed"))
    return ClearRange(nearest, len(tried), len(seeds), last, len(values) - len(good), limit)


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

    def near(self, threshold: Threshold, count: int = VALUES_NEAR_JUMP) -> list[float]:
        """Return so many values of the key near a threshold on each side, within the range."""
        low, high = self.place_of(threshold.low.value), self.place_of(threshold.high.value)
        nearest = min(high - low, 0.5 * MAX_REACH)
        distances = [nearest * (MAX_REACH / nearest) ** (k / (count - 1)) for k in range(count)]
        parts = [low - distance for distance in distances] + [high + distance for distance in distances]
        return [self.value(part) for part in parts if 0.0 <= part <= 1.0]

    def beyond(self, zone: Zone, upward: bool) -> list[float]:
        """Return values of the key beyond the lower or the upper end of a mixed interval, denser near it."""
        low, high = self._mixed_ends(zone)
        edge, clear = (high, zone.above) if upward else (low, zone.below)
        length = abs(self.place_of(clear.limit) - edge)
        if length == 0.0:
            return []
        even = min(EVEN_FRACTION * self._width(zone), length)
        distances = [(k + 0.5) / N_EVEN * even for k in range(N_EVEN if is_wanted(zone, upward, self.plan) else 0)]
        nearest = even if distances and even < 0.9 * length else even / N_EVEN
        distances += [nearest * (length / nearest) ** ((k + 0.5) / VALUES_PER_ROUND) for k in range(VALUES_PER_ROUND)]
        return [self.value(edge + distance if upward else edge - distance) for distance in distances]

    def pairs(self, zone: Zone) -> list[list[float]]:
        """Return values spread over a mixed interval, and for each of the distances the values that far above them."""
        width = self._width(zone)
        first = min(max(0.5 * (sum(self._mixed_ends(zone)) - width), 0.0), 1.0 - width)
        parts = [first + (k + 0.5) / PAIRS * (1.0 - DISTANCES[0]) * width for k in range(PAIRS)]
        return [[self.value(part + distance * width) for part in parts] for distance in (0.0, *DISTANCES)]

    def _mixed_ends(self, zone: Zone) -> tuple[float, float]:
        assert zone.ends is not None
        return self.place_of(zone.ends[0]), self.place_of(zone.ends[1])

    def _width(self, zone: Zone) -> float:
        """Return the width of a mixed interval; one with a single value has that of the tolerance."""
        low, high = self._mixed_ends(zone)
        return max(high - low, self.plan.narrow / (self.plan.stop - self.plan.start))


def is_wanted(zone: Zone, upward: bool, plan: FindPlan) -> bool:
    """Return whether the asker wants the outcome above or below a mixed interval: where an expression holds."""
    nearest = (zone.above if upward else zone.below).nearest
    return nearest is not None and nearest.outcome(plan) is True


def failing_seeds(zone: Zone, upward: bool, plan: FindPlan) -> list[int]:
    """Return seeds with which the outcome beyond an end of a mixed interval is not found in it, nearest to it first."""
    nearest = (zone.above if upward else zone.below).nearest
    if nearest is None:
        return []
    failing = [one for one in zone.mixed if one.is_classified(plan) and one.outcome(plan) != nearest.outcome(plan)]
    return list(dict.fromkeys(one.seed for one in (failing[::-1] if upward else failing)))[:MAX_FAILING_SEEDS]


def open_ends(all_zones: Sequence[Zone], searched: Collection[tuple[float, bool]]) -> Iterator[tuple[Zone, bool]]:
    """Yield mixed intervals and their ends, True for the upper one, beyond which no round of values was evaluated."""
    for zone in all_zones:
        for upward, end in zip((False, True), zone.ends or (), strict=False):
            if (end, upward) not in searched:
                yield zone, upward


def facts(zone: Zone) -> dict[str, Any]:
    """Return the columns of the table of thresholds that are the same for all thresholds of a zone."""
    low, high = zone.ends or (None, None)
    return {
        "fractal": zone.fractal,
        "mixed_low": low,
        "mixed_high": high,
        "tried_below": zone.below.tried,
        "tried_down_to": zone.below.last,
        "tried_above": zone.above.tried,
        "tried_up_to": zone.above.last,
    }
