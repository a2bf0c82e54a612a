"""Standard streams, and progress bars.

Bars are shown only on a terminal: each function yields what reports progress, or None without a terminal.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


def open_streams() -> None:
    """Give closed standard streams the null device, and let every character be printed.

    Otherwise a result file would get the number of a closed stream, with all that is printed to it. What a stream's
    encoding does not have is escaped.
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


@contextmanager
def run_progress(name: str, seconds: float) -> Iterator[Callable[[float, int], None] | None]:
    """Show the simulated time of a run (s) and its number of events."""
    counts = "{task.fields[events]} events"
    with _bar(f"{name}: loading kernels", seconds, "s", counts, number=":.2f", events=0) as update:
        yield update and (lambda reached, events: update(reached, events=events, description=name))


@contextmanager
def points_progress(name: str, counted: str = "points") -> Iterator[Callable[[int, int], None] | None]:
    """Show the number of finished points, or of what else is counted, of at most so many."""
    with _bar(name, 1, counted, "") as update:
        yield update and (lambda finished, most: update(finished, total=most))


@contextmanager
def compilation_progress() -> Iterator[None]:
    """Show that kernels are compiled, and the time that it has taken."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = SpinnerColumn(), TextColumn("compiling the kernels"), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as line:
        line.add_task("")
        yield


@contextmanager
def _bar(
    name: str, total: float, unit: str, counts: str, number: str = "", **fields: Any
) -> Iterator[Callable[..., None] | None]:
    """Show a progress bar with counts next to it."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn(f"{{task.completed{number}}}/{{task.total}} {unit}"),
        TextColumn(counts),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(name, total=total, **fields)

        def update(completed: float, **changed: Any) -> None:
            bar.update(task, completed=completed, **changed)

        yield update
