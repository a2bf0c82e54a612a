"""What people expect of any command line: -h, completion, a file to start from, messages that name file and key."""

from __future__ import annotations

import csv
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from common.commands import script
from common.places import QUICKSTART

from vibroplat import load_config
from vibroplat.config.keys import keys
from vibroplat.system.interrupts import KEPT, RESUMABLE

RESULTS = Path(__file__).parents[2] / "results"
SHORT = ("--set", "run.duration_s=0.05")


@pytest.mark.parametrize("before", [[], ["run"], ["sweep"], ["new"]], ids=["vibroplat", "run", "sweep", "new"])
def test_h_is_short_for_help(before, command):
    assert command(*before, "-h") == command(*before, "--help")
    assert command(*before, "-h").out.startswith("Usage: vibroplat")


# -- completion -----------------------------------------------------------------------------------------


def completed(*words):
    """What bash would offer after these words."""
    asked = {"_VIBROPLAT_COMPLETE": "complete_bash", "COMP_WORDS": " ".join(("vibroplat", *words))}
    asked["COMP_CWORD"] = str(len(words))
    line = [sys.executable, "-c", script()]
    done = subprocess.run(line, capture_output=True, text=True, check=True, env=os.environ | asked)
    assert done.stderr == ""
    return done.stdout.split()


def test_commands_options_and_their_values_are_completed():
    assert completed("sw") == ["sweep"]
    assert "--jobs" in completed("sweep", "x.yaml", "--j")
    assert completed("plot", "DIR", "--kind", "f") == ["force"]


def test_completion_is_installed_by_typer(command):
    assert "--install-completion" in command("--help").out


# -- vibroplat new --------------------------------------------------------------------------------------


def test_new_writes_the_quickstart_with_all_its_keys(command, here):
    done = command("new", "mine.yaml")
    assert (done.code, done.err) == (0, "")
    commands = "`vibroplat run mine.yaml`, `vibroplat sweep mine.yaml` or `vibroplat orbits mine.yaml`"
    assert done.out == f"mine.yaml: change it, then run {commands}\n"
    written = load_config("mine.yaml")
    assert written.orbits.key == "drive.supply_frequency_hz"
    assert written.replace({"orbits": None}) == load_config(QUICKSTART, {"name": "mine"})
    text = (here / "mine.yaml").read_text()
    for name, key in keys().items():
        if name.startswith(("machine.", "motor.", "material.", "contact.", "solver.")):
            last = name.rpartition(".")[2]
            assert re.search(rf"^ *(# )?{last}:", text, re.MULTILINE)
            assert key.meaning.split()[-1] in text
    assert max(map(len, text.splitlines())) <= 120


def test_new_runs(command, kernels, here):
    assert command("new", "mine.yaml").code == 0
    assert command("run", "mine.yaml", *SHORT).code == 0


def test_new_overwrites_nothing(command, here):
    (here / "mine.yaml").write_text("name: kept\n")
    line = "vibroplat: mine.yaml: there is such a file already; allowed: a new one\n"
    assert command("new", "mine.yaml") == (2, "", line)
    assert (here / "mine.yaml").read_text() == "name: kept\n"


@pytest.mark.parametrize(
    ("file", "line"),
    [
        (
            "my machine.yaml",
            "my machine.yaml: name = 'my machine'; allowed: letters, digits and . _ + -, starting with ",
        ),
        ("nowhere/mine.yaml", "nowhere/mine.yaml: cannot be written (No such file or directory)"),
    ],
)
def test_new_refuses_a_file_that_cannot_be_used(file, line, command, here):
    done = command("new", file)
    assert (done.code, done.out) == (2, "")
    assert done.err.startswith(f"vibroplat: {line}")
    assert list(here.iterdir()) == []


# -- messages -------------------------------------------------------------------------------------------


def test_missing_base_is_named_with_the_file_that_extends_it(command, here):
    (here / "c.yaml").write_text("extends: b.yaml\n")
    (here / "b.yaml").write_text("extends: a.yaml\n")
    assert command("run", "c.yaml") == (2, "", "vibroplat: b.yaml: extends = 'a.yaml': no such file\n")


def test_usage_errors_are_sentences(command):
    done = command("plot", ".", "--start", "soon")
    assert done.err.endswith(". Try 'vibroplat --help'.\n")
    assert ".." not in done.err


@pytest.mark.parametrize(("name", "kept"), [("run", KEPT), ("sweep", RESUMABLE), ("bench", KEPT)])
def test_resume_is_promised_where_there_is_one(name, kept, command, monkeypatch):
    """A command that runs out of memory as soon as it begins."""

    def fail(*_):
        raise MemoryError

    monkeypatch.setattr("vibroplat.config.reader.load_config", fail)
    monkeypatch.setattr("vibroplat.kernels.cache.is_compiled", fail)
    arguments = [] if name == "bench" else [QUICKSTART]
    assert command(name, *arguments) == (1, "", f"vibroplat: not enough memory; {kept}\n")
    assert ("--resume" in command(name, "--help").out) == (kept == RESUMABLE)


# -- results --------------------------------------------------------------------------------------------


def test_run_and_sweep_of_one_name_keep_each_others_files(command, kernels, here):
    (here / "c.yaml").write_text("sweep: {supply_frequency_hz: {start: 45, stop: 45}, settle_s: 0.1, measure_s: 0.1}\n")
    assert command("run", "c.yaml", *SHORT).code == 0
    before = {path.name: path.read_bytes() for path in (here / "results/c").iterdir() if path.suffix != ".lock"}
    assert command("sweep", "c.yaml").code == 0
    assert {name: (here / "results/c" / name).read_bytes() for name in before} == before
    assert (here / "results/c/sweep-provenance.json").exists()
    assert command("plot", "results/c", "--kind", "motion").code == 0
    assert command("plot", "results/c", "--kind", "response").code == 0


def test_tables_of_the_paper_hold_no_wall_times():
    tables = sorted((RESULTS / "paper").rglob("*.csv"))
    assert len(tables) > 30
    for path in tables:
        with path.open(newline="", encoding="utf-8") as file:
            assert [name for name in next(csv.reader(file)) if "wall" in name] == [], path
