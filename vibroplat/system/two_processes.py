"""A second process for the time that a command compiles, each of the two compiling some kernels.

Compiling is Python's work for the most part, so threads would not help. Both processes keep what they compile in the
same folder, and a kernel is locked while one of them compiles it: the other one waits, and then loads it. Locks are the
system's own and end with their process, so nobody waits for a process that has died. Nor do both wait for each other:
each waits only for what its own kernel calls, and no kernel calls itself.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from vibroplat.system.memory import COMPILING, available

#: Signals that end a command, and with it its second process.
_SIGNALS = {signal.SIGINT, signal.SIGTERM}
#: PR_SET_PDEATHSIG: which signal a process gets when its parent dies.
_WHEN_PARENT_DIES = 1


class _Shared:
    """What two processes share."""

    #: A file whose bytes are locked, one for each number; None in a process that is alone.
    locks: Any = None
    #: Whether this process is the second one.
    is_second = False


def is_second() -> bool:
    """Whether this process only compiles, and calls no kernel."""
    return _Shared.is_second


@contextmanager
def locked(place: int) -> Iterator[None]:
    """Keep the other process, if there is one, from the block with the same number, below 2⁶³; wait while it is there.

    Blocks may be nested.
    """
    if _Shared.locks is None:
        yield
        return
    import fcntl  # noqa: PLC0415  (not on Windows)

    with suppress(OSError):  # without a lock both do the same
        fcntl.lockf(_Shared.locks, fcntl.LOCK_EX, 1, place)
    try:
        yield
    finally:
        fcntl.lockf(_Shared.locks, fcntl.LOCK_UN, 1, place)


@contextmanager
def helped_by(work: Callable[[], object]) -> Iterator[None]:
    """Let a second process do ``work``, which compiles kernels, while this one is in the block, where that is of use.

    It needs a second core, and memory. It is silent, and what goes wrong there does no harm: this process compiles what
    it does not find.
    """
    if not _is_of_use():
        yield
        return
    with tempfile.TemporaryFile() as locks:
        _Shared.locks = locks
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
            _Shared.locks = None


def _is_of_use() -> bool:
    """Whether two processes are faster than one, and this one can be copied: it must have no other threads."""
    return (
        sys.platform == "linux"
        and len(os.sched_getaffinity(0)) > 1
        and threading.active_count() == 1
        and available() > COMPILING
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
