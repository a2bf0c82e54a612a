"""Tables on the page, which are read without scripts: rows of numbers, listings of words, and parameters."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.columns import display_name, is_angle, is_rotation, unit_of
from vibroplat.config import digits
from vibroplat.config.digits import MISSING, decimal, power_of_ten
from vibroplat.page.text import escape
from vibroplat.results.answer import counted
from vibroplat.results.labels import SUPPLY, capital
from vibroplat.results.picture import finite

#: Most cells and most rows of a table on the page.
MOST_CELLS, MOST_ROWS = 25_000, 2_000
#: Size relative to the largest of a kind up to which numbers are round-off.
ROUND_OFF = 1e-9
#: Most significant digits of the largest number of a column; keys and what has no unit have them all.
MOST_DIGITS = 5


def rows_on_page(table: pd.DataFrame) -> Any:
    """Return the rows of a table that the page has; one that is too long loses some evenly."""
    count, most = len(table), min(MOST_ROWS, max(MOST_CELLS // max(len(table.columns), 1), 50))
    return np.arange(count) if count <= most else np.unique(np.linspace(0, count - 1, most).round().astype(int))


def fold(title: str, more: str, body: str) -> str:
    """Return HTML that is folded below its title, with further words next to the title."""
    small = f" <small>{escape(more)}</small>" if more else ""
    return f"<details><summary>{escape(capital(title))}{small}</summary>{body}</details>"


def hint(text: str) -> str:
    """Return a remark."""
    return f'<p class="hint">{escape(text)}</p>'


def table_html(title: str, whole: pd.DataFrame, rows: Any = None, *, contents: str = "") -> str:
    """Return a table, folded, which the script sorts. End tags are left out, as HTML allows."""
    chosen = rows_on_page(whole) if rows is None else rows
    table = finite(whole.iloc[chosen]).dropna(axis="columns", how="all")
    sizes = _sizes(whole)
    columns = [_column(str(name), table[name], sizes.get(_kind(str(name)), 0.0)) for name in table]
    heads = "".join(
        f'<th scope=col data-n="{escape(name)}">{escape(head)}'
        for name, (head, _) in zip(table.columns.map(str), columns, strict=True)
    )
    rows_of = zip(*(cells for _, cells in columns), strict=True)
    lines = "".join("<tr>" + "".join(f"<td>{cell}" for cell in row) for row in rows_of)
    more, count = "", counted(len(whole), "row")
    if len(chosen) < len(whole):
        which = "the last ones" if len(chosen) > 1 and chosen[0] else "evenly chosen"
        count = f"{len(chosen)} of {len(whole)} rows, {which}"
        more = f" The page holds {count}; the table of the result holds all."
    body = (
        f'<p class="hint"><span class="scripted">A click on a heading sorts.</span>{more}</p><div class="wide">'
        f'<table class="rows"><thead><tr>{heads}</thead><tbody>{lines}</tbody></table></div>'
    )
    return fold(title, contents or count, body)


def _kind(name: str) -> str:
    """Return with which columns one is compared: RMS of motion, or lengths, forces, powers …; "" if none."""
    if "." in name or is_angle(name):
        return ""
    return "rms" if name.startswith("rms_") or is_rotation(name) else unit_of(name)


def _sizes(table: pd.DataFrame) -> dict[str, float]:
    """Return the largest number of each kind of columns."""
    sizes = dict[str, float]()
    for name in table.select_dtypes("number"):
        kind = _kind(str(name))
        if kind and not is_rotation(str(name)):
            largest = float(finite(table[[name]])[name].abs().max())
            sizes[kind] = max(sizes.get(kind, 0.0), 0.0 if math.isnan(largest) else largest)
    sizes.setdefault("rms", sizes.get("m", 0.0))
    return sizes


def _column(name: str, column: pd.Series, largest: float) -> tuple[str, list[str]]:
    """Return the heading of a column and its cells: with the decimals that its numbers need; "0" if it is nothing.

    It is nothing if no number of it is above 1/1000 of the ``largest`` of its kind, or round-off of it if small numbers
    of its kind matter, as differences of frequencies do.
    """
    words = display_name(name) or name
    if not pd.api.types.is_numeric_dtype(column) or pd.api.types.is_bool_dtype(column):
        return words, [escape(value_text(None if pd.isna(value) else value)) for value in column.astype(object)]
    numbers = column.to_numpy(dtype=float, na_value=np.nan)
    known = np.abs(numbers[np.isfinite(numbers)])
    size = float(known.max()) if known.size else 0.0
    if size <= (digits.NEGLIGIBLE if unit_of(name) in digits.PREFIXES else ROUND_OFF) * largest:
        numbers, known, size = 0.0 * numbers, 0.0 * known, 0.0
    unit, factor = digits.shown_unit(name, largest or size)
    if size and not 1e-3 <= size * factor < 1e7:
        power = 3 * math.floor(math.log10(size) / 3)
        unit, factor = f"{power_of_ten(10.0**power)} {unit_of(name)}".strip(), 10.0**-power
    whole = bool(np.all(known == np.round(known))) and not unit
    decimals = 0 if whole else max(digits.places(size * factor, MOST_DIGITS), 0)
    if unit and name != SUPPLY and "." not in name:
        least = float(known[known > digits.NEGLIGIBLE * size].min(initial=size))
        decimals = min(decimals, max(digits.places(least * factor, digits.digits_of(unit)), 0))
    cells = [decimal(value, decimals) if round(value, decimals) else "0" for value in (numbers * factor).tolist()]
    while decimals and all(cell.endswith("0") or cell in "–0" for cell in cells):  # as in values that were digits.given
        decimals -= 1
        cells = [cell if cell in "–0" else cell[:-1].removesuffix(".") for cell in cells]
    return (f"{words} ({unit})" if unit else words), cells


def align_lines(lines: Sequence[str]) -> str:
    """Return printed lines: those in columns as tables, whose cells are broken where there is no room."""
    html = ""
    for columns, rows in groupby((re.split(" {2,}", line.rstrip()) for line in lines), key=len):
        texts = [[re.sub(r"(?<=\d) (?=[^\d\s])", "\N{NO-BREAK SPACE}", escape(cell)) for cell in row] for row in rows]
        if columns == 1:
            html += "".join(f"<p>{row[0]}</p>" for row in texts)
        else:
            html += "<table>" + "".join("<tr><td>" + "<td>".join(row) for row in texts) + "</table>"
    return f'<div class="short">{html}</div>'


def listing(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table of headings and rows of texts."""
    head = "".join(f'<th scope="col">{escape(text)}</th>' for text in heads)
    begin = f"<thead><tr>{head}</tr></thead>" if heads else ""
    lines = "".join(
        f'<tr><th scope="row">{escape(row[0])}</th>{"".join(f"<td>{escape(cell)}</td>" for cell in row[1:])}</tr>'
        for row in rows
    )
    return f'<div class="wide"><table class="listing">{begin}<tbody>{lines}</tbody></table></div>'


