"""Sensitivities against differences of orbits, and samples against motions that settle."""

from pathlib import Path

import numpy as np
import pytest

from vibroplat import design, load_config, orbit
from vibroplat.designs.question import Design
from vibroplat.designs.sensitivities import settling
from vibroplat.errors import ConfigError
from vibroplat.study.point import measure_point

CALIBRATED = Path(__file__).parents[2] / "configs/machines/calibrated.yaml"
KEYS = ("machine.platform_mass_kg", "machine.stiffness_y_n_per_m", "material.mass_ratio")


@pytest.fixture(scope="module")
def scene():
    """Flight, and not far from a period doubling."""
    changes = {"drive.supply_frequency_hz": 57.4, "material.mass_ratio": 0.1, "solver.engine": "taylor"}
    return load_config(CALIBRATED, changes)


def test_elasticities_are_those_of_orbits_at_other_values(scene):
    found = orbit(scene)
    table = found.sensitivities(KEYS).set_index(["measure", "key"])
    assert set(table.index.get_level_values("measure")) >= {"rms_y_m", "motor_power_w", "contact_force_max_n", "margin"}
    for key, value in zip(KEYS, (12.42, 470e3, 0.1), strict=True):
        ends = [orbit(scene.replace({key: value * (1.0 + h)}), found, tolerance=1e-10) for h in (1e-3, -1e-3)]
        for name in ("rms_y_m", "motor_power_w", "excitation_frequency_hz"):
            above, below = (end.measures[name] for end in ends)
            difference = (above - below) / 2e-3 / found.measures[name]
            row = table.loc[(name, key)]
            assert row["elasticity"] == pytest.approx(difference, rel=2e-3)
            assert row["derivative"] == pytest.approx(row["elasticity"] * found.measures[name] / value)


def test_all_keys_that_matter_are_varied_if_none_are_named(scene):
    table = orbit(scene).sensitivities(measures=["rms_y_m"])
    keys = set(table["key"])
    assert {"machine.gravity_m_per_s2", "motor.critical_slip", "material.damping_ratio", *KEYS} <= keys
    assert not keys & {"contact.restitution", "contact.added_mass_share", "machine.restitution"}
    assert np.isfinite(table["derivative"]).all()


@pytest.fixture(scope="module")
def spread(scene):
    """The same with tolerances."""
    return scene.replace({"design": {"spread": dict.fromkeys(KEYS, 0.05), "samples": 60}})


def test_samples_are_what_motions_settle_to(spread):
    """Those that lose the orbit too: without them nearly all would look stable."""
    answer = design(spread)
    table = answer.tables["samples"]
    assert len(table) == 60
    assert 2 < (~table["stable"]).sum() < 20
    assert table["regime"].str.startswith("antiphase").all()
    for _, row in table.iloc[::7].iterrows():
        place = {key: row[key] for key in KEYS}
        point = measure_point(spread.replace(place), settling(spread), None, (0,)).row
        assert (point["period"] == 1) == row["stable"]
        assert row["rms_y_m"] == pytest.approx(point["rms_y_m"], rel=1e-4 if row["stable"] else 0.1)
    assert answer.lines["orbit stable"] == f"{100.0 * table['stable'].mean():.1f} %"


@pytest.mark.parametrize(
    ("plan", "told"),
    [
        (
            {"keys": {"machine.mass": [1.0, 2.0]}},
            "design.keys.machine.mass cannot be varied; allowed: ",
        ),
        ({"measures": ["rms_z_m"]}, "design: rms_z_m is no measure of this scene; allowed: margin, excitation_"),
        ({"keys": {KEYS[0]: [2.0, 2.0]}}, f"design: keys.{KEYS[0]} = [2.0, 2.0] is empty; allowed: [low, high]"),
        ({"spread": {"material.lower_share": 0.9}}, "design.spread.material.lower_share = 0.9: material.lower_share ="),
        ({"subject": {"rms_y_m": "1"}}, "design: subject.rms_y_m = '1' is no bound; allowed: \">= NUMBER\""),
        ({"minimize": "rms_y_m"}, "design: minimize is given without keys; allowed: with keys and their ranges"),
    ],
)
def test_what_cannot_be_asked_is_told_in_a_line(scene, plan, told):
    with pytest.raises(ConfigError) as caught:
        Design(scene.replace({"design": plan}))
    assert str(caught.value).startswith(told)
    assert "\n" not in str(caught.value)
