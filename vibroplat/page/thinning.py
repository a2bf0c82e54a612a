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


def packed(values: npt.ArrayLike) -> str:
    """Return numbers as base64 of 32-bit floats, whose 7 digits are more than a screen shows."""
    return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")


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
