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
from vibroplat.kernels.pairs import PAIR, Pair, pair_of

INDEX = ir.IntType(64)
PLACE = ir.IntType(32)
#: A product may be added to a sum without being rounded in between.
_FUSED = ("contract",)
_BYTES = 8


_LINE = 64  # bytes of a line of the processor's cache


def in_lines(shape: tuple[int, ...]) -> FloatArray:
    """Make an array of zeros that begins with a line of the processor's cache: its rows are loaded faster."""
    size = math.prod(shape)
    whole = np.zeros(size + _LINE // _BYTES)
    first = -(whole.ctypes.data // _BYTES) % (_LINE // _BYTES)
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
    builder.cbranch(builder.icmp_signed(order, after[0], last), loop, end)
    builder.position_at_end(end)
    results = [builder.phi(number.type) for number in before]
    for phi, result, number, next_number in zip(phis, results, before, after, strict=True):
        for merged in (phi, result):
            merged.add_incoming(number, entry)
            merged.add_incoming(next_number, loop)
    return results


def multiply_add(builder: Any, a: Any, b: Any, c: Any) -> Any:
    """Return a b + c."""
    return builder.fadd(builder.fmul(a, b, flags=_FUSED), c, flags=_FUSED)


def _cauchy(numbers: int) -> Any:
    """Make the intrinsic for rows of so many numbers."""

    @intrinsic
    def products(typing_context: Any, a: Any, b: Any, n: Any, last: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            first_rows, second_rows = (Rows(context, builder, signature.args[i], values[i], numbers) for i in (0, 1))
            n, last = values[2], values[3]
            one, two = ir.Constant(INDEX, 1), ir.Constant(INDEX, 2)
            zero = ir.Constant(first_rows.vector, [0.0] * numbers)

            def add_product(total: Any, j: Any) -> Any:
                return multiply_add(builder, first_rows.load(j), second_rows.load(builder.sub(n, j)), total)

            # two sums side by side: an addition need not wait for the one before
            j, even, odd = loop(
                *(builder, two, builder.sub(last, one), 2, [zero, zero]),
                lambda j, sums: (add_product(sums[0], j), add_product(sums[1], builder.add(j, one))),
            )
            total, before = builder.fadd(even, odd, flags=_FUSED), builder.block
            with builder.if_then(builder.icmp_signed("==", j, last)):
                whole, within = add_product(total, j), builder.block
            vector = builder.phi(total.type)
            vector.add_incoming(total, before)
            vector.add_incoming(whole, within)
            sums = [builder.extract_element(vector, ir.Constant(PLACE, i)) for i in range(numbers)]
            pairs = [pair_of(builder, *sums[i : i + 2]) for i in range(0, numbers, 2)]
            return context.make_tuple(builder, signature.return_type, pairs)

        return types.UniTuple(PAIR, numbers // 2)(a, b, types.int64, types.int64), generate

    return products


@intrinsic
def _put_row(typing_context: Any, a: Any, row: Any, numbers: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        single: list[Any] = []
        for kind, part in zip(signature.args[2], cgutils.unpack_tuple(builder, values[2]), strict=True):
            places = range(2) if kind == PAIR else ()
            single += [builder.extract_element(part, ir.Constant(PLACE, i)) for i in places] or [part]
        rows = Rows(context, builder, signature.args[0], values[0], len(single))
        vector = ir.Constant(rows.vector, ir.Undefined)
        for i, number in enumerate(single):
            vector = builder.insert_element(vector, number, ir.Constant(PLACE, i))
        rows.store(values[1], vector)
        return context.get_dummy_value()

    return types.void(a, types.int64, numbers), generate


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
def _put_step(typing_context: Any, q: Any, degree: Any, length: Any, n: Any, c: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        rows, out_rows = (Rows(context, builder, signature.args[i], values[i], 8) for i in (0, 4))
        _, degree, length, n, _ = values
        one, zero = ir.Constant(INDEX, 1), ir.Constant(INDEX, 0)
        last = builder.add(n, n)

        def body(k: Any, powers: list[Any]) -> list[Any]:
            following, scale = builder.add(k, one), repeat(builder, powers[0], rows.vector)
            order = repeat(builder, builder.fmul(powers[0], builder.sitofp(following, ir.DoubleType())), rows.vector)
            coordinates, rates = builder.fmul(rows.load(k), scale), builder.fmul(rows.load(following), order)
            out_rows.store(k, coordinates, zero)
            out_rows.store(k, rates, n)
            out_rows.store(k, builder.extract_element(coordinates, ir.Constant(PLACE, 7)), last)
            return [builder.fmul(powers[0], length)]

        loop(builder, zero, degree, 1, [ir.Constant(ir.DoubleType(), 1.0)], body)
        return context.get_dummy_value()

    return types.void(q, types.int64, types.float64, types.int64, c), generate


if TYPE_CHECKING:

    def put_row(a: FloatArray, row: int, numbers: tuple[float, ...]) -> None:
        """Store numbers and pairs at the beginning of a row."""

    def products_2(a: FloatArray, b: FloatArray, n: int, last: int) -> tuple[Pair]:
        """Do as :func:`products_16` for rows of 2 numbers."""

    def products_16(a: FloatArray, b: FloatArray, n: int, last: int) -> tuple[Pair, ...]:
        """Return, for each of the 16 numbers of rows, the sum of a[j] b[n − j] from j = 2 to ``last``, as pairs."""

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

    def horner_8(c: FloatArray, degree: int, s: float, out: FloatArray) -> None:
        """Evaluate polynomials of 8 columns at s, with first and second derivatives: ``out`` has shape (3, 8)."""

    def put_step(q: FloatArray, degree: int, length: float, n: int, c: FloatArray) -> None:
        """Write series in powers of time as a step's polynomials in its fraction: coordinates, rates, F_c.

        Parameters
        ----------
        q
            Coefficients, shape (degree + 2 or more, 8): n coordinates, then 0 up to column 7, F_c. The row after the
            last is 0.
        length
            Duration of the step (s).
        c
            Filled, shape (degree + 1, 16): coordinates, their rates from column n on, F_c in column 2n, then numbers of
            no meaning.
        """
else:
    products_2, products_16 = _cauchy(2), _cauchy(16)
    put_row, put_step, horner_pair_16, sizes_16, means_16 = _put_row, _put_step, _horner_pair, _sizes, _means
    horner_16, horner_8 = _horner_at_one(16, derivatives=1), _horner_at_one(8, derivatives=2)
