"""The figure of material that moves along the deck."""

import numpy as np
import pytest
from common.places import ROOT

from vibroplat import load_config, simulate, sweep
from vibroplat.config.digits import interval
from vibroplat.plots.histories import run_of
from vibroplat.plots.run import FIGURES
from vibroplat.plots.run_picture import RunPicture
from vibroplat.study.picture import pictures


@pytest.fixture(scope="module")
def feeder():
    return simulate(load_config(ROOT / "configs/examples/conveying.yaml", {"run.duration_s": 1.0}))


def test_modes_change_at_events_and_material_goes_from_the_begin_on(feeder):
    run = run_of(feeder)
    found = FIGURES["conveying"](RunPicture([run]))
    (strip,), (series,) = found.strips.rows, found.series
    spans = strip.spans(found.points["t_s"])
    begin = spans[0].low
    events = feeder.events[(feeder.events["t_s"] > begin) & (feeder.events["kind"] != "drive")]
    assert [span.low for span in spans[1:]] == pytest.approx(events["t_s"].tolist(), abs=1e-9)
    assert [span.kind for span in spans[1:]] == events["mode_after"].tolist()
    places = found.points["along_m"].to_numpy()[series.places]
    assert places[0] == 0.0
    assert places[-1] == pytest.approx(float(np.ptp(run.last["along_m"])), rel=0.1)
    assert found.title.startswith("Conveying speed ")


def test_a_sweep_tells_and_draws_the_conveying_speed():
    over = {"sweep.over": {"key": "transport.friction", "start": 0.2, "stop": 0.4, "count": 2}}
    short = {"sweep.max_settle_s": 1.0, "sweep.measure_s": 0.4, "sweep.lyapunov": False}
    found = sweep(load_config(ROOT / "configs/examples/conveying.yaml", over | short), jobs=1)
    slowest, fastest = found.table("sweep")["conveying_speed_m_per_s"].agg(["min", "max"])
    assert interval(slowest, fastest, "m/s") in str(found)
    assert "conveying_speed_m_per_s" in [panel.column for panel in pictures([found])[0].panels]
