"""Errors with messages for users."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

#: Characters of a text that change how it, or what follows, is shown: those of control but tabulator and end of line,
#: marks of direction and invisible ones, ends of lines and paragraphs, and halves of pairs.
_CONTROLS = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ud800-\udfff\ufff9-\ufffb]"
)

#: Longest message; keys and names from users may be longer.
MAX_TEXT = 400


def escape_controls(text: str) -> str:
    """Write characters of control, which may come from somebody else's files, as they are written in Python."""
    return _CONTROLS.sub(lambda found: repr(found[0])[1:-1], text)


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
