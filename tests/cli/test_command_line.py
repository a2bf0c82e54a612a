"""The command line as a user meets it: exit codes, lines on stderr, files."""

import hashlib
import json
import os
import platform
import re
import subprocess
import sys
from datetime import UTC, datetime
from importlib.metadata import version

import pytest
from common.commands import script
from common.places import QUICKSTART, ROOT

from vibroplat import __version__, load, load_config
from vibroplat.config.keys import configuration_schema, keys
from vibroplat.config.kinds import KINDS, OTHERS
from vibroplat.config.scene import Scene
from vibroplat.integrate import announce_compilation
from vibroplat.results.files import SCHEMA
from vibroplat.results.provenance import configuration_hash, provenance
from vibroplat.results.tables import read_json, read_table
from vibroplat.system.interrupts import KEPT, RESUMABLE

SHORT = ("--set", "run.duration_s=0.1")
STORM = ("contact={restitution: 1.0, restitution_threshold_m_per_s: 0.0}", "solver.max_events_per_period=3")
RUN_FILES = {"trajectory", "events", "summary", "provenance"}


def settings(*texts):
    return [part for text in texts for part in ("--set", text)]


def names(directory):
    return sorted(path.name for path in directory.iterdir())


# -- what answers at once -------------------------------------------------------------------------------


@pytest.mark.parametrize("arguments", [["sweep", "--help"], ["--version"]], ids=" ".join)
def test_what_answers_at_once_loads_nothing_heavy(arguments):
    """A test of times would depend on the machine; these modules are what takes time."""
    heavy = {"numpy", "numba", "pandas", "matplotlib", "scipy", "sksundae", "pydantic", "ruamel", "pyarrow"}
    heavy |= {"rich", "pygments", "markdown_it", "asyncio", "multiprocessing", "sqlite3", "importlib.metadata"}
    code = "import atexit, sys; atexit.register(lambda: print('loaded', *sys.modules))\n" + script()
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True)
    printed, _, loaded = done.stdout.rpartition("loaded ")
    assert "Usage: " in printed or __version__ in printed
    assert heavy & set(loaded.split()) == set()
    assert "vibroplat.cli" in loaded.split()


def test_version_and_schema_are_printed(command):
    assert command("--version") == (0, f"vibroplat {__version__}\n", "")
    done = command("schema")
    assert (done.code, done.err, json.loads(done.out)) == (0, "", configuration_schema())


def test_a_run_loads_nothing_that_it_does_not_use(command, tmp_path):
    """As CSV not even Parquet."""
    code = "import atexit, sys; atexit.register(lambda: print('loaded', *sys.modules))\n" + script()
    arguments = ["run", str(QUICKSTART), *settings("run.duration_s=0.1"), "--out", str(tmp_path), "--format", "csv"]
    assert command(*arguments).code == 0  # compiles what is not compiled yet; the compiler needs scipy
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.rpartition("loaded")[2].split())
    unused = {"scipy.linalg", "scipy.optimize", "numba.np.arraymath", "matplotlib", "dask"}
    assert (unused | {"pandas", "pyarrow"}) & loaded == set()
    assert "numba" in loaded


def test_help_names_the_commands_and_h_is_short_for_it(command):
    done = command("--help")
    assert (done.code, done.err) == (0, "")
    for name in (*KINDS, *OTHERS, "new", "plot", "report", "film", "export", "bench", "schema", "columns"):
        assert re.search(rf"^\W*{name}\s", done.out, re.MULTILINE)
    for before in ([], ["run"], ["new"]):
        assert command(*before, "-h") == command(*before, "--help")
        assert command(*before, "-h").out.startswith("Usage: vibroplat")
    for name in ("run", "sweep", "paper"):
        found = command(name, "--help").out
        assert ("--engine" in found, "--check" in found) == (True, True)
    summaries = [line.split("  ")[-1] for line in done.out.partition("\nBegin:")[2].splitlines() if line[:2] == "  "]
    assert len(summaries) == len(KINDS) + 11
    assert all(len(summary) <= 60 and summary.endswith(".") for summary in summaries)
    assert "..." not in "".join(summaries)


def test_options_and_their_values_are_completed(command):
    """As bash asks for them."""
    for words, offered in ((("sweep", "x.yaml", "--j"), "--jobs"), (("plot", "DIR", "--kind", "for"), "force")):
        asked = {"_VIBROPLAT_COMPLETE": "complete_bash", "COMP_WORDS": " ".join(("vibroplat", *words))}
        asked["COMP_CWORD"] = str(len(words))
        line = [sys.executable, "-c", script()]
        done = subprocess.run(line, capture_output=True, text=True, check=True, env=os.environ | asked)
        assert (done.stdout.split(), done.stderr) == ([offered], "")
    assert "--install-completion" in command("--help").out


