"""Figures of a sweep, from its tables alone."""

from __future__ import annotations

import json
import shutil

import matplotlib.pyplot as plt
import numpy as np
import pytest
from common import commands
from common.results import unproven

from vibroplat.errors import TableError
from vibroplat.plots.regimes import PERIODS, SYNC
from vibroplat.plots.sweep import FIGURES, plot_sweep, read_response
from vibroplat.results.tables import read_table, write_table

from .helpers import CHAOTIC, MACHINE

MATERIAL = f"material: {{mass_ratio: 0.2, damping_ratio: {CHAOTIC['material.damping_ratio']}}}"
#: Sections ``sweep``: response of two masses, bifurcation of one, map over the mass.
SWEEPS = {
    "response": "supply_frequency_hz: {start: 44, stop: 50, step: 2, direction: [up, down]}\n"
    "  grid: {material.mass_ratio: [0.0, 0.2], contact.impact_law: [conservative]}",
    "bifurcation": "supply_frequency_hz: {start: 44, stop: 62, step: 6, direction: [up, down]}\n"
    "  kind: bifurcation\n  lyapunov: false",
    "map": "supply_frequency_hz: {start: 50, stop: 66, step: 4, direction: [up, down]}\n"
    "  grid: {material.mass_ratio: [0.0, 0.1, 0.2]}\n  kind: map\n  lyapunov: false",
}


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Result directories of a sweep of each kind, and of a run."""
    place = tmp_path_factory.mktemp("place")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        for name, text in SWEEPS.items():
            (place / f"{name}.yaml").write_text(
                f"extends: {MACHINE}\n{MATERIAL}\nsweep:\n  max_settle_s: 5\n  {text}\n"
            )
            assert commands.command("sweep", f"{name}.yaml").code == 0
        assert commands.command("run", "map.yaml", "--set", "name=run", "--set", "run.duration_s=0.1").code == 0
    return place / "results"


@pytest.fixture
def tables_of(written, tmp_path):
    """A copy of what a figure may use of a result: its tables and where they came from."""

    def copy(name):
        files = [f for f in (written / name).iterdir() if f.suffix in (".parquet", ".csv", ".json")]
        directory = tmp_path / name
        directory.mkdir()
        for file in files:
            shutil.copy(file, directory)
        return unproven(directory)

    return copy


@pytest.fixture
def drawn(tables_of):
    """Draw a figure of a sweep, to be looked at."""
    figures = []

    def draw(name, kind=None):
        directory = tables_of(name)
        figures.append(FIGURES[kind or name](read_response(directory)))
        return figures[-1], {t: read_table(directory, t) for t in ("sweep", "section", "impacts") if _has(directory, t)}

    yield draw
    for figure in figures:
        plt.close(figure)


def _has(directory, name):
    return any(directory.glob(f"{name}.*"))


# -- files ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "names"),
    [("response", ["response"]), ("bifurcation", ["response", "bifurcation"]), ("map", ["response", "map"])],
)
def test_plot_draws_all_that_the_tables_hold(name, names, tables_of, command, figures):
    directory = tables_of(name)
    done = command("plot", directory)
    assert (done.code, done.err) == (0, "")
    paths = [directory / f"{figure}.png" for figure in names]
    assert done.out.splitlines() == list(map(str, paths))
    assert [path.read_text() for path in paths] == [f"figure {figure}" for figure in names]
    assert plt.get_fignums() == []


def test_plot_writes_a_picture(tables_of, command):
    directory = tables_of("map")
    assert command("plot", directory, "--kind", "map").code == 0
    pixels = plt.imread(directory / "map.png")
    assert pixels.shape[1] > 800
    assert pixels[..., :3].min() < 0.3 < pixels[..., :3].max() == 1.0  # something dark on white


def test_plot_of_one_kind(tables_of, command, figures):
    directory = tables_of("map")
    done = command("plot", directory, "--kind", "map")
    assert (done.code, done.out, done.err) == (0, f"{directory / 'map'}.png\n", "")
    assert [path.name for path in directory.glob("*.png")] == ["map.png"]


def lines_of(figure):
    return [[str(point) for point in line.get_xydata().tolist()] for axis in figure.axes for line in axis.lines]


def curves(axis):
    """The lines of an axis, without their markers."""
    return [line for line in axis.lines if line.get_linestyle() != "None"]


def known(values):
    """Values without the gaps of a line."""
    values = np.asarray(values, dtype=float)
    return values[np.isfinite(values)]


def test_plot_reads_tables_of_either_format(tables_of, figures):
    directory, shown = tables_of("bifurcation"), []
    for form in ("parquet", "csv"):
        for name in ("sweep", "section", "impacts"):
            write_table(read_table(directory, name), directory, name, form)
        plot_sweep(directory, [])
        shown.append({name: lines_of(figure) for name, figure in figures.items()})
    assert shown[0].keys() == {"response", "bifurcation"}
    assert shown[0] == shown[1]


# -- what they show -------------------------------------------------------------------------------------


def test_response_has_a_curve_for_each_branch(drawn):
    figure, tables = drawn("response")
    table = tables["sweep"]
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
    axes = {axis.get_ylabel(): axis for axis in figure.axes}
    assert axes.keys() == quantities.keys()
    for label, (column, factor) in quantities.items():
        assert len(curves(axes[label])) == table["branch"].nunique() == 4
        for line, (_, rows) in zip(curves(axes[label]), table.groupby("branch"), strict=True):
            assert known(line.get_xdata()).tolist() == rows["excitation_frequency_hz"].tolist()
            if column is not None:
                assert known(line.get_ydata()) == pytest.approx(factor * rows[column].dropna().to_numpy())


def test_response_wraps_the_phase_so_that_antiphase_is_one_line(tables_of):
    """Told as π where it is near −π, it may wander on either side of it where the motion does not repeat."""
    directory = tables_of("response")
    table = read_table(directory, "sweep")
    assert set(table["sync"]) == {"antiphase"}
    assert (table["phase_difference_rad"] > 0.0).all()
    write_table(
        table.assign(phase_difference_rad=np.pi * (-0.999) ** np.arange(len(table))), directory, "sweep", "parquet"
    )
    figure = FIGURES["response"](read_response(directory))
    axis = next(axis for axis in figure.axes if axis.get_ylabel() == "$\\Delta\\varphi$")
    phases = known(np.concatenate([line.get_ydata() for line in axis.lines]))
    assert (phases > np.pi).any()
    assert phases == pytest.approx(np.full(len(phases), np.pi), abs=0.06)
    assert axis.get_ylim()[0] < 0.0 < np.pi < axis.get_ylim()[1]


def test_response_tells_directions_and_values_apart(drawn):
    figure, _ = drawn("response")
    lines, markers = curves(figure.axes[0]), [line for line in figure.axes[0].lines if line.get_linestyle() == "None"]
    colours = [line.get_color() for line in lines]
    assert colours[0] == colours[1] != colours[2] == colours[3]
    assert [line.get_linestyle() for line in lines] == ["-", "--", "-", "--"]
    assert [line.get_marker() for line in markers] == ["^", "v", "^", "v"]
    named = [text.get_text() for text in figure.legends[0].get_texts()]
    assert named == ["$\\mu_w$ = 0", "$\\mu_w$ = 0.2", "supply frequency up", "supply frequency down"]


def test_response_leaves_out_flight_where_nothing_flies(tables_of):
    directory = tables_of("response")
    table = read_table(directory, "sweep")
    write_table(table[table["material.mass_ratio"] == 0.0], directory, "sweep", "parquet")
    figure = FIGURES["response"](read_response(directory))
    assert [axis.get_ylabel() for axis in figure.axes][-2:] == ["$\\Delta\\varphi$", "motor power (W)"]


def test_bifurcation_shows_section_and_impacts_of_both_directions(drawn):
    figure, tables = drawn("bifurcation")
    assert len(figure.axes) == 4
    quantities = (("section", "y_m", 1e3), ("impacts", "impact_speed_m_per_s", 1.0))
    for row, (table, column, factor) in zip(np.reshape(figure.axes, (2, 2)), quantities, strict=True):
        for branch, axis in enumerate(row):
            behind, shown = axis.lines
            assert behind.get_color() != shown.get_color()
            assert behind.get_zorder() < shown.get_zorder()
            for line, number in ((behind, 1 - branch), (shown, branch)):
                rows = tables[table][tables[table]["branch"] == number]
                assert len(rows) > 100
                assert line.get_ydata() == pytest.approx(factor * rows[column].to_numpy())
                assert line.get_xdata() == pytest.approx(rows["excitation_frequency_hz"].to_numpy())


def test_map_colours_a_tile_for_each_point(drawn):
    figure, tables = drawn("map")
    table = tables["sweep"]
    ends = [1, 2, 4, 8, 64]
    assert len(figure.axes) == 7  # with the colour bar
    for row, direction in enumerate(("up", "down")):
        rows = table[table["direction"] == direction].sort_values(["material.mass_ratio", "supply_frequency_hz"])
        sync, periods, flight = (figure.axes[3 * row + k].collections[0].get_array().ravel() for k in range(3))
        assert sync.tolist() == [list(SYNC).index(name) for name in rows["sync"]]
        several = [next(i for i, end in enumerate(ends) if n <= end) for n in rows["period"] if n > 0]
        assert periods[rows["period"] > 0].tolist() == several
        assert {list(PERIODS)[int(i)] for i in periods[rows["period"] == 0]} <= {"not periodic"}
        assert np.ma.filled(flight) == pytest.approx(rows["flight_fraction"].to_numpy())
        titles = [figure.axes[3 * row + k].get_title(loc="left").splitlines()[-1] for k in range(3)]
        assert titles == [f"synchronization, {direction}", f"period (turns), {direction}", f"flight, {direction}"]
    assert len(set(table["sync"])) >= 2
    assert {0, 1} <= set(table["period"])


def test_map_hatches_failed_points(tables_of):
    directory = tables_of("map")
    table = read_table(directory, "sweep")
    table.loc[0, ["sync", "period", "flight_fraction"]] = [None, None, None]
    table.loc[0, "outcome"] = "event-storm"
    write_table(table, directory, "sweep", "parquet")
    figure = FIGURES["map"](read_response(directory))
    for axis in figure.axes[:3]:
        tiles, failed = axis.collections
        assert np.isnan(np.ma.filled(tiles.get_array().astype(float), np.nan)).sum() == 1
        assert failed.get_hatch()
        assert np.ma.count(failed.get_array()) == 1
    assert figure.axes[3].get_legend().get_texts()[-1].get_text() == "failed"


def test_map_has_tiles_of_equal_size_whatever_the_values(tables_of):
    directory = tables_of("map")
    table = read_table(directory, "sweep")
    key = "material.mass_ratio"
    write_table(table.assign(**{key: table[key].replace(0.2, 0.9)}), directory, "sweep", "parquet")
    figure = FIGURES["map"](read_response(directory))
    edges = figure.axes[0].collections[0].get_coordinates()[:, 0, 1]
    assert np.ma.filled(np.diff(edges)) == pytest.approx(np.ones(3))
    assert [text.get_text() for text in figure.axes[0].get_yticklabels()] == ["0", "0.1", "0.9"]


def test_figures_leave_out_points_that_failed(tables_of, figures):
    directory = tables_of("response")
    table = read_table(directory, "sweep")
    measures = table.columns[list(table.columns).index("branch") + 1 : list(table.columns).index("settle_s")]
    table[measures] = table[measures].mask(table["supply_frequency_hz"] > 45.0)
    write_table(table, directory, "sweep", "parquet")
    plot_sweep(directory, ["response"])
    good = table[table["supply_frequency_hz"] < 45.0].groupby("branch")["rms_y_m"]
    for line, (_, heights) in zip(curves(figures["response"].axes[0]), good, strict=True):
        assert known(line.get_ydata()) == pytest.approx(1e3 * heights.to_numpy())
    table[measures] = table[measures].mask(table["supply_frequency_hz"] > 0.0)
    write_table(table, directory, "sweep", "parquet")
    plot_sweep(directory, ["response"])
    assert not any(np.isfinite(line.get_ydata()).any() for line in figures["response"].axes[0].lines)


# -- refused --------------------------------------------------------------------------------------------


def refusal(directory, command, *options):
    """The line that answers ``plot``, without the directory's name."""
    done = command("plot", directory, *options)
    assert (done.code, done.out, len(done.err.splitlines())) == (2, "", 1)
    assert list(directory.glob("*.png")) == []
    return done.err.strip().replace(str(directory), "DIR").removeprefix("vibroplat: ")


