"""Loops over rows as vectors, against numpy."""

from itertools import product

import numpy as np
import pytest

from vibroplat.kernels import lanes
from vibroplat.kernels.compiled import compiled
from vibroplat.kernels.pairs import pack_pair, unpack_pair
from vibroplat.kernels.sines import sincos_pair


@compiled
def products(a, b, n, last, out):
    for i, pair in enumerate(lanes.products_16(a, b, n, last)):
        out[2 * i], out[2 * i + 1] = unpack_pair(pair)


@compiled
def products_of_two(a, b, n, last, out):
    out[0], out[1] = unpack_pair(lanes.products_2(a, b, n, last)[0])


@compiled
def evaluate(c, degree, s, out):
    lanes.horner_16(c, degree, s, out)


@compiled
def evaluate_pair(c, degree, s, following, out):
    lanes.horner_pair_16(c, degree, s, following, out)


@compiled
def differentiate(c, degree, s, out):
    lanes.horner_8(c, degree, s, out)


@compiled
def sines(x, y, out):
    for i in range(x.size):
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = sincos_pair(x[i], y[i])


@compiled
def compute(a, b, out):
    both = pack_pair(a[0], a[1])
    out[0] = unpack_pair(2.0 * both - both * pack_pair(b[0], b[1]) + both * 0.25)
    out[1] = unpack_pair(1.0 - both - 3.0)


def rows(count, width, seed=0):
    found = lanes.in_lines((count, width))
    found[:] = np.random.default_rng(seed).normal(size=(count, width))
    return found


def test_products():
    for n, short, (width, kernel) in product((0, 1, 2, 3, 4, 9, 20), (0, 1), ((16, products), (2, products_of_two))):
        a, b, out = rows(24, width), rows(24, width, 1), np.full(width, np.nan)
        kernel(a, b, n, n - short, out)
        expected = sum((a[j] * b[n - j] for j in range(2, n - short + 1)), np.zeros(width))
        np.testing.assert_allclose(out, expected, rtol=1e-14, atol=1e-13)


@pytest.mark.long
def test_pairs_compute_as_numbers_do():
    a, b, out = *rows(2, 2), np.empty((2, 2))
    compute(a, b, out)
    np.testing.assert_allclose(out, [2.0 * a - a * b + 0.25 * a, -2.0 - a], rtol=1e-14)


def test_values_of_polynomials():
    for degree in (1, 3, 17):
        c, powers = rows(degree + 1, 16), np.arange(degree + 1.0)[:, np.newaxis]
        one, two = np.empty((2, 16)), np.empty((2, 16))
        evaluate(c, degree, 0.3, one)
        evaluate_pair(c, degree, 0.3, 1.0, two)
        np.testing.assert_allclose(one[0], (c * 0.3**powers).sum(axis=0), atol=1e-13)
        np.testing.assert_allclose(one[1], (powers * c * 0.3 ** (powers - 1.0)).sum(axis=0), atol=1e-13)
        np.testing.assert_allclose(two, [one[0], c.sum(axis=0)], atol=1e-13)


def test_derivatives_of_polynomials():
    c, k, out = rows(18, 8), np.arange(18.0)[:, np.newaxis], np.empty((3, 8))
    differentiate(c, 17, 0.4, out)
    terms = (c * 0.4**k, k * c * 0.4 ** (k - 1.0), k * (k - 1.0) * c * 0.4 ** (k - 2.0))
    np.testing.assert_allclose(out, [of.sum(axis=0) for of in terms], atol=1e-12)


def test_sines_are_right_to_round_off():
    for largest in (1e-8, 1.0, 10.0, 1e3, 1e5):
        x, y = np.random.default_rng(1).uniform(-largest, largest, (2, 10_000))
        x[:9] = np.arange(-4, 5) * 0.25 * np.pi
        out = np.empty((10_000, 4))
        sines(x, y, out)
        np.testing.assert_allclose(out.T, [np.sin(x), np.cos(x), np.sin(y), np.cos(y)], atol=2.3e-16, rtol=0)


def test_arrays_begin_with_a_line_of_the_cache():
    for shape in ((3,), (5, 7), (2, 3, 16)):
        array = lanes.in_lines(shape)
        assert array.shape == shape
        assert not array.any()
        assert array.ctypes.data % 64 == 0
        assert array.flags.c_contiguous
