"""Where results lie: each command in a directory of its own, or saved in the one above."""

import json

import pytest

from vibroplat import load
from vibroplat.errors import TableError
from vibroplat.results.files import commands_in, directory_of


@pytest.fixture
def home(runs, tmp_path):
    """A directory with a run in the place of its command."""
    runs["two layers"].save(tmp_path / "rig/run")
    return tmp_path / "rig"


def test_either_directory_is_taken_and_gives_the_name(home, monkeypatch):
    for place in (home, home / "run"):
        assert commands_in(place) == ["run"]
        found = load(place)
        assert (found.directory, found.home) == (home / "run", home.resolve())
    monkeypatch.chdir(home / "run")
    assert load(".").home == home.resolve()
    with pytest.raises(TableError, match="is not a directory"):
        load(home / "sweep", "sweep")


def test_a_result_that_was_saved_above_is_read_where_it_lies(runs, tmp_path):
    runs["bare"].save(tmp_path / "rig")
    assert commands_in(tmp_path / "rig") == ["run"]
    assert load(tmp_path / "rig").directory == tmp_path / "rig"


@pytest.mark.parametrize("newer", ["run", "."])
def test_of_two_results_the_later_one_is_read(newer, runs, home):
    runs["bare"].save(home)
    for place in (home, home / "run"):
        proof = json.loads((place / "provenance.json").read_text())
        created = f"2026-01-0{1 + (place == home / newer)}T00:00:00"
        (place / "provenance.json").write_text(json.dumps(proof | {"created": created}))
    assert directory_of(home, "run") == home / newer
    assert load(home).directory == home / newer
