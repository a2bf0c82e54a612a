"""Thresholds, basins and designs on the page: their figures, what moves when a point is clicked, and odd answers."""

import json
import shutil

import numpy as np
import pytest
from common.results import unproven

from vibroplat.continuation.rows import orbit_motion
from vibroplat.errors import VibroplatError
from vibroplat.page import report
from vibroplat.page.report import write_report
from vibroplat.page.results import find_results
from vibroplat.results.picture import STATES, SYNC
from vibroplat.results.tables import read_json, read_table, write_table


def shown(*directories, **options):
    return report.page_data(find_results(list(directories)), **options)


def column(table, name):
    return next(one["values"] for one in table["columns"] if one["name"] == name)


def changed(source, place, name, **columns):
    """Copy a result with other columns of a table."""
    copy = unproven(shutil.copytree(source, place))
    write_table(read_table(copy, name).assign(**columns), copy, name, "parquet")
    return copy


def test_each_start_moves_as_its_attractor(answered):
    (study,) = shown(answered["basins"], mover=orbit_motion)["pictures"]
    names, attractors = column(study["table"], "attractor"), column(study["special"], "attractor")
    assert len(set(names)) == 2
    assert [attractors[row] for row in study["owner"]] == [*names, *attractors]
    orbits = study["motions"]["list"]
    assert [study["motions"]["rows"][row] for row in range(2)] == [0, 1]
    assert {round(1.0 / orbit["end"], 2) for orbit in orbits} == {
        round(f, 2) for f in column(study["special"], "excitation_frequency_hz")
    }
    assert sorted(row for series in study["series"] for row in series["rows"]) == list(range(40))
    assert [name for name, _, _ in study["measures"][0]["classes"]] == attractors


def test_over_a_key_shares_are_stacked_and_starts_are_of_one_value(answered):
    shares, starts = shown(answered["over"])["pictures"]
    assert [measure["kind"] for measure in shares["measures"]][:2] == ["stack", "points"]
    assert [axis["column"] for axis in shares["axes"]] == ["supply_frequency_hz"]
    at, own = column(starts["table"], "supply_frequency_hz"), column(shares["table"], "supply_frequency_hz")
    assert [own[row] for row in starts["owner"]] == at
    assert [{at[row] for row in starts["series"][n]["rows"]} for n in range(2)] == [{value} for value in sorted({*at})]
    assert [facet["series"] for facet in starts["facets"]] == [[0], [1]]
    assert starts["motions"] is shares["motions"], "orbits are computed once"
    fractions = np.array(column(shares["table"], "fraction"))
    assert [fractions[np.array(own) == value].sum() for value in sorted(set(at))] == pytest.approx([1.0, 1.0])


def test_thresholds_are_lines_and_move_as_what_is_below(answered):
    (study,) = shown(answered["thresholds"], mover=orbit_motion)["pictures"]
    (line,) = study["lines"]
    assert line["at"] == pytest.approx([0.202220, 0.410803], abs=1e-5)
    values, moved = column(study["table"], "material.mass_ratio"), study["motions"]["rows"]
    below = study["owner"][len(values) :]
    assert "does not repeat" in moved[below[0]], "chaotic below the period doubling"
    assert type(moved[below[1]]) is int
    assert values[below[1]] == pytest.approx(column(study["special"], "below")[1])


def test_designs_have_elasticities_samples_and_searches_with_a_front(answered):
    data = shown(answered["design"], answered["best"], mover=orbit_motion)
    titles = ["Elasticities", "Tolerances", "Elasticities", "Searches"]
    assert [study["title"] for study in data["pictures"]] == titles
    assert [len(set(column(one["table"], "key"))) for one in data["pictures"][::2]] == [1, 3]
    searches = data["pictures"][3]
    (mark,), power = searches["marks"], column(searches["table"], "motor_power_w")
    feasible = column(searches["table"], "feasible")
    least = min(value for value, is_so in zip(power, feasible, strict=True) if is_so)
    assert mark["rows"] == [len(power)]
    assert searches["values"]["motor_power_w"][len(power)] == pytest.approx(least, rel=1e-5)
    assert [type(searches["motions"]["rows"][row]) for row in searches["owner"]] == [int] * (len(power) + 3)
    assert "rms_x_m" not in [measure["column"] for measure in searches["measures"]]  # round-off
    front = next(one for one in searches["series"] if one["label"] == "Pareto front")
    assert front["rows"] == [len(power) + 1, len(power) + 2]


