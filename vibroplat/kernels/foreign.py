"""Calls of C functions by address, in compiled code.

An address that comes as an argument leaves compiled code free of it, so that it can be kept on disk;
and what is called that way is compiled once, not into each caller.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

T = TypeVar("T")


def _caller(returned: Any) -> Any:
    """Make the intrinsic that calls functions of one return type."""

    def call(typing_context: Any, address: Any, arguments: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            passed = cgutils.unpack_tuple(builder, values[1])
            function = ir.FunctionType(context.get_value_type(returned), [value.type for value in passed])
            return builder.call(builder.inttoptr(values[0], function.as_pointer()), passed)

        return returned(address, arguments), generate

    return intrinsic(call)


def _pointer_to(kind: Any) -> Any:
    """Make the intrinsic that turns addresses into pointers of one type."""

    def point(typing_context: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return builder.inttoptr(values[0], context.get_value_type(signature.return_type))

        return kind(address), generate

    return intrinsic(point)


def _disown(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Take the owner off an array, or off each array of a tuple."""
    if isinstance(kind, types.BaseTuple):
        parts: Any = kind
        for i, part in enumerate(parts):
            inside = _disown(context, builder, part, builder.extract_value(value, i))
            value = builder.insert_value(value, inside, i)
        return value
    if not isinstance(kind, types.Array):
        return value
    view = context.make_array(kind)(context, builder, value)
    view.meminfo = cgutils.get_null_value(view.meminfo.type)
    view.parent = cgutils.get_null_value(view.parent.type)
    return view._getvalue()


@intrinsic
def _borrow(typing_context: Any, owned: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return _disown(context, builder, owned, values[0])

    return owned(owned), generate


if TYPE_CHECKING:

    def call_int(address: int, arguments: tuple[Any, ...]) -> int:
        """Call a C function that returns an int; pointers are passed as integers."""

    def call_address(address: int, arguments: tuple[Any, ...]) -> int:
        """Call a C function that returns a pointer."""

    def pointer(address: int) -> Any:
        """Turn an address into a pointer to doubles, for ``numba.carray``."""

    def void_pointer(address: int) -> Any:
        """Turn an address into a pointer without type, for ``numba.carray`` of records."""

    def borrow(owned: T) -> T:
        """View an array, or all arrays of a tuple, without owning them; the caller keeps them alive.

        Every access to an array in a tuple counts a reference, with an atomic instruction, which took a
        quarter of the time of a run; what has no owner is not counted.
        """
else:
    call_int = _caller(types.int32)
    call_address = _caller(types.intp)
    pointer = _pointer_to(types.CPointer(types.float64))
    void_pointer = _pointer_to(types.voidptr)
    borrow = _borrow
