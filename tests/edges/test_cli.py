"""The command line as a user meets it: exit codes, lines on stderr, files."""

from __future__ import annotations

import json
import platform
import re
import shutil
import signal
import subprocess
import sys
from contextlib import contextmanager
from datetime import UTC, datetime
from importlib.metadata import version

import pytest

from vibroplat import __version__, load_config
from vibroplat.cli import main
from vibroplat.config import configuration_schema
from vibroplat.errors import TableError
from vibroplat.flow.warm import is_compiled
from vibroplat.plots.run import plot_run
from vibroplat.provenance import configuration_hash, provenance
from vibroplat.scene import Scene
from vibroplat.tables import read_json, read_table, write_table

from .helpers import QUICKSTART

SHORT = ("--set", "run.duration_s=0.1")
STORM = (
    "run.duration_s=1.0",
    "contact.restitution=1.0",
    "contact.sticking_speed_m_per_s=0.0",
    "drive.supply_frequency_hz=46.0",
    "solver.max_events_per_period=3",
)
RUN_FILES = {"trajectory", "events", "summary", "provenance"}


def settings(*texts):
    return [part for text in texts for part in ("--set", text)]


def names(directory):
    return sorted(path.name for path in directory.iterdir())


# -- what answers at once -------------------------------------------------------------------------------


def test_command_line_loads_nothing_heavy():
    heavy = ("numpy", "numba", "pandas", "matplotlib", "scipy", "sksundae", "pydantic", "ruamel", "pyarrow")
    code = f"import sys, vibroplat.cli; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_help_names_the_commands(vibroplat):
    done = vibroplat("--help")
    assert (done.returncode, done.stderr) == (0, "")
    for command in ("run", "plot", "schema"):
        assert re.search(rf"^\W*{command}\s", done.stdout, re.MULTILINE)


def test_version(vibroplat):
    done = vibroplat("--version")
    assert (done.returncode, done.stdout, done.stderr) == (0, f"vibroplat {__version__}\n", "")


def test_schema_is_json(vibroplat):
    done = vibroplat("schema")
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout) == configuration_schema()


# -- run: what it writes --------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "form"), [("quickstart", "parquet"), ("bare", "csv")])
def test_run_writes_tables_summary_and_provenance(name, form, written):
    directory = written / name
    tables = {f"trajectory.{form}", f"events.{form}", "summary.json", "provenance.json"}
    assert {file for file in names(directory) if not file.endswith(".png")} == tables
    summary, trajectory = read_json(directory, "summary"), read_table(directory, "trajectory")
    assert (summary["name"], summary["outcome"], summary["simulated_s"]) == (name, "ok", 0.2)
    assert trajectory["t_s"].iloc[-1] == 0.2
    assert len(read_table(directory, "events")) == summary["events"]
    assert ("gap_m" in trajectory) == (name == "quickstart")


@pytest.mark.parametrize("name", ["quickstart", "bare"])
def test_run_prints_a_summary_and_where_the_tables_are(name, finished_commands):
    printed = finished_commands[0][name].stdout
    lines = {line[:28].rstrip(): line[28:] for line in printed.splitlines()}
    assert (lines["outcome"], lines["simulated"], lines["tables"]) == ("ok", "0.2 s", f"results/{name}")
    assert re.fullmatch(r"\S+, \S+ m", lines["RMS x, y"])
    assert ("flight fraction" in lines) == ("contact force, largest" in lines) == (name == "quickstart")


def test_run_that_ends_early_exits_1_and_keeps_what_it_has(vibroplat, tmp_path):
    done = vibroplat("run", QUICKSTART, *settings(*STORM, "name=storm"), "--out", tmp_path)
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith("vibroplat: event-storm: 3 restarts within ")
    assert "raise solver.max_events_per_period to follow them; mode flight, t = " in done.stderr
    directory = tmp_path / "storm"
    assert {name.partition(".")[0] for name in names(directory)} == RUN_FILES
    summary, trajectory = read_json(directory, "summary"), read_table(directory, "trajectory")
    assert summary["outcome"] == "event-storm"
    assert trajectory["t_s"].iloc[-1] == summary["simulated_s"] < 1.0
    assert len(read_table(directory, "events")) == summary["events"] >= 3
    assert done.stdout.startswith("outcome                     event-storm\n")


