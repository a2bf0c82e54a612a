"""Figures of sweeps, from their tables alone."""

import json
from functools import partial

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from common.places import QUICKSTART
from common.results import unproven

from vibroplat import load_config
from vibroplat.errors import TableError
from vibroplat.hybrid.state import static_rest
from vibroplat.plots.command import plot_results
from vibroplat.plots.style import MOST_ENTRIES
from vibroplat.results.picture import SYNC
from vibroplat.results.tables import read_json, write_table
from vibroplat.study import picture
from vibroplat.study.picture import PERIODS

from .conftest import diagram, sweep_table, texts
from .conftest import drawn as drawn_of

MASS = "material.mass_ratio"
drawn = partial(drawn_of, "sweep")


def curves(axis):
    """The lines of an axis; markers alone are left out."""
    return [line for line in axis.lines if line.get_linestyle() != "None"]


def known(values):
    """Values without the gaps of a line."""
    values = np.asarray(values, dtype=float)
    return values[np.isfinite(values)]


def test_a_sweep_by_the_command_has_its_figures(command, kernels, here):
    frequencies = "{start: 44, stop: 62, step: 18, direction: up}"
    plan = f"{{supply_frequency_hz: {frequencies}, kind: bifurcation, lyapunov: false, measure_s: 1}}"
    done = command("sweep", QUICKSTART, "--set", f"sweep={plan}", "--set", "name=swept")
    assert (done.code, done.err) == (0, "")
    before = dict(mpl.rcParams)
    done = command("plot", "results/swept")
    paths = [f"results/swept/sweep/{figure}.png" for figure in ("response", "bifurcation")]
    assert (done.code, done.err, done.out.splitlines()) == (0, "", paths)
    pixels = plt.imread(paths[1])
    assert pixels.shape[1] > 800
    assert pixels[..., :3].min() < 0.3 < pixels[..., :3].max() == 1.0  # something dark on white
    assert dict(mpl.rcParams) == before
    assert plt.get_fignums() == []


# -- response -------------------------------------------------------------------------------------------


def test_response_has_a_curve_for_each_branch(write_sweep):
    table = sweep_table()
    quantities = {
        "RMS $y$ (mm)": ("rms_y_m", 1e3),
        "RMS $x$ (mm)": ("rms_x_m", 1e3),
        "RMS $\\varphi$ (mrad)": ("rms_phi_rad", 1e3),
        "$\\Delta\\varphi$": (None, 1.0),
        "motor power (W)": ("motor_power_w", 1.0),
        "largest $F_c$ (N)": ("contact_force_max_n", 1.0),
        "flight fraction": ("flight_fraction", 1.0),
        "largest gap (mm)": ("gap_max_m", 1e3),
    }
    figure = drawn(write_sweep())["response"]
    axes = {axis.get_ylabel(): axis for axis in figure.axes}
    assert axes.keys() == quantities.keys()
    for label, (column, factor) in quantities.items():
        lines = curves(axes[label])
        assert len(lines) == 4
        for line, (_, rows) in zip(lines, table.groupby("branch"), strict=True):
            seen = line.get_xdata()[np.isfinite(line.get_ydata())]
            assert known(seen).tolist() == known(rows["excitation_frequency_hz"]).tolist()
            if column is not None:
                assert known(line.get_ydata()) == pytest.approx(factor * known(rows[column]))
    lines, markers = curves(figure.axes[0]), [line for line in figure.axes[0].lines if line.get_marker() != "None"]
    colours = [line.get_color() for line in lines]
    assert colours[0] == colours[1] != colours[2] == colours[3]
    assert [line.get_linestyle() for line in lines] == ["-", "--", "-", "--"]
    full = [line.get_marker() for line in markers if line.get_fillstyle() == "full"]
    assert full == ["^", "v", "^", "x", "v", "x"]  # of each direction, and of points that failed
    named = texts(figure.legends[0])
    assert named[:4] == ["mass ratio 0", "mass ratio 0.2", "supply frequency up", "supply frequency down"]
    assert named[4:] == ["periodic", "not periodic", "failed"]


def test_what_all_quantities_along_a_branch_share_is_found_once(write_sweep, monkeypatch):
    """With many branches it took most of the time."""
    asked = []
    found = picture.find_jumps
    monkeypatch.setattr(picture, "find_jumps", lambda rows: asked.append(rows) or found(rows))
    axes = drawn(write_sweep())["response"].axes
    assert len(asked) == sweep_table()["branch"].nunique() < len(axes)


