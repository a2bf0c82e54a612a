"""What is known before a run: formulas, the balance of torques, the averaged start, and the lines that say it."""

import math
import re

import numpy as np
import pytest
from common.commands import command

from vibroplat import Scene, load_config, simulate
from vibroplat.config.digits import quantity
from vibroplat.config.plausibility import WARNING
from vibroplat.config.reader import configurations
from vibroplat.inspection.balance import (
    balances,
    final_supply,
    holding_torque,
    speed_alone,
    speed_grid,
    while_driven,
)
from vibroplat.inspection.linear import amplitudes, amplitudes_alone, loaded_frequencies, platform_torques
from vibroplat.inspection.material import loaded_motion
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


@pytest.mark.long
@pytest.mark.parametrize(("changes", "expected"), [
    ({"drive.supply_frequency_hz": 66.0}, "in-phase"),
    ({"drive.supply_frequency_hz": 78.0}, "antiphase"),
    ({"motors": [{}, {"critical_torque_n_m": 0.0}]}, "antiphase"),
    ({"exciters.0.rotation": "clockwise"}, "in-phase"),
])  # fmt: skip
def test_expected_synchronization(changes, expected):
    base = {"machine": {"unbalance_radius_m": 0.03}}
    if "exciters.0.rotation" in changes:
        base, changes = {"exciters": [{"rotation": "clockwise"}, {"rotation": "clockwise"}]}, {}
    assert Scene.from_tree(base).replace(changes).inspect()["expected"] == expected


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
    assert "a start may be captured below 30.8 Hz" in str(found).splitlines()[0]


#: 0.4 t with motors at its ends: an angular resonance at 21.7 Hz, below 25 Hz.
ENDS = {
    "machine": {
        "platform_mass_kg": 400, "platform_inertia_kg_m2": 100, "stiffness_x_n_per_m": 1e6, "stiffness_y_n_per_m": 12e4,
        "stiffness_phi_n_m_per_rad": 1.9e6, "damping_x_n_s_per_m": 2700, "damping_y_n_s_per_m": 930,
        "damping_phi_n_m_s_per_rad": 1900,
    },
    "exciters": [
        {
            "position_m": [side * 0.54, 0.055], "unbalance_mass_kg": 4, "static_moment_kg_m": 0.237,
            "rotor_inertia_kg_m2": 0.003, "rated_power_w": 700, "rated_speed_rpm": 1430, "breakdown_ratio": 2.5,
            "rated_frequency_hz": 50, "pole_pairs": 2, "friction_radius_m": 2e-4,
        }
        for side in (1, -1)
    ],
    "material": {"mass_ratio": 0},
    "run": {"duration_s": 20, "initial": {"speed_ratio": 0}},
    "solver": {"engine": "taylor"},
}  # fmt: skip


@pytest.fixture(scope="module")
def ends():
    return Scene.from_tree(ENDS).inspect()


def test_a_start_passes_only_if_it_does_with_every_lag_on_the_way(ends, kernels):
    """A resonance of the other motion captures some: of runs with seeds 0 and 1 the second stays at 20.4 Hz.

    How many of the averaged starts are captured is not told: of runs it is another share, as they hang at first.
    """
    scene, found = Scene.from_tree(ENDS), ends
    first, second = (simulate(scene.replace({"run.seed": n})).summary["excitation_frequency_hz"] for n in (0, 1))
    assert first == pytest.approx(found["excitation_frequency_hz"], rel=2e-3)
    assert second < found["passage_frequency_hz"] == pytest.approx(21.7, abs=0.05)
    assert (found["expected"], found["start"], found["passage_axis"]) == ("antiphase", "may be captured", "phi")
    assert "a start may be captured below 21.7 Hz" in str(found).splitlines()[0]
    assert "12" not in str(found).partition("to pass")[2].partition("\n")[0]
    strong = scene.replace({"exciters.N.rated_power_w": 3000}).inspect()
    assert (strong["start"], "a start passes" in str(strong)) == ("passes", True)


