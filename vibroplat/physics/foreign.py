"""Calls of C functions by address, in compiled code.

An address that comes as an argument leaves compiled code free of it, so that it can be kept on disk;
and what is called that way is compiled once, not into each caller.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


def _caller(returned: Any) -> Any:
    """Make the intrinsic that calls functions of one return type."""

    def call(typing_context: Any, address: Any, arguments: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            passed = cgutils.unpack_tuple(builder, values[1])
            function = ir.FunctionType(context.get_value_type(returned), [value.type for value in passed])
            return builder.call(builder.inttoptr(values[0], function.as_pointer()), passed)

        return returned(address, arguments), generate

    return intrinsic(call)


@intrinsic  # type: ignore[misc]
def _as_pointer(typing_context: Any, address: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.inttoptr(values[0], context.get_value_type(signature.return_type))

    return types.CPointer(types.float64)(address), generate


if TYPE_CHECKING:

    def call_int(address: int, arguments: tuple[Any, ...]) -> int:
        """Call a C function that returns an int; pointers are passed as integers."""

    def call_double(address: int, arguments: tuple[Any, ...]) -> float:
        """Call a C function that returns a double."""

    def call_address(address: int, arguments: tuple[Any, ...]) -> int:
        """Call a C function that returns a pointer."""

    def pointer(address: int) -> Any:
        """Turn an address into a pointer to doubles, for ``numba.carray``."""
else:
    call_int = _caller(types.int32)
    call_double = _caller(types.float64)
    call_address = _caller(types.intp)
    pointer = _as_pointer
