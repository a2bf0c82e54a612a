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

_INDEX = ir.IntType(64)
_PLACE = ir.IntType(32)
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

    def _place(self, row: Any, column: Any, kind: Any) -> Any:
        b = self._builder
        address = b.add(self._base, b.mul(row, self._length))
        if column is not None:
            address = b.add(address, b.mul(column, ir.Constant(_INDEX, _BYTES)))
        return b.inttoptr(address, kind.as_pointer())

    def load(self, row: Any, column: Any = None) -> Any:
        return self._builder.load(self._place(row, column, self.vector), align=_BYTES)

    def store(self, row: Any, numbers: Any, column: Any = None) -> None:
        self._builder.store(numbers, self._place(row, column, numbers.type), align=_BYTES)


def _repeated(builder: Any, number: Any, vector: Any) -> Any:
    """Make a vector of one number."""
    single = builder.insert_element(ir.Constant(vector, ir.Undefined), number, ir.Constant(_PLACE, 0))
    first = ir.Constant(ir.VectorType(_PLACE, vector.count), [0] * vector.count)
    return builder.shuffle_vector(single, ir.Constant(vector, ir.Undefined), first)


def _elementwise(builder: Any, name: str, vector: Any) -> Any:
    """Return LLVM's function of that name for all numbers of a vector."""
    kind = ir.FunctionType(vector, [vector])
    return cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{vector.count}f64")


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
            loop, rest, odd, end = (builder.append_basic_block(name) for name in ("pairs", "rest", "odd", "end"))
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


