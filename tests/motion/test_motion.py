"""A motion carried on to a time, to points of its section, to events, and read while it goes."""

import math

import numpy as np
import pytest
from common.known import motion_of

from vibroplat import simulate
from vibroplat.hybrid.loop import EVENT_ROWS
from vibroplat.hybrid.modes import KINDS
from vibroplat.integrate.group import UNREAD_SEGMENTS
from vibroplat.model.energy import FORCE_SIZE
from vibroplat.motion.recorder import Recorder
from vibroplat.observe.section import section_rows
from vibroplat.observe.statistics import Statistics

TURN = 2.0 * math.pi

#: Difference in time that a stop may make in these motions at tolerance 1e-9 (s): the integrator starts anew, and
#: errors of a run against the reference tables are as large.
STOPPED = 1e-7


CASES = {
    "impacts-native": {},
    "one layer-taylor": {"material": {"mass_ratio": 0.1, "layers": 1}, "contact.restitution": 0.3},
    "bare-native": {"material.mass_ratio": 0.0},
    "impacts-sundae": {},
}


@pytest.fixture(
    params=[pytest.param(name, marks=pytest.mark.long) if name.endswith("sundae") else name for name in CASES]
)
def scene(request, quickstart):
    engine = request.param.rpartition("-")[2]
    usual = {"drive.supply_frequency_hz": 50.0, "solver": {"tolerance": 1e-9, "engine": engine}}
    return quickstart.replace({**usual, "run.duration_s": 0.5, **CASES[request.param]})


def events_of(scene, until=None):
    events = Recorder(scene, "events")
    with motion_of(scene) as motion:
        motion.to_time(until or scene.run.duration_s, [events])
    return events.events


def assert_alike(rows, others, within=STOPPED):
    assert [KINDS[k] for k in rows["kind"]] == [KINDS[k] for k in others["kind"]]
    assert np.abs(rows["t"] - others["t"]).max(initial=0.0) <= within


def test_points_of_the_section_are_met_exactly_one_after_the_other(scene):
    whole, seen = Statistics(0.0), Statistics(0.0)
    with motion_of(scene) as motion:
        motion.to_time(0.5, [whole])
    expected = section_rows(whole.measures)
    with motion_of(scene) as motion:
        for point in expected[:8]:
            assert motion.to_section(1, 0.1, [seen])
            assert abs(motion.now - point["t"]) <= STOPPED
            assert abs(motion.state[3] - TURN * round(motion.state[3] / TURN)) <= 1e-12
            assert section_rows(seen.measures)["t"][-1] == pytest.approx(motion.now, abs=1e-13)
        assert motion.to_section(3, 0.2, [seen])
        assert abs(motion.now - expected["t"][10]) <= STOPPED
        assert motion.state[3] == pytest.approx(11 * TURN, abs=1e-12)
    assert np.abs(section_rows(seen.measures)["t"] - expected["t"][:11]).max() <= STOPPED
    assert seen.measures.marks["turns"] == 11


def test_the_first_of_an_event_and_an_angle_ends_a_step(scene):
    """Angles just before each event are met before it, those just after it in the next segment."""
    run = simulate(scene.replace({"run.duration_s": 0.2}))
    for t in run.events["t_s"][:2]:
        for ahead in (-1e-2, -1e-5, 1e-5, 1e-2):
            angle = float(run(t)["phi1_rad"].iloc[0]) + ahead
            with motion_of(scene) as motion:
                motion.automaton.run["target"] = angle
                seen = Recorder(scene, "events")
                motion.to_time(0.5, [seen])
                assert motion.state[3] == pytest.approx(angle, abs=1e-12)
            assert len(seen.events) == (run.events["t_s"] < t).sum() + (ahead > 0.0)


def test_a_motion_stopped_at_times_and_at_its_section_goes_on_as_before(scene):
    seen = Recorder(scene, "events")
    with motion_of(scene) as motion:
        for time in (0.1, 0.1234, 0.1235):
            motion.to_time(time, [seen])
            assert motion.now == time
        assert not motion.to_section(2, 0.01, [seen])  # it does not get there
        assert motion.now == pytest.approx(0.1335)
        for _ in range(5):
            assert motion.to_section(1, 0.1, [seen])
        motion.to_time(0.5, [seen])
    assert_alike(seen.events, events_of(scene))


