"""The soak: rounds are judged, stored one by one and not done again."""

from __future__ import annotations

import signal
import subprocess
import sys

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from bench import processes, rounds, soak

TINY = rounds.Size(2, 3, ("up",), (0.4,), dask=False)


def row(number, failed=""):
    return {
        "round": number,
        "seed": number + 1,
        "runs": 4,
        "points": 3,
        "sweep_kills": 1,
        "worker_kills": 0,
        "left_out": "dask",
        "processor_s": 10.0,
        "failed": failed,
    }


@pytest.fixture
def done(monkeypatch):
    """Rounds that take no time; the numbers of those that were done."""
    numbers = []

    def run_round(number, size, directory):
        assert list(directory.iterdir()) == []
        numbers.append(number)
        (directory / "left").touch()
        return row(number)

    monkeypatch.setattr(soak, "run_round", run_round)
    return numbers


# -- from round to round --------------------------------------------------------------------------------


def test_finished_round_is_not_done_again(tmp_path, done):
    assert list(soak.soak(tmp_path)["round"]) == [0]
    assert list(soak.soak(tmp_path)["round"]) == [0, 1]
    assert done == [0, 1]


def test_rounds_until_their_processor_time_is_reached(tmp_path, done):
    assert soak.soak(tmp_path, seconds=25.0)["processor_s"].sum() == 30.0
    assert soak.soak(tmp_path, seconds=35.0)["processor_s"].sum() == 40.0
    assert soak.soak(tmp_path, seconds=35.0)["processor_s"].sum() == 40.0  # nothing is left to do
    assert done == [0, 1, 2, 3]


def test_rounds_of_other_code_or_size_do_not_count(tmp_path, done, monkeypatch):
    soak.soak(tmp_path)
    assert list(soak.soak(tmp_path, size=TINY)["round"]) == [0]
    monkeypatch.setattr(soak, "code", lambda: {"source files": "other"})
    assert list(soak.soak(tmp_path)["round"]) == [0]
    assert len(list(tmp_path.iterdir())) == 3


KILLED = """
import os, sys
from pathlib import Path
from bench import soak
def run_round(number, size, directory):
    (directory / "half").touch()
    if number == 1:
        os.kill(os.getpid(), {signal})
    return {row}
soak.run_round = run_round
soak.soak(Path(sys.argv[1]), seconds=1e9)
"""


@pytest.mark.faults
def test_killed_soak_goes_on_with_its_round(tmp_path, done):
    text = KILLED.format(signal=int(signal.SIGKILL), row=row(0))
    ended = subprocess.run([sys.executable, "-c", text, str(tmp_path)], timeout=120, check=False)
    assert ended.returncode == -signal.SIGKILL
    assert len(list(tmp_path.glob("*/round-*/half"))) == 1
    assert list(soak.soak(tmp_path, seconds=15.0)["round"]) == [0, 1]
    assert done == [1]
    assert list(tmp_path.glob("*/round-*")) == []


def test_dask_that_is_not_there_is_left_out_by_name(monkeypatch):
    monkeypatch.setattr(processes.importlib.util, "find_spec", lambda name: None)
    assert processes.missing_dask() == "dask: distributed is not installed; it comes with vibroplat[cluster]"


# -- what is found --------------------------------------------------------------------------------------

TABLE = pd.DataFrame({"y": [0.0, np.nan, 1.0], "outcome": ["ok", "ok", "ok"], "wall_s": [1.0, 2.0, 3.0]})


@pytest.mark.parametrize("value", [-0.0, 5e-324])
def test_difference_of_a_bit_is_found(value):
    assert rounds.differences(TABLE, TABLE.assign(y=[value, np.nan, 1.0])) == "y"


def test_differences_of_texts_and_rows_are_found():
    assert rounds.differences(TABLE, TABLE.assign(outcome=["ok", "lost", "ok"])) == "outcome"
    assert rounds.differences(TABLE, TABLE[1:]) == "rows or columns: (2, 3) instead of (3, 3)"


def test_wall_times_may_differ():
    assert rounds.differences(TABLE, TABLE.assign(wall_s=0.0)) == ""


def test_figure_that_is_missing_broken_off_or_empty_is_found(tmp_path):
    plt.imsave(tmp_path / "whole.png", np.random.default_rng(0).random((50, 50)))
    plt.imsave(tmp_path / "empty.png", np.ones((50, 50, 3)))
    (tmp_path / "half.png").write_bytes((tmp_path / "whole.png").read_bytes()[:-1000])
    assert rounds.flaw(tmp_path, "whole") == ""
    assert rounds.flaw(tmp_path, "empty") == "empty"
    assert rounds.flaw(tmp_path, "half") != ""
    assert "No such file" in rounds.flaw(tmp_path, "absent")


def test_command_that_ends_with_an_error_is_found(tmp_path):
    with processes.Places(tmp_path) as places, pytest.raises(processes.ProcessError) as raised:
        places.run("sweep", "absent.yaml")
    assert "vibroplat sweep absent.yaml ended with exit code 2: vibroplat: " in str(raised.value)


def test_processes_end_with_the_soak(tmp_path):
    with processes.Places(tmp_path) as places:
        server = places.start("http.server", "0", "--bind", "127.0.0.1")
        assert server.poll() is None
    assert server.returncode == -signal.SIGKILL


def test_rounds_are_drawn_from_their_numbers():
    first, again, other = (rounds.random_sweep(number, TINY).to_tree() for number in (4, 4, 5))
    assert first == again
    assert first != other


# -- whole rounds ---------------------------------------------------------------------------------------


@pytest.fixture
def short_points(monkeypatch):
    """Points that take a second or two instead of ten."""
    monkeypatch.setattr(rounds, "SETTLE", 4.0)
    monkeypatch.setattr(rounds, "MEASURE", 1.0)


@pytest.mark.campaign
@pytest.mark.usefixtures("kernels", "short_points")
def test_round_with_a_sweep_that_is_killed_and_resumed(tmp_path):
    found = rounds.run_round(0, TINY, tmp_path)
    assert found["failed"] == ""
    assert (found["runs"], found["points"], found["worker_kills"]) == (4, 3, 0)
    assert found["steps"] > 0
    assert found["processor_s"] > 0.0


@pytest.mark.campaign
@pytest.mark.usefixtures("kernels", "short_points")
def test_round_with_workers_that_come_and_go(tmp_path):
    pytest.importorskip("distributed")
    found = rounds.run_round(0, TINY._replace(dask=True), tmp_path)
    assert found["failed"] == ""
    assert found["left_out"] == ""
    assert found["worker_kills"] > 0
