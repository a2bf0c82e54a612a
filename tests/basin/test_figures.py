"""Figures of basins: of a grid, of starts at random, of one key, over a key."""

import pytest
from common.places import ROOT
from matplotlib.colors import to_hex

from vibroplat.results.picture import SYNC, attractor_colours

CONFIG = """
extends: {machine}
solver: {{engine: taylor}}
drive: {{supply_frequency_hz: 62.3}}
material: {{mass_ratio: 0.0}}
basins: {{{plan}}}
"""
PHASE, SPEED = "run.initial.phase_difference_rad", "run.initial.speed_ratio"
LEGEND = {"antiphase, period 1", "in-phase, period 1"}
KINDS = {
    "grid": (f"initial_conditions: {{{PHASE}: [-3.0, 3.0, 4], {SPEED}: [0.9, 1.0, 2]}}", "phase difference (rad)"),
    "random": (
        f"initial_conditions: {{{PHASE}: [-3.0, 3.0], {SPEED}: [0.9, 1.0]}}, random: 8",
        "phase difference (rad)",
    ),
    "one": (f"initial_conditions: {{{PHASE}: [-3.0, 3.0]}}, random: 8", "phase difference (rad)"),
    "over": (
        f"initial_conditions: {{{PHASE}: [-0.1, 3.0, 4]}}, "
        "over: {key: drive.supply_frequency_hz, values: [62.0, 62.1]}",
        "supply frequency $f_e$ (Hz)",
    ),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_figure_names_attractors_and_the_box_of_starts(kind, command, figures, tmp_path, monkeypatch):
    plan, label = KINDS[kind]
    monkeypatch.chdir(tmp_path)
    (tmp_path / "c.yaml").write_text(CONFIG.format(machine=ROOT / "configs/machines/calibrated.yaml", plan=plan))
    assert command("basins", "c.yaml", "--out", ".").code == 0
    assert command("plot", "c").code == 0
    figure = figures["basins"]
    assert {axis.get_xlabel() for axis in figure.axes if axis.get_xlabel()} == {label}
    (legend,) = figure.legends
    names = [text.get_text().partition(":")[0] for text in legend.get_texts()]
    assert set(names) == LEGEND
    handles = zip(names, legend.legend_handles, strict=True)
    colours = {
        name: one.get_color() if kind == "over" else to_hex(one.get_facecolor()).upper() for name, one in handles
    }
    assert colours == {name: SYNC[name.partition(",")[0]] for name in LEGEND}
    assert ("phase difference −0.1 … 3 rad" in figure.axes[0].get_title("left")) == (kind == "over")


def test_colours_of_attractors_depend_on_no_order():
    names = ["in-phase, chaotic", "antiphase, period 2", "in-phase, period 1", "antiphase, period 1", "none, undecided"]
    found = attractor_colours(names)
    assert found == attractor_colours(names[::-1])
    assert len(set(found.values())) == len(names)
    assert [found[name] for name in names[2:]] == [SYNC["in-phase"], SYNC["antiphase"], SYNC["none"]]
    assert not {found[name] for name in names[:2]} & set(SYNC.values())
