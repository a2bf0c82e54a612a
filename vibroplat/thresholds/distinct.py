"""Whether attractors can be told apart: beside chaos, the class of a motion may depend on its seed and its duration.

A stable orbit that is known is a class of its own, and so is every synchronization: where seeds decide between two of
them, the interval is mixed. The class of any other motion counts only if it stays the same with another seed and with
twice the settling and measuring time.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, groupby
from typing import NamedTuple

from vibroplat.columns import unit_of
from vibroplat.config.digits import given, interval
from vibroplat.config.study_plans import FindPlan
from vibroplat.study.point import ERRORS
from vibroplat.thresholds.values import NOISE_ERRORS, ScanPoint

#: Measures that may be asked for instead, and the largest difference of repetitions relative to their range.
MEASURES = ("rms_y_m", "rms_x_m", "excitation_frequency_hz", "flight_fraction", "motor_power_w")
MAX_SCATTER = 0.05
#: Amplitude (m) below which a vibration is a remainder.
NEGLIGIBLE_M = 1e-7
#: Fraction of the maximum settling time after which a motion beside an aperiodic one comes to its orbit by chance: with
#: a quarter of the time it would have had another class. Where chaos is a transient, its durations are distributed
#: exponentially.
LATE_FRACTION = 0.25

Pair = tuple[ScanPoint, ScanPoint]


class Indistinct(NamedTuple):
    """A range in which attractors cannot be told apart.

    Attributes
    ----------
    low, high
        Its ends: the changes of the attractor in it were not narrowed.
    pairs
        Motions at one value, of which another seed or twice the time has made another one.
    late
        Motions that came to their orbits only after so long that others may do so as well.
    """

    low: float
    high: float
    pairs: Sequence[Pair]
    late: Sequence[ScanPoint] = ()


def is_known_orbit(value: ScanPoint) -> bool:
    """Whether the motion is on a stable orbit, which is known."""
    return value.row.get("multiplier_max") is not None and bool(value.row["period"]) and not value.leaving


def is_doubtful(change: Pair) -> bool:
    """Whether a change is between motions of one synchronization that are not both known orbits."""
    same = change[0].row["sync"] == change[1].row["sync"]
    return same and not all(map(is_known_orbit, change))


def unstable_classes(values: Sequence[ScanPoint], plan: FindPlan) -> list[Pair]:
    """Return the doubtful changes between motions at the same value, one for each value."""
    known = sorted((one for one in values if not one.failed and one.reason != "orbit"), key=lambda one: one.value)
    pairs = []
    for _, same in groupby(known, key=lambda one: one.value):
        changes = (pair for pair in combinations(same, 2) if pair[0].outcome(plan) != pair[1].outcome(plan))
        pairs += [pair for pair in changes if is_doubtful(pair)][:1]
    return pairs


def indistinct(doubtful: Sequence[Pair], values: Sequence[ScanPoint], plan: FindPlan) -> Indistinct | None:
    """Return the range of doubtful changes of a scan, if the class of a motion is unstable in it."""
    pairs = unstable_classes(values, plan)
    ends = {end.value: end for change in doubtful for end in change if is_known_orbit(end)}
    late = [end for end in ends.values() if end.row["settle_s"] > LATE_FRACTION * plan.max_settle_s]
    if not (doubtful and (pairs or late)):
        return None
    return Indistinct(doubtful[0][0].value, doubtful[-1][1].value, pairs, late)


def measures_to_ask(found: Indistinct, values: Sequence[ScanPoint]) -> list[str]:
    """Return expressions of measures that vary over a range, with a level in its middle.

    A measure that another seed or time changed there is left out, and so is a remainder of symmetric motion.
    """
    inside = sorted((one for one in values if found.low <= one.value <= found.high), key=lambda one: one.value)
    asked = []
    for name in MEASURES:
        rows = [one for one in inside if one.row.get(name) is not None]
        numbers = [one.row[name] for one in rows]
        span = max(numbers, default=0.0) - min(numbers, default=0.0)
        if name.endswith("_m") and span < NEGLIGIBLE_M:
            continue
        if span > MAX_SCATTER * max(map(abs, numbers), default=0.0) and _is_repeated(rows, name, MAX_SCATTER * span):
            level = given(float(f"{min(numbers) + 0.5 * span:.3g}"))
            there = interval(min(numbers), max(numbers), unit_of(name), digits=3)
            asked.append(f'"{name} > {level}" ({there} there)')
    return asked


def _is_repeated(rows: Sequence[ScanPoint], name: str, scatter: float) -> bool:
    """Whether motions at the same value have the same measure, within this scatter or their standard errors."""
    for _, same in groupby(rows, key=lambda one: one.value):
        for one, other in combinations(same, 2):
            error = sum((value.row.get(ERRORS.get(name, "")) or 0.0) ** 2 for value in (one, other)) ** 0.5
            if abs(one.row[name] - other.row[name]) > max(scatter, NOISE_ERRORS * error):
                return False
    return True