# -- run: what it writes --------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "form"), [("quickstart", "parquet"), ("bare", "csv")])
def test_run_writes_tables_summary_and_provenance(name, form, written):
    directory = written / name / "run"
    tables = {f"trajectory.{form}", f"events.{form}", "summary.json", "provenance.json"}
    assert {file for file in names(directory) if not file.endswith(".png")} == tables | {"files.lock"}
    summary, trajectory = read_json(directory, "summary"), read_table(directory, "trajectory")
    assert (summary["name"], summary["outcome"], summary["simulated_s"]) == (name, "ok", 0.2)
    assert trajectory["t_s"].iloc[-1] == 0.2
    assert len(read_table(directory, "events")) == summary["events"]
    assert ("gap_m" in trajectory) == (name == "quickstart")


def test_run_prints_and_keeps_its_notes(command, kernels, here):
    """Those of the samples as well, which Python's summary does not have."""
    (here / "own.yaml").write_text("machine: {stiffness_y_n_per_m: 470.0}\n")
    done = command("run", "own.yaml", *SHORT, "-v")
    notes = read_json(here / "results/own/run", "summary")["notes"]
    own, *others = (line for line in done.out.splitlines() if line.startswith(("note: ", "warning: ")))
    assert (own.startswith("note: computed by engine native"), others) == (True, notes)
    assert [note.removeprefix("warning: ").partition(":")[0] for note in notes] == [
        *["machine.stiffness_y_n_per_m = 470"] * 2,
        "machine",
        "motor",
    ]
    coarse = ("output.sample_rate_hz=1", "run.duration_s=1.0", "name=coarse")
    done = command("run", QUICKSTART, *settings(*coarse), "-v")
    (note,) = read_json(here / "results/coarse/run", "summary")["notes"]
    assert note.startswith("hint: output.sample_rate_hz = 1: 0.039 samples per turn miss ")
    assert f"\n{note}\n" in done.out


def test_run_that_ends_early_exits_1_and_keeps_what_it_has(command, tmp_path):
    done = command(
        "run",
        QUICKSTART,
        *settings(*STORM, "drive.supply_frequency_hz=46", "run.duration_s=1", "name=storm"),
        "--out",
        tmp_path,
    )
    assert done.code == 1
    assert len(done.err.splitlines()) == 1
    assert done.err.startswith("vibroplat: too-many-events: 3 restarts within ")
    assert "raise solver.max_events_per_period to follow them; mode flight, t = " in done.err
    directory = tmp_path / "storm/run"
    assert {name.partition(".")[0] for name in names(directory)} == RUN_FILES | {"files"}
    summary, trajectory = read_json(directory, "summary"), read_table(directory, "trajectory")
    assert summary["outcome"] == "too-many-events"
    assert "state [" not in done.err  # 14 numbers that nobody reads on a terminal
    assert done.err.endswith(f" s; {directory / 'summary.json'} contains the state at that time\n")
    assert ", state [" in summary["detail"]
    assert trajectory["t_s"].iloc[-1] == summary["simulated_s"] < 1.0
    assert len(read_table(directory, "events")) == summary["events"] >= 3
    assert done.out.startswith("storm: STOPPED at ")
    assert done.out.splitlines()[0].endswith(" s: too-many-events")
    assert load(directory).answer.lines["measured"] == "nothing: the run ended before 0.500 s"


# -- provenance -----------------------------------------------------------------------------------------


def test_provenance_says_where_a_result_came_from(written):
    scene = load_config(QUICKSTART, {"run.duration_s": 0.2})
    found, summary = (
        read_json(written / "quickstart/run", "provenance"),
        read_json(written / "quickstart/run", "summary"),
    )
    told = (
        "schema vibroplat git_commit source_files created configuration_sha256 engine sundials tolerance "
        "python platform libraries"
    )
    assert list(found) == [*told.split(), "configuration", "command", "result", "files"]
    assert (found["schema"], found["vibroplat"]) == (SCHEMA, __version__)
    assert found["git_commit"] is None or re.fullmatch(r"[0-9a-f]{40}\+?", found["git_commit"])
    age = datetime.now(UTC) - datetime.fromisoformat(found["created"])
    assert 0.0 <= age.total_seconds() < 3600.0
    assert found["configuration_sha256"] == configuration_hash(scene)
    assert (found["engine"], found["tolerance"]) == (summary["engine"], scene.solver.tolerance)
    assert re.fullmatch(r"7\.\d+\.\d+", found["sundials"])
    assert (found["python"], found["platform"]) == (platform.python_version(), platform.platform())
    assert {"numpy", "numba", "scikit-sundae", "pandas", "pyarrow"} <= set(found["libraries"])
    assert found["libraries"] == {name: version(name) for name in found["libraries"]}
    assert Scene.from_tree(found["configuration"]) == scene
    assert (found["command"], len(found["result"])) == ("run", 32)
    assert found["files"] == {
        name: hashlib.sha256((written / "quickstart/run" / name).read_bytes()).hexdigest()
        for name in ("trajectory.parquet", "events.parquet", "summary.json")
    }


def test_hash_is_that_of_what_is_simulated():
    scene = Scene()
    spelled_out = Scene.from_tree({"drive": {"supply_frequency_hz": 50}, "motor": {"pole_pairs": 2}, "contact": {}})
    assert re.fullmatch(r"[0-9a-f]{64}", configuration_hash(scene))
    assert configuration_hash(scene) == configuration_hash(spelled_out)
    assert configuration_hash(scene) != configuration_hash(scene.replace({"drive.supply_frequency_hz": 50.000001}))
    started = scene.replace({"run.initial.state.x_m": 0.1})  # what a result holds can be run again
    assert Scene.from_tree(provenance(started, "none")["configuration"]) == started


