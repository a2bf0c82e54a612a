"""Loops over the numbers of a row at once, as vectors of the processor.

A row is a line of a contiguous array. Numba leaves sums over the rows of an array in memory and does not see that the
numbers of a row may go side by side; here they stay in registers, which is several times faster. A row that was just
stored number by number cannot be loaded as a vector before all of it has left the processor, so rows are stored whole.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from vibroplat.kernels.compiled import FloatArray

INDEX = ir.IntType(64)
PLACE = ir.IntType(32)
#: A product may be added to a sum without being rounded in between.
_FUSED = ("contract",)
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
            self._length = ir.Constant(INDEX, 0)
        self._base = builder.ptrtoint(array.data, INDEX)

    def _place(self, row: Any, column: Any, kind: Any) -> Any:
        b = self._builder
        address = b.add(self._base, b.mul(row, self._length))
        if column is not None:
            address = b.add(address, b.mul(column, ir.Constant(INDEX, _BYTES)))
        return b.inttoptr(address, kind.as_pointer())

    def load(self, row: Any, column: Any = None) -> Any:
        """Load the numbers of a row, from a column on."""
        return self._builder.load(self._place(row, column, self.vector), align=_BYTES)

    def load_one(self, row: Any, column: Any) -> Any:
        """Load a single number."""
        return self._builder.load(self._place(row, column, ir.DoubleType()), align=_BYTES)

    def store(self, row: Any, numbers: Any, column: Any = None) -> None:
        """Store numbers into a row, from a column on."""
        self._builder.store(numbers, self._place(row, column, numbers.type), align=_BYTES)


def repeat(builder: Any, number: Any, vector: Any) -> Any:
    """Make a vector of one number."""
    single = builder.insert_element(ir.Constant(vector, ir.Undefined), number, ir.Constant(PLACE, 0))
    first = ir.Constant(ir.VectorType(PLACE, vector.count), [0] * vector.count)
    return builder.shuffle_vector(single, ir.Constant(vector, ir.Undefined), first)


def loop(builder: Any, first: Any, last: Any, step: int, initial: list[Any], body: Any) -> list[Any]:
    """Compile a loop over k from ``first`` to ``last``; ``body(k, totals)`` gives the totals after it.

    Returns k and the totals behind the loop, which are ``initial`` where it is not run.
    """
    entry = builder.block
    loop, end = builder.append_basic_block("loop"), builder.append_basic_block("end")
    order = "<=" if step > 0 else ">="
    builder.cbranch(builder.icmp_signed(order, first, last), loop, end)
    builder.position_at_end(loop)
    before = [first, *initial]
    phis = [builder.phi(number.type) for number in before]
    after = [*body(phis[0], phis[1:])]
    after.insert(0, builder.add(phis[0], ir.Constant(INDEX, step)))
    behind = builder.block  # where the body has ended
    builder.cbranch(builder.icmp_signed(order, after[0], last), loop, end)
    builder.position_at_end(end)
    results = [builder.phi(number.type) for number in before]
    for phi, result, number, next_number in zip(phis, results, before, after, strict=True):
        for merged in (phi, result):
            merged.add_incoming(number, entry)
            merged.add_incoming(next_number, behind)
    return results


def multiply_add(builder: Any, a: Any, b: Any, c: Any) -> Any:
    """Return a b + c."""
    return builder.fadd(builder.fmul(a, b, flags=_FUSED), c, flags=_FUSED)


@intrinsic
def _put_step(typing_context: Any, q: Any, lane: Any, degree: Any, length: Any, n: Any, shifted: Any, c: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        _, lane, degree, length, n, shifted, _ = values
        width = signature.args[0].shape[-1]
        rows = Rows(context, builder, signature.args[0], values[0], 8)
        out_rows = Rows(context, builder, signature.args[6], values[6], 8)
        one, zero = ir.Constant(INDEX, 1), ir.Constant(INDEX, 0)
        last = builder.add(n, n)
        fifth, eleventh = (ir.Constant(INDEX, i) for i in (5, 11))

        def load(k: Any) -> Any:
            if width == 1:
                return rows.load(k)
            row = ir.Constant(rows.vector, ir.Undefined)
            for i in range(8):
                single = rows.load_one(k, builder.add(lane, ir.Constant(INDEX, i * width)))
                row = builder.insert_element(row, single, ir.Constant(PLACE, i))
            return row

        def body(k: Any, totals: list[Any]) -> list[Any]:
            scale, row = totals
            following = builder.add(k, one)
            after = load(following)
            order = repeat(builder, builder.fmul(scale, builder.sitofp(following, ir.DoubleType())), rows.vector)
            coordinates = builder.fmul(row, repeat(builder, scale, rows.vector))
            out_rows.store(k, coordinates, zero)
            rates = builder.fmul(after, order)
            out_rows.store(k, rates, n)
            with builder.if_then(shifted):
                for numbers, place in ((coordinates, fifth), (rates, eleventh)):
                    out_rows.store(k, builder.extract_element(numbers, ir.Constant(PLACE, 6)), place)
            out_rows.store(k, builder.extract_element(coordinates, ir.Constant(PLACE, 7)), last)
            return [builder.fmul(scale, length), after]

        loop(builder, zero, degree, 1, [ir.Constant(ir.DoubleType(), 1.0), load(zero)], body)
        return context.get_dummy_value()

    kinds = types.int64, types.int64, types.float64, types.int64, types.boolean
    return types.void(q, *kinds, c), generate


if TYPE_CHECKING:

    def put_step(q: FloatArray, lane: int, degree: int, length: float, n: int, shifted: bool, c: FloatArray) -> None:
        """Write series in powers of time as a step's polynomials in its fraction: coordinates, rates, F_c.

        Parameters
        ----------
        q, lane
            Coefficients, shape (degree + 2 or more, 8 lanes), and which lane's: seven coordinates, then F_c. The row
            after the last is 0.
        length
            Duration of the step (s).
        n, shifted
            Number of coordinates that count, and whether the seventh of them comes in place of the sixth.
        c
            Filled, shape (degree + 1, 16): coordinates, their rates from column n on, F_c in column 2n, then numbers of
            no meaning.
        """
else:
    put_step = _put_step
