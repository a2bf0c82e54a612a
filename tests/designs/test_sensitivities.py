"""Sensitivities against differences of orbits, and samples against motions that settle."""

from pathlib import Path

import numpy as np
import pytest

from vibroplat import design, load_config, orbit
from vibroplat.config.digits import percent
from vibroplat.designs.sensitivities import settling_plan
from vibroplat.designs.study import DesignStudy
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
    assert set(table.index.get_level_values("measure")) >= {
        "rms_y_m",
        "motor_power_w",
        "contact_force_max_n",
        "stability_margin",
    }
    for key, value in zip(KEYS, (12.42, 470e3, 0.1), strict=True):
        shares = (2e-3, -2e-3, 1e-3, -1e-3)
        ends = [orbit(scene.replace({key: value * (1.0 + h)}), found, tolerance=1e-11) for h in shares]
        for name in ("rms_y_m", "motor_power_w", "contact_force_max_n", "excitation_frequency_hz", "stability_margin"):
            nominal, *far, above, below = (measured(end, name) for end in (found, *ends))
            wide, narrow = (far[0] - far[1]) / 4e-3, (above - below) / 2e-3
            row = table.loc[(name, key)]
            assert row["elasticity"] == pytest.approx((4.0 * narrow - wide) / 3.0 / nominal, rel=1e-5)
            assert row["derivative"] == pytest.approx(row["elasticity"] * nominal / value)


def measured(found, name):
    """Measure of an orbit, with the margin."""
    return 1.0 - abs(found.multipliers[0]) if name == "stability_margin" else found.measures[name]


def test_a_phase_difference_has_a_derivative_across_pi_and_no_elasticity(scene):
    equal = scene.replace({"material.mass_ratio": 0.0, "exciters": [{}, {}]})
    key, value = "exciters.0.unbalance_radius_m", equal.exciter_pair[0].unbalance_radius_m
    found = orbit(equal)
    row = found.sensitivities([key], ["phase_difference_rad"]).iloc[0]
    assert row["value"] == pytest.approx(np.pi)
    above, below = (orbit(equal.replace({key: value * (1.0 + h)}), found).measures for h in (1e-3, -1e-3))
    turned = np.angle(np.exp(1j * (above["phase_difference_rad"] - below["phase_difference_rad"])))
    assert row["derivative"] == pytest.approx(turned / (2e-3 * value), rel=1e-3)
    assert np.isnan(row["elasticity"])


def test_all_keys_that_matter_are_varied_if_none_are_named(scene):
    table = orbit(scene).sensitivities(measures=["rms_y_m"])
    keys = set(table["key"])
    assert {"machine.gravity_m_per_s2", "motor.critical_slip", "material.damping_ratio", *KEYS} <= keys
    assert not keys & {"contact.restitution", "contact.added_mass_share", "machine.restitution"}
    assert np.isfinite(table["derivative"]).all()


@pytest.fixture(scope="module")
def spread(scene):
    """The same with tolerances."""
    return scene.replace({"design": {"parameter_tolerances": dict.fromkeys(KEYS, 0.05), "samples": 60}})


def test_samples_are_what_motions_settle_to(spread):
    """Those that lose the orbit too: without them nearly all would look stable."""
    result = design(spread)
    table = result.samples
    assert len(table) == 60
    assert 2 < (~table["stable"]).sum() < 20
    assert table["regime"].str.startswith("antiphase").all()
    for _, row in table.iloc[::7].iterrows():
        place = {key: row[key] for key in KEYS}
        point = measure_point(spread.replace(place), settling_plan(spread), None, (0,)).row
        assert (point["period"] == 1) == row["stable"]
        assert row["rms_y_m"] == pytest.approx(point["rms_y_m"], rel=1e-4 if row["stable"] else 0.1)
    assert result.answer.lines["orbit stable"] == percent(table["stable"].mean())


def test_shares_of_the_variance_are_those_of_the_slopes_where_a_spread_is_small(scene):
    small = dict.fromkeys(KEYS, 1e-4)
    found = design(scene.replace({"design": {"parameter_tolerances": small, "samples": 64}})).tables
    slopes, shares = (found[name].set_index(["measure", "key"]) for name in ("sensitivities", "variance_contributions"))
    for measure in ("rms_y_m", "motor_power_w"):
        parts = np.array([slopes.loc[(measure, key), "elasticity"] for key in KEYS]) ** 2
        own = shares.loc[measure].loc[list(KEYS)]
        assert own["explained"].iloc[0] > 0.999
        assert own["regression"].to_numpy() == pytest.approx(parts / parts.sum(), abs=0.01)


