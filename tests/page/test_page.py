"""``vibroplat report``: the file, its safety and its size, parameters, and what is refused."""

import base64
import hashlib
import re
import shutil

import pytest
from common import handmade
from common.pages import data_of, figures_of, page_of, read
from common.results import unproven

from vibroplat.config.kinds import KINDS
from vibroplat.continuation.rows import orbit_motion
from vibroplat.page.results import parameters

HOSTILE = "</script><script>window.hacked = 1</script><img src=x onerror='window.hacked = 1'>"
#: Sizes of pages (bytes): of a run, and of a sweep with the orbits of its points.
OF_A_RUN, OF_A_SWEEP = 300_000, 1_200_000


def test_parameters_have_meanings_and_are_marked_where_they_are_not_the_default_or_differ(quickstart_scene):
    tree = {"machine": {"platform_mass_kg": 1.0, "weight_kg": 2.0}, "motors": [{}, {"critical_slip": 0.1}]}
    meanings = {row["key"]: row["meaning"] for row in parameters(["run"], [tree])}
    wanted = ("machine.platform_mass_kg", "motors.2.critical_slip", "machine.weight_kg")
    assert [meanings[name][:5] for name in wanted] == ["m_0: ", "s_c: ", ""]
    tree = quickstart_scene.to_tree()
    other = quickstart_scene.replace({"machine.damping_y_n_s_per_m": 400.0})
    rows = {r["key"].partition(".")[2]: r for r in parameters(["run", "run"], [tree, other.to_tree()])}
    radius, damping, mass = (rows[name] for name in ("unbalance_radius_m", "damping_y_n_s_per_m", "platform_mass_kg"))
    assert (radius["default"], radius["values"], radius["changed"]) == (0.09, [0.03, 0.03], [True, True])
    assert (damping["values"], damping["changed"], damping["differs"]) == ([40.0, 400.0], [False, True], True)
    assert (mass["changed"], mass["differs"], mass["unit"]) == ([False, False], False, "kg")
    run, sweep = ({row["key"].partition(".")[0] for row in parameters([c], [tree])} for c in ("run", "sweep"))
    assert "run" in run - sweep
    assert "sweep" in sweep - run


def test_report_writes_one_file_and_names_it(command, saved, tmp_path):
    copy = shutil.copytree(saved["bare"], tmp_path / "bare")
    done = command("report", copy, "--stop", "0.1")
    assert (done.code, done.err, done.out.splitlines()) == (0, "", [str(copy / "report.html")])
    assert figures_of((copy / "report.html").read_text())["y from rest"].ends(0)[1] < 0.11


def test_a_page_needs_nothing_else_and_runs_its_own_script_only(saved, swept):
    text = page_of(saved["two layers"], swept)
    assert not re.search(r"(src|href)=\"(?!data:)", text)
    assert "{{" not in text
    policy = re.search(r"script-src ([^;]+);", text).group(1)
    (script,) = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    assert policy == f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"
    assert "innerHTML" not in script
    assert "eval(" not in script


def test_text_from_files_stays_text(saved, tmp_path):
    copy = handmade.rename(unproven(shutil.copytree(saved["two layers"], tmp_path / "copy")), HOSTILE, HOSTILE)
    for text in (page_of(copy), page_of(copy, saved["bare"])):
        assert HOSTILE not in text
        assert "<img" not in text
        assert text.count("</script>") == text.count("<script") == 2, "the frames, and the script"
        assert HOSTILE in read(text)


def test_a_run_has_less_than_300_kb_and_scripts_of_its_own_alone(saved):
    text = page_of(saved["two layers"])
    assert len(text.encode()) < OF_A_RUN
    assert "class Study" not in text


@pytest.mark.long
def test_pages_of_the_shipped_run_and_of_a_sweep_of_462_points_are_small(measured, tmp_path):
    from vibroplat import load_config, simulate, sweep

    keys = {"solver.engine": "taylor", "name": "whole"}
    run = simulate(load_config(handmade.QUICKSTART, keys)).save(tmp_path / "run")
    assert len(page_of(run).encode()) < OF_A_RUN
    points = sweep(load_config(handmade.QUICKSTART, keys | {"sweep.measure_s": 1.0})).save(tmp_path / "sweep")
    text = page_of(points, mover=orbit_motion)
    assert len(text.encode()) < OF_A_SWEEP
    data = data_of(text)
    assert sum(owner >= 0 for owner in data["owner"]) > 0.9 * len(data["owner"])


def test_all_that_is_said_can_be_read_without_scripts(saved, swept):
    text = page_of(saved["two layers"], swept)
    told = read(text)
    for words in (
        "Amplitude and stroke",
        "Force into the foundation",
        "Synchronization",
        "Balances",
        "liftoff",
        "How it was made",
    ):
        assert words in told
    assert len(figures_of(text)) >= 12
    assert text.count('<svg class="machine"') == 1


# -- what is refused ------------------------------------------------------------------------------------


def test_a_directory_without_results_is_refused(tmp_path, command):
    for directory in (tmp_path, tmp_path / "nowhere"):
        done = command("report", directory)
        assert (done.code, done.out) == (2, "")
        *others, last = KINDS
        names = f"run, {', '.join(others)} or {last}"
        told = f"{directory} holds no finished {names}; allowed: a directory with one of them"
        assert done.err == f"vibroplat: {told}\n"


@pytest.mark.long
def test_a_page_replaces_no_configuration_and_has_orbits_unless_told_otherwise(saved, branched, tmp_path, command):
    config = tmp_path / "machine.yaml"
    config.write_text("name: mine")
    done = command("report", branched, "--out", config)
    told = f"{config} is a file of another kind; allowed: a new file, or to overwrite it"
    assert (done.code, done.err, config.read_text()) == (2, f"vibroplat: {told}\n", "name: mine")
    sizes = []
    for options in (("--overwrite", "--no-orbits"), ()):  # then there is a page to replace
        done = command("report", branched, saved["bare"], *options, "--out", config)
        assert (done.code, done.err, done.out) == (0, "", f"{config}\n")
        assert config.read_text().startswith("<!DOCTYPE html>")
        sizes.append(len(data_of(config.read_text())["list"]))
    assert sizes[0] == 0
    assert sizes[1] > 10
