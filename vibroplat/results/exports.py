"""Tables for other programs, beside the Parquet files that everything here reads: Excel, MATLAB, CSV with ; and comma.

They are made of the Parquet files when these are complete. ``COMMAND.xlsx`` has a sheet for each table, one for each
document and one with units and meanings of the columns. ``COMMAND.mat`` has a structure for each table and document,
and ``units``; numbers that are not known are NaN, and points in names are underscores. ``TABLE.csv`` has decimal
commas.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from vibroplat.columns import unit_of
from vibroplat.errors import ConfigError
from vibroplat.frames import pd
from vibroplat.results.tables import read_row_groups

_LOG = logging.getLogger("vibroplat")

#: Rows of a sheet of Excel, with the one of names.
SHEET_ROWS = 2**20

#: Functions that yield tables in parts, by the names of the tables, and contents of JSON files by name.
Sources = Mapping[str, "Callable[[], Iterable[pd.DataFrame]]"]
Documents = Mapping[str, Any]


def require_writer(form: str) -> str:
    """Return a format; refuse xlsx without the package that writes it (ConfigError)."""
    if form == "xlsx" and find_spec("openpyxl") is None:
        raise ConfigError("--format xlsx needs openpyxl: pip install 'vibroplat[xlsx]'; allowed without: mat, csv")
    return form


def exports(form: str, command: str, tables: Sources, documents: Documents) -> dict[str, Callable[[Path], object]]:
    """Return functions that write the files of an export by their names; none for formats that are no export."""
    if require_writer(form) == "xlsx":
        return {f"{command}.xlsx": partial(_write_book, tables, documents)}
    if form == "mat":
        return {f"{command}.mat": lambda path: write_mat(path, _whole(tables), _flat(documents))}
    return {f"{name}.csv": partial(_write_lines, parts) for name, parts in tables.items() if form == "csv-semicolon"}


def parts_of(file: Path) -> Iterator[pd.DataFrame]:
    """Yield the parts of a Parquet file that was just written."""
    with file.open("rb") as opened:
        yield from read_row_groups(opened, None, last=False)


def _write_lines(parts: Callable[[], Iterable[pd.DataFrame]], path: Path) -> None:
    """Write a table as CSV that a spreadsheet opens where the decimal comma is usual."""
    for number, part in enumerate(parts()):
        look: dict[str, Any] = {"sep": ";", "decimal": ",", "index": False, "header": number == 0}
        part.to_csv(path, mode="a" if number else "w", encoding="utf-8" if number else "utf-8-sig", **look)


def _cell(value: Any) -> Any:
    """Return a value as a sheet holds it: nothing for what is not a finite number, texts for lists."""
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, list):
        return "\n".join(map(str, value))
    return value.item() if isinstance(value, np.generic) else None if value is pd.NA else value


def _write_book(tables: Sources, documents: Documents, path: Path) -> None:
    """Write a workbook; a table that is longer than a sheet is cut, which a line says."""
    book = import_module("openpyxl").Workbook(write_only=True)
    try:
        _fill_book(book, tables, documents)
    except Exception:
        for sheet in book.worksheets:
            sheet.close()  # otherwise Python complains when it ends their generators
        raise
    book.save(path)


def _fill_book(book: Any, tables: Sources, documents: Documents) -> None:
    """Write tables, documents, and units and meanings of columns into sheets."""
    described: dict[str, tuple[str, str]] = {}
    for name, parts in tables.items():
        sheet, written = book.create_sheet(name[:31]), 1
        for part in parts():
            if written == 1:
                sheet.append(list(map(str, part)))
                meanings = part.attrs.get("meanings", {})
                described |= {str(column): (unit_of(str(column)), meanings.get(column, "")) for column in part}
            for row in part.astype(object).head(SHEET_ROWS - written).itertuples(index=False, name=None):
                sheet.append([_cell(value) for value in row])
            written += len(part)
        if written > SHEET_ROWS:
            _LOG.warning(
                "a sheet of Excel has %d rows, and the %s table %d: the rest is in the Parquet file alone",
                *(SHEET_ROWS, name, written),
            )
    for name, value in _flat(documents).items():
        sheet = book.create_sheet(name[:31])
        for key, entry in value.items():
            sheet.append([key, _cell(entry), unit_of(key)])
    sheet = book.create_sheet("columns")
    for column, (unit, meaning) in described.items():
        sheet.append([column, unit, meaning])


def _flat(documents: Documents) -> dict[str, dict[str, Any]]:
    """Return documents that are values by names, without the entries that are not."""
    trees = {name: value for name, value in documents.items() if isinstance(value, dict)}
    return {name: {k: v for k, v in of.items() if not isinstance(v, dict)} for name, of in trees.items()}


def _whole(tables: Sources) -> dict[str, pd.DataFrame]:
    return {name: pd.concat([*parts()], ignore_index=True) for name, parts in tables.items()}


def write_mat(path: Path, tables: Mapping[str, pd.DataFrame], documents: Mapping[str, Mapping[str, Any]]) -> None:
    """Write tables, documents and the units of all columns as structures for MATLAB or Octave."""
    contents = {name: {_field(c): plain_array(table[c]) for c in table} for name, table in tables.items()}
    for name, document in documents.items():
        known = {k: v for k, v in document.items() if not isinstance(v, list)}
        contents[name] = {_field(k): np.nan if v is None else v for k, v in known.items()}
    contents["units"] = {_field(c): unit_of(str(c)) for table in tables.values() for c in table}
    savemat = import_module("scipy.io").savemat
    savemat(path, contents, appendmat=False, long_field_names=True, oned_as="column")


def _field(name: Any) -> str:
    """Return a name as a field has it, with at most 63 letters."""
    return str(name).replace(".", "_")[:63]


def plain_array(column: pd.Series) -> Any:
    """Return a column as an array of numbers, or of texts, which are empty where they are missing."""
    if pd.api.types.is_numeric_dtype(column):
        return column.to_numpy(dtype=float, na_value=np.nan) if column.isna().any() else column.to_numpy()
    return column.astype(object).where(column.notna(), "").to_numpy()