def test_legend_of_hundreds_of_curves_names_some_and_says_how_many_more(write_sweep):
    """All of them would cover the figure."""
    table, count = sweep_table(), 100
    branch = table[table["branch"] == 0]
    several = [branch.assign(**{MASS: 0.01 * (k // 10), "k": k % 10, "branch": k}) for k in range(count)]
    table = pd.concat([rows[["k", *table.columns]] for rows in several], ignore_index=True)
    figure = drawn(write_sweep(table))["response"]
    assert len(curves(figure.axes[0])) == count
    named = texts(figure.legends[0])
    assert [named[0], *named[MOST_ENTRIES - 1 : MOST_ENTRIES + 2]] == [
        *("k 0, mass ratio 0", "k 9, mass ratio 0.09"),
        f"and {count - MOST_ENTRIES} more between them",
        "supply frequency up",
    ]


def test_response_leaves_out_force_and_flight_where_there_is_none_and_is_over_either_frequency(write_sweep):
    table = sweep_table()
    axes = drawn(write_sweep(table[table[MASS] == 0.0]))["response"].axes
    assert "largest $F_c$ (N)" not in [axis.get_ylabel() for axis in axes]
    assert len(axes) == 5
    assert axes[-1].get_xlabel() == "excitation frequency $f$ (Hz)"
    axes = drawn(write_sweep(), x="supply")["response"].axes
    assert known(axes[0].lines[0].get_xdata()).tolist() == [*range(42, 50)]
    assert any(axis.get_xlabel() == "supply frequency $f_e$ (Hz)" for axis in axes)


def test_response_wraps_the_phase_so_that_antiphase_is_one_line(write_sweep):
    """Told as π where it is near −π, it may wander on either side of it where the motion does not repeat."""
    table = sweep_table()
    alternating = np.pi * (-0.999) ** np.arange(len(table))
    figure = drawn(write_sweep(table.assign(phase_difference_rad=alternating, sync="antiphase")))["response"]
    axis = next(axis for axis in figure.axes if axis.get_ylabel() == "$\\Delta\\varphi$")
    phases = known(np.concatenate([line.get_ydata() for line in curves(axis)]))
    assert (phases > np.pi).any()
    assert phases == pytest.approx(np.full(len(phases), np.pi), abs=0.1)
    assert axis.get_ylim()[0] < 0.0 < np.pi < axis.get_ylim()[1]


def test_many_values_of_a_key_follow_a_colour_scale(write_sweep):
    parts = [sweep_table().assign(**{MASS: 0.1 * n, "branch": n}).iloc[:8] for n in range(6)]
    figure = drawn(write_sweep(pd.concat(parts)))["response"]
    assert figure.axes[-1].get_ylabel() == r"mass ratio $\mu_w$"
    assert len({line.get_color() for line in curves(figure.axes[0])}) == 6


def test_sweeps_are_laid_over_each_other(write_sweep, figures):
    table = sweep_table().query("branch < 2")
    plain = write_sweep(table.drop(columns=MASS), name="plain")
    proof = read_json(plain, "provenance")
    proof["configuration"]["material"]["mass_ratio"] = 0.3
    (plain / "provenance.json").write_text(json.dumps(proof))
    (path,) = plot_results([write_sweep(table.assign(**{MASS: 0.1}), name="soft"), plain])
    assert (path.parent.name, path.name) == ("soft", "response-compared.png")
    assert texts(figures["response"].legends[0])[:2] == ["soft, mass ratio 0.1", "plain, mass ratio 0.3"]
    assert len(curves(figures["response"].axes[0])) == 4


# -- diagrams -------------------------------------------------------------------------------------------


def test_bifurcation_shows_every_point_with_the_other_direction_behind(write_sweep):
    table = sweep_table().query("branch < 2")
    tables = {"section": diagram(table, "y_m"), "impacts": diagram(table, "impact_speed_m_per_s")}
    figure = drawn(write_sweep(table, "bifurcation", **tables))["bifurcation"]
    rest = 1e3 * static_rest(load_config(QUICKSTART, {MASS: 0.0}))[1]
    quantities = [("section", "y_m", 1e3, rest), ("impacts", "impact_speed_m_per_s", 1.0, 0.0)]
    for row, (name, column, factor, zero) in zip(np.reshape(figure.axes, (2, 2)), quantities, strict=True):
        for branch, axis in enumerate(row):
            behind, shown = axis.lines
            assert behind.get_color() != shown.get_color()
            assert behind.get_zorder() < shown.get_zorder()
            for line, number in ((behind, 1 - branch), (shown, branch)):
                rows = tables[name][tables[name]["branch"] == number]
                assert line.get_ydata() == pytest.approx(factor * rows[column].to_numpy() - zero)
                assert line.get_xdata() == pytest.approx(rows["excitation_frequency_hz"].to_numpy())
    assert texts(figure.legends[0]) == ["supply frequency up", "supply frequency down", "the other direction"]


def test_map_colours_a_tile_for_each_point_and_hatches_failed_ones(write_sweep):
    table = sweep_table()
    figure = drawn(write_sweep(table, "map"))["map"]
    ends = [1, 2, 4, 8, 64]
    assert len(figure.axes) == 7  # with the colour bar
    for column, direction in enumerate(("up", "down")):
        own = figure.axes[column:6:2]
        rows = table[table["direction"] == direction].sort_values([MASS, "supply_frequency_hz"])
        good = (rows["outcome"] == "ok").to_numpy()
        tiles = [axis.collections[0].get_array().ravel() for axis in own]
        sync, periods, flight = (np.ma.filled(np.ma.asarray(values, dtype=float), np.nan) for values in tiles)
        assert sync[good].tolist() == [list(SYNC).index(name) for name in rows["sync"][good]]
        several = [next(i for i, end in enumerate(ends) if n <= end) for n in rows["period"] if n > 0]
        assert periods[rows["period"] > 0].tolist() == several
        assert {list(PERIODS)[int(i)] for i in periods[rows["period"] == 0]} == {"chaotic"}
        assert flight == pytest.approx(rows["flight_fraction"].to_numpy(dtype=float), nan_ok=True)
        titles = [axis.get_title(loc="left").splitlines()[-1] for axis in own]
        assert titles == [f"synchronization, {direction}", f"period (turns), {direction}", f"flight, {direction}"]
        for axis in own:
            assert np.isnan(np.ma.filled(axis.collections[0].get_array(), np.nan)).sum() == (~good).sum() == 1
            assert axis.collections[1].get_hatch()
            assert np.ma.count(axis.collections[1].get_array()) == 1
    named = ["antiphase: vibrates along y", "in-phase: vibrates along x and rocks"]
    assert texts(figure.legends[0])[:3] == ["failed", *named]


def test_map_has_tiles_of_equal_size_whatever_the_values(write_sweep):
    table = sweep_table()
    more = table.query("branch > 1").assign(**{MASS: 0.9, "branch": 4})
    axis = drawn(write_sweep(pd.concat([table, more]), "map"))["map"].axes[0]
    edges = axis.collections[0].get_coordinates()[:, 0, 1]
    assert np.ma.filled(np.diff(edges)) == pytest.approx(np.ones(3))
    assert [text.get_text() for text in axis.get_yticklabels()] == ["0", "0.2", "0.9"]


# -- refused --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "told"),
    [
        ("bifurcation", "DIR holds no section table; allowed: "),
        ("map", "DIR varies []; a map needs one grid key with several numbers"),
    ],
)
def test_a_figure_without_its_data_is_refused(kind, told, write_sweep):
    directory = write_sweep(sweep_table().query("branch < 2"))
    with pytest.raises(TableError) as caught:
        drawn(directory, kinds=[kind])
    assert str(caught.value).replace(str(directory), "DIR").startswith(told)


@pytest.mark.parametrize("column", ["supply_frequency_hz", "rms_y_m", "period", "direction", "sync"])
def test_the_column_that_is_missing_is_named(column, write_sweep):
    directory = unproven(write_sweep())
    write_table(sweep_table().drop(columns=column), directory, "sweep", "parquet")
    with pytest.raises(TableError, match=column):
        drawn(directory)


def test_a_table_may_hold_failed_points_only_but_not_none(write_sweep):
    table = sweep_table()
    with pytest.raises(TableError, match="holds an empty sweep table; there is nothing to plot"):
        drawn(write_sweep(table.iloc[:0]))
    measures = table.columns[list(table.columns).index("branch") + 1 :].difference(["outcome", "motion"])
    lost = table.assign(outcome="event-storm", **dict.fromkeys(measures, np.nan))
    axis = drawn(write_sweep(lost.astype({"sync": object})))["response"].axes[0]
    assert not any(np.isfinite(line.get_ydata()).any() for line in curves(axis))
    crosses = np.concatenate([line.get_xdata() for line in axis.lines if line.get_marker() == "x"])
    assert sorted(crosses) == sorted(table["supply_frequency_hz"])  # no excitation frequency is known


def test_the_only_value_of_a_grid_is_told_instead_of_that_of_the_configuration(write_sweep):
    table = sweep_table()
    (figure,) = drawn(write_sweep(table[table["material.mass_ratio"] == 0.0]), kinds=["response"]).values()
    assert figure.axes[0].get_title(loc="left") == "no material"
