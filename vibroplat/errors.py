"""Errors with messages for users."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

#: Longest message; keys and names from users may be longer.
MAX_TEXT = 400


class VibroplatError(Exception):
    """Base of all errors that vibroplat raises on purpose.

    The message is one line. Characters that cannot be printed are escaped; a message longer than
    :data:`MAX_TEXT` is shortened in the middle.
    """

    #: Exit code of the command line; 1 if the input was valid but the work failed.
    exit_code = 2

    def __init__(self, text: str) -> None:
        line = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
        if len(line) > MAX_TEXT:  # without the ends of names that are cut
            first, last = (
                re.sub(r" \S{,40}$", "", line[: MAX_TEXT // 2]),
                re.sub(r"^\S{,40} ", "", line[-MAX_TEXT // 2 :]),
            )
            line = f"{first} … {last}"
        super().__init__(line)


class ConfigError(VibroplatError):
    """A configuration that cannot be used; the message names the key, the value and what is allowed."""


@contextmanager
def errors_about(place: object) -> Iterator[None]:
    """Begin errors of a configuration with the file, section or key that they are about."""
    try:
        yield
    except ConfigError as error:
        raise ConfigError(f"{place}: {error}") from None


class MotionError(VibroplatError):
    """A motion that ended before its time; the message says why, when and where."""

    exit_code = 1


class TableError(VibroplatError):
    """A result file that cannot be written or read."""
