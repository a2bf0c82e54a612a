"""Thresholds of a key: starts through a resonance, stability that is lost, levels, and what is no threshold."""

import re
from pathlib import Path

import pytest

from vibroplat import find, load_config
from vibroplat.errors import ConfigError
from vibroplat.plots.command import draw_results
from vibroplat.results.result import Result
from vibroplat.thresholds.study import ThresholdStudy

CONFIGS = Path(__file__).parents[2] / "configs"
MASS = {"key": "material.mass_ratio", "start": 0.02, "stop": 0.6}
TORQUE = {"key": "motor.critical_torque_n_m", "start": 1.2, "stop": 1.9, "scan": 8, "tolerance": 1e-4}


@pytest.fixture(scope="module", autouse=True)
def _compiled(kernels):
    """Compile before any of the tests."""


def start():
    """A start from rest through the resonance, the same for all seeds."""
    changes = {"solver.engine": "taylor", "machine.damping_y_n_s_per_m": 100.0, "run.perturbation": 0.0}
    return load_config(CONFIGS / "examples/start-captured.yaml").replace(changes | {"find": TORQUE})


def loaded(supply, **plan):
    """The calibrated machine with a mass ratio of 0.3."""
    changes = {"solver.engine": "taylor", "drive.supply_frequency_hz": supply, "material.mass_ratio": 0.3}
    return load_config(CONFIGS / "machines/calibrated.yaml").replace(changes | {"find": MASS | plan})


def test_the_smallest_torque_that_passes_the_resonance_is_told_by_where_the_motion_ends():
    found = find(start())
    (row,) = found.thresholds.to_dict("records")
    assert (row["kind"], row["special_point"]) == ("jump", "")
    assert row["value"] == pytest.approx(1.53784, abs=1e-4)  # bisected by the attractor of each start alone
    assert 0.0 < row["above"] - row["below"] <= 1e-4
    assert (row["below_sync"], row["above_sync"]) == ("antiphase", "in-phase")
    assert found.scan["motor.critical_torque_n_m"].is_monotonic_increasing
    assert found.answer.headline == "motor.critical_torque_n_m = 1.53784 ± 0.00005 N·m: jump"
    below, above, slow, takes = found.answer.short
    assert below.startswith("below  antiphase, period 1: ")
    assert above.startswith("above  in-phase, period 1: ")
    assert slow.endswith(f" in {row['tried_below']} of {row['tried_below']} → 0 of {row['tried_above']} starts")
    hangs = r"; at 1\.5377\d N·m it hangs for ever, on a stable orbit"
    assert re.fullmatch(r"a start at 1\.5378\d N·m takes \d\.\d s \(1 measured\)" + hangs, takes)


@pytest.mark.parametrize(("supply", "expected"), [(58.0, [0.05528, 0.511134]), (60.0, [0.202220, 0.410803])])
def test_the_window_of_a_motion_ends_where_its_orbit_loses_its_stability(supply, expected):
    answer = find(loaded(supply, **{"from": "previous", "start": 0.0}))  # without layers at its start
    found = answer.thresholds
    assert f"{expected[0]:.5f}" in answer.answer.short[0], "the special point is known better than values beside it"
    assert found["special_point"].tolist() == ["period-doubling", "branch-point"]
    assert found["value"].tolist() == pytest.approx(expected, abs=1e-5)  # from branches of orbits


def test_a_start_may_be_what_varies():
    """The machine without material comes to either of two motions."""
    plan = {"key": "run.initial.phase_difference_rad", "start": 1.0, "stop": 3.0, "scan": 3, "tolerance": 0.05}
    (row,) = find(
        loaded(62.3, **plan).replace({"material.mass_ratio": 0.0, "run.perturbation": 0.0})
    ).thresholds.to_dict("records")
    assert (row["below_sync"], row["above_sync"], row["kind"]) == ("in-phase", "antiphase", "jump")


@pytest.mark.parametrize("begin", ["initial", "previous"])
def test_a_measure_passes_a_level(begin):
    plan = {"expression": "rms_y_m > 7e-4", "scan": 5, "start": 0.2, "stop": 0.4, "tolerance": 1e-6, "from": begin}
    found = find(loaded(58.0, **plan))
    (row,) = found.thresholds.to_dict("records")
    known = "0.3302769 ± 0.0000004: level-crossing; rms_y_m > 7e-4 below"
    assert found.answer.headline.endswith(known), "no digits beyond the error, and where the expression holds"
    assert any("seed 0 only" in note for note in found.answer.notes) == (begin == "previous")
    assert found.scan["seed"].nunique() > 1 or begin == "previous", "a sharp value is challenged"
    assert [line[:35] for line in found.answer.short] == ["on both sides  rms_y_m = 0.70000 mm"]
    assert (row["kind"], row["value"]) == ("level-crossing", pytest.approx(0.3302756, abs=2e-6))
    assert row["below_rms_y_m"] > 7e-4 > row["above_rms_y_m"]


