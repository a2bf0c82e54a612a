"""What all evaluated values say together: mixed intervals, what holds beyond them, and what is a jump."""

import math
import random
import re
from itertools import pairwise
from types import SimpleNamespace

import pandas as pd
import pytest
from common import handmade
from common.places import ROOT

from vibroplat import Scene, find, load_config
from vibroplat.config.circular import shown_angle
from vibroplat.config.study_plans import FindPlan
from vibroplat.study.point import ANTIPHASE, SweepPoint, failed_record
from vibroplat.thresholds import picture, search
from vibroplat.thresholds import values as values_of
from vibroplat.thresholds.distinct import indistinct, measures_to_ask
from vibroplat.thresholds.evidence import (
    ERROR_PROBABILITY,
    MAX_OTHER_FRACTION,
    MAX_ROUNDS,
    STARTS,
    VALUES_PER_ROUND,
    ScaledKey,
    Threshold,
    facts,
    is_wanted,
    may_depend_on_seed,
    zones,
)
from vibroplat.thresholds.search import start_key
from vibroplat.thresholds.study import ThresholdStudy
from vibroplat.thresholds.values import ScanPoint, evaluate, has_errors, measures_meet, relative_difference

KEY = "motor.critical_torque_n_m"
ASKED = {"key": KEY, "start": 0.0, "stop": 100.0, "scan": 5, "tolerance": 0.5, "expression": "rms_y_m > 0.5"}
PLAN = FindPlan(**ASKED)


def value(at, measure, stage="scan", **row):
    """A value at which the measure of the expression has been found; none if it failed."""
    return ScanPoint(at, stage, {"rms_y_m": measure, **row}, None if measure is None else [0.0])


def values(*measures):
    """Values at 0, 10, 20, … with these measures."""
    return [value(10.0 * place, measure) for place, measure in enumerate(measures)]


def between(low, high, special=""):
    return Threshold(low, high, 0.5 * (low.value + high.value), "jump", special)


def test_without_contradiction_values_are_counted_on_both_sides():
    found = values(0, 0, 1, 1, None, 1)
    (zone,) = zones(found, [between(*found[1:3])], PLAN)
    assert (zone.mixed, zone.ends) == ([], None)
    assert (zone.below.tried, zone.below.last, zone.below.unknown) == (2, 0.0, 0)
    assert (zone.above.tried, zone.above.last, zone.above.unknown) == (3, 50.0, 1), "a failed run is no success"
    assert is_wanted(zone, True, PLAN)
    assert not is_wanted(zone, False, PLAN)


def test_values_that_contradict_a_threshold_make_a_mixed_interval():
    found = values(0, 1, 0, 0, 1, 1, 0, 1, 1)
    (zone,) = zones(found, [between(*found[3:5])], PLAN)
    assert zone.ends == (10.0, 60.0), "from the lowest value where it holds to the highest where it does not"
    assert (zone.below.tried, zone.above.tried, zone.above.last) == (1, 2, 80.0)


def test_a_clear_side_begins_where_many_starts_agree():
    """What a single start there or nearer says is no promise; without a failure of n the share p is (1 - p)**n."""
    found = values(0, 0, 1, 1, 1)
    many = [value(25.0, 1)._replace(seed=k) for k in range(STARTS)]
    (zone,) = zones([*found, *many], [between(*found[1:3])], PLAN)
    assert (zone.above.nearest.value, zone.above.starts, zone.above.tried) == (25.0, STARTS, STARTS + 2)
    assert zone.above.sure
    assert (1.0 - zone.above.max_other_fraction) ** STARTS == pytest.approx(ERROR_PROBABILITY / MAX_ROUNDS)
    assert zone.above.max_other_fraction < MAX_OTHER_FRACTION
    (fewer,) = zones([*found, *many[:3]], [between(*found[1:3])], PLAN)
    assert (fewer.above.nearest.value, fewer.above.sure) == (20.0, False)


def test_measures_that_meet_within_their_errors_are_no_clear_threshold():
    """Chaos scatters around the level; orbits do not."""
    one, other = (value(at, 0.5 + at / 1e4, rms_y_error_m=0.02) for at in (-1.0, 1.0))
    assert has_errors(one, other, PLAN)
    assert not has_errors(value(-1.0, 0.4999), value(1.0, 0.5001), PLAN)


