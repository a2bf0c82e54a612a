"""Measured data: files as spreadsheets write them, mapped, shifted and compared."""

import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Text

from vibroplat import Scene, load, simulate
from vibroplat.errors import TableError
from vibroplat.hybrid.state import static_rest
from vibroplat.measured.alignment import best_shift
from vibroplat.measured.data import Measured, _number, comparison_of, read_data
from vibroplat.measured.rows import MAX_BYTES
from vibroplat.page.report import write_report
from vibroplat.plots.command import draw_results

MAPPING = 't=Zeit*0.001,ay_inlet=Beschl_y (g)*10,"y=Weg, y"'
TEXT = "Zeit;Beschl_y (g);Weg, y\n0;1,5;0,1\n500;−;0,2\n1000;-2,5;0,3\n".replace("−", "")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize("first", ["", "sep=;\r\n"])
def test_files_of_spreadsheets_are_mapped_to_columns(encoding, first, tmp_path):
    file = tmp_path / "rig.csv"
    file.write_bytes((first + TEXT.replace("y (g)", "ü (g)")).encode(encoding))
    found = read_data(f"{file}:{MAPPING.replace('y (g)', 'ü (g)')},shift=2").select("t_s", ["y_m"], ["x_m"])
    assert found.table["t_s"].tolist() == [2.0, 2.5, 3.0]
    assert found.table["y_m"].tolist() == [0.1, 0.2, 0.3]
    both = read_data(f"{file}:{MAPPING.replace('y (g)', 'ü (g)')}").select("t_s", ["acceleration_y_inlet_m_per_s2"])
    assert both.table["acceleration_y_inlet_m_per_s2"].dropna().tolist() == [15.0, -25.0]


@pytest.mark.parametrize(
    ("mapping", "line"),
    [
        ("t=Zeit,y=Weg y", "y=Weg y: no such column in the file; did you mean Weg, y? allowed: Zeit, Beschl_y (g), "),
        ("t=Zeit,y=", "y=: no such column in the file; allowed: Zeit, Beschl_y (g), "),
        ("t=Zeit*ms", "'t=Zeit*ms' in the mapping; allowed: COLUMN=NAME, COLUMN=NAME*FACTOR, shift=SECONDS, shift=fit"),
        ("t=Zeit,shift=nan", "'shift=nan' in the mapping; allowed: COLUMN=NAME, COLUMN=NAME*FACTOR, shift="),
        ("t=Zeit,shift=soon", "'shift=soon' in the mapping; allowed: COLUMN=NAME, COLUMN=NAME*FACTOR, shift="),
    ],
)
def test_a_mapping_that_is_none_is_refused(mapping, line, tmp_path):
    file = tmp_path / "rig.csv"
    file.write_text(TEXT)
    with pytest.raises(TableError) as caught:
        read_data(f"{file}:{mapping}")
    assert str(caught.value).startswith(f"--data {file}: {line}")


