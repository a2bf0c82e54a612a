"""What commands print: the answer in the first line, twelve lines at most, all with -v, for every configuration."""

import re
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest
from common.places import ROOT

from vibroplat import load_config, simulate
from vibroplat.cli.common import print_answer
from vibroplat.columns import name_regime
from vibroplat.config.digits import quantity, spread
from vibroplat.config.engine_choice import engine_note
from vibroplat.config.kinds import KINDS
from vibroplat.config.plausibility import HINT, WARNING, by_severity
from vibroplat.errors import TableError
from vibroplat.plots.command import FIGURE_NAMES
from vibroplat.results.answer import MAX_LINES, Answer, first_failures, of_both, short_line
from vibroplat.results.run_answer import headline, kind_of_motion, repetition_text
from vibroplat.results.sheet import FURTHER, POINTS, Sheet, all_lines, short_lines
from vibroplat.study.sweep import notes_on_points

#: Most characters of a line that is printed in the directory of the results.
WIDEST = 116
#: Changes that make the studies of shipped configurations short, by command.
THINNED = {
    "run": {"run.duration_s": 3.0},
    "sweep": {
        "sweep.supply_frequency_hz.step": 4.0,
        "sweep.measure_s": 0.3,
        "sweep.max_settle_s": 10.0,
        "sweep.lyapunov": False,
    },
    "orbits": {"orbits.max_points": 12},
    "find": {"find.scan": 3, "find.tolerance": 0.1},
    "basins": {"basins.initial_conditions": {"run.initial.phase_difference_rad": [-3.0, 3.0, 4]}},
    "design": {"design.samples": 16, "design.starts": 1},
}


def cases():
    """Yield each command and each shipped configuration that it takes."""
    for file in sorted((ROOT / "configs").rglob("*.yaml")):
        if file.parent.name in ("configs", "examples", "templates", "paper"):
            scene = load_config(file)
            yield from (
                (command, file)
                for command in ("run", *KINDS)
                if command == "run" or getattr(scene, command) is not None
            )


@pytest.mark.long
@pytest.mark.parametrize(("name", "file"), [pytest.param(*case, id=f"{case[0]}-{case[1].stem}") for case in cases()])
def test_shipped_configurations_print_twelve_lines(name, file, command, kernels, here):
    known = load_config(file)
    changes = THINNED[name]
    given = [f"{key}={str(value).replace(chr(39), '')}" for key, value in changes.items() if holds(known, key)]
    done = command(name, file, *(part for one in given for part in ("--set", one)), "--engine", "taylor")
    printed = [*done.out.splitlines(), *done.err.splitlines()]
    assert done.code in (0, 1), done.err
    assert len(printed) <= MAX_LINES, done.out
    assert max(map(len, done.out.splitlines())) <= WIDEST, done.out
    last = done.out.splitlines()[-1]
    assert last.startswith(f"results/{known.name}/{name}: ")
    assert " next: vibroplat " in last
    assert re.search(r"\bnan\b", done.out) is None


def holds(scene, key):
    """Whether a scene has the section of a key, and a value that it is an alternative to."""
    section, *rest = key.split(".")
    if getattr(scene, section, None) is None:
        return False
    return rest != ["supply_frequency_hz", "step"] or scene.sweep.over is None


def test_readme_shows_what_the_quickstart_prints(command, kernels, here):
    done = command("run", ROOT / "configs/quickstart.yaml")
    assert (done.code, done.err) == (0, "")
    shown = (ROOT / "README.md").read_text(encoding="utf-8").partition("```text\n")[2].partition("```")[0]
    assert done.out == shown


# -- what there is room for ------------------------------------------------------------------------------


