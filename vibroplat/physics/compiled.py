"""How the kernels are compiled: without the interpreter's lock, kept on disk between processes."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

import numba
import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

P = ParamSpec("P")
T = TypeVar("T")


def _drop_stale_caches() -> None:
    """Delete cached machine code that is older than any kernel's source.

    Numba compares a cached function with its own file only, not with those of the functions it calls: a
    changed motor would go on being compiled into the old platform.
    """
    rooms = [Path(__file__).parent, Path(__file__).parents[1] / "solver"]
    newest = max(source.stat().st_mtime for room in rooms for source in room.glob("*.py"))
    for room in rooms:
        for cached in (room / "__pycache__").glob("*.nb[ci]"):
            if cached.stat().st_mtime < newest:
                cached.unlink(missing_ok=True)


with suppress(OSError):  # an installation that cannot be written keeps its caches elsewhere, and does not change
    _drop_stale_caches()


def compiled(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a kernel; division by zero gives inf or nan, as in C, instead of an exception."""
    return cast("Callable[P, T]", numba.njit(function, nogil=True, cache=True, error_model="numpy", fastmath=False))


def inlined(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a kernel into its callers instead of on its own, which for one of few callers is quicker."""
    return cast("Callable[P, T]", numba.njit(function, nogil=True, error_model="numpy", inline="always"))


def callback(signature: str) -> Callable[[Callable[P, T]], Any]:
    """Compile a kernel to a C function of a fixed signature, kept on disk; its ``address`` is callable from C."""
    return cast("Callable[[Callable[P, T]], Any]", numba.cfunc(signature, cache=True, error_model="numpy"))


@compiled
def copy(source: FloatArray, target: FloatArray) -> None:
    """Copy numbers; a loop compiles far faster than an assignment of slices, and runs alike."""
    for i in range(source.size):
        target[i] = source[i]
