"""Where results lie: each command in a directory of its own, or saved in the one above."""

import pytest

from vibroplat import load
from vibroplat.errors import TableError
from vibroplat.results.files import commands_in, directory_of
from vibroplat.results.result import Answer, Result


@pytest.fixture
def home(runs, tmp_path):
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


def test_of_two_results_that_in_the_directory_of_the_command_is_read(runs, home):
    runs["bare"].save(home)
    assert directory_of(home, "run") == load(home).directory == home / "run"


def test_a_result_is_not_written_over_that_of_another_command(runs, home):
    other = Result("sweep", runs["bare"].scene, {"sweep": runs["bare"].events}, Answer())
    with pytest.raises(TableError, match=f"^{home}/run holds a result of run; allowed: another directory$"):
        other.save(home / "run")
    other.save(home)
    assert commands_in(home) == ["run", "sweep"]
