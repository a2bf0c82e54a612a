"""Studies on the page: what is drawn of each kind, what a click on a point finds, tables, and odd answers."""

import re
import shutil

import numpy as np
import pandas as pd
import pytest
from common.pages import data_of, figures_of, page_of, read, unpacked
from common.results import of_kind, unproven

from vibroplat.continuation.rows import orbit_motion
from vibroplat.errors import VibroplatError
from vibroplat.page import orbits, tables
from vibroplat.page.tables import rows_on_page, table_html
from vibroplat.results.tables import read_table, write_table


def changed(source, place, name, **columns):
    """Copy a result with other columns of a table."""
    copy = unproven(shutil.copytree(source, place))
    write_table(read_table(copy, name).assign(**columns), copy, name, "parquet")
    return copy


def section(text, number):
    """The part of a page that shows a picture."""
    begin = text.index(f'id="picture-{number}"')
    end = text.find(f'id="picture-{number + 1}"')
    return text[begin : end if end > 0 else len(text)]


def lost(scene, row):
    raise VibroplatError("lost")


# -- sweeps and branches --------------------------------------------------------------------------------


def test_a_sweep_is_drawn_with_its_jumps_its_failures_and_all_points_to_click(swept):
    text = page_of(swept)
    figures, table = figures_of(text), read_table(swept, "sweep")
    rms = figures["RMS y"]
    points = rms.points(next(name for name in rms.names if name.startswith("mass ratio 0,")))
    assert points[:, 1].max() == pytest.approx(1e3 * table["rms_y_m"].max(), rel=0.01)
    jumps = table["rms_y_m"].diff().abs() > 1e-3
    assert jumps.any()
    assert rms.text.count('title="jump"') >= 1
    assert {*rms.hits} == {*table.index[table["rms_y_m"].notna()]}, "also where curves coincide"
    strips = figures["mass ratio"]
    assert strips.text.count("<rect") >= 8, "antiphase and in-phase, of four branches"
    assert "Over another column" in text


def test_branches_are_dashed_where_unstable_and_have_their_special_points(followed):
    text = page_of(followed)
    rms = figures_of(section(text, 0))["RMS y"]
    dashes = dict(re.findall(r'data-n="(\w+)" style="stroke:#\w+;(stroke-dasharray:[\d ]+|stroke-width)', rms.text))
    assert dashes["stable"] == "stroke-width"
    assert dashes["unstable"].startswith("stroke-dasharray")
    count = len(read_table(followed, "branches"))
    assert data_of(text)["marks"] == {str(count): "fold", str(count + 1): "grazing"}
    assert rms.text.count('class="symbol"') == 2
    assert [*figures_of(section(text, 1))] == ["mass ratio"]
    assert any(name.startswith("fold") for name in figures_of(section(text, 1))["mass ratio"].names)


def test_a_point_without_a_motion_is_no_end_of_a_page(swept, tmp_path):
    none = dict.fromkeys(("rms_y_m", "rms_x_m", "phase_difference_rad", "gap_max_m", "excitation_frequency_hz"), np.nan)
    text = page_of(changed(swept, tmp_path / "copy", "sweep", outcome="too-many-events", **none))
    assert "Table sweep" in text
    one = changed(swept, tmp_path / "one", "sweep")
    write_table(read_table(one, "sweep").iloc[:1], one, "sweep", "parquet")
    assert figures_of(page_of(one))["RMS y"].hits == [0]


# -- tables ---------------------------------------------------------------------------------------------


def cells(text):
    """Cells of the first table of a text, by rows."""
    body = text[text.index("<tbody>") : text.index("</tbody>")]
    return [row.split("<td>")[1:] for row in body.split("<tr>")[1:]]


