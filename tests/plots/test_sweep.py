"""Figures of sweeps, from their tables alone."""

from functools import partial

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from common import handmade
from common.places import QUICKSTART
from common.results import edited, unproven

from vibroplat import load_config
from vibroplat.columns import PHASE
from vibroplat.errors import TableError
from vibroplat.hybrid.state import static_rest
from vibroplat.plots.command import plot_results
from vibroplat.results.legend import MOST_ENTRIES
from vibroplat.results.picture import SYNC
from vibroplat.results.tables import write_table

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
    plan = f"{{supply_frequency_hz: {frequencies}, kind: bifurcation, lyapunov: false, measure_s: 0.2, "
    plan += "max_settle_s: 2}"
    done = command("sweep", QUICKSTART, "--set", f"sweep={plan}", "--set", "name=swept")
    assert (done.code, done.err) == (0, "")
    before, open_figures = dict(mpl.rcParams), plt.get_fignums()
    done = command("plot", "results/swept")
    paths = [f"results/swept/sweep/{figure}.png" for figure in ("response", "bifurcation")]
    assert (done.code, done.err, done.out.splitlines()) == (0, "", paths)
    pixels = plt.imread(paths[1])
    assert pixels.shape[1] > 800
    assert pixels[..., :3].min() < 0.3 < pixels[..., :3].max() == 1.0  # something dark on white
    assert dict(mpl.rcParams) == before
    assert plt.get_fignums() == open_figures


# -- response -------------------------------------------------------------------------------------------


def panels(figure):
    """Panels by their labels; strips have none."""
    return {axis.get_ylabel(): axis for axis in figure.axes if axis.get_ylabel()}


def moving(table):
    """Both directions of vibration, antiphase below 46 Hz up and below 44 Hz down."""
    place, down = table["supply_frequency_hz"], table["direction"] == "down"
    high = place < np.where(down, 44.0, 46.0)
    changed = {
        "rms_y_m": np.where(high, 4e-3 + 1e-5 * place, 0.0),
        "rms_x_m": np.where(high, 0.0, 2e-3 + 1e-5 * place),
        "phase_difference_rad": np.where(high, np.pi, 0.0),
        "sync": np.where(high, "antiphase", "in-phase"),
    }
    lost = table["outcome"] != "ok"
    return table.assign(**{name: pd.Series(v, table.index).mask(lost) for name, v in changed.items()})


def test_response_has_a_solid_curve_up_on_a_dashed_one_down(write_sweep):
    """No panel is without content."""
    table = moving(sweep_table())
    figure = drawn(write_sweep(table), x="supply")["response"]
    shown = panels(figure)
    assert {"RMS $y$ (mm)", "RMS $x$ (mm)", "motor power (W)"} <= {*shown}
    assert not {PHASE, "RMS $\\varphi$ (mrad)"} & {*shown}  # strips tell phases, and what is 0.5 % of RMS y is even
    drawn_lines = curves(shown["RMS $x$ (mm)"])
    assert [line.get_linestyle() for line in drawn_lines] == ["--", "--", "-", "-"]
    down, up = (known(line.get_ydata()[line.get_ydata() > 0.0]) for line in drawn_lines[1:4:2])
    assert len(down) == len(up) + 2  # it is in phase from 44 Hz on instead of 46 Hz
    named = texts(figure.legends[0])
    assert named[:3] == ["antiphase: vibrates along y", "in-phase: vibrates along x and rocks", "non-periodic"]
    assert {"supply frequency up", "supply frequency down", "jump", "failed"} <= {*named}
    told = figure.axes[0].get_title(loc="left").splitlines()
    assert told[-1].startswith("not drawn: Δφ (within 10° of 0° or 180° at 100 % of the synchronous points)")


def test_peaks_of_two_masses_are_no_range(write_sweep):
    table = sweep_table().assign(outcome="ok", motion="periodic", sync="antiphase", gap_max_m=0.0)
    up = table["supply_frequency_hz"]
    table["rms_y_m"] = 1e-3 + 1e-5 * np.where(table[MASS] == 0.0, up, -up)
    (figure,) = drawn(write_sweep(table), x="supply", measure=["rms_y_m"]).values()
    low, high = up.min(), up.max()
    assert f"$f_e$ = {low:.2f}, {high:.2f} Hz" in figure.get_suptitle() or (
        f"$f_e$ = {high:.2f}, {low:.2f} Hz" in figure.get_suptitle()
    )


def test_jumps_are_arrows_of_both_ways(write_sweep):
    table = moving(sweep_table()).query("branch < 2")
    axis = panels(drawn(write_sweep(table), x="supply")["response"])["RMS $y$ (mm)"]
    (arrows,) = axis.collections
    ends = sorted((line[0][0], line[1][0]) for line in arrows.get_segments())
    assert ends == [(43.0, 44.0), (45.0, 46.0)]
    assert [line.get_marker() for line in axis.lines if line.get_marker() != "None"] == ["v", "v"]


