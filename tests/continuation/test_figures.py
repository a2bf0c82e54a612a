"""Figures of branches of orbits, from their tables alone, and of one orbit."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
from common import handmade
from matplotlib.figure import Figure
from matplotlib.text import Text

from vibroplat import orbit
from vibroplat.continuation.tables import BOUNDARIES, write_orbits
from vibroplat.continuation.test_functions import KINDS
from vibroplat.errors import TableError
from vibroplat.plots.orbits import MARKERS, draw_branch, plot_orbit, plot_orbits, read_branches
from vibroplat.results.tables import read_table, write_table

from .helpers import LIFTOFF, MASS


@pytest.fixture
def written(scene, found, tmp_path):
    """A result directory."""
    write_orbits(scene, found, {"branches": []}, tmp_path, "parquet")
    return tmp_path


def branch(stable, phases=None):
    """Points of a branch at whole frequencies."""
    count = len(stable)
    return pd.DataFrame(
        {
            "excitation_frequency_hz": np.arange(count, dtype=float),
            "rms_y_m": 1e-3 * np.arange(count),
            "phase_difference_rad": np.zeros(count) if phases is None else phases,
            "stable": stable,
        }
    )


def special(*places, kind="fold"):
    where = np.array(places, dtype=float)
    return pd.DataFrame({"kind": kind, "excitation_frequency_hz": where, "point": where.astype(int)})


def lines(points, marks, column="rms_y_m"):
    """Ends and styles of the lines of a branch, and its markers."""
    axis = draw_branch(Figure().add_subplot(), points, marks, column)
    drawn = [line for line in axis.lines if line.get_linestyle() != "None" and len(line.get_xdata()) > 1]
    ends = [(*line.get_xdata()[[0, -1]], line.get_linestyle()) for line in drawn]
    return ends, [line for line in axis.lines if len(line.get_xdata()) == 1]


def test_stable_parts_are_solid_and_end_at_the_special_point():
    ends, (mark,) = lines(branch([True, True, False, False, True]), special(1.25))
    assert ends == [(0.0, 1.25, "-"), (1.25, 4.0, "--")]  # no special point says where it is stable again
    assert mark.get_xdata().tolist() == [1.25]
    np.testing.assert_allclose(mark.get_ydata(), [1.25])  # mm
    assert mark.get_marker() == MARKERS["fold"]


def test_between_two_special_points_nothing_is_called_stable():
    ends, _ = lines(branch([True, True, True]), special(0.25, 0.75))
    assert ends == [(0.0, 0.25, "-"), (0.25, 0.75, "--"), (0.75, 2.0, "-")]


def test_phase_difference_breaks_at_the_end_of_its_axis():
    phases = np.array([-1.4, -1.5, -1.6, -1.7])
    ends, _ = lines(branch([True] * 4, phases), special(), "phase_difference_rad")
    assert ends == [(0.0, 1.0, "-"), (2.0, 3.0, "-")]


def test_each_kind_has_a_marker_of_its_own():
    assert len({MARKERS[kind] for kind in KINDS}) == len(KINDS)


def test_branches_over_excitation_frequency(written, found, figures):
    assert [path.name for path in plot_orbits(written)] == ["branches.png", "multipliers.png"]
    axes = figures["branches"].axes
    assert axes[0].get_ylabel() == "RMS $y$ (mm)"
    shown = np.concatenate([line.get_xdata() for line in axes[0].lines])
    assert shown.min() == pytest.approx(found.branches["excitation_frequency_hz"].min())
    legend = axes[-1].get_legend()  # five panels leave room for it
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts == [r"$\mu_w$ = 0", r"$\mu_w$ = 0.1", "stable", "liftoff: contact is lost for the first time"]


def test_supply_frequency_can_be_chosen(written, figures):
    plot_orbits(written, ["branches"], x="supply_frequency_hz")
    axis = figures["branches"].axes[0]
    assert [line.get_xdata()[0] for line in axis.lines if len(line.get_xdata()) == 1] == pytest.approx([LIFTOFF])


def test_points_of_a_sweep_lie_behind(written, figures):
    table = pd.DataFrame({"supply_frequency_hz": [47.0, 47.0], MASS: [0.0, 0.1], "direction": "up", "branch": [0, 1]})
    table["excitation_frequency_hz"], table["rms_y_m"] = 23.5, [1e-3, 2e-3]
    write_table(table, written, "sweep", "parquet")
    (written / "sweep-provenance.json").write_text(json.dumps({"schema": 1, "command": "sweep"}))
    plot_orbits(written, ["branches"])
    marks = [line for line in figures["branches"].axes[0].lines if line.get_marker() == "^" and line.get_zorder() < 2]
    assert sorted(float(line.get_ydata()[0]) for line in marks if len(line.get_xdata())) == [1.0, 2.0]
    texts = [text.get_text() for text in figures["branches"].axes[-1].get_legend().get_texts()]
    assert "sweep, up" in texts


def test_multipliers_lie_about_the_unit_circle(written, found, figures):
    plot_orbits(written, ["multipliers"])
    planes = [axis for axis in figures["multipliers"].axes if axis.get_xlabel() == "real part"]
    assert [axis.get_title(loc="left").split("\n")[-1] for axis in planes] == [r"$\mu_w$ = 0", r"$\mu_w$ = 0.1"]
    for axis, (_, rows) in zip(planes, found.branches.groupby(MASS), strict=True):
        drawn = np.concatenate([collection.get_offsets() for collection in axis.collections])
        assert len(drawn) == 2 * 4 * len(rows)  # with their conjugates
        np.testing.assert_allclose(np.sort_complex(drawn @ [1.0, 1j]), np.sort_complex(drawn @ [1.0, -1j]))
        circle = axis.lines[0]
        np.testing.assert_allclose(np.hypot(circle.get_xdata(), circle.get_ydata()), 1.0)


def test_boundaries_are_drawn_over_two_keys(tmp_path, figures):
    place = handmade.write_orbits(tmp_path / "followed")
    assert set(BOUNDARIES) <= set(read_table(place, "boundaries"))  # as the command writes them, with both sides
    plot_orbits(place, ["boundaries"])
    (axis,) = figures["boundaries"].axes
    assert [line.get_ydata()[-1] for line in axis.lines] == [0.3, 0.3]
    assert axis.get_ylabel() == r"mass ratio $\mu_w$"
    words = "".join(text.get_text() for text in figures["boundaries"].findobj(Text))
    assert "two layers" in words
    assert r"$\mu_w$ =" not in words  # it varies along the curves


def test_unfinished_branches_are_refused(tmp_path):
    (tmp_path / "orbits.sqlite").touch()
    with pytest.raises(TableError, match="holds unfinished branches; continue them with `vibroplat orbits --resume`"):
        read_branches(tmp_path)


def test_an_orbit_closes(scene):
    found = orbit(scene.replace({MASS: 0.1, "drive.supply_frequency_hz": 49.0}))
    first, second = plot_orbit(found, Figure().subplots(1, 2))
    speed, gap = first.lines[0].get_xydata(), second.lines[0].get_xydata()
    np.testing.assert_allclose(speed[0], speed[-1], atol=1e-5)
    assert gap[[0, -1], 0] == pytest.approx([0.0, 1.0], abs=1e-6)
    assert gap[:, 1].max() == pytest.approx(1e3 * found.measures["gap_max_m"], rel=1e-3)
    bare = orbit(scene.replace({MASS: 0.0}))
    assert plot_orbit(bare, Figure().subplots(1, 2))[1].texts[0].get_text() == "no material"


def test_an_orbit_and_branches_draw_themselves(scene, found):
    loaded = orbit(scene.replace({MASS: 0.1, "drive.supply_frequency_hz": 49.0}))
    assert [axis.get_xlabel() for axis in loaded.plot().axes] == ["$y$ (mm)", "phase of exciter 1 (turns)"]
    assert len(orbit(scene.replace({MASS: 0.0})).plot().axes) == 1
    axis = found.plot().axes[0]
    marks = [line.get_xdata()[0] for line in axis.lines if line.get_marker() == MARKERS["liftoff"]]
    assert marks == pytest.approx(found.special["excitation_frequency_hz"].tolist())
