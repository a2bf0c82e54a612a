"""The section ``springs``: what it may say, how it lies over others, and keys of it."""

import json

import pytest
from common.places import ROOT

from vibroplat import load_config
from vibroplat.config.keys import configuration_schema, key_of, number_of
from vibroplat.config.reader import parse_overrides
from vibroplat.designs.sensitivities import tolerances_of_keys, varied_keys
from vibroplat.errors import ConfigError
from vibroplat.page.machine import Sizes, drawing, machine_of
from vibroplat.results.labels import axis_label, value_words

CONVEYOR = ROOT / "configs/machines/conveyor.yaml"
LEFT = "springs.left.stiffness_y_n_per_m"


@pytest.fixture(scope="module")
def conveyor():
    return load_config(CONVEYOR)


MESSAGES = {
    "springs.left.off=true": "springs: the machine tips over with springs.left.off; allowed: springs at two places",
    "springs.left.stiffness_z=1": "unknown key springs.left.stiffness_z; did you mean stiffness_ratio? allowed: pos",
    "springs.left.stiffness_y_n_per_m=-1": "springs.left.stiffness_y_n_per_m = -1; allowed: more than 0",
    "springs.new={position_m: [0, 0], stiffness_ratio: 1}": "springs.new: no stiffness_y_n_per_m is given; allowed: st",
    "springs.new={position_m: [0, 0], sag_m: 1}": "springs.new: no stiffness_x_n_per_m is given; allowed: stiffness_x",
    "springs.a b.sag_m=1": "springs.a b.[key] = 'a b'; allowed: at most 40 letters of English",
    "springs.left.count=0": "springs.left.count = 0; allowed: at least 1",
    "machine.stiffness_y_n_per_m=1e5": "springs and machine.stiffness_y_n_per_m are both given; allowed: one of the",
    "output={points: {a: [0, 0]}, springs: {a: 1}}": "springs and output.springs are both given; allowed: springs",
}


@pytest.mark.parametrize("setting", MESSAGES)
def test_messages(setting):
    with pytest.raises(ConfigError) as caught:
        load_config(CONVEYOR, parse_overrides([setting]))
    assert MESSAGES[setting] in str(caught.value)
    assert str(caught.value).isprintable()


def test_they_replace_those_of_the_machine_and_are_merged_by_names(tmp_path, conveyor):
    upper = tmp_path / "upper.yaml"
    upper.write_text(f"extends: {CONVEYOR}\nsprings: {{left: {{sag_m: 0.05}}}}\n")
    scene = load_config(upper)
    assert scene.springs["left"].stiffness_y_n_per_m is None
    assert scene.springs["right"] == conveyor.springs["right"]
    quickstart = load_config(ROOT / "configs/quickstart.yaml")
    placed = quickstart.replace({"springs": conveyor.to_tree()["springs"]})
    assert placed.suspension.stiffness[0][0] == 2.0 * 12714.0
    assert "stiffness_x_n_per_m" not in placed.to_tree()["machine"]
    assert type(placed).from_tree(placed.to_tree()).suspension == placed.suspension


def test_catalogue_springs_are_chosen_for_the_loaded_machine(conveyor):
    weight = (conveyor.body.mass * 1.2) * 9.81
    by_sag = conveyor.replace({"material": {"mass_ratio": 0.2, "layers": 1}, "springs.left.sag_m": 0.02})
    by_sag = by_sag.replace({"springs.left.count": 3, "springs.right.sag_m": 0.02})
    assert by_sag.suspension.stiffness[1][1] == pytest.approx(weight / 0.02, rel=1e-14)
    frequency = (9.81 / 0.02) ** 0.5 / 6.283185307179586
    same = by_sag.replace({f"springs.{name}.natural_frequency_hz": frequency for name in ("left", "right")})
    assert same.suspension.stiffness[1][1] == pytest.approx(weight / 0.02, rel=1e-14)
    across = same.replace({"springs.left.stiffness_ratio": 0.5, "springs.left.off": False})
    assert across.suspension.stiffness[0][0] == pytest.approx(0.5 * 0.75 * weight / 0.02 + 12714.0, rel=1e-14)


def test_keys_of_springs_are_keys_as_others(conveyor):
    assert key_of(LEFT).name == "springs.NAME.stiffness_y_n_per_m"
    assert (number_of(LEFT), number_of("springs.left.count")) == (float, int)
    assert LEFT in varied_keys(conveyor)
    assert LEFT in tolerances_of_keys(conveyor, {"springs": 0.1})[0]
    assert axis_label(LEFT, "N/m") == "stiffness y of spring left (N/m)"
    assert value_words(LEFT, 7e3) == "stiffness y of spring left 7000 N/m"
    schema = json.dumps(configuration_schema()["properties"]["springs"])
    assert '"additionalProperties": false' in schema


def test_more_springs_than_are_measured(conveyor):
    one = conveyor.to_tree()["springs"]["left"]
    many = {f"s{i}": one | {"position_m": [0.1 * i - 0.5, -0.1]} for i in range(11)}
    scene = conveyor.replace({"springs": many, "output.points": {"tip": [1.0, 0.0]}})
    assert len(scene.measured_points) == 8
    assert list(scene.measured_springs) == ["left", "right", *(f"s{i}" for i in range(5))]


def test_the_machine_is_drawn_as_it_stands(conveyor):
    machine = machine_of(conveyor)
    sizes = Sizes.of(machine)
    assert sizes.springs == [(-100.0, -30.0), (100.0, -30.0)]
    assert drawing(machine, "x").count('class="spring"') == 2
    more = conveyor.to_tree()["springs"]["left"] | {"off": True}
    assert drawing(machine_of(conveyor.replace({"springs.broken": more})), "x").count('opacity="0.25"') == 1
    screen = load_config(ROOT / "configs/templates/inclined-screen.yaml")
    assert 'transform="rotate(15)"' in drawing(machine_of(screen), "x")
    wide = Sizes.of(machine_of(screen.replace({"transport.deck_length_m": 4.0})))
    assert wide.scale == 50.0
    assert wide.top - wide.bottom < 100.0
