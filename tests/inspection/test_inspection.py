"""What is known before a run: formulas, the balance of torques, the averaged start, and the lines that say it."""

import math
import re

import numpy as np
import pytest
from common.commands import command

from vibroplat import Scene, load_config
from vibroplat.config.reader import configurations
from vibroplat.inspection.balance import balances, final_supply, holding_torque, speed_grid
from vibroplat.inspection.linear import loaded_frequencies, platform_torques
from vibroplat.inspection.start import averaged_start
from vibroplat.inspection.values import INSPECTION

CONFIGS = configurations()
RIG = {"M": 12.51, "k": 0.045 * 0.09, "c": 470e3, "b": 40.0}


def test_closed_formulas_of_the_default_rig():
    found = Scene().inspect()
    assert found.keys() == INSPECTION.keys()
    assert found["natural_frequency_y_hz"] == pytest.approx(math.sqrt(RIG["c"] / RIG["M"]) / (2.0 * math.pi))
    assert found["damping_ratio_y"] == pytest.approx(0.5 * RIG["b"] / math.sqrt(RIG["c"] * RIG["M"]))
    assert found["static_sag_m"] == pytest.approx(RIG["M"] * 9.81 / RIG["c"])
    assert found["stroke_far_above_m"] == pytest.approx(4.0 * RIG["k"] / RIG["M"])
    w = 2.0 * math.pi * found["excitation_frequency_hz"]
    stroke = 4.0 * RIG["k"] * w * w / abs(RIG["c"] - RIG["M"] * w * w + 1j * w * RIG["b"])
    assert found["expected"] == "antiphase"
    assert found["stroke_y_m"] == pytest.approx(stroke, rel=1e-6)
    assert found["throw_index"] == pytest.approx(0.5 * stroke * w * w / 9.81, rel=1e-6)
    force = 0.5 * stroke * abs(RIG["c"] + 1j * w * RIG["b"])
    assert found["dynamic_force_y_n"] == pytest.approx(force, rel=1e-6)
    assert force == pytest.approx(found["isolation"] * 2.0 * RIG["k"] * w * w)
    # the motors give what friction and dampers take
    power = 0.5 * RIG["b"] * (0.5 * stroke * w) ** 2 + 2.0 * found["friction_torque_1_n_m"] * w
    assert found["motor_power_w"] == pytest.approx(power, rel=1e-3)


def test_material_in_contact_makes_two_oscillators_of_y():
    soft = {"mass_ratio": 0.4, "lower_share": 0.5, "natural_frequency_hz": 20.0}
    low, high = loaded_frequencies(Scene(material=soft))
    total, upper, w = RIG["M"] * 1.4, RIG["M"] * 0.2, 2.0 * math.pi * np.array([low, high])
    square = (2.0 * math.pi * 20.0) ** 2
    determinant = (RIG["c"] - total * w**2) * (square - w**2) - upper * w**4
    assert np.abs(determinant / (RIG["c"] * square)).max() < 1e-9
    (alone,) = loaded_frequencies(Scene(material={"mass_ratio": 0.4, "layers": 1}))
    assert alone == pytest.approx(math.sqrt(RIG["c"] / total) / (2.0 * math.pi))
    assert loaded_frequencies(Scene()) == ()


def test_platform_torques_take_what_the_dampers_dissipate():
    scene = load_config(CONFIGS / "examples" / "unequal-radii.yaml")
    lag = np.linspace(-3.0, 3.0, 7)
    taken = -platform_torques(scene, np.full(7, 180.0), lag).sum(axis=-1)
    assert (taken > 0.0).all()
    undamped = {f"machine.damping_{axis}": 0.0 for axis in ("x_n_s_per_m", "y_n_s_per_m", "phi_n_m_s_per_rad")}
    kept = platform_torques(scene.replace(undamped), np.full(7, 180.0), lag)
    assert np.abs(kept.sum(axis=-1)).max() < 1e-9 * np.abs(kept).max()


