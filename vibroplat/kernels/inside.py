"""Kernels as other kernels call them: without what calls from Python need, and without machine code of their own.

Numba makes machine code of every function that it compiles, and with it what turns Python's objects into arguments,
which for tuples of arrays is more than most kernels. Its callers need neither: LLVM links what a kernel is before it
becomes machine code into each of them and optimizes it there. Without both a first run waits a third less.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from types import FunctionType
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.registry import CPUDispatcher
from numba.core.types import unliteral

from vibroplat.kernels.cache import kept

#: Division by zero gives inf or nan, as in C, instead of an exception; no kernel is called through a C wrapper.
OPTIONS = {"nopython": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}


class Kernel(CPUDispatcher):
    """A kernel that Python and other kernels call, each what is compiled for it; most have only one kind of caller."""

    def __init__(self, function: Callable[..., Any], *, inline: bool = False, fused: bool = False) -> None:
        self._options = OPTIONS | ({"fastmath": {"contract"}} if fused else {})
        super().__init__(function, targetoptions=self._options)
        self._inline, self._kept = inline, kept(function)
        if self._kept:
            self.enable_caching()

    @cached_property
    def _inside(self) -> Any:
        """The kernel as others call it; where all are on disk, none is needed."""
        function = self.py_func
        twin = FunctionType(function.__code__, function.__globals__, closure=function.__closure__)
        # numba keeps a function by its name
        twin.__module__, twin.__qualname__ = function.__module__, f"{function.__qualname__}.inside"
        options = self._options | {"no_cpython_wrapper": True, "forceinline": self._inline}
        found = CPUDispatcher(twin, targetoptions=options, pipeline_class=_InsideCompiler)
        if self._kept:
            found.enable_caching()
        return found

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Say how other kernels call it, and compile it for them, for all numbers of a type at once.

        What is known of a number, as of a degree, LLVM sees where it puts the kernel into its caller.
        """
        named = {name: unliteral(kind) for name, kind in kws.items()}
        return self._inside.get_call_template(tuple(unliteral(kind) for kind in args), named)

    def get_overload(self, sig: Any) -> Any:
        """Return what other kernels call."""
        return self._inside.get_overload(sig)


class _InsideLibrary(JITCodeLibrary):
    """What LLVM knows of a kernel, for the libraries of its callers."""

    @property
    def codegen(self) -> Any:
        """Ask for no changes of machine code, as there is none."""
        return _NoMachineCode

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0, as numba does for what it has no machine code of."""
        self._ensure_finalized()  # type: ignore[no-untyped-call]
        return 0

    def _optimize_final_module(self) -> None:
        """Leave it to the callers, which optimize all that they call."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()  # type: ignore[no-untyped-call]
        self._finalized = True

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        """Return what is kept on disk."""
        module = self._get_module_for_linking()  # type: ignore[no-untyped-call]
        return self.name, "bitcode", module.as_bitcode()


class _NoMachineCode:
    """The part of numba's code generator that would change machine code."""

    @staticmethod
    def set_env(name: str, environment: Any) -> None:
        """Do nothing: an environment is for exceptions and objects of Python, which no kernel has."""


class _InsideCompiler(Compiler):
    """Numba's compiler, with a library of ours."""

    def __init__(self, typing_context: Any, context: Any, library: Any, *rest: Any) -> None:
        library = library or _InsideLibrary(context.codegen(), "kernel")  # type: ignore[no-untyped-call]
        super().__init__(typing_context, context, library, *rest)  # type: ignore[no-untyped-call]
