"""Results on disk, stored one by one as they are finished, so that a killed process loses none of them.

Damage is found, as each record has a digest of its text, its place and its task. When work is resumed, damaged records
are deleted and their tasks done again. Later records of such a chain are used again only where the same task follows,
with the same arguments.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from copy import copy
from pathlib import Path
from typing import Any, Self

from pydantic_core import from_json, to_json

from vibroplat.config.reader import flat
from vibroplat.errors import ConfigError, TableError
from vibroplat.results.files import STORE
from vibroplat.results.locks import Lock, share
from vibroplat.study.fingerprint import NAMES
from vibroplat.system.interrupts import offer_resume_now

#: Version of its contents; files of other versions are refused.
FORMAT = 3

#: What is stored of one task: plain values that JSON can hold.
Record = dict[str, Any]

_log = logging.getLogger(__name__)


class CorruptRecordError(TableError):
    """Stored records that are damaged or missing."""

    exit_code = 1


class Store:
    """Records in an SQLite file, each under the name of its chain and its place in the chain.

    In a sweep these are the numbers of branch and point.

    Parameters
    ----------
    directory
        Directory of the file, which is created if needed; without a directory the records are in memory.
    conditions
        Nested plain values on which the records depend. Work is resumed only under the same conditions.
    resume
        Whether to keep the records that are found.
    overwrite
        Whether records of unfinished work may be deleted.

    Raises
    ------
    ConfigError
        The conditions have changed, or unfinished work would be lost.
    CorruptRecordError
        The file as a whole is damaged.
    TableError
        The file cannot be written, is in use, or is no such file.
    """

    def __init__(
        self,
        directory: Path | None,
        conditions: Mapping[str, Any],
        *,
        resume: bool = False,
        overwrite: bool = False,
    ) -> None:
        self._path = ":memory:" if directory is None else str(directory / STORE)
        self._prefix = ""
        self._departed = False
        self._stack = ExitStack()
        self._reused = [0]  # shared by the parts of a store
        with self._stack:
            if directory is not None:
                lock = Lock((directory / STORE).with_suffix(".lock"))
                try:
                    lock.acquire()
                except OSError as error:
                    raise TableError(f"{self._path} cannot be used: {error.strerror or error}") from None
                self._stack.callback(lock.release)
            files = [] if directory is None else [directory / f"{STORE}{end}" for end in ("", "-wal", "-shm")]
            unfinished = [] if any(file.exists() for file in files) else [*files]
            self._stack.callback(_remove, unfinished)
            _require_writable(files)
            self._open(json.loads(json.dumps(conditions)), resume=resume, overwrite=overwrite)
            for file in files:
                share(file)
            unfinished.clear()
            self._stack = self._stack.pop_all()

    def _open(self, wanted: dict[str, Any], *, resume: bool, overwrite: bool) -> None:
        """Open the file; keep or delete its records, if that is allowed."""
        with self._complaints():
            self._base = sqlite3.connect(self._path)
            self._stack.callback(self._base.close)
            self._base.text_factory = bytes  # a damaged text may not be UTF-8
            # with a write-ahead log a record is complete or absent whenever the process dies, and writing is quick
            self._base.execute("PRAGMA journal_mode = WAL")
            self._base.execute("PRAGMA synchronous = NORMAL")
            if self._number("SELECT COUNT(*) FROM sqlite_master"):
                self._require_sound()
            else:
                self._create()
            stored, finished = map(self._about, ("conditions", "finished"))
        if stored is None and len(self) and not overwrite:
            raise self._corrupt_error("it does not contain the conditions of its records")
        if stored is not None:
            if resume:
                self._require_same(stored, wanted)
            elif not (finished or overwrite) and len(self):
                raise ConfigError(
                    f"{Path(self._path).parent} holds {len(self)} tasks of unfinished work; allowed: --resume to "
                    "continue it, --overwrite to start again"
                )
        with self._complaints(), self._base:
            if resume:
                self._drop_corrupt(finished or 0)
            else:
                self._base.execute("DELETE FROM records")
                self._base.execute("DELETE FROM about")
            self._tell("conditions", wanted)
            self._tell("finished", finished if resume else 0)

    def _create(self) -> None:
        """Create the tables; they are there together with the conditions, or not at all."""
        self._base.execute("BEGIN")
        self._base.execute("CREATE TABLE about (key TEXT PRIMARY KEY, value TEXT, digest TEXT)")
        self._base.execute(
            "CREATE TABLE records "
            "(first, second INTEGER, task TEXT, record TEXT, digest TEXT, PRIMARY KEY (first, second))"
        )
        self._base.execute(f"PRAGMA user_version = {FORMAT}")

    def _require_sound(self) -> None:
        """Refuse files of other formats and programs, and those whose pages are damaged."""
        form = self._number("PRAGMA user_version")
        if form != FORMAT:
            raise TableError(
                f"{self._path} cannot be used: its format is {form}, this version reads {FORMAT}; "
                "remove it to start again"
            )
        (verdict,) = self._base.execute("PRAGMA integrity_check(1)").fetchone()
        if verdict != b"ok":
            raise self._corrupt_error(_text(verdict))

    def _drop_corrupt(self, finished: int) -> None:
        """Delete damaged records, and say how many are damaged or missing.

        ``finished`` is how many records there were when the work was finished.
        """
        rows = self._base.execute("SELECT rowid, first, second, task, record, digest FROM records NOT INDEXED")
        spoiled = [(row,) for row, *content in rows if not _is_sound(*content)]
        self._base.executemany("DELETE FROM records WHERE rowid = ?", spoiled)
        kept = len(self)
        if lost := max(finished - kept, len(spoiled)):
            total = kept + lost
            _log.warning("%s: %d of %d records damaged or missing; computing them again", self._path, lost, total)

    @property
    def reused(self) -> int:
        """How many records have been found for tasks, which were therefore not done again."""
        return self._reused[0]

    def __len__(self) -> int:
        with self._complaints():
            return self._number("SELECT COUNT(*) FROM records")

    def lengths(self) -> dict[int | str, int]:
        """Return the number of records of each chain that has one."""
        with self._complaints():
            return dict(self._base.execute("SELECT first, COUNT(*) FROM records GROUP BY first"))

    def write(self, chain: int | str, index: int, record: Record, task: str = "") -> None:
        """Store the record of a task at a place of a chain; numbers that are not finite are refused (ValueError)."""
        chain, text = self._chain_name(chain), _plain(record)
        if b"NaN" in text or b"Infinity" in text:
            json.dumps(record, allow_nan=False)  # unless these are words
        row = (chain, index, task, text.decode(), digest(chain, index, task, text))
        with self._complaints(), self._base:
            self._base.execute("INSERT OR REPLACE INTO records VALUES (?, ?, ?, ?, ?)", row)
        if self._path != ":memory:":
            offer_resume_now()

    def get(self, chain: int | str, index: int, task: str) -> Record | None:
        """Return the record at a place of a chain; None if there is none, or if it is the record of another task.

        Records were found sound when the store was opened.
        """
        chain = self._chain_name(chain)
        with self._complaints():
            row = self._base.execute(
                "SELECT task, record FROM records WHERE first = ? AND second = ?", (chain, index)
            ).fetchone()
        if row is None:
            return None
        if _text(row[0]) != task:
            if not self._departed:
                _log.warning("%s: some records do not follow from those before them; computing them again", self._path)
            self._departed = True
            return None
        self._reused[0] += 1
        return _record(row[1])

    def read(self, chain: int | str) -> Iterator[tuple[int, Record]]:
        """Yield places and records of a chain in their order; raises :class:`CorruptRecordError` at a damaged one."""
        chain = self._chain_name(chain)
        with self._complaints():
            rows = self._base.execute(
                "SELECT second, task, record, digest FROM records WHERE first = ? ORDER BY second", (chain,)
            )
            for index, *content in rows:
                if not _is_sound(chain, index, *content):
                    raise CorruptRecordError(f"{self._path}: a record is damaged; --resume computes it again")
                yield index, _record(content[1])

    def namespace(self, name: str) -> Store:
        """Return the same store with names of chains of its own, for one purpose."""
        part = copy(self)
        part._prefix = f"{self._prefix}{name}/"
        return part

    def _chain_name(self, chain: int | str) -> int | str:
        return f"{self._prefix}{chain}" if self._prefix else chain

    def require(self, condition: str, value: Any) -> None:
        """Refuse to go on under another value of a condition that is known only when the work begins.

        Raises
        ------
        ConfigError
            Work is resumed that began under another value.
        """
        with self._complaints(), self._base:
            stored = self._about(condition)
            if stored is not None:
                self._require_same({condition: stored}, {condition: value})
            self._tell(condition, value)

    def _require_same(self, stored: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
        """Refuse to resume under other conditions, and name the first that differs, code and arithmetic last."""
        old, new = flat(stored), flat(wanted)
        differing = [key for key in {**old, **new} if old.get(key) != new.get(key)]
        if not differing:
            return
        differing.sort(key=_is_of_code)
        key = differing[0]
        if _is_of_code(key) and not len(self):
            return  # nothing was made by it
        more = f" (and {len(differing) - 1} more)" if len(differing) > 1 else ""
        raise ConfigError(
            f"cannot resume: {key} = {new.get(key)}; allowed: {old.get(key)}, as in the finished tasks{more}, or "
            "--overwrite to start again"
        )

    def finish(self) -> None:
        """Mark the work as finished: nothing is missing."""
        with self._complaints(), self._base:
            self._tell("finished", len(self))

    def close(self) -> None:
        """Close the file and let other processes use it."""
        self._stack.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _about(self, key: str) -> Any:
        row = self._base.execute("SELECT value, digest FROM about WHERE key = ?", (key,)).fetchone()
        if row is None:
            return None
        value, stored_digest = map(_text, row)
        if digest(key, value) != stored_digest:
            raise self._corrupt_error("the conditions of its records are damaged")
        return json.loads(value)

    def _tell(self, key: str, value: Any) -> None:
        text = json.dumps(value)
        self._base.execute("INSERT OR REPLACE INTO about VALUES (?, ?, ?)", (key, text, digest(key, text)))

    def _number(self, query: str) -> int:
        return int(self._base.execute(query).fetchone()[0])

    def _corrupt_error(self, reason: str) -> CorruptRecordError:
        return CorruptRecordError(f"{self._path} is damaged ({reason}); remove it to start again")

    @contextmanager
    def _complaints(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.Error as error:
            if getattr(error, "sqlite_errorcode", 0) & 0xFF in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB):
                raise self._corrupt_error(str(error)) from None
            raise TableError(f"{self._path} cannot be used: {error}") from None
        except UnicodeDecodeError:  # a message of SQLite that quotes damaged names
            raise self._corrupt_error("its names are no text") from None


def _require_writable(files: Sequence[Path]) -> None:
    """Create the first of a store's files if there is none; refuse those that only others can write to (TableError).

    SQLite would read them alone, leave files of its own beside them, and so keep those others from their work.
    """
    for number, file in enumerate(files):
        try:
            with suppress(FileNotFoundError):
                os.close(os.open(file, os.O_RDWR | (0 if number else os.O_CREAT), 0o666))
        except OSError as error:
            raise TableError(f"{file} cannot be used: {error.strerror or error}") from None


def _remove(files: Sequence[Path]) -> None:
    """Remove what a failed begin has left."""
    for file in files:
        with suppress(OSError):
            file.unlink()


def _is_of_code(key: str) -> bool:
    """Whether a condition is the code that made the records, or its arithmetic."""
    return key.rpartition(".")[2] in NAMES


def digest(*values: Any) -> str:
    """Return the SHA-256 of plain values; text may be given as its bytes.

    It takes some microseconds for a record that took milliseconds to compute, and unlike a cyclic checksum it also
    tells tasks apart that differ anywhere.
    """
    parts: list[bytes] = []
    for value in values:
        if isinstance(value, bytes):
            kind, part = b"text", value
        elif isinstance(value, str):
            kind, part = b"text", value.encode()
        else:
            kind, part = b"json", _plain(value)
        parts += (b"%s %d " % (kind, len(part)), part)
    return hashlib.sha256(b"".join(parts)).hexdigest()


def _plain(value: Any) -> bytes:
    """Write plain values as JSON, in a fifth of the standard library's time."""
    return to_json(value, inf_nan_mode="constants")


def _is_sound(chain: Any, index: Any, task: Any, record: Any, stored_digest: Any) -> bool:
    """Whether a row is as it was written."""
    return digest(chain, index, task, record) == _text(stored_digest)


def _record(text: bytes) -> Record:
    """Read a record as the standard library would, in a third of the time."""
    try:
        return dict(from_json(text, allow_inf_nan=False))
    except ValueError:
        raise CorruptRecordError("a record is damaged; --resume computes it again") from None


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