def test_run_without_a_first_step_exits_1_and_writes_empty_tables(vibroplat, tmp_path):
    done = vibroplat("run", QUICKSTART, *settings("run.initial.state={phi_rad: 1.0e20}"), *SHORT, "--out", tmp_path)
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith("vibroplat: beyond-model: the platform has turned by 1e+20 rad; ")
    directory = tmp_path / "quickstart"
    assert read_table(directory, "trajectory").empty
    assert read_json(directory, "summary")["simulated_s"] == 0.0
    assert refusal(directory) == "DIR holds an empty trajectory; there is nothing to draw"


def test_interrupted_run_says_so_and_leaves_no_half_tables(monkeypatch, capsys, here):
    @contextmanager
    def pressing_ctrl_c(_name, _seconds):
        yield lambda _reached, _events: signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr("vibroplat.cli.run_progress", pressing_ctrl_c)
    monkeypatch.setattr(sys, "argv", ["vibroplat", "run", str(QUICKSTART)])
    with pytest.raises(SystemExit) as ended:
        main()
    told = capsys.readouterr()
    assert (ended.value.code, told.out) == (130, "")
    assert told.err.startswith("vibroplat: interrupted; tables under their final names are whole")
    assert names(here / "results/quickstart") == []


def test_the_first_run_says_why_it_takes_long(here, monkeypatch, capsys, kernels):
    monkeypatch.setattr("vibroplat.flow.warm.is_compiled", lambda: False)
    monkeypatch.setattr("sys.argv", ["vibroplat", "run", str(QUICKSTART), "--set", "run.duration_s=0.01"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 0
    assert capsys.readouterr().err == "vibroplat: compiling the numerical kernels, once, in about half a minute\n"


def test_compiled_kernels_are_found_on_disk(kernels):
    assert is_compiled()


# -- provenance -----------------------------------------------------------------------------------------


def test_provenance_says_where_a_result_came_from(written):
    scene = load_config(QUICKSTART, {"run.duration_s": 0.2})
    found, summary = read_json(written / "quickstart", "provenance"), read_json(written / "quickstart", "summary")
    assert list(found) == [
        "schema",
        "vibroplat",
        "git_commit",
        "created",
        "configuration_sha256",
        "engine",
        "sundials",
        "integrators",
        "tolerance",
        "python",
        "platform",
        "libraries",
        "configuration",
    ]
    assert (found["schema"], found["vibroplat"]) == (1, __version__)
    assert found["git_commit"] is None or re.fullmatch(r"[0-9a-f]{40}\+?", found["git_commit"])
    age = datetime.now(UTC) - datetime.fromisoformat(found["created"])
    assert 0.0 <= age.total_seconds() < 3600.0
    assert found["configuration_sha256"] == configuration_hash(scene)
    assert (found["engine"], found["tolerance"]) == (summary["engine"], scene.solver.tolerance)
    assert re.fullmatch(r"7\.\d+\.\d+", found["sundials"])
    assert found["integrators"] == {"attached": "ida", "flight": "ida"}
    assert (found["python"], found["platform"]) == (platform.python_version(), platform.platform())
    assert {"numpy", "numba", "scikit-sundae", "pandas", "pyarrow"} <= set(found["libraries"])
    assert found["libraries"] == {name: version(name) for name in found["libraries"]}
    assert Scene.from_tree(found["configuration"]) == scene


def test_commit_is_none_outside_of_a_checkout(monkeypatch, tmp_path):
    monkeypatch.setattr("vibroplat.provenance.__file__", str(tmp_path / "provenance.py"))
    assert provenance(Scene(), "none")["git_commit"] is None
    monkeypatch.setenv("PATH", "")
    assert provenance(Scene(), "none")["git_commit"] is None


def test_hash_is_that_of_what_is_simulated():
    scene = Scene()
    spelled_out = Scene.from_tree({"drive": {"supply_frequency_hz": 50}, "contact": {}, "solver": {"tolerance": 1e-6}})
    assert re.fullmatch(r"[0-9a-f]{64}", configuration_hash(scene))
    assert configuration_hash(scene) == configuration_hash(spelled_out)
    assert configuration_hash(scene) != configuration_hash(scene.replace({"drive.supply_frequency_hz": 50.000001}))


def test_hash_does_not_tell_a_default_from_the_same_given():
    assert configuration_hash(Scene()) == configuration_hash(Scene.from_tree({"motor": {"pole_pairs": 2}}))


def test_configuration_of_a_result_with_a_state_can_be_run_again():
    scene = Scene().replace({"run.initial.state.x_m": 0.1})
    assert Scene.from_tree(provenance(scene, "none")["configuration"]) == scene


# -- bad input ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["run", "nope.yaml"], "nope.yaml: no such file"),
        (["run", "bad.yaml"], "bad.yaml: contact.restitution = 1.2; allowed: at most 1.0"),
        (["run", "good.yaml", "--set", "drive"], "--set 'drive'; allowed: key.sub=value"),
        (["run", "good.yaml", "--out", "bad.yaml"], "output bad.yaml/good is not writable: Not a directory"),
        (["plot", "nope"], "nope is no directory; allowed: one that vibroplat has written"),
        (["run"], "Missing argument 'config'. Try 'vibroplat --help'."),
        (["frobnicate"], "No such command 'frobnicate'. Try 'vibroplat --help'."),
    ],
    ids=["missing file", "value", "setting", "out", "directory", "argument", "command"],
)
def test_bad_input_exits_2_with_one_line(arguments, line, vibroplat, here):
    (here / "bad.yaml").write_text("contact: {restitution: 1.2}\n")
    (here / "good.yaml").write_text("run: {duration_s: 0.01}\n")
    done = vibroplat(*arguments)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", f"vibroplat: {line}\n")
    assert names(here) == ["bad.yaml", "good.yaml"]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["run", "nope.yaml", "--format", "xml"], ("'--format'", "'xml'", "'parquet', 'csv'")),
        (["run", "nope.yaml", "--bogus"], ("--bogus",)),
        (["plot", ".", "--kind", "nope"], ("'--kind'", "'nope'", "'motion', 'force', 'exciters'")),
        (["plot", ".", "--start", "soon"], ("'--start'", "number")),
    ],
    ids=["format", "option", "kind", "time"],
)
def test_bad_option_exits_2_with_one_line(arguments, named, vibroplat):
    """In typer's words, which change with its version."""
    done = vibroplat(*arguments)
    assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (2, "", 1)
    assert [text for text in named if text not in done.stderr] == []


