"""Kernels whose text is written when they are compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")

#: All that write kernels, as far as their modules have been imported.
WRITERS: list[Callable[[], str]] = []


def written(write: Callable[[], str]) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Let a kernel that other kernels call be what a function writes; the one below gives its arguments alone.

    The text is written when the kernel is compiled. It imports what it needs.
    """

    def mark(function: Callable[P, T]) -> Callable[P, T]:
        function.write = write  # type: ignore[attr-defined]
        WRITERS.append(write)
        return function

    return mark


def as_written(function: Any) -> Any:
    """Return the function that is to be compiled: what :func:`written` says, otherwise itself."""
    write = getattr(function, "write", None)
    if write is None:
        return function
    names: dict[str, Any] = {"__name__": function.__module__}
    exec(compile(write(), function.__code__.co_filename, "exec"), names)
    return names[function.__name__]