def test_notes_take_the_room_that_is_left():
    notes = [f"note number {n} " + "with more words " * 8 for n in range(5)]
    answer = Answer(notes=notes, headline="what it is", short=["line"] * 5)
    lines = answer.brief()
    assert lines[:2] == ["what it is", "  line"]
    assert len(lines) <= MAX_LINES
    assert lines[-1] == "  3 more notes: -v"
    assert max(map(len, lines)) <= WIDEST
    for room in range(7, 20):
        assert len(answer.brief(room)) <= room
    assert answer.brief(7)[-1].endswith(" … (4 more: -v)")
    assert answer.full()[-5:] == [f"note: {note}" for note in notes]


def test_warnings_are_always_printed():
    """They take the room of other lines, or more than that."""
    warnings = [f"{WARNING}{what} " + "and more words " * 10 for what in ("another machine", "captured")]
    notes = [engine_note("taylor"), *warnings, f"{HINT}faster"]
    answer = Answer(headline="what it is", short=["line"] * 10, notes=notes)
    for room in (3, 8, 11, 20):
        lines = answer.brief(room)
        printed = " ".join(" ".join(lines).split())
        assert all(kept.strip() in printed for kept in ("computed by engine taylor", *warnings))
        assert lines[0] == "what it is"
        assert len(lines) <= max(room, 7)
    assert answer.brief(11)[5] == "  … 7 more lines: -v prints them"
    assert answer.brief(20)[12].startswith("  warning: another machine")


def test_notes_that_put_no_number_in_doubt_come_last():
    stiff, wrong = f"{HINT}another engine is faster", "not settled: stroke may fall by 5 %"
    assert by_severity([stiff, "an unusual mass", wrong]) == ["an unusual mass", wrong, stiff]
    assert Answer(headline="what it is", notes=[wrong, stiff]).brief()[1:] == [f"  note: {wrong}", f"  {stiff}"]
    table = pd.DataFrame({"mass": [1.0, 2.0], "notes": [stiff, f"{stiff}; {wrong}"], "motion": "x", "outcome": "ok"})
    assert notes_on_points(table) == [
        f"{HINT}2 points at mass 1 … 2, the first: another engine is faster",
        f"1 point at mass 2: {wrong}",
    ]


def test_all_of_a_finished_result_is_printed_without_computing_it_anew(command, kernels, here):
    file, short = ROOT / "configs/quickstart.yaml", ("--set", "run.duration_s=0.5")
    command("run", file, *short)
    made = Path("results/quickstart/run/provenance.json").read_bytes()
    again = command("run", file, *short, "-v")
    assert "results/quickstart/run: computed before; next: " in again.out
    assert "\nliftoffs, impacts, chatters " in again.out
    assert Path("results/quickstart/run/provenance.json").read_bytes() == made
    assert "computed before" not in command("run", file, "--set", "run.duration_s=0.6", "-v").out
    swept = ("--set", "sweep.supply_frequency_hz={start: 48, stop: 50, step: 1}", "--set", "sweep.grid={}")
    assert "computed before" not in command("sweep", file, *swept, "-v").out
    assert "results/quickstart/sweep: computed before; next: " in command("sweep", file, *swept, "-v").out


def test_an_answer_of_a_former_version_is_printed_whole():
    former = Answer.from_tree({"lines": {"points": "8"}, "text": ["a band"], "notes": ["look"], "failures": []})
    assert former.brief(3) == [f"{'points':<28}8", "a band", "note: look"]
    assert Answer.from_tree(former.to_tree()).full() == former.full()


def test_a_print_with_failures_and_a_check_keeps_within_its_lines(capsys, here):
    answer = Answer({"wall time": "1 s"}, ["more"], ["look"] * 4, headline="what it is", short=["line"] * 8)
    failures = first_failures([f"lost {n}" for n in range(9)], "9 of the points failed")
    assert failures == ["lost 0", "lost 1", "lost 2", "9 of the points failed"]
    print_answer(answer, here, "plot", verbose=False, failures=failures, check={"checked by": "x"})
    brief = capsys.readouterr()
    assert brief.out.startswith("what it is\n  line\n")
    assert len(brief.out.splitlines()) + len(brief.err.splitlines()) == MAX_LINES
    assert "wall time" not in brief.out
    print_answer(answer, here, "plot", verbose=True, reused="3 tasks from before")
    told = capsys.readouterr().out
    assert "wall time                   1 s\nmore\nnote: look\n" in told
    assert told.endswith(f"{here}: 3 tasks from before; next: vibroplat plot\n")


