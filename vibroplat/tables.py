"""Tables out and in: written whole under a temporary name, then renamed."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Literal

import pandas as pd

from vibroplat.errors import TableError

Format = Literal["parquet", "csv"]
FORMATS: tuple[Format, ...] = ("parquet", "csv")


def result_directory(out: Path, name: str) -> Path:
    """Create and return the directory of one result.

    Raises
    ------
    TableError
        It cannot be created or written.
    """
    directory = out / name
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            pass
    except OSError as error:
        raise TableError(f"output {directory} is not writable: {error.strerror or error}") from None
    return directory


def write_table(table: pd.DataFrame, directory: Path, name: str, form: Format) -> Path:
    """Write a table as ``name.parquet`` or ``name.csv``; one of the other format is removed.

    CSV holds the shortest text of each number that reads back as the same number.
    """
    path = directory / f"{name}.{form}"
    if form == "parquet":
        _replace(path, lambda temporary: table.to_parquet(temporary, index=False))
    else:
        _replace(path, lambda temporary: table.to_csv(temporary, index=False))
    _drop_other_formats(directory, name, form)
    return path


def write_tables(parts: Iterable[pd.DataFrame], directory: Path, name: str, form: Format) -> Path:
    """Write a table that comes in parts, one in memory at a time, like :func:`write_table`.

    The parts have the same columns and types; each becomes a row group of a Parquet file.
    """
    path = directory / f"{name}.{form}"
    _replace(path, lambda temporary: (_write_row_groups if form == "parquet" else _write_lines)(parts, temporary))
    _drop_other_formats(directory, name, form)
    return path


def remove_table(directory: Path, name: str) -> None:
    """Remove a table of whichever format, where there is one."""
    for form in FORMATS:
        _remove(directory / f"{name}.{form}")


def write_json(value: Any, directory: Path, name: str) -> Path:
    """Write ``name.json``; numbers that are not finite are refused."""
    path = directory / f"{name}.json"
    text = json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    _replace(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))
    return path


def read_table(directory: Path, name: str) -> pd.DataFrame:
    """Read a table of a result, whichever format it has.

    Raises
    ------
    TableError
        There is none, or it is not such a table.
    """
    for form in FORMATS:
        path = directory / f"{name}.{form}"
        if path.exists():
            try:
                return pd.read_parquet(path) if form == "parquet" else pd.read_csv(path)
            except (OSError, ValueError) as error:
                raise TableError(f"{path} cannot be read: {' '.join(str(error).split())}") from None
    raise TableError(f"{directory} holds no {name} table; allowed: a directory that vibroplat has written")


def read_json(directory: Path, name: str) -> Any:
    """Read ``name.json`` of a result; raises :class:`TableError` like :func:`read_table`."""
    path = directory / f"{name}.json"
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise TableError(f"{directory} holds no {name}.json") from None
    except (OSError, ValueError) as error:
        raise TableError(f"{path} cannot be read: {' '.join(str(error).split())}") from None


def _write_row_groups(parts: Iterable[pd.DataFrame], path: Path) -> None:
    import pyarrow as pa  # noqa: PLC0415  (a run of one scene does not need it)
    import pyarrow.parquet as pq  # noqa: PLC0415

    writer: pq.ParquetWriter | None = None
    try:
        for part in parts:
            rows = pa.Table.from_pandas(part, preserve_index=False)
            writer = writer or pq.ParquetWriter(path, rows.schema)
            writer.write_table(rows)
    finally:
        if writer is not None:
            writer.close()


def _write_lines(parts: Iterable[pd.DataFrame], path: Path) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        for number, part in enumerate(parts):
            part.to_csv(file, index=False, header=number == 0)


def _drop_other_formats(directory: Path, name: str, form: Format) -> None:
    for other in FORMATS:
        if other != form:
            _remove(directory / f"{name}.{other}")


def _remove(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise TableError(f"{path} cannot be removed: {error.strerror or error}") from None


def _replace(path: Path, write: Callable[[Path], object]) -> None:
    """Write to a temporary name beside ``path`` and rename it there."""
    handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        write(temporary)
        temporary.chmod(0o644)
        os.replace(temporary, path)
    except OSError as error:
        raise TableError(f"{path} cannot be written: {error.strerror or error}") from None
    finally:
        temporary.unlink(missing_ok=True)
