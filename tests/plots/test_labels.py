"""What keys, values and results laid over each other are called."""

import itertools
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from common.places import QUICKSTART
from matplotlib.figure import Figure

from vibroplat import load_config
from vibroplat.columns import PHASE_COLUMN, unit_of
from vibroplat.measured.data import Measured
from vibroplat.page.results import differences
from vibroplat.plots.axes import show_phases
from vibroplat.plots.pictures import draw_measured
from vibroplat.plots.style import save, styled
from vibroplat.results.content import measures
from vibroplat.results.labels import (
    MOST,
    axis_label,
    capital,
    differing,
    distinct,
    halfway,
    legend_names,
    shortened,
)

PROGRAM = [{"t_s": 0.0, "supply_frequency_hz": 0.0}, {"t_s": 3.0, "supply_frequency_hz": 66.0}]


def tree(**changes):
    return load_config(QUICKSTART, changes).to_tree()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"material.mass_ratio": 0.1}, ("mass ratio 0.2", "mass ratio 0.1")),
        (
            {"drive.supply_frequency_hz": 60.0},
            ("supply 51.5 Hz", "supply 60 Hz"),
        ),
        (
            {"drive.program": PROGRAM},
            ("supply 51.5 Hz", "supply 0 → 66 Hz"),
        ),
        (
            {"contact.impact_law": "central"},
            ("impact law conservative", "impact law central"),
        ),
        (
            {"name": "other", "orbits.key": "contact.restitution", "orbits.start": 0.0, "orbits.stop": 0.5},
            ("", ""),
        ),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_results_name_their_values_of_what_differs(changes, words):
    trees = [tree(), tree(**changes)]
    told = legend_names(["a", "b"], differing("run", trees))
    assert told == [f"{name} ({how})" if how else name for name, how in zip("ab", words, strict=True)]
    assert differences(["run", "run"], trees) == [*words]


def test_of_many_parameters_the_first_are_named_and_the_others_counted():
    changes = {f"machine.damping_{axis}": 50.0 for axis in ("x_n_s_per_m", "y_n_s_per_m", "phi_n_m_s_per_rad")}
    trees = [tree(), tree(**changes, **{"material.mass_ratio": 0.1, "run.duration_s": 9.0})]
    second = legend_names(["a", "b"], differing("run", trees))[1]
    assert second.count(",") == MOST - 1
    assert second.endswith("2 more)")
    assert shortened(["a"] * MOST) == ["a"] * MOST


def test_an_exciter_is_named_by_its_number_and_results_of_one_name_by_their_directories():
    first = load_config(QUICKSTART)
    exciters = [e.model_dump(exclude_none=True) for e in first.exciter_pair]
    trees = [
        first.to_tree() | {"exciters": [exciters[0], exciters[1] | {"unbalance_radius_m": r}]} for r in (0.03, 0.04)
    ]
    assert legend_names(["a", "b"], differing("run", trees))[1] == "b (unbalance radius of exciter 2 0.04 m)"
    places = [Path("one/run"), Path("two/run"), Path("three")]
    assert distinct(["run", "run", "third"], places) == ["one/run", "two/run", "third"]
    assert differences(["run", "sweep"], [tree(), tree(**{"material.mass_ratio": 0.1})]) == ["", ""]


def test_a_phase_axis_tells_values_as_tables_do():
    """Its ticks, read in (−π, π], are where a value of a table is drawn."""
    axis = Figure().add_subplot()
    show_phases(axis, "")
    told = {text.get_text(): place for place, text in zip(axis.get_yticks(), axis.get_yticklabels(), strict=True)}
    assert told["180°"] == pytest.approx(np.pi)
    assert told["−90°"] in (pytest.approx(-0.5 * np.pi), pytest.approx(1.5 * np.pi))
    table = pd.DataFrame({"supply_frequency_hz": [50.0, 51.0], PHASE_COLUMN: [-3.136, 3.136]})
    draw_measured(axis, Measured(Path("measured"), table), "supply_frequency_hz", PHASE_COLUMN)
    low, high = axis.get_ylim()
    drawn = axis.lines[0].get_ydata()
    assert all(low < value < high for value in drawn)
    assert all(abs(b - a) < 0.02 for a, b in itertools.pairwise(drawn))


OVER_FREQUENCY = {"key": "drive.supply_frequency_hz", "start": 42.0, "stop": 50.0}


@pytest.mark.parametrize(
    ("command", "study", "changes"),
    [
        ("sweep", {"sweep.grid": {"material.mass_ratio": [0.1]}}, {"material.mass_ratio": 0.3}),
        ("sweep", {}, {"drive.supply_frequency_hz": 60.0}),
        (
            "orbits",
            {"orbits": {"key": "material.mass_ratio", "start": 0.1, "stop": 0.2}},
            {"material.mass_ratio": 0.3},
        ),
        (
            "orbits",
            {"orbits": OVER_FREQUENCY | {"grid": {"material.mass_ratio": [0.1]}}},
            {"material.mass_ratio": 0.3},
        ),
    ],
)
def test_what_a_study_varies_itself_is_no_difference(command, study, changes):
    trees = [tree(**study), tree(**study, **changes)]
    assert differing(command, trees) == [{}, {}]
    assert differing("run", trees)[1]


@pytest.mark.parametrize(
    ("key", "label"),
    [
        ("material.mass_ratio", r"mass ratio $\mu_w$"),
        ("machine.damping_y_n_s_per_m", "damping along y $b_y$ (N·s/m)"),
        ("contact.viscous_per_mass_per_s", "viscous per mass (1/s)"),
    ],
)
def test_keys_are_called_by_names_symbols_and_units(key, label):
    assert axis_label(key, unit_of(key)) == label


def test_a_sentence_has_a_capital_letter_and_a_key_stays_a_key():
    told = ["runs at 16 Hz", "machine.stiffness_y_n_per_m: 2 jumps", "rms_y_m is 0", "no jump."]
    assert [capital(text) for text in told] == ["Runs at 16 Hz", *told[1:3], "No jump."]


def test_tiles_of_what_is_not_below_0_do_not_reach_below_it():
    assert halfway(np.array([1e3, 2.5e4, 5e4]))[0] == 0.0
    assert halfway(np.array([0.0, 1.0])).tolist() == [0.0, 0.5, 1.5]
    assert halfway(np.array([-1.0, 1.0])).tolist() == [-2.0, 0.0, 2.0]


def test_a_measure_of_one_point_is_told_and_has_no_panel():
    table = pd.DataFrame({"rms_y_m": [1e-3, 2e-3, 4e-3], "lyapunov_per_s": [np.nan, 0.52, np.nan]})
    panels, told = measures(table)
    assert ([panel.column for panel in panels], told) == (["rms_y_m"], "not drawn: Lyapunov 0.520 1/s at one point")
    assert [panel.column for panel in measures(table.iloc[1:2])[0]] == ["rms_y_m", "lyapunov_per_s"]


def test_letters_that_the_font_lacks_are_no_warning(tmp_path, caplog):
    with styled():
        figure = Figure(layout="constrained")
        figure.suptitle("篩")
        figure.subplots().set_title(r"$\mathrm{篩}$")
        save(figure, tmp_path, "sieve")
    assert caplog.messages == []
    assert (tmp_path / "sieve.png").stat().st_size > 0
