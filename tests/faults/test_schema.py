"""Results of another schema, or of whose making nothing is known, are refused by figures and by ``--resume``."""

import json
import shutil
import sqlite3

import pytest
from common.commands import command, not_a_line
from common.places import LOADED
from common.results import bits, left

pytestmark = pytest.mark.usefixtures("kernels")

SWEEP = f"extends: {LOADED}\nname: c\nrun: {{duration_s: 0.1}}\n"
SWEEP += "sweep: {supply_frequency_hz: {start: 50.0, stop: 50.5}}\n"

#: Contents of provenance.json that no other version than this one can make sense of; without "schema" none is kept.
SCHEMAS = [*({"schema": value} for value in (0, 2, "1", None, True, 1.0, [1])), {}, [1], 1]
GARBAGE = [b"", bytes(1000), bytes(range(256)), b'{"schema": 1, "vibro', b"[" * 100_000]
GARBAGE += [b'{"schema": 1' + b"0" * 5000 + b"}", b'{"schema": "\\ud800"}']
DAMAGES = [json.dumps(value).encode() for value in SCHEMAS] + GARBAGE


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Directory with the results of both commands."""
    place = tmp_path_factory.mktemp("finished")
    (place / "c.yaml").write_text(SWEEP)
    for name in ("run", "sweep"):
        assert command(name, place / "c.yaml", "--out", place / name).code == 0
    return place


@pytest.fixture
def result(here, finished):
    """Copy the result of a command, to be damaged."""

    def copy(name):
        (here / "c.yaml").write_text(SWEEP)
        return shutil.copytree(finished / name / "c", here / "results/c")

    return copy


@pytest.mark.parametrize("name", ["run", "sweep"])
def test_plot_refuses_in_a_line(name, result):
    directory = result(name)
    told = {}
    for content in DAMAGES:
        (directory / "provenance.json").write_bytes(content)
        told[content[:20]] = not_a_line(command("plot", directory))
    (directory / "provenance.json").unlink()
    told["no provenance"] = not_a_line(command("plot", directory))
    assert told == dict.fromkeys(told, "")
    assert list(directory.glob("*.png")) == []


def test_plot_of_a_sweep_whose_configuration_is_lost_is_refused(result):
    directory = result("sweep")
    for kept in ({"schema": 1}, {"schema": 1, "configuration": {}}):
        (directory / "provenance.json").write_text(json.dumps(kept))
        assert not_a_line(command("plot", directory)) == ""


def test_resume_refuses_in_a_line_and_leaves_all_as_it_is(result):
    directory = result("sweep")
    before = bits(left(directory)[0]["sweep.parquet"])
    with sqlite3.connect(directory / "points-sweep.sqlite") as base:
        base.execute("DELETE FROM records WHERE second = 1")
    base.close()
    told = {}
    for content in DAMAGES:
        (directory / "provenance.json").write_bytes(content)
        told[content[:20]] = not_a_line(command("sweep", "c.yaml", "--resume"))
        assert (directory / "provenance.json").read_bytes() == content
    assert told == dict.fromkeys(told, "")
    (directory / "provenance.json").unlink()
    assert bits(left(directory)[0]["sweep.parquet"]) == before


def test_resume_goes_on_without_provenance(result):
    """It is written at the end of a sweep: one that was killed has none."""
    directory = result("sweep")
    (directory / "provenance.json").unlink()
    done = command("sweep", "c.yaml", "--resume")
    assert (done.code, done.err) == (0, "")
