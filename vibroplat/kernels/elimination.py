"""Gaussian elimination of small systems whose rows lie in whole lanes, as vectors of the processor.

Two rows are subtracted from all others at a time, so each row is loaded and stored half as often.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from vibroplat.kernels.compiled import FloatArray, fused, inlined
from vibroplat.kernels.lanes import INDEX, Rows, loop, multiply_add, repeat
from vibroplat.kernels.linear import pivot_row

#: Numbers of a row that are reduced at once.
LANE = 16


@intrinsic
def _reduce(typing_context: Any, a: Any, first: Any, last: Any, one: Any, other: Any, column: Any, factors: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        rows = Rows(context, builder, signature.args[0], values[0], LANE)
        shares = Rows(context, builder, signature.args[6], values[6], 1)
        _, first, last, one, other, column, _ = values
        pivots = [rows.load(row, column) for row in (one, other)]

        def body(i: Any, totals: list[Any]) -> list[Any]:
            row = rows.load(i, column)
            for k, pivot in enumerate(pivots):
                factor = builder.fneg(shares.load_one(ir.Constant(INDEX, k), i))
                row = multiply_add(builder, repeat(builder, factor, rows.vector), pivot, row)
            rows.store(i, row, column)
            return totals

        loop(builder, first, last, 1, [], body)
        return context.get_dummy_value()

    places = (types.int64,) * 5
    return types.void(a, *places, factors), generate


@intrinsic
def _blend(
    typing_context: Any, out: Any, row: Any, column: Any, a: Any, b: Any, rows: Any, other: Any, begin: Any
) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        _, row, column, a, b, _, other, begin = values
        result, source = (Rows(context, builder, signature.args[i], values[i], LANE // 2) for i in (0, 5))
        a, b = (repeat(builder, share, source.vector) for share in (a, b))
        first = builder.fmul(a, source.load(other, ir.Constant(INDEX, 0)))
        result.store(row, multiply_add(builder, b, source.load(other, begin), first), column)
        return context.get_dummy_value()

    index, number = types.int64, types.float64
    return types.void(out, index, index, number, number, rows, index, index), generate


@intrinsic
def _combine(
    typing_context: Any, out: Any, row: Any, column: Any, weights: Any, rows: Any, last: Any, begin: Any
) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        _, row, column, _, _, last, begin = values
        result, source = (Rows(context, builder, signature.args[i], values[i], LANE) for i in (0, 4))
        shares, zero = Rows(context, builder, signature.args[3], values[3], 1), ir.Constant(INDEX, 0)

        def body(i: Any, totals: list[Any]) -> list[Any]:
            share = repeat(builder, shares.load_one(zero, i), source.vector)
            return [multiply_add(builder, share, source.load(i, begin), totals[0])]

        zeros = ir.Constant(source.vector, [0.0] * LANE)
        result.store(row, loop(builder, zero, last, 1, [zeros], body)[1], column)
        return context.get_dummy_value()

    index = types.int64
    return types.void(out, index, index, weights, rows, index, index), generate


if TYPE_CHECKING:

    def reduce(a: FloatArray, first: int, last: int, one: int, other: int, column: int, factors: FloatArray) -> None:
        """Subtract two rows from the rows ``first`` to ``last``, in a lane from a column on.

        Factors of both are in the columns of ``factors``, shape (2, rows of a).
        """

    def blend_8(
        out: FloatArray, row: int, column: int, a: float, b: float, rows: FloatArray, other: int, begin: int
    ) -> None:
        """Fill 8 numbers of a row with a times the first 8 of another and b times its 8 from column ``begin`` on."""

    def combine_16(
        out: FloatArray, row: int, column: int, weights: FloatArray, rows: FloatArray, last: int, begin: int
    ) -> None:
        """Fill a lane of a row with the weighted sum of the rows up to ``last``, from column ``begin`` on.

        The weights have the shape (1, last + 1 or more).
        """
else:
    reduce, blend_8, combine_16 = _reduce, _blend, _combine


@inlined
def whole_lanes(numbers: int) -> int:
    """Numbers of a row rounded up to whole lanes."""
    return -(-numbers // LANE) * LANE


@inlined
def exchange(matrix: FloatArray, one: int, other: int, first: int, end: int) -> None:
    """Exchange two rows in these columns."""
    if one != other:
        for j in range(first, end):
            matrix[one, j], matrix[other, j] = matrix[other, j], matrix[one, j]


@fused
def eliminate_lanes(matrix: FloatArray, m: int, right: int, end: int, factors: FloatArray) -> None:
    """Solve m linear equations for the right-hand sides in these columns, which become the solutions.

    Partial pivoting. Rows are reduced in whole lanes: what that leaves before the diagonal is never read. A singular
    matrix leaves solutions that are not finite.

    Parameters
    ----------
    matrix
        Its first m columns are the matrix; the right-hand sides are in columns ``right`` to ``end``, whole lanes.
    factors
        Room, shape (2, m or more).
    """
    for k in range(0, m - 1, 2):
        first = k // LANE * LANE
        exchange(matrix, k, pivot_row(matrix[:m], k), first, end)
        inverse = 1.0 / matrix[k, k]
        for i in range(k + 1, m):
            factors[0, i] = matrix[i, k] * inverse
            factors[1, i] = matrix[i, k + 1] - factors[0, i] * matrix[k, k + 1]
        best = k + 1
        for i in range(k + 2, m):
            if abs(factors[1, i]) > abs(factors[1, best]):
                best = i
        exchange(matrix, k + 1, best, first, end)
        exchange(factors.T, k + 1, best, 0, 2)
        inverse = 1.0 / factors[1, k + 1]
        factors[1, k + 1] = 0.0
        for i in range(k + 2, m):
            factors[1, i] *= inverse
        for j in range(first, end, LANE):
            reduce(matrix, k + 1, k + 1, k, k, j, factors)
            reduce(matrix, k + 2, m - 1, k, k + 1, j, factors)
    for k in range(m - 1, -1, -2):
        divide(matrix, k, right, end)
        if k == 0:
            break
        factors[0, k - 1], factors[1, k - 1] = matrix[k - 1, k], 0.0
        for i in range(k - 1):
            factors[0, i], factors[1, i] = matrix[i, k], matrix[i, k - 1]
        for j in range(right, end, LANE):
            reduce(matrix, k - 1, k - 1, k, k, j, factors)
        divide(matrix, k - 1, right, end)
        for j in range(right, end, LANE):
            reduce(matrix, 0, k - 2, k, k - 1, j, factors)


@inlined
def divide(matrix: FloatArray, k: int, right: int, end: int) -> None:
    """Divide the right-hand sides of a row by its diagonal."""
    inverse = 1.0 / matrix[k, k]
    for j in range(right, end):
        matrix[k, j] *= inverse
