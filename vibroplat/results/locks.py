"""Who works in a directory: locks that name their holder."""

from __future__ import annotations

import errno
import logging
import os
import platform
import stat
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path

from filelock import FileLock, SoftFileLock, Timeout

from vibroplat.errors import TableError

#: Name of the lock that is held while files of a directory are replaced.
NAME = "files.lock"
#: Longest time (s) that a command waits for another one to replace its files, which takes milliseconds.
MAX_WAIT_S = 60.0

#: What a file system answers that knows no locks.
_WITHOUT_LOCKS = {errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS}

_log = logging.getLogger(__name__)


class Lock:
    """A lock of the operating system on a file, which therefore ends with the process that holds it.

    The file says who holds the lock: process, host, and since when. It stays when the lock is released: if it were
    removed, a process that waits for it and one that creates it anew would both believe that they hold it.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = FileLock(path)

    def acquire(self, seconds: float = 0.0) -> None:
        """Take the lock, or wait so long for it.

        Raises
        ------
        TableError
            Another process holds it; the message names it.
        OSError
            The file cannot be created, or the file system has no locks.
        """
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # without locks of the system filelock uses the file's existence
                self._lock.acquire(timeout=seconds)
        except Timeout:
            raise TableError(f"{self._path.parent} is in use by {self._holder()}") from None
        share(self._path)
        self._write(f"{os.getpid()}\n{platform.node()}\n{datetime.now(UTC).isoformat(timespec='seconds')}\n")

    def release(self) -> None:
        """Let others take the lock."""
        if self._lock.is_locked:
            self._write("")
            self._lock.release()

    def _write(self, text: str) -> None:
        if not isinstance(self._lock, SoftFileLock):  # whose file has contents of its own
            with suppress(OSError):  # a full disk must not keep anybody from locking
                self._path.write_text(text, encoding="utf-8")

    def _holder(self) -> str:
        try:
            process, host, *since = self._path.read_text(encoding="utf-8").split("\n")[:3]
        except (OSError, ValueError):
            return "another process"
        moment = f" since {since[0]}" if since and since[0][:4].isdecimal() and "T" in since[0] else ""
        return f"process {process} on {host}{moment}"


def share(path: Path) -> None:
    """Let those write to a file who may write to its folder: its group is the folder's. Only its owner can do so."""
    with suppress(OSError):
        folder, status = path.parent.stat(), path.stat()
        if status.st_gid != folder.st_gid and hasattr(os, "chown"):
            os.chown(path, -1, folder.st_gid)
        path.chmod(stat.S_IMODE(status.st_mode) | folder.st_mode & (stat.S_IRGRP | stat.S_IWGRP))


@contextmanager
def replacement_lock(directory: Path) -> Iterator[None]:
    """Hold the lock of a directory while its files are replaced.

    On a file system without locks one line says so. There two commands may mix their files, which readers refuse.

    Raises
    ------
    TableError
        Another process holds it for longer than :data:`MAX_WAIT_S`, or it cannot be created.
    """
    lock = Lock(directory / NAME)
    try:
        lock.acquire(MAX_WAIT_S)
    except OSError as error:
        if error.errno not in _WITHOUT_LOCKS:
            raise TableError(f"{directory / NAME} cannot be written: {error.strerror or error}") from None
        _log.warning("the file system of %s has no locks; let only one command at a time write there", directory)
    try:
        yield
    finally:
        lock.release()
