"""Bands of a sweep, and where a branch jumps."""

import numpy as np
import pandas as pd
import pytest
from common.handmade import after, branch

from vibroplat.results.picture import Strip
from vibroplat.study.bands import band_lines, bands, find_jumps


def test_a_resonance_that_is_climbed_is_no_jump():
    assert not find_jumps(branch()).any()
    height = 1e-3 / np.abs(52.6 - branch()["supply_frequency_hz"])
    assert not find_jumps(branch(rms_y_m=height)).any()


def test_motors_held_back_by_a_resonance_jump_where_they_get_free():
    f = branch()["excitation_frequency_hz"].to_numpy()
    captured = np.where(np.arange(21) < 12, np.minimum(f, 22.5), f)
    assert np.flatnonzero(find_jumps(branch(excitation_frequency_hz=captured))).tolist() == [11]


def test_a_phase_that_crosses_pi_or_drifts_slowly_is_no_jump():
    crossing = np.pi * np.where(np.arange(21) % 2, 0.999, -0.999)
    drifting = np.linspace(np.pi, 0.0, 21)
    names = np.where(drifting > 2.0 * np.pi / 3.0, "antiphase", "intermediate")
    assert not find_jumps(branch(phase_difference_rad=crossing)).any()
    assert not find_jumps(branch(phase_difference_rad=drifting, sync=names)).any()


#: What jumps at point 8 of a branch.
JUMPS = {
    "phase": {"phase_difference_rad": after(8, np.pi, 0.0), "sync": after(8, "antiphase", "in-phase")},
    "lost": {"sync": after(8, "antiphase", "none")},
    "frequency": {"excitation_frequency_hz": 21.0 + 0.25 * np.arange(21) + after(8, 0.0, 1.5)},
    "amplitude": {"rms_y_m": after(8, 1e-3, 0.1e-3)},
}


@pytest.mark.parametrize("change", JUMPS.values(), ids=JUMPS)
def test_a_jump_takes_two_points_on_each_side(change):
    table = branch(**change)
    assert np.flatnonzero(find_jumps(table)).tolist() == [7]
    for first, last in ((7, 8), (6, 8), (7, 9), (0, 8), (7, 20)):
        assert not find_jumps(table[first : last + 1]).any()
    assert find_jumps(table[6:10]).tolist() == [False, True, False]


def test_exciters_that_get_free_at_the_last_point_jump_there():
    last = np.arange(21) == 20
    free = branch(sync=np.where(last, "antiphase", "none"))
    assert not find_jumps(free).any(), "one point with another synchronization alone says little"
    free["excitation_frequency_hz"] += np.where(last, 6.0, 0.0)
    assert np.flatnonzero(find_jumps(free)).tolist() == [19]
    assert np.flatnonzero(find_jumps(free[::-1])).tolist() == [0]


def test_strips_go_no_farther_from_a_point_than_points_are_apart():
    """Beyond a jump of the excitation frequency nothing is known of what is between."""
    at = np.array([20.0, 20.5, 21.0, 27.6])
    strip = Strip("", "", range(4), ["in-phase", "in-phase", "none", "antiphase"])
    ends = [(round(span.low, 3), round(span.high, 3)) for span in strip.spans(at)]
    assert ends == [(19.75, 20.75), (20.75, 21.25), (27.35, 27.85)]
    ratios = strip.spans(np.array([1.0, 10.0, 100.0, 1000.0]))
    assert [span.high for span in ratios[:-1]] == [span.low for span in ratios[1:]]


def test_a_key_that_hardly_changes_the_motion_has_no_jump_between_few_points():
    few = branch(2, rms_y_m=[2.19e-3, 2.18e-3], excitation_frequency_hz=[25.1, 25.0])
    few = few.rename(columns={"supply_frequency_hz": "machine.mass_kg"})
    assert not find_jumps(few).any()
    assert bands(few)["kind"].tolist() == ["band", "largest"]


def test_a_point_on_the_way_shows_that_the_response_is_steep():
    """As where the symmetry of in-phase motion breaks: finer sweeps show a phase difference that is continuous."""
    phase = np.select([np.arange(21) < 8, np.arange(21) == 8], [0.0, -2.2], np.pi)
    assert not find_jumps(branch(phase_difference_rad=phase, sync=after(8, "in-phase", "antiphase"))).any()
    one = np.where(np.arange(21) == 8, "none", "antiphase")
    assert bands(branch(sync=one))["kind"].tolist() == ["band", "band", "band", "largest"]


