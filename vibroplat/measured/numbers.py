"""Numbers and times of measured data as their texts: decimal signs, thousands, gaps, dates and clocks.

Whether a point or a comma is a decimal sign is decided by all texts of a column, and by the other columns where these
leave it open. ``1.234`` beside ``900`` may be thousands or not: that is refused.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from vibroplat.errors import TableError

#: What loggers and spreadsheets write where there is no value.
_GAPS = {
    *("nan", "na", "n/a", "#n/a", "#nv", "#n/v", "null", "none", "-", "--", "---", "ol", "ovl"),
    *("#div/0!", "#value!", "#wert!", "#num!", "#zahl!", "#ref!", "#bezug!", "#null!", "#name?"),
}
#: Signs that are written in several ways: minus, and what separates thousands beside points and commas.
_SIGNS = str.maketrans({"−": "-", "–": "-", "\u2007": "'", "\u00a0": "'", "\u202f": "'", " ": "'", "’": "'"})
_NUMBER = re.compile(r"[+-]?(?:\d{1,3}(?:'\d{3})+(?:[.,]\d*)?|\d[\d.,]*|[.,]\d+)(?:[eEdD][+-]?\d+)?")
_CLOCK = re.compile(r"(?:(\d{1,3}):)?(\d{1,2}):(\d{1,2})(?:([.,:])(\d+))?")
_DATE = re.compile(r"\d{1,4}[-./]\d{1,2}[-./]\d{1,4}(?:[ T_]*\d{1,2}:\d{2}.*)?")
#: A number that may be one with thousands: groups of three digits, of which the first does not begin with 0.
_GROUPED = {sign: re.compile(rf"[+-]?[1-9]\d{{0,2}}(?:\{sign}\d{{3}})+") for sign in ".,"}
#: A whole number as large as those below one thousand can be.
_BELOW_THOUSAND = re.compile(r"[+-]?[1-9]\d\d")
#: Seconds of a day, and of which a clock that passes midnight falls back by more than half.
DAY = 86_400.0


class _Signs(NamedTuple):
    """Decimal sign of a column, "" if that is open, and whether it may also be the sign of thousands."""

    decimal: str
    open: bool = False


def is_value(text: str) -> bool:
    """Whether a text is a number, a time, a date or a gap."""
    text = text.strip()
    times = any(form.fullmatch(text) for form in (_CLOCK, _DATE))
    return times or _is_gap(text) or _NUMBER.fullmatch(_clean(text)) is not None


def _clean(text: str) -> str:
    return text.strip().translate(_SIGNS)


def _is_gap(text: str) -> bool:
    return not text.strip() or text.strip().lower() in _GAPS


def numbers_of(columns: Sequence[Sequence[str]]) -> list[list[float | str]]:
    """Return columns of texts as numbers, nan where they have gaps; what is no number remains a text.

    Raises
    ------
    TableError
        Numbers may have thousands or decimals.
    """
    cleaned = [[_clean(text) for text in texts] for texts in columns]
    signs = [_signs_of([text for text in texts if _NUMBER.fullmatch(text)]) for texts in cleaned]
    proved = {one.decimal for one in signs if one.decimal and not one.open}
    return [
        [_number(text, given, decimal) for text, given in zip(texts, column, strict=True)]
        for texts, column, decimal in zip(cleaned, columns, _decimals(signs, proved), strict=True)
    ]


def _decimals(signs: Iterable[_Signs], proved: set[str]) -> Iterable[str]:
    """Yield the decimal sign of each column; other columns decide where its own texts do not."""
    for one in signs:
        other = "," if one.decimal == "." else "."
        yield other if one.open and proved == {other} else one.decimal or "."


def _signs_of(texts: Sequence[str]) -> _Signs:
    """Find the decimal sign of the numbers of a column."""
    pointed = {sign: [text for text in texts if sign in text] for sign in ".,"}
    if both := [text for text in pointed["."] if "," in text]:
        return _Signs(max(".,", key=both[0].rfind))
    for sign, other in (".,", ",."):
        with_sign = pointed[sign]
        if not with_sign:
            continue
        if not all(_GROUPED[sign].fullmatch(text) for text in with_sign):
            return _Signs(sign)
        if pointed[other] or any(text.count(sign) > 1 for text in with_sign):
            return _Signs(other)
        whole = [text for text in texts if sign not in text]
        if any(map(_BELOW_THOUSAND.fullmatch, whole)) and all(len(text.lstrip("+-")) <= 3 for text in whole):
            if any(text.endswith("0") for text in with_sign):
                return _Signs(other)  # decimals would be as many everywhere, or without zeros at their ends
            allowed = "numbers without signs of thousands, or as many decimals in each"
            raise TableError(f"{with_sign[0]} beside {whole[0]} may have thousands or decimals; allowed: {allowed}")
        return _Signs(sign, open=True)
    return _Signs("")


def _number(text: str, given: str, decimal: str) -> float | str:
    """Return the number of a cleaned text; nan for a gap, and the text as given if it is none."""
    if _is_gap(given):
        return np.nan
    bare = text.replace("," if decimal == "." else ".", "").replace("'", "").replace(decimal, ".")
    try:
        return float(bare.replace("D", "E").replace("d", "e")) if _NUMBER.fullmatch(text) else given
    except ValueError:
        return given


# -- times -------------------------------------------------------------------------------------------------------------


def seconds_of(texts: Sequence[str]) -> np.ndarray | None:
    """Return dates or times of a clock as seconds from the first one, nan at gaps; None if they are neither."""
    known = pd.Series([None if _is_gap(text) else text.strip() for text in texts], dtype=object)
    some = known.dropna()
    if some.empty:
        return None
    if all(map(_CLOCK.fullmatch, some)):
        seconds = some.map(_of_clock).astype(float)
        seconds = seconds + DAY * (seconds.diff() < -0.5 * DAY).cumsum()
    elif all(map(_DATE.fullmatch, some)):
        dates = _dates(some)
        if dates is None:
            return None
        seconds = (dates - dates.iloc[0]).dt.total_seconds()
    else:
        return None
    return np.asarray((seconds - seconds.iloc[0]).reindex(known.index), dtype=float)


def _of_clock(text: str) -> float:
    """Return the seconds of a clock: hours, minutes, seconds and what follows, behind a colon in thousandths."""
    match = _CLOCK.fullmatch(text)
    assert match is not None
    hours, minutes, seconds, sign, part = match.groups()
    rest = int(part or 0) / 10.0 ** (max(len(part), 3) if sign == ":" else len(part)) if part else 0.0
    return 3600.0 * int(hours or 0) + 60.0 * int(minutes) + int(seconds) + rest


def _dates(texts: pd.Series) -> pd.Series | None:
    """Return dates; of those that begin with a day or a month, in the order in which all can be read."""
    points = texts.str.replace(r"(:\d{2}),(\d+)", r"\1.\2", regex=True).str.replace("_", " ")
    points = points.str.replace(r"(:\d{2}):(\d+)$", r"\1.\2", regex=True)
    for how in ({"format": "ISO8601"}, {"dayfirst": True, "format": "mixed"}, {"dayfirst": False, "format": "mixed"}):
        try:
            return pd.Series(pd.to_datetime(points, utc=True, **how))
        except (ValueError, OverflowError):
            continue
    return None
