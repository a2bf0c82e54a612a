"""Basins beside heyoka's ensemble, on a few starts."""

import pytest

from vibroplat.bench import basins


@pytest.mark.peers
@pytest.mark.usefixtures("kernels")
def test_long_transients_end_where_basins_say(monkeypatch):
    pytest.importorskip("heyoka")
    monkeypatch.setattr(basins, "TRANSIENTS", (1000,))
    table = basins.cost(1, 4)
    assert list(table["what"]) == ["basins", "heyoka, one by one", "heyoka, 4 in a vector"]
    assert list(table["unlike"]) == [0, 0, 0]
