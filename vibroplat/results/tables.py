"""Writes and reads tables. Files are written under a temporary name and renamed once they are complete."""

from __future__ import annotations

import csv
import glob
import hashlib
import json
import math
import os
import secrets
import stat
import tempfile
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from io import BufferedReader
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self, TypeAlias

from vibroplat.errors import TableError, VibroplatError
from vibroplat.frames import ArrayTable, CategoryColumn, pd, share_descriptions
from vibroplat.results.locks import share
from vibroplat.system.interrupts import unfinished, watching
from vibroplat.system.memory import is_short_of_memory

if TYPE_CHECKING:
    import pyarrow.parquet as pq

Format = Literal["parquet", "csv", "csv-semicolon", "xlsx", "mat"]
Writer = Callable[[Path], object]
#: A table, or its parts, with one of them in memory at a time.
Table: TypeAlias = "pd.DataFrame | Iterable[pd.DataFrame]"
#: Formats that are read; the others are exports beside Parquet files, see :mod:`vibroplat.results.exports`.
FORMATS: tuple[Format, ...] = ("parquet", "csv")
#: Most rows of a group in a Parquet file that is made of whole tables.
MAX_GROUP_ROWS = 2000
#: Most rows that are read at a time.
MAX_PART_ROWS = 2**15
#: Age (s) at which a temporary file is removed: its writer, perhaps on another machine, has been killed. One that is
#: alive changes its file much more often.
LEFTOVER_AGE_S = 86_400.0
#: Ends of the names of temporary files.
_TOKEN = "[0-9a-f]" * 16