@pytest.mark.parametrize(("changes", "expected"), [
    pytest.param({"drive.supply_frequency_hz": 66.0}, "in-phase", marks=pytest.mark.long),
    pytest.param({"drive.supply_frequency_hz": 78.0}, "antiphase", marks=pytest.mark.long),
    ({"motors": [{}, {"pole_pairs": 3}]}, "none"),
    pytest.param({"motors": [{}, {"critical_torque_n_m": 0.0}]}, "antiphase", marks=pytest.mark.long),
    pytest.param({"exciters.0.rotation": "clockwise"}, "in-phase", marks=pytest.mark.long),
])  # fmt: skip
def test_expected_synchronization(changes, expected):
    base = {"machine": {"unbalance_radius_m": 0.03}}
    if "exciters.0.rotation" in changes:
        base, changes = {"exciters": [{"rotation": "clockwise"}, {"rotation": "clockwise"}]}, {}
    found = Scene.from_tree(base).replace(changes).inspect()
    assert found["expected"] == expected
    assert math.isnan(found["phase_difference_rad"]) == (expected == "none")


def test_unequal_torques_are_held_by_a_lag_up_to_the_holding_torque():
    scene = Scene(machine={"unbalance_radius_m": 0.03}, drive={"supply_frequency_hz": 78.0})
    hold = holding_torque(scene, 2.0 * math.pi * 39.0)
    for share, held in ((0.8, True), (1.3, False)):
        drag = {"friction_radius_m": share * hold / (0.00135 * (2.0 * math.pi * 39.0) ** 2)}
        other = Scene.from_tree(scene.to_tree() | {"motor": None, "motors": [{"friction_radius_m": 0.0}, drag]})
        found = balances(other, final_supply(other), speed_grid(other))
        assert bool(found) == held


def test_a_start_is_captured_below_the_torque_that_passes():
    scene = load_config(CONFIGS / "examples" / "threshold-torque.yaml")
    found = scene.inspect()
    factor = found["passage_ratio"]
    assert 1.2 * factor == pytest.approx(1.5295, rel=0.05)  # of `vibroplat find`
    ends = averaged_start(scene, np.array([0.95, 1.05]) * factor) / (2.0 * math.pi)
    assert ends[0] == pytest.approx([30.8, 30.8], abs=0.2)
    assert (ends[1] > 32.0).all()
    assert (found["passage_axis"], found["passage_frequency_hz"]) == ("y", pytest.approx(30.85, abs=0.01))
    assert "a start is captured" in str(found).splitlines()[0]


@pytest.mark.parametrize(("name", "stroke", "throw", "force"), [
    ("screen", 3.0225e-3, 3.809, 853.0),
    pytest.param("feeder", 6.975e-3, 3.919, 1194.3, marks=pytest.mark.long),
    pytest.param("heavy-screen", 6.48e-3, 3.54, 5280.0, marks=pytest.mark.long),
])  # fmt: skip
def test_loaded_templates_as_simulated(name, stroke, throw, force):
    found = load_config(CONFIGS / "templates" / f"{name}.yaml").inspect()
    assert found["loaded_expected"] == "antiphase"
    assert found["loaded_stroke_y_m"] == pytest.approx(stroke, rel=0.03)
    assert found["loaded_throw_index"] == pytest.approx(throw, rel=0.03)
    assert found["loaded_dynamic_force_y_n"] == pytest.approx(force, rel=0.03)


@pytest.mark.parametrize("changes", [
    pytest.param(
        {"drive": {"program": [{"t_s": 0, "supply_frequency_hz": 50}, {"t_s": 1, "off": True}]}}, marks=pytest.mark.long
    ),
    {"motor.critical_torque_n_m": 0.0},
    pytest.param({"machine.stiffness_x_n_per_m": 0.0, "machine.damping_x_n_s_per_m": 0.0}, marks=pytest.mark.long),
    pytest.param({"material": {"mass_ratio": 0.1, "layers": 1}, "contact.model": "non-impact"}, marks=pytest.mark.long),
    {"name": "m" * 100, "machine.gravity_m_per_s2": 0.0, "drive.supply_frequency_hz": 20.0},
])  # fmt: skip
def test_twelve_lines_for_every_machine(changes):
    lines = str(Scene().replace(changes).inspect()).splitlines()
    assert len(lines) == 12
    assert all(len(line) <= 110 and not re.search(r"\b(nan|inf)\b", line) for line in lines), lines


def test_command(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("motor: {critical_torque_n_m: 2}\n")
    done = command("inspect", str(file), "--set", "drive.supply_frequency_hz=40")
    assert done.code == 0
    assert done.out.startswith("mine: in-phase expected at 19.7")
    assert "note: machine: no key given" in done.out
    wrong = command("inspect", str(file), "--set", "motor.critical_torque_n_m=-1")
    assert wrong.code == 2
    assert "critical_torque_n_m" in wrong.err