def test_figure_of_a_run_is_refused_to_a_sweep(tables_of, command):
    line = "--kind force: DIR holds no run; allowed: response, bifurcation, map"
    assert refusal(tables_of("response"), command, "--kind", "force") == line


def test_figure_of_a_sweep_is_refused_to_a_run(tables_of, command):
    line = "--kind map: DIR holds no sweep; allowed: motion, force, exciters"
    assert refusal(tables_of("run"), command, "--kind", "motion", "--kind", "map") == line


def test_figures_without_their_tables_or_key_are_told_in_a_line(tables_of, command):
    line = refusal(tables_of("response"), command, "--kind", "bifurcation")
    assert line.startswith("DIR holds no section table; allowed: ")
    line = refusal(tables_of("bifurcation"), command, "--kind", "map")
    assert line.endswith("a map needs one grid key with several numbers")


@pytest.mark.parametrize(
    ("file", "line"),
    [
        ("sweep.parquet", "--kind response: DIR holds no sweep; allowed: motion, force, exciters"),
        ("provenance.json", "DIR holds no provenance.json"),
    ],
)
def test_plot_names_what_it_misses(file, line, tables_of, command):
    directory = tables_of("response")
    (directory / file).unlink()
    assert refusal(directory, command, "--kind", "response") == line


@pytest.mark.parametrize(("column", "kind"), [("rms_y_m", "response"), ("direction", "response"), ("sync", "map")])
def test_plot_names_the_column_it_misses(column, kind, tables_of):
    directory = tables_of("map")
    write_table(read_table(directory, "sweep").drop(columns=column), directory, "sweep", "parquet")
    with pytest.raises(TableError, match=column):
        plot_sweep(directory, [kind])


def test_plot_refuses_another_schema(tables_of, command):
    directory = tables_of("response")
    (directory / "provenance.json").write_text(json.dumps({"schema": 99}))
    assert refusal(directory, command) == "DIR holds results of schema 99; this version reads schema 1"


def test_plot_of_an_empty_table_is_refused(tables_of, command):
    directory = tables_of("response")
    write_table(read_table(directory, "sweep").iloc[:0], directory, "sweep", "parquet")
    assert refusal(directory, command) == "DIR holds an empty sweep table; there is nothing to plot"
