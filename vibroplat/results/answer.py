"""What a command prints: the answer in its first line and a few more, and all of it on request."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple, Self

from vibroplat.config.digits import quantity
from vibroplat.config.engine_choice import COMPUTED_BY
from vibroplat.config.plausibility import WARNING, split_severity

#: Most lines that a command prints without ``-v``, the width of notes, and of lines with remarks (characters).
MAX_LINES, WIDTH, WIDEST = 12, 100, 110
#: Most failures that are told one by one.
MAX_FAILURES = 3
#: Width of the labels of the overview, and of a label and a value in the short lines (characters).
LABELS, LABEL, VALUE = 28, 20, 22
#: Relative difference up to which the numbers of two exciters are told once.
EQUAL_DIFFERENCE = 0.01


class Answer(NamedTuple):
    """What a command prints.

    Attributes
    ----------
    lines
        Labels and texts of an overview, printed with ``-v``.
    text
        Further lines below it.
    notes
        Warnings.
    failures
        A line for each motion that failed.
    headline
        The answer in a sentence; empty if a provenance holds none.
    short
        The few lines below it that are printed without ``-v``, too.
    """

    lines: Mapping[str, str] = {}
    text: Sequence[str] = ()
    notes: Sequence[str] = ()
    failures: Sequence[str] = ()
    headline: str = ""
    short: Sequence[str] = ()

    @classmethod
    def from_tree(cls, tree: object) -> Self:
        """Return the answer that a provenance holds; an empty one if it holds none."""
        values = tree if isinstance(tree, Mapping) else {}
        lines, headline = values.get("lines"), values.get("headline")
        overview = {str(label): str(text) for label, text in lines.items()} if isinstance(lines, Mapping) else {}
        texts = {name: values.get(name) for name in ("text", "notes", "failures", "short")}
        lists = {name: [str(line) for line in given] for name, given in texts.items() if isinstance(given, list)}
        return cls(lines=overview, headline=str(headline or ""), **lists)

    def to_tree(self) -> dict[str, object]:
        """Return it as plain values, for a provenance."""
        texts = {name: list(getattr(self, name)) for name in ("text", "notes", "failures", "short")}
        return {"lines": dict(self.lines), "headline": self.headline, **texts}

    def brief(self, room: int = MAX_LINES) -> list[str]:
        """Return the answer in at most ``room`` lines: headline, short lines, and as many notes as there is room for.

        All warnings are among them, and which engine computed it: they take the room of other lines, or more than that.
        An answer without a headline is as long as it is.
        """
        if not self.headline:
            return self.full()
        lines = [self.headline, *(f"  {line}" for line in self.short)]
        others = [note for note in self.notes if not note.startswith((WARNING, COMPUTED_BY))]
        kept = [line for note in self.notes if note not in others for line in wrapped(note)]
        left = room - len(kept)
        if len(lines) + bool(others) > left:
            count = max(left - 1, 1)
            return [*lines[:count], f"  … {len(lines) - count + len(others)} more lines: -v prints them", *kept]
        return lines + kept + notes_within(others, left - len(lines))

    def full(self) -> list[str]:
        """Return all of it but the failures."""
        begin = [self.headline, *(f"  {line}" for line in self.short), ""] if self.headline else []
        return [*begin, *label_lines(self.lines), *self.text, *map(noted, self.notes)]

    def __str__(self) -> str:
        """Return what is printed without ``-v``."""
        return "\n".join([*self.brief(), *first_failures(self.failures)])


def label_lines(lines: Mapping[str, str]) -> list[str]:
    """Return labels and texts in two columns."""
    width = max([LABELS, *(len(label) + 2 for label in lines)])
    return [f"{label:<{width}}{text}".rstrip() for label, text in lines.items()]


def first_failures(lines: Sequence[str], total: str = "") -> list[str]:
    """Return the first failures, and a total if there is one or some are left out."""
    left = len(lines) - MAX_FAILURES
    last = total or (f"… and {left} more failures" if left > 0 else "")
    return [*lines[:MAX_FAILURES], *([last] if lines and last else [])]


def short_line(label: str, value: str, more: str = "", width: int = LABEL) -> str:
    """Return a short line: a label, a value, and those of the remarks that qualify it for which there is room."""
    return fitting(f"{label:<{width - 2}}  {value:<{VALUE - 2}}  ", more.split("; "), WIDEST - 2 + width - LABEL)


def fitting(begin: str, remarks: Iterable[str], width: int = WIDEST) -> str:
    """Return the beginning of a line and as many remarks, in their order, as there is room for."""
    shown = [remark for remark in remarks if remark]
    while shown and len(begin + "; ".join(shown)) > width:
        shown.pop()
    return (begin + "; ".join(shown)).rstrip()


def in_columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of texts as lines, each column as wide as its widest text."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(f"{text:<{width}}" for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def counted(number: int, noun: str) -> str:
    """Return a number with a noun, which gets an s for all numbers but 1."""
    return f"{number} {noun}{'s' * (number != 1)}"


def are_alike(values: Sequence[float]) -> bool:
    """Return whether the numbers of both exciters are equal within 1 %."""
    return abs(values[0] - values[1]) <= EQUAL_DIFFERENCE * max(map(abs, values))


def of_both(values: Sequence[float], unit: str) -> str:
    """Write the numbers of both exciters: once if they are equal within 1 %."""
    if are_alike(values):
        return f"{quantity(values[0], unit)} each"
    return " and ".join(quantity(value, unit, largest=max(map(abs, values))) for value in values)


def notes_within(notes: Sequence[str], room: int) -> list[str]:
    """Return the lines of as many notes as have room, then how many more there are."""
    parts = [wrapped(note) for note in notes]
    fits = [parts[:count] for count in range(len(parts) + 1)]
    whole = [few for few in fits if sum(map(len, few)) + (len(few) < len(parts)) <= room]
    shown = whole[-1] if whole else []
    lines = [line for note in shown for line in note]
    left = len(parts) - len(shown)
    if left and not shown:
        begin = textwrap.shorten(" ".join(parts[0]), WIDTH - 20, placeholder=" …")
        lines.append(f"  {begin} (-v)" if left == 1 else f"  {begin} ({left - 1} more: -v)")
    elif left:
        lines.append(f"  {counted(left, 'more note')}: -v")
    return lines


def wrapped(note: str) -> list[str]:
    """Return the lines of a note."""
    return textwrap.wrap(f"  {noted(note)}", WIDTH, subsequent_indent=" " * 8, break_on_hyphens=False)


def noted(note: str) -> str:
    """Return a note with what it is."""
    return note if split_severity(note)[0] else f"note: {note}"


class Numbers(dict[str, Any]):
    """A summary that records which of its numbers were read; missing ones are None."""

    def __init__(self, summary: Mapping[str, Any]) -> None:
        super().__init__(summary)
        self.read: set[str] = set()

    def __getitem__(self, name: str) -> Any:
        self.read.add(name)
        return self.get(name)
