"""What pictures of sweeps show, in one sentence: each function computes it from the tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vibroplat.columns import PHASE_COLUMN, display_name, unit_of
from vibroplat.config import digits
from vibroplat.frames import pd
from vibroplat.results.labels import capital, key_name, symbol_of
from vibroplat.study.answer import main_rms, motions_text
from vibroplat.study.sweeps import Sweeps

#: Maximum number of values that are listed.
MAX_LISTED = 3


def place(column: str, values: Any) -> str:
    """Say a few places on an axis one by one, more of them from where to where: "$f$ = 30.9 Hz"."""
    text = several(values, unit_of(column))
    if text == digits.MISSING:
        return ""
    symbol = symbol_of(column)
    return f"{symbol} = {text}" if symbol else f"{key_name(column)} {text}"


def several(values: Any, unit: str) -> str:
    """Say a few numbers one by one, more of them as an interval, in one unit."""
    known = [value for value in map(float, values) if np.isfinite(value)]
    if not known:
        return digits.MISSING
    if len(known) > MAX_LISTED or unit == "rad":
        return digits.interval(min(known), max(known), unit)
    return digits.together(known, unit)


def sentence(*parts: str) -> str:
    """Join what is said, with a capital letter."""
    return capital("; ".join(filter(None, parts)))


def response(sweeps: Sweeps, columns: Sequence[str] = ()) -> str:
    """Say the largest value of the first measure and where it is, and what motions there are, as the answer does."""
    table = sweeps.table
    column = next(iter(columns), main_rms(table))
    known = table.dropna(subset=[column]) if column in table else table.iloc[:0]
    if known.empty:
        return "Every point failed" if len(table) else "No points"
    largest = ""
    if column != PHASE_COLUMN:
        varied = [name for name in sweeps.varied if name in table]
        best = known.loc[known.groupby(varied or np.zeros(len(known)), sort=False)[column].idxmax()]
        maximum = several(best[column], unit_of(column))
        name = display_name(column).removeprefix("largest ")
        largest = f"largest {name} {maximum} at {place(sweeps.key, best[sweeps.key])}"
    return sentence(largest, motions(table))


def motions(table: pd.DataFrame) -> str:
    """Say which motions a table of a sweep has, and how many points failed, as its answer does."""
    known, count = table[table["sync"].notna()], int((table["outcome"] != "ok").sum()) if "outcome" in table else 0
    texts = [motions_text(known)] if {"motion", "period"} <= {*known} and len(known) else []
    texts += [f"{count} of {len(table)} points failed"] if count else []
    return sentence(*texts) or "Every point failed"