def told_otherwise(source, place, **told):
    """Copy a result with another answer in its provenance."""
    copy = unproven(shutil.copytree(source, place))
    proof = read_json(copy, "provenance")
    (copy / "provenance.json").write_text(json.dumps(proof | {"answer": proof["answer"] | told}))
    return copy


def test_notes_and_failures_of_an_answer_are_remarks(answered, tmp_path):
    copy = told_otherwise(answered["basins"], tmp_path / "copy", notes=["look <twice>"], failures=["lost"] * 7)
    data = shown(copy)
    assert [(one["text"], one["failed"]) for one in data["remarks"]] == [
        *[("lost", True)] * 5,
        ("2 more", True),
        ("look <twice>", False),
    ]
    assert "<b>Note: </b>look &lt;twice&gt;" in report.page(data)


def test_orbits_of_designs_have_the_period_of_their_table(answered, tmp_path):
    periods = set()

    def lost(scene, row):
        periods.add(row["period"])
        raise VibroplatError("lost")

    copy = changed(answered["best"], tmp_path / "copy", "evaluations", period=4)
    _, searches = shown(copy, mover=lost)["pictures"]
    assert periods == {4, 1}, "of searches, and of the front"
    assert searches["motions"]["asked"]
    assert not shown(copy)["pictures"][0]["motions"]["asked"]


def test_a_synchronization_has_the_colour_that_maps_have(answered):
    (study,) = shown(answered["basins"])["pictures"]
    shares, starts = shown(answered["over"])["pictures"]
    wanted = {"antiphase, period 1": SYNC["antiphase"], "in-phase, period 1": SYNC["in-phase"]}
    assert {one["label"]: one["colour"] for one in shares["series"]} == wanted
    for one in (study, starts):
        assert {name: colour for name, colour, _ in one["measures"][0]["classes"]} == wanted


def test_what_was_printed_is_told_and_escaped(answered, tmp_path):
    data = shown(answered["thresholds"])
    page = report.page(data)
    assert "material.mass_ratio = 0.2022" in page[page.index('id="answers"') : page.index("<noscript")]
    data["answers"][0]["told"]["text"] = ["<b>bold"]
    assert "&lt;b&gt;bold" in report.page(data)


def test_motions_that_settle_nowhere_and_values_that_are_missing(answered, tmp_path):
    nothing = {"motion": "undecided", "period": np.nan, "rms_y_m": np.nan}
    basins = changed(answered["basins"], tmp_path / "basins", "attractors", **nothing)
    failed = {"outcome": "too-many-events", "sync": None, "motion": None, "rms_y_m": np.nan, "rms_x_m": np.nan}
    values = changed(answered["thresholds"], tmp_path / "find", "scan", **failed)
    none = read_table(values, "thresholds").iloc[:0]
    write_table(none, values, "thresholds", "parquet")
    study, other = shown(basins, values, mover=orbit_motion)["pictures"]
    assert all("does not repeat" in text for text in study["motions"]["rows"].values())
    assert (other["lines"][0]["at"], other["motions"]["list"], other["special"]["rows"]) == ([], [], 0)
    assert {*other["states"]} == {STATES.index("failed")}


def test_a_search_that_finds_nothing_has_no_best_design(answered, tmp_path):
    def lost(scene, row):
        raise VibroplatError("lost")

    copy = changed(answered["best"], tmp_path / "copy", "evaluations", feasible=False, best=False)
    _, searches = shown(copy, mover=lost)["pictures"]
    assert (searches["marks"], searches["special"]["rows"], searches["motions"]["list"]) == ([], 2, [])


def test_a_directory_holds_a_sweep_and_basins(answered, measured, tmp_path, command):
    both = shutil.copytree(measured, tmp_path / "both")
    for path in answered["basins"].iterdir():
        name = "basins-provenance.json" if path.name == "provenance.json" else path.name
        shutil.copy(path, both / name)
    assert [study["title"] for study in shown(both)["pictures"]] == ["Sweep", "Basins"]
    done = command("plot", both)
    assert (done.code, done.err) == (0, "")
    assert {name.rpartition("/")[2] for name in done.out.split()} >= {"response.png", "basins.png"}
    assert write_report([both]).stat().st_size > 5e5
