"""A supply over time: what a program means between and at its entries."""

import math
from itertools import pairwise

import pytest

from vibroplat import Drive, Scene
from vibroplat.config.drive import MIN_FREQUENCY_RATIO, interval_at
from vibroplat.errors import ConfigError
from vibroplat.study.branches import branches


def test_sweep_refuses_a_supply_and_a_start_of_its_own(scene_of, here, command):
    """A scene with both is a scene: it can be run."""
    program = "drive: {program: [{t_s: 0, supply_frequency_hz: 50}]}"
    for text, line in (
        (program, "drive.program is given, but a sweep sets the supply itself; "),
        ("run: {initial: {from: x}}", "run.initial.from is given, but a sweep cannot start from a run; "),
    ):
        with pytest.raises(ConfigError) as caught:
            branches(scene_of(f"{text}\nsweep: {{supply_frequency_hz: {{start: 40, stop: 50}}}}"))
        assert str(caught.value).startswith(line)
        assert command("sweep", "c.yaml") == (2, "", f"vibroplat: c.yaml: {caught.value}\n")
        assert [path.name for path in here.iterdir()] == ["c.yaml"]


def drive(*entries):
    """Make a drive of entries (time, frequency) and their switches."""
    keys = ("t_s", "supply_frequency_hz")
    return Drive(program=[dict(zip(keys, entry[:2], strict=False)) | dict(*entry[2:]) for entry in entries])


def test_constant_supply_is_one_interval_without_a_beginning():
    (interval,) = Drive(supply_frequency_hz=46.0).intervals
    assert (interval.start, interval.end) == (-math.inf, math.inf)
    assert [interval.frequency_at(time) for time in (0.0, 1e9)] == [46.0, 46.0]
    assert interval.driven == (True, True)


def test_a_changed_supply_has_its_own_intervals():
    first = drive((0.0, 20.0), (2.0, 30.0))
    assert first.intervals is first.intervals
    second = first.model_copy(update={"program": first.program[:1]})
    assert (len(first.intervals), len(second.intervals)) == (2, 1)


def test_frequency_is_linear_between_entries_and_stays_after_the_last():
    example = drive((1.0, 20.0), (3.0, 50.0), (8.0, 45.0))
    for time, frequency in ((1.0, 20.0), (2.0, 35.0), (3.0, 50.0), (4.0, 49.0), (8.0, 45.0), (1e6, 45.0)):
        assert example.at(time).frequency_at(time) == pytest.approx(frequency, rel=1e-15)
    assert [interval.corner for interval in example.intervals] == [True] * 3
    assert example.largest_frequency == 50.0
    assert example.at(0.0).start == 1.0  # before the program is its beginning


def test_frequency_jumps_where_two_entries_share_a_time():
    example = drive((0.0, 20.0), (2.0, 30.0), (2.0, 50.0), (3.0, 50.0))
    before, after, _ = example.intervals
    assert (before.end, after.start) == (2.0, 2.0)
    assert before.frequency_at(2.0) == 30.0
    assert example.at(2.0).frequency_at(2.0) == after.frequency_at(2.0) == 50.0
    ends = drive((0.0, 20.0), (0.0, 30.0), (1.0, 30.0), (1.0, 10.0)).intervals
    assert [(i.start, i.end, i.frequency) for i in ends] == [(0.0, 1.0, 30.0), (1.0, math.inf, 10.0)]


def test_left_out_values_are_those_before():
    example = drive((0.0, 20.0), (1.0, None, {"exciter_2": "off"}), (2.0, 40.0), (3.0, None, {"off": True}))
    assert [(i.frequency, i.ramp, i.driven) for i in example.intervals] == [
        (20.0, 0.0, (True, True)),
        (20.0, 20.0, (True, False)),
        (40.0, 0.0, (True, False)),
        (40.0, 0.0, (False, False)),
    ]
    again = drive((0.0, 20.0, {"off": True}), (1.0, None, {"exciter_1": "on"}), (2.0, None, {"off": False}))
    assert [i.driven for i in again.intervals] == [(False, False), (True, False), (True, True)]


