"""Files as loggers, phone apps, LabVIEW and spreadsheets write them: names, units, numbers, gaps and times."""

import numpy as np
import pandas as pd
import pytest

from vibroplat.errors import TableError
from vibroplat.measured.data import read_data
from vibroplat.measured.numbers import numbers_of, seconds_of

LVM = """LabVIEW Measurement\t
Separator\tTab
Decimal_Separator\t,
Date\t2024/05/03
***End_of_Header***\t
\t
Channels\t1\t
Samples\t3\t
***End_of_Header***\t\t
X_Value\tAcc_y\tComment
0,000\t1,5\t
0,001\t2,5\t
0,002\t3,5
"""
DATED = "when,a\n2024-05-03 23:59:59.999,1.5\n2024-05-04 00:00:00.000,2.5\n2024-05-04 00:00:00.001,3.5\n"


@pytest.mark.parametrize(
    ("text", "mapping"),
    [
        ("Recorder: X\nSerial: 1\n\nTime (s),Acc y (m/s^2)\n0,1.5\n0.001,2.5\n0.002,3.5\n", "t=Time (s),ay=Acc y"),
        ("# Recorder, X\nt,a\n0,1.5\n# stopped for a moment\n0.001,2.5\n0.002,3.5\n", "t=t,ay=a"),
        ("# t a\n0 1.5\n0.001 2.5\n0.002 3.5\n", "t=t,ay=a"),
        ("0 1.5\n0.001 2.5\n0.002 3.5\n", "t=1,ay=2"),
        ("Zeit;Beschl\ns;m/s²\n0,000;1,5\n0,001;2,5\n0,002;3,5\n", "t=Zeit,ay=Beschl"),
        ("time,acc\n(ms),[mm/s²]\n0,1500\n1,2500\n2,3500\n", "t=time,ay=acc"),
        ("t|a\n0|1.5\n1e-3|2.5\n2D-3|3.5\n", "t=t,ay=a"),
        ("t   a\n 0   1.5\n 0.001   2.5\n 0.002   3.5\n", "t=t,ay=a"),
        ('Time: s,"Acc, y=up"\n0,1.5\n0.001,2.5\n0.002,3.5\n', 't=Time: s,"ay=Acc, y=up"'),
        ('"t","a"\n"0,000","1,5"\n"0,001","2,5"\n"0,002","3,5"\n', "t=t,ay=a"),
        ("t;a;who\n0,000;1,5;me\n0,001;2,5;me\n0,002;3,5;me\n", "t=t,ay=a"),
        (LVM, "t=X_Value,ay=Acc_y"),
        (DATED, "t=when,ay=a,shift=0"),
        ("when,a\n23:59:59:999,1.5\n00:00:00:000,2.5\n00:00:00:001,3.5\n", "t=when,ay=a,shift=0"),
        ("when;a\n03.05.2024 10:00:00,000;1,5\n03.05.2024 10:00:00,001;2,5\n03.05.2024 10:00:00,002;3,5\n",
         "t=when,ay=a,shift=0"),
        ("t,a\n1714731072000,1.5\n1714731072001,2.5\n1714731072002,3.5\n", "t=t,ay=a"),
        ("t,a\n1714731072000000000,1.5\n1714731072001000000,2.5\n1714731072002000000,3.5\n", "t=t*1e-9,ay=a"),
        ("t,a\n3600,1.5\n3600.001,2.5\n3600.002,3.5\n", "t=t,ay=a,shift=0"),
        ("t,a\n0.002,3.5\n0.001,2.5\n0,1.5\n", "t=t,ay=a"),
    ],
)  # fmt: skip
def test_files_are_read(text, mapping, tmp_path):
    (tmp_path / "log.csv").write_text(text, encoding="utf-8")
    data = read_data(f"{tmp_path}/log.csv:{mapping}").select("t_s", ["acceleration_y_m_per_s2"])
    table = data.table.sort_values("t_s")
    assert table["t_s"].to_numpy() == pytest.approx([0.0, 1e-3, 2e-3], abs=3e-7)
    assert table["acceleration_y_m_per_s2"].to_numpy() == pytest.approx([1.5, 2.5, 3.5])