# -- plot -----------------------------------------------------------------------------------------------


def is_png(path):
    return path.read_bytes().startswith(b"\x89PNG\r\n\x1a\n")


def test_plot_draws_all_figures_and_names_the_files(vibroplat, result):
    done = vibroplat("plot", result)
    assert (done.returncode, done.stderr) == (0, "")
    paths = [result / f"{figure}.png" for figure in ("motion", "force", "exciters")]
    assert done.stdout.splitlines() == list(map(str, paths))
    assert all(map(is_png, paths))


def test_plot_leaves_out_the_force_of_a_scene_without_contact(written):
    paths = plot_run(written / "bare", ["motion", "force", "exciters"])
    assert [path.name for path in paths] == ["motion.png", "exciters.png"]
    assert all(map(is_png, paths))


def test_plot_of_one_kind_in_an_interval(vibroplat, result):
    done = vibroplat("plot", result, "--kind", "force", "--start", "0.1", "--stop", "0.15")
    assert (done.returncode, done.stderr) == (0, "")
    assert [path.name for path in result.glob("*.png")] == ["force.png"]


@pytest.fixture
def result(written, tmp_path):
    """A copy of a result that may be damaged."""
    return shutil.copytree(written / "quickstart", tmp_path / "result", ignore=shutil.ignore_patterns("*.png"))