def _horner(numbers: int, derivatives: int) -> Any:
    """Make the intrinsic for rows of so many numbers; ``out`` has one row more than derivatives."""

    @intrinsic
    def evaluate(typing_context: Any, c: Any, degree: Any, s: Any, out: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            rows, out_rows = (_Rows(context, builder, signature.args[i], values[i], numbers) for i in (0, 3))
            one, zero = ir.Constant(_INDEX, 1), ir.Constant(_INDEX, 0)
            share, none = _repeated(builder, values[2], rows.vector), ir.Constant(rows.vector, [0.0] * numbers)
            before = [rows.load(values[1]), *[none] * derivatives]
            entry, first = builder.block, builder.sub(values[1], one)
            loop, end = builder.append_basic_block("horner"), builder.append_basic_block("horner.end")
            builder.cbranch(builder.icmp_signed(">=", first, zero), loop, end)
            builder.position_at_end(loop)
            k, totals = builder.phi(_INDEX), [builder.phi(rows.vector) for _ in before]
            after = [
                builder.fadd(builder.fmul(total, share, flags=_FUSED), added, flags=_FUSED)
                for total, added in zip(totals, [rows.load(k), *totals], strict=False)
            ]
            following = builder.sub(k, one)
            builder.cbranch(builder.icmp_signed(">=", following, zero), loop, end)
            builder.position_at_end(end)
            for phi, begun, found in ((k, first, following), *zip(totals, before, after, strict=True)):
                phi.add_incoming(begun, entry)
                phi.add_incoming(found, loop)
            results = [builder.phi(rows.vector) for _ in before]
            factorial = 1.0
            for result, begun, found in zip(results, before, after, strict=True):
                result.add_incoming(begun, entry)
                result.add_incoming(found, loop)
            for i, result in enumerate(results):  # what nested products give is a derivative over its factorial
                factorial *= max(i, 1)
                times = ir.Constant(rows.vector, [factorial] * numbers)
                out_rows.store(ir.Constant(_INDEX, i), builder.fmul(result, times))
            return context.get_dummy_value()

        return types.void(c, types.int64, types.float64, out), generate

    return evaluate


@intrinsic
def _horner_pair(typing_context: Any, c: Any, degree: Any, s: Any, following: Any, out: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        rows, out_rows = (_Rows(context, builder, signature.args[i], values[i], 16) for i in (0, 4))
        one, zero = ir.Constant(_INDEX, 1), ir.Constant(_INDEX, 0)
        shares = [_repeated(builder, values[i], rows.vector) for i in (2, 3)]
        top, entry = rows.load(values[1]), builder.block
        loop, end = builder.append_basic_block("pair"), builder.append_basic_block("pair.end")
        first = builder.sub(values[1], one)
        builder.branch(loop)
        builder.position_at_end(loop)
        k, totals = builder.phi(_INDEX), [builder.phi(rows.vector) for _ in shares]
        row = rows.load(k)
        after = [
            builder.fadd(builder.fmul(total, share, flags=_FUSED), row, flags=_FUSED)
            for total, share in zip(totals, shares, strict=True)
        ]
        lower = builder.sub(k, one)
        for phi, begun, found in ((k, first, lower), *zip(totals, (top, top), after, strict=True)):
            phi.add_incoming(begun, entry)
            phi.add_incoming(found, loop)
        builder.cbranch(builder.icmp_signed(">=", lower, zero), loop, end)
        builder.position_at_end(end)
        for i, found in enumerate(after):
            out_rows.store(ir.Constant(_INDEX, i), found)
        return context.get_dummy_value()

    return types.void(c, types.int64, types.float64, types.float64, out), generate


@intrinsic
def _sizes(typing_context: Any, c: Any, first: Any, degree: Any, out: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        rows, out_rows = (_Rows(context, builder, signature.args[i], values[i], 16) for i in (0, 3))
        size = _elementwise(builder, "fabs", rows.vector)
        none, entry = ir.Constant(rows.vector, [0.0] * 16), builder.block
        loop, end = builder.append_basic_block("sizes"), builder.append_basic_block("sizes.end")
        builder.cbranch(builder.icmp_signed("<=", values[1], values[2]), loop, end)
        builder.position_at_end(loop)
        k, total = builder.phi(_INDEX), builder.phi(rows.vector)
        sums = builder.fadd(total, builder.call(size, [rows.load(k)]))
        following = builder.add(k, ir.Constant(_INDEX, 1))
        for phi, begun, found in ((k, values[1], following), (total, none, sums)):
            phi.add_incoming(begun, entry)
            phi.add_incoming(found, loop)
        builder.cbranch(builder.icmp_signed("<=", following, values[2]), loop, end)
        builder.position_at_end(end)
        result = builder.phi(rows.vector)
        result.add_incoming(none, entry)
        result.add_incoming(sums, loop)
        out_rows.store(ir.Constant(_INDEX, 0), result)
        return context.get_dummy_value()

    return types.void(c, types.int64, types.int64, out), generate


@intrinsic
def _reduce(typing_context: Any, a: Any, row: Any, other: Any, column: Any, factor: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        rows = _Rows(context, builder, signature.args[0], values[0], 16)
        _, row, other, column, factor = values
        product = builder.fmul(_repeated(builder, factor, rows.vector), rows.load(other, column), flags=_FUSED)
        rows.store(row, builder.fsub(rows.load(row, column), product, flags=_FUSED), column)
        return context.get_dummy_value()

    return types.void(a, types.int64, types.int64, types.int64, types.float64), generate


#: π/2 in three parts, the first ones with so many zeros at their ends that their products with a number of quarter
#: turns are exact, and coefficients of sine and cosine on [−π/4, π/4], highest first (Moshier, Cephes, 1989).
_QUARTER = (1.57079625129699707031, 7.54978941586159635335e-8, 5.39030285815811905290e-15)
_SINE = (
    1.58962301576546568060e-10,
    -2.50507477628578072866e-8,
    2.75573136213857245213e-6,
    -1.98412698295895385996e-4,
    8.33333333332211858878e-3,
    -1.66666666666666307295e-1,
)
_COSINE = (
    -1.13585365213876817300e-11,
    2.08757008419747316778e-9,
    -2.75573141792967388112e-7,
    2.48015872888517045348e-5,
    -1.38888888888730564116e-3,
    4.16666666666665929218e-2,
)


@intrinsic
def _sines(typing_context: Any, first: Any, second: Any) -> Any:
    four = ir.VectorType(ir.DoubleType(), 4)
    whole = ir.VectorType(_INDEX, 4)

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        def constant(number: float) -> Any:
            return ir.Constant(four, [number] * 4)

        def fused(a: Any, b: Any, c: Any) -> Any:
            return builder.fadd(builder.fmul(a, b, flags=_FUSED), c, flags=_FUSED)

        def polynomial(z: Any, coefficients: tuple[float, ...]) -> Any:
            total = constant(coefficients[0])
            for coefficient in coefficients[1:]:
                total = fused(total, z, constant(coefficient))
            return total

        x = ir.Constant(four, ir.Undefined)
        for i in range(4):
            x = builder.insert_element(x, values[i // 2], ir.Constant(_PLACE, i))
        rint = _elementwise(builder, "rint", four)
        quarters = builder.call(rint, [builder.fmul(x, constant(0.63661977236758134308))])
        r = x
        for part in _QUARTER:
            r = fused(quarters, constant(-part), r)
        z = builder.fmul(r, r)
        sine = fused(builder.fmul(r, z), polynomial(z, _SINE), r)
        cosine = fused(builder.fmul(z, z), polynomial(z, _COSINE), fused(z, constant(-0.5), constant(1.0)))
        # the cosine is the sine a quarter turn later
        turn = builder.add(builder.fptosi(quarters, whole), ir.Constant(whole, [0, 1, 0, 1]))
        none = ir.Constant(whole, [0] * 4)
        odd = builder.icmp_signed("!=", builder.and_(turn, ir.Constant(whole, [1] * 4)), none)
        below = builder.icmp_signed("!=", builder.and_(turn, ir.Constant(whole, [2] * 4)), none)
        found = builder.select(odd, cosine, sine)
        found = builder.select(below, builder.fmul(found, constant(-1.0)), found)
        numbers = [builder.extract_element(found, ir.Constant(_PLACE, i)) for i in range(4)]
        return context.make_tuple(builder, signature.return_type, numbers)

    return types.UniTuple(types.float64, 4)(types.float64, types.float64), generate


@intrinsic
def _put_step(typing_context: Any, q: Any, degree: Any, length: Any, n: Any, c: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        rows, out_rows = (_Rows(context, builder, signature.args[i], values[i], 8) for i in (0, 4))
        _, degree, length, n, _ = values
        one, zero = ir.Constant(_INDEX, 1), ir.Constant(_INDEX, 0)
        entry = builder.block
        loop, end = builder.append_basic_block("step"), builder.append_basic_block("step.end")
        unit, last = ir.Constant(ir.DoubleType(), 1.0), builder.add(n, n)
        builder.branch(loop)
        builder.position_at_end(loop)
        k, power = builder.phi(_INDEX), builder.phi(ir.DoubleType())
        following, scale = builder.add(k, one), _repeated(builder, power, rows.vector)
        order = _repeated(builder, builder.fmul(power, builder.sitofp(following, ir.DoubleType())), rows.vector)
        coordinates, rates = builder.fmul(rows.load(k), scale), builder.fmul(rows.load(following), order)
        out_rows.store(k, coordinates, zero)
        out_rows.store(k, rates, n)
        out_rows.store(k, builder.extract_element(coordinates, ir.Constant(_PLACE, 7)), last)
        next_power = builder.fmul(power, length)
        for phi, begun, found in ((k, zero, following), (power, unit, next_power)):
            phi.add_incoming(begun, entry)
            phi.add_incoming(found, loop)
        builder.cbranch(builder.icmp_signed("<=", following, degree), loop, end)
        builder.position_at_end(end)
        return context.get_dummy_value()

    return types.void(q, types.int64, types.float64, types.int64, c), generate


if TYPE_CHECKING:

    def put_row(a: FloatArray, row: int, numbers: tuple[float, ...]) -> None:
        """Store numbers at the beginning of a row."""

    def products_2(a: FloatArray, b: FloatArray, n: int, last: int, out: FloatArray) -> None:
        """Do as :func:`products_16` for rows of 2 numbers."""

    def products_16(a: FloatArray, b: FloatArray, n: int, last: int, out: FloatArray) -> None:
        """Fill, for each of the 16 numbers of rows, the sum of a[j] b[n − j] from j = 2 to ``last``."""

    def horner_16(c: FloatArray, degree: int, s: float, out: FloatArray) -> None:
        """Evaluate the polynomials of all 16 columns at s; ``out`` has room for 16 numbers."""

    def horner_pair_16(c: FloatArray, degree: int, s: float, following: float, out: FloatArray) -> None:
        """Do as :func:`horner_16` at two places in the time of one; degree above 0, ``out`` of shape (2, 16)."""

    def sizes_16(c: FloatArray, first: int, degree: int, out: FloatArray) -> None:
        """Sum up the sizes of all 16 columns over rows ``first`` to ``degree``."""

    def reduce_16(a: FloatArray, row: int, other: int, column: int, factor: float) -> None:
        """Subtract a multiple of another row from a row, in 16 columns from one on."""

    def sines(first: float, second: float) -> tuple[float, float, float, float]:
        """Sine and cosine of an angle, then of another, in the time of one of them; to round-off below 1e5 rad."""

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
    put_row, put_step, horner_pair_16, sizes_16 = _put_row, _put_step, _horner_pair, _sizes
    reduce_16, sines = _reduce, _sines
    horner_16, horner_8 = _horner(16, derivatives=0), _horner(8, derivatives=2)
