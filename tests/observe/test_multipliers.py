"""Order of the multipliers, and derivatives that have none."""

import numpy as np
import pytest

from vibroplat.shooting.multipliers import multipliers_of


def test_the_largest_is_first_and_of_a_pair_that_above_the_real_axis():
    turn = np.array([[0.0, -2.0], [2.0, 0.0]])
    section_map = np.block([[np.diag([0.5, -3.0]), np.zeros((2, 2))], [np.zeros((2, 2)), turn]])
    np.testing.assert_allclose(multipliers_of(section_map), [-3.0, 2.0j, -2.0j, 0.5], atol=1e-15)


def test_what_is_no_number_has_no_multipliers():
    with pytest.raises(np.linalg.LinAlgError):
        multipliers_of(np.full((4, 4), np.nan))
