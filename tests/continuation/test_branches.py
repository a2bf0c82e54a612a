"""Branches, boundaries and single orbits of a machine whose special points are known."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from common.known import motion_of
from common.orbits import traced
from common.places import QUICKSTART

from continuation.helpers import MACHINE
from vibroplat import load_config, orbit
from vibroplat.continuation.first_orbit import OrbitError, guesses
from vibroplat.continuation.orbit import with_initial_state
from vibroplat.continuation.shooting import Shooter
from vibroplat.hybrid.state import state_scales

CALIBRATED = MACHINE.parents[2] / "configs" / "machines" / "calibrated.yaml"
KEY, MASS, RESTITUTION = "drive.supply_frequency_hz", "material.mass_ratio", "contact.restitution"
#: Range in which impacts with a restitution of 0.3 accumulate no longer, down to a single one.
REBOUNDS = {"restitution": 0.3, "start": 50.0, "stop": 54.0, "switch": []}

#: Special points at these mass ratios, found by another program of the same model: supply frequency or, above 1 in the
#: third place, excitation frequency (Hz).
KNOWN = [
    (0.0, "branch-point", "value", (61.974, 62.617, 69.264, 71.190)),
    (0.1, "liftoff", "excitation_frequency_hz", (24.06,)),
    (0.1, "end-of-sticking", "excitation_frequency_hz", (26.93,)),
    (0.1, "period-doubling", "excitation_frequency_hz", (27.332,)),
    (0.1, "neimark-sacker", "excitation_frequency_hz", (28.28,)),
    (0.2, "liftoff", "excitation_frequency_hz", (23.92,)),
    (0.2, "end-of-sticking", "excitation_frequency_hz", (27.53,)),
    (0.2, "period-doubling", "excitation_frequency_hz", (28.129,)),
    (0.2, "neimark-sacker", "excitation_frequency_hz", (28.78,)),
]


def machine(mass, engine="taylor", restitution=0.0, **changes):
    """The machine, with its whole range of frequencies as the plan of its branches."""
    plan = {"key": KEY, "start": 42.0, "stop": 80.0} | changes
    return load_config(MACHINE, {"solver.engine": engine, MASS: mass, RESTITUTION: restitution, "orbits": plan})


class Branches(dict):
    """Branches by mass ratio, followed when they are first asked for."""

    def __missing__(self, mass):
        self[mass] = traced(machine(mass))
        return self[mass]


@pytest.fixture(scope="module")
def branches():
    return Branches()


#: Mass ratios, of which that in the middle is left to long tests.
MASSES = pytest.mark.parametrize("mass", [0.0, pytest.param(0.1, marks=pytest.mark.long), 0.2])


@pytest.fixture(scope="module")
def rebounding():
    """The branch at a mass ratio of 0.2 with restitution."""
    (branch,) = traced(machine(0.2, **REBOUNDS))
    return branch


@MASSES
def test_special_points_are_where_they_were_found_before(branches, mass):
    for _, kind, column, places in (known for known in KNOWN if known[0] == mass):
        special = [s for branch in branches[mass] for s in branch.special if s["kind"] == kind]
        for place in places:
            digits = len(str(place).partition(".")[2])
            assert min(abs(s[column] - place) for s in special) <= max(0.002, 0.6 * 10.0**-digits), (mass, kind)


def test_ranges_end_before_what_lies_beyond_them(branches):
    beyond = next(s["value"] for s in branches[0.2][0].special if s["kind"] == "period-doubling")
    (branch,) = traced(machine(0.2, start=beyond - 1.0, stop=beyond - 0.005, switch=[]))
    assert branch.rows[-1]["value"] == pytest.approx(beyond - 0.005, rel=1e-14)
    assert all(special["value"] < beyond - 0.005 for special in branch.special)


@pytest.mark.parametrize("stop", [52.4, 54.2])
def test_ranges_end_where_they_are_told_though_the_section_moves_there(stop):
    (branch,) = traced(machine(0.2, start=stop - 1.5, stop=stop, switch=[], step={"first": 0.2, "max": 0.3}))
    assert branch.ended == "stop of the key's range"
    assert branch.rows[-1]["value"] == stop


@MASSES
def test_branches_go_through_the_whole_range_in_both_synchronizations(branches, mass):
    rows = [row for branch in branches[mass] for row in branch.rows]
    if mass == 0.0:
        assert {row["stable"] for row in rows if row["sync"] == "intermediate"} == {False}
    assert not any(branch.failed for branch in branches[mass])
    for sync in ("antiphase", "in-phase"):
        values = [row["value"] for row in rows if row["sync"] == sync]
        assert (min(values), max(values)) == (42.0, 80.0)
    # points are orbits and cost few turns
    assert max(row["residual"] for row in rows) < 1e-8
    assert sum(row["turns"] / row["period"] for row in rows) < 6.0 * len(rows)
    assert {row["period"] for row in rows} == {1}


@pytest.mark.long
def test_no_special_point_is_missed_by_long_steps(branches):
    """Steps a fifth as long find the same points, at the same places."""
    span = 80.0 - 42.0
    found = [branches[0.2], traced(machine(0.2, step={"max": span / 200.0}))]
    kinds = ("fold", "liftoff", "end-of-sticking", "period-doubling", "neimark-sacker", "branch-point", "grazing")
    for kind in kinds:
        few, many = (
            np.array([s["value"] for branch in family for s in branch.special if s["kind"] == kind]) for family in found
        )
        assert few.size == many.size == 0 or np.abs(few[:, None] - many).min(axis=0).max() < 1e-5, kind
        assert few.size == 0 or np.abs(few[:, None] - many).min(axis=1).max() < 1e-5, kind


def test_engines_agree_on_orbits():
    ends = {"start": 47.0, "stop": 48.5, "switch": []}
    by_engine = [traced(machine(0.1, engine, **ends))[0] for engine in ("taylor", "native")]
    # native's steps are cubics, between whose ends a state is good to some 1e-8
    first, second = ([s["value"] for s in branch.special] for branch in by_engine)
    assert first == pytest.approx(second, abs=1e-6)
    ends = [branch.rows[-1] for branch in by_engine]
    for name in ("period_s", "rms_y_m", "multiplier_1_re", "contact_force_max_n"):
        assert ends[0][name] == pytest.approx(ends[1][name], rel=1e-6)


def farthest(row, mass, seconds, restitution=0.0):
    """Follow an orbit disturbed by 1e-3; its distance from the orbit at the section in the first and last turns."""
    scene = machine(mass, restitution=restitution).replace({KEY: row["value"], "solver.tolerance": 1e-9})
    scales, start = state_scales(scene), np.array(row["state"])
    rates = np.random.default_rng(0).standard_normal(5)
    begun = start.copy()
    begun[7:12] += 1e-3 * scales[7:12] * rates / np.linalg.norm(rates)
    turns = int(seconds / row["period_s"])
    with motion_of(scene, begun) as motion:
        motion.to_time(seconds)
        motion.to_section(1, 1.0)
        disturbed = motion.state
        motion.reset(start)
        motion.to_section(1, 1.0)
        own = motion.state
    assert turns > 100
    difference = (disturbed - own) / scales
    difference[3:5] -= 2.0 * np.pi * np.round(difference[3:5] / (2.0 * np.pi))
    return float(np.abs(difference).max())


#: Special points with restitution as far as impacts are few: kind, impacts of the orbit next to it, supply frequency.
FEW_IMPACTS = [
    ("grazing", 3, 51.437912),
    ("fold", 3, 51.379888),
    ("period-doubling", 3, 51.394662),
    ("grazing", 2, 51.746617),
    ("fold", 2, 51.401103),
    ("period-doubling", 2, 51.450892),
    ("grazing", 1, 53.161387),
    ("fold", 1, 50.714276),
    ("period-doubling", 1, 51.381290),
    ("neimark-sacker", 1, 52.269419),
]


def few_impacts(branch):
    """Special points of a branch as in FEW_IMPACTS."""
    places = [(s["kind"], s["word"].count("I"), s["value"]) for s in branch.special if s["word"] in ("I", "II", "III")]
    return sorted(places, key=lambda place: place[1:])


@pytest.mark.parametrize(
    ("engine", "tolerance"), [("taylor", 1e-8), pytest.param("native", 1e-10, marks=pytest.mark.long)]
)
def test_branches_go_through_grazing_with_fewer_and_fewer_impacts(engine, tolerance):
    """The same special points whatever the engine and the tolerance, up to where impacts accumulate."""
    (branch,) = traced(machine(0.2, engine, tolerance=tolerance, step={"max": 0.1}, **REBOUNDS))
    assert branch.ended == "stop of the key's range"
    expected = sorted(FEW_IMPACTS, key=lambda place: place[1:])
    found = few_impacts(branch)
    assert [place[:2] for place in found] == [place[:2] for place in expected]
    assert [place[2] for place in found] == pytest.approx([place[2] for place in expected], abs=2e-6)


@pytest.mark.long
def test_branches_go_through_grazing_with_more_and_more_impacts(rebounding):
    """The branch back from its end, to where impacts accumulate."""
    row = rebounding.rows[-1]
    back = REBOUNDS | {"start": row["value"], "stop": 50.0, "from": "state"}
    (branch,) = traced(with_initial_state(machine(0.2, **back).replace({KEY: row["value"]}), np.array(row["state"])))
    places = {place[:2]: place[2] for place in reversed(few_impacts(branch))}
    assert places == pytest.approx({place[:2]: place[2] for place in FEW_IMPACTS}, abs=2e-6)


def test_orbits_with_a_single_impact_stay_where_they_are_stable(rebounding):
    """Between fold and period doubling, beside orbits whose impacts accumulate."""
    single = [row for row in rebounding.rows if row["sequence"] == "impact"]
    stable = [row for row in single if row["stable"]]
    assert len(stable) >= 3
    assert all(50.714 < row["value"] < 51.382 for row in stable)
    assert max(farthest(row, 0.2, 60.0, 0.3) for row in stable if row["value"] < 51.3) < 1e-5
    unstable = [row for row in single if abs(row["multiplier_1_re"]) > 1.2]
    assert min(farthest(row, 0.2, 60.0, 0.3) for row in unstable[::4]) > 1e-2


def test_orbits_and_branches_count_the_same_multipliers_as_unstable(branches):
    """At a branch point a multiplier is 1 but for its error."""
    branch = next(b for b in branches[0.0] if b.ended == "mirror image beyond")
    row = branch.rows[-1]
    assert abs(np.abs(row["multiplier_1_re"]) - 1.0) < 1e-5
    scene = load_config(MACHINE, {"solver.engine": "taylor", MASS: 0.0, KEY: row["value"]})
    found = orbit(scene, row["state"])
    for size, unstable in ((1.0 + 1e-7, 0), (1.0 + 1e-5, 1)):
        assert replace(found, multipliers=np.array([size + 0.0j])).unstable == unstable
    assert found.unstable == row["n_unstable"]


def test_branches_end_where_the_law_of_impact_jumps_and_say_so():
    plan = {"key": KEY, "start": 49.0, "stop": 51.0, "switch": []}
    scene = load_config(CALIBRATED, {"solver.engine": "taylor", MASS: 0.2, RESTITUTION: 0.7, "orbits": plan})
    (branch,) = traced(scene)
    assert branch.failed
    assert branch.ended == (
        "no further orbit found: an impact reaches contact.restitution_threshold_m_per_s, where rebounds begin"
    )


def test_doubled_periods_end_where_they_begin():
    scene = load_config(CALIBRATED, {"solver.engine": "taylor", MASS: 0.2})
    single, double = (
        traced(scene.replace({"orbits": {"key": KEY, "start": start, "stop": stop, "switch": [], "period": period}}))[0]
        for start, stop, period in ((59.5, 60.2, 1), (61.5, 55.0, 2))
    )
    (begins,) = [s["value"] for s in single.special if s["kind"] == "period-doubling"]
    assert double.ended == "half the period beyond"
    assert not double.failed
    assert (double.special[-1]["kind"], double.special[-1]["period"]) == ("period-doubling", 2)
    assert double.special[-1]["value"] == pytest.approx(begins, abs=1e-6)
    assert double.rows[-1]["value"] == pytest.approx(begins, abs=1e-6)


def test_an_orbit_is_found_from_all_guesses():
    scene = load_config(MACHINE, {"solver.engine": "taylor", MASS: 0.2, KEY: 50.0})
    settled = orbit(scene)
    assert (settled.sequence, settled.period, settled.stable) == ("liftoff stick", 1, True)
    assert settled.residual < 1e-8
    assert repr(settled).splitlines()[1] == "  event sequence        liftoff stick"
    run = settled.run
    assert run.summary["simulated_s"] == pytest.approx(settled.period_s)
    assert run.final_state[[0, 1, 2]] == pytest.approx(settled.state[[0, 1, 2]], abs=1e-9)
    for guess in (settled, settled.state, run, run.trajectory.iloc[3]):
        again = orbit(scene, guess)
        assert again.period_s == pytest.approx(settled.period_s, rel=1e-9)
        assert np.abs(again.multipliers[:3]) == pytest.approx(np.abs(settled.multipliers[:3]), abs=1e-6)


def test_speeds_of_a_guess_follow_the_supply(tmp_path):
    scene = load_config(QUICKSTART, {"solver.engine": "taylor"})
    moved = scene.replace({KEY: 58.0})
    near, wanted = orbit(scene), orbit(moved)
    for guess in (near, near.run, near.run.save(tmp_path / "near")):
        assert orbit(moved, guess).period_s == pytest.approx(wanted.period_s, rel=1e-9)


def test_a_guess_leads_to_orbits_of_other_supplies(caplog):
    """By steps, past 53 Hz, and where these end at an unstable branch, by settling. Unstable orbits are noted."""
    scene = load_config(QUICKSTART, {"solver.engine": "taylor"})
    near = orbit(scene)
    for supply, stable in ((55.0, True), (56.0, True), (65.0, False), (70.0, True)):
        caplog.clear()
        found = orbit(scene.replace({KEY: supply}), near)
        assert (found.scene.drive.supply_frequency_hz, found.stable) == (supply, stable)
        assert found.excitation_frequency_hz == pytest.approx(0.5 * supply, rel=0.02)
        assert any("the orbit is unstable" in line for line in caplog.messages) == (not stable)
        assert found.residual <= 1e-8
    assert found.scene.run == scene.run


def test_a_motion_goes_on_settling_after_a_search_in_vain():
    scene = machine(0.2, start=50.0)
    undisturbed, searched = [], []
    for found, disturb in ((undisturbed, False), (searched, True)):
        with closing(Shooter(scene)) as shooter:
            for state in guesses(shooter, None):
                found.append(state)
                if disturb:
                    shooter.shot(np.where(np.arange(14) == 9, 100.0, state), 0.01)
    assert len(searched) == 3
    for one, other in zip(undisturbed, searched, strict=True):
        assert np.delete(other, [3, 4]) == pytest.approx(np.delete(one, [3, 4]), rel=1e-6, abs=1e-9)


def test_an_unstable_orbit_is_found_from_chaos():
    found = orbit(load_config(CALIBRATED, {"solver.engine": "taylor", MASS: 0.02, KEY: 60.0}))
    assert found.sequence == "impact"
    assert abs(found.multipliers[0]) == pytest.approx(4.72, abs=0.01)  # as followed from 56 Hz


def test_an_orbit_that_is_not_there_is_told_with_its_residuals():
    scene = load_config(MACHINE, {"solver.engine": "taylor", MASS: 0.2, KEY: 50.0})
    with pytest.raises(OrbitError, match=r"orbits.period = 2 but the motion repeats after 1; allowed: 1"):
        orbit(scene, period=2)
    state = orbit(scene).state
    state[7:12] += 30.0 * state_scales(scene)[7:12]
    with pytest.raises(OrbitError, match=r"no orbit of period 1 near the guess: .*; last residuals: \d"):
        orbit(scene, state)


def test_motion_that_settles_to_another_period_is_told(monkeypatch):
    """In chaos about an orbit whose largest multiplier is 19, so that near returns meet it by chance alone: none."""
    monkeypatch.setattr(Shooter, "returns", lambda shooter, turns: iter(()))
    with pytest.raises(OrbitError, match=r"does not repeat after 1 turns; .*; continue one from where the motion is p"):
        orbit(load_config(CALIBRATED, {"solver.engine": "taylor", MASS: 0.02, KEY: 62.0}))
