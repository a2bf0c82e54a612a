"""What can go wrong, as the user is told of it."""

from __future__ import annotations

#: Longest text of an error; what users put into keys and names may be longer.
MAX_TEXT = 400


class VibroplatError(Exception):
    """Base of all errors that vibroplat raises on purpose.

    The text is one line for the user: characters that do not print are escaped, and it is cut at
    :data:`MAX_TEXT`.
    """

    def __init__(self, text: str) -> None:
        line = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
        super().__init__(line if len(line) <= MAX_TEXT else line[: MAX_TEXT - 1] + "…")


class ConfigError(VibroplatError):
    """A configuration that cannot be used; the text names the key, the value and what is allowed."""


class TableError(VibroplatError):
    """A result table that cannot be written or read."""