def test_a_phase_difference_that_passes_pi_neither_jumps_nor_crosses_another_level():
    phases = {10.0: 3.11, 20.0: 3.14159, 30.0: -3.14159, 40.0: -3.11}
    one, *others = (ScanPoint(at, "scan", {"phase_difference_rad": phase}, [0.0]) for at, phase in phases.items())
    asked = {how: FindPlan(**ASKED | {"expression": f"phase_difference_rad {how}"}) for how in ("> 3.12", "< -3.0")}
    assert [value.outcome(asked["> 3.12"]) for value in (one, *others)] == [False, True, True, True]
    assert [value.outcome(asked["< -3.0"]) for value in (one, *others)] == [True] * 4
    assert relative_difference(*others[:2], asked["> 3.12"]) == pytest.approx(2.0 * (math.pi - 3.14159))
    assert measures_meet([(one, others[2]), tuple(others[:2])], asked["> 3.12"])
    one, other = (
        ScanPoint(at, "scan", {"phase_difference_rad": phase}, [0.0]) for at, phase in ((1.0, -3.1367), (2.0, math.pi))
    )
    assert measures_meet([(one, other)], FindPlan(**ASKED | {"expression": "phase_difference_rad > 0"}))
    with pytest.raises(ValueError, match="300 is more than a turn, but phase_difference_rad is in rad"):
        FindPlan(**ASKED | {"expression": "phase_difference_rad > 300"})


@pytest.mark.parametrize(("level", "kind"), [(0.0, "opposite-crossing"), (-3.139, "level-crossing")])
def test_a_phase_that_passes_pi_is_located_as_well_as_rows_show_it(known, monkeypatch, level, kind):
    """Rows show π for what is less than 5 mrad above −π; half a turn from a level no level is crossed."""

    def passing(scene, plan, state, times, key):
        point, at = known(scene, plan, state, times, key), scene.motor.critical_torque_n_m
        point.row["phase_difference_rad"] = shown_angle(math.pi + 1e-3 * (at - 45.0), ANTIPHASE)
        return point

    monkeypatch.setattr(search, "evaluate", passing)
    found = find(Scene().replace({"find": ASKED | {"expression": f"phase_difference_rad > {level}", "stop": 80.0}}))
    (row,) = found.thresholds.to_dict("records")
    true = 45.0 + 1e3 * ((level + 2.0 * math.pi if level else math.pi) - math.pi)
    assert row["below"] < true < row["above"]
    assert row["above"] - row["below"] < 12.0, "the width of what is shown as π, and as much on one side"
    assert row["kind"] == kind
    assert ("no level-crossing" in found.answer.headline) == (kind == "opposite-crossing")
    assert pd.isna(row["mixed_low"])


def test_a_value_that_changes_with_twice_the_time_is_mixed():
    found = values(0, 0, 1, 1)
    (zone,) = zones([*found, value(20.0, 0, "extended")], [between(*found[1:3])], PLAN)
    assert (zone.ends, zone.below.tried, zone.above.tried) == ((20.0, 20.0), 2, 1)


def test_a_window_between_two_thresholds_is_no_mixed_interval():
    found = values(0, 1, 1, 0, 0)
    first, second = zones(found, [between(*found[:2]), between(*found[2:4])], PLAN)
    assert (first.ends, second.ends) == (None, None)
    assert (first.above.tried, second.below.tried) == (2, 2)


def test_each_contradiction_belongs_to_the_nearest_threshold_that_is_no_special_point():
    found = values(0, 1, 1, 1, 0, 1, 0, 0)
    borders = [between(*found[:2]), between(*found[5:7])]
    first, second = zones(found, borders, PLAN)
    assert (first.ends, second.ends) == (None, (40.0, 50.0))
    special = between(*found[5:7], special="fold")
    assert [zone.ends for zone in zones(found, [borders[0], special], PLAN)] == [(10.0, 40.0), None]


def test_orbits_of_a_branch_are_no_evidence():
    found = values(0, 0, 1, 1)
    (zone,) = zones([*found, value(35.0, 0, "orbit")], [between(*found[1:3])], PLAN)
    assert not zone.mixed


