"""Rows of an array as vectors of the processor.

A row is a line of a contiguous array. Numba leaves sums over the rows of an array in memory and does not see that the
numbers of a row may go side by side; as vectors they stay in registers, which is several times faster. A row that was
just stored number by number cannot be loaded as a vector before all of it has left the processor, so rows are stored
whole.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba.core import cgutils

_INDEX = ir.IntType(64)
_BYTES = 8

LINE = 64  # bytes of a line of the processor's cache


_NUMBER = np.dtype(float)


def in_lines(shape: tuple[int, ...], kind: np.dtype[Any] = _NUMBER) -> npt.NDArray[Any]:
    """Make an array of zeros that begins with a line of the processor's cache: its rows are loaded faster.

    Its elements are numbers, or records of a ``kind``.
    """
    whole = np.zeros(math.prod(shape) * kind.itemsize + LINE, np.uint8)
    return np.ndarray(shape, kind, whole, -whole.ctypes.data % LINE)


class Rows:
    """Loads and stores rows of an array as vectors of so many numbers; what a row has beyond them is left alone."""

    def __init__(self, context: Any, builder: Any, kind: Any, value: Any, numbers: int) -> None:
        self._builder = builder
        self.vector = ir.VectorType(ir.DoubleType(), numbers)
        array = context.make_array(kind)(context, builder, value)
        if kind.ndim > 1:
            self._length = cgutils.unpack_tuple(builder, array.strides, kind.ndim)[0]
        else:
            self._length = ir.Constant(_INDEX, 0)
        self._base = builder.ptrtoint(array.data, _INDEX)

    def _place(self, row: Any, column: Any, kind: Any) -> Any:
        b = self._builder
        address = b.add(self._base, b.mul(row, self._length))
        address = b.add(address, b.mul(column, ir.Constant(_INDEX, _BYTES)))
        return b.inttoptr(address, kind.as_pointer())

    def load(self, row: Any, column: Any) -> Any:
        """Load the numbers of a row, from a column on."""
        return self._builder.load(self._place(row, column, self.vector), align=_BYTES)

    def store(self, row: Any, numbers: Any, column: Any) -> None:
        """Store numbers into a row, from a column on."""
        self._builder.store(numbers, self._place(row, column, numbers.type), align=_BYTES)
