"""Material that moves along the deck: reference motions, closed forms, balances, both engines."""

import math

import numpy as np
import pandas as pd
import pytest
from common.places import ROOT
from common.references import REFERENCES

from vibroplat import load_config, simulate
from vibroplat.errors import ConfigError

NAMES = ("feeder-inclined-line", "stick-slip-no-flight", "inclined-screen-two-layers")
#: Tolerance of each engine, errors of coordinates and forces over their largest value, and errors of time (s).
ENGINES = [("taylor", 1e-12, 1e-10, 1e-10), ("native", 1e-9, 1e-6, 1e-6), ("sundae", 1e-9, 1e-6, 1e-6)]

GRAVITY = 9.81


def reference(name):
    """Return the scene of a reference, its events and its trajectory without rows at events."""
    events, trajectory = (pd.read_csv(REFERENCES / f"{name}.{kind}.csv") for kind in ("events", "trajectory"))
    return load_config(REFERENCES / f"{name}.yaml"), events, trajectory


@pytest.mark.parametrize(("engine", "tolerance", "error", "seconds"), ENGINES, ids=[e[0] for e in ENGINES])
@pytest.mark.parametrize("name", NAMES)
def test_reference(name, engine, tolerance, error, seconds):
    scene, events, trajectory = reference(name)
    run = simulate(scene.replace({"solver": {"engine": engine, "tolerance": tolerance}}))
    found, near = run.events, 3.0 * error  # an impact soon after a liftoff is moved by more than others
    assert found["kind"].to_list() == events["kind"].to_list()
    assert found["mode_after"].to_list() == events["mode_after"].to_list()
    assert np.abs(found["t_s"] - events["t_s"]).max() <= seconds
    for column in (c for c in events if c.endswith(("_n_s", "_n", "_m_per_s", "_j"))):
        size = trajectory["contact_force_n"].max() if column.endswith("_n") else max(events[column].abs().max(), 1e-3)
        np.testing.assert_allclose(found[column], events[column], rtol=0.0, atol=near * size)
    there = run(trajectory["t_s"].to_numpy())
    for column in trajectory.columns.drop(["t_s", "mode"]):
        apart = np.abs(there[column] - trajectory[column]).max()
        assert apart <= error * trajectory[column].abs().max(), column
    assert run.summary["energy_residual"] <= 100.0 * tolerance
    assert run.summary["momentum_along_residual"] <= 100.0 * tolerance


@pytest.mark.parametrize(("engine", "tolerance", "least"), [
    ("taylor", 1e-12, 1e-12),
    ("native", 1e-9, 1e-9),
])  # fmt: skip
@pytest.mark.parametrize("layers", [1, 2])
def test_symmetric_antiphase_conveys_nothing(engine, tolerance, least, layers):
    """Forces along y alone leave the material where it is, whatever the friction; it lifts off without a slip."""
    scene = load_config(REFERENCES / f"{NAMES[0]}.yaml")
    pair = scene.to_tree()["exciters"]
    for exciter, x in zip(pair, (0.1, -0.1), strict=True):
        exciter["position_m"] = [x, 0.02]
    start = {"phase_difference_rad": math.pi, "speed_ratio": 0.98}
    changes = {"exciters": pair, "run": {"duration_s": 0.5, "initial": start, "perturbation": 0.0}}
    changes["material"] = {"mass_ratio": 0.2, "layers": layers}
    if layers == 2:
        changes["material"] |= {"natural_frequency_hz": 30.0, "damping_ratio": 0.2}
    run = simulate(scene.replace(changes).replace({"solver": {"engine": engine, "tolerance": tolerance}}))
    assert run.summary["impacts"] > 3
    assert set(run.events["kind"]) == {"liftoff", "impact"}
    assert run.summary["contact_pull_n"] < 1e-3
    assert np.abs(run.trajectory["along_m"]).max() < least


def test_an_inclined_machine_at_rest_stays_so_and_holds_its_material():
    """Its unbalances hang straight down, not perpendicular to the deck."""
    off = [{"t_s": 0.0, "supply_frequency_hz": 50.0, "off": True}]
    rest = {"run": {"duration_s": 0.3, "initial": {"speed_ratio": 0.0}}, "transport.deck_angle_deg": 15.0}
    scene = load_config(ROOT / "configs/templates/inclined-screen.yaml", rest | {"drive.program": off})
    run = simulate(scene)
    assert run.summary["stick_fraction"] == 1.0
    assert max(run.summary[f"whole_stroke_{axis}_m"] for axis in "xy") < 1e-9
    pressed = run.trajectory[["friction_force_n", "contact_force_n"]].iloc[-1]
    assert abs(pressed["friction_force_n"]) == pytest.approx(
        math.tan(math.radians(15.0)) * pressed["contact_force_n"], rel=1e-6
    )