def test_two_equal_exciters_are_told_once():
    assert of_both([155.2, 155.9], "N") == "155 N each"
    assert of_both([155.0, 99.0], "N") == "155 N and 99.0 N"
    assert of_both([155.0, 0.01], "N") == "155 N and 0"


def test_kind_knows_all_figures(command):
    help_ = " ".join(command("plot", "--help").out.replace("\n", " ").split())
    assert all(kind in help_ for kinds in FIGURE_NAMES.values() for kind in kinds.split())


# -- runs that went wrong --------------------------------------------------------------------------------

#: Changes of a run's summary, and how the headline begins then.
HEADLINES = {
    "runs at 25.74 Hz (1545 rpm), antiphase: vibrates along y": {},
    "STOPPED at 0.100 s: too-many-events": {"outcome": "too-many-events", "simulated_s": 0.1},
    "INACCURATE, runs at 25.74 Hz": {"outcome": "inaccurate"},
    "CAPTURED by the resonance in y: 25.74 Hz, < 0.1 % below the synchronous speed 25.75 Hz": {"captured_by": "y"},
    "nothing measured, the run is too short": {"excitation_frequency_hz": None},
    "not a whole turn in the measured 0.0777 s: a longer run.duration_s helps": {"measured_turns": 0},
    "the exciters hardly turn": {"measured_turns": 0, "measured_to_s": 9.0, "excitation_frequency_hz": 0.01},
    "exciter 1 hardly turns, exciter 2 at 25.00 Hz": {
        "measured_turns": 0,
        "measured_to_s": 9.0,
        "excitation_frequency_hz": 12.5,
        "frequency_split_hz": -25.0,
    },
    "runs, not synchronized: exciters at 26.74 Hz and 24.74 Hz": {"frequency_split_hz": 2.0, "phase_coherence": 0.1},
    "runs at 25.74 Hz (1545 rpm), phase difference 90 °": {"phase_difference_rad": 1.5707},
    "runs at 25.74 Hz (1545 rpm), in-phase: vibrates along x and rocks; repeats every 3 turns": {
        "phase_difference_rad": 0.1,
        "period": 3,
        "stroke_change": 0.0,
    },
}


@pytest.mark.parametrize(("told", "changes"), HEADLINES.items(), ids=range(len(HEADLINES)))
def test_a_headline_says_what_is_wrong_first(told, changes, runs):
    run = runs["two layers"]
    assert headline(run.scene, run.summary | changes).startswith(f"quickstart: {told}")


def test_a_motor_that_is_switched_off_and_stops_has_no_steady_numbers(runs):
    """Its exciter passes the resonances: what is measured is largest there, and no motion in operation."""
    run = runs["two layers"]
    program = [{"t_s": 0.0, "supply_frequency_hz": 51.5}, {"t_s": 0.01, "exciter_2": "off"}]
    off = run.scene.replace({"drive.program": program})
    stops = run.summary | {"frequency_split_hz": 20.0, "speed_ripple_2_hz": 16.0, "phase_coherence": 0.1}
    told = "quickstart: motor 2 is off, its exciter is stopping: exciters at 35.74 Hz and 15.74 Hz in the mean"
    assert headline(off, stops) == told
    first = short_lines(Sheet(off, stops))[0]
    assert first.startswith("no steady motion ")
    assert first.endswith("  values of this time, while exciter 2 stops"), "means and largest ones"
    assert "off, not synchronized" in headline(off, stops | {"speed_ripple_2_hz": 1.0})
    assert short_lines(Sheet(run.scene, run.summary))[0].startswith("stroke y")
    stopped = off.replace({"drive.program": [program[0], {"t_s": 0.01, "off": True}]})
    assert "while it coasts down" in short_lines(Sheet(stopped, run.summary | {"measured_turns": 0}))[0]


