"""Notes in the rows of a sweep, and their digest."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from common.places import LOADED, ROOT
from common.results import bits

from vibroplat.results.tables import read_table
from vibroplat.study.branches import branches
from vibroplat.study.sweep import notes_on_branches, notes_on_points

from .helpers import planned, swept

PRINTED = ROOT / "configs/machines/printed.yaml"
#: The vertical resonance of the printed machine captures the motors on the way up from 62 Hz.
RISING = {"motor.friction_radius_m": 0.0, "run.initial.speed_ratio": 0.8, "solver.tolerance": 1e-5}
CAPTURED = "captured by a resonance, overloaded or still running up"


@pytest.fixture(scope="module")
def table():
    return swept(PRINTED, 58.0, 66.0, step=4.0, changes=RISING, measure_s=0.5, lyapunov=False)


def test_rows_of_captured_motors_say_so(table):
    notes = table["notes"].tolist()
    assert table["outcome"].tolist() == ["ok"] * 3
    assert notes[0] == ""
    first, second = notes[2].split("; ")
    assert first == f"exciter 1 turns at 30.5 Hz, 7.6 % below its synchronous speed 33 Hz: {CAPTURED}"
    assert second.startswith("exciter 2 turns at 30.5 Hz")


def test_points_that_fail_have_no_notes():
    failed = swept(LOADED, 50.0, changes={"solver.max_events_per_period": 1})
    assert failed["notes"].isna().all()
    assert notes_on_points(failed) == []


# -- the digest -----------------------------------------------------------------------------------------


def noted(*notes):
    found = pd.DataFrame({"supply_frequency_hz": 60.0 + np.arange(len(notes)), "notes": list(notes)})
    return found.assign(motion="periodic", outcome="ok")


def test_each_kind_of_note_is_told_once_with_its_points():
    turning = "the platform turns by up to {} rad, where a model of first order in phi is inaccurate"
    captured = f"exciter {{}} turns at {{}} Hz, 7.6 % below its synchronous speed 33 Hz: {CAPTURED}"
    both = f"{captured.format(1, 30.5)}; {captured.format(2, 30.5)}"
    found = notes_on_points(noted("", both, f"{turning.format(0.2)}; {captured.format(2, 1e-5)}", both, None))
    assert found == [
        f"3 points at a supply of 61 … 63 Hz, the first: {captured.format(1, 30.5)}",
        f"1 point at a supply of 62 Hz: {turning.format(0.2)}",
    ]


@pytest.mark.parametrize("notes", [("", None, ""), ("", ""), (None, None), (np.nan, np.nan), ()])
def test_a_table_without_notes_has_no_digest(notes):
    assert notes_on_points(noted(*notes)) == []


def test_notes_on_the_input_are_those_of_all_branches_each_once():
    grid = {"material.mass_ratio": [0.2, 20.0], "contact.restitution": [0.0, 0.5]}
    scene = planned(LOADED, 300.0, 500.0, step=100.0, direction=["up", "down"], grid=grid)
    notes = notes_on_branches(branches(scene))
    assert len(set(notes)) == len(notes)
    assert "material.mass_ratio = 20; usual: up to 5" in notes
    assert "drive.supply_frequency_hz = 500; usual: up to 400 Hz" in notes
    assert not [note for note in notes if "not given" in note]


def test_a_sweep_prints_its_notes_and_keeps_those_of_points(command, kernels, here):
    frequencies = "{start: 50.0, stop: 50.5}"
    times = "settle_s: 0.5, measure_s: 0.5, lyapunov: false"
    sweep = f"{{supply_frequency_hz: {frequencies}, grid: {{motor.critical_torque_n_m: [1.2, 0.01]}}, {times}}}"
    plan = "run: {initial: {speed_ratio: 0.7}}\nsolver: {tolerance: 1.0e-5}\n"
    (here / "own.yaml").write_text(
        f"motor: {{critical_slip: 0.15}}\nmachine: {{damping_y_n_s_per_m: 400.0}}\n{plan}sweep: {sweep}\n"
    )
    done = command("sweep", "own.yaml", "--format", "csv")
    assert (done.code, done.err) == (0, "")
    notes = [line for line in done.out.splitlines() if line.startswith("note: ")]
    assert notes[:2] == [
        "note: machine: platform_mass_kg and 11 more keys not given; taken from the paper's test rig",
        "note: motor: pole_pairs and 1 more key not given; taken from the paper's test rig",
    ]
    assert len(notes) == 3
    assert notes[2].startswith("note: 2 points at a supply of 50 … 50.5 Hz, the first: exciter 1 ")
    table = read_table(here / "results/own", "sweep")
    assert table["notes"].notna().tolist() == [False, False, True, True]


def test_notes_do_not_change_a_table_written_and_read(table, tmp_path):
    table.to_csv(tmp_path / "sweep.csv", index=False)
    again = read_table(tmp_path, "sweep")
    assert notes_on_points(again) == notes_on_points(table) != []
    assert bits(again) == bits(table)


def test_undecided_points_are_told_with_the_first_reason():
    table = pd.DataFrame(
        {
            "supply_frequency_hz": [45.0, 46.0, 47.0],
            "motion": ["periodic", "undecided", "undecided"],
            "outcome": "ok",
            "notes": "",
            "detail": ["", "sign unclear", "section drifts"],
        }
    )
    told = "2 points are undecided, the first at a supply of 46 Hz: sign unclear; sweep.max_settle_s may help"
    assert notes_on_points(table) == [told]
    one = "1 point is undecided, at a supply of 47 Hz: section drifts; sweep.max_settle_s may help"
    assert notes_on_points(table[table["detail"] != "sign unclear"]) == [one]
    assert notes_on_points(table[:1]) == []
