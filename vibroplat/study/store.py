"""Results on disk, stored one by one as they are finished, so that a killed process loses none of them."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

from filelock import FileLock, Timeout

from vibroplat.errors import ConfigError, TableError
from vibroplat.overrides import flat

#: Name of the file, next to the tables made from it.
FILE = "points.sqlite"

#: What is stored of one task: plain values that JSON can hold.
Record = dict[str, Any]


class Records(Protocol):
    """Where chains of tasks store their records: a :class:`Store` or a part of one."""

    def write(self, chain: int | str, place: int, record: Mapping[str, Any]) -> None:
        """Store the record at a place of a chain."""
        ...

    def read(self, chain: int | str) -> Iterator[tuple[int, Record]]:
        """Yield places and records of a chain in their order."""
        ...


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
    TableError
        The file cannot be written, is in use, or is no such file.
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
        """Open the file; keep or delete its records, if that is allowed."""
        with self._complaints():
            self._connection = sqlite3.connect(self._path)
            # with a write-ahead log a record is complete or absent whenever the process dies, and writing is quick
            self._base.execute("PRAGMA journal_mode = WAL")
            self._base.execute("PRAGMA synchronous = NORMAL")
            self._base.execute("CREATE TABLE IF NOT EXISTS about (key TEXT PRIMARY KEY, value TEXT)")
            self._base.execute(
                "CREATE TABLE IF NOT EXISTS records (first, second INTEGER, record TEXT, PRIMARY KEY (first, second))"
            )
            found, finished = self._about("conditions"), self._about("finished")
        if found is not None:
            if resume:
                _require_same(flat(found), flat(wanted))
            elif not (finished or overwrite) and len(self):
                raise ConfigError(
                    f"{Path(self._path).parent} holds {len(self)} points of unfinished work; "
                    "allowed: --resume to continue it, --overwrite to start again"
                )
        with self._complaints(), self._base:
            if not resume:
                self._base.execute("DELETE FROM records")
            self._tell("conditions", wanted)
            self._tell("finished", finished if resume else False)

    def __len__(self) -> int:
        with self._complaints():
            return int(self._base.execute("SELECT COUNT(*) FROM records").fetchone()[0])

    def lengths(self) -> dict[int | str, int]:
        """Return the number of records of each chain that has one."""
        with self._complaints():
            return dict(self._base.execute("SELECT first, COUNT(*) FROM records GROUP BY first"))

    def write(self, chain: int | str, place: int, record: Mapping[str, Any]) -> None:
        """Store the record at a place of a chain; numbers that are not finite are refused with a ValueError."""
        text = json.dumps(record, allow_nan=False)
        with self._complaints(), self._base:
            self._base.execute("INSERT OR REPLACE INTO records VALUES (?, ?, ?)", (chain, place, text))

    def read(self, chain: int | str) -> Iterator[tuple[int, Record]]:
        """Yield places and records of a chain in their order."""
        with self._complaints():
            rows = self._base.execute("SELECT second, record FROM records WHERE first = ? ORDER BY second", (chain,))
            for place, text in rows:
                yield place, json.loads(text)

    def part(self, name: str) -> Records:
        """Return the part of the store that holds the chains of one purpose."""
        return _Part(self, name)

    def finish(self) -> None:
        """Mark the work as finished: nothing is missing."""
        with self._complaints(), self._base:
            self._tell("finished", True)

    def close(self) -> None:
        """Close the file and let other processes use it."""
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
        assert self._connection is not None  # opened with the store
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


class _Part:
    """Part of a store, whose chains have names of their own."""

    def __init__(self, store: Store, name: str) -> None:
        self._store = store
        self._name = name

    def write(self, chain: int | str, place: int, record: Mapping[str, Any]) -> None:
        self._store.write(f"{self._name}/{chain}", place, record)

    def read(self, chain: int | str) -> Iterator[tuple[int, Record]]:
        return self._store.read(f"{self._name}/{chain}")


def _require_same(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
    """Refuse to resume under other conditions, and name the first key that differs."""
    differing = [key for key in {**found, **wanted} if found.get(key) != wanted.get(key)]
    if differing:
        key = differing[0]
        more = f" (and {len(differing) - 1} more)" if len(differing) > 1 else ""
        raise ConfigError(
            f"cannot resume: {key} = {wanted.get(key)}; allowed: {found.get(key)}, as in the finished points{more}"
        )
