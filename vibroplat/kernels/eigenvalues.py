"""Eigenvalues of small real matrices in compiled code: the QR algorithm with implicit double shifts.

The algorithm is that of LAPACK (Golub and Van Loan 2013, 7.4 and 7.5). For up to 13 equations numpy spends most of its
time on the call, not in LAPACK.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, inlined
from vibroplat.kernels.linear import largest_size

#: Steps that the last block of a matrix may take; shifts after which it takes an exceptional one.
MAX_STEPS, STALLED = 60, 10
#: Rows that a reflection of a step changes.
BULGE = 3
EPSILON = float(np.finfo(float).eps)


@compiled
def eigenvalues(matrix: FloatArray, found: Any) -> bool:
    """Find the eigenvalues of a matrix, which is overwritten; False if they are not found."""
    n = matrix.shape[0]
    room, negligible = np.empty(n), EPSILON**2 * largest_size(matrix.ravel())
    for k in range(n - 2):
        reflect(matrix, k + 1, n, k, 0, n, room)
    end, steps = n, 0
    while end > 0:
        begin = active_block(matrix, end, negligible)
        if end - begin > 2:
            steps += 1
            if not steps <= MAX_STEPS:
                return False
            step(matrix, begin, end, steps % STALLED == 0, room)
            continue
        if end - begin == 1:
            found[begin] = matrix[begin, begin]
        else:
            found[begin], found[end - 1] = eigenvalues_of_two(matrix, begin)
        end, steps = begin, 0
    return True


@inlined
def active_block(matrix: FloatArray, end: int, negligible: float) -> int:
    """First row of the last block that does not fall apart; what couples it to the rows before becomes 0."""
    for k in range(end - 1, 0, -1):
        size = abs(matrix[k - 1, k - 1]) + abs(matrix[k, k])
        if abs(matrix[k, k - 1]) <= max(EPSILON * size, negligible):
            matrix[k, k - 1] = 0.0
            return k
    return 0


@inlined
def eigenvalues_of_two(matrix: FloatArray, k: int) -> tuple[complex, complex]:
    """Eigenvalues of the two rows from one on, that above the real axis first."""
    half = 0.5 * (matrix[k, k] - matrix[k + 1, k + 1])
    square, middle = half * half + matrix[k, k + 1] * matrix[k + 1, k], matrix[k + 1, k + 1] + half
    root = math.sqrt(abs(square))
    if square < 0.0:
        return complex(middle, root), complex(middle, -root)
    return complex(middle + root, 0.0), complex(middle - root, 0.0)


@inlined
def step(matrix: FloatArray, begin: int, end: int, exceptional: bool, room: FloatArray) -> None:
    """Take a step with both eigenvalues of the last two rows as shifts, or with others where these lead nowhere."""
    a, last = matrix, end - 1
    total = a[last - 1, last - 1] + a[last, last]
    product = a[last - 1, last - 1] * a[last, last] - a[last - 1, last] * a[last, last - 1]
    if exceptional:
        size = abs(a[last, last - 1]) + abs(a[last - 1, last - 2])
        middle = a[last, last] + 0.75 * size
        total, product = 2.0 * middle, middle * middle + 0.4375 * size * size
    first, second = a[begin, begin], a[begin + 1, begin + 1]
    room[begin] = first * (first - total) + product + a[begin, begin + 1] * a[begin + 1, begin]
    room[begin + 1] = a[begin + 1, begin] * (first + second - total)
    room[begin + 2] = a[begin + 1, begin] * a[begin + 2, begin + 1]
    reflect(a, begin, begin + BULGE, -1, begin, end, room)
    for k in range(begin, end - 2):
        reflect(a, k + 1, min(k + 1 + BULGE, end), k, begin, end, room)


@inlined
def reflect(matrix: FloatArray, first: int, after: int, column: int, begin: int, end: int, room: FloatArray) -> None:
    """Reflect rows, and the same columns, of a block so that of a column of these rows only the first entry is left.

    Without a column, -1, it is that of the numbers in ``room``.
    """
    others = 0.0
    for i in range(first, after):
        if column >= 0:
            room[i] = matrix[i, column]
        others += room[i] * room[i] if i > first else 0.0
    if others == 0.0:
        return
    length = math.copysign(math.sqrt(room[first] * room[first] + others), room[first])
    room[first] += length
    scale = 1.0 / (length * room[first])
    for j in range(max(column, begin), end):
        part = 0.0
        for i in range(first, after):
            part += room[i] * matrix[i, j]
        for i in range(first, after):
            matrix[i, j] -= scale * part * room[i]
    for i in range(begin, min(after + 1, end)):
        part = 0.0
        for j in range(first, after):
            part += room[j] * matrix[i, j]
        for j in range(first, after):
            matrix[i, j] -= scale * part * room[j]
    if column >= 0:
        for i in range(first + 1, after):
            matrix[i, column] = 0.0
