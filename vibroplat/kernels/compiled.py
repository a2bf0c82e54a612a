"""How the kernels are compiled: without the interpreter's lock, kept on disk between processes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

import numba
import numpy as np
import numpy.typing as npt

from vibroplat.errors import VibroplatError
from vibroplat.kernels.cache import kept
from vibroplat.kernels.inside import Kernel

if getattr(numba.config, "DISABLE_JIT", 0):
    raise VibroplatError(
        "NUMBA_DISABLE_JIT is set, but SUNDIALS calls the kernels by their addresses, which only compiled ones have; "
        "unset it"
    )

FloatArray = npt.NDArray[np.float64]

P = ParamSpec("P")
T = TypeVar("T")


def compiled(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a kernel; division by zero gives inf or nan, as in C, instead of an exception."""
    return cast("Callable[P, T]", Kernel(function))


def fused(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a kernel whose products may be added without being rounded first, which shortens long chains of sums."""
    return cast("Callable[P, T]", Kernel(function, fused=True))


def inlined(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a kernel into its callers.

    LLVM does so. Numba's own way, by source, copies the whole caller for each call: it took a fifth of the first run.
    """
    return cast("Callable[P, T]", Kernel(function, inline=True))


def callback(signature: str) -> Callable[[Callable[P, T]], Any]:
    """Compile a kernel to a C function of a fixed signature, kept on disk; its ``address`` is callable from C."""

    def compiled_to(function: Callable[P, T]) -> Any:
        return numba.cfunc(signature, cache=kept(function), error_model="numpy")(function)

    return compiled_to


@compiled
def copy(source: FloatArray, target: FloatArray) -> None:
    """Copy numbers; a loop compiles far faster than an assignment of slices, and runs alike."""
    for i in range(source.size):
        target[i] = source[i]
