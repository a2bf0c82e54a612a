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
from vibroplat.plots.measured import MAX_BYTES, Measured, _number, best_shift, read_data, relative_error

from .conftest import drawn

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
    for name, line in (
        ("pipe", "is no regular file; allowed: a CSV file"),
        ("/dev/zero", "is no regular file; allowed: a CSV file"),
        ("book.xlsx", "is no text; allowed: a CSV file, as spreadsheets save it"),
        ("large.csv", "has 64 MiB; allowed: at most 64 MiB"),
    ):
        with pytest.raises(TableError, match=line):
            read_data(tmp_path / name)


TIMES = np.arange(0.0, 2.0, 1e-3)


def chirp(t):
    return np.sin(20.0 * t + 40.0 * t * t)


@pytest.mark.parametrize(
    ("begin", "end", "rate"),
    [(0.4, 1.1, 800.0), (-1.0, 4.0, 3000.0), (0.3, 1.7, 25.0), (-1.0, 4.0, 20.0)],
    ids=["shorter", "longer", "slower", "longer and slower"],
)
def test_the_shift_in_time_is_found_by_correlation(begin, end, rate):
    """To a part of a sample, whichever is longer, and whatever the clock of the data says and their scale is.

    Also where the data have less than two samples of an oscillation.
    """
    t = np.arange(begin, end, 1.0 / rate)
    measured = t + 77.0003, 3.0 + 0.1 * chirp(t)
    assert best_shift(measured, (TIMES, chirp(TIMES)))[0] == pytest.approx(-77.0003, abs=2e-5)


def test_of_motion_that_repeats_the_smallest_shift_is_taken():
    """Of a period of 0.1 s."""
    t = np.arange(0.5, 1.0, 1e-3)
    measured, computed = (t, np.sin(20.0 * np.pi * (t + 0.02))), (TIMES, np.sin(20.0 * np.pi * TIMES))
    shift, alike = best_shift(measured, computed)
    assert shift == pytest.approx(0.02, abs=1e-5)
    assert np.diff(alike) == pytest.approx(0.1, abs=1e-4)
    told = Measured(Path("rig"), pd.DataFrame(), shift=shift, alike=alike).shifted
    assert told == f"shifted by 0.02 s, of {len(alike)} shifts, −0.480 … 0.920 s, that differ as little"
    with pytest.raises(TableError, match="shift=fit finds nothing to correlate"):
        best_shift((t, 0.0 * t), computed)
    with pytest.raises(TableError, match="shift=fit needs values over time"):
        best_shift((t[:1], t[:1]), computed)
    with pytest.raises(TableError, match="times span 499000 s; allowed with shift=fit: seconds"):
        best_shift((1e6 * t, measured[1]), computed)


@pytest.mark.parametrize("factor", [1.0, 1.1])
def test_of_turns_that_hardly_differ_that_of_the_least_error_is_taken(factor):
    """Turns of 40 ms whose second order shifts slowly correlate by more than 0.998 with those beside them."""
    times = np.arange(0.0, 4.0, 5e-4)

    def drifting(t):
        return np.sin(50.0 * np.pi * t) + 0.2 * np.sin(100.0 * np.pi * t + 2.0 * t)

    t = np.arange(2.0, 3.0, 7.1e-4)
    measured = t - 1.23456, factor * drifting(t)
    shift, alike = best_shift(measured, (times, drifting(times)))
    assert shift == pytest.approx(1.23456, abs=1.1e-5)
    assert len(alike) < 5
    data = Measured(Path("rig"), pd.DataFrame({"t_s": t, "y_m": measured[1]}), shift=-shift, alike=alike[:1])
    assert read_data_shift(data.shifted) == -1.23456


def read_data_shift(told):
    """Return a shift as it is read from what a line says."""
    return _number(told.removeprefix("shifted by ").removesuffix(" s"))


def test_the_error_is_that_of_the_difference_beside_the_measured_values():
    curve = TIMES, chirp(TIMES)
    assert relative_error((TIMES[5:50], chirp(TIMES[5:50]) / 0.9), curve) == pytest.approx(0.1, rel=1e-12)
    assert relative_error((TIMES + 5.0, chirp(TIMES)), curve) is None
    data = Measured(Path("rig"), pd.DataFrame({"t_s": TIMES, "y_m": chirp(TIMES)}), shift=0.25)
    data.compare("y_m", "t_s", [(TIMES, 2.0 * chirp(TIMES)), (TIMES, 1.1 * chirp(TIMES))])
    assert data.lines() == [
        "rig: y differs by 10 % (RMS of the difference / RMS of the measured values); shifted by 0.25 s"
    ]


def test_names_lose_blanks_at_their_ends_and_may_hold_semicolons(tmp_path):
    (tmp_path / "blanks.csv").write_text("Zeit ; Weg\n0;1,5\n1;2,5\n")
    found = read_data(f"{tmp_path}/blanks.csv:t=Zeit,y=Weg").select("t_s", ["y_m"])
    assert found.table["y_m"].tolist() == [1.5, 2.5]
    (tmp_path / "semicolon.csv").write_text("time (s; from start),y (m)\n0,1.5\n1,2.5\n")
    assert [*read_data(tmp_path / "semicolon.csv").given] == ["time (s; from start)", "y (m)"]


def test_samples_that_share_their_times_are_told(tmp_path, caplog):
    """As of an accelerometer that sends them in packets with one time stamp; an event has two rows of a trajectory."""
    for name, times in (("rig", "0011223344"), ("event", "0112345678")):
        (tmp_path / f"{name}.csv").write_text("\n".join(["t;y", *(f"{time};1" for time in times)]))
        read_data(f"{tmp_path}/{name}.csv:t=t,y=y")
    assert caplog.messages == [f"--data {tmp_path}/rig.csv: 5 of 10 rows have the time of the row before them"]


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
    """Without an interval the last turns would be shown, where the start is not."""
    scene = Scene().replace({"solver.engine": "taylor", "run.duration_s": 2.0, "run.initial.speed_ratio": 0.5})
    simulate(scene).save(tmp_path / "a/run")
    start = load(tmp_path / "a").trajectory.query("0.1 < t_s < 0.5")
    moved = start.assign(t_s=start["t_s"] + 12.7, y_m=start["y_m"] - static_rest(scene)[1])
    moved[["t_s", "y_m"]].to_csv(tmp_path / "rig.csv", index=False)
    data = read_data(f"{tmp_path}/rig.csv:t_s=t_s,y=y_m,shift=fit")
    drawn("run", tmp_path / "a", kinds=["measured"], data=data)
    assert data.errors["y_m"] < 2e-3
    again = read_data(f"{tmp_path}/rig.csv:t_s=t_s,y=y_m,shift=-12.7")
    drawn("run", tmp_path / "a", kinds=["motion"], data=again)
    assert again.errors["y_m"] < 2e-3
    figure = load(tmp_path / "a").plot("motion", data=f"{tmp_path}/rig.csv:t_s=t_s,y=y_m,shift=-12.7")
    assert any("data" in text.get_text() or "rig" in text.get_text() for text in figure.findobj(Text))
    found = data.interval_in(load(tmp_path / "a").trajectory)
    assert data.shift == pytest.approx(-12.7, abs=1e-3)
    assert found == pytest.approx((0.1, 0.5), abs=2e-3)