def test_the_resonances_of_the_expected_motion_are_told(ends):
    """In phase the platform moves along x and φ, whose resonances lie above the speed, and not along y."""
    stiff = {"machine.stiffness_x_n_per_m": 12e6, "machine.stiffness_phi_n_m_per_rad": 5e6}
    found = Scene.from_tree(ENDS).replace(stiff | {"exciters.N.rated_power_w": 3000}).inspect()
    assert (found["expected"], found["moving_axes"]) == ("in-phase", "x, phi")
    assert "below resonances (x 27.3, φ 35.2 Hz)" in str(found)
    assert (ends["moving_axes"], ends["holding_axis"]) == ("y", "phi")
    assert "far above resonance (y 2.73 Hz)" in str(ends)
    assert "resonance of φ (21.7 Hz) decides" in str(ends)


@pytest.mark.parametrize(("name", "stroke", "throw", "force"), [
    ("screen", 3.0225e-3, 3.809, 829.75),
    pytest.param("heavy-screen", 6.46e-3, 3.54, 5181.2, marks=pytest.mark.long),
])  # fmt: skip
def test_loaded_templates_as_simulated(name, stroke, throw, force):
    found = load_config(CONFIGS / "templates" / f"{name}.yaml").inspect()
    assert found["loaded_expected"] == "antiphase"
    assert found["loaded_stroke_y_m"] == pytest.approx(stroke, rel=0.03)
    assert found["loaded_throw_index"] == pytest.approx(throw, rel=0.03)
    assert found["loaded_dynamic_force_y_n"] == pytest.approx(force, rel=0.02)  # half the range
    for load in ("loaded_", ""):
        speed, *_ = [quantity(found[f"{load}excitation_frequency_{i}_hz"], "Hz") for i in (1, 2)]
        assert (f"expected at {speed}" if load else f"empty {speed}") in str(found)


@pytest.mark.parametrize("changes", [
    pytest.param(
        {"drive": {"program": [{"t_s": 0, "supply_frequency_hz": 50}, {"t_s": 1, "off": True}]}}, marks=pytest.mark.long
    ),
    {"motor.critical_torque_n_m": 0.0},
    pytest.param({"machine.stiffness_x_n_per_m": 0.0, "machine.damping_x_n_s_per_m": 0.0}, marks=pytest.mark.long),
    pytest.param({"material": {"mass_ratio": 0.1, "layers": 1}, "contact.model": "non-impact"}, marks=pytest.mark.long),
    {"material": {"mass_ratio": 0.1, "layers": 1}, "transport": {"friction": 0.4, "deck_angle_deg": 5.0}},
    {"name": "m" * 100, "machine.gravity_m_per_s2": 0.0, "drive.supply_frequency_hz": 20.0},
])  # fmt: skip
def test_at_most_twelve_lines_for_every_machine(changes):
    found = Scene().replace(changes).inspect()
    lines = str(found).splitlines()
    assert len(lines) <= 12
    told = re.search(r"note: |warning: |notes?: -v|\(-v\)|more: -v", "\n".join(lines))
    assert bool(found.answer.notes) == bool(told)
    warnings = [note for note in found.answer.notes if note.startswith(WARNING)]
    assert all(note in " ".join(str(found).split()) for note in warnings)
    assert all(len(line) <= 110 and not re.search(r"\b(nan|inf)\b", line) for line in lines), lines


@pytest.mark.long
def test_an_exciter_that_stops_takes_no_part():
    found = load_config(CONFIGS / "examples" / "one-motor-off-stops.yaml").inspect()
    assert (found["expected"], found["excitation_frequency_2_hz"]) == ("none", 0.0)
    assert math.isnan(found["excitation_frequency_hz"])
    assert found["excitation_frequency_1_hz"] == pytest.approx(24.97, abs=0.005)  # as simulated, and so on
    assert found["motor_power_w"] == pytest.approx(3.16, rel=0.01)
    assert found["throw_index"] == pytest.approx(1.57, rel=0.03)
    assert found["centrifugal_force_2_n"] == found["friction_torque_2_n_m"] == 0.0
    assert "24.97 Hz and 0" in str(found).splitlines()[0]


