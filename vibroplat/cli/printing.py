"""What commands print of their results."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vibroplat.results.run import Trajectory

#: Width of the labels.
WIDTH = 28


def print_lines(lines: Mapping[str, str], width: int = WIDTH) -> None:
    """Print labels and texts in two columns."""
    for label, text in lines.items():
        print(f"{label:<{width}}{text}")


def print_table(header: Sequence[str], rows: Iterable[Sequence[str]], most: int, more: str) -> None:
    """Print the first rows of a table of texts in columns; if they are not all, where the others are."""
    lines = [header, *rows]
    shown = lines[: most + 1]
    widths = [max(map(len, column)) for column in zip(*shown, strict=True)]
    for line in shown:
        print("  ".join(f"{text:<{width}}" for text, width in zip(line, widths, strict=True)).rstrip())
    if len(lines) > len(shown):
        print(f"… and {len(lines) - len(shown)} more: {more}")


def print_notes(notes: list[str]) -> None:
    """Print what is to be noted, a line each."""
    for note in notes:
        print(f"note: {note}")


def print_summary(result: Trajectory, directory: Path) -> None:
    """Print the most important results, first those of the measured part; summary.json holds all of them."""
    from vibroplat.results.card import results, whole

    lines = results(result.scene, result.summary, result.origin) | whole(result.summary)
    print_lines(lines | {"tables": str(directory)})
