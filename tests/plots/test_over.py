"""Figures and the page of sweeps over another key than the supply."""

import numpy as np
import pytest
from common import handmade
from common.places import QUICKSTART
from matplotlib.colors import to_hex

from vibroplat import load_config
from vibroplat.columns import unit_of
from vibroplat.errors import TableError, VibroplatError
from vibroplat.hybrid.state import static_rest
from vibroplat.plots.command import plot_results
from vibroplat.results.files import write_result
from vibroplat.results.labels import axis_label, in_ratios
from vibroplat.study.curves import fill_failed

from . import conftest
from .conftest import diagram, sweep_table, texts

MASS, DAMPING, LAW = "material.mass_ratio", "machine.damping_y_n_s_per_m", "contact.restitution"
#: Values in equal ratios, in the place of the frequencies of a table made by hand.
RATIOS = 10.0 ** np.linspace(1.0, 4.5, 8)


def over(key, values, second=LAW):
    """The table of a sweep over a key whose values take the place of 42 … 49 Hz; of a fixed supply of 60 Hz."""
    table = sweep_table().rename(columns={"supply_frequency_hz": key, MASS: second})
    return table.assign(**{key: np.asarray(values)[(table[key] - 42.0).astype(int)], "excitation_frequency_hz": 29.5})


@pytest.fixture
def write(tmp_path):
    """Write a sweep over a key, and tables beside it."""

    def written(table, kind="response", name="swept", more=None, **tables):
        place, key = tmp_path / name, table.columns[0]
        place.mkdir(exist_ok=True)
        grid = {column: table[column].unique().tolist() for column in (LAW, MASS) if column in table and column != key}
        plan = {"over": {"key": key, "values": table[key].unique().tolist()}, "grid": grid, "kind": kind}
        origin = handmade.origin(name, sweep=plan | {"supply_frequency_hz": None}, **(more or {}))
        write_result(place, "sweep", origin, {"sweep": table, **tables}, form="parquet")
        return place

    return written


def drawn(place, *kinds, **options):
    return conftest.drawn("sweep", place, kinds=kinds, **options)


def test_a_response_is_over_the_key_with_its_name_and_unit(write):
    place = write(over(DAMPING, RATIOS))
    figure = drawn(place)["response"]
    axis = figure.axes[1]
    assert {one.get_xlabel() for one in figure.axes} == {"", "damping along y $b_y$ (N·s/m)"}
    assert {one.get_xscale() for one in figure.axes} == {"log"}
    assert figure.axes[0].get_title(loc="left").startswith("swept: $f_e$ = 51.5 Hz, ")
    assert {"damping along y up", "damping along y down"} <= {*texts(figure.legends[0])}
    lines = np.concatenate([line.get_xdata()[np.isfinite(line.get_ydata())] for line in axis.lines])
    assert sorted({*lines[np.isfinite(lines)]}) == pytest.approx(RATIOS)


def test_axes_are_logarithmic_for_values_in_equal_ratios_alone():
    assert in_ratios([1.0, 10.0, 100.0, 10.0])
    assert not in_ratios([1.0, 10.0])
    assert not in_ratios([0.0, 1.0, 10.0])
    assert not in_ratios(np.linspace(42.0, 42.001, 3))
    assert not in_ratios([np.nan, np.nan])


def test_a_key_of_an_exciter_says_of_which():
    assert axis_label("exciters.1.critical_slip", "") == "critical slip of exciter 2"


def test_points_that_failed_are_on_the_axis_of_either_column():
    table = over(MASS, 0.1 * np.arange(8)).query("branch == 2")
    failed = (table["outcome"] != "ok").to_numpy()
    assert fill_failed(table, MASS)[failed].to_numpy() == pytest.approx([0.7])
    assert fill_failed(table, "excitation_frequency_hz")[failed].to_numpy() == pytest.approx([29.5])


def test_heights_of_a_bifurcation_are_from_the_rest_of_each_value(write):
    table = over(MASS, 0.1 * np.arange(8)).query("branch == 0")
    section = diagram(table, "y_m")
    place = write(table, "bifurcation", section=section, impacts=diagram(table, "impact_speed_m_per_s"))
    (line,) = (line for line in drawn(place, "bifurcation")["bifurcation"].axes[1].lines if len(line.get_xdata()) > 5)
    section = section[section["period"] > 0]  # others are smaller dots
    rests = {value: static_rest(load_config(QUICKSTART, {MASS: value}))[1] for value in section[MASS].unique()}
    wanted = section["y_m"] - section[MASS].map(rests)
    assert line.get_ydata() == pytest.approx(wanted.to_numpy())
    assert line.get_xdata() == pytest.approx(section[MASS].to_numpy())


