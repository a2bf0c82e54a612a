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
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

#: What remains of a command that was stopped, and of one with finished points and an option ``--resume``.
KEPT = "this command has written no result, earlier ones are complete"
RESUMABLE = f"{KEPT}; --resume continues from the finished points"
#: Seconds during which further requests are ignored while the stack is unwound.
GRACE = 5.0

_WORDS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}

#: Signals of which programs have handlers that raise: Ctrl-C, time limits, and those that are free.
_RAISING = [
    getattr(signal, name)
    for name in ("SIGINT", "SIGTERM", "SIGALRM", "SIGVTALRM", "SIGPROF", "SIGUSR1", "SIGUSR2")
    if hasattr(signal, name)
]

#: Temporary files that are being written.
_unfinished: set[Path] = set()


class _Ending:
    """What a request to end meets."""

    #: Contexts with something to close.
    open = 0
    #: Contexts that look for requests themselves.
    watching = 0
    #: Whether the command can be continued by ``--resume``; None in a program, which has no command.
    resumable: bool | None = None
    #: The signal that came, and when.
    signal: int | None = None
    since = 0.0


def end_at_signals() -> None:
    """End this program, which is a command, at Ctrl-C and at SIGTERM.

    A signal that was ignored from the start stays ignored: a shell without job control starts commands with ``&``
    that way, and a Ctrl-C meant for the foreground must not end them.
    """
    _Ending.resumable = bool(_Ending.resumable)
    for number in _WORDS:
        if signal.getsignal(number) not in (None, signal.SIG_IGN):
            signal.signal(number, _end)


def offer_resume(offered: bool | None) -> None:
    """Say whether ``--resume`` can continue the command, None without a command; messages promise it only then."""
    _Ending.resumable = offered


def offer_resume_now() -> None:
    """Let a command promise ``--resume`` from now on, as a finished point is stored; a program promises nothing."""
    _Ending.resumable = None if _Ending.resumable is None else True


def records_kept() -> str:
    """Say, after a semicolon, what remains of a command that was stopped; nothing of a program."""
    if _Ending.resumable is None:
        return ""
    return f"; {RESUMABLE if _Ending.resumable else KEPT}"


def _end(number: int, _frame: object) -> None:
    if _Ending.signal is not None:
        if time.monotonic() - _Ending.since > GRACE:
            _exit(number)
        return
    _Ending.signal, _Ending.since = number, time.monotonic()
    show_cursor = "\r\x1b[K\x1b[?25h" if os.isatty(2) else ""  # a progress bar may have hidden it
    os.write(2, f"{show_cursor}vibroplat: {_WORDS[signal.Signals(number)]}{records_kept()}\n".encode())
    if not _Ending.watching:
        stop_if_asked()


def _exit(number: int) -> None:
    """End the process here; workers that are loading end with it."""
    for path in _unfinished:
        with contextlib.suppress(OSError):
            path.unlink()
    with contextlib.suppress(Exception):  # the signal may have come in the middle of a flush
        sys.stdout.flush()
    os._exit(128 + number)


def stop_if_asked() -> None:
    """End the program if a signal has asked for it, by unwinding the stack where something has to be closed."""
    if _Ending.signal is None:
        return
    if not _Ending.open:
        _exit(_Ending.signal)
    sys.exit(128 + _Ending.signal)


@contextmanager
def unwinding() -> Iterator[None]:
    """Unwind the stack at a request to end: something has to be closed."""
    _Ending.open += 1
    try:
        yield
    finally:
        _Ending.open -= 1
    stop_if_asked()


@contextmanager
def watching() -> Iterator[None]:
    """Put off a request to end until the block calls :func:`stop_if_asked`, or its end."""
    _Ending.watching += 1
    try:
        yield
    finally:
        _Ending.watching -= 1
    if not _Ending.watching:
        stop_if_asked()


@contextmanager
def handlers_put_off() -> Iterator[None]:
    """Put off the handlers of signals that a program has set until the end of the block.

    An exception that they raise is lost where C code calls Python. That of a command ends the process instead.
    """
    came: list[tuple[int, Any]] = []
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    known = {number: signal.getsignal(number) for number in _RAISING}
    handlers = {number: handler for number, handler in known.items() if callable(handler) and handler is not _end}
    try:
        for number in handlers:
            signal.signal(number, lambda *signal_and_frame: came.append(signal_and_frame))
        yield
    finally:
        try:
            _set(handlers)
        finally:  # one that came meanwhile may have raised
            _set(handlers)
    for number, frame in came:
        handlers[number](number, frame)


def _set(handlers: Mapping[int, Any]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)


@contextmanager
def unfinished(path: Path) -> Iterator[None]:
    """Remove a file at a request to end, as it is not finished."""
    _unfinished.add(path)
    try:
        yield
    finally:
        _unfinished.discard(path)


@contextmanager
def without_interrupts() -> Iterator[None]:
    """Let processes that are started in the block never receive Ctrl-C, which a terminal sends to them too.

    They inherit the mask of signals; it is their parent that stops them.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