def test_material_with_one_exciter():
    scene = load_config(CONFIGS / "templates" / "screen.yaml", {
        "drive": {"program": [{"t_s": 0, "supply_frequency_hz": 50, "exciter_2": "off"}]}
    })  # fmt: skip
    speed, supply = 2.0 * math.pi * 24.59, final_supply(scene)
    motion = loaded_motion(scene, speed, amplitudes_alone(scene, 0, speed)[1:2], settle=True)
    assert motion["stroke"] == pytest.approx(1.29e-3, rel=0.02)  # as simulated
    assert motion["force"] == pytest.approx(365.0, rel=0.02)
    loaded = speed_alone(scene, supply, 0, speed, complex(motion["carried"][0]))
    assert loaded == pytest.approx(speed, rel=2e-4)
    assert speed_alone(scene, supply, 1, speed) == 0.0


def test_exciters_at_two_speeds_are_told_apart():
    found = Scene(motors=[{}, {"pole_pairs": 3}], material={"mass_ratio": 0.2, "layers": 1}).inspect()
    first, second = (found[f"excitation_frequency_{i}_hz"] for i in (1, 2))
    assert (first, second) == (pytest.approx(25.0, rel=0.01), pytest.approx(16.67, rel=0.01))
    assert (found["expected"], found["loaded_expected"]) == ("none", "none")
    assert math.isnan(found["phase_difference_rad"])
    assert math.isnan(found["loaded_stroke_y_m"])
    assert "–, no common speed" in str(found)


def test_what_a_run_does_not_reach_is_not_expected():
    """Of a ramp that goes on beyond it, the frequency at its end."""
    on, off = {"t_s": 0.0, "supply_frequency_hz": 40.0}, {"t_s": 3.0, "exciter_2": "off"}
    scene = Scene().replace({"drive.program": [on, off]})
    assert scene.replace({"run.duration_s": 2.0}).inspect() == pytest.approx(
        Scene().replace({"drive.supply_frequency_hz": 40.0}).inspect(), nan_ok=True
    )
    assert scene.replace({"run.duration_s": 5.0}).inspect()["excitation_frequency_2_hz"] == 0.0
    ramp = Scene().replace({"drive.program": [on, {"t_s": 8.0, "supply_frequency_hz": 80.0}], "run.duration_s": 2.0})
    assert ramp.inspect()["supply_frequency_hz"] == 50.0


def test_a_start_is_judged_before_the_motors_go_off():
    supply = [{"t_s": 0.0, "supply_frequency_hz": 50.0}]
    scene = load_config(
        CONFIGS / "templates" / "screen.yaml", {"material.mass_ratio": 0.0, "drive": {"program": supply}}
    )
    found = scene.replace(drive={"program": [*supply, {"t_s": 4, "off": True}]}).inspect()
    assert found["passage_ratio"] < 0.2
    lines = str(found).splitlines()
    assert "; a start passes; driven until 4.00 s; far above" in lines[0]
    assert "to pass" in lines[7]
    ramp = [{"t_s": 0.0, "supply_frequency_hz": 0.0}, {"t_s": 2.0, "supply_frequency_hz": 80.0}]
    short = Scene(drive={"program": [*ramp, {"t_s": 2.0, "off": True}]})
    assert final_supply(short).frequency == 80.0
    assert while_driven(short).drive.intervals[-1].driven == (True, True)


@pytest.mark.parametrize(
    ("ratio", "stroke", "force", "moves"), [(2.0, 0.993e-3, 279.3, 1.03), (3.0, 0.76e-3, 211.5, 1.0)]
)
def test_heavy_material_is_measured_when_it_has_settled(ratio, stroke, force, moves):
    changes = {"material.layers": 1, "material.mass_ratio": ratio}
    scene = load_config(CONFIGS / "templates" / "screen.yaml", changes)
    speed = 2.0 * math.pi * 24.62
    motion = loaded_motion(scene, speed, amplitudes(scene, speed, np.array([math.pi]))[:, 1], settle=True)
    assert motion["stroke"] == pytest.approx(stroke, rel=0.02)  # as simulated
    assert motion["force"] == pytest.approx(force, rel=0.05)
    assert motion["carried"].real == pytest.approx(moves * scene.material_mass, rel=0.02)
    assert (motion["change"] < 0.01).all()


