"""Limits of processor time."""

import signal
from contextlib import contextmanager

import pytest


class _TooLong(BaseException):
    """Raised in whatever runs when its time is over; nothing catches it on the way."""


@contextmanager
def cpu_seconds(limit):
    """Fail when the block takes more processor time than that; it is ended there, however long it would be."""

    def stop(_signal, _frame):
        raise _TooLong

    before = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, limit)
    late = False
    try:
        yield
    except _TooLong:
        late = True
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)
    if late:
        raise pytest.fail.Exception(f"took more than {limit} s") from None
