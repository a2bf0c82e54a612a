"""Tables of branches of orbits: rows, columns, types."""

import numpy as np
import pandas as pd
import pytest

from vibroplat import load_config, orbit
from vibroplat.config.coordinates import COORDINATES, RATES
from vibroplat.config.plans import OrbitsPlan
from vibroplat.continuation.answer import _cut_short, answer_of
from vibroplat.continuation.branch_tasks import ComputedBranch, multiplier_columns
from vibroplat.continuation.rows import orbit_motion
from vibroplat.continuation.study import OrbitsStudy
from vibroplat.continuation.tables import make_tables
from vibroplat.errors import ConfigError
from vibroplat.study.point import MEASURED

from .helpers import LIFTOFF, MACHINE, MASS, PLAN

KEY = "supply_frequency_hz"


def test_columns_of_branches_are_those_of_the_interface(found):
    first = [MASS, KEY, "branch", "parent", "point", "excitation_frequency_hz", "period", "period_s"]
    last = ["sequence", "stable", "n_unstable", *(f"multiplier_{i}_{p}" for i in range(1, 5) for p in ("re", "im"))]
    columns = list(found.branches.columns)
    assert columns[: len(first)] == first
    state = [*COORDINATES, *RATES]  # the second combination has material
    begin = columns.index("sequence")
    assert columns[begin : begin + len(last) + 2 + len(state)] == [*last, "residual", "turns", *state]
    assert {*MEASURED, "sync"} <= {*columns}
    assert len(set(columns)) == len(columns)


def test_rows_are_in_the_order_of_the_grid_and_of_points(found):
    table = found.branches
    assert table[MASS].is_monotonic_increasing
    assert sorted(set(table[MASS])) == [0.0, 0.1]
    for _, rows in table.groupby(MASS):
        assert rows["branch"].tolist() == [0] * len(rows)
        assert rows["parent"].tolist() == [-1] * len(rows)
        assert rows["point"].tolist() == list(range(len(rows)))
        np.testing.assert_allclose(rows[KEY].iloc[[0, -1]], [47.0, 49.0], rtol=1e-12)


def test_a_row_is_the_orbit_there(found, scene):
    row = found.branches[found.branches[MASS] == 0.1].iloc[-1]
    there = orbit(scene.replace({MASS: 0.1, "drive.supply_frequency_hz": 49.0}))
    assert (row["sequence"], row["stable"], row["n_unstable"]) == (there.sequence, True, 0)
    for name in ("rms_y_m", "motor_power_w", "flight_fraction"):
        assert row[name] == pytest.approx(there.measures[name], rel=1e-6)
    assert row["period_s"] == pytest.approx(there.period_s, rel=1e-8)
    told = complex(row["multiplier_1_re"], row["multiplier_1_im"])
    assert abs(told) == pytest.approx(abs(there.multipliers[0]), rel=1e-4)


def test_a_row_leads_back_to_its_orbit(found, scene):
    mass = 0.1
    row = found.branches[found.branches[MASS] == mass].iloc[-1]
    there = orbit(scene, row)
    assert there.scene.material.mass_ratio == mass
    assert there.scene.drive.supply_frequency_hz == pytest.approx(row[KEY])
    assert there.period_s == pytest.approx(row["period_s"], rel=1e-8)
    motion = orbit_motion(scene, row.to_dict()).trajectory.iloc[[0, -1]]
    assert motion["y_m"].tolist() == pytest.approx([row["y_m"]] * 2, abs=1e-8)  # its state is that of the orbit


def test_special_points_lead_back_to_their_orbits(found, scene):
    (special,) = (row for _, row in found.special.iterrows())
    there = orbit(scene, special)
    assert there.excitation_frequency_hz == pytest.approx(special["excitation_frequency_hz"], rel=1e-7)
    assert there.measures["gap_max_m"] < 1e-6  # contact is about to be lost


def test_special_points_have_place_and_state(found):
    (special,) = (row for _, row in found.special.iterrows())
    assert (special["kind"], special[MASS], special["branch"], special["period"]) == ("liftoff", 0.1, 0, 1)
    assert special[KEY] == pytest.approx(LIFTOFF, abs=1e-5)
    assert found.special[[*COORDINATES, *RATES]].notna().all(axis=None)
    rows = found.branches[found.branches[MASS] == 0.1].reset_index(drop=True)
    before, after = rows[KEY][special["point"]], rows[KEY][special["point"] + 1]
    assert before <= special[KEY] <= after


def test_columns_of_state_are_those_of_the_scenes():
    bare = load_config(MACHINE, {"orbits": {**PLAN, "grid": {}}, MASS: 0.0})
    (family,) = OrbitsStudy(bare).families
    special = {"kind": "fold", "value": 48.0, "excitation_frequency_hz": 24.0, "period": 1}
    branch = ComputedBranch(family, 0, -1, "start", special=[special | {"after": 1, "state": list(range(14))}])
    table = make_tables(bare.orbits, [branch], [])["special"]
    assert "gap_m" not in table
    assert table[["x_m", "phi2_rad", "x_rate_m_per_s"]].iloc[0].tolist() == [0.0, 4.0, 7.0]


