"""Figures of basins: of a grid, of starts at random, of one key, over a key."""

import pytest
from common.places import ROOT
from matplotlib.colors import to_hex

from vibroplat import basins, load_config
from vibroplat.results.picture import SYNC, attractor_colours

SUPPLY, PHASE, SPEED = "drive.supply_frequency_hz", "run.initial.phase_difference_rad", "run.initial.speed_ratio"
KEYS = {"solver.engine": "taylor", SUPPLY: 62.3, "material.mass_ratio": 0.0}
PLANS = {
    "grid": {"initial_conditions": {PHASE: [-3.0, 3.0, 4], SPEED: [0.9, 1.0, 2]}},
    "random": {"initial_conditions": {PHASE: [-3.0, 3.0], SPEED: [0.9, 1.0]}, "random": 8},
    "one": {"initial_conditions": {PHASE: [-3.0, 3.0]}, "random": 8},
    "over": {"initial_conditions": {PHASE: [-0.1, 3.0, 4]}, "over": {"key": SUPPLY, "values": [62.0, 62.1]}},
}


@pytest.mark.parametrize("kind", PLANS)
def test_a_figure_names_attractors_and_the_box_of_starts(kind):
    figure = basins(load_config(ROOT / "configs/machines/calibrated.yaml", KEYS | {"basins": PLANS[kind]})).plot()
    label = "supply frequency $f_e$ (Hz)" if kind == "over" else "phase difference (rad)"
    assert {axis.get_xlabel() for axis in figure.axes if axis.get_xlabel()} == {label}
    (legend,) = figure.legends
    names = [text.get_text().partition(":")[0] for text in legend.get_texts()]
    colours = {
        name: one.get_color() if kind == "over" else to_hex(one.get_facecolor()).upper()
        for name, one in zip(names, legend.legend_handles, strict=True)
    }
    assert colours == {f"{sync}, period 1": SYNC[sync] for sync in ("antiphase", "in-phase")}
    assert ("phase difference −0.1 … 3 rad" in figure.axes[0].get_title("left")) == (kind == "over")


def test_colours_of_attractors_depend_on_no_order():
    names = [
        "in-phase, chaotic",
        "antiphase, period 2",
        "in-phase, period 1",
        "antiphase, period 1",
        "not synchronized, undecided",
    ]
    found = attractor_colours(names)
    assert found == attractor_colours(names[::-1])
    assert len(set(found.values())) == len(names)
    assert [found[name] for name in names[2:]] == [SYNC["in-phase"], SYNC["antiphase"], SYNC["none"]]
    assert not {found[name] for name in names[:2]} & set(SYNC.values())
