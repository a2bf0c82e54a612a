"""The few lines that a design prints."""

import numpy as np
import pandas as pd
import pytest

from vibroplat.config.study_plans import DesignPlan
from vibroplat.designs.answer import _of_keys, quantile_lines
from vibroplat.designs.samples import variance_contributions


def test_keys_of_one_exciter_have_its_number_and_equal_ones_are_told_once():
    moments = {"exciters.0.static_moment_kg_m": 0.5601, "exciters.1.static_moment_kg_m": 0.5602}
    assert _of_keys(moments | {"body.mass_kg": -1.0}) == ["static_moment_kg_m 0.56 each", "mass_kg −1.0"]
    unlike = {"exciters.1.rated_power_w": 0.4, "exciters.0.rated_power_w": 0.2}
    assert _of_keys(unlike) == ["rated_power_w (2) 0.40", "rated_power_w (1) 0.20"]


def test_of_several_bounds_each_has_the_share_of_machines_that_keep_it():
    bounds = {"rms_y_m": ">= 1e-3", "motor_power_w": "<= 50"}
    plan = DesignPlan(parameter_tolerances={"machine.platform_mass_kg": 0.1}, constraints=bounds)
    samples = pd.DataFrame(
        {"stable": True, "rms_y_m": np.linspace(0.9e-3, 1.9e-3, 100), "motor_power_w": np.linspace(46.0, 54.0, 100)}
    )
    none = pd.DataFrame({"measure": [], "key": [], "regression": []})
    head, amplitude, power = quantile_lines(plan, samples, none)
    assert head.split("  ")[-2:] == ["within bound", "fraction of the variance"]
    assert (amplitude.split()[-2:], power.split()[-2:]) == (["90", "%"], ["50", "%"])
    plan = DesignPlan(parameter_tolerances={"machine.platform_mass_kg": 0.1}, constraints={"rms_y_m": ">= 1e-3"})
    assert not any("keep" in line for line in quantile_lines(plan, samples, none))


PHASE = "phase_difference_rad"


def test_phases_near_pi_are_told_by_their_deviations_and_judged_on_their_circle():
    plan = DesignPlan(parameter_tolerances={"machine.platform_mass_kg": 0.1}, constraints={PHASE: "<= 3.12"})
    away = np.linspace(-0.4, 0.4, 101)
    samples = pd.DataFrame({"machine.platform_mass_kg": away, PHASE: np.angle(np.exp(1j * (np.pi + away)))})
    contributions = variance_contributions(samples, ["machine.platform_mass_kg"], [PHASE])
    assert contributions["regression"].tolist() == pytest.approx([1.0])
    line = quantile_lines(plan, samples, contributions)[1]
    assert line.split("  ")[0] == "phase difference about 3.142 (rad)"
    assert line.split()[5:8] == ["−0.360", "0", "0.360"]
    assert plan.keeps(PHASE, samples[PHASE]).mean() == pytest.approx(48 / 101)


def test_phases_all_around_the_circle_have_no_mean():
    plan = DesignPlan(parameter_tolerances={"machine.platform_mass_kg": 0.1}, measures=[PHASE])
    samples = pd.DataFrame({"machine.platform_mass_kg": np.arange(99.0), PHASE: np.linspace(-np.pi, np.pi, 100)[1:]})
    contributions = variance_contributions(samples, ["machine.platform_mass_kg"], [PHASE])
    assert contributions["regression"].isna().all()
    assert quantile_lines(plan, samples, contributions)[1].endswith("no mean: spread around the circle")


@pytest.mark.parametrize(
    ("plan", "message"),
    [
        ({"minimize": PHASE}, f"minimize = {PHASE}, which is an angle, and a circle has no least value; allowed: "),
        ({"minimize": "rms_y_m", "constraints": {PHASE: "<= 180"}}, f"constraints.{PHASE}: 180 is more than a turn"),
    ],
)
def test_what_a_circle_does_not_have_is_refused(plan, message):
    with pytest.raises(ValueError, match=message):
        DesignPlan(keys={"machine.platform_mass_kg": [10.0, 20.0]}, **plan)
