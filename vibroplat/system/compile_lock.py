"""Processes that compile: one at a time each kernel, and a second one for the time that a command compiles.

Processes keep what they compile in the same folder, and a kernel is locked while one of them compiles it: the others
wait, and then load it. If two compiled it, their machine code could differ in the last bits of what it computes. Locks
are the system's own and end with their process, so nobody waits for a process that has died. Nor do two wait for each
other: each waits only for what its own kernel calls, and no kernel calls itself.

Compiling is Python's work for the most part, so threads would not help a command that compiles all; a second process
does, each of the two compiling some kernels.
"""

from __future__ import annotations

import ctypes
import errno
import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

try:
    import fcntl as _fcntl
except ImportError:  # on Windows
    _fcntl = None  # type: ignore[assignment]

from vibroplat.system.memory import MIN_COMPILING_ADDRESS_SPACE, available

_log = logging.getLogger(__name__)

#: Signals that end a command, and with it its second process.
_SIGNALS = {signal.SIGINT, signal.SIGTERM}
#: Name of the file in the folder whose bytes are locked, one for each kernel.
LOCK_FILE = ".locks"
#: Longest time (s) to wait for a kernel, which takes seconds: its process may have been stopped. And how often to try.
MAX_WAIT_S, PAUSE_S = 120.0, 0.002
#: PR_SET_PDEATHSIG: which signal a process gets when its parent dies.
_WHEN_PARENT_DIES = 1


class _Shared:
    """What is known of this process."""

    is_second = False
    #: Whether it still waits for others: not again after one that was waited for too long, and may hold more.
    waits = True


def is_second() -> bool:
    """Whether this process only compiles, and calls no kernel."""
    return _Shared.is_second


@contextmanager
def locked(folder: Path | None, place: int) -> Iterator[None]:
    """Keep other processes from the block with the same folder and number, below 2⁶³; wait while one is there.

    Blocks may be nested. Without a folder, or where it has no locks, each process does the same.
    """
    file = None if folder is None else _file(folder)
    if file is None or not (_Shared.waits and _take(file, place)):
        yield
        return
    try:
        yield
    finally:
        _fcntl.lockf(file, _fcntl.LOCK_UN, 1, place)


@cache
def _file(folder: Path) -> int | None:
    """Open the file that is locked, once: all locks of a process go when it closes the file."""
    if _fcntl is None:
        return None
    try:
        return os.open(folder / LOCK_FILE, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600)
    except OSError:
        return None


def _take(file: int, place: int) -> bool:
    """Lock a byte of a file; False where that is not possible."""
    latest = time.monotonic() + MAX_WAIT_S
    while True:
        try:
            _fcntl.lockf(file, _fcntl.LOCK_EX | _fcntl.LOCK_NB, 1, place)
        except OSError as error:
            if error.errno not in (errno.EAGAIN, errno.EACCES):
                return False
            if time.monotonic() > latest:
                _Shared.waits = False
                _log.warning("a process that compiles was waited for %g s; has it been stopped?", MAX_WAIT_S)
                return False
        else:
            return True
        time.sleep(PAUSE_S)


@contextmanager
def second_compiler(work: Callable[[], object]) -> Iterator[None]:
    """Run ``work`` (compiling kernels) in a second process while the block runs, if a core and memory are available.

    The second process is silent, and its failure does no harm: this process compiles the kernels that it does not find.
    """
    if not _is_of_use():
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)  # in the second process for good
    parent, child = os.getpid(), os.fork()
    if child == 0:
        _do(work, parent)
    signal.pthread_sigmask(signal.SIG_SETMASK, before)
    try:
        yield
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


def _is_of_use() -> bool:
    """Whether two processes are faster than one, and this one can be copied: it must have no other threads."""
    return (
        sys.platform == "linux"
        and len(os.sched_getaffinity(0)) > 1
        and threading.active_count() == 1
        and available() > MIN_COMPILING_ADDRESS_SPACE
    )


def _do(work: Callable[[], object], parent: int) -> None:
    """Do the work of the second process, silently, and end it; it ends with its parent too, however that ends."""
    try:
        _Shared.is_second = True
        ctypes.CDLL(None).prctl(_WHEN_PARENT_DIES, signal.SIGKILL)
        silence = os.open(os.devnull, os.O_RDWR)
        for stream in range(3):
            os.dup2(silence, stream)
        if os.getppid() == parent:
            work()
    finally:
        os._exit(0)