@pytest.mark.parametrize(("expression", "told"), [("rms_y_m > 1", "false"), ("rms_y_m <= 1", "true")])
def test_what_never_changes_is_an_answer(expression, told):
    found = find(loaded(58.0, expression=expression, scan=2, start=0.2, stop=0.3))
    assert found.thresholds.empty
    assert found.answer.headline == (
        f"no threshold: {expression} is {told} in all 14 starts from material.mass_ratio = 0.2 to 0.3"
    )
    assert found.answer.short == ["up to 0.0083 apart: between them nothing is known"]


@pytest.mark.parametrize(
    ("plan", "told"),
    [
        ({"key": "material.mass"}, "find: unknown key material.mass; did you mean mass_kg?"),
        ({"start": 0.6}, "find: stop = 0.6 is not above start = 0.6"),
        ({"scale": "log", "start": 0.0}, "find: scale = log but start = 0.0"),
        ({"key": "sweep.seed"}, "find: key = 'sweep.seed' cannot be varied"),
        ({"expression": "rms_y_m = 1"}, "find: expression = 'rms_y_m = 1'; allowed: column > number"),
        ({"expression": "rms_y > 1"}, "find.expression: no column rms_y; did you mean rms_y_m"),
        ({"expression": "sync > 1"}, "find.expression: no column sync"),
        ({"expression": "wall_s > 1"}, "find.expression: no column wall_s"),
        ({"start": -0.1}, "find: material.mass_ratio = -0.1"),
        (
            {"key": "motor.pole_pairs", "start": 1.0, "stop": 3.0},
            "find: motor.pole_pairs = 1.0; allowed: a whole number",
        ),
        ({"max_settle_s": 1e20}, "find.max_settle_s = 2e+20 takes"),
    ],
)
def test_a_mistake_is_told_in_one_line(plan, told):
    with pytest.raises(ConfigError) as caught:
        ThresholdStudy(loaded(58.0, **plan))
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_program_must_end_with_a_supply():
    stops = [{"t_s": 0.0, "supply_frequency_hz": 66.0}, {"t_s": 1.0, "off": True}]
    with pytest.raises(ConfigError, match="ends without supply"):
        ThresholdStudy(start().replace({"drive.program": stops}))


def test_the_command_writes_tables_and_prints_the_answer_and_plot_draws_it(command, tmp_path):
    (tmp_path / "c.yaml").write_text(
        f"extends: {CONFIGS / 'machines/calibrated.yaml'}\nname: c\ndrive: {{supply_frequency_hz: 58.0}}\n"
        "find: {key: material.mass_ratio, start: 0.2, stop: 0.4, scan: 3, tolerance: 0.01, expression: rms_y_m>7e-4}\n"
    )
    done = command("find", tmp_path / "c.yaml", "--engine", "taylor", "--out", tmp_path)
    assert done.code == 0
    assert "material.mass_ratio = 0.328" in done.out
    assert "level-crossing" in done.out
    drawn = command("plot", tmp_path / "c", "--measure", "rms_y_m", "--measure", "motor_power_w")
    assert (drawn.code, drawn.out.split()) == (0, [str(tmp_path / "c/find/thresholds.png")])
    columns = ["rms_y_m", "rms_x_m", "phase_difference_rad"]
    ((name, figure),) = draw_results([Result.read(tmp_path / "c", "find")], measure=columns)
    assert name == "thresholds"
    assert [axis.get_ylabel() for axis in figure.axes] == ["RMS $y$ (mm)", "RMS $x$ (mm)", r"$\Delta\varphi$"]
    levels = [line.get_ydata()[0] for line in figure.axes[0].lines if line.get_linestyle() == ":"]
    assert levels == [pytest.approx(0.7e-3)]
    assert figure.axes[1].get_ylim()[1] > 1e-5, "round-off is drawn as none"
    assert figure.axes[0].get_title("left").startswith("c: $f_e$ = 58 Hz, two layers, $R$ = 0")
    assert command("plot", tmp_path / "c", "--measure", "sync").code == 2
