"""Loops over the numbers of a row at once, as vectors of the processor.

A row is a line of a contiguous array. Numba leaves sums over the rows of an array in memory and does not see that the
numbers of a row may go side by side; here they stay in registers, which is several times faster. A row that was just
stored number by number cannot be loaded as a vector before all of it has left the processor, so rows are stored whole.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
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


def in_lines(shape: tuple[int, ...]) -> FloatArray:
    """Make an array of zeros that begins with a line of the processor's cache: its rows are loaded faster."""
    size = math.prod(shape)
    whole = np.zeros(size + LINE // _BYTES)
    first = -(whole.ctypes.data // _BYTES) % (LINE // _BYTES)
    return whole[first : first + size].reshape(shape)


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


def elementwise(builder: Any, name: str, vector: Any) -> Any:
    """Return LLVM's function of that name for all numbers of a vector."""
    kind = ir.FunctionType(vector, [vector])
    return cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{vector.count}f64")


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


def _horner(builder: Any, rows: Rows, degree: Any, places: list[Any], derivatives: int = 0) -> list[Any]:
    """Evaluate the polynomials at each place; what follows are their derivatives there, each over its factorial."""
    shares = [repeat(builder, place, rows.vector) for place in places]
    initial = [rows.load(degree), *[ir.Constant(rows.vector, [0.0] * rows.vector.count)] * derivatives]
    one, zero = ir.Constant(INDEX, 1), ir.Constant(INDEX, 0)

    def body(k: Any, totals: list[Any]) -> list[Any]:
        row, after = rows.load(k), []
        for i, share in enumerate(shares):
            mine = totals[i * len(initial) : (i + 1) * len(initial)]
            after += [multiply_add(builder, t, share, addend) for t, addend in zip(mine, [row, *mine], strict=False)]
        return after

    return loop(builder, builder.sub(degree, one), zero, -1, initial * len(shares), body)[1:]


def _horner_at_one(numbers: int, derivatives: int) -> Any:
    """Make the intrinsic for rows of so many numbers; ``out`` has one row more than derivatives."""

    @intrinsic
    def evaluate(typing_context: Any, c: Any, degree: Any, s: Any, out: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            rows, out_rows = (Rows(context, builder, signature.args[i], values[i], numbers) for i in (0, 3))
            for i, total in enumerate(_horner(builder, rows, values[1], [values[2]], derivatives)):
                times = ir.Constant(rows.vector, [float(math.factorial(i))] * numbers)
                out_rows.store(ir.Constant(INDEX, i), builder.fmul(total, times))
            return context.get_dummy_value()

        return types.void(c, types.int64, types.float64, out), generate

    return evaluate


@intrinsic
def _horner_pair(typing_context: Any, c: Any, degree: Any, s: Any, following: Any, out: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        rows, out_rows = (Rows(context, builder, signature.args[i], values[i], 16) for i in (0, 4))
        for i, total in enumerate(_horner(builder, rows, values[1], [values[2], values[3]])):
            out_rows.store(ir.Constant(INDEX, i), total)
        return context.get_dummy_value()

    return types.void(c, types.int64, types.float64, types.float64, out), generate


@intrinsic
def _sizes(typing_context: Any, c: Any, first: Any, degree: Any, out: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        rows, out_rows = (Rows(context, builder, signature.args[i], values[i], 16) for i in (0, 3))
        size = elementwise(builder, "fabs", rows.vector)
        _, total = loop(
            *(builder, values[1], values[2], 1, [ir.Constant(rows.vector, [0.0] * 16)]),
            lambda k, totals: [builder.fadd(totals[0], builder.call(size, [rows.load(k)]))],
        )
        out_rows.store(ir.Constant(INDEX, 0), total)
        return context.get_dummy_value()

    return types.void(c, types.int64, types.int64, out), generate


@intrinsic
def _means(typing_context: Any, samples: Any, weights: Any, nodes: Any, n: Any, out: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        rows, out_rows = (Rows(context, builder, signature.args[i], values[i], 16) for i in (0, 4))
        quarters, out_quarters = (Rows(context, builder, signature.args[i], values[i], 4) for i in (0, 4))
        shares = Rows(context, builder, signature.args[1], values[1], 1)
        size, zero = elementwise(builder, "fabs", rows.vector), ir.Constant(INDEX, 0)

        def body(i: Any, totals: list[Any]) -> list[Any]:
            row, single = rows.load(i), shares.load_one(zero, i)
            weight = repeat(builder, single, rows.vector)
            weighed = builder.fmul(row, weight)
            rates = builder.fmul(quarters.load(i, values[3]), repeat(builder, single, quarters.vector))
            parts = (row, weight), (row, weighed), (builder.call(size, [row]), weight), (quarters.load(i), rates)
            return [multiply_add(builder, *part, total) for part, total in zip(parts, totals, strict=True)]

        last = builder.sub(values[2], ir.Constant(INDEX, 1))
        zeros = [ir.Constant(rows.vector, [0.0] * 16)] * 3 + [ir.Constant(quarters.vector, [0.0] * 4)]
        totals = loop(builder, zero, last, 1, zeros, body)[1:]
        for i, total in enumerate(totals):
            (out_rows if i < len(totals) - 1 else out_quarters).store(ir.Constant(INDEX, i), total)
        return context.get_dummy_value()

    return types.void(samples, weights, types.int64, types.int64, out), generate


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

    def horner_16(c: FloatArray, degree: int, s: float, out: FloatArray) -> None:
        """Evaluate polynomials of 16 columns at s, with first derivatives: ``out`` has shape (2, 16)."""

    def horner_pair_16(c: FloatArray, degree: int, s: float, following: float, out: FloatArray) -> None:
        """Evaluate them at two places, in the time of one; degree above 0, ``out`` of shape (2, 16)."""

    def sizes_16(c: FloatArray, first: int, degree: int, out: FloatArray) -> None:
        """Sum up the sizes of all 16 columns over rows ``first`` to ``degree``."""

    def means_16(samples: FloatArray, weights: FloatArray, nodes: int, n: int, out: FloatArray) -> None:
        """Fill the weighted sums of 16 columns over their rows, of their squares and of their sizes: shape (4, 16).

        In the last row are those of the products of the first four columns with those from n on.
        """

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
    put_step, horner_pair_16, sizes_16, means_16 = _put_step, _horner_pair, _sizes, _means
    horner_16 = _horner_at_one(16, derivatives=1)