def test_tables_have_one_unit_and_as_many_decimals_as_a_column_needs():
    table = pd.DataFrame(
        {
            "rms_y_m": [1.23456789e-3, np.nan, 2e-9],
            "supply_frequency_hz": [42.0, 42.5, 43.0],
            "period": pd.array([1, None, 2], dtype="Int64"),
            "energy_residual": [3e-9, 2e-9, 0.0],
            "stable": [True, False, True],
            "note": ["<b>", None, "x"],
        }
    )
    text = table_html("points", table)
    assert cells(text) == [
        ["1.23", "42.0", "1", "3", "yes", "&lt;b&gt;"],
        ["–", "42.5", "–", "2", "no", "–"],
        ["0", "43.0", "2", "0", "yes", "x"],
    ]
    assert "RMS y (mm)" in text
    assert "energy residual (10⁻⁹)" in text
    assert 'data-n="supply_frequency_hz"' in text


def test_columns_that_are_nothing_beside_their_kind_are_0_and_others_have_the_digits_of_their_unit():
    table = pd.DataFrame(
        {
            "supply_frequency_hz": [50.125, 50.25],
            "rms_x_m": [1.03e-13, 2e-13],
            "rms_phi_rad": [4e-13, 1e-13],
            "rms_y_m": [1.07794e-3, 1.5104e-3],
            "excitation_frequency_hz": [24.65312, 24.52107],
            "frequency_split_hz": [0.0012, 0.0],
            "speed_ripple_hz": [3e-12, 0.0],
            "phi_max_rad": [2.5e-16, 0.0],
            "multiplier_max": [0.99987, 0.96838],
            "sync": ["antiphase", "antiphase"],
        }
    )
    text = table_html("points", table)
    assert cells(text) == [
        ["50.125", "0", "0", "1.08", "24.65", "0.0012", "0", "0", "0.99987", "antiphase"],
        ["50.250", "0", "0", "1.51", "24.52", "0", "0", "0", "0.96838", "antiphase"],
    ]
    assert {"RMS x (mm)", "RMS φ (mrad)", "synchronization"} <= {*re.findall("<th[^>]*>([^<]*)", text)}


def test_a_long_table_loses_rows_evenly_and_says_so(monkeypatch):
    monkeypatch.setattr(tables, "MOST_CELLS", 1000)
    table = pd.DataFrame({"x": np.arange(10_000.0), "y": 0.0})
    kept = rows_on_page(table)
    assert (len(kept), kept[0], kept[-1]) == (500, 0, 9999)
    assert np.ptp(np.diff(kept)) <= 1
    assert "The page holds 500 of 10000 rows, evenly chosen" in table_html("points", table)