# -- bad input ------------------------------------------------------------------------------------------


def test_bad_input_exits_2_with_one_line(command, here):
    (here / "bad.yaml").write_text("contact: {restitution: 1.2}\n")
    (here / "good.yaml").write_text("run: {duration_s: 0.01}\n")
    for line, told in {
        "run nope.yaml": "nope.yaml: no such file",
        "run bad.yaml": "bad.yaml: contact.restitution = 1.2; allowed: at most 1.0",
        "run good.yaml --set drive": "--set 'drive'; allowed: key.sub=value",
        "run good.yaml --out bad.yaml": "output bad.yaml/good is not writable: Not a directory",
        "plot nope": "nope is not a directory; allowed: a result directory of vibroplat",
        "frobnicate": "No such command 'frobnicate'. Try 'vibroplat -h'.",
    }.items():
        assert command(*line.split()) == (2, "", f"vibroplat: {told}\n")
    assert names(here) == ["bad.yaml", "good.yaml"]


def test_bad_option_exits_2_with_one_line(command):
    """In typer's words, which change with its version."""
    for line, named in {
        "run nope.yaml --format xml": ("'--format'", "'xml'", "'parquet', 'csv'"),
        "run nope.yaml --bogus": ("--bogus",),
        "run": ("Missing argument",),
        "plot . --kind nope": ("'--kind'", "'nope'", "'motion', 'conveying', 'force'"),
        "plot . --start soon": ("'--start'", "valid"),
        "sweep nope.yaml --jobs 0": ("'--jobs'",),
    }.items():
        done = command(*line.split())
        assert (done.code, done.out, len(done.err.splitlines())) == (2, "", 1)
        assert [text for text in named if text not in done.err] == []
        assert done.err.endswith(f". Try 'vibroplat {line.split()[0]} -h'.\n")
        assert ".." not in done.err


@pytest.mark.parametrize(("name", "kept"), [("run", KEPT), ("sweep", KEPT), ("sweep --resume", RESUMABLE)])
def test_resume_is_promised_where_there_may_be_points(name, kept, command, monkeypatch):
    """A command that runs out of memory as soon as it begins."""

    def fail(*_):
        raise MemoryError

    announce_compilation.cache_clear()  # a process asks only once
    monkeypatch.setattr("vibroplat.config.loading.load_config", fail)
    monkeypatch.setattr("vibroplat.kernels.cache.is_compiled", fail)
    done = command(*name.split(), QUICKSTART)
    assert done == (1, "", f"vibroplat: not enough memory; {kept}\n")


# -- vibroplat new --------------------------------------------------------------------------------------


def test_new_writes_a_template_and_says_what_can_be_done_with_it(command, here):
    for source in (ROOT / "configs/templates").glob("*.yaml"):
        file = here / "of mine" / f"{source.stem}.yaml"
        file.parent.mkdir(exist_ok=True)
        done = command("new", f"of mine/{file.name}", "--template", source.stem)
        assert load_config(file) == load_config(source, {"name": source.stem})
        text = file.read_text()
        assert len(text.splitlines()) <= 60
        assert f"vibroplat sweep 'of mine/{file.name}'" in text  # it can be copied
        assert f"change it, then `vibroplat run 'of mine/{file.name}'`" in done.out
        assert ("vibroplat orbits" in text) == ("\norbits:" in text)


@pytest.mark.parametrize("template", sorted(file.stem for file in (ROOT / "configs/templates").glob("*.yaml")))
def test_new_writes_all_keys_on_request(command, here, template):
    assert command("new", "mine.yaml", "--template", template, "--full").code == 0
    assert load_config("mine.yaml") == load_config(ROOT / f"configs/templates/{template}.yaml", {"name": "mine"})
    text = (here / "mine.yaml").read_text()
    assert max(map(len, text.splitlines())) <= 120
    for name in keys():
        if name.startswith(("material.", "contact.", "solver.")):
            assert re.search(rf"^ *(- )?(# )?{name.rpartition('.')[2]}:", text, re.MULTILINE), name


def test_new_overwrites_nothing_and_refuses_names_that_cannot_be_used(command, here):
    (here / "mine.yaml").write_text("name: kept\n")
    name = "my machine.yaml: name = 'my machine'; allowed: letters, digits and . _ + -, starting with a letter or digit"
    name += ", as name: my-machine"
    lines = {"mine.yaml": "mine.yaml exists already; allowed: the name of a new file", "my machine.yaml": name}
    lines["nowhere/mine.yaml"] = "nowhere/mine.yaml: cannot be written (No such file or directory)"
    for file, line in lines.items():
        assert command("new", file) == (2, "", f"vibroplat: {line}\n")
    assert names(here) == ["mine.yaml"]
    assert (here / "mine.yaml").read_text() == "name: kept\n"
