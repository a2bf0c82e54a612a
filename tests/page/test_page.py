"""``vibroplat report``: what the page holds, and what is refused."""

import base64
import hashlib
import json
import re
import shutil
import zlib
from itertools import groupby

import numpy as np
import pandas as pd
import pytest
from common import handmade
from common.results import unproven

from vibroplat.columns import display_name, unit_of
from vibroplat.config.scene import Scene
from vibroplat.continuation.picture import MARKERS
from vibroplat.continuation.rows import orbit_motion
from vibroplat.errors import TableError
from vibroplat.page import pictures, report, run
from vibroplat.page.pictures import SYMBOLS, plain_column, spread
from vibroplat.page.results import find_results, parameters
from vibroplat.page.run import packed, packed_coarsely
from vibroplat.plots.reading import Ends
from vibroplat.results.content import measures
from vibroplat.results.picture import CURVES, STATES
from vibroplat.results.tables import read_json, read_table, write_table

HOSTILE = "</script><script>window.hacked = 1</script><img src=x onerror='window.hacked = 1'>"


def shown(*directories, **options):
    """Data of a page."""
    return report.page_data(find_results(list(directories)), **options)


def held(page):
    """Data that a page holds."""
    return json.loads(re.search(r'<script id="data"[^>]*>(.*?)</script>', page.read_text(), re.DOTALL).group(1))


def column(table, name):
    return next(one["values"] for one in table["columns"] if one["name"] == name)


def opened(text):
    """Numbers that were packed."""
    return np.frombuffer(base64.b64decode(text), "<f4")


def unpacked(column):
    """Numbers that were packed coarsely."""
    low, high, text = column
    parts = np.frombuffer(base64.b64decode(text), "<u2").astype(float)
    return np.where(parts == 65535, np.nan, low + (high - low) * parts / 65534)


@pytest.fixture
def _undrawn(monkeypatch):
    """Leave the figures for browsers without scripts empty: they take most of a page's time."""
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda *_, **__: None)


# -- words ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "said", "of"),
    [
        ("machine.unbalance_mass_kg", "unbalance mass", "kg"),
        ("machine.damping_phi_n_m_s_per_rad", "damping φ", "N·m·s/rad"),
        ("rms_y_m", "RMS y", "m"),
        ("gap_max_m", "largest gap", "m"),
        ("material.mass_ratio", "mass ratio", ""),
    ],
)
def test_words_and_units_follow_from_keys(key, said, of):
    assert (display_name(key), unit_of(key)) == (said, of)


def test_parameters_have_meanings_and_are_marked_where_they_are_not_the_default_or_differ(quickstart_scene):
    tree = {"machine": {"platform_mass_kg": 1.0, "weight_kg": 2.0}, "motors": [{}, {"critical_slip": 0.1}]}
    meanings = {row["words"]: row["meaning"] for row in parameters(["run"], [tree])}
    assert [meanings[name][:5] for name in ("platform mass", "critical slip", "weight")] == ["m_0: ", "s_c: ", ""]
    tree = quickstart_scene.to_tree()
    other = quickstart_scene.replace({"machine.damping_y_n_s_per_m": 400.0})
    rows = {r["words"]: r for r in parameters(["run", "run"], [tree, other.to_tree()])}
    radius, damping, mass = (rows[name] for name in ("unbalance radius", "damping y", "platform mass"))
    assert (radius["default"], radius["values"], radius["changed"]) == (0.09, [0.03, 0.03], [True, True])
    assert (damping["values"], damping["changed"], damping["differs"]) == ([40.0, 400.0], [False, True], True)
    assert (mass["changed"], mass["differs"], mass["unit"]) == ([False, False], False, "kg")
    run, sweep = ({row["section"].split(" ")[0] for row in parameters([c], [tree])} for c in ("run", "sweep"))
    assert "run" in run - sweep
    assert "sweep" in sweep - run


# -- numbers --------------------------------------------------------------------------------------------


