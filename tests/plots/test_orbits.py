"""Figures of branches of orbits, from their tables alone, and of one orbit."""

import json

import numpy as np
import pandas as pd
import pytest
from common import handmade
from common.places import QUICKSTART, ROOT
from matplotlib.text import Text

from vibroplat import load_config, orbit
from vibroplat.columns import PHASE
from vibroplat.continuation.picture import MARKERS
from vibroplat.continuation.special_points import KINDS
from vibroplat.errors import TableError
from vibroplat.plots.command import draw_results
from vibroplat.results.files import SCHEMA
from vibroplat.results.result import Answer, Result
from vibroplat.results.tables import read_table, write_table

from . import conftest
from .conftest import data_of, texts

MASS = "material.mass_ratio"


@pytest.fixture(scope="module")
def scene(kernels):
    """A machine from below the supply frequency at which its material lifts off to above it."""
    step = {"first": 0.4, "max": 0.5}
    plan = {"key": "drive.supply_frequency_hz", "start": 47.0, "stop": 49.0, "step": step, "grid": {MASS: [0.0, 0.1]}}
    return load_config(ROOT / "tests/continuation/machine.yaml", {"solver.engine": "taylor", "orbits": plan})


def drawn(directory, kinds=(), **options):
    return conftest.drawn("orbits", directory, kinds=kinds, **options)


def branch(stable, phases=None):
    """Points of a branch at whole frequencies."""
    count = len(stable)
    return pd.DataFrame(
        {
            "supply_frequency_hz": 2.0 * np.arange(count),
            "branch": 0,
            "excitation_frequency_hz": np.arange(count, dtype=float),
            "rms_x_m": 0.0,
            "motor_power_w": 0.0,
            "multiplier_1_re": 0.0,
            "sequence": "",
            "rms_y_m": 1e-3 * np.arange(count),
            "phase_difference_rad": np.zeros(count) if phases is None else phases,
            "stable": stable,
        }
    )


def special(*places, kind="fold"):
    where = np.array(places, dtype=float)
    places = {"supply_frequency_hz": 2.0 * where, "excitation_frequency_hz": where, "point": where.astype(int)}
    return pd.DataFrame({"branch": 0, "kind": kind, **places}).astype({"kind": object})


def lines(points, marks, column="RMS $y$ (mm)"):
    """Ends and styles of the lines of a branch, and its markers."""
    scene = load_config(QUICKSTART, {"orbits": {"key": "drive.supply_frequency_hz", "start": 0.0, "stop": 4.0}})
    tables = {"branches": points, "special": marks}
    ((_, figure),) = draw_results([Result("orbits", scene, tables, Answer())], ["branches"])
    axis = next(axis for axis in figure.axes if axis.get_ylabel() == column)
    ends = []
    for line in (line for line in axis.lines if line.get_linestyle() != "None"):
        x, y = line.get_xdata(), line.get_ydata()
        parts = np.split(x, np.flatnonzero(np.isnan(x) | np.isnan(y)))
        known = [part[~np.isnan(part)] for part in parts]
        ends += [(part[0], part[-1], line.get_linestyle()) for part in known if len(part) > 1]
    ends.sort()
    return ends, [line for line in axis.lines if len(line.get_xdata()) == 1 and line.get_linestyle() == "None"]


def test_stable_parts_are_solid_and_end_at_the_special_point():
    ends, (mark,) = lines(branch([True, True, False, False, True]), special(1.25))
    assert ends == [(0.0, 1.25, "-"), (1.25, 4.0, "--")]  # no special point says where it is stable again
    assert mark.get_xdata().tolist() == [1.25]
    np.testing.assert_allclose(mark.get_ydata(), [1.25e-3])
    assert mark.get_marker() == MARKERS["fold"]
    assert len({MARKERS[kind] for kind in KINDS}) == len(KINDS)


def test_between_two_special_points_nothing_is_called_stable():
    ends, _ = lines(branch([True, True, True]), special(0.25, 0.75))
    assert ends == [(0.0, 0.25, "-"), (0.25, 0.75, "--"), (0.75, 2.0, "-")]


def test_phase_difference_breaks_at_the_end_of_its_axis():
    phases = np.array([-1.4, -1.5, -1.6, -1.7])
    ends, _ = lines(branch([True] * 4, phases), special(), PHASE)
    assert ends == [(0.0, 1.0, "-"), (2.0, 3.0, "-")]


def test_branches_are_drawn_over_the_excitation_frequency_or_that_of_the_supply(followed):
    figures = drawn(followed)
    assert [*figures] == ["branches", "multipliers", "boundaries"]
    table, axes = handmade.branches(), figures["branches"].axes
    assert axes[0].get_ylabel() == "RMS $y$ (mm)"
    shown = np.concatenate([line.get_xdata() for line in axes[0].lines])
    assert np.nanmin(shown) == pytest.approx(table["excitation_frequency_hz"].min())
    over = drawn(followed, ["branches"], x="supply")["branches"].axes[0]
    marks = [line.get_xdata()[0] for line in over.lines if len(line.get_xdata()) == 1]
    assert marks == pytest.approx(table["supply_frequency_hz"].iloc[[11, 30]].tolist())
    told = texts(figures["branches"].legends[0])
    assert told == ["stable", "unstable", "fold: two orbits merge and vanish", f"grazing: {KINDS['grazing']}"]


