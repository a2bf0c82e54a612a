"""Eigenvalues in compiled code, against the matrix itself and where they are known."""

import numpy as np
import pytest

from vibroplat.kernels.eigenvalues import eigenvalues


def make(kind, rng, n):
    matrix = rng.normal(size=(n, n))
    if kind == "rows of unlike sizes":
        return matrix * np.exp(3.0 * rng.normal(size=(n, 1)))
    if kind == "small integers":
        return rng.integers(-1, 2, (n, n)).astype(float)
    turn = np.linalg.qr(matrix)[0]
    return turn @ (np.eye(n) + np.eye(n, k=1)) @ turn.T if kind == "defective" else turn


@pytest.mark.parametrize("kind", ["rows of unlike sizes", "small integers", "defective", "orthogonal"])
def test_a_matrix_less_an_eigenvalue_is_singular_but_for_round_off(kind):
    rng = np.random.default_rng(1)
    for n in range(1, 14):
        for _ in range(5):
            matrix = make(kind, rng, n)
            size, values = max(np.linalg.norm(matrix, 2), 1.0), np.empty(n, complex)
            assert eigenvalues(matrix.copy(), values)
            left = [np.linalg.svd(matrix - value * np.eye(n))[1][-1] for value in values]
            assert max(left) < 2e-14 * size
            assert values.sum() == pytest.approx(np.trace(matrix), abs=1e-13 * size)


@pytest.mark.parametrize("n", [2, 3, 7])
def test_a_cycle_has_the_roots_of_one(n):
    values = np.empty(n, complex)
    assert eigenvalues(np.roll(np.eye(n), 1, 0), values)  # the usual shifts leave it as it is
    np.testing.assert_allclose(values**n, 1.0, atol=1e-13)
    assert abs(values.sum()) < 1e-13


def test_what_is_no_number_has_no_eigenvalues():
    assert not eigenvalues(np.full((4, 4), np.nan), np.empty(4, complex))
