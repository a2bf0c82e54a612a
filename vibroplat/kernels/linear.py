"""Newton's linear systems in compiled code; a singular matrix is an outcome here, not an exception.

They have a block that needs no elimination: half of their rows say that rates are the derivatives
of coordinates. What is left is inverted once for many solutions, which then are products of a matrix with a
vector: a third of the work of two triangular systems of full size. The small steps of shooting follow them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, inlined


@inlined
def pivot_row(matrix: FloatArray, k: int) -> int:
    """Row from k on with the largest entry in column k."""
    best = k
    for i in range(k + 1, matrix.shape[0]):
        if abs(matrix[i, k]) > abs(matrix[best, k]):
            best = i
    return best


@compiled
def invert(matrix: FloatArray) -> bool:
    """Replace a square matrix by its inverse (Gauss–Jordan, partial pivoting).

    Returns False where a pivot is 0 or not finite; what is not finite elsewhere goes on into the inverse.
    """
    n = matrix.shape[0]
    rows = np.empty(n, dtype=np.int64)
    for k in range(n):
        best = pivot_row(matrix, k)
        rows[k] = best
        pivot = matrix[best, k]
        if not 0.0 < abs(pivot) < np.inf:
            return False
        for j in range(n):
            swapped = matrix[best, j]
            matrix[best, j] = matrix[k, j]
            matrix[k, j] = swapped / pivot
        matrix[k, k] = 1.0 / pivot
        for i in range(n):
            factor = matrix[i, k]
            if i != k and factor != 0.0:
                matrix[i, k] = 0.0
                for j in range(n):
                    matrix[i, j] -= factor * matrix[k, j]
    for k in range(n - 1, -1, -1):  # exchanged rows of the matrix are exchanged columns of the inverse
        if rows[k] != k:
            for i in range(n):
                matrix[i, k], matrix[i, rows[k]] = matrix[i, rows[k]], matrix[i, k]
    return True


@compiled
def eliminate(matrix: FloatArray, right: FloatArray) -> float:
    """Solve a few linear equations (Gauss, partial pivoting); the matrix is overwritten, the right-hand side solved.

    Returns the determinant. Where a pivot is 0 or not a number, it is that, and there is no solution.
    """
    n, determinant = right.size, 1.0
    for k in range(n):
        best = pivot_row(matrix, k)
        if best != k:
            for j in range(k, n):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            right[k], right[best] = right[best], right[k]
            determinant = -determinant
        determinant *= matrix[k, k]
        if not abs(matrix[k, k]) > 0.0:
            return determinant
        for i in range(k + 1, n):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k + 1, n):
                matrix[i, j] -= factor * matrix[k, j]
            right[i] -= factor * right[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            right[k] -= matrix[k, j] * right[j]
        right[k] /= matrix[k, k]
    return determinant


@compiled
def bordered_determinant(matrix: FloatArray, border: FloatArray, solution: FloatArray) -> float:
    """Find the null vector of a matrix with one column more than rows whose product with a border is 1.

    Returns the determinant of the matrix with the border as its last row; where it is 0, there is no solution.
    """
    n = border.size
    bordered = np.empty((n, n))
    for j in range(n):
        for i in range(n - 1):
            bordered[i, j] = matrix[i, j]
        bordered[n - 1, j], solution[j] = border[j], 0.0
    solution[n - 1] = 1.0
    return eliminate(bordered, solution)


@compiled
def condense(jac: FloatArray, cj: float, dynamic: FloatArray, condensed: FloatArray) -> bool:
    """Prepare solutions of Newton's system of n coordinates q, their rates v, and F_c where it is unknown.

    Its first n rows are c_j δq − δv = r_q. With δq = (r_q + δv)/c_j the dynamic rows
    J_q δq + J_z δz = r_z of z = (v, F_c) become S δz = r_z − J_q r_q/c_j, S = J_z + J_q/c_j (added to the
    columns of v). ``jac`` is ∂F/∂y + c_j ∂F/∂y′; ``dynamic`` is room for S, shape (m, m), m = size − n.
    ``condensed``, shape (m, size), is filled with (−S⁻¹ J_q/c_j, S⁻¹), which maps (r_q, r_z) to δz. Returns what
    :func:`invert` says of S.
    """
    m, size = condensed.shape
    n = size - m
    for i in range(m):
        for j in range(m):
            dynamic[i, j] = jac[n + i, n + j]
        for j in range(n):
            dynamic[i, j] += jac[n + i, j] / cj
    if not invert(dynamic):
        return False
    for i in range(m):
        for j in range(n):
            condensed[i, j] = 0.0
        for j in range(m):
            condensed[i, n + j] = dynamic[i, j]
    for k in range(m):
        for j in range(n):
            factor = jac[n + k, j] / cj
            if factor != 0.0:  # most are 0
                for i in range(m):
                    condensed[i, j] -= dynamic[i, k] * factor
    return True


@compiled
def solve_condensed(condensed: FloatArray, cj: float, right: FloatArray, solution: FloatArray) -> None:
    """Solve a system that :func:`condense` has prepared."""
    m, size = condensed.shape
    n = size - m
    for i in range(m):
        total = 0.0
        for j in range(size):
            total += condensed[i, j] * right[j]
        solution[n + i] = total
    for i in range(n):
        solution[i] = (right[i] + solution[n + i]) / cj


@compiled
def take_scaled(derivative: FloatArray, places: Any, columns: Any, sizes: FloatArray, out: FloatArray) -> None:
    """Take some rows and columns of a derivative, times the sizes."""
    for i in range(places.size):
        for j in range(columns.size):
            out[i, j] = derivative[places[i], columns[j]] * sizes[i, j]


@compiled
def project_to_section(derivative: FloatArray, along: FloatArray, phase: int, out: FloatArray) -> None:
    """Project the derivative of an end along the motion to where the unknown ``phase`` stays, and leave that out."""
    for i in range(along.size):
        delay = along[i] / along[phase]
        for j in range(along.size):
            if phase not in (i, j):
                out[i - (i > phase), j - (j > phase)] = derivative[i, j] - delay * derivative[phase, j]


@compiled
def closing_residual(
    end: FloatArray, start: FloatArray, change: FloatArray, places: Any, scales: FloatArray, residual: FloatArray
) -> None:
    """Fill how far the end of a motion is from its start and a change, at some places in scales."""
    for i in range(places.size):
        residual[i] = (end[places[i]] - start[places[i]] - change[places[i]]) / scales[i]


@compiled
def largest_size(values: FloatArray) -> float:
    """Largest size of some values; inf if one of them is not a number."""
    maximum = 0.0
    for value in values:
        if not abs(value) <= maximum:
            maximum = abs(value) if abs(value) >= 0.0 else np.inf
    return maximum


@compiled
def broyden_update(jacobian: FloatArray, step: FloatArray, change: FloatArray) -> None:
    """Change a Jacobian as little as possible to fit the change of the residual over a step (Broyden 1965)."""
    square = 0.0
    for part in step:
        square += part * part
    for i in range(change.size):
        missing = change[i]
        for j in range(step.size):
            missing -= jacobian[i, j] * step[j]
        for j in range(step.size):
            jacobian[i, j] += missing * step[j] / square
