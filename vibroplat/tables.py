"""Writes and reads tables. Files are written under a temporary name and renamed once they are complete."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, Literal

import pandas as pd

from vibroplat.errors import TableError
from vibroplat.interrupts import unfinished, watching

Format = Literal["parquet", "csv"]
Writer = Callable[[Path], object]
FORMATS: tuple[Format, ...] = ("parquet", "csv")


def result_directory(out: Path, name: str) -> Path:
    """Create and return the directory of one result.

    Raises
    ------
    TableError
        It cannot be created or is not writable, or the encoding of the system has not understood its name.
    """
    directory = out / name
    try:
        str(directory).encode()
    except UnicodeEncodeError:  # pyarrow could not open files in it
        raise TableError(f"output {directory} is no text in the encoding of this system; allowed: UTF-8") from None
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            pass
    except OSError as error:
        raise TableError(f"output {directory} is not writable: {error.strerror or error}") from None
    return directory


def write_table(table: pd.DataFrame, directory: Path, name: str, form: Format) -> Path:
    """Write a table as ``name.parquet`` or ``name.csv``; a file of the other format is removed.

    In CSV each number has the fewest digits from which it reads back exactly.
    """
    path = directory / f"{name}.{form}"
    replace_files({path: _table_writer(table, form)})
    _drop_other_formats(directory, name, form)
    return path


def write_result(
    directory: Path, tables: Mapping[str, pd.DataFrame], documents: Mapping[str, Any], form: Format
) -> None:
    """Write tables like :func:`write_table` and documents like :func:`write_json`: all of them or none.

    If the process is killed in between, the last files are missing; old and new ones are never mixed.
    """
    writers = {directory / f"{name}.{form}": _table_writer(table, form) for name, table in tables.items()}
    replace_files(writers | {directory / f"{name}.json": _json_writer(value) for name, value in documents.items()})
    for name in tables:
        _drop_other_formats(directory, name, form)


def write_tables(parts: Iterable[pd.DataFrame], directory: Path, name: str, form: Format) -> Path:
    """Write a table in parts, with one part in memory at a time, like :func:`write_table`.

    All parts have the same columns and types; each becomes a row group of a Parquet file.
    """
    path = directory / f"{name}.{form}"
    replace_files({path: lambda to: (_write_row_groups if form == "parquet" else _write_lines)(parts, to)})
    _drop_other_formats(directory, name, form)
    return path


def remove_table(directory: Path, name: str) -> None:
    """Remove a table of any format if it exists."""
    for form in FORMATS:
        _remove(directory / f"{name}.{form}")


def write_json(value: Any, directory: Path, name: str) -> Path:
    """Write ``name.json``; numbers must be finite."""
    path = directory / f"{name}.json"
    replace_files({path: _json_writer(value)})
    return path


def read_table(directory: Path, name: str) -> pd.DataFrame:
    """Read a table of a result in either format.

    Raises
    ------
    TableError
        It does not exist or cannot be read.
    """
    for form in FORMATS:
        path = directory / f"{name}.{form}"
        if path.exists():
            try:
                return pd.read_parquet(path) if form == "parquet" else pd.read_csv(path)
            except (OSError, ValueError) as error:
                raise TableError(f"{path} cannot be read: {' '.join(str(error).split())}") from None
    raise TableError(f"{directory} holds no {name} table; allowed: a result directory of vibroplat")


def read_json(directory: Path, name: str) -> Any:
    """Read ``name.json`` of a result; raises :class:`TableError` like :func:`read_table`."""
    path = directory / f"{name}.json"
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise TableError(f"{directory} holds no {name}.json") from None
    except (OSError, ValueError, RecursionError) as error:
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


def replace_files(writers: Mapping[Path, Writer]) -> None:
    """Write files under temporary names next to their final ones, and rename them once all are written.

    All old files but the first are removed before the first new one is renamed.

    Raises
    ------
    TableError
        A file cannot be written; all old files are kept.
    """
    temporaries: dict[Path, Path] = {}
    path = next(iter(writers))
    with ExitStack() as stack:
        try:
            for path, write in writers.items():
                temporaries[path] = stack.enter_context(_temporary(path))
                write(temporaries[path])
                temporaries[path].chmod(0o644)
            with watching():
                for path in list(writers)[1:]:
                    path.unlink(missing_ok=True)
                for path, temporary in temporaries.items():
                    os.replace(temporary, path)
        except OSError as error:
            raise TableError(f"{path} cannot be written: {error.strerror or error}") from None


@contextmanager
def _temporary(path: Path) -> Iterator[Path]:
    """Make a temporary file next to another; it is removed at the end, even after Ctrl-C."""
    with ExitStack() as stack:
        with watching():
            temporary = _empty_file(path)
            stack.enter_context(unfinished(temporary))
        try:
            yield temporary
        finally:
            with suppress(OSError):
                temporary.unlink()


def _empty_file(path: Path) -> Path:
    """Make an empty file next to another, named after this process; remove those left by killed processes."""
    for old in path.parent.glob(f".{path.stem}-*-*"):
        owner = old.name.removeprefix(f".{path.stem}-").partition("-")[0]
        if owner.isdecimal() and not _runs(int(owner)):
            old.unlink(missing_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.stem}-{os.getpid()}-", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    return Path(name)


def _runs(process: int) -> bool:
    """Whether a process exists; assumed where the system offers no harmless way to ask."""
    if os.name != "posix":
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        pass
    return True


def _table_writer(table: pd.DataFrame, form: Format) -> Writer:
    if form == "parquet":
        return lambda path: table.to_parquet(path, index=False)
    return lambda path: table.to_csv(path, index=False)


def _json_writer(value: Any) -> Writer:
    text = json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    return lambda path: path.write_text(text, encoding="utf-8")
