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
from vibroplat.thresholds.evidence import NOT_NARROWED, Threshold
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
            changes = [pair for pair in changes if pair[0].value < one.low.value or pair[1].value > one.high.value]
    changes += [(one.low, one.high) for one in thresholds if one.kind == NOT_NARROWED]
    doubtful = [change for change in changes if is_doubtful(change)]
    within = [change for change in doubtful if change[0].row["sync"] == change[1].row["sync"]] or doubtful
    if not within:
        return None
    low = min(change[0].value for change in within)
    high = max(change[1].value for change in within)
    pairs = {one.value: (one, other) for one, other in doubtful if one.value == other.value}
    return Indistinct(low, high, list(pairs.values()))


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
