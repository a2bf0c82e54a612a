"""Gaussian elimination of small systems whose rows lie in whole lanes, as vectors of the processor.

Two rows are subtracted from all others at a time, so each row is loaded and stored half as often.
"""

from __future__ import annotations

from vibroplat.kernels.compiled import FloatArray, fused, fused_inline, inlined
from vibroplat.kernels.lanes import load_8, load_16, store, zero
from vibroplat.kernels.linear import pivot_row

#: Numbers of a row that are reduced at once.
LANE = 16


@fused_inline
def reduce(a: FloatArray, first: int, last: int, one: int, other: int, column: int, factors: FloatArray) -> None:
    """Subtract two rows from the rows ``first`` to ``last``, in a lane from a column on.

    Factors of both are in the columns of ``factors``, shape (2, rows of a).
    """
    one_pivot, other_pivot = load_16(a, one, column), load_16(a, other, column)
    for i in range(first, last + 1):
        row = load_16(a, i, column) - factors[0, i] * one_pivot
        store(row - factors[1, i] * other_pivot, a, i, column)


@fused_inline
def blend_8(
    out: FloatArray, row: int, column: int, a: float, b: float, rows: FloatArray, other: int, begin: int
) -> None:
    """Fill 8 numbers of a row with a times the first 8 of another and b times its 8 from column ``begin`` on."""
    store(b * load_8(rows, other, begin) + a * load_8(rows, other, 0), out, row, column)


@fused_inline
def combine_16(
    out: FloatArray, row: int, column: int, weights: FloatArray, rows: FloatArray, last: int, begin: int
) -> None:
    """Fill a lane of a row with the weighted sum of the rows up to ``last``, from column ``begin`` on.

    The weights have the shape (1, last + 1 or more).
    """
    total = zero(load_16(rows, 0, begin))
    for i in range(last + 1):
        total = weights[0, i] * load_16(rows, i, begin) + total
    store(total, out, row, column)


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
