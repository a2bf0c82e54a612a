"""Standard streams, and progress bars.

Bars are shown only on a terminal: each function yields what reports progress, or None without a terminal.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from vibroplat.errors import escape_controls


class _Escaping:
    """A stream for texts whose characters of control are shown instead of sent."""

    def __init__(self, stream: Any) -> None:
        #: Where rich sends characters of control of its own: it asks for an attribute of this name.
        self.rich_proxied_file = getattr(stream, "rich_proxied_file", stream)

    def write(self, text: str) -> int:
        """Write a text."""
        return int(self.rich_proxied_file.write(escape_controls(text)))

    def writelines(self, lines: Iterable[str]) -> None:
        """Write texts."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.rich_proxied_file, name)


def escape_streams() -> None:
    """Let nothing that is printed, by whatever way, change a terminal: names and notes may come from anybody."""
    sys.stdout, sys.stderr = map(_Escaping, (sys.stdout, sys.stderr))


def open_streams() -> None:
    """Give closed standard streams the null device, and let every character be printed.

    Otherwise a result file would get the number of a closed stream, with all that is printed to it. What a stream's
    encoding does not have is escaped, and so are characters of control.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest free number, which is this one
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w" if number else "r", encoding="utf-8"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if getattr(stream, "errors", "") in ("strict", "surrogateescape"):
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    escape_streams()


@contextmanager
def run_progress(name: str, seconds: float) -> Iterator[Callable[[float, int], None] | None]:
    """Show the simulated time of a run (s) and its number of events."""
    counts = "{task.fields[events]} events"
    name = escape_controls(name)
    with _bar(f"{name}: loading kernels", seconds, "s", counts, number=":.2f", events=0) as update:
        yield update and (lambda reached, events: update(reached, events=events, description=name))


@contextmanager
def points_progress(name: str, counted: str = "points") -> Iterator[Callable[[int, int], None] | None]:
    """Show the number of finished points, or of what else is counted, of at most so many."""
    with _bar(escape_controls(name), 1, counted, "") as update:
        yield update and (lambda finished, most: update(finished, total=most))


@contextmanager
def compilation_progress() -> Iterator[None]:
    """Show that kernels are compiled, and the time that it has taken."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = SpinnerColumn(), TextColumn("compiling the kernels"), TimeElapsedColumn()
    with Progress(*columns, **_look()) as line:
        line.add_task("")
        yield


def _look() -> dict[str, Any]:
    """Return where bars are shown, and how: other texts do not pass through rich, which would not escape them."""
    from rich.console import Console

    return {
        "console": Console(stderr=True),
        "transient": True,
        "redirect_stdout": False,
        "redirect_stderr": False,
    }


@contextmanager
def _bar(
    name: str, total: float, unit: str, counts: str, number: str = "", **fields: Any
) -> Iterator[Callable[..., None] | None]:
    """Show a progress bar with counts next to it."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn(f"{{task.completed{number}}}/{{task.total}} {unit}"),
        TextColumn(counts),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, **_look()) as bar:
        task = bar.add_task(name, total=total, **fields)

        def update(completed: float, **changed: Any) -> None:
            bar.update(task, completed=completed, **changed)

        yield update