def test_an_exciter_1_without_motor_that_stands_still_does_not_stop_the_other_one(runs):
    run = runs["two layers"]
    off = run.scene.replace({"drive.program": [{"t_s": 0.0, "supply_frequency_hz": 51.5, "exciter_1": "off"}]})
    alone = {"measured_turns": 0, "impacts_per_period": None, "frequency_split_hz": -51.48, "flight_fraction": 0.5}
    known = run.summary | alone | {"speed_ripple_1_hz": 0.1}
    assert headline(off, known).startswith("quickstart: runs with motor 1 off, not synchronized: exciters at 0 and 51")
    assert "in flight 50 %" in (lines := "\n".join(short_lines(Sheet(off, known))))
    assert "a turn" not in lines
    assert "no steady" not in lines


def test_strokes_that_still_change_are_told_instead_of_turns_that_repeat(runs):
    run = runs["two layers"]
    ends = {
        0.14: "; not settled: stroke may fall by 14 %",
        0.001: "; repeats every turn",
        None: "; repeats every turn",
    }
    for change, end in ends.items():
        assert headline(run.scene, run.summary | {"period": 1, "stroke_change": change}).endswith(end)
    assert headline(run.scene, run.summary | {"period": 0, "stroke_change": 0.14}).endswith(ends[0.14])


def test_digits_of_strokes_and_forces_end_where_their_transient_begins(runs):
    run = runs["two layers"]
    stroke, stiffness = run.summary["stroke_y_m"], run.scene.machine.stiffness_y_n_per_m
    left = {"transient_y_m": 0.3 * stroke, "foundation_force_y_amplitude_n": 0.5 * stiffness * stroke}
    lines = short_lines(Sheet(run.scene, run.summary | left))
    assert lines[0].split()[2] == quantity(stroke, "m", error=0.3 * stroke).split()[0]
    assert f"may tend to {quantity(0.7 * stroke, 'm', error=0.03 * stroke)}; " in lines[0]
    assert spread(156.1, 20.0, "N", 15.0) == "160 ± 20 N"
    assert "most is transient" in short_lines(Sheet(run.scene, run.summary | {"transient_y_m": 0.98 * stroke}))[0]


def test_static_forces_are_the_weight_along_both_axes(runs):
    """A mean over a part of a motion that is not steady is none; a deck that slopes has a static force along it."""
    run = runs["two layers"]
    weight = quantity(run.scene.gravity[1] * (run.scene.platform_mass + run.scene.material_mass), "N")
    lines = short_lines(Sheet(run.scene, run.summary | {"foundation_force_y_mean_n": -1.0, "transient_y_m": 0.0}))
    assert next(line for line in lines if line.startswith("foundation, y")).split()[2][:3] == weight[:3]
    sloping = run.scene.replace({"transport": {"deck_height_m": 0.0, "deck_angle_deg": 15.0, "friction": 0.4}})
    lines = short_lines(Sheet(sloping, run.summary | {"foundation_force_x_amplitude_n": 3.0}))
    along = next(line for line in lines if line.startswith("foundation, x"))
    assert " ± 3.0 N  " in along
    assert "  along the deck; largest " in along


@pytest.mark.parametrize("label", ["at tip", "spring at corner_fl_1", f"at {'front_left_corner_' * 2}"])
@pytest.mark.parametrize("value", ["3.51 ± 0.32 kN", "stroke y 10.23456789 ± 0.12 mm"])
def test_labels_of_any_length_and_values_stand_apart(label, value):
    parts = [part.strip() for part in short_line(label, value, "static").split("  ")]
    assert [*filter(None, parts)] == [label, value, "static"]


