"""Results of another schema, or of whose making nothing is known, are refused by figures and by ``--resume``."""

import json
import sqlite3
from contextlib import closing

import pytest
from common.commands import LONGEST, command, not_a_line
from common.places import LOADED
from common.results import bits, left

from vibroplat.errors import TableError
from vibroplat.results.files import SCHEMA, SavedFiles

SWEEP = f"extends: {LOADED}\nname: c\nrun: {{duration_s: 0.1}}\n"
SWEEP += "sweep: {supply_frequency_hz: {start: 50.0, stop: 50.5}}\n"

#: Contents of provenance.json that no other version than this one can make sense of; without "schema" none is kept.
SCHEMAS = [
    *({"schema": value} for value in (0, SCHEMA - 1, SCHEMA + 1, "1", None, True, float(SCHEMA), [1])),
    {},
    [1],
    1,
]
GARBAGE = [b"", bytes(1000), bytes(range(256)), b'{"schema": 4, "vibro', b"[" * 100_000]
GARBAGE += [b'{"schema": 1' + b"0" * 5000 + b"}", b'{"schema": "\\ud800"}']


@pytest.mark.parametrize("content", [*(json.dumps(value).encode() for value in SCHEMAS), *GARBAGE, None])
def test_a_result_of_another_schema_is_refused_in_a_line(content, tmp_path):
    if content is not None:
        (tmp_path / "provenance.json").write_bytes(content)
    with pytest.raises(TableError) as caught:
        SavedFiles(tmp_path, "run")
    line = str(caught.value)
    assert (line.isprintable(), len(line) < LONGEST) == (True, True)


def test_plot_and_resume_refuse_in_a_line_and_leave_all_as_it_is(here, kernels):
    (here / "c.yaml").write_text(SWEEP)
    assert command("sweep", "c.yaml").code == 0
    directory = here / "results/c/sweep"
    proof, before = directory / "provenance.json", bits(left(directory)[0]["sweep.parquet"])
    with closing(sqlite3.connect(directory / "points.sqlite")) as base, base:
        base.execute("DELETE FROM records WHERE second = 1")
    lost = {"schema": 1, "configuration": {}}
    for content, commands in (({"schema": SCHEMA + 1}, ("plot", "sweep")), (lost, ("plot",))):
        proof.write_text(json.dumps(content))
        for name in commands:
            arguments = ("plot", directory) if name == "plot" else ("sweep", "c.yaml", "--resume")
            assert not_a_line(command(*arguments)) == ""
        assert json.loads(proof.read_text()) == content
    proof.unlink()
    assert bits(left(directory)[0]["sweep.parquet"]) == before
    # it is written at the end of a sweep: one that was killed has none
    done = command("sweep", "c.yaml", "--resume")
    assert (done.code, done.err) == (0, "")
    assert left(directory)[0].keys() >= {"provenance.json", "sweep.parquet"}
