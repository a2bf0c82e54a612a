"""Tables for other programs, beside the files that are read here."""

import numpy as np
import pandas as pd
import pytest
from common.results import unproven
from scipy.io import loadmat

from vibroplat import load
from vibroplat.errors import TableError
from vibroplat.results import exports
from vibroplat.results.files import SCHEMA, export_result, write_result
from vibroplat.results.tables import read_table

COUNT = pd.array([3, None], "Int64")
TABLE = pd.DataFrame({"material.mass_ratio": [0.1, np.nan], "motion": ["chaotic", None], "n": [1, 2], "count": COUNT})


@pytest.fixture
def written(tmp_path):
    """Write the table and a document in a format; return the directory."""

    def write(form, table=TABLE):
        proof, documents = {"schema": SCHEMA}, {"told": {"a_m": 0.5, "b": None}}
        write_result(tmp_path, "sweep", proof, {"sweep": table}, documents, form=form)
        pd.testing.assert_frame_equal(read_table(tmp_path, "sweep"), table)
        return tmp_path

    return write


def test_a_workbook_has_tables_documents_and_what_columns_mean(written, runs, tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.load_workbook(written("xlsx") / "sweep.xlsx")
    assert [*book["sweep"].iter_rows(values_only=True)] == [tuple(TABLE), (0.1, "chaotic", 1, 3), (None, None, 2, None)]
    assert [*book["told"].iter_rows(values_only=True)] == [("a_m", 0.5, "m"), ("b", None, None)]
    runs["bare"].save(tmp_path / "run", "xlsx")
    book = openpyxl.load_workbook(tmp_path / "run" / "run.xlsx")
    assert book.sheetnames == ["trajectory", "events", "summary", "columns"]
    assert ("t_s", "s", "time") in [*book["columns"].iter_rows(values_only=True)]
    *_, last = book["trajectory"].iter_rows(values_only=True)
    assert load(tmp_path / "run").trajectory["y_m"].iloc[-1] == pytest.approx(last[3], rel=1e-14)


def test_a_file_for_matlab_has_structures(written):
    found = loadmat(written("mat") / "sweep.mat", simplify_cells=True)
    assert found["sweep"]["material_mass_ratio"].tolist() == pytest.approx([0.1, np.nan], nan_ok=True)
    assert found["sweep"]["count"].tolist() == pytest.approx([3.0, np.nan], nan_ok=True)
    assert found["sweep"]["motion"][0] == "chaotic"
    assert found["told"]["a_m"] == 0.5


def test_csv_for_spreadsheets_has_decimal_commas(written):
    text = (written("csv-semicolon") / "sweep.csv").read_bytes().decode("utf-8-sig")
    assert text.splitlines() == ["material.mass_ratio;motion;n;count", "0,1;chaotic;1;3", ";;2;"]


def test_an_export_goes_with_the_result_that_it_was_made_of(written):
    for form in ("mat", "csv-semicolon", "parquet"):
        names = {path.name for path in written(form).iterdir()}
    assert names == {"sweep.parquet", "told.json", "provenance.json", "files.lock"}


def test_a_table_longer_than_a_sheet_is_cut_with_a_line(written, monkeypatch, caplog):
    openpyxl = pytest.importorskip("openpyxl")
    monkeypatch.setattr(exports, "SHEET_ROWS", 5)
    table = pd.DataFrame({"v": np.arange(7.0)})
    book = openpyxl.load_workbook(written("xlsx", table) / "sweep.xlsx")
    assert [v for (v,) in book["sweep"].iter_rows(values_only=True)] == ["v", 0.0, 1.0, 2.0, 3.0]
    assert caplog.messages[0].startswith("a sheet of Excel has 5 rows, and the sweep table 8: the rest is in")


def test_excel_without_its_package_is_refused_before_anything_is_simulated(command, tmp_path, monkeypatch):
    monkeypatch.setattr(exports, "find_spec", lambda name: None)
    done = command("run", "nowhere.yaml", "--format", "xlsx")
    assert done.code == 2
    assert done.err == (
        "vibroplat: --format xlsx needs openpyxl: pip install 'vibroplat[xlsx]'; allowed without: mat, csv\n"
    )


def test_a_finished_result_is_exported_and_a_new_one_takes_the_exports_away(written):
    directory = written("parquet")
    for form, names in (("mat", ["sweep.mat"]), ("csv-semicolon", ["sweep.csv"])):
        assert [path.name for path in export_result(directory, "sweep", form)] == names
    assert (directory / "sweep.csv").read_bytes() == (written("csv-semicolon") / "sweep.csv").read_bytes()
    export_result(directory, "sweep", "mat")
    assert not {"sweep.mat", "sweep.csv"} & {path.name for path in written("parquet").iterdir()}
    with pytest.raises(TableError, match="no Parquet tables; allowed: a result of --format parquet"):
        export_result(written("csv", TABLE.drop(columns="count")), "sweep", "mat")


def test_a_changed_or_damaged_table_is_not_exported(written):
    directory = written("parquet")
    path = directory / "sweep.parquet"
    whole = path.read_bytes()
    TABLE.assign(n=7).to_parquet(path)
    with pytest.raises(TableError, match=r"sweep\.parquet was changed or belongs to another result"):
        export_result(directory, "sweep", "mat")
    path.write_bytes(whole[:-9])
    unproven(directory)
    for form in ("mat", "csv-semicolon"):
        with pytest.raises(TableError, match=r"sweep\.parquet cannot be read: "):
            export_result(directory, "sweep", form)
    assert not {"sweep.mat", "sweep.csv"} & {path.name for path in directory.iterdir()}
