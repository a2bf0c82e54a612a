"""Polynomials and sums of all columns of an array at once: rows of 16 numbers, as lanes."""

from __future__ import annotations

from vibroplat.kernels.compiled import FloatArray, fused_inline
from vibroplat.kernels.lanes import load_4, load_16, size, store, zero


@fused_inline
def horner_16(c: FloatArray, degree: int, s: float, out: FloatArray) -> None:
    """Evaluate polynomials of 16 columns at s."""
    value = load_16(c, degree, 0)
    for k in range(degree - 1, -1, -1):
        value = value * s + load_16(c, k, 0)
    store(value, out, 0, 0)


@fused_inline
def horner_pair_16(c: FloatArray, degree: int, s: float, following: float, row: int, out: FloatArray) -> None:
    """Evaluate them at two places, in the time of one, into two rows of ``out``; degree above 0."""
    first = second = load_16(c, degree, 0)
    for k in range(degree - 1, -1, -1):
        addend = load_16(c, k, 0)
        first, second = first * s + addend, second * following + addend
    store(first, out, row, 0)
    store(second, out, row + 1, 0)


@fused_inline
def sizes_16(c: FloatArray, first: int, degree: int, out: FloatArray) -> None:
    """Sum up the sizes of all 16 columns over rows ``first`` to ``degree``."""
    total = zero(load_16(c, first, 0))
    for k in range(first, degree + 1):
        total += size(load_16(c, k, 0))
    store(total, out, 0, 0)


@fused_inline
def means_16(samples: FloatArray, weights: FloatArray, first: int, nodes: int, n: int, out: FloatArray) -> None:
    """Fill weighted sums of 16 columns over their rows from ``first`` on, of their squares and sizes: shape (4, 16).

    In the last row are those of the products of the first four columns with those from n on.
    """
    total = zero(load_16(samples, first, 0))
    squares, sizes, products = total, total, zero(load_4(samples, first, 0))
    for i in range(nodes):
        row, weight = load_16(samples, first + i, 0), weights[i]
        weighed = row * weight
        total, squares, sizes = total + weighed, squares + row * weighed, sizes + size(weighed)
        products += weight * load_4(samples, first + i, 0) * load_4(samples, first + i, n)
    store(total, out, 0, 0)
    store(squares, out, 1, 0)
    store(sizes, out, 2, 0)
    store(products, out, 3, 0)