def test_boundaries_have_both_keys(scene):
    first, last = (
        [MASS, "curve", "kind", "branch", KEY],
        ["excitation_frequency_hz", "period", "n_unstable"],
    )
    second = {"boundaries": {"key": "contact.restitution", "start": 0.0, "stop": 0.5}}
    assert "boundaries" not in make_tables(scene.orbits, [], [])
    table = make_tables(scene.replace({"orbits": PLAN | second}).orbits, [], [])["boundaries"]
    assert list(table.columns) == [*first, "contact.restitution", *last]


def test_summary_tells_how_each_branch_ended(found):
    told = found.documents["orbits"]
    assert told["key"] == "drive.supply_frequency_hz"
    assert (told["points"], told["failed"]) == (len(found.branches), 0)
    assert told["turns"] == pytest.approx(found.branches["turns"].sum())
    assert [branch["grid"] for branch in told["branches"]] == [{MASS: 0.0}, {MASS: 0.1}]
    for branch in told["branches"]:
        assert (branch["branch"], branch["parent"], branch["origin"]) == (0, None, "start")
        assert branch["ended"] == "stop of the key's range"
        assert branch["points"] == branch["stable"] > 3


def test_pairs_of_multipliers_are_told_whole_or_not_at_all():
    pair = np.array([0.5 + 0.1j, 0.5 - 0.1j])
    real = np.array([0.9, 0.8, 0.7, 0.4], dtype=complex)
    assert list(multiplier_columns(np.concatenate([real[:3], pair]), 4).values()) == [
        0.9,
        0.0,
        0.8,
        0.0,
        0.7,
        0.0,
        None,
        None,
    ]
    assert list(multiplier_columns(np.concatenate([real[:2], pair, real[3:]]), 4).values())[4:] == [0.5, 0.1, 0.5, -0.1]
    assert list(multiplier_columns(real, 4).values())[6:] == [0.4, 0.0]
    assert list(multiplier_columns(real[:1], 2).values()) == [0.9, 0.0, None, None]


def test_start_that_is_no_run_is_refused(scene, here):
    place = "nowhere"
    with pytest.raises(ConfigError) as caught:
        OrbitsStudy(scene.replace({"orbits": PLAN | {"from": place}}))
    assert str(caught.value) == (
        f"orbits.from = '{place}': {place} holds no finished result: it has no provenance.json; "
        "allowed: settled, state, or the directory of a finished run"
    )


def test_a_second_key_in_the_grid_is_refused_at_once(scene):
    second = {"boundaries": {"key": MASS, "start": 0.0, "stop": 0.3}}
    with pytest.raises(ConfigError) as caught:
        OrbitsStudy(scene.replace({"orbits": PLAN | second}))
    assert str(caught.value) == f"orbits.grid.{MASS} is the key of boundaries; allowed: another key"


def test_stable_ranges_end_at_the_points_where_stability_is_lost():
    """The last computed points before them are no limits; other special points, and another combination's, are none."""
    rows = {KEY: [1.0, 2.0, 3.0, 4.0, 5.0], "stable": [False, True, True, True, False], "point": range(5)}
    branches = pd.DataFrame(rows).assign(branch=0, sync="antiphase", excitation_frequency_hz=1.0, rms_y_m=1.0)
    branches = pd.concat([branches.assign(**{MASS: mass}) for mass in (0.0, 0.1)])
    values, mass = [1.637, 3.5, 4.2, 4.5, 4.8, 4.9], [0.0] * 5 + [0.1]
    places = {KEY: values, "point": [0, 2, 3, 3, 3, 3], "branch": 0, MASS: mass}
    special = pd.DataFrame(places).assign(
        excitation_frequency_hz=1.0, period=1, kind=["branch-point", "grazing", "liftoff", "liftoff", "fold", "fold"]
    )
    plan = OrbitsPlan.model_validate({**PLAN, "grid": {MASS: [0.0, 0.1]}})
    summary = {
        "branches": [
            dict.fromkeys(("branch", "origin", "parent", "least", "largest", "points", "stable", "ended", "failed"))
            | {"grid": {MASS: 0.0}, "ended": "stop of the key's range"}
        ],
        "boundaries": [],
        "failed": 0,
        "turns": 1.0,
    }
    answer = answer_of(plan, {"branches": branches.assign(turns=1, residual=0.0), "special": special}, summary, "")
    assert "1.637 … 4.800" in answer.short[1]
    assert answer.short[1].endswith("  4.200"), "the first of two lift-offs"
    assert "2.000 … 4.900" in answer.short[2]


def test_what_ended_by_a_limit_of_the_plan_is_told_first():
    plan = OrbitsPlan.model_validate(
        {**PLAN, "max_branches": 2, "boundaries": {"key": MASS, "start": 0.0, "stop": 0.3}}
    )
    low, high = plan.range
    ends = {"whole": "stop of the key's range", "cut": "max_points = 2 reached"}
    branches = [{"grid": {}, "ended": end, "least": low, "largest": 0.9 * low + 0.1 * high} for end in ends.values()]
    summary = {"branches": branches, "boundaries": [{"ended": ["max_points = 9 reached", "end of a key's range"]}]}
    assert [*_cut_short(plan, summary)] == [
        "1 of 2 branches ended early, after 10 % of the range: max_points = 2 reached",
        "1 of 1 boundary curve ended early: boundaries.max_points = 9 reached",
        "there may be more branches: max_branches = 2 reached",
    ]
    assert not [*_cut_short(plan, {"branches": branches[:1], "boundaries": []})]
