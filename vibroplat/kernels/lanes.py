"""Loops over the numbers of a row at once, as vectors of the processor.

A row is a line of a contiguous array. Numba leaves sums over the rows of an array in memory and does not see that the
numbers of a row may go side by side; here they stay in registers, which is several times faster. A row that was just
stored number by number cannot be loaded as a vector before all of it has left the processor, so rows are stored whole.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from vibroplat.kernels.compiled import FloatArray

_INDEX = ir.IntType(64)
_PLACE = ir.IntType(32)
#: A product may be added to a sum without being rounded in between.
_FUSED = ("contract",)
_BYTES = 8


class _Rows:
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

    def _place(self, row: Any) -> Any:
        b = self._builder
        return b.inttoptr(b.add(self._base, b.mul(row, self._length)), self.vector.as_pointer())

    def load(self, row: Any) -> Any:
        return self._builder.load(self._place(row), align=_BYTES)

    def store(self, row: Any, numbers: Any) -> None:
        self._builder.store(numbers, self._place(row), align=_BYTES)


def _repeated(builder: Any, number: Any, vector: Any) -> Any:
    """Make a vector of one number."""
    single = builder.insert_element(ir.Constant(vector, ir.Undefined), number, ir.Constant(_PLACE, 0))
    first = ir.Constant(ir.VectorType(_PLACE, vector.count), [0] * vector.count)
    return builder.shuffle_vector(single, ir.Constant(vector, ir.Undefined), first)


def _cauchy(numbers: int) -> Any:
    """Make the intrinsic for rows of so many numbers."""

    @intrinsic
    def products(typing_context: Any, a: Any, b: Any, n: Any, last: Any, out: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            first_rows, second_rows, out_rows = (
                _Rows(context, builder, signature.args[i], values[i], numbers) for i in (0, 1, 4)
            )
            n, last = values[2], values[3]
            one, two = ir.Constant(_INDEX, 1), ir.Constant(_INDEX, 2)
            zero = ir.Constant(first_rows.vector, [0.0] * numbers)

            def added(total: Any, j: Any) -> Any:
                factors = first_rows.load(j), second_rows.load(builder.sub(n, j))
                return builder.fadd(total, builder.fmul(*factors, flags=_FUSED), flags=_FUSED)

            # two sums side by side: an addition need not wait for the one before
            entry = builder.block
            loop, rest, odd, end = (builder.append_basic_block(f"products.{name}") for name in ("", "rest", "odd", "end"))
            builder.cbranch(builder.icmp_signed("<", two, last), loop, rest)
            builder.position_at_end(loop)
            phis = [builder.phi(kind) for kind in (_INDEX, first_rows.vector, first_rows.vector)]
            j, even_sum, odd_sum = phis
            after = builder.add(j, two), added(even_sum, j), added(odd_sum, builder.add(j, one))
            builder.cbranch(builder.icmp_signed("<", after[0], last), loop, rest)
            builder.position_at_end(rest)
            left = [builder.phi(kind) for kind in (_INDEX, first_rows.vector, first_rows.vector)]
            for phi, beyond, begun, passed in zip(phis, left, (two, zero, zero), after, strict=True):
                for block, number in ((entry, begun), (loop, passed)):
                    beyond.add_incoming(number, block)
                    phi.add_incoming(number, block)
            total = builder.fadd(left[1], left[2], flags=_FUSED)
            builder.cbranch(builder.icmp_signed("==", left[0], last), odd, end)
            builder.position_at_end(odd)
            whole = added(total, left[0])
            builder.branch(end)
            builder.position_at_end(end)
            found = builder.phi(first_rows.vector)
            found.add_incoming(total, rest)
            found.add_incoming(whole, odd)
            out_rows.store(ir.Constant(_INDEX, 0), found)
            return context.get_dummy_value()

        return types.void(a, b, types.int64, types.int64, out), generate

    return products


@intrinsic
def _put_row(typing_context: Any, a: Any, row: Any, numbers: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        rows = _Rows(context, builder, signature.args[0], values[0], len(signature.args[2]))
        vector = ir.Constant(rows.vector, ir.Undefined)
        for i, number in enumerate(cgutils.unpack_tuple(builder, values[2])):
            vector = builder.insert_element(vector, number, ir.Constant(_PLACE, i))
        rows.store(values[1], vector)
        return context.get_dummy_value()

    return types.void(a, types.int64, numbers), generate


def _horner(numbers: int) -> Any:
    """Make the intrinsic for rows of so many numbers."""

    @intrinsic
    def evaluate(typing_context: Any, c: Any, degree: Any, s: Any, out: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            rows, out_row = (_Rows(context, builder, signature.args[i], values[i], numbers) for i in (0, 3))
            one, zero = ir.Constant(_INDEX, 1), ir.Constant(_INDEX, 0)
            share, top = _repeated(builder, values[2], rows.vector), rows.load(values[1])
            entry = builder.block
            loop, end = builder.append_basic_block("horner"), builder.append_basic_block("horner.end")
            first = builder.sub(values[1], one)
            builder.cbranch(builder.icmp_signed(">=", first, zero), loop, end)
            builder.position_at_end(loop)
            k, total = builder.phi(_INDEX), builder.phi(rows.vector)
            found = builder.fadd(builder.fmul(total, share, flags=_FUSED), rows.load(k), flags=_FUSED)
            following = builder.sub(k, one)
            for phi, before, after in ((k, first, following), (total, top, found)):
                phi.add_incoming(before, entry)
                phi.add_incoming(after, loop)
            builder.cbranch(builder.icmp_signed(">=", following, zero), loop, end)
            builder.position_at_end(end)
            result = builder.phi(rows.vector)
            result.add_incoming(top, entry)
            result.add_incoming(found, loop)
            out_row.store(zero, result)
            return context.get_dummy_value()

        return types.void(c, types.int64, types.float64, out), generate

    return evaluate


if TYPE_CHECKING:
    Products = Callable[[FloatArray, FloatArray, int, int, FloatArray], None]

    def put_row(a: FloatArray, row: int, numbers: tuple[float, ...]) -> None:
        """Store numbers at the beginning of a row."""

    def products_2(a: FloatArray, b: FloatArray, n: int, last: int, out: FloatArray) -> None:
        """Do as :func:`products_16` for rows of 2 numbers."""

    def products_16(a: FloatArray, b: FloatArray, n: int, last: int, out: FloatArray) -> None:
        """Fill, for each of the 16 numbers of rows, the sum of a[j] b[n − j] from j = 2 to ``last``."""

    def horner_14(c: FloatArray, degree: int, s: float, out: FloatArray) -> None:
        """Evaluate the polynomials of all 14 columns at s; ``out`` has room for 14 numbers."""
else:
    products_2, products_16 = _cauchy(2), _cauchy(16)
    put_row = _put_row
    horner_14 = _horner(14)
