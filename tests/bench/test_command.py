"""What ``vibroplat bench`` writes and says, on one short scene."""

import re

import pandas as pd
import pytest
from common.places import ROOT

from vibroplat.bench import measure
from vibroplat.cli.bench import DURATIONS


@pytest.fixture
def short(monkeypatch):
    """One short scene instead of all."""
    scene = measure.cases()["attached"].replace({"run.duration_s": 0.05})
    monkeypatch.setattr(measure, "cases", lambda: {"attached": scene})


@pytest.mark.usefixtures("short", "kernels")
def test_precision_is_a_table_and_a_figure(command, here, figures):
    done = command("bench", "precision", "--repeats", 1, "--out", "out")
    assert (done.code, done.err) == (0, "")
    assert "results" not in {path.name for path in here.iterdir()}
    table = pd.read_csv("out/benchmarks/precision.csv")
    assert list(table["tolerance"]) == pytest.approx([10.0**-n for n in range(4, 11)])
    assert set(table["engine"]) == {"native"}
    assert table["coordinates"].iloc[-1] < 1e-3 * table["coordinates"].iloc[0]
    assert (table["ms_per_s"] > 0.0).all()
    assert figures["precision"].axes[0].get_title(loc="left").endswith("\nattached")


@pytest.mark.usefixtures("short", "kernels", "figures")
def test_engines_are_compared_at_equal_error(command, here):
    assert command("bench", "--repeats", 1).code == 0
    table = pd.read_csv("results/benchmarks/summary-equal.csv").set_index(["engine", "error"])
    usual = table.xs(measure.LEVEL, level="error")
    assert list(usual.index) == ["taylor", "native"]
    assert usual.loc["taylor", "over_taylor"] == 1.0
    assert (usual["ms_per_s"] > 0.0).all()


def test_all_benchmarks_and_some_are_not_asked_for_at_once(command, here):
    done = command("bench", "engines", "--long")
    line = "engines --long: --long runs all benchmarks; allowed: names or --long"
    assert (done.code, done.out, done.err) == (2, "", f"vibroplat: {line}\n")


def test_durations_are_said_in_one_way(command):
    """In the help of the command, and where its results are discussed."""
    printed = " ".join(command("bench", "--help").out.split())
    page = (ROOT / "results/benchmarks/README.md").read_text(encoding="utf-8")
    for name, duration in DURATIONS.items():
        assert f"{name} ({duration})" in printed if name else f"in {duration}" in printed
        command_line = f"vibroplat bench {name}".strip()
        assert re.findall(rf"^\| `{command_line}` \|.*\| (.*) \|$", page, re.MULTILINE) == [duration]
