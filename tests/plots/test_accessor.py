"""``table.vibroplat.plot()`` of trajectories, sweeps and branches."""

import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from common import handmade

from vibroplat.errors import TableError


def shown(axis):
    """All points of the lines of an axis."""
    return np.concatenate([np.column_stack(line.get_data()) for line in axis.lines if len(line.get_xdata())])


def test_trajectory_is_a_motion_with_its_impacts(runs):
    run = runs["two layers"]
    figure = run.trajectory.vibroplat.plot()
    assert figure.axes[0].get_ylabel() == "$y$ (mm)"
    gap = next(axis for axis in reversed(figure.axes) if axis.get_ylabel() == "gap $y_{w1}$ (mm)")
    marks = np.concatenate([line.get_xdata() for line in gap.lines if line.get_marker() == "v"])
    first = shown(gap)[:, 0].min()
    struck = run.events[(run.events["kind"] == "impact") & (run.events["t_s"] >= first)]
    assert marks.tolist() == struck["t_s"].tolist()
    assert len(marks) > 0
    bare = runs["bare"].trajectory.vibroplat.plot()
    assert not any("gap" in axis.get_ylabel() for axis in bare.axes)


def test_sweep_is_a_response_over_either_frequency():
    table = handmade.sweep_table().assign(rms_phi_rad=1e-6)
    figure = table.vibroplat.plot()
    assert figure.axes[0].get_ylabel() == "RMS $y$ (mm)"
    low, high = (edge(table["excitation_frequency_hz"]) for edge in (min, max))
    assert low <= np.nanmin(shown(figure.axes[0])[:, 0]) <= np.nanmax(shown(figure.axes[0])[:, 0]) <= high
    over = table.vibroplat.plot("supply_frequency_hz").axes[0]
    assert np.nanmin(shown(over)[:, 0]) == 42.0


def test_branches_are_solid_and_dashed_over_their_key():
    table = handmade.branches()
    axis = table.vibroplat.plot().axes[0]
    assert {line.get_linestyle() for line in axis.lines} == {"-", "--"}
    np.testing.assert_allclose(shown(axis)[:, 1].max(), 2.0)  # mm
    over = table.rename(columns={"supply_frequency_hz": "material.mass_ratio"}).vibroplat.plot()
    assert {axis.get_xlabel() for axis in over.axes if axis.get_xlabel()} == {r"mass ratio $\mu_w$"}
    part = table[table["stable"]].vibroplat.plot().axes[0]
    assert {line.get_linestyle() for line in part.lines} == {"-"}


@pytest.mark.parametrize(
    ("table", "x", "told"),
    [
        (pd.DataFrame({"attractor": ["in-phase"]}), None, "those of basins, thresholds and designs are"),
        (handmade.branches(), "weight_kg", "x = 'weight_kg'; allowed: a column of the table"),
    ],
)
def test_what_cannot_be_drawn_is_refused(table, x, told):
    with pytest.raises(ValueError, match=told):
        table.vibroplat.plot(x)
    with pytest.raises(TableError, match="the table is empty"):
        handmade.branches().iloc[:0].vibroplat.plot()


@pytest.mark.long
def test_tables_that_pandas_reads_offer_it_too():
    """In whatever order pandas and the package are loaded; a room alone loads none, and no run loads matplotlib."""
    code = (
        "import sys; from vibroplat.motion.recorder import pd; assert 'pandas' not in sys.modules;"
        "from vibroplat import Scene, simulate; run = simulate(Scene().replace({'run.duration_s': 0.01}));"
        "repr(run); run.rows('unique'); assert 'matplotlib' not in sys.modules"
    )
    for loaded in (f"{code}; import pandas", "import pandas; from vibroplat import load"):
        subprocess.run([sys.executable, "-c", f"{loaded}; pandas.DataFrame.vibroplat"], check=True)
