"""What ``vibroplat bench`` writes, and what it says where a peer is not there."""

from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

from vibroplat.bench import report, timing
from vibroplat.bench.peers import peers, scaling
from vibroplat.cli import app
from vibroplat.errors import VibroplatError
from vibroplat.plots.bench import plot_scaling

REFERENCE = Path(__file__).parents[1] / "reference"


@pytest.fixture
def bare(monkeypatch):
    """No extra is installed."""
    monkeypatch.setattr(peers.importlib.util, "find_spec", lambda name: None)


def test_bench_without_its_oracle_says_what_to_install(bare):
    with pytest.raises(VibroplatError, match=r"pip install 'vibroplat\[bench\]' has it"):
        report.require_oracle()


def test_peer_that_is_not_there_says_what_to_install(bare):
    missing = {peer.name: peer.missing for peer in peers.PEERS if peer.module in ("heyoka", "pathsim")}
    assert missing == {
        "heyoka": "heyoka is not installed; it comes with vibroplat[bench]",
        "PathSim": "pathsim is not installed; it comes with vibroplat[bench]",
    }


def test_names_and_long_exclude_each_other():
    done = CliRunner().invoke(app, ["bench", "runtime", "--long"])
    assert str(done.exception) == "runtime --long: --long runs every bench; allowed: names or --long"


@pytest.mark.peers
def test_summary_compares_all_quick_peers(tmp_path):
    pytest.importorskip("heyoka")
    report.report_summary(tmp_path, REFERENCE, 1)
    runs, equal = (pd.read_csv(tmp_path / f"{name}.csv") for name in ("summary", "summary-equal"))
    names = [peer.name for peer in peers.PEERS if peer.quick and not peer.missing]
    assert len(names) >= 6
    assert runs["failed"].isna().all()
    assert list(dict.fromkeys(equal["peer"])) == names
    assert equal["case"].nunique() == report.QUICK
    # the finest setting is more accurate than the coarsest, for each peer on each scene
    errors = runs.groupby(["case", "peer"])["coordinates"].agg(["first", "last"])
    assert (errors["last"] < errors["first"]).all()
    assert equal.loc[equal["peer"] != "PathSim", "coordinates"].notna().all()


def named(*names):
    return [peer for peer in peers.PEERS if peer.name in names]


def test_run_times_over_simulated_time():
    table = scaling.simulated_time(named("vibroplat"), 1, lengths=(0.1, 0.2))
    assert list(table["simulated_s"]) == [0.1, 0.2] * 2
    assert list(table["scene"]) == ["attached, f_e 46"] * 2 + ["impacts, f_e 50"] * 2
    assert (table["ms_per_s"] * table["simulated_s"]).to_numpy() == pytest.approx(1e3 * table["wall_s"].to_numpy())


def test_run_times_by_engine():
    table = timing.runtime(seconds=0.05, repeats=1, engines=("native", "taylor")).set_index(["scene", "engine"])
    attached = table.loc["attached, f_e 46"]
    assert (attached[["ms_per_s_median", "steps_per_s", "ratio"]] > 0.0).all(axis=None)
    assert attached["residual_calls_per_s"].notna().to_dict() == {"native": True, "taylor": False}


def test_run_times_over_events():
    table = scaling.events_per_second(1, seconds=0.4)
    assert set(table["outcome"]) == {"ok"}
    assert table["restarts_per_s"].min() < 20.0
    assert table["restarts_per_s"].max() > 60.0
    assert (table["steps_per_s"] < table["residual_calls_per_s"]).all()


@pytest.mark.peers
def test_run_times_over_scenes_and_memory():
    table = scaling.scenes(1, counts=(2,))
    assert list(table["jobs"]) == [1, 2]
    memory = scaling.memory(named("vibroplat", "scipy DOP853"), seconds=(1.0,))
    assert (memory["loaded_mb"] > 50.0).all()
    assert (memory["added_mb"] < 10.0).all()


def test_scaling_is_drawn(tmp_path, figures):
    tables = {
        "time": pd.DataFrame({"peer": "a", "scene": "s", "simulated_s": [1.0, 10.0], "wall_s": [0.1, 1.0]}),
        "events": pd.DataFrame({"restitution": 0.0, "outcome": "ok", "restarts_per_s": [1, 2], "ms_per_s": [1.0, 2.0]}),
        "scenes": pd.DataFrame({"jobs": [1, 2], "scenes": [4, 4], "wall_s": [2.0, 1.1]}),
        "memory": pd.DataFrame({"peer": ["a"], "loaded_mb": [100.0], "added_mb": [1.0]}),
    }
    path = plot_scaling(tables, tmp_path)
    assert path == tmp_path / "scaling.png"
    lengths, restarts, scenes, memory = figures["scaling"].axes
    assert [line.get_xydata().tolist() for line in lengths.lines] == [[[1.0, 0.1], [10.0, 1.0]]]
    assert (lengths.get_xscale(), lengths.get_yscale()) == ("log", "log")
    assert [line.get_xydata().tolist() for line in restarts.lines] == [[[1.0, 1.0], [2.0, 2.0]]]
    assert [line.get_xydata().tolist() for line in scenes.lines] == [[[4.0, 2.0]], [[4.0, 1.1]]]
    assert [(bar.get_x(), bar.get_width()) for bar in memory.patches] == [(0.0, 100.0)]
    assert [text.get_text() for text in memory.texts] == [" +1.0"]
