"""The band of practice beside the conveying speed of a sweep, in print and on the page."""

import math
from pathlib import Path

import numpy as np
import pytest
from common.pages import page_of

from vibroplat import load_config, sweep
from vibroplat.inspection.material import ERROR
from vibroplat.plots.pictures import draw_picture
from vibroplat.results.picture import LOW
from vibroplat.study.picture import pictures

FEEDER = Path(__file__).parents[2] / "configs/templates/feeder.yaml"
SPEED = "conveying_speed_m_per_s"


def swept(values):
    """A feeder over its mass ratio, up."""
    plan = {"over": {"key": "material.mass_ratio", "values": values}, "max_settle_s": 20.0}
    return sweep(load_config(FEEDER).model_copy(update={"sweep": None}).replace({"sweep": plan}))


@pytest.fixture(scope="module")
def found():
    return swept([0.1, 0.25, 0.3, 0.35])


def test_the_band_is_what_the_formula_says_of_the_motion_of_each_row(found):
    (picture,) = pictures([found])
    (band,) = [one for one in picture.series if one.mode == "band"]
    rows, drawn = found.sweep, picture.points.iloc[len(found.sweep) :]
    moved = math.pi * rows["excitation_frequency_hz"] * rows["stroke_x_m"]
    good = rows["gamma"].between(2.2, 2.8).to_numpy()
    assert good.tolist() == [False, True, True, True]
    np.testing.assert_allclose(drawn[SPEED][good], 0.95 * moved[good], rtol=0.05)
    np.testing.assert_allclose(drawn[f"{SPEED}{LOW}"] / drawn[SPEED], np.where(good, 0.75 / 0.95, np.nan))
    assert band.places.tolist() == [-1, 5, 6, 7]
    assert band.label == f"formulas of practice (simulations: up to {100 * ERROR:.0f} % off)"
    assert "formula" not in " ".join(panel.note for panel in picture.panels)


def test_it_is_drawn_in_print_and_on_the_page(found, tmp_path):
    (picture,) = pictures([found])
    axis = next(a for a in draw_picture(picture).axes if "conveying" in a.get_ylabel())
    assert len(axis.collections) == 1
    assert axis.get_ylim()[0] < picture.points[f"{SPEED}{LOW}"].min()
    found.save(tmp_path)
    assert page_of(tmp_path).count('class="band"') >= 1


def test_the_band_of_a_single_row_is_a_bar():
    one = swept([0.3])
    (picture,) = pictures([one])
    axis = next(a for a in draw_picture(picture).axes if "conveying" in a.get_ylabel())
    low, high = axis.collections[-1].get_segments()[0][:, 1]
    assert high == pytest.approx(low * 0.95 / 0.75)