def test_any_two_keys_make_a_map_with_boundaries_of_orbits_over_both(write):
    boundaries = handmade.boundaries().rename(columns={"supply_frequency_hz": DAMPING, MASS: LAW})
    boundaries[DAMPING] = np.geomspace(20.0, 2e4, len(boundaries))
    place = write(over(DAMPING, RATIOS), "map")
    figure = drawn(place, "map")["map"]
    assert figure.axes[0].get_xlabel() == axis_label(DAMPING, unit_of(DAMPING))  # two rows are bars
    assert figure.axes[0].get_xscale() == "log"
    (beside := place / "orbits").mkdir()
    write_result(beside, "orbits", handmade.origin("swept"), {"boundaries": boundaries}, form="parquet")
    figure = drawn(place, "map")["map"]
    assert figure.axes[0].get_ylabel() == axis_label(LAW, unit_of(LAW))
    edges = np.ma.filled(figure.axes[0].collections[0].get_coordinates()[0, :, 0])
    assert edges[1:-1] == pytest.approx(np.sqrt(RATIOS[1:] * RATIOS[:-1]))
    fold, liftoff = figure.axes[0].lines
    assert any(text.startswith("liftoff: ") for text in texts(figure.legends[0]))
    assert fold._dash_pattern != liftoff._dash_pattern
    assert fold.get_xdata() == pytest.approx(boundaries[DAMPING][:7])
    # rows of 0 and 0.2 are 1 apart; beyond the last there is nothing
    assert np.asarray(fold.get_ydata())[:5] == pytest.approx(5.0 * np.linspace(0.0, 0.2, 5))
    assert np.isnan(fold.get_ydata()[5:]).all()
    write_result(
        beside,
        "orbits",
        handmade.origin("swept"),
        {"boundaries": boundaries.assign(n_unstable=(boundaries["curve"] == 1).astype("Int64"))},
        form="parquet",
    )
    figure = drawn(place, "map")["map"]
    assert len({line.get_linewidth() for line in figure.axes[0].lines}) == 2
    assert texts(figure.legends[0])[-1] == "thin: of unstable orbits"
    other = boundaries.rename(columns={DAMPING: MASS})
    write_result(beside, "orbits", handmade.origin("swept"), {"boundaries": other}, form="parquet")
    assert not any("liftoff: " in text for text in texts(drawn(place, "map")["map"].legends[0]))


def test_a_map_shows_any_measure(write):
    table = over(MASS, 0.1 * np.arange(8))
    figure = drawn(write(table, "map"), "map", measure=["rms_y_m", "period"])["map"]
    tiles = figure.axes[0].collections[0]
    rows = table[table["direction"] == "up"].sort_values([LAW, MASS])
    shown = np.ma.filled(np.ma.asarray(tiles.get_array(), dtype=float), np.nan).ravel()
    assert shown == pytest.approx(rows["rms_y_m"].to_numpy(), nan_ok=True)
    assert [axis.get_title(loc="left").splitlines()[-1] for axis in figure.axes[:4:2]] == [
        "RMS $y$, up",
        "period, up",
    ]
    assert [axis.get_ylabel() for axis in figure.axes[4:]] == ["RMS $y$ (mm)", "period"]
    assert to_hex(tiles.cmap(tiles.norm(np.nanmax(shown)))) == to_hex(tiles.cmap(1.0))


def test_a_response_shows_any_measure(write):
    table = over(MASS, 0.1 * np.arange(8)).assign(foundation_force_y_max_n=np.arange(32.0))
    _, axis = drawn(write(table), "response", measure=["foundation_force_y_max_n"])["response"].axes
    assert axis.get_ylabel() == "largest foundation force y (N)"
    assert {*np.arange(8.0)} <= {value for line in axis.lines for value in line.get_ydata()}


MISTAKES = [
    ({"kinds": ["map"], "measure": ["sync"]}, "the sweep table in DIR has no numbers in column sync"),
    ({"kinds": ["map"], "measure": ["rms"]}, "the sweep table in DIR has no column rms"),
    (
        {"kinds": ["bifurcation"], "measure": ["rms_y_m"]},
        "--measure rms_y_m: bifurcation does not show it; allowed: response, map",
    ),
    ({"x": "supply"}, "the sweep table in DIR has no column supply_frequency_hz"),
]


@pytest.mark.parametrize(("options", "told"), MISTAKES)
def test_what_cannot_be_drawn_is_told(options, told, write):
    place = write(over(MASS, 0.1 * np.arange(8)))
    with pytest.raises(VibroplatError) as caught:
        plot_results([place], **options)
    assert str(caught.value).replace(str(place), "DIR") == told


def test_sweeps_over_different_keys_are_not_laid_over_each_other(write):
    first, second = write(over(MASS, 0.1 * np.arange(8))), write(over(DAMPING, RATIOS), name="other")
    with pytest.raises(
        TableError, match=rf"other is over {DAMPING}, not {MASS}; allowed: several sweeps over one key$"
    ):
        plot_results([first, second])


def test_the_only_values_of_keys_and_all_failed_points_are_drawn(write):
    one = over(MASS, 0.1 * np.arange(8), second=LAW).query("branch == 0").head(1)
    assert np.ptp(drawn(write(one))["response"].axes[0].get_xlim()) < 0.2
    failed = over(MASS, 0.1 * np.arange(8)).assign(
        outcome="too-many-events", rms_y_m=np.nan, excitation_frequency_hz=np.nan
    )
    axis = drawn(write(failed))["response"].axes[0]
    crosses = np.concatenate([line.get_xdata() for line in axis.lines if line.get_marker() == "x"])
    assert sorted({*crosses}) == pytest.approx(0.1 * np.arange(8))
