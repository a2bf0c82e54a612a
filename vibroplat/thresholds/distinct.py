"""Whether attractors can be told apart: beside chaos, the class of a motion may depend on its seed and its duration.

Motion that repeats is a class of its own, and so is an exciter that hangs. A change beside any other motion is
doubtful: only the point at which an orbit loses its stability can be located there.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, groupby, pairwise
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


def is_doubtful(change: Pair) -> bool:
    """Whether a side of a change does not repeat, so that its class may be luck; a capture is none."""
    repeat = all(value.row["period"] and not value.leaving for value in change)
    return not repeat and change[0].hangs == change[1].hangs


def unstable_classes(values: Sequence[ScanPoint], plan: FindPlan) -> list[Pair]:
    """Return the doubtful changes between motions at the same value, one for each value."""
    known = sorted((one for one in values if not one.failed and one.reason != "orbit"), key=lambda one: one.value)
    pairs = []
    for _, same in groupby(known, key=lambda one: one.value):
        changes = (pair for pair in combinations(same, 2) if pair[0].outcome(plan) != pair[1].outcome(plan))
        pairs += [pair for pair in changes if is_doubtful(pair)][:1]
    return pairs


def neighbours_that_differ(values: Sequence[ScanPoint], plan: FindPlan) -> list[Pair]:
    """Return the pairs of neighbours with different outcomes, in ascending order."""
    good = sorted((one for one in values if one.is_classified(plan)), key=lambda one: one.value)
    return [(one, other) for one, other in pairwise(good) if one.outcome(plan) != other.outcome(plan)]


def indistinct(changes: Sequence[Pair], values: Sequence[ScanPoint], plan: FindPlan) -> Indistinct | None:
    """Return the range of those of these changes, in ascending order, that are doubtful; None if none is.

    Changes between two synchronizations count only if there are no others, as they can be asked for by themselves.
    """
    doubtful = [change for change in changes if plan.of_motion and is_doubtful(change)]
    within = [change for change in doubtful if change[0].row["sync"] == change[1].row["sync"]] or doubtful
    return Indistinct(within[0][0].value, within[-1][1].value, unstable_classes(values, plan)) if within else None


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