def value_text(value: Any) -> str:
    """Return a value of a configuration as a person reads it."""
    if value is None or isinstance(value, bool | np.bool_):
        return MISSING if value is None else "yes" if value else "no"
    if not isinstance(value, int | float):
        return str(value)
    return power_of_ten(value) if value and not 1e-4 <= abs(value) < 1e7 else digits.given(value).replace("-", "−")


def parameters_html(rows: Sequence[Mapping[str, Any]], names: Sequence[str]) -> str:
    """Return the parameters that are not the default, or not the same in all results; the others folded below."""
    shown = [row for row in rows if row["differs"] or any(row["changed"])]
    rest = [row for row in rows if row not in shown]
    note = "Default: the paper's test rig." + (" ≠: not the same in all results." if len(names) > 1 else "")
    heads = ["key", "meaning", "unit", "default", *(names if len(names) > 1 else ["here"])]
    more = fold("Parameters as by default", str(len(rest)), _parameters(heads, rest)) if rest else ""
    body = hint(note) + _parameters(heads, shown) + more
    return fold("Parameters that differ from the default", f"{len(shown)} of {len(rows)}", body)


def _parameters(heads: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> str:
    words = [["≠ " * row["differs"] + row["key"], row["meaning"], row["unit"]] for row in rows]
    values = [[value_text(value) for value in (row["default"], *row["values"])] for row in rows]
    return listing(heads, [[*a, *b] for a, b in zip(words, values, strict=True)])