@pytest.mark.parametrize(
    ("plan", "told"),
    [
        (
            {"keys": {"machine.mass": [1.0, 2.0]}},
            "design.keys: unknown key machine.mass; allowed: ",
        ),
        (
            {"parameter_tolerances": {"contact.restitution": 0.1}},
            "design.parameter_tolerances.contact.restitution is 0 in this scene; allowed: ",
        ),
        ({"measures": ["rms_z_m"]}, "design: rms_z_m is not a measure of this scene; did you mean rms_"),
        ({"keys": {KEYS[0]: [2.0, 2.0]}}, f"design: keys.{KEYS[0]} = [2.0, 2.0] is empty; allowed: [low, high]"),
        (
            {"parameter_tolerances": {"material.lower_share": 0.9}},
            "design.parameter_tolerances.material.lower_share = 0.9: material.lower_share =",
        ),
        ({"constraints": {"rms_y_m": "1"}}, "design: constraints.rms_y_m = '1' is no bound; allowed: \">= NUMBER\""),
        ({"minimize": "rms_y_m"}, "design: minimize is given without keys; allowed: with keys and their ranges"),
        (
            {"constraints": {"rms_y_m": ">= 1"}},
            "design: constraints are given without minimize; allowed: with a measure",
        ),
        (
            {"parameter_tolerances": {"motors": 0.05}},
            "design.parameter_tolerances.motors = 0.05: the motion depends on no number of this section that may vary "
            "so; allowed: machine, motor, drive, material, contact, or a key",
        ),
    ],
)
def test_what_cannot_be_asked_is_told_in_a_line(scene, plan, told):
    with pytest.raises(ConfigError) as caught:
        DesignStudy(scene.replace({"design": plan}))
    assert str(caught.value).startswith(told)
    assert "\n" not in str(caught.value)


def test_a_section_stands_for_its_numbers(scene):
    tolerances = {"machine": 0.05, "machine.platform_mass_kg": 0.01, "contact.restitution_threshold_m_per_s": 0.02}
    study = DesignStudy(scene.replace({"machine.damping_x_n_s_per_m": 0.0, "design.parameter_tolerances": tolerances}))
    found = study.plan.parameter_tolerances
    assert found["machine.platform_mass_kg"] == 0.01
    assert found["machine.stiffness_y_n_per_m"] == found["machine.exciter_angle_deg"] == 0.05
    assert found["contact.restitution_threshold_m_per_s"] == 0.02
    assert len(found) == 13
    assert "machine.gravity_m_per_s2" not in found
    (note,) = study.notes
    assert note.startswith("hint: no tolerance: machine.damping_x_n_s_per_m (")
    # a speed of 5 % more is above the synchronous speed, and a position has two numbers
    screen = load_config(
        CALIBRATED.parents[1] / "templates/screen.yaml", {"design.parameter_tolerances.exciters": 0.05}
    )
    (note,) = DesignStudy(screen).notes
    assert "exciters.0.rated_speed_rpm" in note
    assert "exciters.1.position_m" in note


def test_share_of_machines_within_bounds_without_minimizing(scene):
    bounds = {"rms_y_m": "<= 1.5e-3", "motor_power_w": ">= 1"}
    plan = {"parameter_tolerances": {"machine": 0.02}, "constraints": bounds, "samples": 24}
    found = design(scene.replace({"design": plan}))
    kept = [found.samples["rms_y_m"] <= 1.5e-3, found.samples["motor_power_w"] >= 1.0]
    labels, told = zip(*found.answer.lines.items(), strict=True)
    assert labels[:3] == ("constraints satisfied", "  rms_y_m <= 1.5e-3", "  motor_power_w >= 1")
    for text, inside in zip(told, (kept[0] & kept[1], *kept), strict=False):
        assert text.startswith(f"{percent(inside.mean())} (")
        assert text.endswith("with 95 % confidence)")
    assert "evaluations" not in found.tables


def test_a_key_of_both_exciters_has_the_sum_of_their_elasticities(command, tmp_path):
    assert command("new", str(tmp_path / "screen.yaml"), "--template", "screen").code == 0
    screen = load_config(tmp_path / "screen.yaml", {"solver.engine": "taylor"})
    keys = [f"exciters.{place}.static_moment_kg_m" for place in (0, 1, "N")]
    first, second, both = orbit(screen).sensitivities(keys, ["rms_y_m"])["elasticity"]
    assert both == pytest.approx(first + second, rel=1e-6)
    unequal = screen.replace({keys[0]: 0.8, "design": {"parameter_tolerances": {keys[2]: 0.01}}})
    with pytest.raises(
        ConfigError, match=r"design.parameter_tolerances.exciters.N.static_moment_kg_m has two values; allowed: equal"
    ):
        DesignStudy(unequal)


def test_a_place_that_no_list_has_is_told_those_that_there_are():
    plan = {"parameter_tolerances": {"exciters.2.critical_slip": 0.05}}
    told = "cannot be varied; allowed: exciters.0.critical_slip, exciters.1.critical_slip$"
    with pytest.raises(ConfigError, match=rf"^design.parameter_tolerances.exciters.2.critical_slip {told}"):
        DesignStudy(load_config(CALIBRATED, {"exciters.N.critical_slip": 0.15, "design": plan}))


@pytest.mark.parametrize("section", ["parameter_tolerances", "keys"])
def test_a_key_that_holds_a_list_is_refused(section):
    own = {"exciters": [{"position_m": [-0.06, 0.0]}, {"position_m": [0.06, 0.0]}]}
    given = {"parameter_tolerances": 0.05, "keys": [0.0, 1.0]}[section]
    plan = {section: {"exciters.0.position_m": given}, "minimize": "motor_power_w"}
    with pytest.raises(ConfigError, match=rf"^design.{section}.exciters.0.position_m cannot be varied; allowed: "):
        DesignStudy(load_config(CALIBRATED, own | {"design": plan if section == "keys" else {section: plan[section]}}))