def test_strips_say_how_exciters_synchronize_along_each_way(write_sweep):
    figure = drawn(write_sweep(moving(sweep_table())), x="supply")["response"]
    strips = figure.axes[0]
    assert [text.get_text() for text in strips.get_yticklabels()] == ["0 ↑", "0 ↓", "0.2 ↑", "0.2 ↓"]
    bars = [part for part in strips.collections if not part.get_hatch()]
    ends = {(path.vertices[:, 0].min(), path.vertices[:, 0].max()) for part in bars for path in part.get_paths()}
    assert {(41.5, 43.5), (44.5, 45.5), (45.5, 49.5)} <= ends  # up; 44 Hz is chaotic
    assert sum(part.get_hatch() == "/////" for part in strips.collections) == 4


def test_the_axis_of_several_panels_has_the_points_of_all(write_sweep):
    """Each has points of one machine alone, and another slip."""
    table = sweep_table().query("supply_frequency_hz == 45")
    table = table.assign(outcome="ok", motion="periodic", sync="antiphase", period=1)
    loaded = table[MASS] > 0.0
    table["excitation_frequency_hz"] = np.where(loaded, 24.52, 24.65) + 1e-4 * (table["direction"] == "up")
    table["rms_y_m"] = np.where(loaded, np.nan, 1e-3)
    table["motor_power_w"] = np.where(loaded, 1920.0, np.nan)
    figure = drawn(write_sweep(table), x="excitation", measure=["rms_y_m", "motor_power_w"])["response"]
    for axis in panels(figure).values():
        low, high = axis.get_xlim()
        assert low < 24.52
        assert high > 24.65


def test_the_title_says_the_largest_measure_and_which_motions_there_are(write_sweep):
    figure = drawn(write_sweep(moving(sweep_table())), x="supply")["response"]
    told = figure.get_suptitle().replace("\n", " ")
    assert told.startswith("Largest RMS y 4.45 mm at $f_e$ = 45.00 Hz; ")
    assert told.endswith("4 chaotic, the others repeat every turn; 2 of 32 points failed")
    (figure,) = drawn(write_sweep(), measure=["gap_max_m"]).values()
    assert figure.get_suptitle().startswith("Largest gap 0, 0.200 mm at $f_e$ = 42.00 Hz; ")


