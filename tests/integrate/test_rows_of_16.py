"""Loops over rows as vectors, against numpy."""

import numpy as np

from vibroplat.kernels import lines
from vibroplat.kernels.compiled import compiled
from vibroplat.kernels.rows_of_16 import horner_16, horner_pair_16
from vibroplat.kernels.sines import sincos_pair


@compiled
def evaluate(c, degree, s, out):
    horner_16(c, degree, s, out)


@compiled
def evaluate_pair(c, degree, s, following, out):
    horner_pair_16(c, degree, s, following, 0, out)


@compiled
def sines(x, y, out):
    for i in range(x.size):
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = sincos_pair(x[i], y[i])


def rows(count, width, seed=0):
    found = lines.in_lines((count, width))
    found[:] = np.random.default_rng(seed).normal(size=(count, width))
    return found


def test_values_of_polynomials():
    for degree in (1, 3, 17):
        c, powers = rows(degree + 1, 16), np.arange(degree + 1.0)[:, np.newaxis]
        one, two = np.empty((1, 16)), np.empty((2, 16))
        evaluate(c, degree, 0.3, one)
        evaluate_pair(c, degree, 0.3, 1.0, two)
        np.testing.assert_allclose(one[0], (c * 0.3**powers).sum(axis=0), atol=1e-13)
        np.testing.assert_allclose(two, [one[0], c.sum(axis=0)], atol=1e-13)


def test_sines_are_right_to_round_off():
    for largest in (1e-8, 1.0, 10.0, 1e3, 1e5):
        x, y = np.random.default_rng(1).uniform(-largest, largest, (2, 10_000))
        x[:9] = np.arange(-4, 5) * 0.25 * np.pi
        out = np.empty((10_000, 4))
        sines(x, y, out)
        np.testing.assert_allclose(out.T, [np.sin(x), np.cos(x), np.sin(y), np.cos(y)], atol=2.3e-16, rtol=0)
