"""The cost of branches beside sweeps."""

import pytest

from vibroplat.bench.orbits import cost


@pytest.mark.long
def test_branches_are_cheaper_than_sweeps_and_as_exact():
    narrow = {"sweep.grid": {"material.mass_ratio": [0.1]}, "sweep.supply_frequency_hz.stop": 45.0}
    table = cost(1, narrow).set_index("what")
    assert list(table.index) == ["branches", *(f"sweep, settled to {t:g}" for t in (1e-3, 1e-7, 1e-9))]
    assert table["times_branches"].is_monotonic_increasing
    assert (table["error"] < [1e-8, 1e-2, 1e-6, 1e-8]).all()
