"""Newton's systems by their block structure against solutions of the full ones."""

import numpy as np
import pytest

from vibroplat.kernels.linear import condense, invert, solve_condensed
from vibroplat.model.equations import jacobian
from vibroplat.model.parameters import parameters

from .helpers import EACH_MACHINE, EACH_SYSTEM, random_states, scene_of, settled

#: c_j of the first step after a restart at 1e-10 and of the longest at 1e-4.
EACH_CJ = pytest.mark.parametrize("cj", [3e2, 1e5, 1e8])


def matrices(system, machine, cj, seed):
    """Return ∂F/∂y + c_j ∂F/∂y′ at consistent random states."""
    p = parameters(scene_of(system.layers, machine))
    for state in random_states(seed, count=8):
        y, yp, *_ = settled(system, state[system.places], p)
        full = np.empty((system.size, system.size))
        jacobian(system.index, 0.0, y, yp, cj, full, p)
        yield full


def sizes(size, cj):
    """Sizes of coordinates, rates and F_c that belong together."""
    n = size // 2
    return np.array([1.0] * n + [cj] * n + [cj * cj] * (size - 2 * n))


def scaled_error(found, expected, cj):
    """Largest error over the sizes of what belongs together."""
    scale = sizes(found.size, cj)
    return np.abs((found - expected) / scale).max() / np.abs(expected / scale).max()


@EACH_MACHINE
@EACH_SYSTEM
@EACH_CJ
def test_condensed_system_has_the_solution_of_the_full_one(system, machine, cj):
    rng = np.random.default_rng(3)
    m = system.size - system.size // 2
    for full in matrices(system, machine, cj, seed=4):
        dynamic, condensed = np.empty((m, m)), np.empty((m, system.size))
        assert condense(full, cj, dynamic, condensed)
        wanted = rng.normal(size=system.size) * sizes(system.size, cj)
        found = np.empty(system.size)
        solve_condensed(condensed, cj, full @ wanted, found)
        # backward error 1e-16 times the condition of the rotors' rows, some 1e3
        assert scaled_error(found, wanted, cj) < 1e-11


@pytest.mark.parametrize("size", range(1, 9))
def test_inverse(size):
    rng = np.random.default_rng(size)
    for _ in range(20):
        matrix = rng.normal(size=(size, size))
        matrix[rng.random((size, size)) < 0.3] = 0.0
        matrix += np.eye(size)[rng.permutation(size)] * 3.0  # pivots are off the diagonal
        found = matrix.copy()
        if np.linalg.cond(matrix) > 1e6:
            continue
        assert invert(found)
        np.testing.assert_allclose(found @ matrix, np.eye(size), atol=1e-9)


@pytest.mark.parametrize("spoil", [0.0, np.nan, np.inf], ids=["singular", "nan", "inf"])
def test_matrix_without_inverse_is_told(spoil):
    matrix = np.eye(3)
    matrix[1, 1] = spoil
    assert not invert(matrix)
