"""Newton's systems by their block structure against solutions of the full ones."""

import numpy as np
import pytest

from vibroplat.kernels.linear import condense, eliminate, invert, solve_condensed
from vibroplat.model.equations import jacobian

from .helpers import EACH_SYSTEM, RECORDS, random_states, record_of, settled


@EACH_SYSTEM
def test_condensed_system_has_the_solution_of_the_full_one(system):
    """c_j is that of the first step after a restart at 1e-10, of the longest at 1e-4, and one between."""
    rng, n = np.random.default_rng(3), system.size // 2
    m, p = system.size - n, record_of(system.layers, RECORDS[system.index])
    full, found = np.empty((system.size, system.size)), np.empty(system.size)
    for state in random_states(seed=4, count=8):
        y, yp, *_ = settled(system, state[system.places], p)
        for cj in (3e2, 1e5, 1e8):
            jacobian(system.index, 0.0, y, yp, cj, full, p)
            dynamic, condensed = np.empty((m, m)), np.empty((m, system.size))
            assert condense(full, cj, dynamic, condensed)
            sizes = np.array([1.0] * n + [cj] * n + [cj * cj] * (m - n))
            wanted = rng.normal(size=system.size) * sizes
            solve_condensed(condensed, cj, full @ wanted, found)
            # backward error 1e-16 times the condition of the rotors' rows, some 1e3
            assert np.abs((found - wanted) / sizes).max() < 1e-11 * np.abs(wanted / sizes).max()


def test_solution_and_determinant():
    rng = np.random.default_rng(2)
    for size in [*range(1, 16)] * 5:
        matrix = rng.normal(size=(size, size)) + 3.0 * np.eye(size)[rng.permutation(size)]
        wanted = rng.normal(size=size)
        found = matrix @ wanted
        assert eliminate(matrix.copy(), found) == pytest.approx(np.linalg.det(matrix), rel=1e-9)
        np.testing.assert_allclose(found, wanted, atol=1e-9)
    matrix[:, 0] = 0.0
    assert eliminate(matrix.copy(), found) == 0.0
    matrix[0, 0] = np.nan
    assert np.isnan(eliminate(matrix, found))


def test_inverse():
    rng = np.random.default_rng(1)
    for size in [*range(1, 9)] * 20:
        matrix = rng.normal(size=(size, size))
        matrix[rng.random((size, size)) < 0.3] = 0.0
        matrix += np.eye(size)[rng.permutation(size)] * 3.0  # pivots are off the diagonal
        if np.linalg.cond(matrix) < 1e6:
            found = matrix.copy()
            assert invert(found)
            np.testing.assert_allclose(found @ matrix, np.eye(size), atol=1e-9)


@pytest.mark.parametrize("spoil", [0.0, np.nan, np.inf], ids=["singular", "nan", "inf"])
def test_matrix_without_inverse_is_told(spoil):
    assert not invert(np.diag([1.0, spoil, 1.0]))