@pytest.mark.parametrize(
    ("text", "mapping", "line"),
    [
        ("", "t=t", "cannot be read: it is empty; allowed: names of columns and rows of numbers"),
        ("only words\nand more\n", "t=t", "cannot be read: there are no numbers"),
        ("t,a\n0,1\n1,2,3\n", "t=t", "line 3 has more values than there are names; allowed: "),
        ("t,a\n0,1\n1,high\n2,3\n", "t=t,ay=a", "column acceleration_y_m_per_s2 holds 'high' in line 3; allowed: "),
        ("t,a (mm)\n0,1\n1,2\n", "t=t,ay=a", "acceleration_y_m_per_s2=a (mm) is in mm; allowed: m/s², mm/s², cm/s², g"),
        ("t,a\n0,1\n2,2\n1,3\n3,1\n", "t=t,ay=a", "time goes back in line 4; allowed: one record, in ascending order"),
        ("t;a\n0;1.234\n1;900\n2;2.345\n", "t=t,ay=a", "1.234 beside 900 may have thousands or decimals; allowed: "),
    ],
)
def test_what_cannot_be_read_is_told_with_its_line(text, mapping, line, tmp_path):
    (tmp_path / "log.csv").write_text(text, encoding="utf-8")
    with pytest.raises(TableError) as caught:
        read_data(f"{tmp_path}/log.csv:{mapping}").select("t_s", ["acceleration_y_m_per_s2"])
    assert str(caught.value).removeprefix(f"--data {tmp_path}/log.csv").lstrip(": ").startswith(line)


@pytest.mark.parametrize(
    ("columns", "numbers"),
    [
        ([["900,0", "1.000,0", "−1.234,5"]], [[900.0, 1000.0, -1234.5]]),
        ([["900.0", "27,749.031"]], [[900.0, 27749.031]]),
        ([["900", "27.749", "33.730"]], [[900.0, 27749.0, 33730.0]]),
        ([["0.125", "0.250", "100"]], [[0.125, 0.25, 100.0]]),
        ([["1.125", "2.250"]], [[1.125, 2.25]]),
        ([["0,5", "1,5"], ["1.125", "2.250"]], [[0.5, 1.5], [1125.0, 2250.0]]),
        ([["1.234.567", "2"]], [[1234567.0, 2.0]]),
        ([["1 234,5", "1’234,5", "1\u00a0234,5"]], [[1234.5] * 3]),
        ([["1", "#NV", "", "NaN", "#DIV/0!", "-", "2"]], [[1.0, *[np.nan] * 5, 2.0]]),
        ([["1.5", "1 2"]], [[1.5, "1 2"]]),
    ],
)
def test_decimal_signs_and_thousands_are_told_apart_by_all_numbers(columns, numbers):
    for found, wanted in zip(numbers_of(columns), numbers, strict=True):
        assert found == pytest.approx(wanted, nan_ok=True) if "1 2" not in wanted else found == wanted


def test_clocks_pass_midnight_and_packets_are_spread(tmp_path):
    assert seconds_of(["23:59:59.5", "", "00:00:00.5"]) == pytest.approx([0.0, np.nan, 1.0], nan_ok=True)
    assert seconds_of(["59:59.5", "60:00.5"]) == pytest.approx([0.0, 1.0])
    assert seconds_of(["1.5", "2"]) is None
    (tmp_path / "log.csv").write_text("t,a\n0,1\n0,2\n0,3\n3,4\n3,5\n3,6\n6,7\n6,8\n")
    data = read_data(f"{tmp_path}/log.csv:t=t*0.001,ay=a")
    assert data.given["t_s"].to_numpy() == pytest.approx(1e-3 * np.arange(8))
    assert data.notes == ["up to 3 samples have one time: they are spread evenly up to the next one"]


def test_a_workbook_is_read(tmp_path):
    pytest.importorskip("openpyxl")
    rows = [["Recorder", "X", None], ["when", "a", "b"], ["s", "g", "mm"], [0.0, 1.0, 5], [0.5, -1.0, None]]
    pd.DataFrame(rows).to_excel(tmp_path / "log.xlsx", header=False, index=False)
    data = read_data(f"{tmp_path}/log.xlsx:t=when,ay=a,y=b").select("t_s", ["acceleration_y_m_per_s2", "y_m"])
    assert data.table["acceleration_y_m_per_s2"].tolist() == pytest.approx([9.80665, -9.80665])
    assert data.factors == {"acceleration_y_m_per_s2": 9.80665, "y_m": 1e-3}
    assert data.notes == ["a is in g: multiplied by 9.80665", "b is in mm: multiplied by 0.001"]