def test_points_of_a_sweep_lie_behind_in_the_colour_of_their_branch(followed):
    table = handmade.branches()
    both = pd.concat([table.assign(**{MASS: mass}) for mass in (0.0, 0.1)], ignore_index=True)
    marks = handmade.special(table).assign(**{MASS: 0.1})
    for name, rows in (("branches", both), ("special", marks)):
        write_table(rows[[MASS, *rows.columns.drop(MASS)]], followed, name, "parquet")
    (beside := followed / "sweep").mkdir()
    points = pd.DataFrame({"supply_frequency_hz": [52.0, 52.0], MASS: [0.0, 0.1], "direction": "up", "branch": [0, 1]})
    write_table(points.assign(excitation_frequency_hz=26.0, rms_y_m=[1e-3, 2e-3]), beside, "sweep", "parquet")
    (beside / "provenance.json").write_text(json.dumps({"schema": SCHEMA, "command": "sweep"}))
    figure = drawn(followed, ["branches"])["branches"]
    behind = [line for line in figure.axes[0].lines if line.get_zorder() < 2 and len(line.get_xdata())]
    points = {float(line.get_ydata()[0]): line.get_color() for line in behind if line.get_marker() == "o"}
    assert sorted(points) == [1e-3, 2e-3]
    assert points[1e-3] != points[2e-3]
    told = texts(figure.legends[0])
    assert told[:2] == ["mass ratio 0", "mass ratio 0.1"]
    assert {"stable", "unstable", "sweep, up"} <= {*told}


def test_multipliers_lie_about_the_unit_circle(followed):
    figure = drawn(followed, ["multipliers"])["multipliers"]
    plane, margin = figure.axes[:2]
    table = handmade.branches()
    shown = np.concatenate([collection.get_offsets() for collection in plane.collections])
    assert len(shown) == 2 * 2 * len(table)  # with their conjugates
    np.testing.assert_allclose(np.sort_complex(shown @ [1.0, 1j]), np.sort_complex(shown @ [1.0, -1j]))
    np.testing.assert_allclose(np.hypot(*data_of(plane.lines[0])), 1.0)
    assert plane.get_xlim() == pytest.approx((-1.05 * 1.3, 1.05 * 1.3))
    np.testing.assert_allclose(margin.lines[0].get_ydata(), 1.0 - table["multiplier_1_re"].abs())


def test_boundaries_are_drawn_over_two_keys(followed):
    figure = drawn(followed, ["boundaries"])["boundaries"]
    (axis,) = figure.axes
    assert [np.nanmax(line.get_ydata()) for line in axis.lines] == [0.3, 0.3]
    assert len({line.get_color() for line in axis.lines}) == 2
    assert axis.get_ylabel() == r"mass ratio $\mu_w$"
    words = "".join(text.get_text() for text in figure.findobj(Text))
    assert "two layers" in words
    assert r"$\mu_w$ =" not in words  # it varies along the curves
    table = read_table(followed, "boundaries")
    write_table(table.assign(n_unstable=(table["kind"] == "fold").astype("Int64")), followed, "boundaries", "parquet")
    figure = drawn(followed, ["boundaries"])["boundaries"]
    assert [line.get_linestyle() for line in figure.axes[0].lines] == [":", "-"]
    assert "thin: of unstable orbits" in [text.get_text() for text in figure.legends[0].get_texts()]


def test_what_is_missing_is_refused(followed, tmp_path):
    (tmp_path / "points.sqlite").touch()
    with pytest.raises(TableError, match="holds unfinished work; continue it by the same command with --resume"):
        drawn(tmp_path)
    (followed / "boundaries.parquet").unlink()
    with pytest.raises(TableError, match=r"holds no boundaries; add orbits.boundaries to its configuration"):
        drawn(followed, ["boundaries"])
    table = read_table(followed, "branches")
    proof = json.loads((followed / "provenance.json").read_text())
    proof["configuration"]["orbits"]["key"] = "contact.restitution"
    (followed / "provenance.json").write_text(json.dumps(proof))
    for name in ("branches", "special"):
        renamed = read_table(followed, name).rename(columns={"supply_frequency_hz": "contact.restitution"})
        write_table(renamed, followed, name, "parquet")
    with pytest.raises(TableError, match=r"--x supply: the branches table in .* has no column supply_frequency_hz"):
        drawn(followed, x="supply")
    write_table(table.drop(columns="stable"), followed, "branches", "parquet")
    with pytest.raises(TableError, match="has no"):
        drawn(followed)


def test_an_orbit_closes_and_draws_itself(scene):
    found = orbit(scene.replace({MASS: 0.1, "drive.supply_frequency_hz": 49.0}))
    first, second = found.plot().axes
    speed, gap = first.lines[0].get_xydata(), second.lines[0].get_xydata()
    np.testing.assert_allclose(speed[0], speed[-1], atol=1e-5)
    assert gap[[0, -1], 0] == pytest.approx([0.0, 1.0], abs=1e-6)
    assert gap[:, 1].max() == pytest.approx(found.measures["gap_max_m"], rel=1e-3)
    assert [axis.get_xlabel() for axis in (first, second)] == ["y from rest (mm)", "turns of exciter 1"]
    assert len(orbit(scene.replace({MASS: 0.0})).plot().axes) == 1
