"""Whether attractors can be told apart: beside chaos, the class of a motion may depend on its seed and its duration.

Motion that repeats is a class of its own, and so is an exciter that hangs. A change beside any other motion is
doubtful: only the point at which an orbit loses its stability can be located there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import combinations, groupby, pairwise
from typing import NamedTuple

from vibroplat.columns import unit_of
from vibroplat.config.digits import given, interval
from vibroplat.config.study_plans import FindPlan
from vibroplat.study.point import ERRORS
from vibroplat.study.pool import Tasks
from vibroplat.thresholds.evidence import NOT_NARROWED, Threshold
from vibroplat.thresholds.values import NOISE_ERRORS, ScanPoint

#: Measures that may be asked for instead, and the largest difference of repetitions relative to their range.
MEASURES = ("rms_y_m", "rms_x_m", "excitation_frequency_hz", "flight_fraction", "motor_power_w")
MAX_SCATTER = 0.05
#: Settling time relative to ``max_settle_s``, and to the decay by e along the orbit, from which on it is long.
LATE_RATIO, LATE_DECAYS = 1.0 / 9.0, 6.0
#: Starts with other seeds at a value, up to the first that differs: where every third does, one of 70 in 100 cases.
MAX_REPEATED = 3
#: Amplitude (m) below which a vibration is a remainder.
NEGLIGIBLE_M = 1e-7

Pair = tuple[ScanPoint, ScanPoint]


class Indistinct(NamedTuple):
    """A range in which attractors cannot be told apart.

    Attributes
    ----------
    low, high
        Its ends: the changes of the attractor in it were not narrowed.
    pairs
        Motions at one value, of which another seed has made another one.
    """

    low: float
    high: float
    pairs: Sequence[Pair]

    def outward(self, values: Sequence[ScanPoint]) -> tuple[list[ScanPoint], list[ScanPoint]]:
        """Return the values from its ends on downward and upward."""
        known = sorted(values, key=lambda one: one.value)
        below = [one for one in reversed(known) if one.value <= self.low]
        return below, [one for one in known if one.value >= self.high]


def is_doubtful(change: Pair) -> bool:
    """Whether a side of a change does not repeat, so that its class may be luck; a capture is none."""
    return not all(value.row["period"] for value in change) and change[0].hangs == change[1].hangs


def indistinct(thresholds: Sequence[Threshold], values: Sequence[ScanPoint], plan: FindPlan) -> Indistinct | None:
    """Return the range of doubtful changes: those that were not narrowed, and those between neighbouring values.

    Changes at a special point are none. Those between two synchronizations count only if there are no others, as they
    can be asked for by themselves. None if no change is doubtful.
    """
    if not plan.of_motion:
        return None
    good = sorted((one for one in values if one.is_classified(plan)), key=lambda one: one.value)
    changes = [pair for pair in pairwise(good) if pair[0].outcome(plan) != pair[1].outcome(plan)]
    for one in thresholds:
        if one.special:
            beyond = [pair for pair in changes if pair[0].value < one.low.value or pair[1].value > one.high.value]
            changes = [pair for pair in beyond if not pair[0].value < one.value < pair[1].value]
    changes += [(one.low, one.high) for one in thresholds if one.kind == NOT_NARROWED]
    doubtful = [change for change in changes if is_doubtful(change)]
    within = [change for change in doubtful if change[0].row["sync"] == change[1].row["sync"]] or doubtful
    if not within:
        return None
    low = max((at for at in _alike_values(good, plan) if at <= min(c[0].value for c in within)), default=good[0].value)
    high = min(
        (at for at in _alike_values(good, plan) if at >= max(c[1].value for c in within)), default=good[-1].value
    )
    pairs = {one.value: (one, other) for one, other in doubtful if one.value == other.value}
    return Indistinct(low, high, list(pairs.values()))


def _alike_values(good: Sequence[ScanPoint], plan: FindPlan) -> list[float]:
    """Return the values of the key at which all starts have one outcome, none of them after a long transient."""
    starts = {at: list(same) for at, same in groupby(good, key=lambda one: one.value)}
    return [at for at, same in starts.items() if are_alike(same, plan)]


def are_alike(starts: Sequence[ScanPoint], plan: FindPlan) -> bool:
    """Whether starts at a value have one outcome that another start would have, too, as far as they tell."""
    return len({one.outcome(plan) for one in starts}) == 1 and not any(is_late(one, plan) for one in starts)


def is_late(value: ScanPoint, plan: FindPlan) -> bool:
    """Whether motion repeats after a transient so long that another start may not settle in time.

    If a transient ends at a constant rate, a start that takes a ninth of ``max_settle_s`` says that one of ten takes
    longer than that. Weakly damped motion takes long without such a transient.
    """
    row = value.row
    multiplier, turns_per_s = row.get("multiplier_max"), row.get("excitation_frequency_hz")
    if not (row["period"] and multiplier and turns_per_s) or multiplier >= 1.0:
        return False
    decay = row["period"] / turns_per_s / -math.log(multiplier)
    return bool(row["settle_s"] > max(LATE_RATIO * plan.max_settle_s, LATE_DECAYS * decay))


def repeat_outward(
    way: Sequence[ScanPoint], start: Callable[[float], Tasks[ScanPoint]], plan: FindPlan
) -> Tasks[tuple[bool, list[ScanPoint]]]:
    """Start again at the values along a way, up to the first at which all starts are alike; whether there is one.

    ``start`` makes a start at a value with another seed. All new starts are returned, at most half as many as the scan
    has values: both ways and the scan cost no more than a sweep up and down.
    """
    repeated: list[ScanPoint] = []
    for at, known in groupby((value for value in way if value.is_classified(plan)), key=lambda one: one.value):
        starts = list(known)
        for _ in range(MAX_REPEATED):
            if not are_alike(starts, plan) or 2 * len(repeated) >= plan.scan:
                break
            starts.append((yield from start(at)))
            repeated.append(starts[-1])
        if are_alike(starts, plan):
            return True, repeated
    return False, repeated


def measures_to_ask(found: Indistinct, values: Sequence[ScanPoint], plan: FindPlan) -> list[str]:
    """Return expressions of measures that vary over a range, with a level in its middle.

    A measure that another seed or time changed there in motion of the same class is left out, and so is a remainder of
    symmetric motion. One that differs between classes gives a mixed interval.
    """
    inside = sorted((one for one in values if found.low <= one.value <= found.high), key=lambda one: one.value)
    asked = []
    for name in MEASURES:
        rows = [one for one in inside if one.row.get(name) is not None]
        numbers = [one.row[name] for one in rows]
        span = max(numbers, default=0.0) - min(numbers, default=0.0)
        if name.endswith("_m") and span < NEGLIGIBLE_M:
            continue
        if span > MAX_SCATTER * max(map(abs, numbers), default=0.0) and _is_repeated(
            rows, name, MAX_SCATTER * span, plan
        ):
            level = given(float(f"{min(numbers) + 0.5 * span:.3g}"))
            there = interval(min(numbers), max(numbers), unit_of(name), digits=3)
            asked.append(f'"{name} > {level}" ({there} there)')
    return asked


def _is_repeated(rows: Sequence[ScanPoint], name: str, scatter: float, plan: FindPlan) -> bool:
    """Whether motions of a class at a value have the same measure, within this scatter or their standard errors."""
    ordered = sorted(rows, key=lambda one: (one.value, str(one.outcome(plan))))
    for _, same in groupby(ordered, key=lambda one: (one.value, one.outcome(plan))):
        for one, other in combinations(same, 2):
            error = sum((value.row.get(ERRORS.get(name, "")) or 0.0) ** 2 for value in (one, other)) ** 0.5
            if abs(one.row[name] - other.row[name]) > max(scatter, NOISE_ERRORS * error):
                return False
    return True