def test_what_is_no_small_text_is_refused(tmp_path):
    """A pipe would never end, a device may not either."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "book.xlsx").write_bytes(b"PK\x03\x04\0\0")
    (tmp_path / "large.csv").touch()
    os.truncate(tmp_path / "large.csv", MAX_BYTES + 1)
    (tmp_path / "picture.csv").write_bytes(b"PK\x03\x04\0\0")
    for name, line in (
        ("pipe", "is no regular file; allowed: a CSV file"),
        ("/dev/zero", "is no regular file; allowed: a CSV file"),
        ("picture.csv", "is no text; allowed: a CSV file, as spreadsheets save it, or .xlsx"),
        ("book.xlsx", "book.xlsx cannot be read: File is not a zip file"),
        ("large.csv", "has 64 MiB; allowed: at most 64 MiB"),
    ):
        with pytest.raises(TableError, match=line):
            read_data(tmp_path / name)


TIMES = np.arange(0.0, 2.0, 1e-3)


def chirp(t):
    return np.sin(20.0 * t + 40.0 * t * t)


@pytest.mark.parametrize(("begin", "end", "rate"), [(0.4, 1.1, 800.0), (-1.0, 4.0, 3000.0)], ids=["shorter", "longer"])
def test_the_shift_in_time_is_found(begin, end, rate):
    """Whichever is longer, and whatever the clock of the data says; not one that half of the data do not reach."""
    t = np.arange(begin, end, 1.0 / rate)
    assert best_shift((t + 77.0003, chirp(t)), (TIMES, chirp(TIMES))).shift == pytest.approx(-77.0003, abs=2e-6)
    level = best_shift((t, 9.81 + chirp(t)), (TIMES, chirp(TIMES)), offset=True)
    assert level.shift == pytest.approx(0.0, abs=2e-6)
    scaled = best_shift((t, -0.1 * chirp(t)), (TIMES, chirp(TIMES)))
    assert scaled.shift == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize("each", [3.1, 7.7, 400.0])
@pytest.mark.parametrize("long", [0.7, 1.0])
def test_a_few_samples_a_turn_suffice(each, long):
    """Of one turn in 40 ms with a beat, also where both are equally long."""

    def motion(t):
        return np.sin(50.0 * np.pi * t) * (1.0 + 0.3 * np.sin(3.0 * t + 1.0))

    t = np.arange(0.2, 0.2 + 1.8 * long, 0.04 / each)
    computed = np.arange(0.0, 2.0, 0.04 / max(each, 12.0))
    found = best_shift((t - 0.2, motion(t)), (computed, motion(computed)))
    assert found.shift == pytest.approx(0.2, abs=2e-5)
    assert found.samples_a_turn == pytest.approx(each, rel=0.05)


def test_of_motion_that_repeats_the_smallest_shift_is_taken():
    """Of a period of 0.1 s."""
    t = np.arange(0.5, 1.0, 1e-3)
    measured, computed = (t, np.sin(20.0 * np.pi * (t + 0.02))), (TIMES, np.sin(20.0 * np.pi * TIMES))
    found = best_shift(measured, computed)
    assert found.shift == pytest.approx(0.02, abs=1e-6)
    assert np.diff(found.alike) == pytest.approx(0.1, abs=1e-5)
    told = Measured(Path("rig"), pd.DataFrame(), shift=found.shift, alignment=found).shifted
    ends = f"{found.alike[0]:.2f} … {found.alike[-1]:.2f} s".replace("-", "−")
    assert told == f"shifted by 0.02 s, of {len(found.alike)} shifts, {ends}, that differ as little"
    with pytest.raises(TableError, match="shift=fit finds nothing to correlate"):
        best_shift((t, 0.0 * t), computed)
    with pytest.raises(TableError, match="shift=fit needs values over time"):
        best_shift((t[:1], t[:1]), computed)
    with pytest.raises(TableError, match=r"times span 4.99e\+07 s; allowed with shift=fit: seconds"):
        best_shift((1e8 * t, measured[1]), computed)


@pytest.mark.parametrize("factor", [1.0, 1.1])
def test_of_turns_that_hardly_differ_that_of_the_least_error_is_taken(factor):
    """Turns of 40 ms whose second order shifts slowly correlate by more than 0.998 with those beside them."""
    times = np.arange(0.0, 4.0, 5e-4)

    def drifting(t):
        return np.sin(50.0 * np.pi * t) + 0.2 * np.sin(100.0 * np.pi * t + 2.0 * t)

    t = np.arange(2.0, 3.0, 7.1e-4)
    found = best_shift((t - 1.23456, factor * drifting(t)), (times, drifting(times)))
    assert found.shift == pytest.approx(1.23456, abs=3e-6)
    assert len(found.alike) == 1
    data = Measured(Path("rig"), pd.DataFrame({"t_s": t, "y_m": t}), shift=-found.shift, alignment=found)
    assert _number(data.shifted.removeprefix("shifted by ").removesuffix(" s")) == pytest.approx(-1.23456, abs=3e-6)


def test_the_error_is_that_of_the_difference_beside_the_measured_values():
    curve = TIMES, chirp(TIMES)
    found = comparison_of((TIMES[5:50], chirp(TIMES[5:50]) / 0.9), curve)
    assert found.error == pytest.approx(0.1, rel=1e-12)
    assert (found.samples, found.factor) == (45, pytest.approx(0.9))
    assert comparison_of((TIMES + 5.0, chirp(TIMES)), curve) is None
    data = Measured(Path("rig"), pd.DataFrame({"t_s": TIMES, "y_m": chirp(TIMES)}), shift=0.25)
    data.compare("y_m", "t_s", [(TIMES, 2.0 * chirp(TIMES)), (TIMES, 1.1 * chirp(TIMES))])
    assert data.lines() == [
        "rig: y differs by 10 % (RMS of the difference / RMS of the measured values) in 2000 of 2000 samples, "
        "100 % of the curve; shifted by 0.25 s"
    ]


@pytest.mark.parametrize(
    ("change", "level", "line"),
    [
        (lambda a: a + 9.81, False, "a constant difference of 9.81 m/s²: gravity in the sensor?; offset=fit takes it"),
        (lambda a: a + 9.81, True, "a constant difference of 9.81 m/s²: gravity in the sensor?; was taken away"),
        (lambda a: a / 9.81, False, "is 0.102 times the computed one: is one in m/s² and the other in g?"),
        (lambda a: 1e3 * a, False, "is 1000 times the computed one: do units differ by 1000?"),
        (lambda a: -a, False, "is −1.00 times the computed one: does the sensor point the other way?"),
    ],
)
def test_what_sensors_and_units_do_is_recognized(change, level, line):
    column, values = "acceleration_y_m_per_s2", np.sin(40.0 * TIMES)
    data = Measured(Path("rig"), pd.DataFrame({"t_s": TIMES, column: change(values)}), level=level)
    data.compare(column, "t_s", [(TIMES, values)])
    assert line in "\n".join(data.lines())
    assert (data.errors[column] < 1e-9) == level


def test_names_lose_blanks_at_their_ends_and_may_hold_semicolons(tmp_path):
    (tmp_path / "blanks.csv").write_text("Zeit ; Weg\n0;1,5\n1;2,5\n")
    found = read_data(f"{tmp_path}/blanks.csv:t=Zeit,y=Weg").select("t_s", ["y_m"])
    assert found.table["y_m"].tolist() == [1.5, 2.5]
    (tmp_path / "semicolon.csv").write_text("time (s; from start),y (m)\n0,1.5\n1,2.5\n")
    assert [*read_data(tmp_path / "semicolon.csv").given] == ["time (s; from start)", "y (m)"]


def test_what_is_not_compared_is_told(tmp_path):
    data = Measured(tmp_path / "rig.csv", pd.DataFrame({"t_s": [5.0, 6.0], "y_m": [1.0, 2.0]})).select("t_s", ["y_m"])
    data.compare("y_m", "t_s", [(np.array([0.0, 1.0]), np.array([0.0, 0.0]))])
    assert data.lines() == ["rig.csv: y is not compared: fewer than two of its values lie beside a curve, or all are 0"]
    assert data.difference("y_m") == ""
    table = pd.DataFrame({"supply_frequency_hz": [40.0, 41.0], "phase_difference_rad": [3.1, -3.1]})
    data = Measured(tmp_path / "rig.csv", table).select("supply_frequency_hz", ["phase_difference_rad"])
    data.compare("phase_difference_rad", "supply_frequency_hz", [(np.array([40.0, 41.0]), np.array([-3.1, 3.1]))])
    told = "is not compared: it is an angle, whose zero is arbitrary, and has no relative error"
    assert data.lines() == [f"rig.csv: phase difference {told}"]


def test_the_shift_is_found_in_the_whole_run_and_the_interval_of_the_data_is_shown(tmp_path):
    """Without an interval the last turns would be shown, where the start is not; time counts from the first sample."""
    scene = Scene().replace({"solver.engine": "taylor", "run.duration_s": 2.0, "run.initial.speed_ratio": 0.5})
    simulate(scene).save(tmp_path / "a/run")
    run = load(tmp_path / "a")
    start = run.trajectory.query("0.1 < t_s < 0.5")
    begin = float(start["t_s"].iloc[0])
    moved = start.assign(t_s=start["t_s"] + 12.7, y_m=start["y_m"] - static_rest(scene)[1])
    moved[["t_s", "y_m"]].to_csv(tmp_path / "rig.csv", index=False)
    data = read_data(f"{tmp_path}/rig.csv:t_s=t_s,y=y_m,shift=fit")
    list(draw_results([run], ["measured"], data=data))
    assert data.errors["y_m"] < 1e-4
    assert data.shift == pytest.approx(begin, abs=1e-5)
    again = read_data(f"{tmp_path}/rig.csv:t_s=t_s,y=y_m,shift={data.shift}")
    figure = run.plot("motion", data=again)
    assert again.errors["y_m"] == pytest.approx(data.errors["y_m"], rel=1e-6)
    assert any("rig" in text.get_text() for text in figure.findobj(Text))
    assert data.interval_in(run.trajectory) == pytest.approx((begin, float(start["t_s"].iloc[-1])), abs=1e-5)
    page = write_report([tmp_path / "a"], data=f"{tmp_path}/rig.csv:t_s=t_s,y=y_m,shift=fit").read_text("utf-8")
    assert "measured: rig.csv" in page
    assert "rig.csv: y differs by &lt; 0.1 %" in page


def test_a_run_does_not_differ_from_its_own_table(tmp_path):
    """In no column, with both rows of each impact, heights included."""
    changes = {"run.duration_s": 0.5, "material": {"mass_ratio": 0.2, "layers": 1}, "contact.restitution": 0.5}
    run = simulate(Scene().replace(changes | {"drive.supply_frequency_hz": 60.0}))
    run.save(tmp_path / "a/run")
    run.trajectory.to_csv(tmp_path / "own.csv", index=False)
    assert (np.diff(run.trajectory["t_s"]) == 0.0).any()
    data = read_data(tmp_path / "own.csv")
    list(draw_results([load(tmp_path / "a")], ["measured"], data=data))
    compared = {column: error for column, error in data.errors.items() if np.isfinite(error)}
    assert len(compared) > 10
    assert set(compared.values()) == {0.0}
