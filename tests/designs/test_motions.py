"""Designs of machines that convey, which have no orbits: by settled motions."""

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from vibroplat import design, load_config
from vibroplat.designs.sensitivities import local_orbit, settle_on_orbit
from vibroplat.designs.study import DesignStudy
from vibroplat.errors import ConfigError

FEEDER = Path(__file__).parents[2] / "configs/templates/feeder.yaml"
MOMENT, FRICTION = "exciters.N.static_moment_kg_m", "transport.friction"
NAMES = ["conveying_speed_m_per_s", "friction_power_w", "motor_power_w", "rms_x_m"]


def feeder(**plan):
    return load_config(FEEDER).replace({"design": plan})


def gradients(scene, keys):
    with closing(local_orbit(scene, keys, settle_on_orbit(scene))) as local:
        return local.gradients(NAMES)


def test_derivatives_are_those_of_the_other_engine_within_their_errors():
    keys = [FRICTION]
    (one, error), (other, wrong) = (
        gradients(feeder().replace({"solver.engine": engine}), keys) for engine in ("taylor", "native")
    )
    assert (np.abs(one - other) <= 3.0 * np.hypot(error, wrong) + 1e-6 * np.abs(one)).all()
    assert (error < 1e-4 * np.abs(one)).all()


def test_the_least_power_for_a_throughput_is_where_the_bound_is_kept_just_so():
    plan = {"keys": {MOMENT: [0.5, 1.2]}, "minimize": "motor_power_w", "constraints": {"throughput_kg_per_s": ">= 12"}}
    found = design(feeder(**plan, starts=1, measures=["residence_time_s"]))
    best = found.evaluations[found.evaluations["best"]].iloc[0]
    assert best["throughput_kg_per_s"] == pytest.approx(12.0, rel=1e-6)
    assert best["residence_time_s"] == pytest.approx(2.5 / best["conveying_speed_m_per_s"])
    assert any("there are no orbits" in note for note in found.answer.notes)
    assert found.sensitivities["derivative_error"].notna().all()


def test_samples_within_tolerances_keep_or_lose_the_regime():
    plan = {"parameter_tolerances": {FRICTION: 0.2}, "samples": 4, "keys": {FRICTION: [0.3, 0.4]}}
    found = design(feeder(**plan))
    assert "stability_margin" not in found.samples
    assert found.samples["stable"].all()
    assert np.ptp(found.samples["conveying_speed_m_per_s"]) > 1e-3
    assert "4 machines within the tolerances: 100 % settle alike" in found.answer.headline


def test_keys_of_transport_matter_and_a_margin_of_stability_cannot_be_had():
    assert {FRICTION, "transport.static_friction", "transport.deck_height_m"} <= {*DesignStudy(feeder()).keys}
    with pytest.raises(ConfigError, match="stability_margin needs an orbit; allowed: another measure, or no section"):
        DesignStudy(feeder(measures=["stability_margin"]))