def test_the_damper_of_material_is_not_on_the_foundation():
    contact = {"model": "non-impact", "viscous_per_mass_per_s": 20.0, "added_mass_share": 0.5}
    found = Scene(material={"mass_ratio": 0.2, "layers": 1}, contact=contact).inspect()
    w = 2.0 * math.pi * found["excitation_frequency_hz"]
    assert found["dynamic_force_y_n"] == pytest.approx(0.5 * found["stroke_y_m"] * abs(RIG["c"] + 1j * w * RIG["b"]))
    assert "2.50 kg of material cannot lift off" in str(found)


def test_command(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(
        "motor: {critical_torque_n_m: 2}\nmachine: {gravity_m_per_s2: 900}\nrun: {initial: {speed_ratio: 0}}\n"
    )
    done = command("inspect", str(file), "-v", "--set", "drive.supply_frequency_hz=40")
    assert done.code == 0
    assert done.out.startswith("mine: in-phase expected at 19.7")
    assert "warning: machine: platform_mass_kg" in done.out
    assert done.out.index("warning: machine: ") < done.out.index("each motor gives")
    assert "torque to lift unbalance 1" in done.out
    brief = command("inspect", str(file), "--set", "drive.supply_frequency_hz=40").out.splitlines()
    assert len(brief) <= 12
    assert max(map(len, brief)) <= 110
    assert any(line.startswith("  warning: machine: platform_mass_kg") for line in brief)
    wrong = command("inspect", str(file), "--set", "motor.critical_torque_n_m=-1")
    assert wrong.code == 2
    assert "critical_torque_n_m" in wrong.err


def test_a_motor_that_fails_is_held_by_the_platform_as_a_run_shows():
    """Runs of 60 s stay at 16.322 Hz; with averaged steps 2.5 times as long the exciter would seem to stop."""
    failing = [{"t_s": 0.0, "supply_frequency_hz": 50.0}, {"t_s": 10.0, "exciter_2": "off"}]
    friction = {f"exciters.{i}.friction_radius_m": 1.26e-4 for i in (0, 1)}
    changes = {"drive.program": failing, "material.mass_ratio": 0.0, **friction}
    found = load_config(CONFIGS / "templates/heavy-screen.yaml", changes).inspect()
    assert found["expected"] == "antiphase"
    assert found["excitation_frequency_2_hz"] == pytest.approx(16.322, rel=1e-3)


def test_co_rotating_exciters_that_only_rock_the_machine_are_noted():
    """The distance is where the forces of both are a quarter of a turn apart, far above resonances."""

    def noted(half):
        exciters = {
            f"exciters.{i}": {"rotation": "clockwise", "position_m": [x, 0.5]} for i, x in enumerate((half, -half))
        }
        found = load_config(CONFIGS / "templates" / "screen.yaml", {"material.mass_ratio": 0.0} | exciters).inspect()
        rocks = [note for note in found.answer.notes if "rock the machine" in note]
        return found["phase_difference_rad"], rocks

    phase, (note,) = noted(0.25)
    assert abs(phase) > 2.9
    assert re.search(r"strokes are 9\.\d % of .* 2\.31 m apart and more on the same line, instead of 0\.500 m", note)
    assert noted(1.17)[1] == []
    assert abs(noted(1.16)[0]) == pytest.approx(0.5 * math.pi, abs=0.05)


def test_flights_longer_than_a_period_are_noted_where_material_is_conveyed():
    feeder = load_config(CONFIGS / "examples" / "conveying.yaml")
    fast = feeder.replace({"drive.supply_frequency_hz": 80.0})
    assert [sum("above 3.30 a flight" in note for note in one.inspect().answer.notes) for one in (feeder, fast)] == [
        0,
        1,
    ]