def test_numbers_are_plain_json_or_right_to_a_pixel():
    table = pd.DataFrame({"a": [1.0, np.nan, np.inf], "b": pd.array([1, None, 3], dtype="Int64"), "c": ["x", "", None]})
    assert [plain_column(table[name]) for name in table] == [[1.0, None, None], [1, None, 3], ["x", "", None]]
    assert plain_column(pd.Series([True, False])) == [True, False]
    values = np.array([-2.0, np.nan, 0.1, 3.0])
    np.testing.assert_allclose(unpacked(packed_coarsely(values)), values, atol=5.0 / 65534)
    assert unpacked(packed_coarsely([7.0, 7.0])).tolist() == [7.0, 7.0]
    assert np.isnan(unpacked(packed_coarsely([np.nan]))).all()


# -- runs -----------------------------------------------------------------------------------------------


def test_a_short_run_is_on_the_page_as_it_is(moved):
    (data,) = shown(moved["two layers"])["runs"]
    trajectory = read_table(moved["two layers"], "trajectory")
    assert data["rows"] == data["of"] == len(trajectory)
    assert data["coarse"] is None
    sag = read_json(moved["two layers"], "summary")["static_sag_m"]
    np.testing.assert_allclose(opened(data["columns"]["y_m"]), trajectory["y_m"] + sag, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(data["origin"] + opened(data["columns"]["t_s"]), trajectory["t_s"], atol=1e-7)
    assert data["modes"] == "".join(mode[0] for mode in trajectory["mode"])
    events = read_table(moved["two layers"], "events")
    assert data["impacts"] == events.loc[events["impulse_n_s"] > 0.0, ["t_s", "impulse_n_s"]].to_numpy().tolist()


def test_infinite_numbers_are_missing(moved, tmp_path):
    copy = unproven(shutil.copytree(moved["two layers"], tmp_path / "copy"))
    for name in ("trajectory", "events"):
        table = read_table(copy, name)
        numbers = table.select_dtypes(float).columns.drop("t_s")
        table.loc[len(table) // 2 :, numbers] = np.inf
        write_table(table, copy, name, "parquet")
    assert "Infinity" not in report.page(shown(copy))


@pytest.mark.long
def test_a_long_run_keeps_its_last_rows_and_the_extremes_of_all(moved, monkeypatch):
    monkeypatch.setattr(run, "ROWS", 100)
    monkeypatch.setattr(run, "INTERVALS", 20)
    monkeypatch.setattr("vibroplat.results.tables.MAX_PART_ROWS", 37)
    (data,) = shown(moved["two layers"])["runs"]
    trajectory = read_table(moved["two layers"], "trajectory")
    assert (data["rows"], data["of"]) == (100, len(trajectory))
    assert data["origin"] == trajectory["t_s"].iloc[-100]
    for name in ("x_m", "contact_force_n"):
        coarse = opened(data["coarse"][name]["values"])
        assert len(coarse) < len(trajectory)
        np.testing.assert_allclose(
            [coarse.min(), coarse.max()], [trajectory[name].min(), trajectory[name].max()], rtol=1e-6
        )


@pytest.mark.long
def test_a_start_is_shown_from_its_beginning(moved, started, monkeypatch):
    assert not shown(moved["two layers"])["transient"]
    data = shown(started)
    assert data["transient"]
    monkeypatch.setattr(run, "ROWS", 100)
    (cut,) = shown(started)["runs"]
    assert (cut["origin"], cut["rows"]) == (0.0, 100)
    (chosen,) = shown(started, start=0.1)["runs"]
    assert chosen["origin"] == pytest.approx(0.1, abs=1e-3)
    monkeypatch.setattr(run, "ROWS", 200)
    together = shown(moved["two layers"], started)
    assert [one["origin"] for one in together["runs"]] == [0.0, 0.0]


def test_a_switch_of_the_supply_is_a_transient_if_the_run_reaches_it(quickstart_scene):
    speeds = np.array([160.0, -160.0])
    off = {"drive": {"program": [{"t_s": 0.0, "supply_frequency_hz": 50.0}, {"t_s": 1.0, "exciter_1": "off"}]}}
    switched = Scene.from_tree(quickstart_scene.to_tree() | off)

    def is_transient(scene, last=2.0, before=speeds):
        ends = ((0.0, before), (last, speeds))
        return run.is_transient(Ends(10, *(pd.Series([t, *v], ["t_s", *run.SPEEDS]) for t, v in ends)), scene)

    assert is_transient(switched)
    assert not is_transient(switched, last=0.9)
    assert not is_transient(quickstart_scene)
    assert is_transient(quickstart_scene, before=0.0 * speeds)
    assert not is_transient(quickstart_scene, before=0.98 * speeds)


def test_results_name_the_parameters_in_which_they_differ(moved):
    differs = [one["differs"] for one in shown(moved["two layers"], moved["bare"])["results"]]
    assert any("mass ratio 0" in one for one in differs), differs
    assert shown(moved["bare"])["results"][0]["differs"] == ""


def test_the_interval_of_a_run_can_be_chosen(moved):
    (data,) = shown(moved["two layers"], start=0.05, stop=0.1)["runs"]
    assert 0.05 <= data["origin"] < data["end"] <= 0.1
    assert data["coarse"] is not None
    with pytest.raises(TableError, match=r"no data between 3 and 4 s in .*; allowed: an interval within 0 … 0\.25 s"):
        shown(moved["bare"], start=3.0, stop=4.0)


def test_phases_are_wrapped_and_speeds_are_in_hz(moved):
    (data,) = shown(moved["bare"])["runs"]
    trajectory = read_table(moved["bare"], "trajectory")
    phase = opened(data["columns"]["phase"])
    assert (-0.5 * np.pi <= phase).all()
    assert (phase <= 1.5 * np.pi).all()
    np.testing.assert_allclose(np.cos(phase), np.cos(trajectory["phi1_rad"] + trajectory["phi2_rad"]), atol=1e-5)
    np.testing.assert_allclose(
        opened(data["columns"]["speed_2"]), -trajectory["phi2_rate_rad_per_s"] / (2.0 * np.pi), rtol=1e-5
    )


def test_panels_are_those_of_the_scene_in_units_of_its_size(moved):
    units = {panel["title"]: panel["unit"] for panel in shown(moved["two layers"])["panels"]}
    assert units["gap"] == units["platform y from rest"] == "mm"
    assert units["platform x"] == "mm"
    assert "impulse" in units
    assert not {"gap", "contact force", "impulse"} & {p["title"] for p in shown(moved["bare"])["panels"]}


def test_several_runs_share_the_room(moved, monkeypatch):
    monkeypatch.setattr(run, "ROWS", 400)
    data = shown(*(moved[name] for name in ("two layers", "bare", "bouncing")))
    assert [one["rows"] for one in data["runs"]] == [133] * 3
    labels = [one["label"] for one in data["results"]]
    assert len({*labels}) == 3  # all are called quickstart
    assert str(moved["bare"]) in labels[1]


def test_machines_move_side_by_side_until_the_first_run_ends(moved, tmp_path):
    copy = unproven(shutil.copytree(moved["bare"], tmp_path / "copy"))
    table = read_table(copy, "trajectory")
    write_table(table[table["t_s"] <= 0.1], copy, "trajectory", "parquet")
    short, long = shown(copy, moved["two layers"])["runs"]
    assert short["end"] == long["end"] == 0.1
    assert (short["coarse"], long["last"]) == (None, 0.25)
    assert long["coarse"] is not None


def test_a_failed_run_without_rows_tells_its_notes_and_has_no_curves(moved, tmp_path):
    copy = unproven(shutil.copytree(moved["bare"], tmp_path / "copy"))
    summary = json.loads((copy / "summary.json").read_text())
    summary |= {"outcome": "too-many-events", "detail": "more than 10", "notes": ["look twice"]}
    (copy / "summary.json").write_text(json.dumps(summary))
    write_table(read_table(copy, "trajectory").iloc[:0], copy, "trajectory", "csv")
    data = shown(copy)
    told = {remark["text"]: remark["failed"] for remark in data["remarks"]}
    assert told == {"too-many-events: more than 10": True, "look twice": False}
    assert (data["runs"], data["panels"]) == ([], [])
    assert data["summary"]["rows"]


# -- points ---------------------------------------------------------------------------------------------


def test_a_sweep_is_broken_where_it_jumps(swept):
    (sweep,) = shown(swept)["pictures"]
    first, *others = sweep["series"]
    assert first["rows"] == [0, 1, 2, 3, None, 4, 5, 6, 7]
    assert first["label"] == "mass ratio 0, supply frequency up"
    assert [row for row, state in enumerate(sweep["states"]) if state] == [2, 10, 18, 23, 26, 31]
    assert [sweep["states"][row] for row in (2, 31)] == [STATES.index(name) for name in ("open", "failed")]
    lines = [one for one in (first, *others) if one["mode"] == "lines"]
    assert [(one["colour"], one["dash"], one["of"]) for one in lines][:1] == [(CURVES[0], "solid", ["rms_y_m"])]
    assert {one["label"] for one in others if one["mode"] == "markers"} == {""}  # those that failed
    assert sweep["jumps"][0] == {"before": 3, "after": 4, "colour": CURVES[0], "of": ("rms_y_m",)}
    strips = sweep["strips"]
    assert [row["label"] for row in strips["rows"]] == ["0 ↑↓", "0.2 ↑↓"]
    spans = strips["rows"][0]["spans"]["supply_frequency_hz"]
    assert [(low, high, kind) for low, high, kind, *_ in spans if not _[0]] == [
        (41.5, 43.5, "antiphase"),
        (44.5, 45.5, "antiphase"),
        (45.5, 49.5, "in-phase"),
    ]


def test_orbits_are_solid_where_stable_and_dashed_elsewhere(followed):
    orbits, _ = shown(followed)["pictures"]
    stable, unstable = orbits["series"]
    assert [(one["label"], one["dash"]) for one in (stable, unstable)] == [("stable", "solid"), ("unstable", "dash")]
    good = column(orbits["table"], "stable")
    edges = np.flatnonzero(np.diff(good)).tolist()
    fold, end = orbits["marks"][0]["rows"][0], orbits["marks"][1]["rows"][0]
    assert unstable["rows"][:2] == [edges[0], edges[0] + 1] or fold in unstable["rows"]
    assert {*stable["rows"], *unstable["rows"]} == {*range(len(good)), fold, end, None}
    assert all(good[row] for row in stable["rows"] if row is not None and row < len(good))


def test_branches_of_each_combination_are_curves_of_their_own(branched):
    """Numbers of branches begin anew for each combination of the grid's values."""
    orbits, *_ = shown(branched)["pictures"]
    series, masses, numbers = (
        orbits["series"],
        *(column(orbits["table"], n) for n in ("material.mass_ratio", "branch")),
    )
    assert len({one["label"] for one in series}) == len({one["colour"] for one in series}) == 2
    for one in series:
        for rows in (list(part) for broken, part in groupby(one["rows"], lambda row: row is None) if not broken):
            assert len({(masses[row], numbers[row]) for row in rows if row < len(masses)}) == 1


def test_special_points_stand_where_they_were_found(followed):
    orbits, _ = shown(followed)["pictures"]
    count = orbits["table"]["rows"]
    assert [(mark["kind"], mark["rows"]) for mark in orbits["marks"]] == [("fold", [count]), ("grazing", [count + 1])]
    assert "merge" in orbits["marks"][0]["meaning"]
    for place, row in ((count, 11), (count + 1, 30)):
        for name in ("supply_frequency_hz", "rms_y_m"):
            assert orbits["values"][name][place] == pytest.approx(column(orbits["table"], name)[row])


def test_points_can_be_drawn_over_each_key(swept, followed):
    sweep, orbits, _ = shown(swept, followed)["pictures"]
    assert [axis["column"] for axis in sweep["axes"]] == [
        "excitation_frequency_hz",
        "supply_frequency_hz",
        "material.mass_ratio",
    ]
    assert [axis["column"] for axis in orbits["axes"]] == ["excitation_frequency_hz", "supply_frequency_hz"]
    assert orbits["special"]["rows"] == 2


def test_what_has_no_content_is_told_instead_of_drawn(followed):
    table = read_table(followed, "branches").assign(rms_y_m=np.linspace(8e-3, 9e-3, 31), rms_x_m=8e-6, rms_phi_rad=4e-4)
    panels, left = measures(table.assign(rms_phi_rad=np.linspace(3e-4, 4e-4, 31)))
    drawn = [panel.column for panel in panels]
    assert {"rms_y_m", "rms_phi_rad"} <= {*drawn}
    assert not {"rms_x_m", "motor_power_w"} & {*drawn}
    assert left == "not drawn: motor power 10.0 W, RMS x 0"
    least = {panel.column: panel.least for panel in panels}
    assert least["rms_phi_rad"] == pytest.approx(0.18e-3)
    (only,), _ = measures(table.assign(rms_y_m=9e-3), ["rms_y_m"])
    assert only.column == "rms_y_m"  # at least one


def test_boundaries_lie_in_the_plane_of_both_keys_and_an_empty_section_is_not_told(followed, tmp_path):
    data = shown(followed)
    told = {row["words"]: row["values"] for row in data["parameters"] if row["section"] == "orbits"}
    assert told["stop"] == [56.0]
    assert "step" not in told
    _, found = data["pictures"]
    assert [found["axes"][0]["column"], found["measures"][0]["column"]] == [
        "supply_frequency_hz",
        "material.mass_ratio",
    ]
    assert [(one["label"].partition(":")[0], one["rows"]) for one in found["series"]] == [
        ("fold", [*range(7)]),
        ("liftoff", [*range(7, 14)]),
    ]
    copy = unproven(shutil.copytree(followed, tmp_path / "copy"))
    table = read_table(copy, "boundaries")
    write_table(table.assign(n_unstable=(table["kind"] == "fold").astype("Int64")), copy, "boundaries", "parquet")
    _, found = shown(copy)["pictures"]
    assert ["unstable orbits" in one["label"] for one in found["series"]] == [True, False]


def test_the_data_sheet_of_a_run_is_in_groups(moved, tmp_path):
    copy = unproven(shutil.copytree(moved["bare"], tmp_path / "copy"))
    more = {"gamma": 5.0, "foundation_force_y_max_n": 7e3, "slip_1": 0.01, "whole_gamma": 9.0, "start_energy_j": 1.0}
    (copy / "summary.json").write_text(json.dumps(read_json(copy, "summary") | more))
    data = shown(copy)
    page = report.page(data)
    sheet = page[page.index("<h3>Data sheet</h3>") : page.index("All other numbers")]
    headed = [*dict.fromkeys(row["group"] for row in data["summary"]["rows"] if row["group"] not in ("first", ""))]
    assert {"load on the foundation", "motors", "start", "peaks of the whole run"} <= {*headed}
    assert all(f">{group}</th>" in sheet for group in headed)
    assert "7000" in sheet


def test_a_quantity_has_one_unit_on_the_whole_page(moved, followed):
    """In the file that is saved from a table, columns have the unit of their names."""
    data = shown(moved["two layers"], followed)
    orbits, _ = data["pictures"]
    tables = {column["name"]: column for column in orbits["table"]["columns"]}
    for measure in orbits["measures"]:
        column = tables[measure["column"]]
        assert (column["unit"], column["factor"]) == (measure["unit"], measure["factor"])
    units = {row["words"]: row["unit"] for row in data["summary"]["rows"]}
    panels = {panel["title"]: panel["unit"] for panel in data["panels"]}
    assert units["RMS y"] == tables["rms_y_m"]["unit"] == panels["platform y from rest"] == "mm"
    assert units["RMS φ"] == panels["rotation φ"] == "mrad"
    assert units["phase difference"] == tables["phase_difference_rad"]["unit"] == panels["phase difference"] == "rad"
    assert tables["rms_y_m"]["values"][0] == pytest.approx(1e-3)


def test_symbols_are_those_of_figures_and_flight_begins_at_its_liftoff(branched):
    (orbits,) = shown(branched)["pictures"]
    (liftoff,) = (mark for mark in orbits["marks"] if mark["kind"] == "liftoff")
    assert liftoff["symbol"] == SYMBOLS[MARKERS["liftoff"]] == "triangle-up"
    assert {orbits["values"]["flight_fraction"][place] for place in liftoff["rows"]} == {0.0}
    assert len({SYMBOLS[marker] for marker in MARKERS.values()}) == len(MARKERS)


# -- orbits of points -----------------------------------------------------------------------------------


def test_the_first_rows_of_a_spread_lie_evenly():
    assert (spread(1), spread(5)) == ([0], [0, 4, 2, 1, 3])
    order = spread(100)
    assert sorted(order) == [*range(100)]
    assert max(np.diff([*sorted(order[:25]), 100])) <= 8


@pytest.mark.long
def test_points_of_branches_have_their_orbits(branched):
    (orbits,) = shown(branched, mover=orbit_motion)["pictures"]
    table, motions = read_table(branched, "branches"), orbits["motions"]
    assert [*motions["rows"]] != []
    assert {*motions["rows"]} == {*range(len(table) + orbits["special"]["rows"])}
    assert len(motions["machines"]) == 2  # with material and without
    for row, place in ((row, place) for row, place in motions["rows"].items() if row in table.index):
        found = {name: unpacked(column) for name, column in motions["list"][place]["columns"].items()}
        y = found["y_m"]
        assert motions["list"][place]["end"] == pytest.approx(table["period_s"][row])
        assert y[-1] == pytest.approx(y[0], abs=1e-3 * np.ptp(y))
        assert np.sqrt(np.trapezoid((y - y.mean()) ** 2, found["t_s"]) / found["t_s"][-1]) == pytest.approx(
            table["rms_y_m"][row], rel=0.02
        )
        largest = table["gap_max_m"][row]
        assert ("gap_m" in found) == (table["material.mass_ratio"][row] > 0.0)
        if "gap_m" in found:
            assert found["gap_m"].max() == pytest.approx(largest, rel=0.03, abs=5e-8)
            assert bool(largest) == ("f" in motions["list"][place]["modes"])


def test_the_orbit_of_another_motion_is_refused(measured, tmp_path):
    copy = unproven(shutil.copytree(measured, tmp_path / "copy"))
    table = read_table(copy, "sweep")
    table.loc[0, "rms_y_m"] *= 1.1
    table.loc[1, ["motion", "period"]] = ["chaotic", 0]
    table.loc[2, "outcome"] = "solver-failure"
    write_table(table, copy, "sweep", "parquet")
    rows = shown(copy, mover=orbit_motion)["pictures"][0]["motions"]["rows"]
    assert "another motion settles" in rows[0]
    assert "does not repeat" in rows[1]
    assert "failed (solver-failure)" in rows[2]
    assert isinstance(rows[3], int)


@pytest.mark.long
def test_a_state_that_is_on_no_orbit_is_told(branched, tmp_path):
    copy = unproven(shutil.copytree(branched, tmp_path / "copy"))
    table = read_table(copy, "branches")
    table.loc[0, "y_m"] += 1e-3
    write_table(table, copy, "branches", "parquet")
    rows = shown(copy, mover=orbit_motion)["pictures"][0]["motions"]["rows"]
    assert "is not on an orbit of period 1" in rows[0]
    assert isinstance(rows[1], int)


def test_special_points_and_ends_come_first_where_there_is_little_room(branched, monkeypatch):
    monkeypatch.setattr(report, "MOST_SAMPLES", 600)
    told = []
    (orbits,) = shown(branched, mover=orbit_motion, progress=lambda *counts: told.append(counts))["pictures"]
    found, count = orbits["motions"], orbits["table"]["rows"]
    assert len(found["list"]) < orbits["table"]["rows"]
    assert {*range(count, count + orbits["special"]["rows"]), 0, count - 1} <= {*found["rows"]}
    assert [done for done, _ in told] == [*range(len(told))]


def test_a_long_table_loses_rows_evenly_and_says_so(swept, monkeypatch):
    monkeypatch.setattr(pictures, "MOST_ROWS", 10)
    table = shown(swept)["pictures"][0]["table"]
    assert (table["rows"], table["of"]) == (10, 32)
    assert {len(column["values"]) for column in table["columns"]} == {10}


# -- the page -------------------------------------------------------------------------------------------


def test_report_writes_one_file_and_names_it(command, moved, tmp_path):
    copy = shutil.copytree(moved["bare"], tmp_path / "bare")
    done = command("report", copy, "--stop", "0.1")
    assert (done.code, done.err, done.out.splitlines()) == (0, "", [str(copy / "report.html")])
    (one,) = held(copy / "report.html")["runs"]
    assert 0.09 < one["end"] <= 0.1
    assert (copy / "report.html").read_text().count('src="data:image/png;base64,iVBOR') == 3  # motion, exciters, loads


def test_a_page_needs_nothing_else_and_runs_its_own_scripts_only(moved, swept):
    text = report.page(shown(moved["two layers"], swept))
    head = text[: text.index("<style>")] + text[text.index("</style>") : text.index('<script id="data"')]
    assert not re.search(r"(src|href)=\"(?!data:)", head)
    assert "{{" not in head
    policy = re.search(r"script-src ([^;]+);", text).group(1)
    packed = re.search(r'<script id="library" type="text/plain">(.*?)</script>', text).group(1)
    library = zlib.decompress(base64.b64decode(packed)).decode()
    assert library.startswith("/**\n* plotly.js (cartesian - minified) v")
    scripts = [library, *re.findall(r"<script>(.*?)</script>", text, re.DOTALL)]
    digests = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    assert policy == " ".join(f"'sha256-{digest}'" for digest in digests)
    assert len(scripts) == 2


def test_text_from_files_stays_text(moved, tmp_path):
    copy = handmade.rename(unproven(shutil.copytree(moved["two layers"], tmp_path / "copy")), HOSTILE, HOSTILE)
    page = report.page(shown(copy))
    assert HOSTILE not in page
    assert page.count("</script>") == 3
    (tmp_path / "page.html").write_text(page)
    assert held(tmp_path / "page.html")["title"] == HOSTILE


def test_no_more_than_8_mb_for_ten_seconds(moved):
    """20 000 samples and 4 rows for each turn with an impact, in every column that a scene can have."""
    data = shown(moved["two layers"])
    (one,) = data["runs"]
    one["columns"] |= {name: packed(np.zeros(run.ROWS)) for name in [*one["columns"], "synchronous"]}
    one["modes"] = "a" * run.ROWS
    one["impacts"] = [[1.2345678901234567, 0.12345678901234567]] * run.IMPACTS
    row = {c["name"]: -0.00123456789 for c in data["tables"][0]["columns"]}
    data["tables"] = [pictures.table_data("events", 0, pd.DataFrame([row] * pictures.MOST_ROWS))]
    assert len(report.page(data).encode()) < 8_000_000


@pytest.mark.usefixtures("_undrawn")
def test_a_page_over_8_mb_is_told_with_what_makes_it_smaller(command, moved, swept, tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(report, "LARGE", 600_000)
    command("report", moved["bare"], swept, "--no-orbits", "--out", tmp_path / "both.html")
    size = (tmp_path / "both.html").stat().st_size / 1e6
    (told,) = caplog.messages
    assert f"both.html has {size:.1f} MB, over 1 MB; smaller with fewer results, or a shorter interval" in told
    assert "--no-orbits" not in told  # there are none


# -- what is refused ------------------------------------------------------------------------------------


def test_a_directory_without_results_is_refused(tmp_path, command):
    for directory in (tmp_path, tmp_path / "nowhere"):
        done = command("report", directory)
        assert (done.code, done.out) == (2, "")
        names = "run, sweep, orbits, find, basins or design"
        told = f"{directory} holds no finished {names}; allowed: a directory with one of them"
        assert done.err == f"vibroplat: {told}\n"


@pytest.mark.long
@pytest.mark.usefixtures("_undrawn")
def test_a_page_replaces_no_configuration_and_has_orbits_unless_told_otherwise(moved, branched, tmp_path, command):
    config = tmp_path / "machine.yaml"
    config.write_text("name: mine")
    done = command("report", branched, "--out", config)
    told = f"{config} is a file of another kind; allowed: a new file, or to overwrite it"
    assert (done.code, done.err, config.read_text()) == (2, f"vibroplat: {told}\n", "name: mine")
    sizes = []
    for options in (("--overwrite", "--no-orbits"), ()):  # then there is a page to replace
        done = command("report", branched, moved["bare"], *options, "--out", config)
        assert (done.code, done.err, done.out) == (0, "", f"{config}\n")
        assert config.read_text().startswith("<!DOCTYPE html>")
        sizes.append(len(held(config)["pictures"][0]["motions"]["list"]))
    assert sizes[0] == 0
    assert sizes[1] > 10


@pytest.mark.parametrize(("name", "column"), [("sweep", "sync"), ("branches", "stable")])
def test_a_table_without_a_column_is_refused(swept, followed, tmp_path, name, column):
    source = {"sweep": swept, "branches": followed}[name]
    copy = unproven(shutil.copytree(source, tmp_path / "copy"))
    write_table(read_table(copy, name).drop(columns=column), copy, name, "parquet")
    with pytest.raises(TableError, match=f"the {name} table in .* has no column {column}"):
        shown(copy)