def refusal(directory, **interval):
    """What the user is told instead of figures."""
    with pytest.raises(TableError) as caught:
        plot_run(directory, ["motion", "force"], **interval)
    assert list(directory.glob("*.png")) == []
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value).replace(str(directory), "DIR")


@pytest.mark.parametrize("found", [0, 2, None, "1"])
def test_plot_refuses_another_schema(found, result):
    (result / "provenance.json").write_text(json.dumps({"schema": found}))
    assert refusal(result) == f"DIR holds results of schema {found}; this version reads schema 1"


@pytest.mark.parametrize(
    ("interval", "between"),
    [
        ({"start": 5.0}, "5.0 and 0.2"),
        ({"start": 0.1, "stop": 0.05}, "0.1 and 0.05"),
        ({"start": float("nan")}, "nan and 0.2"),
        ({"start": 0.1, "stop": 0.1}, "0.1 and 0.1"),
    ],
)
def test_plot_of_an_empty_interval_is_refused(interval, between, result):
    assert refusal(result, **interval) == f"nothing between {between} s; allowed: an interval within 0.0 … 0.2 s"


@pytest.mark.parametrize(
    ("missing", "line"),
    [
        ("provenance.json", "DIR holds no provenance.json"),
        ("summary.json", "DIR holds no summary.json"),
        ("trajectory.parquet", "DIR holds no trajectory table; allowed: a directory that vibroplat has written"),
        ("events.parquet", "DIR holds no events table; allowed: a directory that vibroplat has written"),
    ],
)
def test_plot_names_the_file_it_misses(missing, line, result):
    (result / missing).unlink()
    assert refusal(result) == line


@pytest.mark.parametrize(
    ("file", "content", "line"),
    [
        ("provenance.json", "[]", "DIR holds results of schema None; this version reads schema 1"),
        ("provenance.json", "{", "DIR/provenance.json cannot be read: "),
        ("summary.json", "{}", "DIR/summary.json is no summary of a run"),
        ("summary.json", "[]", "DIR/summary.json is no summary of a run"),
        ("trajectory.csv", "a,b\n1,2\n", "the trajectory table in DIR has no numbers in column t_s"),
        ("trajectory.csv", "t_s,y_m\nx,y\nz,w\n", "the trajectory table in DIR has no numbers in column t_s"),
        ("events.csv", "a,b\n1,2\n", "the events table in DIR has no numbers in column t_s"),
        ("events.csv", "", "DIR/events.csv cannot be read: "),
    ],
)
def test_plot_of_damaged_files_is_told_in_a_line(file, content, line, result):
    if file.endswith("csv"):
        (result / file).with_suffix(".parquet").unlink()
    (result / file).write_text(content)
    assert refusal(result).startswith(line)


@pytest.mark.parametrize(
    ("table", "column"),
    [
        *(("trajectory", column) for column in ("t_s", "mode", "y_m", "phi2_rad", "phi1_rate_rad_per_s")),
        ("events", "kind"),
    ],
)
def test_plot_names_the_column_it_misses(table, column, result):
    write_table(read_table(result, table).drop(columns=column), result, table, "parquet")
    with pytest.raises(TableError, match=column):
        plot_run(result, ["motion", "force", "exciters"])


def test_plot_where_a_figure_cannot_be_written_is_told_in_a_line(result):
    (result / "motion.png").mkdir()
    with pytest.raises(TableError) as caught:
        plot_run(result, ["motion"])
    assert str(caught.value) == f"{result}/motion.png cannot be written: Is a directory"