def test_friction_of_impacts_is_in_work_and_power_of_friction():
    """What friction takes in an impact is its impulse times the mean of the velocities before and after."""
    run = simulate(load_config(ROOT / "configs/templates/feeder.yaml", {"run.duration_s": 3.0}))
    events, s = run.events, run.summary
    velocities = events["along_rate_before_m_per_s"] + events["along_rate_after_m_per_s"]
    rubbed = (-0.5 * events["friction_impulse_n_s"] * velocities)[events["kind"].isin(["impact", "chatter"])]
    assert s["impact_loss_j"] + rubbed.sum() == pytest.approx(events["energy_loss_j"].sum(), rel=1e-12)
    late = run.events["t_s"].between(s["measured_from_s"], s["measured_to_s"])
    power = rubbed[late].sum() / (s["measured_to_s"] - s["measured_from_s"])
    assert 0.5 * s["friction_power_w"] < power < s["friction_power_w"], "more than sliding in this machine"
    assert s["friction_work_j"] > rubbed.sum()


def test_slow_impacts_of_sliding_material_stick():
    scene = load_config(REFERENCES / f"{NAMES[0]}.yaml")
    run = simulate(scene.replace({"contact": {"restitution": 0.4, "restitution_threshold_m_per_s": 0.3}}))
    impacts = run.events[run.events["kind"] == "impact"]
    before, after = impacts["gap_rate_before_m_per_s"], impacts["gap_rate_after_m_per_s"]
    slow = before > -0.3
    assert min(slow.sum(), (~slow).sum()) > 2
    np.testing.assert_allclose(after, np.where(slow, 0.0, -0.4 * before), rtol=1e-12)


@pytest.mark.parametrize(("changes", "told"), [
    ({"material.mass_ratio": 0.0}, "material.mass_ratio = 0.0 does not go with transport; allowed: more than 0"),
    ({"contact.model": "non-impact"}, "contact.model = non-impact does not go with transport; allowed: impact"),
    ({"contact.impact_law": "central"}, "contact.impact_law = central does not go with transport"),
    ({"transport.deck_angle_deg": 25.0}, "allowed with this friction: up to 24.23"),
    ({"transport.static_friction": 0.1}, "static_friction = 0.1; allowed: at least friction = 0.4"),
])  # fmt: skip
def test_refused(changes, told):
    with pytest.raises(ConfigError, match=told.replace("(", r"\(")):
        load_config(REFERENCES / f"{NAMES[0]}.yaml").replace(changes)


def test_orbits_are_refused_in_one_line():
    from vibroplat import lyapunov, orbit

    scene = load_config(REFERENCES / f"{NAMES[0]}.yaml")
    for function in (orbit, lyapunov):
        with pytest.raises(ConfigError, match="cannot be computed with transport"):
            function(scene)


#: Throw index, from the stroke along y, and conveying speed over the amplitude of the velocity along x, of a feeder
#: with a line of action of 30°, mass ratio 0.2 and friction 0.4, by an independent computation; and the radius.
FEEDER = [(0.0215, 0.94, 0.49), (0.0481, 2.26, 0.79), (0.0664, 3.3, 0.99)]


def test_speed_of_a_feeder_over_its_throw_index():
    scene = load_config(REFERENCES / f"{NAMES[0]}.yaml")
    start = {"phase_difference_rad": 1.0, "speed_ratio": 0.98}
    level = {"friction": 0.4, "static_friction": 0.4, "deck_height_m": 0.0}
    common = {"transport": level, "run": {"duration_s": 30.0, "initial": start}, "solver.engine": "taylor"}
    for radius, throw, ratio in FEEDER:
        tree = scene.to_tree()
        for exciter in tree["exciters"]:
            exciter["unbalance_radius_m"] = radius
        del tree["run"]
        summary = simulate(type(scene).from_tree(tree).replace(common), keep="summary").summary
        omega = 2.0 * math.pi * summary["excitation_frequency_hz"]
        assert 0.5 * summary["stroke_y_m"] * omega**2 / GRAVITY == pytest.approx(throw, rel=0.01)
        speed = summary["conveying_speed_m_per_s"] / (0.5 * summary["stroke_x_m"] * omega)
        assert speed == pytest.approx(ratio, rel=0.02, abs=0.005)
