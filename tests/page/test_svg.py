"""Drawings of the page: axes, curves with all that can be seen of them, and dots."""

import math
import re

import numpy as np
import pytest

from vibroplat.config.digits import shown_unit
from vibroplat.page.svg import COLUMNS, DOTS, Plot, Scale, distinct_dots, path, plain_text, thin


@pytest.mark.parametrize(
    ("column", "size", "wanted"),
    [
        ("rms_y_m", 2e-6, ("mm", 1e3)),
        ("rms_phi_rad", 1.0, ("mrad", 1e3)),
        ("force_y_n", 14e3, ("kN", 1e-3)),
        ("force_y_n", 14.0, ("N", 1.0)),
        ("phase_difference_rad", 3.0, ("°", 180.0 / math.pi)),
        ("machine.unbalance_radius_m", 0.03, ("m", 1.0)),
        ("flight_fraction", 1.0, ("", 1.0)),
    ],
)
def test_units_have_prefixes_and_keys_keep_theirs(column, size, wanted):
    assert shown_unit(column, size) == (wanted[0], pytest.approx(wanted[1]))


def test_labels_of_figures_are_plain_text():
    assert plain_text(r"$\mu_w$ = 0.2, $f_e$ 50 Hz") == "μw = 0.2, fe 50 Hz"
    assert plain_text(r"$\Delta\varphi$ in \$") == "Δφ in $"


@pytest.mark.parametrize(
    ("ends", "told"),
    [
        ((0.0, 20.0), ["0", "5", "10", "15", "20"]),
        ((-0.0023, 0.0017), ["−0.002", "−0.001", "0.000", "0.001"]),
        ((0.0, 0.0), ["0"]),
        ((-2e-12, 2e-12), ["−2·10⁻¹²", "−10⁻¹²", "0", "10⁻¹²", "2·10⁻¹²"]),
    ],
)
def test_ticks_are_round_numbers_with_a_minus_of_their_own(ends, told):
    assert [text for _, text in Scale(*ends).ticks(5)] == told


def test_phases_beyond_half_a_turn_are_told_as_in_tables():
    assert [text for _, text in Scale(3.0, 3.3, "°", 180.0 / math.pi).ticks(5)] == ["175", "180", "−175"]
    ticks = Scale(-1.0, 4.0, "°", 180.0 / math.pi).ticks(5)
    assert [text for _, text in ticks] == ["0", "90", "180"]


def test_logarithmic_axes_have_powers():
    scale = Scale(0.1, 1000.0, log=True)
    assert [text for _, text in scale.ticks(5)] == ["0.1", "1", "10", "100", "1000"]
    assert scale.share([0.1, 10.0]).tolist() == pytest.approx([0.0, 0.5])


def test_what_hardly_varies_has_an_axis_that_is_not_noise():
    axis = Scale.of(np.array([5.0, 5.0 + 1e-9]), "W", 1.0)
    assert axis.high - axis.low == pytest.approx(5e-3, rel=0.2)
    phase = Scale.of(np.array([math.pi, math.pi - 1e-9]), "°", 180.0 / math.pi)
    assert (phase.high - phase.low) * phase.factor == pytest.approx(2.0, rel=0.2)


def test_a_long_curve_keeps_its_extremes_its_ends_and_its_gaps():
    x = np.linspace(0.0, 1.0, 100_001)
    y = 0.5 + 0.1 * np.sin(3000.0 * x)
    y[70_007], y[30_011], y[50_000:50_100] = 1.0, 0.0, np.nan
    few_x, few_y = thin(x, y)
    assert len(few_x) <= 4 * COLUMNS + 200
    assert {0.0, 1.0} <= {*few_y[np.isfinite(few_y)]}
    assert (few_x[0], few_x[-1]) == (0.0, 1.0)
    assert np.isnan(few_y).any()
    assert path(few_x, few_y).count("M") == 2


def test_a_curve_that_turns_back_keeps_both_ways():
    there = np.linspace(0.0, 1.0, 10_000)
    x, y = np.concatenate([there, there[::-1]]), np.concatenate([0.2 + 0.0 * there, 0.8 + 0.0 * there])
    few_x, few_y = thin(x, y)
    assert np.ptp(few_x[few_y == 0.2]) == np.ptp(few_x[few_y == 0.8]) == 1.0


def test_dots_that_cover_each_other_are_one():
    rng = np.random.default_rng(1)
    x, _ = distinct_dots(rng.random(1_000_000), rng.random(1_000_000))
    assert len(x) <= (DOTS[0] + 1) * (DOTS[1] + 1)
    assert len(distinct_dots(np.array([0.1, 0.1 + 1e-5, 0.9]), np.array([0.5, 0.5, 0.5]))[0]) == 2


def test_paths_are_whole_numbers_from_point_to_point():
    assert path(np.array([0.0, 0.1, np.nan, 0.5, 0.6, 0.6]), np.array([1.0, 0.9, 0.0, 0.0, 0.1, 0.1])) == (
        "M0 0l1000 300M5000 3000l1000-300"
    )
    assert path(np.array([0.5, np.nan]), np.array([0.5, 0.5])) == "", "a point without a neighbour is no line"


def test_texts_of_a_drawing_are_escaped():
    plot = Plot("<q>&", Scale(0.0, 1.0, label="<u>"), Scale(0.0, 1.0))
    plot.curve([0.0, 1.0], [0.0, 1.0], 'a"<', "#000")
    plot.mark(0.5, 0.5, "<x>")
    plot.word(0.5, 0.5, "<y>", "#000")
    plot.rule("<z>", y=0.5)
    plot.box((0.0, 0.5), (0.0, 0.5), "#000", "<w>")
    assert not re.search(r"<(q|u|x|y|z|w)>", plot.html())
    assert 'data-n="a&quot;&lt;"' in plot.html()
