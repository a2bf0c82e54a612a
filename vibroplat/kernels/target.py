"""Which processor the kernels are compiled for: a generic one, so that machines share machine code and results.

Code for x86-64-v3 (AVX2 and FMA, in nearly all processors since 2015) carries one motion as fast as code for all that a
newer processor has: its kernels are chains of scalars that gain nothing from wider vectors. The same machine code then
runs everywhere, and computes the same bits. Kernels that carry several motions side by side take the widest vectors of
the machine (:func:`lanes`). A motion has the same bits in four and eight lanes, and others in two. What motions tell
each other on the way depends on their number as well, so that work is not resumed with another one. Eight lanes in
vectors of four would be the same everywhere, but take 9 to 25 % longer there. A user's own choice
(``NUMBA_CPU_NAME``, ``NUMBA_CPU_FEATURES``) goes before.
"""

from __future__ import annotations

import ctypes
import os
import platform
from collections.abc import Callable
from functools import cache
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir
from numba.core import config, types
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen, get_host_cpu_features
from numba.core.cpu import CPUContext
from numba.core.pythonapi import NativeValue, PythonAPI
from numba.core.registry import CPUTarget, cpu_target
from numba.core.utils import threadsafe_cached_property

#: Generic processors by machine, and what a processor must have of the names that LLVM gives its features.
GENERIC = {
    "x86_64": ("x86-64-v3", "cx16 sahf popcnt sse3 ssse3 sse4.1 sse4.2 avx avx2 bmi bmi2 f16c fma lzcnt movbe xsave"),
    "aarch64": ("generic", "neon"),
}
GENERIC |= {"AMD64": GENERIC["x86_64"], "arm64": GENERIC["aarch64"]}  # as other systems name them


#: What vectors of eight numbers take, and the processor that kernels for them are compiled for: LLVM would halve them.
_WIDE, _EIGHT = "avx512f avx512bw avx512cd avx512dq avx512vl", ("x86-64-v4", "-prefer-256-bit")


@cache
def lanes() -> int:
    """Return how many motions go side by side in the processor's vectors; ``VIBROPLAT_LANES`` asks for fewer."""
    most = 2 if processor()[0] == GENERIC["aarch64"][0] else 4
    own = set(get_host_cpu_features().split(","))
    if processor() == (GENERIC["x86_64"][0], "") and {f"+{one}" for one in _WIDE.split()} <= own:
        most = 8
    asked = os.environ.get("VIBROPLAT_LANES", "")
    return int(asked) if asked in ("2", "4") and int(asked) < most else most


@cache
def processor() -> tuple[str, str]:
    """Return the processor that kernels are compiled for, and its features beyond those of its name, as LLVM says.

    It is this machine's own where the user has chosen one, or where it lacks what the generic one has.
    """
    generic, needed = GENERIC.get(platform.machine(), ("", ""))
    name, features = getattr(config, "CPU_NAME", None), getattr(config, "CPU_FEATURES", None)
    own = get_host_cpu_features()
    if generic and name is None and features is None and {f"+{one}" for one in needed.split()} <= set(own.split(",")):
        return generic, ""
    return name or llvm.get_host_cpu_name(), own if features is None else features


class InsideLibrary(JITCodeLibrary):
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


class _Codegen(JITCPUCodegen):
    """Numba's generator of machine code, for a processor."""

    def __init__(self, name: str, made_for: tuple[str, str]) -> None:
        self._made_for = made_for
        super().__init__(name)  # type: ignore[no-untyped-call]

    def _get_host_cpu_name(self) -> str:
        return self._made_for[0]

    def _get_host_cpu_features(self) -> str:
        return self._made_for[1]

    def unserialize_library(self, serialized: tuple[str, str, Any]) -> Any:
        """Load a kernel; of what others call there is no machine code, as when it has just been compiled.

        Numba's own way makes some of what LLVM knows of it, without optimizing. Callers would then call that, as it has
        the same name as their own: three times slower.
        """
        name, kind, data = serialized
        if kind != "bitcode":
            return super().unserialize_library(serialized)  # type: ignore[no-untyped-call]
        library = InsideLibrary(self, name)  # type: ignore[no-untyped-call]
        library._final_module = llvm.parse_bitcode(data)
        library._finalize_final_module()
        return library


#: Place of the pointer to its data in numpy's object of a record, PyVoidScalarObject: behind head and size.
_DATA = object.__basicsize__ + 8


@cache
def _records_are_as_expected() -> bool:
    """Whether the data of numpy's records are where the kernels look for them."""
    array = np.zeros(1, [("number", float)])
    record = array[0]
    return bool(ctypes.c_void_p.from_address(id(record) + _DATA).value == array.ctypes.data)


class _PythonAPI(PythonAPI):
    """Turns Python's objects into arguments."""

    def to_native_value(self, typ: Any, obj: Any) -> Any:
        """Find the data of a record at their place: numba asks for them by name, which takes 6 µs a record."""
        if type(typ) is not types.Record or not _records_are_as_expected():
            return super().to_native_value(typ, obj)  # type: ignore[no-untyped-call]
        b, whole = self.builder, ir.IntType(64)
        place = b.add(b.ptrtoint(obj, whole), ir.Constant(whole, _DATA))
        return NativeValue(b.load(b.inttoptr(place, self.context.get_value_type(typ).as_pointer())))


class _Context(CPUContext):
    """Numba's, with these arguments."""

    def get_python_api(self, builder: Any) -> Any:
        return _PythonAPI(self, builder)  # type: ignore[no-untyped-call]


class _Target(CPUTarget):
    """Numba's target with a generator of its own: what others compile in this process stays for this machine."""

    def __init__(self, made_for: Callable[[], tuple[str, str]]) -> None:
        self._made_for = made_for
        super().__init__("cpu")  # type: ignore[no-untyped-call]

    @threadsafe_cached_property
    def _toplevel_target_context(self) -> Any:
        codegen = _Codegen("vibroplat", self._made_for())
        context = cpu_target.target_context.subtarget(_internal_codegen=codegen)
        context.__class__ = _Context
        return context

    @property
    def typing_context(self) -> Any:
        """Numba's own: kernels call its functions."""
        return cpu_target.typing_context


TARGET = _Target(processor)
#: The target of kernels that carry several motions.
WIDE_TARGET = _Target(lambda: _EIGHT if lanes() == 8 else processor())