def test_parts_of_a_motion_add_up(scene):
    with motion_of(scene) as motion:
        whole = motion.advance(0.5)
        events = motion.events
    with motion_of(scene) as motion:
        parts = [motion.advance(0.1) for _ in range(5)]
        assert motion.events == events
    assert sum(part.measures.marks["turns"] for part in parts) == whole.measures.marks["turns"]
    assert (sum(part.measures.marks["counts"] for part in parts) == whole.measures.marks["counts"]).all()
    work, expected = sum(part.measures.work for part in parts)[:FORCE_SIZE], whole.measures.work[:FORCE_SIZE]
    assert np.abs(work - expected).max() <= 1e-6 * np.abs(expected).max()


class Counter:
    def __init__(self):
        self.steps = self.events = self.chatters = 0
        self.seconds = 0.0

    def read(self, h):
        for piece in h.steps.pieces[: h.steps.used["pieces"]]:
            rows = slice(int(piece["first"]), int(piece["end"]))
            self.steps += rows.stop - rows.start
            self.seconds += h.steps.length[rows].sum()
        self.events += int(h.run["events"])
        self.chatters += int((h.events["kind"][: h.run["events"]] == KINDS.index("chatter")).sum())


def test_observers_see_each_step_and_event_once(scene, monkeypatch):
    name = scene.solver.engine
    monkeypatch.setattr(f"vibroplat.integrate.{name}.{name.capitalize()}Engine.rows", 8)
    counter, segments = Counter(), Recorder(scene, "segments")
    with motion_of(scene) as motion:
        for time in (0.2, 0.3, 0.5):
            motion.to_time(time, [counter, segments])
        steps = motion.engine.work["steps"]
    assert counter.seconds == pytest.approx(0.5, abs=1e-12)
    assert counter.events == len(events_of(scene, 0.5))
    # a chatter is a step of its own; where the guard's root is at the very end of a step, another adds nothing
    assert counter.steps == steps + counter.chatters
    assert [segment.start for segment in segments.segments[1:]] == [segment.end for segment in segments.segments[:-1]]


@pytest.mark.parametrize(
    "changes",
    [
        {"contact.restitution": 0.5, "material.mass_ratio": 0.2, "drive.supply_frequency_hz": 51.5},
        {"transport": {"friction": 0.5, "deck_angle_deg": 5.0}},
    ],
    ids=["accumulating impacts", "transport"],
)
def test_a_motion_that_nobody_reads_is_the_same(quickstart, changes):
    """It has more events than there is room for: it is told of them in parts."""
    scene, found = quickstart.replace({"solver.engine": "taylor", **changes}), []
    for observers in ([], [Counter()]):
        with motion_of(scene) as motion:
            motion.to_time(40.0, observers)
            assert motion.events > EVENT_ROWS
            found.append((motion.state.tolist(), motion.events, motion.engine.work, motion.restarts))
    assert found[0] == found[1]


def test_a_long_motion_that_nobody_reads_can_be_interrupted(quickstart, monkeypatch):
    scene, calls = quickstart.replace({"solver.engine": "taylor", "material.mass_ratio": 0.0}), []
    with motion_of(scene) as motion:
        monkeypatch.setattr(motion, "go_on", lambda go_on=motion.go_on: (go_on(), calls.append(motion.now)))
        motion.to_time(3.5 * UNREAD_SEGMENTS * 10 * TURN / scene.speed_scale)
    assert len(calls) == 4


def test_a_motion_that_begins_again_is_a_new_one(quickstart):
    scene = quickstart.replace({"drive.program": [{"t_s": 0.1, "supply_frequency_hz": 50.0}]})
    found = []
    with motion_of(scene) as motion:
        state = motion.state
        for _ in range(2):
            motion.to_time(0.3)
            found.append((motion.now, motion.events, motion.state))
            motion.reset(state)
            assert (motion.now, motion.events) == (0.0, 0)
            np.testing.assert_array_equal(motion.state, state)
    assert found[0][:2] == found[1][:2]
    np.testing.assert_array_equal(found[0][2], found[1][2])


@pytest.mark.parametrize("engine", ["native", "taylor"])
def test_steps_are_counted_anew_where_a_motion_begins_again(quickstart, engine, monkeypatch):
    """However often it does, no stretch takes as many steps as one that is stuck."""
    monkeypatch.setattr("vibroplat.integrate.interface.MAX_STEPS", 400)
    scene = quickstart.replace({"solver.engine": engine, "solver.max_events_per_period": 6})
    with motion_of(scene) as motion:
        state = motion.state
        for stretch in range(240):
            motion.reset(state)
            motion.to_time(0.1 if stretch % 2 else 0.01)  # of several turns, or shorter than one
            assert motion.outcome == "ok", motion.detail