def result_directory(out: Path, name: str) -> Path:
    """Create and return the directory of one result.

    Raises
    ------
    TableError
        It cannot be created or is not writable, or the encoding of the system has not understood its name; or it is
        that of a result whose name differs in capitals alone, on a file system that does not tell them apart.
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
        alike = [out / entry for entry in os.listdir(out) if entry != name and entry.casefold() == name.casefold()]
        same = [other for other in alike if os.path.samefile(directory, other)]
        if same and any(directory.glob("**/provenance.json")):
            raise TableError(f"output {directory} is {same[0]} on this file system; allowed: another name")
    except OSError as error:
        raise TableError(f"output {directory} is not writable: {error.strerror or error}") from None
    return directory


def write_table(table: Table, directory: Path, name: str, form: Format) -> Path:
    """Write a table as ``name.parquet`` or ``name.csv``; a file of the other format is removed.

    In CSV each number has the fewest digits from which it reads back exactly. Parts of a table have the same columns
    and types; each becomes a row group of a Parquet file.
    """
    with TableFile(directory, name, form) as file:
        file.extend(table)
        put_in_place({file.path: file.finish()})
    for other in FORMATS:
        if other != form:
            remove_file(directory / f"{name}.{other}")
    return file.path


def read_table(directory: Path, name: str, digests: Mapping[str, str] | None = None) -> pd.DataFrame:
    """Read a table of a result in either format.

    Parameters
    ----------
    directory, name
        Where it is.
    digests
        SHA-256 of the files that belong together, by their names; others are refused.

    Raises
    ------
    TableError
        It does not exist, is not the one of the digest, or cannot be read.
    """
    with _open_table(directory, name, digests) as file:
        if file.name.endswith(".parquet"):
            return share_descriptions(pd.read_parquet(file, page_checksum_verification=True))
        return pd.read_csv(file)


def read_parts(
    directory: Path,
    name: str,
    digests: Mapping[str, str] | None = None,
    columns: Collection[str] | None = None,
    *,
    last: bool = False,
) -> Iterator[pd.DataFrame]:
    """Read a table of a result in parts, with one of them in memory at a time; at least one, without rows if need be.

    Parameters
    ----------
    directory, name, digests
        As in :func:`read_table`, which raises the same errors.
    columns
        Columns that are read if the table has them; all of them by default.
    last
        Whether only the end of the table is wanted.
    """
    with _open_table(directory, name, digests) as file:
        read = read_row_groups if file.name.endswith(".parquet") else _read_lines
        yield from read(file, columns, last=last)


def read_row_groups(file: BufferedReader, columns: Collection[str] | None, *, last: bool) -> Iterator[pd.DataFrame]:
    """Read a Parquet file in parts, as :func:`read_parts`."""
    import pyarrow as pa  # noqa: PLC0415  (a table in CSV does not need it)
    import pyarrow.parquet as pq  # noqa: PLC0415

    source = pq.ParquetFile(file, page_checksum_verification=True)
    wanted = [name for name in source.schema_arrow.names if columns is None or name in columns]
    groups = list(range(source.num_row_groups))
    has_rows = False
    for rows in source.iter_batches(MAX_PART_ROWS, groups[-1:] if last else groups, wanted):
        has_rows = True
        yield share_descriptions(pa.Table.from_batches([rows]).to_pandas())
    if not has_rows:
        yield share_descriptions(source.schema_arrow.empty_table().select(wanted).to_pandas())


def _read_lines(file: BufferedReader, columns: Collection[str] | None, *, last: bool) -> Iterator[pd.DataFrame]:
    part = None
    for part in pd.read_csv(file, usecols=None if columns is None else columns.__contains__, chunksize=MAX_PART_ROWS):
        if not last:
            yield part
    if last and part is not None:
        yield part


@contextmanager
def _open_table(directory: Path, name: str, digests: Mapping[str, str] | None) -> Iterator[BufferedReader]:
    """Open a table of a result in either format."""
    files = [f"{name}.{form}" for form in FORMATS]
    files = [file for file in files if digests is None or file in digests] or files
    with ExitStack() as stack:
        for file in files:
            with suppress(FileNotFoundError):
                table = stack.enter_context(open_file(directory / file, digests))
                break
        else:
            raise TableError(f"{directory} holds no {name} table; allowed: a result directory of vibroplat")
        yield table


def read_json(directory: Path, name: str, digests: Mapping[str, str] | None = None) -> Any:
    """Read ``name.json`` of a result; raises :class:`TableError` like :func:`read_table`."""
    path = directory / f"{name}.json"
    try:
        with open_file(path, digests) as file:
            return json.loads(file.read().decode("utf-8"))
    except FileNotFoundError:
        raise TableError(f"{directory} holds no {name}.json") from None


@contextmanager
def open_file(path: Path, digests: Mapping[str, str] | None) -> Iterator[BufferedReader]:
    """Open a file of a result; what is wrong with its contents becomes one line.

    What is compared with the digest is what is read, even if the file is replaced meanwhile.
    """
    try:
        with path.open("rb") as file:
            if digests is not None and hashlib.file_digest(file, "sha256").hexdigest() != digests.get(path.name):
                raise TableError(f"{path} was changed or belongs to another result; repeat the command that wrote it")
            file.seek(0)
            yield file
    except (TableError, FileNotFoundError):
        raise
    except Exception as error:  # on damaged files readers may raise anything: KeyError, OverflowError, MemoryError …
        reason = " ".join(str(error).split()) or type(error).__name__
        raise TableError(f"{path} cannot be read: {reason}") from None


@contextmanager
def as_written(*places: Path) -> Iterator[None]:
    """Turn errors at contents that no command writes into one line about their files.

    Readers check what they need, but files that somebody has changed may hold anything.
    """
    try:
        yield
    except Exception as error:
        if isinstance(error, (VibroplatError, OSError)) or is_short_of_memory(error):
            raise
        files, reason = ", ".join(map(str, places)), f"{type(error).__name__}: {error}"
        raise TableError(
            f"{files} cannot be used ({reason}): not as vibroplat writes it, or an error of vibroplat; "
            "repeat the command that wrote it"
        ) from error


class TableFile:
    """A table that is written part by part, with one of them in memory at a time.

    It is a file with a temporary name next to its final one, which is made with the first part and removed when the
    context is left, unless it has got its final name by :func:`put_in_place`.

    Parameters
    ----------
    directory, name, form
        As in :func:`write_table`.

    Attributes
    ----------
    path
        The file's final name.
    """

    def __init__(self, directory: Path, name: str, form: Format) -> None:
        self._form = form if form in FORMATS else "parquet"
        self.path = directory / f"{name}.{self._form}"
        self._stack = ExitStack()
        self._temporary: Path | None = None
        self._parquet: pq.ParquetWriter | None = None

    def append(self, part: pd.DataFrame | ArrayTable) -> None:
        """Write the next part; raises :class:`TableError`. Plain arrays give the same file without loading pandas."""
        with one_line_errors(self.path):
            first = self._temporary is None
            if self._temporary is None:
                self._temporary = self._stack.enter_context(_temporary(self.path))
            if self._form == "parquet":
                self._append_rows(part, self._temporary)
            elif isinstance(part, ArrayTable):
                _append_lines(part, self._temporary, header=first)
            else:
                part.to_csv(self._temporary, mode="a", index=False, header=first)

    def extend(self, table: Table) -> None:
        """Write a table, whole or in parts; raises :class:`TableError`."""
        for part in [table] if isinstance(table, pd.DataFrame) else table:
            if isinstance(part, ArrayTable) or len(part) <= MAX_GROUP_ROWS:
                self.append(part)
                continue
            for row in range(0, len(part), MAX_GROUP_ROWS):
                self.append(part[row : row + MAX_GROUP_ROWS])

    def _append_rows(self, part: pd.DataFrame | ArrayTable, path: Path) -> None:
        """Append a row group; units and meanings in the ``attrs`` become metadata of the fields."""
        import pyarrow as pa  # noqa: PLC0415  (a table in CSV does not need it)
        import pyarrow.parquet as pq  # noqa: PLC0415

        from vibroplat.results.arrow import arrow_table  # noqa: PLC0415  (nor this)

        rows = arrow_table(part) if isinstance(part, ArrayTable) else pa.Table.from_pandas(part, preserve_index=False)
        units, meanings = part.attrs.get("units", {}), part.attrs.get("meanings", {})
        fields = [
            field.with_metadata({"unit": units.get(field.name, ""), "meaning": meanings[field.name]})
            if field.name in meanings
            else field
            for field in rows.schema
        ]
        rows = pa.Table.from_arrays(rows.columns, schema=pa.schema(fields, rows.schema.metadata))
        self._parquet = self._parquet or pq.ParquetWriter(path, rows.schema, write_page_checksum=True)
        self._parquet.write_table(rows)

    def finish(self) -> Path:
        """Complete the file and return its temporary name; raises :class:`TableError`."""
        assert self._temporary is not None, "a table has one part at least"
        with one_line_errors(self.path):
            if self._parquet is not None:
                self._parquet.close()
        return self._temporary

    def clear(self) -> None:
        """Begin anew, with no part."""
        self.__exit__()
        self._stack, self._temporary, self._parquet = ExitStack(), None, None

    def __enter__(self) -> Self:
        if self._form == "parquet":
            import vibroplat.results.arrow  # noqa: F401, PLC0415
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(Exception):  # a file that could not be written cannot be completed either
            if self._parquet is not None:
                self._parquet.close()
        self._stack.close()


def _append_lines(part: ArrayTable, path: Path, *, header: bool) -> None:
    """Append lines of CSV, to the byte as pandas writes them: numbers in full, and nothing for nan."""
    cells = [
        of.texts()
        if isinstance(of, CategoryColumn)
        else ["" if math.isnan(number) else number for number in of.tolist()]
        for of in part.columns.values()
    ]
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator=os.linesep)
        if header:
            writer.writerow(part.columns)
        writer.writerows(zip(*cells, strict=True))


@contextmanager
def one_line_errors(path: Path, what: str = "written") -> Iterator[None]:
    """Turn errors of the system into one line, which says that a file cannot be written, read or removed."""
    try:
        yield
    except OSError as error:
        raise TableError(f"{path} cannot be {what}: {error.strerror or error}") from None


def remove_file(path: Path) -> None:
    """Remove a file if it exists; raises :class:`TableError`."""
    with one_line_errors(path, "removed"):
        path.unlink(missing_ok=True)


def require_replaceable(path: Path, begins: bytes = b"", *, overwrite: bool = False) -> None:
    """Refuse a path that holds what was hardly meant: a device, a folder, or a file that begins with other bytes.

    Files may be of another kind if they are to be overwritten, or if they are empty.

    Raises
    ------
    TableError
        That is so.
    """
    head = b""
    with one_line_errors(path), suppress(FileNotFoundError):  # also of a file that another process has just removed
        if not stat.S_ISREG(path.stat().st_mode):
            raise TableError(f"{path} is no regular file; allowed: a new file or one to replace")
        with path.open("rb") as file:
            head = file.read(len(begins)).lower()
    if head not in (b"", begins.lower()) and not overwrite:
        raise TableError(f"{path} is a file of another kind; allowed: a new file, or to overwrite it")


def replace_file(path: Path, write: Writer) -> None:
    """Let a function write a file under a temporary name; if it fails, the old file is kept.

    Raises
    ------
    TableError
        The file cannot be written.
    """
    with new_file(path, write) as temporary:
        put_in_place({path: temporary})


@contextmanager
def new_file(path: Path, write: Writer) -> Iterator[Path]:
    """Let a function write a temporary file next to another, and yield its name; raises :class:`TableError`."""
    require_replaceable(path)
    with ExitStack() as stack:
        with one_line_errors(path):
            temporary = stack.enter_context(_temporary(path))
            write(temporary)
        yield temporary


def put_in_place(temporaries: Mapping[Path, Path]) -> None:
    """Give temporary files their final names.

    All old files but the first are removed before the first new one is renamed, so that the files of two results are
    never found together if the process is killed in between.
    """
    with watching():
        for path in list(temporaries)[1:]:
            with one_line_errors(path):
                path.unlink(missing_ok=True)
        for path, temporary in temporaries.items():
            with one_line_errors(path):
                os.replace(temporary, path)


@contextmanager
def _temporary(path: Path) -> Iterator[Path]:
    """Make an empty temporary file next to another; it is removed at the end, even after Ctrl-C.

    Files that killed processes have left are removed.
    """
    with ExitStack() as stack:
        with watching():
            temporary = path.with_name(f".{path.stem}-{secrets.token_hex(8)}{path.suffix}")
            handle = os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
            stack.enter_context(unfinished(temporary))
            share(temporary)
        try:
            with os.fdopen(handle) as file:
                now = os.fstat(file.fileno()).st_mtime  # by the clock of the file system, of another machine perhaps
            for old in path.parent.glob(f".{glob.escape(path.stem)}-{_TOKEN}.*"):
                with suppress(FileNotFoundError):  # another process has removed it
                    if now - old.stat().st_mtime > LEFTOVER_AGE_S:
                        old.unlink()
            yield temporary
        finally:
            with suppress(OSError):
                temporary.unlink()


def json_writer(value: Any) -> Writer:
    """Return a function that writes a value to a path; its numbers must be finite."""
    return text_writer(json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def text_writer(text: str) -> Writer:
    """Return a function that writes a text to a path."""
    return lambda path: path.write_text(text, encoding="utf-8")
