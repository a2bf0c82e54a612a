"""What can go wrong, as the user is told of it."""

from __future__ import annotations

#: Longest text of an error; what users put into keys and names may be longer.
MAX_TEXT = 400


class VibroplatError(Exception):
    """Base of all errors that vibroplat raises on purpose.

    The text is one line for the user: characters that do not print are escaped, and of one longer than
    :data:`MAX_TEXT` beginning and end are told.
    """

    #: Of the command line; 1 where the input was good and the work failed.
    exit_code = 2

    def __init__(self, text: str) -> None:
        line = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
        half = MAX_TEXT // 2
        super().__init__(line if len(line) <= MAX_TEXT else f"{line[:half]} … {line[-half:]}")


class ConfigError(VibroplatError):
    """A configuration that cannot be used; the text names the key, the value and what is allowed."""


class TableError(VibroplatError):
    """A result table that cannot be written or read."""