@pytest.mark.parametrize(
    "lost",
    [{"outcome": "too-many-events", "excitation_frequency_hz": np.nan, "rms_y_m": np.nan}, {"rms_y_error_m": 0.3e-3}],
    ids=["failed", "jumps-while-measured"],
)
def test_a_jump_leads_across_a_point_that_says_nothing(lost):
    table = branch(rms_y_m=after(8, 1e-3, 0.1e-3), rms_y_error_m=1e-6)
    table.loc[8, [*lost, "rms_x_m"]] = [*lost.values(), 0.2e-3]
    assert np.flatnonzero(find_jumps(table)).tolist() == [7, 8]
    row = bands(table).query("kind == 'jump'").iloc[0]
    assert (row["points"], row["from_supply_frequency_hz"], row["to_supply_frequency_hz"]) == (3, 45.5, 46.5)
    table["rms_y_m"] = table["rms_y_m"].where(table["rms_y_m"].isna(), 1e-3)
    assert not find_jumps(table).any()


def test_changes_count_by_the_distance_of_points():
    places = np.array([1.0, 2.0, 3.0, 4.0, 7.0, 8.0, 9.0, 10.0])
    uneven = branch(8, supply_frequency_hz=places, excitation_frequency_hz=0.5 * places, rms_y_m=1e-3 * places)
    assert not find_jumps(uneven).any()
    uneven["rms_y_m"] += np.where(places > 4.0, 20e-3, 0.0)
    assert np.flatnonzero(find_jumps(uneven)).tolist() == [3]
    uneven["supply_frequency_hz"] += np.where(places > 4.0, 2.0, 0.0)
    assert not find_jumps(uneven).any()  # nothing is known of so much between
    uneven["supply_frequency_hz"] = 5.0
    assert not find_jumps(uneven).any()


def test_nothing_lifts_off_where_there_was_no_material():
    flight = {"flight_fraction": after(3, 0.0, 0.4) * after(8, 1.0, 0.0)}
    bare = branch(**flight, contact_force_max_n=after(3, np.nan, 60.0))
    assert bands(bare)["kind"].tolist() == ["band", "flight-end", "largest"]
    failed = np.arange(21) == 3
    assert (
        "liftoff" in bands(branch(**flight).assign(outcome=np.where(failed, "too-many-events", "ok")))["kind"].tolist()
    )
    none = branch(**flight, contact_force_max_n=after(8, 60.0, np.nan))
    assert bands(none)["kind"].tolist() == ["band", "liftoff", "largest"]


def _without(table, failed, columns):
    table.loc[failed, columns] = np.nan
    return table.assign(outcome=np.where(failed, "too-many-events", "ok"))


def test_bands_name_synchronization_jump_liftoff_and_largest_amplitude():
    table = branch(
        phase_difference_rad=after(8, np.pi, 0.0),
        sync=after(8, "antiphase", "in-phase"),
        flight_fraction=after(3, 0.0, 0.4) * after(8, 1.0, 0.0),
    )
    found = bands(table)
    assert found[["kind", "name", "points"]].to_numpy().tolist() == [
        ["band", "antiphase", 8],
        ["band", "in-phase", 13],
        ["jump", "antiphase → in-phase", 2],
        ["liftoff", "", 2],
        ["flight-end", "", 2],
        ["largest", "in-phase", 1],
    ]
    assert found["from_supply_frequency_hz"].tolist() == [42.0, 46.0, 45.5, 43.0, 45.5, 52.0]
    assert found["to_supply_frequency_hz"].tolist() == [45.5, 52.0, 46.0, 43.5, 46.0, 52.0]
    assert found["to_excitation_frequency_hz"].tolist() == (0.5 * found["to_supply_frequency_hz"]).tolist()
    assert found["from_rms_y_m"].iloc[-1] == table["rms_y_m"].max()


def test_failed_points_are_a_band_of_their_own():
    failed = np.arange(21) >= 18
    found = bands(_without(branch(), failed, ["excitation_frequency_hz", "rms_x_m", "rms_y_m", "sync"]))
    row = found[found["kind"] == "failed"].iloc[0]
    assert (row["name"], row["points"], row["from_supply_frequency_hz"]) == ("too-many-events", 3, 51.0)
    assert np.isnan(row["from_excitation_frequency_hz"])
    assert any(line.startswith("  too-many-events") and "f_e 51 … 52 Hz" in line for line in band_lines(found))


def test_bands_are_those_of_each_branch_in_their_order():
    table = pd.concat([branch(), branch(branch=1, direction="down"), branch(branch=2)], ignore_index=True)
    assert bands(table)["branch"].unique().tolist() == [0, 1, 2]
    assert (find_jumps(table[:1]).size, find_jumps(table[:0]).size) == (0, 0)
    assert (bands(table[:0]).empty, "from_rms_y_m" in bands(table[:0])) == (True, True)


def test_lines_say_where_and_what():
    table = branch(phase_difference_rad=after(8, np.pi, 0.0), sync=after(8, "antiphase", "in-phase"))
    lines = list(band_lines(bands(table)))
    assert lines[0] == "mass ratio 0.2, up"
    assert lines[1].startswith("  antiphase                  f_e 42 … 45.5 Hz  f 21.00 … 22.75 Hz  RMS y ")
    jump = next(line for line in lines if line.startswith("  jump antiphase → in-phase  "))
    assert "f_e 45.5 → 46 Hz" in jump
