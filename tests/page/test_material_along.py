"""Material that moves along the deck, on the page and in its data sheet."""

import base64
import math

import numpy as np
import pytest
from common.places import ROOT

from vibroplat import load_config, simulate
from vibroplat.page.machine import drawing, machine_of
from vibroplat.page.run import resample, shown_run
from vibroplat.results.sheet import Sheet


@pytest.fixture(scope="module")
def feeder():
    return simulate(load_config(ROOT / "configs/examples/conveying.yaml", {"run.duration_s": 2.0}))


def test_the_machine_moves_its_material_from_the_beginning_of_each_turn(feeder):
    motion = shown_run(feeder, feeder.events).motion
    low, high, text = motion["columns"]["along_m"]
    along = low + (high - low) * np.frombuffer(base64.b64decode(text), "<u2") / 65534
    firsts, (_, seconds, last, count) = [first for *_, first, _ in motion["windows"]], motion["windows"][-1]
    assert np.abs(along[firsts]).max() <= (high - low) / 65534
    way = (2.0 * along[-1] - along[-2]) / seconds
    assert way == pytest.approx(feeder.summary["conveying_speed_m_per_s"], rel=0.02)
    assert len(along) == last + count
    assert drawing(machine_of(feeder.scene), "").count('class="grains"') == 1
    assert "grains" not in drawing(machine_of(feeder.scene.replace({"transport": None})), "")


def test_a_machine_on_a_slope_is_drawn_from_its_rest(feeder):
    scene = feeder.scene.replace({"transport.deck_angle_deg": 10.0})
    force = 1.2 * scene.platform_mass * 9.81 * math.sin(math.radians(10.0))
    shown, times = feeder.trajectory, np.zeros(1)
    level, tilted = (resample(shown, one, times)["x_m"][0] for one in (feeder.scene, scene))
    assert level - tilted == pytest.approx(force / scene.machine.stiffness_x_n_per_m)


def test_the_sheet_tells_how_fast_material_goes_and_what_follows(feeder):
    sheet, s = Sheet(feeder.scene, feeder.summary), feeder.summary
    rows = {row.label: row for row in sheet.groups["Conveying"]}
    told = rows["conveying speed"].short[2]
    assert f"{rows['throughput'].now}; sticks {rows['sticks'].now}, slips " in told
    assert rows["throughput"].now.endswith(" kg/s")
    assert rows["wear power"].now.endswith(" W/m²")
    assert "beyond internal friction" not in rows, "one layer"
    still = Sheet(feeder.scene, s | {"conveying_speed_m_per_s": 1e-12, "residence_time_s": None})
    rows = {row.label: row.now for row in still.groups["Conveying"]}
    assert rows["conveying speed"] == "0"
    assert not {"throughput", "residence time"} & {*rows}
    steep = {"transport": {"friction": 0.3, "static_friction": 0.6, "deck_angle_deg": 24.0}}
    sheet = Sheet(feeder.scene.replace(steep), s | {"period": 0})
    rows = {row.label: row for row in sheet.groups["Conveying"]}
    assert rows["conveying speed"].short[2].endswith("in this time, it runs away")
    assert "throughput" not in rows
    smooth = Sheet(feeder.scene.replace({"transport": None}), s)
    assert "Conveying" not in smooth.groups
