"""Keeps finished records on disk, so that they survive if the process is killed."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from filelock import FileLock, Timeout

from vibroplat.errors import ConfigError, TableError
from vibroplat.overrides import flat

#: Name of the file, next to the tables made from it.
FILE = "points.sqlite"


class Store:
    """Records in an SQLite file, each identified by two numbers: branch and point of a sweep.

    Parameters
    ----------
    directory
        Directory of the file. If None, the records are kept in memory.
    conditions
        Everything that the records depend on, as nested plain values. Work under other conditions is not resumed.
    resume
        Whether existing records are kept.
    overwrite
        Whether records of unfinished work may be discarded.

    Raises
    ------
    ConfigError
        The conditions have changed, or unfinished work would be lost.
    TableError
        The file cannot be written or is not a database.
    """

    def __init__(
        self, directory: Path | None, conditions: Mapping[str, Any], *, resume: bool = False, overwrite: bool = False
    ) -> None:
        self._path = ":memory:" if directory is None else str(directory / FILE)
        self._lock = FileLock(Path(self._path).with_suffix(".lock"), timeout=0) if directory is not None else None
        self._connection: sqlite3.Connection | None = None
        try:
            if self._lock is not None:
                self._lock.acquire()
            self._open(json.loads(json.dumps(conditions)), resume=resume, overwrite=overwrite)
        except Timeout:
            raise TableError(f"{directory} is in use by another process") from None
        except OSError as error:
            raise TableError(f"{self._path} cannot be used: {error.strerror or error}") from None
        except BaseException:
            self.close()
            raise

    def _open(self, wanted: dict[str, Any], *, resume: bool, overwrite: bool) -> None:
        """Open the file and check whether its records may be kept or discarded."""
        with self._complaints():
            self._connection = sqlite3.connect(self._path)
            # write-ahead log: if the process dies, each record is complete or absent; no write waits for the disk
            self._base.execute("PRAGMA journal_mode = WAL")
            self._base.execute("PRAGMA synchronous = NORMAL")
            self._base.execute("CREATE TABLE IF NOT EXISTS about (key TEXT PRIMARY KEY, value TEXT)")
            self._base.execute(
                "CREATE TABLE IF NOT EXISTS records (first INTEGER, second INTEGER, record TEXT, "
                "PRIMARY KEY (first, second)) WITHOUT ROWID"
            )
            found, finished = self._about("conditions"), self._about("finished")
        if found is not None:
            if resume:
                _require_same(flat(found), flat(wanted))
            elif not (finished or overwrite) and len(self):
                raise ConfigError(
                    f"{Path(self._path).parent} holds {len(self)} points of unfinished work; "
                    "allowed: --resume to continue, --overwrite to start over"
                )
        with self._complaints(), self._base:
            if not resume:
                self._base.execute("DELETE FROM records")
            self._tell("conditions", wanted)
            self._tell("finished", finished if resume else False)

    def __len__(self) -> int:
        with self._complaints():
            return int(self._base.execute("SELECT COUNT(*) FROM records").fetchone()[0])

    def write(self, first: int, second: int, record: Mapping[str, Any]) -> None:
        """Store a record."""
        text = json.dumps(record, allow_nan=False)
        with self._complaints(), self._base:
            self._base.execute("INSERT OR REPLACE INTO records VALUES (?, ?, ?)", (first, second, text))

    def read(self, first: int) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield the records with this first number, ordered by the second."""
        with self._complaints():
            rows = self._base.execute("SELECT second, record FROM records WHERE first = ? ORDER BY second", (first,))
            for second, text in rows:
                yield second, json.loads(text)

    def finish(self) -> None:
        """Mark the work as finished."""
        with self._complaints(), self._base:
            self._tell("finished", True)

    def close(self) -> None:
        """Close and release the file."""
        if self._connection is not None:
            self._connection.close()
        if self._lock is not None:
            self._lock.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    @property
    def _base(self) -> sqlite3.Connection:
        assert self._connection is not None  # opened by the constructor
        return self._connection

    def _about(self, key: str) -> Any:
        row = self._base.execute("SELECT value FROM about WHERE key = ?", (key,)).fetchone()
        return None if row is None else json.loads(row[0])

    def _tell(self, key: str, value: Any) -> None:
        self._base.execute("INSERT OR REPLACE INTO about VALUES (?, ?)", (key, json.dumps(value)))

    @contextmanager
    def _complaints(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.Error as error:
            raise TableError(f"{self._path} cannot be used: {error}") from None


def _require_same(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
    """Refuse to resume under other conditions; name the first key that differs."""
    differing = [key for key in {**found, **wanted} if found.get(key) != wanted.get(key)]
    if differing:
        key = differing[0]
        more = f" (and {len(differing) - 1} more)" if len(differing) > 1 else ""
        raise ConfigError(
            f"cannot resume: {key} = {wanted.get(key)}; allowed: {found.get(key)}, as in the finished points{more}"
        )
