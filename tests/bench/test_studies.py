"""The cost of branches beside sweeps, and of basins."""

import pytest

from vibroplat.bench import studies

pytestmark = pytest.mark.long


def test_branches_are_as_exact_as_sweeps_that_settle_longest():
    narrow = {"sweep.grid": {"material.mass_ratio": [0.1]}, "sweep.supply_frequency_hz.stop": 45.0}
    table = studies.cost_of_orbits(1, narrow).set_index("what")
    assert list(table.index) == ["branches", *(f"sweep, settled to {t:g}" for t in (1e-3, 1e-7, 1e-9))]
    assert table["simulated_s"].iloc[1:].is_monotonic_increasing
    assert (table["times_point"] > 0.0).all()
    assert (table["error"] < [1e-8, 1e-2, 1e-6, 1e-8]).all()


@pytest.mark.usefixtures("kernels")
def test_engines_assign_starts_alike():
    table = studies.cost_of_basins(1, 4)
    assert list(table["engine"]) == ["taylor", "native"]
    assert list(table["unlike"]) == [0, 0]
    assert table["over_taylor"].iloc[0] == 1.0
