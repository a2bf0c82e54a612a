"""Keys and columns: each is described, and the pages in results/ are those that the commands write."""

from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq
import pytest
from common.commands import command as run_command
from common.places import QUICKSTART

from vibroplat import simulate, sweep
from vibroplat.cli.data_dictionary import LEADING_COLUMNS, TABLES, columns_page
from vibroplat.columns import unit_of
from vibroplat.config.keys import key_of, keys
from vibroplat.config.reader import flat
from vibroplat.config.scene import Scene
from vibroplat.results.tables import read_parts, read_table

RESULTS = Path(__file__).parents[2] / "results"
COLUMNS = {name: columns for name, (_, columns) in TABLES.items()}
PLAN = {"sweep.supply_frequency_hz": {"start": 45.0, "stop": 45.0}, "sweep.measure_s": 0.1}


@pytest.mark.parametrize(
    ("page", "arguments"), [("configuration", ("schema", "--markdown")), ("columns", ("columns",))], ids=str
)
def test_page_is_up_to_date(page, arguments, command):
    """Otherwise write it again: vibroplat schema --markdown > results/configuration.md, the same with columns."""
    done = command(*arguments)
    assert (done.code, done.err) == (0, "")
    assert done.out == (RESULTS / f"{page}.md").read_text(encoding="utf-8")


# -- keys -----------------------------------------------------------------------------------------------


def test_every_key_has_a_meaning_and_says_what_is_allowed():
    assert [k.name for k in keys().values() if not (k.meaning and k.allowed)] == []
    scene = Scene().replace({"run.initial.state": {"y_m": 0.0}, **PLAN})
    assert [name for name in flat(scene.to_tree()) if name not in keys()] == []


def test_a_key_is_told_with_symbol_unit_default_typical_values_and_range():
    assert key_of("machine.platform_mass_kg")[1:6] == ("m_0", "kg", 12.42, "200 … 5000", "number, > 0")
    assert key_of("exciters.1.critical_slip")[1:6] == ("s_c", "", 0.15, "0.1 … 0.3", "number, > 0")
    assert key_of("sweep.supply_frequency_hz.step").unit == "Hz"
    assert key_of("contact.impact_law").allowed == "conservative, central, printed"
    assert key_of("run.seed").allowed == "whole number, ≥ 0"


# -- columns --------------------------------------------------------------------------------------------


def test_page_begins_with_thirty_columns_and_the_tables_that_have_them():
    first, rest = columns_page().split("\n## ", 2)[1:]
    rows = [line.strip("| ").split(" | ") for line in first.splitlines() if line.startswith("| `")]
    assert ([row[0].strip("`") for row in rows], len(set(LEADING_COLUMNS))) == ([*LEADING_COLUMNS], 30)
    for name, row in zip(LEADING_COLUMNS, rows, strict=True):
        holding = [table for table, described in COLUMNS.items() if name in described]
        assert row[-1] == ", ".join(holding)
        assert row[2] == COLUMNS[holding[0]][name].meaning
    assert all(f"## {table}\n" in f"## {rest}" for table in TABLES)


def undescribed(table, name):
    return [column for column in table if column not in COLUMNS[name]]


def test_every_column_of_a_run_is_described(runs):
    program = {"drive.program": [{"t_s": 0.0, "supply_frequency_hz": 50.0}], "run.duration_s": 0.1}
    for run in (runs["two layers"], simulate(Scene().replace(program))):
        for name, table in (("trajectory", run.trajectory), ("events", run.events), ("trajectory", run.section)):
            assert undescribed(table, name) == []
            assert list(table.attrs["meanings"]) == list(table.attrs["units"]) == list(table)
        assert undescribed(run.summary, "summary.json") == []
    assert runs["two layers"]([0.1]).attrs == runs["two layers"].trajectory.attrs


def test_every_column_of_a_sweep_and_its_bands_is_described(kernels):
    result = sweep(Scene().replace({**PLAN, "sweep.grid": {"contact.restitution": [0.0]}}))
    for found, name, column in ((result.sweep, "sweep", "rms_y_m"), (result.bands, "bands", "from_rms_y_m")):
        assert undescribed(found, name) == ["contact.restitution"]
        assert [*found.attrs["meanings"]] == [*found]
        assert found.attrs["meanings"]["contact.restitution"] == "coefficient of restitution of impacts"
        assert found.attrs["units"][column] == "m"


def test_every_column_of_the_papers_tables_is_described():
    unknown = {}
    for path in sorted((RESULTS / "paper").glob("*/*.csv")):
        name = "fig4, fig5, fig7" if path.stem in ("fig4", "fig5", "fig7") else path.stem
        name = "sweep" if path.stem not in COLUMNS and name == path.stem else name
        header = pd.read_csv(path, nrows=0)
        unknown[path.name] = [column for column in undescribed(header, name) if column not in keys()]
        assert "wall_s" not in header
    assert len(unknown) == 9
    assert not any(unknown.values())


def test_parquet_files_carry_units_and_meanings(kernels, tmp_path):
    done = run_command("run", QUICKSTART, "--set", "run.duration_s=0.05", "--out", tmp_path)
    assert done.code == 0
    place = tmp_path / "quickstart/run"
    for name in ("trajectory", "events"):
        for field in pq.read_schema(place / f"{name}.parquet"):
            about = {key.decode(): value.decode() for key, value in field.metadata.items()}
            assert about["unit"] == unit_of(field.name)
            assert about["meaning"] == COLUMNS[name][field.name].text
        table = read_table(place, name)
        assert table.attrs["meanings"] == {column: COLUMNS[name][column].text for column in table}
        assert next(read_parts(place, name)).attrs == table.attrs


def test_units_follow_from_names():
    units = {"t_s": "s", "impulse_n_s": "N·s", "viscous_per_mass_per_s": "1/s", "phi_rate_rad_per_s": "rad/s"}
    units |= {"damping_phi_n_m_s_per_rad": "N·m·s/rad", "machine.platform_inertia_kg_m2": "kg·m²"}
    units |= {"motor_power_1_w": "W", "events": "", "impacts_per_period": "", "layers": ""}
    assert {name: unit_of(name) for name in units} == units