def test_a_run_that_continues_is_told_no_start(runs):
    """It is in step from its beginning, or comes so after a time that counts from there."""
    run = runs["two layers"]
    for at, told in ((6.12, []), (7.0, ["in", "step", "0.880", "s", "after"])):
        lines = short_lines(Sheet(run.scene, run.summary | {"begins_s": 6.12, "synchronized_at_s": at}))
        assert [line.split()[:5] for line in lines if line.startswith(("start", "in step"))] == [told][: len(told)]


def test_a_summary_has_what_the_first_line_says(runs):
    run = runs["two layers"]
    summary, line = run.summary, headline(run.scene, run.summary)
    assert summary["sync"] in line
    assert (summary["motion"] == "periodic") == ("; repeats every " in line)
    assert summary["regime"] == f"{summary['sync']}, {summary['motion']}"
    assert name_regime(summary | {"motion": "periodic", "period": 2}) == f"{summary['sync']}, period 2"


def test_few_turns_are_told_wherever_a_period_would_be(runs):
    """They do not show that a motion is aperiodic; a transient may not repeat either."""
    run = runs["two layers"]
    summary = run.summary | {"period": 0, "measured_turns": 30, "stroke_change": 0.0}
    told = "undecided: 30 turns measured, at least 31 are needed"
    assert headline(run.scene, summary).endswith(f"; {told}")
    rows = {row.label: row for row in Sheet(run.scene, summary).groups["Synchronization"]}
    assert f"{rows['motion repeats'].now}: {rows['motion repeats'].also}" == told
    assert headline(run.scene, summary | {"measured_turns": 31}).endswith("; does not repeat yet")
    kinds = [kind_of_motion({"measured_turns": turns}, 0, left) for turns, left in ((30, 0.0), (31, 0.0), (31, 0.01))]
    assert kinds == ["undecided", "non-periodic", "undecided"]
    assert run.summary["detail"] == repetition_text(run.summary)


def test_a_machine_at_rest_rests_and_shows_no_round_off(kernels):
    """Its motors are off from the beginning, and its unbalances hang."""
    off = {"drive.program": [{"t_s": 0.0, "supply_frequency_hz": 50.0, "off": True}], "output.accelerations": True}
    at_rest = {"run.initial": {"speed_ratio": 0.0}, "run.duration_s": 0.25, "material.mass_ratio": 0.2}
    run = simulate(load_config(ROOT / "configs/machines/calibrated.yaml", {**off, **at_rest, "name": "still"}))
    sheet = Sheet(run.scene, run.summary)
    assert headline(run.scene, run.summary) == "still: the machine rests, motors off"
    assert sheet.transient == ""
    moved = [label for label, text in all_lines(sheet, None).items() if "·10" in text or "e-" in text]
    assert moved == []
    assert not any("next to nothing moves" in note for note in run.answer.notes)
    with pytest.raises(TableError, match="has no spectrum, as its machine rests"):
        run.plot("spectrum")


def test_a_jump_to_a_lower_frequency_is_no_operation(kernels):
    """Motors take power from the machine while they brake it."""
    jump = [(0.0, 50.0), (0.5, 50.0), (0.5, 20.0)]
    program = [{"t_s": t, "supply_frequency_hz": frequency} for t, frequency in jump]
    changes = {"drive.program": program, "run.duration_s": 1.0, "material.mass_ratio": 0.0, "solver.engine": "taylor"}
    run = simulate(load_config(ROOT / "configs/templates/screen.yaml", changes | {"run.initial.speed_ratio": 0.98}))
    assert "is braked by the motors, at " in headline(run.scene, run.summary)
    assert Sheet(run.scene, run.summary).transient == "while its motors brake"


@pytest.mark.long
def test_round_off_of_a_long_run_is_no_transient(kernels):
    changes = {"material.mass_ratio": 0.0, "run.duration_s": 1000.0, "solver.engine": "taylor"}
    run = simulate(load_config(ROOT / "configs/quickstart.yaml", changes), keep="summary")
    assert headline(run.scene, run.summary).endswith("repeats every turn")
    assert "transient" not in " ".join(run.answer.notes)


