"""The least power of the calibrated machine for an amplitude, beside what other searches have found."""

from pathlib import Path

import pandas as pd
import pytest

from vibroplat import design, load_config, orbit
from vibroplat.config.digits import percent
from vibroplat.continuation.first_orbit import OrbitError
from vibroplat.errors import ConfigError

CALIBRATED = Path(__file__).parents[2] / "configs/machines/calibrated.yaml"
RADIUS, STIFFNESS, SUPPLY = "machine.unbalance_radius_m", "machine.stiffness_y_n_per_m", "drive.supply_frequency_hz"
PLAN = {
    "keys": {RADIUS: [0.018, 0.048], STIFFNESS: [329e3, 611e3], SUPPLY: [46.75, 60.5]},
    "minimize": "motor_power_w",
    "constraints": {"rms_y_m": ">= 1e-3", "stability_margin": ">= 0.005"},
}


def scene(**changes):
    keys = {SUPPLY: 55.0, "material.mass_ratio": 0.1, "solver.engine": "taylor", "design": PLAN | changes}
    return load_config(CALIBRATED, keys)


@pytest.fixture(scope="module")
def answer():
    return design(scene(starts=2, pareto={"rms_y_m": [0.8e-3, 1.2e-3]}))


def test_the_least_power_is_found_from_each_start(answer, tmp_path):
    """3.4307 W, as with derivative-free searches; the file that is written has it."""
    assert answer.answer.headline == "best: motor power 3.43 W with RMS y 1.00 mm, stability margin 0.0275"
    first, radius, *_ = answer.answer.short
    assert first == "found by 2 of 2 searches:"
    assert radius.startswith("machine.unbalance_radius_m ")
    assert radius.endswith(" 0.04407 m")
    assert answer.answer.lines["best"].startswith("machine.unbalance_radius_m 0.0440")
    assert answer.answer.lines["from rest"] == "antiphase, period 1, motor power 3.43 W, RMS y 1.00 mm"
    (note,) = answer.answer.notes
    assert note.startswith("computed by engine taylor")
    (tmp_path / "best.yaml").write_text(answer.configurations["best"], encoding="utf-8")
    best = load_config(tmp_path / "best.yaml")
    assert best.design is None
    assert orbit(best).measures["motor_power_w"] == pytest.approx(3.4307, abs=1e-4)


def test_all_that_was_looked_at_is_told(answer):
    table = answer.tables["evaluations"]
    assert set(table["start"]) == {0, 1}
    assert table.loc[table["feasible"], "motor_power_w"].min() == pytest.approx(3.4307, abs=1e-4)
    assert (table.loc[table["feasible"], "rms_y_m"] > 0.999e-3).all()
    assert (table["violation"] > 0.0).any()
    for key, (low, high) in PLAN["keys"].items():
        assert table[key].between(low * (1.0 - 1e-9), high * (1.0 + 1e-9)).all()


def test_what_cannot_settle_is_refused():
    with pytest.raises(OrbitError, match="does not converge to a periodic orbit"):
        design(scene().replace({SUPPLY: 60.0, "material.mass_ratio": 0.2}))


def test_more_amplitude_costs_more_power(answer):
    front = answer.tables["pareto"]
    assert front["feasible"].all()
    assert front["rms_y_m"].tolist() == pytest.approx([0.8e-3, 1.2e-3], rel=1e-6)
    assert front["motor_power_w"].tolist() == pytest.approx([2.35367, 4.49183], rel=1e-4)


def test_the_worst_scene_of_a_tolerance_counts():
    """The mass 5 % off to either side: the nominal machine has amplitude to spare, and takes less power."""
    plan = {"parameter_tolerances": {"machine.platform_mass_kg": 0.05}, "starts": 1, "samples": 10}
    found = design(scene(**plan))
    assert found.answer.headline.startswith("best: motor power 4.38 W with RMS y 1.18 mm")
    assert found.answer.headline.endswith("; up to 5.79 W within the tolerances")
    kept = "100 % (74 % to 100 % with 95 % confidence)"
    assert f"10 machines within the tolerances: 100 % stable, {kept} within bounds" in found.answer.short
    assert found.answer.lines["constraints satisfied"] == kept
    table = found.tables["evaluations"]
    (best,) = table.index[table["best"]]
    assert table.loc[best, "objective"] == table.loc[table["feasible"], "objective"].min()
    assert table.loc[best, "objective"] > table.loc[best, "motor_power_w"] + 1.0
    samples = found.tables["samples"]
    assert samples["stable"].all()
    assert isinstance(samples, pd.DataFrame)
    assert samples["rms_y_m"].between(1e-3, 1.5e-3).all()


def test_a_box_without_a_design_is_an_answer():
    found = design(scene(starts=2, constraints={"rms_y_m": ">= 8e-3"}))
    assert found.answer.lines["closest"].startswith(f"{RADIUS} 0.0480000 m, machine.stiffness_y_n_per_m ")
    assert found.answer.headline == "no design in this box satisfies all constraints"
    assert found.answer.short[0].startswith("the closest one violates a bound by ")
    assert not found.tables["evaluations"]["feasible"].any()
    assert found.configurations == {}


def test_tolerances_that_break_a_bound_together_are_told():
    spread = {"machine.platform_mass_kg": 0.03, "machine.stiffness_y_n_per_m": 0.03}
    found = design(scene(parameter_tolerances=spread, starts=1, samples=40))
    kept = found.tables["samples"]["rms_y_m"] >= 1e-3 * (1.0 - 1e-6)
    assert found.answer.lines["constraints satisfied"].startswith(f"{percent(kept.mean())} (")
    assert 0.5 < kept.mean() < 1.0


def test_what_has_no_value_cannot_be_made_least():
    bare = scene(keys={"machine.platform_mass_kg": [10.0, 14.0]}, minimize="contact_force_max_n", constraints={})
    with pytest.raises(ConfigError, match="contact_force_max_n has no value for the motion of this scene"):
        design(bare.replace({"material.mass_ratio": 0.0}))


def test_a_tolerance_about_a_key_stays_within_the_model():
    share = scene(keys={"material.lower_share": [0.5, 0.99]}, parameter_tolerances={"material.lower_share": 0.1})
    with pytest.raises(
        ConfigError, match=r"lower_share = \[0.5, 0.99\] with design.parameter_tolerances.material.lower_share = 0.1: "
    ):
        design(share)


def test_a_box_to_which_the_orbit_cannot_be_followed_is_no_answer_on_its_designs():
    found = design(scene(keys={"motor.critical_torque_n_m": [0.001, 0.002]}, starts=2))
    assert found.answer.headline == "unknown: the orbit was lost on the way to every starting point of the search"
    assert found.tables["evaluations"].empty
    assert found.plot("evaluations").axes