def test_twenty_thousand_points_are_a_small_page_in_which_all_extremes_are_seen(swept, tmp_path):
    copy = unproven(shutil.copytree(swept, tmp_path / "copy"))
    table = read_table(copy, "sweep")
    count = 20_000
    branch = np.repeat(np.arange(20), count // 20)
    supply = np.tile(np.linspace(42.0, 49.0, count // 20), 20)
    size = 1e-3 * (1.0 + 0.1 * np.random.default_rng(1).random(count))
    size[15_777] = 5e-3
    long = pd.DataFrame({name: np.repeat(table[name].iloc[:1].to_numpy(), count) for name in table})
    varied = ("rms_x_m", "rms_phi_rad", "motor_power_w", "phase_difference_rad", "lyapunov_per_s")
    columns = {
        "supply_frequency_hz": supply,
        "excitation_frequency_hz": 0.49 * supply,
        "rms_y_m": size,
        "motion": "periodic",
        "branch": branch,
        "material.mass_ratio": 0.01 * branch,
        **dict.fromkeys(varied, size),
    }
    write_table(long.assign(**columns), copy, "sweep", "parquet")
    text = page_of(copy)
    assert len(text.encode()) < 700_000, "half a megabyte is left for orbits"
    rms = figures_of(text)["RMS y"]
    assert max(rms.points(name)[:, 1].max() for name in rms.names) == pytest.approx(5.0, rel=0.01)
    assert re.search(r"[0-9]+ of 20000 rows, evenly chosen</small></summary>", text)


# -- orbits of points -----------------------------------------------------------------------------------


@pytest.mark.long
def test_points_of_branches_have_their_orbits(branched):
    text = page_of(branched, mover=orbit_motion)
    table, data = read_table(branched, "branches"), data_of(text)
    assert len(data["owner"]) == len(table) + len(read_table(branched, "special"))
    assert min(data["owner"]) >= 0
    assert text.count("<template id=") == 2, "with material and without"
    for row, place in enumerate(data["owner"][: len(table)]):
        orbit = data["list"][place]
        y = unpacked(orbit["columns"]["y_m"], orbit["frames"])
        assert orbit["windows"][0][1] == pytest.approx(table["period_s"][row], rel=1e-3)
        assert np.ptp(y) / np.sqrt(8.0) == pytest.approx(1e3 * table["rms_y_m"][row] / 1e3, rel=0.2)
        assert abs(y[0] - y[-1]) < 0.2 * np.ptp(y) + 1e-12


@pytest.mark.long
def test_points_without_an_orbit_say_why(branched, tmp_path):
    table = read_table(branched, "branches")
    period = table["period"].astype("Int64").to_numpy(dtype=object)
    period[1] = 0
    outcome = np.array(["ok"] * len(table), dtype=object)
    outcome[2] = "solver-failure"
    copy = changed(branched, tmp_path / "copy", "branches", period=pd.array(period, dtype="Int64"), outcome=outcome)
    data = data_of(page_of(copy, mover=orbit_motion))
    why = [data["why"][-1 - owner] if owner < 0 else "" for owner in data["owner"]]
    assert "does not repeat" in why[1]
    assert "failed (solver-failure)" in why[2]
    table.loc[0, "y_m"] += 1e-3
    shifted = changed(branched, tmp_path / "shifted", "branches", y_m=table["y_m"])
    data = data_of(page_of(shifted, mover=orbit_motion))
    assert "is not on an orbit of period 1" in data["why"][-1 - data["owner"][0]]


def test_special_points_and_ends_come_first_where_there_is_little_room(branched, monkeypatch):
    monkeypatch.setattr("vibroplat.page.report.MOST_SAMPLES", 10 * orbits.SAMPLES)
    told = []
    text = page_of(branched, mover=orbit_motion, progress=lambda *counts: told.append(counts))
    data, count = data_of(text), len(read_table(branched, "branches"))
    special = len(read_table(branched, "special"))
    assert len(data["list"]) <= 10 < count
    assert min(data["owner"][count : count + special]) >= 0
    assert min(data["owner"][0], data["owner"][count - 1]) >= 0
    assert [done for done, _ in told] == [*range(len(told))]
    assert "does not hold the orbit of this point" in " ".join(data["why"])
    assert f"orbits of {sum(one >= 0 for one in data['owner'])} of {len(data['owner'])} points" in read(text)


def test_pictures_of_one_table_share_it_and_its_orbits(swept, tmp_path):
    copy = of_kind(unproven(shutil.copytree(swept, tmp_path / "copy")), "map")
    text = page_of(copy)
    assert (data_of(text, 0)["home"], data_of(text, 1)["home"]) == (0, 0)
    assert "<table" in section(text, 0)
    assert '<table class="rows"' not in section(text, 1)
    figure = figures_of(section(text, 1)).popitem()[1]
    assert len({*figure.hits} & {*range(32)}) == 16
    assert figure.ends(0)[0] > 40.0, "the axis is that of its strips"


def test_neighbours_of_one_class_are_one_tile_of_a_map(swept, tmp_path):
    copy = of_kind(unproven(shutil.copytree(swept, tmp_path / "copy")), "map")
    table = read_table(copy, "sweep").query("direction == 'up'")
    rows = [table.assign(**{"material.mass_ratio": table["material.mass_ratio"] + 0.2 * n}) for n in range(4)]
    write_table(pd.concat(rows, ignore_index=True).assign(motion="chaotic"), copy, "sweep", "parquet")
    (figure,) = figures_of(section(page_of(copy), 1)).values()
    assert len(figure.hits) == 64
    assert 5 < figure.text.count("url(#hatch-0)") < 64


# -- basins, thresholds and designs ---------------------------------------------------------------------


def test_each_start_moves_as_its_attractor(answered):
    text = page_of(answered["basins"], mover=orbit_motion)
    data, starts = data_of(text), read_table(answered["basins"], "starts")
    attractors = read_table(answered["basins"], "attractors")["attractor"].tolist()
    assert len(attractors) == len(data["list"]) == 2
    assert [attractors[owner] for owner in data["owner"]] == [*starts["attractor"], *attractors]
    assert data["owned"]
    (first, *_) = figures_of(section(text, 0)).values()
    assert {*first.hits} == {*range(40)}
    assert len({name.partition(":")[0] for name in first.names} & {*attractors}) == 2


def test_over_a_key_shares_are_stacked_and_starts_are_of_one_value(answered):
    text = page_of(answered["over"], mover=orbit_motion)
    shares = next(one for title, one in figures_of(section(text, 0)).items() if title.startswith("basin fraction"))
    table = read_table(answered["over"], "attractors")
    assert shares.unit == "%"
    assert {*shares.names} == {*table["attractor"]}
    assert shares.points(shares.names[-1])[:, 1].max() == pytest.approx(100.0, abs=0.5)
    assert data_of(text, 1)["owned"]
    assert len({*data_of(text, 1)["owner"]}) <= len(table)
    values = read_table(answered["over"], "starts")["supply_frequency_hz"]
    first, *_ = figures_of(section(text, 1)).values()
    assert {*values.iloc[first.hits]} == {values.min()}, "the other values are folded"


def test_thresholds_are_lines_and_move_as_what_is_below(answered):
    text = page_of(answered["thresholds"], mover=orbit_motion)
    table, scan = (read_table(answered["thresholds"], name) for name in ("thresholds", "scan"))
    rms = figures_of(section(text, 0))["RMS y"]
    assert rms.text.count('class="rule"') >= len(table)
    data = data_of(text)
    below = data["owner"][len(scan) :]
    assert len(below) == len(table)
    assert "does not repeat" in data["why"][-1 - below[0]], "chaotic below the period doubling"
    assert below[1] >= 0
    assert below[1] in data["owner"][: len(scan)]
    assert "material.mass_ratio = 0.2022" in read(text) or "0.2022" in read(text)


def test_designs_have_elasticities_samples_and_searches_with_a_front(answered):
    text = page_of(answered["design"], answered["best"], mover=orbit_motion)
    titles = re.findall(r"<h2>(\w+)", text)
    assert titles == ["Elasticities", "Tolerances", "Elasticities", "Searches"]
    elastic = read_table(answered["design"], "sensitivities").dropna(subset=["elasticity"])
    assert len(figures_of(section(text, 0))) == elastic["measure"].nunique()
    searches, data = section(text, 3), data_of(text, 3)
    rows = len(read_table(answered["best"], "evaluations"))
    assert data["marks"] == {str(rows): "best"}
    assert len(data["owner"]) == rows + 3
    assert min(data["owner"]) >= 0
    assert any("Pareto front" in one.names for one in figures_of(searches).values())


def test_a_search_that_finds_nothing_has_no_best_design(answered, tmp_path):
    copy = changed(answered["best"], tmp_path / "copy", "evaluations", feasible=False, best=False)
    data = data_of(page_of(copy, mover=lost), 1)
    assert (data["marks"], data["list"]) == ({}, [])


def test_motions_that_settle_nowhere_and_values_that_are_missing(answered, tmp_path):
    nothing = {"motion": "undecided", "period": np.nan, "rms_y_m": np.nan}
    basins = changed(answered["basins"], tmp_path / "basins", "attractors", **nothing)
    failed = {"outcome": "too-many-events", "sync": None, "motion": None, "rms_y_m": np.nan, "rms_x_m": np.nan}
    values = changed(answered["thresholds"], tmp_path / "find", "scan", **failed)
    write_table(read_table(values, "thresholds").iloc[:0], values, "thresholds", "parquet")
    text = page_of(basins, values, mover=orbit_motion)
    assert all("does not repeat" in why for why in data_of(text, 0)["why"])
    assert data_of(text, 1)["list"] == []


# -- answers --------------------------------------------------------------------------------------------


def test_a_directory_holds_a_sweep_and_basins(answered, measured, tmp_path):
    both = shutil.copytree(measured, tmp_path / "both")
    shutil.copytree(answered["basins"], both / "basins")
    assert re.findall(r"<h2>(\w+)", page_of(both)) == ["Sweep", "Basins"]
