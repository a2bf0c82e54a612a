"""Thins long tables so that peaks stay, and packs numbers as text."""

from __future__ import annotations

import base64
import math
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

FloatArray = npt.NDArray[np.float64]

#: Significant digits of the numbers in tables.
DIGITS = 9
#: Largest of the whole numbers that curves of orbits are packed as.
STEPS = 65534


def packed(values: npt.ArrayLike) -> str:
    """Return numbers as base64 of 32-bit floats, whose 7 digits are more than a screen shows."""
    return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")


def packed_coarsely(values: npt.ArrayLike) -> tuple[float, float, str]:
    """Return the smallest and the largest number, and all as base64 of 16-bit parts of their range; 65535 is missing.

    That is 1.5e-5 of the range: far less than a pixel.
    """
    numbers = np.asarray(values, dtype=float)
    known = numbers[np.isfinite(numbers)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
    parts = np.nan_to_num(
        (numbers - low) / (high - low or 1.0) * STEPS, nan=STEPS + 1, posinf=STEPS + 1, neginf=STEPS + 1
    )
    return low, high, base64.b64encode(parts.round().astype("<u2").tobytes()).decode("ascii")


def spread(count: int) -> list[int]:
    """Order numbers from 0 so that the first ones, however many, lie evenly among all: by their bits, backwards."""
    bits = max(count - 1, 1).bit_length()
    return sorted(range(count), key=lambda number: int(f"{number:0{bits}b}"[::-1], 2))


def extremes(t: FloatArray, values: FloatArray, edges: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the samples with the smallest and the largest value of each interval between edges, in order of time."""
    kept: list[int] = []
    places = np.unique(np.concatenate(([0], np.searchsorted(t, edges), [t.size])))
    for first, after in pairwise(places.tolist()):
        inside = values[first:after]
        if not np.isnan(inside).all():
            kept += sorted({first + int(np.nanargmin(inside)), first + int(np.nanargmax(inside))})
    return t[kept], values[kept]


def plain_column(column: pd.Series) -> list[Any]:
    """Return the values of a column for JSON; numbers have :data:`DIGITS` digits, what is missing is None."""
    return [_plain(value) for value in column.astype(object).tolist()]


def _plain(value: Any) -> Any:
    if value is None or value is pd.NA or (isinstance(value, float) and not math.isfinite(value)):
        return None
    if isinstance(value, bool | int | str):
        return value
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else str(value)
