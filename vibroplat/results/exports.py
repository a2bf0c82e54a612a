"""Tables for other programs, beside the Parquet files that everything here reads: Excel, MATLAB, CSV with ; and comma.

They are made of the Parquet files when these are complete. ``COMMAND.xlsx`` has a sheet for each table, one for each
document and one with units and meanings of the columns. ``COMMAND.mat`` has a structure for each table and document,
and ``units``; numbers that are not known are NaN, and points in names are underscores. ``TABLE.csv`` has decimal
commas.
"""

from __future__ import annotations

import gc
import logging
import sys
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from vibroplat.columns import unit_of
from vibroplat.errors import ConfigError
from vibroplat.frames import pd

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
    if write := {"xlsx": _write_book, "mat": write_mat}.get(require_writer(form)):
        return {f"{command}.{form}": lambda path: write(path, _whole(tables), documents)}
    return {f"{name}.csv": partial(_write_lines, parts) for name, parts in tables.items() if form == "csv-semicolon"}


def _whole(tables: Sources) -> dict[str, pd.DataFrame]:
    return {name: pd.concat([*parts()], ignore_index=True) for name, parts in tables.items()}


def _write_lines(parts: Callable[[], Iterable[pd.DataFrame]], path: Path) -> None:
    """Write a table as CSV that a spreadsheet opens where the decimal comma is usual."""
    with path.open("w", newline="", encoding="utf-8-sig") as file:
        for number, part in enumerate(parts()):
            part.to_csv(file, sep=";", decimal=",", index=False, header=number == 0)


def _write_book(path: Path, tables: Mapping[str, pd.DataFrame], documents: Documents) -> None:
    """Write a workbook; where there is no room for it, no generator of openpyxl complains besides."""
    failure, complain = None, sys.unraisablehook
    sys.unraisablehook = lambda _: None
    try:
        _fill_book(path, tables, documents)
    except OSError as error:
        failure = OSError(*error.args)  # without the frames in which generators wait
    finally:
        gc.collect()
        sys.unraisablehook = complain
    if failure is not None:
        raise failure


def _fill_book(path: Path, tables: Mapping[str, pd.DataFrame], documents: Documents) -> None:
    """Write the sheets of a workbook; a table that is longer than a sheet is cut, which a line says."""
    with pd.ExcelWriter(path, engine="openpyxl") as book:
        for name, table in tables.items():
            table.replace([np.inf, -np.inf], np.nan)[: SHEET_ROWS - 1].to_excel(book, sheet_name=name[:31], index=False)
            if len(table) >= SHEET_ROWS:
                _LOG.warning(
                    "a sheet of Excel has %d rows, and the %s table %d: the rest is in the Parquet file alone",
                    *(SHEET_ROWS, name, len(table) + 1),
                )
        meanings = [(c, unit_of(str(c)), t.attrs.get("meanings", {}).get(c)) for t in tables.values() for c in t]
        lines = {name: [(k, _text(v), unit_of(k)) for k, v in of.items()] for name, of in _flat(documents).items()}
        for name, rows in {**lines, "columns": dict.fromkeys(meanings)}.items():
            pd.DataFrame([*rows]).to_excel(book, sheet_name=name[:31], index=False, header=False)


def _text(value: Any) -> Any:
    return "\n".join(map(str, value)) if isinstance(value, list) else value


def _flat(documents: Documents) -> dict[str, dict[str, Any]]:
    """Return documents that are values by names, without the entries that are not."""
    trees = {name: value for name, value in documents.items() if isinstance(value, dict)}
    return {name: {k: v for k, v in of.items() if not isinstance(v, dict)} for name, of in trees.items()}


def write_mat(path: Path, tables: Mapping[str, pd.DataFrame], documents: Documents) -> None:
    """Write tables, documents and the units of all columns as structures for MATLAB or Octave."""
    contents = {name: {_field(c): plain_array(table[c]) for c in table} for name, table in tables.items()}
    for name, document in _flat(documents).items():
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
