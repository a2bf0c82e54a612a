"""The rate at which aperiodic motions converge to orbits: chaos may be a transient of any length.

A motion on a chaotic saddle leaves it at a constant rate (Grebogi, Ott and Yorke 1983, Physica D 7, 181; Lai and Tél,
Transient Chaos, 2011). Early arrivals are of motions that never came near the saddle, and would spoil the estimate:
those after a quarter of the turns count.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vibroplat.config.digits import percent
from vibroplat.frames import pd
from vibroplat.kernels.compiled import FloatArray
from vibroplat.study.store import Record

#: Part of the turns after which an arrival counts as late.
LATE_FRACTION = 0.25
#: Error of bounds: they hold the rate in 95 of 100 samples.
ALPHA = 0.05
#: Motions that may be transients. Those that are surely chaotic do not converge directly; others may do so.
CHAOTIC, TRANSIENT_MOTIONS = "chaotic", ("chaotic", "undecided")
#: Radius that counts for orbits without an ellipsoid.
MIN_RADIUS = 1e-4
#: Minimum number of late arrivals for a test whether their rate is constant.
MIN_LATE_ARRIVALS = 5


class Rate(NamedTuple):
    """A rate in events a turn.

    Attributes
    ----------
    value
        Events over the turns in which they might have happened.
    low, high
        Bounds of 95 % (Garwood 1936, Biometrika 28, 437); with no event the upper bound alone has this error.
    constant
        Probability that events at a constant rate are this uneven; nan if they are too few to tell.
    """

    value: float
    low: float
    high: float
    constant: float


def estimate_rate(places: Sequence[float], exposure: float) -> Rate:
    """Estimate a rate.

    Parameters
    ----------
    places
        Of each event, the turns of all motions at risk until it happened, over all such turns: a constant rate spreads
        them evenly over 0 … 1.
    exposure
        All turns at risk.
    """
    from scipy.special import gammaincinv  # noqa: PLC0415  (half a second)

    count = len(places)
    tail = ALPHA / 2.0 if count else ALPHA
    low = float(gammaincinv(count, tail)) if count else 0.0
    high = float(gammaincinv(count + 1, 1.0 - tail))
    return Rate(count / exposure, low / exposure, high / exposure, _is_constant(np.sort(places)))


def _is_constant(places: FloatArray) -> float:
    """Test whether places are spread evenly over 0 … 1, as Laplace (a trend) and Kolmogorov and Smirnov do."""
    from scipy.special import kolmogorov, ndtr  # noqa: PLC0415

    count = places.size
    if count < MIN_LATE_ARRIVALS:
        return math.nan
    trend = 2.0 * ndtr(-abs(places.mean() - 0.5) * math.sqrt(12.0 * count))
    steps = np.arange(count + 1) / count
    away = max((steps[1:] - places).max(), (places - steps[:-1]).max())
    shape = kolmogorov((math.sqrt(count) + 0.12 + 0.11 / math.sqrt(count)) * away)  # Stephens (1970)
    return float(min(2.0 * min(trend, shape), 1.0))


def estimate_rates(attractors: Sequence[Record], starts: Sequence[Record], max_turns: int) -> list[Rate | None]:
    """Estimate the rate at which motions converge to each orbit, and that at which each other motion is left for one.

    It is None where nothing was at risk, where a motion may take as long on a direct way to the orbit, where it is not
    known when motions converged to it, and of undecided motions. An upper bound alone is known of chaos that may have
    been left for such an orbit, and of chaos beside other aperiodic motions, as it is not known which of them
    was left how often.

    Parameters
    ----------
    attractors, starts
        Records of attractors, and of starts with the number of each start's attractor.
    max_turns
        Turns after which motions were given up.
    """
    begin = LATE_FRACTION * max_turns
    rows = [record["row"] for record in attractors]
    orbits = {k for k, row in enumerate(rows) if row["motion"] == "periodic"}
    unseen = {start["attractor"] for start in starts if "windows" in start}
    quick = {k for k in orbits - unseen if _direct_turns(attractors[k]) <= begin}
    restless = {k for k, row in enumerate(rows) if row["motion"] in TRANSIENT_MOTIONS}
    late = [(start["attractor"], start["turns"] - begin) for start in starts if start["turns"] > begin]
    arrived = [(number, turns) for number, turns in late if number in quick]
    risk = [turns for number, turns in late if number in quick | restless]

    def rate(events: Sequence[float], exposed: Sequence[float]) -> Rate | None:
        total = np.sort(np.array(exposed))
        before, count = np.cumsum(total), np.arange(total.size, 0, -1)
        passed = [np.searchsorted(total, turns) for turns in events]
        places = [(before[k] + (count[k] - 1) * turns) / before[-1] for k, turns in zip(passed, events, strict=True)]
        return estimate_rate(places, float(before[-1])) if total.size else None

    rates: list[Rate | None] = [None] * len(rows)
    for k in quick:
        rates[k] = rate([turns for number, turns in arrived if number == k], risk)
    escaped = [(number, turns) for number, turns in late if number in orbits]
    for k in (k for k in restless if rows[k]["motion"] == CHAOTIC):
        own = [turns for number, turns in late if number == k]
        sure = arrived == escaped and (restless == {k} or not escaped)
        escape_rate = rate([turns for _, turns in escaped], own + [turns for _, turns in escaped])
        rates[k] = escape_rate if escape_rate is None or sure else Rate(math.nan, 0.0, escape_rate.high, math.nan)
    return rates


def _direct_turns(record: Record) -> float:
    """Return the turns that a motion may take to an orbit from any distance, as far as the derivative tells."""
    row = record["row"]
    multiplier = row.get("multiplier_max")
    decay = -math.log(min(max(1.0 if multiplier is None else multiplier, 1e-300), 1.0 - 1e-15))
    return float(row["period"] * -math.log(record["radius"] or MIN_RADIUS) / decay)


def clopper_pearson(count: int, number: int) -> tuple[float, float]:
    """Return confidence bounds of a fraction, from ``count`` of ``number`` samples; one-sided for none or all.

    Clopper and Pearson (1934), Biometrika 26, 404.
    """
    from scipy.special import betaincinv  # noqa: PLC0415  (half a second)

    tail = ALPHA / 2.0 if 0 < count < number else ALPHA
    low = float(betaincinv(count, number - count + 1, tail)) if count else 0.0
    high = float(betaincinv(count + 1, number - count, 1.0 - tail)) if count < number else 1.0
    return low, high


def fractions_over(attractors: pd.DataFrame, key: str) -> dict[str, str]:
    """Return the range of the basin fraction of each attractor over a key, in words; 0 where it is not found."""
    fractions = attractors.pivot_table("fraction", key, "attractor", fill_value=0.0, sort=False)
    ends = {str(name): dict.fromkeys((percent(one.min()), percent(one.max()))) for name, one in fractions.items()}
    return {name: " … ".join(both) for name, both in ends.items()}
