"""A supply over time: what is told about a program, and what it means between and at its entries."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from vibroplat import Drive, Scene
from vibroplat.config.drive import FREQUENCY, LEAST_SHARE, MOST_ENTRIES, interval_at
from vibroplat.config.reader import parse_overrides
from vibroplat.errors import ConfigError
from vibroplat.study.branches import branches

ENTRY = "t_s, supply_frequency_hz, exciter_1, exciter_2, off"


def program(*entries):
    """Text of a configuration with these entries."""
    return f"drive: {{program: [{', '.join(f'{{{entry}}}' for entry in entries)}]}}"


START = "t_s: 0, supply_frequency_hz: 50"

MESSAGES = {
    "empty": (program(), "drive: program is empty; allowed: one entry or more"),
    "no list": ("drive: {program: {t_s: 0}}", "drive.program = {'t_s': 0}; allowed: a list"),
    "number for an entry": ("drive: {program: [3]}", "drive.program.0 = 3; allowed: a section of keys and values"),
    "times that fall back": (
        program(START, "t_s: 2", "t_s: 1"),
        "drive: program.2.t_s = 1.0 lies before 2.0; allowed: times in ascending order",
    ),
    "three at one time": (
        program(START, "t_s: 2", "t_s: 2", "t_s: 2"),
        "drive: program.3.t_s = 2.0 is given three times; allowed: twice, for a jump",
    ),
    "negative time": (
        program("t_s: -1, supply_frequency_hz: 50"),
        "drive.program.0.t_s = -1; allowed: at least 0.0",
    ),
    "time that is no number": (
        program("t_s: .nan, supply_frequency_hz: 50"),
        "drive.program.0.t_s = nan; allowed: a finite number",
    ),
    "no time": (
        program("supply_frequency_hz: 50"),
        "drive.program.0.t_s = {'supply_frequency_hz': 50}; allowed: a value is required",
    ),
    "negative frequency": (
        program(START, "t_s: 1, supply_frequency_hz: -1"),
        "drive.program.1.supply_frequency_hz = -1; allowed: at least 0.0",
    ),
    "no frequency in the first entry": (
        program("t_s: 0", "t_s: 1, supply_frequency_hz: 50"),
        "drive: program.0: supply_frequency_hz is required in the first entry",
    ),
    "never a frequency": (
        program("t_s: 0, supply_frequency_hz: 0", "t_s: 1"),
        "drive: program has no supply_frequency_hz above 0; allowed: at least one, the scales follow it",
    ),
    "constant supply beside": (
        "drive: {supply_frequency_hz: 50, program: [{t_s: 0, supply_frequency_hz: 50}]}",
        "drive: supply_frequency_hz and program are both given; allowed: one of the two",
    ),
    "no constant supply and no program": (
        "drive: {supply_frequency_hz: }",
        "drive: supply_frequency_hz = None; allowed: a number, or a program instead",
    ),
    "neither on nor off": (
        program(f"{START}, exciter_1: maybe"),
        "drive.program.0.exciter_1 = 'maybe'; allowed: 'on' or 'off'",
    ),
    "number for on or off": (
        program(f"{START}, exciter_2: 0"),
        "drive.program.0.exciter_2 = 0; allowed: 'on' or 'off'",
    ),
    "off as a text": (program(f"{START}, off: off"), "drive.program.0.off = 'off'; allowed: true or false"),
    "off and one of them": (
        program(f"{START}, exciter_1: off, off: true"),
        "drive.program.0: off and exciter_1 are both given; allowed: one of the two",
    ),
    "third exciter": (
        program(f"{START}, exciter_3: off"),
        f"unknown key drive.program.0.exciter_3; did you mean exciter_2? allowed: {ENTRY}",
    ),
    "key without its unit": (
        program("t_s: 0, supply_frequency: 50"),
        f"unknown key drive.program.0.supply_frequency; did you mean supply_frequency_hz? allowed: {ENTRY}",
    ),
    "too many turns": (
        program("t_s: 0, supply_frequency_hz: 3e9"),
        "run.duration_s = 4.0 takes 6e+09 turns at the synchronous speed; allowed: at most 1e+09",
    ),
    "swept by the grid": (
        "sweep: {supply_frequency_hz: {start: 40, stop: 50}, grid: {drive.supply_frequency_hz: [50]}}",
        "sweep: grid.drive.supply_frequency_hz cannot be swept by the grid; allowed: keys of machine, material, …",
    ),
    "a program swept by the grid": (
        "sweep: {supply_frequency_hz: {start: 40, stop: 50}, grid: {drive.program.1.t_s: [2]}}",
        "sweep: grid.drive.program.1.t_s cannot be swept by the grid; allowed: keys of machine, material, …",
    ),
}


@pytest.mark.parametrize("case", MESSAGES)
def test_message(case, complaint):
    text, line = MESSAGES[case]
    assert complaint(text) == f"c.yaml: {line}"


def test_message_about_too_many_entries():
    entries = [{"t_s": i, "supply_frequency_hz": 50} for i in range(MOST_ENTRIES + 1)]
    Scene.from_tree({"drive": {"program": entries[:-1]}})
    with pytest.raises(ConfigError, match=rf"^drive\.program = .*; allowed: a list of {MOST_ENTRIES}$"):
        Scene.from_tree({"drive": {"program": entries}})


@pytest.mark.parametrize(
    ("key", "text", "line"),
    [
        ("drive.program", program(START), "drive.program is given, but a sweep sets the supply itself; "),
        ("from", "run: {initial: {from: x}}", "run.initial.from is given, but a sweep does not begin with a run; "),
    ],
)
def test_sweep_refuses(key, text, line, scene_of, here, command):
    """A scene with both is a scene: it can be run."""
    text += "\nsweep: {supply_frequency_hz: {start: 40, stop: 50}}"
    with pytest.raises(ConfigError) as caught:
        branches(scene_of(text))
    assert str(caught.value).startswith(line)
    done = command("sweep", "c.yaml")
    assert (done.code, done.out) == (2, "")
    assert done.err == f"vibroplat: c.yaml: {caught.value}\n"
    assert [path.name for path in here.iterdir()] == ["c.yaml"]


# -- one way replaces the other ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("below", "above", "expected"),
    [
        ("drive: {supply_frequency_hz: 44}", program(START), {"program": [{"t_s": 0, "supply_frequency_hz": 50}]}),
        (program(START), "drive: {supply_frequency_hz: 44}", {"supply_frequency_hz": 44}),
        (program(START, "t_s: 1, off: true"), program(START), {"program": [{"t_s": 0, "supply_frequency_hz": 50}]}),
        (program(START), "drive: {program: }", {"supply_frequency_hz": FREQUENCY}),
    ],
    ids=["program", "constant", "another program", "none"],
)
def test_upper_file_gives_one_of_the_two(below, above, expected, here, scene_of):
    (here / "base.yaml").write_text(below)
    assert scene_of(f"extends: base.yaml\n{above}\n").drive == Drive(**expected)


def test_setting_changes_one_entry(scene_of):
    text = program(START, "t_s: 1, supply_frequency_hz: 60")
    drive = scene_of(text, parse_overrides(["drive.program.1.t_s=2", "drive.program.0.exciter_2=off"])).drive
    entries = [{"t_s": 0, "supply_frequency_hz": 50, "exciter_2": "off"}, {"t_s": 2, "supply_frequency_hz": 60}]
    assert drive == Drive(program=entries)


def test_setting_beyond_the_last_entry_is_told(complaint):
    settings = parse_overrides(["drive.program.1.t_s=2"])
    assert complaint(program(START), settings) == "unknown key drive.program.1; allowed: drive.program.0"
    assert complaint(program(), settings) == "unknown key drive.program.1; allowed: none"


def test_default_is_a_constant_supply():
    assert Scene().drive == Drive() == Drive(supply_frequency_hz=FREQUENCY)


# -- intervals --------------------------------------------------------------------------------------------


def drive(*entries):
    """Make a drive of entries (time, frequency) and their switches."""
    keys = ("t_s", "supply_frequency_hz")
    return Drive(program=[dict(zip(keys, entry[:2], strict=False)) | dict(*entry[2:]) for entry in entries])


def test_constant_supply_is_one_interval_without_a_beginning():
    (interval,) = Drive(supply_frequency_hz=46.0).intervals
    assert (interval.start, interval.end) == (-math.inf, math.inf)
    assert [interval.frequency_at(time) for time in (0.0, 1e9)] == [46.0, 46.0]
    assert interval.driven == (True, True)


def test_frequency_is_linear_between_entries_and_stays_after_the_last():
    example = drive((1.0, 20.0), (3.0, 50.0), (8.0, 45.0))
    for time, frequency in ((1.0, 20.0), (2.0, 35.0), (3.0, 50.0), (4.0, 49.0), (8.0, 45.0), (1e6, 45.0)):
        assert example.at(time).frequency_at(time) == pytest.approx(frequency, rel=1e-15)
    assert [interval.corner for interval in example.intervals] == [True] * 3
    assert example.largest_frequency == 50.0


def test_frequency_jumps_where_two_entries_share_a_time():
    example = drive((0.0, 20.0), (2.0, 30.0), (2.0, 50.0), (3.0, 50.0))
    before, after, _ = example.intervals
    assert (before.end, after.start) == (2.0, 2.0)
    assert before.frequency_at(2.0) == 30.0
    assert example.at(2.0).frequency_at(2.0) == after.frequency_at(2.0) == 50.0


def test_first_and_last_entries_may_jump():
    example = drive((0.0, 20.0), (0.0, 30.0), (1.0, 30.0), (1.0, 10.0))
    assert [(i.start, i.end, i.frequency, i.ramp) for i in example.intervals] == [
        (0.0, 1.0, 30.0, 0.0),
        (1.0, math.inf, 10.0, 0.0),
    ]


def test_left_out_values_are_those_before():
    example = drive((0.0, 20.0), (1.0, None, {"exciter_2": "off"}), (2.0, 40.0), (3.0, None, {"off": True}))
    assert [(i.frequency, i.ramp, i.driven) for i in example.intervals] == [
        (20.0, 0.0, (True, True)),
        (20.0, 20.0, (True, False)),
        (40.0, 0.0, (True, False)),
        (40.0, 0.0, (False, False)),
    ]


@pytest.mark.parametrize(
    ("switches", "driven"),
    [
        ("exciter_1: off", (False, True)),
        ("exciter_1: false", (False, True)),
        ("exciter_2: off, exciter_1: on", (True, False)),
        ("exciter_2: true", (True, True)),
        ("off: true", (False, False)),
        ("off: false", (True, True)),
    ],
)
def test_switches(switches, driven, scene_of):
    """YAML 1.1, which editors and other programs write, takes on and off for true and false."""
    assert scene_of(program(f"{START}, {switches}")).drive.intervals[0].driven == driven


def test_both_may_be_on_again():
    example = drive((0.0, 20.0, {"off": True}), (1.0, None, {"exciter_1": "on"}), (2.0, None, {"off": False}))
    assert [i.driven for i in example.intervals] == [(False, False), (True, False), (True, True)]


def test_slip_speeds_follow_the_frequency_to_a_thousandth_of_the_largest():
    """Where a ramp passes it, an interval ends that is no corner; both parts go on as one ramp."""
    rising, low, falling, lowest = (
        drive((0.0, 0.0), (5.0, 50.0), (9.0, 10.0), (10.0, 0.0)).intervals[:2]
        + drive((0.0, 50.0), (10.0, 0.0)).intervals[:2]
    )
    least = 50.0 * LEAST_SHARE
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
    assert intervals[1].slip_frequency == (50.0 * LEAST_SHARE, 0.0)


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


def test_before_the_program_is_its_beginning():
    assert drive((1.0, 20.0), (2.0, 30.0)).at(0.0).start == 1.0


def test_scales_follow_the_largest_frequency():
    scene = Scene(drive=drive((0.0, 0.0), (1.0, 60.0), (2.0, 10.0)))
    assert scene.synchronous_speeds == Scene(drive=Drive(supply_frequency_hz=60.0)).synchronous_speeds
