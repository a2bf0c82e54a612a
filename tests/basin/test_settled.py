"""Basins of machines that convey: motions that have settled, told apart by their measures."""

from pathlib import Path

import numpy as np
import pytest

from vibroplat import basins, load_config
from vibroplat.basin.attractors import name_attractors
from vibroplat.basin.study import BasinsStudy
from vibroplat.basin.windows import same_motion
from vibroplat.errors import ConfigError

CALIBRATED = Path(__file__).parents[2] / "configs/machines/calibrated.yaml"
BOX = {"phase_difference_rad": [-3.1, 3.1], "speed_ratio": [0.0, 1.1]}
ROW = {"motion": "periodic", "period": 1, "sync": "antiphase", "phase_difference_rad": 3.1, "flight_fraction": 0.2}
ROW |= {"rms_x_m": 1e-4, "rms_y_m": 1e-3, "rms_phi_rad": 1e-5, "outcome": "ok", "stick_fraction": 0.1}


def machine(engine="taylor", **plan):
    keys = {"material.mass_ratio": 0.2, "drive.supply_frequency_hz": 57.0, "contact.restitution": 0.0}
    keys |= {"machine.damping_x_n_s_per_m": 800.0, "transport.friction": 0.4, "transport.deck_angle_deg": 5.0}
    scene = load_config(CALIBRATED, keys | {"solver.engine": engine})
    return scene.replace({"basins": {"initial_conditions": BOX} | plan})


def counts(scene):
    table = basins(scene).attractors
    return dict(zip(table["attractor"], table["count"], strict=True))


def test_starts_come_to_the_motions_to_which_they_settle():
    found = counts(machine(random=3, max_turns=400, seed=2))
    assert {"antiphase, conveys to +x, period 1"} <= {*found}
    assert sum(found.values()) == 3


def test_material_that_runs_away_has_no_speed_and_is_one_motion():
    scene = machine(random=3, max_turns=120, seed=2)
    slope = {"deck_angle_deg": -25.0, "friction": 0.1, "static_friction": 0.8}
    assert counts(scene.replace({"transport": slope})) == {"antiphase, non-periodic": 3}


@pytest.mark.long
def test_shares_are_those_of_the_other_engine():
    one, other = (counts(machine(engine, random=20, max_turns=1000)) for engine in ("taylor", "native"))
    assert one == other
    assert len(one) > 1


def test_motions_that_convey_the_other_way_are_others_and_have_other_names():
    class Found:
        attractors = [
            {"row": ROW | {"conveying_speed_m_per_s": speed, "conveying_speed_error_m_per_s": 1e-5}}
            for speed in (0.1, -0.1, 1e-6)
        ] + [{"row": ROW | {"conveying_speed_m_per_s": 0.0, "stick_fraction": 1.0}}]

    scales = np.array(machine().state_scales)
    rows = [one["row"] for one in Found.attractors]
    assert not same_motion(rows[0], rows[1], scales)
    assert same_motion(rows[0], rows[0] | {"conveying_speed_m_per_s": 0.10001}, scales)
    (names,) = name_attractors([Found])
    told = [name.split(", ")[1] for name in names]
    assert told == ["conveys to +x", "conveys to −x", "conveys nowhere", "material sticks"]


def test_a_branch_of_attractors_is_refused_with_what_to_use_instead():
    over = {"key": "material.mass_ratio", "values": [0.1, 0.2]}
    with pytest.raises(
        ConfigError, match=r"basins.over.* cannot be computed .* allowed: basins at each value, or sweep"
    ):
        BasinsStudy(machine(over=over))
