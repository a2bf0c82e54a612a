"""The few lines of a sweep: from its tables, over any key, with whatever is in them."""

import numpy as np
import pandas as pd
import pytest
from common.handmade import after, branch

from vibroplat.study.answer import short_answer
from vibroplat.study.bands import bands


def told(*parts, **columns):
    """Return the headline and the lines of branches of a sweep."""
    table = pd.concat(parts or [branch(**columns)], ignore_index=True)
    usual = {
        "motion": "periodic",
        "period": 1,
        "relative_rotation": "counter-rotating",
        "motor_power_w": 5.0,
    }
    table = table.assign(**{name: value for name, value in usual.items() if name not in table})
    headline, lines = short_answer(table, bands(table))
    assert max(map(len, [headline, *lines])) <= 108
    assert len(lines) <= 10
    return headline, lines


SYNC = {"phase_difference_rad": after(8, np.pi, 0.0), "sync": after(8, "antiphase", "in-phase")}


def test_the_first_of_several_liftoffs_is_told():
    flight = np.zeros(21)
    flight[5:9], flight[14:18] = 0.2, 0.3
    head, row, *_ = told(flight_fraction=flight, **SYNC)[1]
    assert "liftoff" in head
    assert row[head.index("liftoff") :].startswith("44.25 ")


def test_a_jump_is_told_in_the_middle_of_its_points_and_how_far_it_is_known():
    headline, (head, row, known, legend) = told(**SYNC)
    assert headline == "21 points, f_e 42 … 52 Hz in steps of 0.5, up; all repeat every turn"
    assert head.split("  ")[0] == "at f_e (Hz)"
    assert "antiphase → in-phase" in head
    assert row.startswith("mass ratio 0.2  45.75  ")
    assert row.endswith(" 0.125 mm at 52")
    assert known == "each change ± 0.25 Hz"
    assert legend == "in-phase: vibrates along x and rocks; antiphase: vibrates along y"


def test_where_steps_differ_each_change_has_half_of_its_own():
    values = np.geomspace(5e5, 5e7, 21)
    table = branch(**SYNC).rename(columns={"supply_frequency_hz": "machine.stiffness_x_n_per_m"})
    headline, lines = told(table.assign(**{"machine.stiffness_x_n_per_m": values}))
    assert "500000 … 50000000 N/m at 21 values" in headline
    assert values[7:9] == pytest.approx([2505936.2, 3154786.7])
    assert "  2830000 ± 320000  " in lines[1]
    assert not any("each change" in line for line in lines)
    top = {"rms_y_m": after(12, 1e-3, np.where(np.arange(21) == 12, 2e-3, 1e-3))}
    assert "2.00 mm at 7924470" in told(table.assign(**{"machine.stiffness_x_n_per_m": values}, **top))[1][1]


def test_both_directions_stand_beside_each_other():
    """What changes is told as the key grows, whichever way the sweep goes."""
    up, down = (
        branch(**SYNC),
        branch(
            **SYNC
            | {
                name: after(5, *ends)
                for name, ends in {"phase_difference_rad": (np.pi, 0.0), "sync": ("antiphase", "in-phase")}.items()
            }
        ),
    )
    down = down.iloc[::-1].assign(direction="down", branch=1)
    _, lines = told(up, down)
    assert lines[1].startswith("mass ratio 0.2  45.75 up, 44.25 down ")
    assert lines[2] == "each change ± 0.25 Hz; where up and down differ, the start decides"
    same = branch().iloc[::-1].assign(direction="down", branch=1)
    assert "no jump; up and down agree within 1 %" in told(branch(), same)[1]
    other = same.assign(rms_y_m=np.where(same["supply_frequency_hz"] == 45.0, 0.5, 1.0) * same["rms_y_m"])
    assert "no jump; up and down differ by up to 50 %, at f_e 45 Hz" in told(branch(), other)[1]


def test_a_change_across_a_short_band_is_told_by_its_ends():
    phase = np.select([np.arange(21) < 8, np.arange(21) < 11], [np.pi, 1.5], 0.0)
    names = np.select([np.arange(21) < 8, np.arange(21) < 11], ["antiphase", "intermediate"], "in-phase")
    _, lines = told(phase_difference_rad=phase, sync=names)
    assert lines[1].startswith("mass ratio 0.2  45.5 … 47.5  ")


def test_intermediate_phases_on_both_sides_are_two_intervals():
    phase = np.where(np.arange(21) < 8, -1.5, 1.6)
    assert "always intermediate: phase difference −85.9° and 91.7°" in [
        line.replace(" °", "°") for line in told(phase_difference_rad=phase, sync="intermediate")[1]
    ]


def test_failed_points_and_chaos_are_counted():
    columns = {"outcome": after(19, "ok", "too-many-events"), "motion": after(18, "periodic", "chaotic")}
    headline, lines = told(**columns)
    assert headline == "2 of 21 points FAILED (too-many-events), f_e 42 … 52 Hz in steps of 0.5, up"
    assert lines[0] == "1 chaotic, the others repeat every turn"
    lost = {"outcome": "too-many-events", "rms_y_m": np.nan, "rms_x_m": np.nan, "excitation_frequency_hz": np.nan}
    headline, lines = told(**lost, sync=None)
    assert headline == "21 of 21 points FAILED (too-many-events), f_e 42 … 52 Hz in steps of 0.5, up"
    assert lines == []


def test_one_point_and_another_key():
    headline, lines = told(branch(1))
    assert headline == "1 point, f_e 42 Hz, up; all repeat every turn"
    assert {"no jump", "always antiphase: vibrates along y"} <= {*lines}
    table = branch().rename(columns={"supply_frequency_hz": "material.natural_frequency_hz"})
    headline, lines = told(table)
    assert headline.startswith("21 points, natural frequency 42 … 52 Hz in steps of 0.5, up; ")
    assert lines[0].startswith("at natural frequency (Hz) ")
