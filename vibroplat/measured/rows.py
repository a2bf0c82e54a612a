"""Texts of files of measured data: which lines are numbers, what separates them, and what columns are called.

Loggers, phone apps, LabVIEW and spreadsheets write titles, comments and a row of units above the numbers. Numbers are
the longest block of lines that have equally many of them; the separator is the one by which lines have most numbers.
"""

from __future__ import annotations

import csv
import itertools
import stat
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from vibroplat.errors import TableError
from vibroplat.measured.numbers import is_value
from vibroplat.measured.units import is_unit
from vibroplat.system.memory import size_text

#: Largest file that is read (bytes).
MAX_BYTES = 2**26
#: What may stand between columns: the first that serves; blanks are the last.
SEPARATORS = (";", "\t", "|", ",", "")
#: Lines by which the separator is found.
MOST_LOOKED_AT = 2000
#: What lines of comments begin with.
COMMENTS = ("#", "%", "//")


class Row(NamedTuple):
    """A line of a file: its number from 1, and its texts."""

    line: int
    texts: list[str]

    @property
    def known(self) -> int:
        """How many of the texts are numbers, times or gaps that are named."""
        return sum(bool(text) and is_value(text) for text in self.texts)


class Rows(NamedTuple):
    """Names and units of columns, and the rows of their values; units are "" where none are given."""

    names: list[str]
    units: list[str]
    rows: list[Row]


def read_rows(path: Path) -> Rows:
    """Read the rows of a text or of the first sheet of a workbook.

    Raises
    ------
    TableError
        There are no numbers, or rows have more values than names.
    OSError
        The file cannot be read.
    """
    state = path.stat()
    if not stat.S_ISREG(state.st_mode):
        raise TableError("is no regular file; allowed: a CSV file")
    if state.st_size > MAX_BYTES:
        raise TableError(f"has {size_text(state.st_size)}; allowed: at most {size_text(MAX_BYTES)}")
    if path.suffix.lower() in (".xlsx", ".xlsm"):
        return _named(_of_workbook(path), [])
    lines = [line for line in enumerate(_text(path).splitlines(), 1) if line[1].strip()]
    if lines and lines[0][1].lower().startswith("sep="):
        del lines[0]
    comments = [line for line in lines if _is_comment(line[1])]
    lines = [line for line in lines if not _is_comment(line[1])]
    separator = max(SEPARATORS, key=lambda sign: _fitness([text for _, text in lines[:MOST_LOOKED_AT]], sign))
    return _named(_split(lines, separator), _split([(n, text.lstrip("#%/ \t")) for n, text in comments], separator))


def _is_comment(line: str) -> bool:
    """Whether a line is a comment, which may begin as what spreadsheets write for missing values."""
    first = line.strip()
    return first.startswith(COMMENTS) and not is_value(first.replace(";", "\t").replace(",", "\t").split("\t")[0])


def _text(path: Path) -> str:
    """Return a text: UTF-8 or UTF-16 with a mark at its beginning, UTF-8, or else Windows' 1252."""
    data = path.read_bytes()
    try:
        text = data.decode("utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("cp1252", errors="replace")
    if "\0" in text:
        raise TableError("is no text; allowed: a CSV file, as spreadsheets save it, or .xlsx")
    return text


def _of_workbook(path: Path) -> list[Row]:
    """Return the rows of the first sheet."""
    if find_spec("openpyxl") is None:
        raise TableError("needs openpyxl: pip install 'vibroplat[xlsx]'; allowed without: a CSV file")
    sheet = pd.read_excel(path, header=None, dtype=object)
    texts = sheet.map(lambda cell: "" if pd.isna(cell) else str(cell).strip()).to_numpy().tolist()
    return [Row(line, row) for line, row in enumerate(texts, 1) if any(row)]


def _split(lines: Sequence[tuple[int, str]], separator: str) -> list[Row]:
    """Split lines into texts without blanks at their ends."""
    if not separator:
        return [Row(number, line.split()) for number, line in lines]
    rows = csv.reader((line for _, line in lines), delimiter=separator, skipinitialspace=True)
    return [
        Row(number, [text.strip() for text in texts]) for (number, _), texts in zip(lines, rows, strict=False)
    ]  # a text in quotation marks may go on in the next line


def _fitness(lines: Sequence[str], separator: str) -> tuple[int, int]:
    """Return how well a separator serves: values in rows of several ones, less what is none beside them.

    If that is the same, as in files of one column of numbers, columns of the longest row count.
    """
    rows = [row for row in _split([*enumerate(lines)], separator) if len(row.texts) > 1]
    counts = [(row.known, sum(map(bool, row.texts))) for row in rows]
    longest = max((len(row.texts) for row in rows), default=0) if separator else 0
    return sum(2 * values - texts for values, texts in counts if values), longest


def _named(rows: list[Row], comments: list[Row]) -> Rows:
    """Find the block of numbers, and names and units above it; names in a comment are the last choice."""
    if not rows:
        raise TableError("cannot be read: it is empty; allowed: names of columns and rows of numbers")
    blocks = [(count, [*block]) for count, block in itertools.groupby(rows, lambda row: row.known)]
    _, block = max(blocks, key=lambda of: (len(of[1]) if of[0] else 0, of[0]))
    begin = rows.index(block[0])
    while begin and rows[begin - 1].known and all(is_value(text) for text in rows[begin - 1].texts):
        begin -= 1  # a row with gaps
    if not rows[begin].known:
        raise TableError("cannot be read: there are no numbers; allowed: names of columns and rows of numbers")
    above, width = rows[:begin], max(len(row.texts) for row in block)
    units = above.pop().texts if above and _are_units(above[-1].texts) else []
    above = [row for row in (above[-1:] or comments[-1:]) if sum(map(bool, row.texts)) >= min(width, 2)]
    names = above[0].texts if above else [str(number) for number in range(1, width + 1)]
    while names and not names[-1]:
        names = names[:-1]
    for row in rows[begin:]:
        if any(row.texts[len(names) :]):
            allowed = "names of all columns first, and decimal points, or ; between columns"
            raise TableError(f"line {row.line} has more values than there are names; allowed: {allowed}")
    repeated = [names[:k].count(name) for k, name in enumerate(names)]
    names = [f"{name}.{number}" if number else name for name, number in zip(names, repeated, strict=True)]
    return Rows(names, [*units, *[""] * len(names)][: len(names)], rows[begin:])


def _are_units(texts: Sequence[str]) -> bool:
    known = [text for text in texts if text]
    return bool(known) and all(map(is_unit, known))
