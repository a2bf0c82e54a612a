"""Ctrl-C and SIGTERM end the program: one line, no half-written file, no worker left running.

Normally the process ends inside the signal's handler. An exception would not do: it is lost where C code calls
Python, as LLVM does while it loads or compiles a kernel, and in destructors. Only while worker processes are open
is the stack unwound, because they have to be closed.

This module is light to import: the program starts with it.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

#: What remains of a command that was stopped.
KEPT = "result files are complete, and --resume continues from the finished points"
#: Seconds during which further requests are ignored while the stack is unwound.
GRACE = 5.0

_WORDS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}

#: Temporary files that are being written.
_unfinished: set[Path] = set()


class _Ending:
    """What a request to end meets."""

    #: Contexts with something to close.
    open = 0
    #: Contexts that look for requests themselves.
    watching = 0
    #: The signal that came, and when.
    signal: int | None = None
    since = 0.0


def end_at_signals() -> None:
    """End this program at Ctrl-C and at SIGTERM.

    A signal that was ignored from the start stays ignored: a shell without job control starts commands with ``&``
    that way, and a Ctrl-C meant for the foreground must not end them.
    """
    for number in _WORDS:
        if signal.getsignal(number) not in (None, signal.SIG_IGN):
            signal.signal(number, _end)


def _end(number: int, _frame: object) -> None:
    if _Ending.signal is not None and time.monotonic() - _Ending.since < GRACE:
        return
    again = _Ending.signal is not None
    _Ending.signal, _Ending.since = number, time.monotonic()
    if not again:
        show_cursor = "\r\x1b[K\x1b[?25h" if os.isatty(2) else ""  # a progress bar may have hidden it
        os.write(2, f"{show_cursor}vibroplat: {_WORDS[signal.Signals(number)]}; {KEPT}\n".encode())
    if again or not _Ending.open:
        for path in _unfinished:
            with contextlib.suppress(OSError):
                path.unlink()
        os._exit(128 + number)
    if not _Ending.watching:
        stop_if_asked()


def stop_if_asked() -> None:
    """Unwind the stack if a signal has asked the program to end."""
    if _Ending.signal is not None:
        sys.exit(128 + _Ending.signal)


@contextmanager
def unwinding() -> Iterator[None]:
    """Unwind the stack at a request to end: something has to be closed."""
    _Ending.open += 1
    try:
        yield
    finally:
        _Ending.open -= 1


@contextmanager
def watching() -> Iterator[None]:
    """Only note a request to end; the block calls :func:`stop_if_asked` where it can be stopped."""
    _Ending.watching += 1
    try:
        yield
    finally:
        _Ending.watching -= 1


@contextmanager
def unfinished(path: Path) -> Iterator[None]:
    """Remove a file at a request to end, as it is not finished."""
    _unfinished.add(path)
    try:
        yield
    finally:
        _unfinished.discard(path)


@contextmanager
def held() -> Iterator[None]:
    """Hold back Ctrl-C until the end of the block; processes started in it never receive it.

    A terminal sends Ctrl-C to workers too. They inherit the mask, and their parent stops them.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
