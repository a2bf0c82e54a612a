"""Reads result tables for figures; unusable ones are refused with a clear message."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import pandas as pd

from vibroplat.errors import TableError
from vibroplat.results.files import Command, Result


def read_result(directory: Path, command: Command) -> Result:
    """Return the result of a command; refuse other schema versions and what is unfinished."""
    if not directory.is_dir():
        raise TableError(f"{directory} is not a directory; allowed: a result directory of vibroplat")
    if (directory / "points.sqlite").exists() and not any(directory.glob("sweep.*")):
        raise TableError(f"{directory} holds an unfinished sweep; continue it with `vibroplat sweep --resume`")
    return Result(directory, command)


def read_columns(
    result: Result, name: str, label: str | Sequence[str], numbers: Sequence[str], optional: Sequence[str] = ()
) -> pd.DataFrame:
    """Read a table; it must have these columns of labels and of numbers, and numbers in optional ones it has."""
    table = result.table(name)
    _require(result, name, table, label, numbers, optional)
    return table


def read_parts(
    result: Result, name: str, label: str | Sequence[str], numbers: Sequence[str], optional: Sequence[str] = ()
) -> Iterator[pd.DataFrame]:
    """Read these columns of a table in parts, which must be as in :func:`read_columns`."""
    labels = (label,) if isinstance(label, str) else tuple(label)
    for part in result.parts(name, (*labels, *numbers, *optional)):
        _require(result, name, part, label, numbers, optional)
        yield part


def _require(
    result: Result,
    name: str,
    table: pd.DataFrame,
    label: str | Sequence[str],
    numbers: Sequence[str],
    optional: Sequence[str],
) -> None:
    directory = result.directory
    for column in (*numbers, *(column for column in optional if column in table)):
        if column not in table or not _holds_numbers(table[column]):
            raise TableError(f"the {name} table in {directory} has no numbers in column {column}")
    for column in (label,) if isinstance(label, str) else label:
        if column not in table:
            raise TableError(f"the {name} table in {directory} has no column {column}")
        if pd.api.types.is_numeric_dtype(table[column]) and table[column].notna().any():
            raise TableError(f"the {name} table in {directory} has no names in column {column}")


def _holds_numbers(column: pd.Series) -> bool:
    """Whether a column has real numbers, or nothing at all."""
    types = pd.api.types
    real = not (types.is_bool_dtype(column) or types.is_complex_dtype(column))
    return (types.is_numeric_dtype(column) and real) or column.empty
