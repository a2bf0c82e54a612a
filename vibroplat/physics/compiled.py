"""How the kernels are compiled: without the interpreter's lock, kept on disk between processes."""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
T = TypeVar("T")


def compiled(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a kernel; division by zero gives inf or nan, as in C, instead of an exception."""
    return cast("Callable[P, T]", numba.njit(function, nogil=True, cache=True, error_model="numpy", fastmath=False))
