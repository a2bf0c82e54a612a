"""Runs against the reference trajectories, from YAML through the Python API.

The bounds are those of the specification at tolerance 1e-8; measured errors are a factor of 10 to 100 below them where
the motion does not amplify errors.
"""

import numpy as np
import pandas as pd
import pytest
from common.references import REFERENCES

from vibroplat import load_config, simulate
from vibroplat.bench.measure import compared_events as fast
from vibroplat.bench.measure import coordinate_errors
from vibroplat.config.reader import configurations

PLAIN_CASES = ("attached-mu01-fe46", "bare-printed-fe60", "inelastic-mu02-fe51.5")
LATCH_CASES = ("onelayer-R03-mu01-fe48", "restitution05-mu02-fe51.5")

COORDINATE_BOUNDS = {
    "x_m": 5e-8,
    "y_m": 5e-8,
    "gap_m": 5e-8,
    "upper_m": 5e-8,
    "phi_rad": 5e-7,
    "phi1_rad": 2e-5,
    "phi2_rad": 2e-5,
}
TIME_BOUND = 2e-7
SPEED_BOUND = 1e-5
FORCE_BOUND = 3e-5

#: Until when coordinates are compared where errors of chatters grow: their bounds hold until the motion has amplified
#: an error of the first liftoff 20 times (s).
UNTIL = {"onelayer-R03-mu01-fe48": 0.2, "restitution05-mu02-fe51.5": 0.15}
#: The same in events, at which an error of time at the liftoff after the first chatter has grown so.
EARLY = {"onelayer-R03-mu01-fe48": 14, "restitution05-mu02-fe51.5": 15}


#: Where the motion amplifies errors, what counts is how many steps they are made in: at these tolerances engine
#: ``native``, whose steps follow the tolerance more closely, takes as many as ``sundae`` does at 1e-8, or more.
TOLERANCES = {
    "native": dict.fromkeys(LATCH_CASES, 3e-9) | {"bare-printed-fe60": 1e-9},
    "sundae": {},
    "taylor": dict.fromkeys(LATCH_CASES, 1e-8),
}


@pytest.fixture(scope="module", params=["native", "taylor", pytest.param("sundae", marks=pytest.mark.long)])
def runs(request):
    scenes = {name: load_config(REFERENCES / f"{name}.yaml") for name in PLAIN_CASES + LATCH_CASES}
    for name, tolerance in TOLERANCES[request.param].items():
        scenes[name] = scenes[name].replace({"solver.tolerance": tolerance})
    found = {name: simulate(scene.replace({"solver.engine": request.param})) for name, scene in scenes.items()}
    assert all(run.summary["engine"] == request.param for run in found.values())
    return found


def read(name, kind):
    return pd.read_csv(REFERENCES / f"{name}.{kind}.csv")


def test_coordinates_and_contact_force(runs):
    for name, run in runs.items():
        for quantity, error in coordinate_errors(run, read(name, "trajectory"), UNTIL.get(name, np.inf)).items():
            assert error <= COORDINATE_BOUNDS.get(quantity, FORCE_BOUND), (name, quantity)


@pytest.mark.parametrize("name", PLAIN_CASES)
def test_events(runs, name):
    mine, theirs = fast(runs[name].events), fast(read(name, "events"))
    assert list(mine["kind"]) == list(theirs["kind"])
    assert np.abs(mine["t_s"] - theirs["t_s"]).max() <= TIME_BOUND or mine.empty
    impacts = (mine["kind"] == "impact").to_numpy()
    ratio = mine["gap_rate_before_m_per_s"][impacts] / theirs["gap_rate_before_m_per_s"][impacts]
    assert (np.abs(ratio - 1.0) <= SPEED_BOUND).all()
    impulses = (events["impulse_n_s"].to_numpy(dtype=float) for events in (mine, theirs))
    np.testing.assert_allclose(*impulses, rtol=SPEED_BOUND)
    landed = (theirs["contact_force_after_n"] > 0.0).to_numpy()
    error = (mine["contact_force_after_n"] - theirs["contact_force_after_n"])[landed].abs()
    assert (error <= FORCE_BOUND * theirs["contact_force_after_n"].max()).all()


@pytest.mark.parametrize("name", LATCH_CASES)
def test_events_with_latches(runs, name):
    """The sequence is that of the reference, and so are the times until the motion amplifies errors."""
    mine, theirs = fast(runs[name].events), fast(read(name, "events"))
    assert list(mine["kind"]) == list(theirs["kind"])
    early = np.arange(len(theirs)) < EARLY[name]
    assert (np.abs(mine["t_s"] - theirs["t_s"])[early] <= TIME_BOUND).all()
    # a weak impact takes the absolute error of the strong ones before it
    impacts = early & (mine["kind"] == "impact")
    speeds, expected = (e["gap_rate_before_m_per_s"][impacts] for e in (mine, theirs))
    assert (np.abs(speeds - expected) <= SPEED_BOUND * np.maximum(np.abs(expected), 0.1)).all()
    # chatters carry the momentum on: with it lost, the liftoff after the first is 1.5e-9 s off
    first, second = (e[e["kind"] == "liftoff"]["t_s"].iloc[1] for e in (mine, theirs))
    assert abs(first - second) <= 5e-10


#: Times (s) of the first and of the last event of one elastic layer, 19 in all, by the independent integration; engine
#: ``taylor`` at 1e-14 has them within 2e-16 s and 4e-11 s.
ELASTIC_EVENTS, ELASTIC_FIRST, ELASTIC_LAST = 19, 0.05057859049639654, 0.49883482174892163
#: By how many seconds an error of the start, in the unit of ``run.perturbation``, moves the last one.
ELASTIC_GROWTH = 1330.0


def elastic_layer(tolerance, engine="taylor"):
    """One layer with R = 1, whose motion multiplies errors at each impact."""
    scene = load_config(configurations() / "quickstart.yaml")
    changes = {
        "material": {"mass_ratio": 0.2, "layers": 1},
        "contact": {"restitution": 1.0, "restitution_threshold_m_per_s": 0.0},
        "run": {"duration_s": 0.499, "perturbation": 0.0},
        "solver": {"tolerance": tolerance, "engine": engine},
    }
    return scene.replace(changes)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-14])
def test_elastic_impacts_are_as_accurate_as_errors_grow(tolerance):
    """IDA's last event is off by 1.5e-2 s at tolerance 1e-8 and by 9e-6 s at 1e-12; that of the series by
    3.4e-11 s at 1e-14."""
    events = simulate(elastic_layer(tolerance), keep="events").events
    assert len(events) == ELASTIC_EVENTS
    assert abs(events["t_s"].iloc[0] - ELASTIC_FIRST) <= tolerance / 100.0 + 1e-15
    assert abs(events["t_s"].iloc[-1] - ELASTIC_LAST) <= ELASTIC_GROWTH * tolerance + 1e-10