def test_times_count_from_when_motors_were_switched(runs):
    """A failure has times of its own; what was largest before it is of the start."""
    run = runs["two layers"]
    program = [{"t_s": 0.0, "supply_frequency_hz": 51.5}, {"t_s": 5.0, "exciter_2": "off"}]
    scene, later = run.scene.replace({"drive.program": program}), {"measured_from_s": 10.0, "measured_to_s": 20.0}
    peaks = {"whole_stroke_y_at_s": 0.6, "whole_foundation_force_y_max_at_s": 5.25, "synchronized_at_s": 5.5}
    lines = short_lines(Sheet(scene, run.summary | later | peaks))
    assert " at 0.600 s in the start" in lines[0]
    assert lines[2].endswith(" 0.250 s after motor 2 off")
    assert next(line for line in lines if line.startswith("in step again")).split()[3:] == (
        ["0.500", "s", "after", "motor", "2", "off"]
    )
    stop = run.scene.replace({"drive.program": [program[0] | {"off": True}]})
    lines = short_lines(Sheet(stop, run.summary | {"begins_s": 20.0, "whole_stroke_y_at_s": 31.0}))
    assert " 11.0 s after off" in lines[1]
    still = run.summary | {"measured_turns": 0}
    assert Sheet(stop, still).groups["Synchronization"][0].now == "no whole turn"
    assert "largest " in next(fact for fact in Sheet(stop, still).facts() if fact.startswith("stroke"))


def test_torques_are_relative_to_the_rated_ones_of_motors_with_a_nameplate(runs):
    run = runs["two layers"]
    plate = {"rated_power_w": 3000.0, "rated_speed_rpm": 1455.0, "breakdown_ratio": 2.5, "rated_frequency_hz": 50.0}
    motors = run.scene.replace({"motor": plate})
    lines = short_lines(Sheet(motors, run.summary | {"torque_ratio_1": 0.2, "torque_ratio_2": 0.1}))
    assert any(line.endswith("; 50 % of rated torque") for line in lines)
    assert any(line.endswith(" % of critical torque") for line in short_lines(Sheet(run.scene, run.summary)))


def test_peaks_of_several_seeds_are_ranges(runs):
    run = runs["two layers"]
    found = {"seeds": 19, "whole_stroke_y_m": [0.009, 0.018], "whole_foundation_force_x_max_n": [1.0, 400.0]}
    sheet = Sheet(run.scene, run.summary | {"peaks_of_seeds": found})
    lines = short_lines(sheet)
    assert "largest 9.0 … 18.0 mm at " in lines[0]
    assert "largest 1 … 400 N at " in next(line for line in lines if line.startswith("foundation, x"))
    assert lines[-1].split()[:5] == ["largest", "values", "of", "19", "runs"]
    assert lines[-1].endswith("  run 20 is larger with probability 5.0 %; times refer to run 1")
    for numbers, end in (
        ({"captured": 3}, "at least 3 are captured"),
        ({"seeds": 1}, "  run.perturbation is 0"),
    ):
        known = run.summary | {"peaks_of_seeds": found | numbers}
        assert short_lines(Sheet(run.scene, known))[-1].endswith(end)


def test_a_force_is_0_only_where_its_dynamic_part_is_small(runs):
    run = runs["two layers"]
    sizes = {"foundation_force_x_max_n": 5.0, "foundation_force_x_amplitude_n": 5.0, "transient_x_m": 0.0}
    lines = short_lines(Sheet(run.scene, run.summary | sizes | {"foundation_force_y_amplitude_n": 1000.0}))
    assert next(line for line in lines if line.startswith("foundation, x")).split()[2:4] == ["5.00", "N"]


