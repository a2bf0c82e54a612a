"""The answer of a fit: what keys are, how well the data say so, and what is left."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from vibroplat.columns import display_name, unit_of
from vibroplat.config.digits import given, number, percent, quantity
from vibroplat.config.fit_plan import FitPlan
from vibroplat.config.plausibility import HINT, WARNING
from vibroplat.results.answer import Answer

Row = Mapping[str, Any]

#: Correlation from which on keys are named, and from which on only their ratio or product is known.
CORRELATED, ONE_NUMBER = 0.9, 0.999
#: Error (RMS over RMS) from which on the data may be of another motion, and distance from an end of a range over it.
LARGE, AT_END = 0.5, 1e-3
#: Difference of relative errors of keys of which only the ratio is known.
ALIKE = 0.1
#: Digits of a value without an error.
FULL = 6
#: Searches that come as near as the best: relative difference of their errors.
SAME = 1e-3


def answer_of(plan: FitPlan, keys: Sequence[Row], searches: Sequence[Row], found: Row) -> Answer:
    """Return the answer from the rows of the table of keys, the searches, and what was found."""
    parts, short = found["parts"], [f"{row['key']}: {_value(row)}" for row in keys]
    for part in parts:
        name = f"{Path(plan.data[part['file']].file).name}, {display_name(part['column'])}"
        change = f"differs by {percent(part['error'])}, before by {percent(part['error_before'])}"
        rest = (
            f"{quantity(part['remains'], unit_of(part['column']))} remain, most at {quantity(part['remains_hz'], 'Hz')}"
        )
        short.append(f"{name}: {change}; {rest}")
    good = [one["cost"] for one in searches if not one["failed"]]
    same = sum(cost <= min(good) * (1.0 + SAME) + 1e-15 for cost in good)
    lines = {
        "shift": f"{', '.join(given(round(shift, 6)) for shift in found['shifts'])} s",
        "searches": f"{same} of {len(searches)} came to these values",
        "data": f"{found['samples']} samples, as good as {found['independent']:.0f} independent ones",
    }
    shown = [f"{display_name(row['key'].rpartition('.')[2])} {_value(row)}" for row in keys if row["determined"]]
    head = "; ".join(one.partition(", was")[0] for one in shown[:2]) or "the data determine none of the keys"
    return Answer(lines, notes=[*_notes(keys, found, same, len(searches))], headline=head, short=short)


def _value(row: Row) -> str:
    """Write a value with as many digits as its error says, and what it was before."""
    unit, value, error = unit_of(row["key"]), row["value"], row["error"]
    before = "" if row["before"] is None else f", was {number(row['before'], 4)}"
    if not row["determined"]:
        return f"not determined by the data ({f'{number(value)} ± {number(error, 2)} {unit}'.rstrip()}){before}"
    digits = 2 + max(math.floor(math.log10(abs(value) / error)), 0) if error > 0.0 and value else FULL
    return f"{number(value, min(digits, FULL))} ± {number(error, 2)} {unit}".rstrip() + before


def _notes(keys: Sequence[Row], found: Row, same: int, count: int) -> Iterator[str]:
    """Yield what makes the values doubtful."""
    for row in keys:
        if min(row["value"] - row["low"], row["high"] - row["value"]) < AT_END * (row["high"] - row["low"]):
            yield f"{WARNING}{row['key']} is at the end of its range: a wider fit.keys may help"
        if not row["determined"]:
            yield f"{WARNING}the data do not determine {row['key']}; fit.keys without it, or further data, may help"
    for one, other in _pairs(keys):
        correlation = one["correlation"]
        ratio = one["error"] * abs(other["value"]) / ((other["error"] * abs(one["value"])) or math.inf)
        text = f"{one['key']} and {other['key']} are correlated by {number(correlation, 3)}"
        if abs(correlation) > ONE_NUMBER and abs(ratio - 1.0) < ALIKE:
            text += f": only their {'ratio' if correlation > 0.0 else 'product'} is known"
        yield f"{HINT}{text}"
    for key in found["ambiguous"]:
        yield (
            f"{WARNING}several values of {key} leave as little, with another shift of the data: its error spans them; "
            "fit.shift in seconds tells them apart"
        )
    for part in found["parts"]:
        if part["error"] > LARGE:
            yield (
                f"{WARNING}{display_name(part['column'])} differs by {percent(part['error'])}: the data may be of "
                "another motion, axis, sign or unit, and the fit is doubtful"
            )
    if same == 1 < count:
        yield f"{HINT}one of {count} searches came to these values: others may fit better"


def _pairs(keys: Sequence[Row]) -> Iterator[tuple[Row, Row]]:
    """Yield keys whose errors are correlated, each pair once."""
    rows, told = {row["key"]: row for row in keys}, set[frozenset[str]]()
    for row in keys:
        pair = frozenset((row["key"], row["most_correlated"]))
        if row["most_correlated"] in rows and abs(row["correlation"]) > CORRELATED and pair not in told:
            told.add(pair)
            yield row, rows[row["most_correlated"]]
