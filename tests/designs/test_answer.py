"""The few lines that a design prints."""

import numpy as np
import pandas as pd

from vibroplat.config.study_plans import DesignPlan
from vibroplat.designs.answer import _of_keys, quantile_lines


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
    assert head.split("  ")[-2:] == ["keep its bound", "fraction of the variance"]
    assert (amplitude.split()[-2:], power.split()[-2:]) == (["90", "%"], ["50", "%"])
    plan = DesignPlan(parameter_tolerances={"machine.platform_mass_kg": 0.1}, constraints={"rms_y_m": ">= 1e-3"})
    assert not any("keep" in line for line in quantile_lines(plan, samples, none))
