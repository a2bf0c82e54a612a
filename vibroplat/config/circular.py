"""Angles on their circle: how far they are apart, their mean, and deviations from it.

Angles a whole turn apart are the same, so a mean of their numbers, a quantile or a bound says nothing. Deviations from
their circular mean are less than half a turn; for these all statistics of numbers hold. Which columns hold angles,
:func:`vibroplat.columns.is_angle` knows; platform rotations and angles with all their turns are no such columns.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from vibroplat.columns import is_angle, unit_of
from vibroplat.config.coordinates import TURN
from vibroplat.config.digits import given, number, quantity

FloatArray = np.ndarray[Any, np.dtype[np.float64]]

#: Angles that are spread over more than half a turn have a mean if their mean unit vector is at least this long, and if
#: n random angles of the whole circle have one as long at most so often: exp(-n length²) (Rayleigh 1880).
MIN_MEAN_LENGTH, MAX_CHANCE = 0.5, 1e-3
#: Length of the mean unit vector of opposite angles, which have no mean, but for round-off.
ROUND_OFF_LENGTH = 1e-6
#: What is said of angles without a mean.
NO_MEAN = "no mean: spread around the circle"


def wrap(angles: Any) -> Any:
    """Wrap angles, a number or an array, to (−π, π]; those in it stay as they are to the last bit."""
    turned = angles - TURN * np.round(angles / TURN)
    return turned + TURN * (turned <= -math.pi) - TURN * (turned > math.pi)


def shown_angle(angle: float, near: float = 1e-12) -> float:
    """Wrap an angle to (−π, π] as tables show it; an angle within ``near`` of −π becomes π."""
    wrapped = float(wrap(angle))
    return math.pi if wrapped <= -math.pi + near else wrapped


def circular_mean(angles: Any) -> float:
    """Return the direction of the mean unit vector of angles, in (−π, π]; nan if they have no mean, or are none.

    Angles within half a turn always have one. Values that are nan do not count.
    """
    known = np.asarray(angles, dtype=float)
    known = known[np.isfinite(known)]
    if not known.size:
        return math.nan
    around = np.sort(np.mod(known, TURN))
    gaps = np.diff(around, append=around[0] + TURN)
    cosine, sine = float(np.cos(known).mean()), float(np.sin(known).mean())
    squared = cosine * cosine + sine * sine
    clear = squared >= MIN_MEAN_LENGTH**2 and math.exp(-known.size * squared) <= MAX_CHANCE
    within_half = gaps.max() > math.pi and squared > ROUND_OFF_LENGTH**2
    return float(wrap(math.atan2(sine, cosine))) if clear or within_half else math.nan


def on_line(column: str, values: Any) -> FloatArray:
    """Return values of a column for statistics of numbers: of an angle its deviations from the circular mean.

    They lie in (−π, π]. If there is no mean, all of them are nan. Values of other columns stay as they are.
    """
    numbers = np.asarray(values, dtype=float)
    return np.asarray(wrap(numbers - circular_mean(numbers))) if is_angle(column) else numbers


def ranked(column: str, values: Any, shares: Sequence[float] | FloatArray) -> tuple[Any, FloatArray]:
    """Return the places of values in ascending order, and their quantiles; of angles by their deviations.

    Values without a mean, or without any value, have no quantiles; the order is that of their numbers then.
    """
    centre = circular_mean(values) if is_angle(column) else 0.0
    if math.isnan(centre) or not len(values):
        return np.argsort(values, kind="stable"), np.zeros(0)
    line = on_line(column, values)
    return np.argsort(line, kind="stable"), centre + np.quantile(line, shares)


def beyond(column: str, values: Any, limit: float) -> Any:
    """Return how far values of a column are above a limit, below 0 if they are below it.

    An angle is above a limit up to half a turn from it on, and below it otherwise, so the result is in (−π, π].
    """
    return wrap(values - limit) if is_angle(column) else values - limit


def differences(columns: Sequence[str], values: FloatArray, others: FloatArray) -> FloatArray:
    """Return how far values of several columns are above others, of angles as :func:`beyond`."""
    apart = values - others
    return np.where([is_angle(column) for column in columns], wrap(apart), apart)


def bound_scale(column: str, limit: float) -> float:
    """Return what violations of a bound are relative to: its size, but half a turn for an angle."""
    return math.pi if is_angle(column) else abs(limit)


def require_turn(where: str, column: str, limit: float) -> None:
    """Refuse a limit of an angle that is more than a turn, as one in degrees (ValueError)."""
    if is_angle(column) and abs(limit) > TURN:
        raise ValueError(f"{where}: {limit:g} is more than a turn, but {column} is in rad; allowed: -6.28 … 6.28")


def bound_meaning(column: str, sign: float, limit: float) -> str:
    """Say which angles lie above a limit, sign 1, or below it, sign −1."""
    far, own = number(float(wrap(limit + sign * math.pi)), 3), given(limit).replace("-", "−")
    side, ends = ("above", (own, far)) if sign > 0.0 else ("below", (far, own))
    return f"{column} is an angle: the half turn from {ends[0]} to {ends[1]} rad is {side} {own}, the other one is not"


def value_text(column: str, value: float | None, digits: int | None = None) -> str:
    """Write a value of a column with its unit; an angle in rad without a prefix, from −π to π."""
    if value is not None and is_angle(column):
        return f"{number(float(wrap(value)), digits or 4)} rad"
    return quantity(value, unit_of(column), digits=digits)


def shown_value(column: str, value: float, largest: float) -> str:
    """Write a value of a column as axes do: an angle in degrees, others with the prefix of the largest number."""
    return degrees_text(value) if is_angle(column) else quantity(value, unit_of(column), size=largest)


def degrees_text(angle: float) -> str:
    """Write an angle on its circle in whole degrees, from −179 to 180."""
    degrees = math.degrees(wrap(angle))
    return quantity(180.0 if round(degrees) == -180 else degrees, "°")


def centre_text(column: str, values: Any) -> str:
    """Say from what :func:`on_line` counts: " about" the circular mean of an angle; "" for other columns."""
    return f" about {number(circular_mean(values), 4)}" if is_angle(column) else ""