def test_legend_of_hundreds_of_curves_names_some_and_says_how_many_more(write_sweep):
    """All of them would cover the figure."""
    table, count = sweep_table(), 40
    branch = table[table["branch"] == 0]
    several = [branch.assign(**{MASS: 0.01 * (k // 10), "k": k % 10, "branch": k}) for k in range(count)]
    table = pd.concat([rows[["k", *table.columns]] for rows in several], ignore_index=True)
    figure = drawn(write_sweep(table))["response"]
    assert len(curves(figure.axes[0])) == count
    named = texts(figure.legends[0])
    assert [named[0], *named[MOST_ENTRIES - 1 : MOST_ENTRIES + 2]] == [
        *("k 0, mass ratio 0", "k 9, mass ratio 0.03"),
        f"and {count - MOST_ENTRIES} more between them",
        "supply frequency up",
    ]


def test_response_wraps_the_phase_so_that_antiphase_is_one_line(write_sweep):
    """Told as π where it is near −π, it may wander on either side of it where the motion does not repeat."""
    table = sweep_table()
    alternating = np.pi * (-0.999) ** np.arange(len(table))
    asked = {"measure": ["phase_difference_rad"]}
    figure = drawn(write_sweep(table.assign(phase_difference_rad=alternating, sync="antiphase")), **asked)["response"]
    axis = panels(figure)[PHASE]
    phases = known(np.concatenate([line.get_ydata() for line in curves(axis)]))
    assert (phases > np.pi).any()
    assert phases == pytest.approx(np.full(len(phases), np.pi), abs=0.1)
    assert axis.get_ylim()[0] < 0.0 < np.pi < axis.get_ylim()[1]


def test_many_values_of_a_key_follow_a_colour_scale(write_sweep):
    parts = [sweep_table().assign(**{MASS: 0.1 * n, "branch": n}).iloc[:8] for n in range(6)]
    figure = drawn(write_sweep(pd.concat(parts)))["response"]
    assert figure.axes[-1].get_ylabel() == r"mass ratio $\mu_w$"
    assert len({line.get_color() for line in curves(panels(figure)["RMS $y$ (mm)"])}) == 6


def test_sweeps_are_laid_over_each_other(write_sweep, figures):
    table = sweep_table().query("branch < 2")
    plain = write_sweep(table.drop(columns=MASS), name="plain")
    edited(plain, "provenance", **handmade.origin("plain", **{"material.mass_ratio": 0.3}))
    (path,) = plot_results([write_sweep(table.assign(**{MASS: 0.1}), name="soft"), plain])
    assert (path.parent.name, path.name) == ("soft", "response-compared.png")
    assert {"soft, mass ratio 0.1", "plain, mass ratio 0.3"} <= {*texts(figures["response"].legends[0])}


# -- diagrams -------------------------------------------------------------------------------------------


def test_bifurcation_shows_the_way_up_on_the_way_down(write_sweep):
    table = sweep_table().query("branch < 2")
    tables = {"section": diagram(table, "y_m"), "impacts": diagram(table, "impact_speed_m_per_s")}
    figure = drawn(write_sweep(table, "bifurcation", **tables))["bifurcation"]
    rest = static_rest(load_config(QUICKSTART, {MASS: 0.0}))[1]
    strips, upper, _ = figure.axes
    *below, steady, odd = (line for line in upper.lines if len(line.get_xdata()))
    own = tables["section"].query("branch == 0").sort_values("period", ascending=False, kind="stable")  # 0: chaotic
    heights, over = (np.concatenate([getattr(line, f"get_{k}data")() for line in (steady, odd)]) for k in "yx")
    assert heights == pytest.approx(own["y_m"].to_numpy() - rest)
    assert over == pytest.approx(own["excitation_frequency_hz"].to_numpy())
    assert odd.get_markersize() < steady.get_markersize()
    assert steady.get_color() not in {line.get_color() for line in below}
    assert {"supply frequency up", "supply frequency down"} <= {*texts(figure.legends[0])}
    assert [text.get_text() for text in strips.get_yticklabels()] == ["up", "down"]
    assert "chaotic" in figure.get_suptitle()


def many_masses(table):
    """Five values of the key of the grid, and a period of two turns."""
    up = table.query("branch == 2").assign(period=np.where(table.query("branch == 2")["period"] == 0, 0, 2))
    return pd.concat([table, *(up.assign(**{MASS: mass, "branch": 90}) for mass in (0.3, 0.9, 2.0))])


def test_map_colours_a_tile_for_each_point_and_hatches_what_does_not_repeat(write_sweep):
    table = many_masses(sweep_table())
    figure = drawn(write_sweep(table, "map"))["map"]
    assert len(figure.axes) == 2  # one for each direction
    for axis, direction in zip(figure.axes, ("up", "down"), strict=True):
        rows = table[table["direction"] == direction].sort_values([MASS, "supply_frequency_hz"])
        good = (rows["outcome"] == "ok").to_numpy()
        tiles = np.ma.filled(np.ma.asarray(axis.collections[0].get_array(), dtype=float), np.nan).ravel()
        found = sorted({*rows["sync"].dropna()}, key=list(SYNC).index)
        assert tiles[good].tolist() == [found.index(name) for name in rows["sync"][good]]
        assert np.isnan(tiles).sum() == (~good).sum()
        hatched = {part.get_hatch(): np.ma.count(part.get_array()) for part in axis.collections if part.get_hatch()}
        assert hatched.pop("xxxx") == (~good).sum()
        assert hatched["/////"] == (rows["period"] == 0).sum()
        assert axis.get_title(loc="left").splitlines()[-1] == direction
    named = texts(figure.legends[0])
    assert named[:3] == ["failed", "antiphase: vibrates along y", "in-phase: vibrates along x and rocks"]
    assert {"non-periodic", "period of several turns"} <= {*named}


def test_map_of_few_rows_has_a_bar_for_each_way(write_sweep):
    table = sweep_table()
    figure = drawn(write_sweep(table, "map"))["map"]
    (axis,) = figure.axes
    assert [text.get_text() for text in axis.get_yticklabels()] == ["0 ↑", "0 ↓", "0.2 ↑", "0.2 ↓"]
    assert axis.get_xlabel() == "supply frequency $f_e$ (Hz)"
    assert "material flies" in texts(figure.legends[0])
    told = figure.get_suptitle().replace("\n", " ")
    assert told.endswith(" of period 3, 4 chaotic, the others repeat every turn; 2 of 32 points failed")


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
    lost = table.assign(outcome="too-many-events", **dict.fromkeys(measures, np.nan))
    figure = drawn(write_sweep(lost.astype({"sync": object})))["response"]
    assert figure.get_suptitle() == "Every point failed"
    axis = figure.axes[0]
    assert not any(np.isfinite(line.get_ydata()).any() for line in curves(axis))
    crosses = np.concatenate([line.get_xdata() for line in axis.lines if line.get_marker() == "x"])
    assert sorted(crosses) == sorted(table["supply_frequency_hz"])  # no excitation frequency is known