def test_switches(scene_of):
    """YAML 1.1, which editors and other programs write, takes on and off for true and false."""
    for switches, driven in (
        ("exciter_1: off", (False, True)),
        ("exciter_1: false", (False, True)),
        ("exciter_2: off, exciter_1: on", (True, False)),
        ("exciter_2: true", (True, True)),
        ("off: true", (False, False)),
        ("off: false", (True, True)),
    ):
        text = f"drive: {{program: [{{t_s: 0, supply_frequency_hz: 50, {switches}}}]}}"
        assert scene_of(text).drive.intervals[0].driven == driven


def test_slip_speeds_follow_the_frequency_to_a_thousandth_of_the_largest():
    """Where a ramp passes it, an interval ends that is no corner; both parts go on as one ramp."""
    rising, low, falling, lowest = (
        drive((0.0, 0.0), (5.0, 50.0), (9.0, 10.0), (10.0, 0.0)).intervals[:2]
        + drive((0.0, 50.0), (10.0, 0.0)).intervals[:2]
    )
    least = 50.0 * MIN_FREQUENCY_RATIO
    assert (rising.start, rising.end, rising.slip_frequency, rising.corner) == (0.0, 0.005, (least, 0.0), True)
    assert (low.start, low.end, low.slip_frequency, low.corner) == (0.005, 5.0, (least, 10.0), False)
    assert low.frequency == pytest.approx(least, rel=1e-12)
    assert (falling.slip_frequency, falling.corner) == ((50.0, -5.0), True)
    assert (lowest.slip_frequency, lowest.corner) == ((least, 0.0), False)
    assert lowest.start == pytest.approx(9.99, rel=1e-12)
    assert lowest.frequency_at(10.0) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("frequencies", [(0.0, 0.04), (0.04, 0.0), (0.05, 0.0), (0.0, 0.0)])
def test_ramps_below_a_thousandth_are_whole(frequencies):
    first, second = frequencies
    intervals = drive((0.0, 50.0), (1.0, 50.0), (1.0, first), (2.0, second), (2.0, 50.0)).intervals
    assert len(intervals) == 3
    assert intervals[1].slip_frequency == (50.0 * MIN_FREQUENCY_RATIO, 0.0)


def test_intervals_cover_the_time_without_gaps():
    entries = [(0.1 * i, (i * 37) % 50) for i in range(40)]
    found = drive(*entries).intervals
    assert [(a.end, b.start) for a, b in pairwise(found) if a.end != b.start] == []
    assert (found[0].start, found[-1].end) == (0.0, math.inf)
    for before, after in pairwise(found):
        assert interval_at(found, before.end) is after
        assert interval_at(found, math.nextafter(before.end, -1.0)) is before
        assert after.frequency == pytest.approx(before.frequency_at(before.end), abs=1e-9)
        at_end = before.slip_frequency[0] + before.slip_frequency[1] * (before.end - before.start)
        assert after.slip_frequency[0] == pytest.approx(at_end, abs=1e-9)
    assert sum(interval.corner for interval in found) == len(entries)


def test_scales_follow_the_largest_frequency():
    scene = Scene(drive=drive((0.0, 0.0), (1.0, 60.0), (2.0, 10.0)))
    assert scene.synchronous_speeds == Scene(drive=Drive(supply_frequency_hz=60.0)).synchronous_speeds


def test_a_supply_changes_until_the_end_of_its_ramp():
    """Of which a part near 0 Hz is an interval of its own."""
    drive = Drive.model_validate(
        {"program": [{"t_s": 0, "supply_frequency_hz": 0}, {"t_s": 3600, "supply_frequency_hz": 50}]}
    )
    assert [drive.last_change(time) for time in (1.0, 1000.0, 4000.0)] == [3600.0] * 3