@pytest.mark.parametrize("table", range(16))
def test_what_is_said_of_a_side_holds_for_all_rows_of_the_table(table):
    """Random tables, in which outcomes alternate, differ between seeds at one value, and are missing."""
    draw = random.Random(table)
    share = [draw.choice((0.0, 0.0, 0.03, 0.5, 1.0, 1.0)) for _ in range(11)]
    rows = [
        value(10.0 * at, None if draw.random() < 0.02 else draw.random() < share[at])._replace(seed=seed)
        for at in range(11)
        for seed in range(draw.choice((1, 2, STARTS)))
    ]
    scan = [next(row for row in rows if row.value == 10.0 * at) for at in range(11)]
    good = [row for row in scan if not row.failed]
    changes = [between(*pair) for pair in pairwise(good) if pair[0].outcome(PLAN) != pair[1].outcome(PLAN)]
    study = ThresholdStudy(Scene().replace({"find": ASKED}))
    spans = [(-math.inf, -math.inf)]
    for zone in zones(rows, draw.sample(changes, (len(changes) + 1) // 2), PLAN):
        told = facts(zone)
        for side, upward in (("below", False), ("above", True)):
            if (at := told[f"clear_{side}"]) is None:
                continue
            there = [row for row in rows if row.value == at and not row.failed]
            (outcome,) = {row.outcome(PLAN) for row in there}
            assert told[f"starts_{side}"] == len(there)
            until = told["tried_up_to" if upward else "tried_down_to"]
            beyond = [row for row in rows if min(at, until) <= row.value <= max(at, until) and not row.failed]
            assert told[f"tried_{side}"] == len(beyond)
            assert {row.outcome(PLAN) for row in beyond} == {outcome}
            line = study._clear(zone, upward)
            assert f" in all {len(there) if zone.side(upward).sure else len(beyond)} starts " in line
            assert ("not " in line) != outcome
        begin, end = zone.edges
        inside = [row.value for row in zone.mixed]
        assert inside == sorted(row.value for row in rows if zone.mixed and begin <= row.value <= end)
        assert spans[-1][1] <= begin <= end, "intervals do not overlap"
        assert not zone.mixed or spans[-1][1] < begin
        spans.append((begin, end))


def test_neighbouring_mixed_intervals_have_their_own_clear_sides():
    """No end of the next interval, where other seeds had the other outcome, and no starts made far away at it."""
    many = [value(at, at == 40.0)._replace(seed=100 + k) for at in (40.0, 60.0) for k in range(STARTS)]
    seeds = [(20.0, 1, 1), (20.0, 0, 2), (60.0, 1, 3), (60.0, 0, 4)]
    other = [value(at, measure)._replace(seed=seed) for at, measure, seed in seeds]
    found = values(0, 0, 0, 1, 1, 1, 0, 0, 0)
    first, second = zones([*found, *many, *other], [between(*found[2:4]), between(*found[5:7])], PLAN)
    assert (first.ends, second.ends) == ((20.0, 20.0), (60.0, 60.0))
    assert (first.above.nearest.value, first.above.limit, first.above.last) == (40.0, 60.0, 50.0)
    assert second.above.nearest.value == 70.0
    told = find_lines([first, second])
    assert [line.replace(KEY, "").split()[0] for line in told] == ["up", "mixed", "from"] * 2


def find_lines(found):
    study = ThresholdStudy(Scene().replace({"find": ASKED}))
    return [line for zone in found for line in study._lines_of(zone)]


def test_further_values_lie_beyond_a_mixed_interval_ever_farther():
    places = ScaledKey(PLAN)
    found = values(0, 0, 0, 1, 0, 1, 1, 1, 1, 1, 1)
    (zone,) = zones(found, [between(*found[2:4])], PLAN)
    assert zone.ends == (30.0, 40.0)
    first, *upper = places.beyond(zone, True)
    assert first == pytest.approx(40.8), "8 % of its width away"
    assert len(upper) == VALUES_PER_ROUND - 1
    assert all(40.8 < at < 100.0 for at in upper)
    lower = places.beyond(zone, False)
    assert lower[0] == pytest.approx(29.2)
    assert all(0.0 < at < 30.0 for at in lower)
    narrow = between(value(50.03, 0), value(50.4, 1))
    (zone,) = zones([narrow.low, narrow.high], [narrow], PLAN)
    assert places.beyond(zone, True)[0] == 50.9, "a tolerance from a sharp one, with no more digits"


def test_the_nearest_further_value_has_the_digits_of_the_tolerance_and_is_before_the_next_threshold():
    places = ScaledKey(FindPlan(**ASKED | {"tolerance": 0.1}))
    found = [value(at, measure) for at, measure in ((53.6, 0), (53.7, 1), (60.0, 1), (60.1, 0), (60.16, 0), (60.2, 1))]
    first, second, _ = zones(found, [between(*found[k : k + 2]) for k in (0, 2, 4)], PLAN)
    assert places.beyond(first, True)[0] == 53.8
    narrow = ScaledKey(PLAN).beyond(second, True)
    assert all(60.1 < at < 60.16 for at in narrow[:-1])
    assert narrow[0] == pytest.approx(60.127), "nearer to its own change"


@pytest.mark.parametrize(
    ("measure", "expected"),
    [
        pytest.param(lambda d: max(d, 0.0) ** 0.5, True, id="square root"),
        pytest.param(lambda d: max(d, 0.0), True, id="kink"),
        pytest.param(lambda d: 1.0 * (d > 0.0), False, id="count"),
        pytest.param(lambda d: 0.6 * (d > 0.0) + d, False, id="jump on a slope"),
    ],
)
@pytest.mark.parametrize("at", [0.03, 0.51, 0.99])
def test_a_jump_is_what_does_not_close_when_it_is_refined(measure, expected, at):
    plan = FindPlan(**ASKED | {"expression": "rms_y_m > 0"})
    brackets = [(value(0.0, measure(-at)), value(1.0, measure(1.0 - at)))]
    while (meet := measures_meet(brackets, plan)) is None:
        (low, high), middle = brackets[-1], 0.5 * (brackets[-1][0].value + brackets[-1][1].value)
        new = value(middle, measure(middle - at))
        brackets.append((new, high) if middle < at else (low, new))
        assert len(brackets) < 20
    assert meet == expected


def test_what_differs_by_chance_meets():
    noisy = [value(0.0, 0.49, rms_y_error_m=0.01), value(1.0, 0.51, rms_y_error_m=0.01)]
    assert measures_meet([noisy], PLAN)
    assert measures_meet([[value(0.0, 0.49), value(1.0, 0.51)]], PLAN) is None
    assert measures_meet([[value(0.0, 0.49), ScanPoint(1.0, "scan", {}, [0.0])]], PLAN) is False, (
        "an empty column is no number"
    )


# -- the search, with motions whose outcome is known -------------------------------------------------------------------

#: Where the measure holds although it does not below, and does not although it holds above.
ISLANDS = ((31.0, 33.0), (38.0, 39.0)), ((52.0, 55.0), (61.0, 62.0), (66.0, 66.6))


@pytest.fixture
def known(monkeypatch):
    """Motions whose measure holds above 45, but for islands."""

    def at_value(scene, plan, state, times, key):
        at = scene.motor.critical_torque_n_m
        if at > 90.0:
            return SweepPoint(**failed_record("it took too long", "solver-failure"))
        inside = any(low < at < high for low, high in ISLANDS[at > 45.0])
        row = dict.fromkeys(("rms_x_m", "excitation_frequency_hz", "phase_difference_rad", "motor_power_w"), 1.0)
        row |= {"rms_y_m": float((at > 45.0) != inside), "sync": "antiphase", "motion": "chaotic"}
        row["period"] = 0 if at > 45.0 else None  # as of an exciter that hangs
        return SweepPoint(row | {"outcome": "ok", "detail": "", "multiplier_max": None}, [0.0] * 14)

    monkeypatch.setattr(search, "evaluate", at_value)
    return at_value


def test_the_answer_is_the_value_beyond_which_all_hold_then_the_mixed_interval(known):
    found = find(Scene().replace({"find": ASKED}))
    (row,) = found.thresholds.to_dict("records")
    assert 66.0 < row["mixed_high"] < 66.6, "the last island is found, though it is narrow"
    assert row["mixed_low"] < 33.0
    tried = found.scan[(found.scan[KEY] > row["mixed_high"]) & (found.scan["outcome"] == "ok")]
    assert row["tried_up_to"] == tried[KEY].max()
    assert 66.0 < row["clear_above"] < 72.0
    assert (tried["rms_y_m"] > 0.5).all()
    first, (mixed, below, promise) = found.answer.headline, found.answer.short
    at = row["clear_above"]
    told = rf" from {at:.1f} N·m: rms_y_m > 0\.5 in all {STARTS} starts there; \d+ further values have no clear outcome"
    assert re.fullmatch(re.escape(KEY) + told, first)
    assert re.match(r"mixed from 31\.\d to 66\.\d N·m: ", mixed)
    assert re.match(
        rf"up to (29|3\d)\.\d+ N·m: not rms_y_m > 0\.5 in all {row['tried_below']} starts tried down to ", below
    )
    further = row["tried_above"] - row["starts_above"]
    assert promise == (f"less than 5.0 % of other starts there differ (95 % confidence); none of {further} beyond does")
    (drawn,) = picture.pictures([found])
    assert "in all 104 starts there" in drawn.title
    assert [line.label for line in drawn.lines] == ["rms_y_m > 0.5"], "no line at a value in the mixed interval"


def test_far_from_a_mixed_interval_another_engine_must_agree(known):
    scene = Scene().replace({"find": ASKED})
    result = find(scene)
    cases = ThresholdStudy(scene).cross_check_cases(result, None, lambda scene: scene)
    (row,) = result.thresholds.to_dict("records")
    assert [case.place for case in cases] == [
        f"at {KEY} = {row[name]:.12g}" for name in ("tried_down_to", "tried_up_to")
    ]
    assert [case.row["motor_power_w"] for case in cases] == [1.0, 1.0]
    assert [bool(pd.isna(case.row["period"])) for case in cases] == [True, False]


@pytest.mark.parametrize("machine", range(4))
def test_few_starts_with_other_seeds_fail_where_all_that_were_tried_succeed(known, monkeypatch, machine):
    """Ever fewer fail above 45: a third at 50, the twentieth part at 60, of a thousand 7 at 70."""

    def share(at):
        return math.exp((45.0 - at) / 5.0)

    def by_seed(scene, plan, state, times, key):
        point = known(scene.replace({KEY: min(scene.motor.critical_torque_n_m, 80.0)}), plan, state, times, key)
        at = scene.motor.critical_torque_n_m
        point.row["rms_y_m"] = float(at > 45.0 and random.Random(1000 * machine + key[0]).random() > share(at))
        return point

    monkeypatch.setattr(search, "evaluate", by_seed)
    monkeypatch.setattr(f"{__name__}.ISLANDS", ((), ()))
    found = find(Scene().replace({"find": ASKED}))
    (row,) = found.thresholds.to_dict("records")
    assert share(row["clear_above"]) < MAX_OTHER_FRACTION
    assert row["starts_above"] == STARTS
    there = found.scan[(found.scan[KEY] == row["clear_above"])]
    assert there["seed"].nunique() == STARTS
    assert not found.scan.loc[there.index.symmetric_difference(found.scan.index), "seed"].isin(there["seed"]).any(), (
        "no seed that was seen before"
    )


def test_where_seeds_decide_over_a_wide_range_the_search_ends_soon_with_one_mixed_interval(known, monkeypatch):
    """The scan alternates there: changes that lie in one mixed interval are not narrowed one by one to its end."""

    def by_seed(scene, plan, state, times, key):
        point, at = known(scene, plan, state, times, key), scene.motor.critical_torque_n_m
        in_phase = random.Random(f"{key[0]} {at!r}").random() < 1.0 / (1.0 + math.exp((40.0 - at) / 4.0))
        point.row.update(sync="in-phase" if in_phase else "antiphase")
        return point

    monkeypatch.setattr(search, "evaluate", by_seed)
    plan = {name: ASKED[name] for name in ("key", "start")} | {"stop": 90.0, "compare": "regime"}
    found = find(Scene().replace({"find": plan}))
    ends = found.thresholds[["mixed_low", "mixed_high"]].drop_duplicates()
    assert len(ends) == 1
    assert (found.thresholds[["starts_below", "starts_above"]] == STARTS).all(axis=None)
    assert len(found.scan) < 1000, "rounds go ever farther where many outcomes differ, and end at a contradiction"


@pytest.mark.parametrize("own", [45.0, 120.0])
def test_a_jump_that_only_the_seed_of_the_scene_has_is_no_sharp_threshold(known, monkeypatch, own):
    """Other seeds jump at 72, or the seed of the scene never does."""

    def by_seed(scene, plan, state, times, key):
        point = known(scene, plan, state, times, key)
        if point.state:
            border = own if key[0] == scene.run.seed else 72.0
            point.row["rms_y_m"] = float(scene.motor.critical_torque_n_m > border)
        return point

    monkeypatch.setattr(search, "evaluate", by_seed)
    found = find(Scene().replace({"find": ASKED}))
    (row,) = found.thresholds.drop_duplicates("mixed_high").to_dict("records")
    assert row["mixed_low"] < 80.0
    assert 71.0 < row["mixed_high"] <= 90.0
    assert "±" not in found.answer.headline


def test_a_sharp_jump_withstands_other_seeds(known, monkeypatch):
    monkeypatch.setattr(f"{__name__}.ISLANDS", ((), ()))
    found = find(Scene().replace({"find": ASKED | {"stop": 80.0}}))
    assert found.answer.headline == f"{KEY} = 45.2 ± 0.2 N·m: jump; rms_y_m > 0.5 above"
    assert found.scan["seed"].nunique() > STARTS
    assert found.answer.short[2] == f"from 45.9 N·m: rms_y_m > 0.5 in all {STARTS} starts there"
    assert not any("only" in note for note in found.answer.notes)


def test_a_side_on_which_some_starts_are_captured_says_so_and_how_long_others_take(known, monkeypatch):
    """A synchronization alone does not tell whether exciters have passed a resonance."""

    def captured(scene, plan, state, times, key):
        point, above = known(scene, plan, state, times, key), scene.motor.critical_torque_n_m > 45.0
        point.row.update(sync="in-phase" if above else "antiphase", settle_s=1.0)
        point.row["slow"] = above and key[0] % 3 > 0
        return point

    monkeypatch.setattr(search, "evaluate", captured)
    monkeypatch.setattr(search, "start_time", lambda scene, seconds: {"seconds": 2.0 + scene.run.seed % 3 or None})
    plan = {name: ASKED[name] for name in ("key", "start", "scan", "tolerance")} | {"stop": 80.0, "compare": "regime"}
    found = find(Scene().replace({"find": plan}))
    (row,) = found.thresholds.to_dict("records")
    *_, promise, slow, takes = found.answer.short
    assert promise.startswith("less than 5.0 % of other starts there differ")
    counts = re.fullmatch(r"slow: .* in 0 of (\d+) → (\d+) of (\d+) starts", slow)
    assert [int(counts[1]), int(counts[3])] == [row["tried_below"], row["tried_above"]]
    assert 0.5 < int(counts[2]) / row["tried_above"] < 0.8
    at = [f"a start at {value} N·m takes 2.0 … 4.0 s (20 measured)" for value in ("44.5", "45.9")]
    assert takes == "; ".join(at)
    never = find(Scene().replace({"find": plan | {"start": 46.0}})).answer
    told = re.fullmatch(rf"no threshold: in-phase in all 17 starts from {KEY} = 46 to 80", never.headline)
    assert told
    apart, slow = never.short
    assert apart == "up to 2.8 N·m apart: between them nothing is known"
    assert re.fullmatch(r"slow: .* in \d+ of 17 starts", slow)


@pytest.mark.parametrize(("speed_hz", "slow"), [(5.0, True), (24.9, False)])
def test_a_motor_that_an_overload_holds_far_below_its_synchronous_speed_is_slow(monkeypatch, speed_hz, slow):
    """In rows and in the times of starts, without a resonance that captures it, and whatever notes say."""
    measured = {"excitation_frequency_hz": speed_hz, "frequency_split_hz": 0.0, "impacts_per_period": 0.0}
    row = measured | {"notes": "", "period": 0, "settle_s": 1.0, "simulated_s": 2.0}
    summary = {"measured_from_s": 1.0, "measured_to_s": 2.0, "captured_by": "", "synchronized_at_s": 0.5}
    monkeypatch.setattr(values_of, "measure_point", lambda *_: SweepPoint(row, [0.0] * 14))
    monkeypatch.setattr(values_of, "simulate", lambda *_, keep: SimpleNamespace(summary=measured | summary))
    point = evaluate(Scene(), PLAN, [0.0] * 14, 1, (0,))
    assert ScanPoint(0.0, "scan", point.row, point.state).hangs == slow
    assert values_of.start_time(Scene(), 1.0) == {"seconds": None if slow else 0.5}


@pytest.mark.parametrize("measures", [(0, 0, 1, 1), (0, 1, 0, 1)])
def test_rounds_that_end_early_are_told_of_sharp_and_of_mixed_changes(measures):
    found = values(*measures)
    (zone,) = zones(found, [between(*found[1:3])], PLAN)
    study = ThresholdStudy(Scene().replace({"find": ASKED}))
    (note,) = [
        note for note in study._notes(found, [zone._replace(open_ended=True)]) if "outcomes may be mixed" in note
    ]
    told = "interval from 10.0 to 20.0 N·m: its ends still moved in the last round of starts"
    assert note == f"outcomes may be mixed beyond the {told}"


@pytest.mark.parametrize("above", ["chaotic", "slow", "period 2", "chaotic with some seeds"])
def test_changes_beside_chaos_are_not_narrowed_and_measures_are_named_instead(known, monkeypatch, above):
    """They are at the cost of a sweep up and down; captures and changes between orbits are narrowed."""

    def beside(scene, plan, state, times, key):
        point, at = known(scene, plan, state, times, key), scene.motor.critical_torque_n_m
        luck = key[0] % 2 == 1 and 20.0 < at < 70.0
        chaotic = {"chaotic": (at > 45.0) != luck, "slow": at > 45.0, "period 2": False}.get(above, luck)
        point.row.update(sync="in-phase" if at > 85.0 else "antiphase", rms_y_m=1e-3 + 1e-5 * at, settle_s=1.0)
        point.row.update(motion="chaotic" if chaotic else "periodic", slow=above == "slow" and at > 45.0)
        point.row["period"] = 0 if chaotic else 1 + (at > 45.0)
        return point

    monkeypatch.setattr(search, "evaluate", beside)
    monkeypatch.setattr(search, "start_time", lambda *_: {"seconds": 2.0})
    monkeypatch.setattr(search.ThresholdSearch, "_continuous", lambda *_: False)
    plan = {name: ASKED[name] for name in ("key", "start", "tolerance")} | {"stop": 80.0, "scan": 9}
    if above == "chaotic":
        plan |= {"stop": 90.0, "scan": 10}  # with another synchronization
    found = find(Scene().replace({"find": plan}))
    told = [found.answer.headline, *found.answer.short]
    if above in ("slow", "period 2"):
        assert set(found.thresholds["kind"]) == {"level-crossing"}
        assert not any("told apart" in line for line in told)
        return
    assert told[0].startswith("attractors cannot be told apart over")
    assert "find.compare: regime" in told[1]
    if above == "chaotic":
        assert "20 … 70" in told[0], "another seed decides there"
        assert find(Scene().replace({"find": plan, "run.seed": 1})).answer.headline == told[0]
        assert '"rms_y_m > 0.00145" (1.20 … 1.70 mm there)' in told[2]
        assert told[3] == "at critical torque 30 N·m: antiphase, period 1; with another seed: antiphase, chaotic"
        assert "80 … 90 N·m: antiphase, chaotic → in-phase, chaotic" in told[-1]
        assert set(found.thresholds["kind"]) == {"not-narrowed"}
        assert len(found.scan) <= 2 * 10, "nothing is narrowed"
    assert len(found.scan) < 150, "rounds end as soon as one of their starts is chaotic"


@pytest.mark.parametrize("period", [1, 16])
def test_a_special_point_beside_chaos_is_located(known, monkeypatch, period):
    """Its orbit is known, whatever motion is beyond; but orbits of long periods are met by luck, and not followed."""

    def beside(scene, plan, state, times, key):
        point, chaotic = known(scene, plan, state, times, key), scene.motor.critical_torque_n_m > 45.0
        point.row.update(motion="chaotic" if chaotic else "periodic", period=0 if chaotic else period, settle_s=1.0)
        return point

    def on_branch(self, begin, end, step, evaluated):
        yield from ()
        if begin.value < end:
            return Threshold(begin, begin._replace(value=end), 45.0, "jump", "fold")
        return None

    monkeypatch.setattr(search, "evaluate", beside)
    monkeypatch.setattr(search.ThresholdSearch, "_locate_on_branch", on_branch)
    plan = {name: ASKED[name] for name in ("key", "start", "tolerance")} | {"stop": 80.0, "scan": 9}
    found = find(Scene().replace({"find": plan}))
    if period == 1:
        assert found.answer.headline == f"{KEY} = 45.0 ± 0.5 N·m: jump, fold of the orbit"
    assert set(found.thresholds["kind"]) == {"jump" if period == 1 else "not-narrowed"}
    assert len(found.scan) <= 2 * 9


def test_chaos_beyond_a_special_point_counts_but_not_the_point_itself():
    plan = FindPlan(**{name: ASKED[name] for name in ("key", "start", "stop")})
    rows = {40.0: ("in-phase", 1), 44.0: ("antiphase", 0), 46.0: ("antiphase", 1), 50.0: ("antiphase", 1)}
    found = [value(at, 1.0, sync=sync, period=period, motion="chaotic") for at, (sync, period) in rows.items()]
    special = [between(*found[1:3], special="branch-point")]
    assert indistinct(special, found[1:], plan) is None
    known = indistinct(special, found, plan)
    assert (known.low, known.high) == (40.0, 44.0)


def test_measures_that_meet_do_not_make_a_change_of_synchronization_sharp(known, monkeypatch):
    """Where motion has not settled, measures are so uncertain that they meet: other seeds may still decide."""

    def by_seed(scene, plan, state, times, key):
        point = known(scene, plan, state, times, key)
        above = scene.motor.critical_torque_n_m > 45.0 + 2.0 * (key[0] > scene.run.seed and key[0] % 2)
        point.row.update(sync="in-phase" if above else "antiphase", rms_y_m=1.0)
        return point

    monkeypatch.setattr(search, "evaluate", by_seed)
    plan = {name: ASKED[name] for name in ("key", "start", "scan", "tolerance")} | {"stop": 80.0, "compare": "regime"}
    assert " in all 104 starts there" in find(Scene().replace({"find": plan})).answer.headline


def test_a_synchronization_that_changes_smoothly_along_a_known_orbit_needs_no_other_seeds():
    regime = FindPlan(**{name: ASKED[name] for name in ("key", "start", "stop")} | {"compare": "regime"})
    known_row = {"multiplier_max": 0.9, "rms_x_m": 0.0, "excitation_frequency_hz": 25.0, "phase_difference_rad": 2.094}
    one, other = (value(at, 1.0, **known_row) for at in (1.0, 2.0))
    smooth = between(one, other)._replace(kind="level-crossing")
    unknown = smooth._replace(high=value(2.0, 1.0, **known_row | {"multiplier_max": None}))
    assert not may_depend_on_seed(smooth, regime)
    for case in (unknown, smooth._replace(kind="jump"), smooth._replace(special="fold")):
        assert may_depend_on_seed(case, regime)
    assert not may_depend_on_seed(unknown, PLAN), "an expression says what is measured"


def test_what_was_measured_in_a_transient_is_told(known, monkeypatch):
    def drifting(*arguments):
        point = known(*arguments)
        point.row.update({"motion": "undecided"} if point.state else {})
        return point

    monkeypatch.setattr(search, "evaluate", drifting)
    notes = find(Scene().replace({"find": ASKED})).answer.notes
    assert any("was measured in a transient or has no clear class" in note for note in notes)


def test_periodic_motion_without_a_known_orbit_is_bisected(known, monkeypatch):
    def without_multiplier(*arguments):
        point = known(*arguments)
        point.row.update({"motion": "periodic", "period": 1} if point.state else {})
        point.row.pop("multiplier_max", None)
        return point

    monkeypatch.setattr(search, "evaluate", without_multiplier)
    assert len(find(Scene().replace({"find": ASKED})).thresholds) == 1


def test_undecided_motion_is_no_other_attractor():
    plan = FindPlan(**{name: ASKED[name] for name in ("key", "start", "stop")})
    kinds = ["chaotic", "chaotic", "periodic", "undecided", "periodic", "undecided"]
    found = [value(10.0 * place, 1.0, motion=kind, sync="antiphase", period=0) for place, kind in enumerate(kinds)]
    (zone,) = zones(found, [between(*found[1:3])], plan)
    assert (zone.ends, zone.above.tried, zone.above.unknown) == (None, 2, 2)


# -- real motions ------------------------------------------------------------------------------------------------------


def test_lift_off_is_no_jump_even_just_below_a_value_of_the_scan(kernels):
    plan = {"key": "drive.supply_frequency_hz", "start": 46.2, "stop": 47.54, "scan": 2, "tolerance": 0.02}
    plan |= {"expression": "flight_fraction > 0"}
    scene = load_config(handmade.QUICKSTART, {"solver.engine": "taylor", "find": plan})
    (row,) = find(scene).thresholds.to_dict("records")
    assert (row["kind"], row["below_flight_fraction"]) == ("level-crossing", 0.0)


@pytest.mark.long
def test_motors_from_the_answer_on_start_with_seeds_that_the_search_has_not_used(kernels):
    plan = {"key": "exciters.N.rated_power_w", "start": 200, "stop": 2200, "scan": 5, "tolerance": 1}
    plan |= {"expression": "excitation_frequency_hz > 20"}
    scene = load_config(ROOT / "configs/templates/screen.yaml", {"solver.engine": "taylor", "find": plan})
    (row,) = find(scene, jobs=2).thresholds.to_dict("records")
    assert row["mixed_low"] < 530.0
    assert 620.0 < row["clear_above"] < 800.0
    answer = scene.replace({plan["key"]: row["clear_above"]})
    points = [evaluate(answer, scene.find, None, 1, start_key(scene, 10_000 + k)) for k in range(60)]
    assert sum(point.row["excitation_frequency_hz"] < 20.0 for point in points) <= 6, "more are rare with 5 %"


def test_the_range_of_attractors_that_cannot_be_told_apart_reaches_where_motion_settles_fast():
    """Periodic motion after a long transient may be luck, unless it is weakly damped; a mixed value has measures."""
    plan = FindPlan(**{name: ASKED[name] for name in ("key", "start", "stop")})
    orbit = {"sync": "in-phase", "motion": "periodic", "period": 1, "excitation_frequency_hz": 31.0, "settle_s": 7.0}
    chaos = {"sync": "antiphase", "motion": "chaotic", "period": 0, "rms_y_m": 5e-3}
    late = orbit | {"settle_s": 37.0, "multiplier_max": 0.989}
    found = [value(10.0, 1.0, **chaos), *(value(at, 1.0, rms_y_m=0.0, **late) for at in (20.0, 30.0))]
    found += [value(at, 1.0, rms_y_m=0.0, multiplier_max=0.989, **orbit) for at in (40.0, 50.0)]
    known = indistinct([], found, plan)
    assert (known.low, known.high) == (10.0, 40.0)
    weakly_damped = [one._replace(row=one.row | {"multiplier_max": 0.9995}) for one in found]
    assert indistinct([], weakly_damped, plan).high == 20.0
    mixed = [*found, value(20.0, 1.0, **chaos)]
    known = indistinct([], mixed, plan)
    assert (known.low, known.high, len(known.pairs)) == (10.0, 40.0, 1)
    assert measures_to_ask(known, mixed, plan) == ['"rms_y_m > 0.0025" (0.00 … 5.00 mm there)']