def test_what_is_nothing_is_0_and_what_is_missing_is_left_out(runs):
    run = runs["two layers"]
    small = {"stroke_x_m": 1e-9, "foundation_force_x_max_n": 0.01}
    lines = short_lines(Sheet(run.scene, run.summary | small | {"whole_foundation_force_x_max_n": 0.02}))
    assert lines[0].endswith("; x 0")
    assert not [line for line in lines if line.startswith("foundation, x")]
    (line,) = (line for line in short_lines(Sheet(run.scene, run.summary | small)) if line.startswith("foundation, x"))
    assert line.split()[2:4] == ["0", "largest"], "a start has forces that operation has not"
    off = run.scene.replace({"drive.program": [{"t_s": 0.0, "supply_frequency_hz": 50.0, "off": True}]})
    assert headline(off, run.summary).startswith("quickstart: coasts with the motors off, at 25.74 Hz")
    jump = [{"t_s": 0.0, "supply_frequency_hz": 50.0}, {"t_s": 0.0, "supply_frequency_hz": 0.0}]
    braked = run.scene.replace({"drive.program": jump})
    assert headline(braked, run.summary).startswith("quickstart: is braked by the motors (supply 0 Hz), at 25.74 Hz")
    assert "while its motors brake" in short_lines(Sheet(braked, run.summary))[0]
    assert [line for line in short_lines(Sheet(braked, run.summary)) if line.startswith("motor power")]
    still = run.summary | {"measured_turns": 0, "speed_ripple_1_hz": 0.001, "speed_ripple_2_hz": 0.0}
    assert headline(braked, still) == "quickstart: the exciters have come to rest, motors braking at 0 Hz"
    ends = {0.5: "swing out", 0.001: "have come to rest"}
    for ripple, end in ends.items():
        known = run.summary | {"measured_turns": 0, "speed_ripple_1_hz": ripple, "speed_ripple_2_hz": 0.0}
        assert headline(off, known) == f"quickstart: the exciters {end}, motors off"
    assert not [line for line in short_lines(Sheet(off, run.summary)) if line.startswith("motor power")]
    assert short_lines(Sheet(run.scene, run.summary | {"stroke_y_m": None})) == []
    former = {name: value for name, value in run.summary.items() if not name.startswith("foundation")}
    assert short_lines(Sheet(run.scene, former)) == []


def test_all_numbers_of_the_data_sheet_are_printed_once_and_those_at_four_points_shortly(runs):
    """Numbers that no row of an engineer's groups has stand below them; more points are counted."""
    run = runs["two layers"]
    points = {f"p{n}": [0.01 * n, 0.0] for n in range(6)}
    scene = run.scene.replace({"output.points": points})
    known = {f"stroke_{axis}_{name}_m": 1e-3 for name in points for axis in "xy"}
    sheet = Sheet(scene, run.summary | known | {f"acceleration_max_{name}_m_per_s2": 9.0 for name in points})
    lines = all_lines(sheet, None)
    assert lines["stroke y at p5"] == "1.00 mm, x 1.00 mm; 9.00 m/s²"
    assert lines["foundation force y RMS"].endswith(" N")
    assert {"largest motor torque 1", "foundation moment amplitude"} <= {*lines}
    assert "stroke y" not in {row.label for row in sheet.groups[FURTHER]}
    shown = short_lines(sheet)
    assert shown[-2:] == [
        f"{'at p3':<20}{'stroke y 1.00 mm':<22}x 1.00 mm; acceleration 9.00 m/s²",
        "and 2 more points: -v",
    ]
    assert len([line for line in shown if line.startswith("at p")]) == 4
    assert len(sheet.groups[POINTS]) == 6


def test_long_names_of_points_shift_no_column():
    rows = [("stroke y", "1.36 mm", "x 0"), ("at the_name_of_a_point_is_long", "2.5 mm", "x 0.01 mm")]
    lines = short_lines(SimpleNamespace(groups={}, short=lambda: rows))
    assert [[line.index(text) for text in row[1:]] for line, row in zip(lines, rows, strict=True)] == [[32, 54]] * 2
