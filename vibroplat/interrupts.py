"""Ctrl-C where it cannot be an exception: while the program is loaded, and where workers are started.

Light to import: the program begins with it.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

#: What is there after a command was stopped.
KEPT = "tables under their final names are whole, and --resume goes on with finished points"
#: Exit code of a program that Ctrl-C has ended, also that which typer makes of it.
INTERRUPTED = 130


def _end(_number: int, _frame: object) -> None:
    os.write(2, f"vibroplat: interrupted; {KEPT}\n".encode())
    os._exit(INTERRUPTED)


@contextmanager
def ending_at_once() -> Iterator[None]:
    """Let Ctrl-C, or a request to end, end the process without unwinding it.

    Loading takes long, has nothing to undo, and goes through callbacks of LLVM, which an exception breaks.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number, ending in ((signal.SIGINT, _end), (signal.SIGTERM, signal.SIG_DFL)):
        if before[number] not in (None, signal.SIG_IGN):  # None: not Python's; ignored: in the background
            signal.signal(number, ending)
    try:
        yield
    finally:
        for number, handler in before.items():
            if handler is not None:
                signal.signal(number, handler)


@contextmanager
def held() -> Iterator[None]:
    """Hold Ctrl-C back until the end; what is started meanwhile never gets it, as signal masks are inherited.

    A terminal sends Ctrl-C to workers too, which would each tell of it; it is their parent's to stop them.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
