"""Bands of a sweep, and where a branch jumps."""

import numpy as np
import pandas as pd
import pytest
from common.handmade import after, branch

from vibroplat.study.bands import band_lines, bands, jumps


def test_a_smooth_branch_has_no_jump():
    assert not jumps(branch()).any()


def test_a_resonance_that_is_climbed_is_no_jump():
    height = 1e-3 / np.abs(52.6 - branch()["supply_frequency_hz"])
    assert not jumps(branch(rms_y_m=height)).any()


def test_motors_held_back_by_a_resonance_jump_where_they_get_free():
    f = branch()["excitation_frequency_hz"].to_numpy()
    captured = np.where(np.arange(21) < 12, np.minimum(f, 22.5), f)
    assert np.flatnonzero(jumps(branch(excitation_frequency_hz=captured))).tolist() == [11]


@pytest.mark.parametrize(
    "change",
    [
        {"phase_difference_rad": after(8, np.pi, 0.0), "sync": after(8, "antiphase", "in-phase")},
        {"sync": after(8, "antiphase", "none")},
        {"rms_y_m": after(8, 1e-3, 0.1e-3)},
    ],
    ids=["phase", "lost", "amplitude"],
)
def test_a_jump_is_found_where_it_is(change):
    assert np.flatnonzero(jumps(branch(**change))).tolist() == [7]


def test_a_phase_that_crosses_pi_or_drifts_slowly_is_no_jump():
    crossing = np.pi * np.where(np.arange(21) % 2, 0.999, -0.999)
    drifting = np.linspace(np.pi, 0.0, 21)
    names = np.where(drifting > 2.0 * np.pi / 3.0, "antiphase", "intermediate")
    assert not jumps(branch(phase_difference_rad=crossing)).any()
    assert not jumps(branch(phase_difference_rad=drifting, sync=names)).any()


def test_next_to_a_failed_point_nothing_is_known():
    failed = np.arange(21) == 8
    columns = ["excitation_frequency_hz", "rms_x_m", "rms_y_m", "phase_difference_rad", "sync"]
    assert not jumps(_without(branch(), failed, columns)).any()


def _without(table, failed, columns):
    table.loc[failed, columns] = np.nan
    return table.assign(outcome=np.where(failed, "event-storm", "ok"))


def test_one_point_or_none_has_no_jump():
    assert jumps(branch(count=1)).size == jumps(branch().iloc[:0]).size == 0


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
    assert (row["name"], row["points"], row["from_supply_frequency_hz"]) == ("event-storm", 3, 51.0)
    assert np.isnan(row["from_excitation_frequency_hz"])
    assert any(line.startswith("  event-storm") and "f_e 51 … 52 Hz" in line for line in band_lines(found))


def test_bands_of_several_branches_are_in_their_order():
    table = pd.concat([branch(), branch(branch=1, direction="down"), branch(branch=2)], ignore_index=True)
    assert bands(table)["branch"].unique().tolist() == [0, 1, 2]


def test_bands_of_an_empty_table_are_empty():
    found = bands(branch().iloc[:0])
    assert found.empty
    assert "from_rms_y_m" in found


def test_lines_say_where_and_what():
    table = branch(phase_difference_rad=after(8, np.pi, 0.0), sync=after(8, "antiphase", "in-phase"))
    lines = list(band_lines(bands(table), "counter-rotating"))
    assert lines[0] == "material.mass_ratio 0.2, up"
    assert lines[1] == "  antiphase                 f_e 42 … 45.5 Hz, f 21.00 … 22.75 Hz: shakes along y"
    jump = next(line for line in lines if line.startswith("  jump"))
    assert "f_e 45.5 → 46 Hz" in jump
    assert jump.endswith("mm, antiphase → in-phase")
