"""Other solvers find the motion, and the motion that errors are measured against is that of independent ones."""

import numpy as np
import pytest
from bench import peers
from common.references import load_reference

from vibroplat.bench import measure

#: Tolerance, and bounds of the errors of coordinates over their scales, event times (s) and F_c over its largest:
#: those of "one impact a period" over 0.8 s, tripled.
SOLVERS = {
    "native": (1e-8, 4.4e-6, 9.3e-9, 3.7e-7),
    "taylor": (1e-6, 2.6e-6, 5e-9, 7e-7),
    "scipy DOP853": (1e-8, 3e-6, 8e-9, 6e-7),
    "scipy LSODA": (1e-8, 2e-6, 6e-9, 3e-7),
    "heyoka": (1e-6, 7e-6, 1.2e-8, 1.1e-6),
    "heyoka, integrator alone": (1e-6, 7e-6, 1.2e-8, 1.1e-6),
}


@pytest.fixture(scope="module")
def case():
    return measure.truth("one", measure.cases()["one impact a period"].replace({"run.duration_s": 0.8}))


@pytest.mark.peers
@pytest.mark.parametrize("name", SOLVERS)
def test_solver_finds_the_motion(name, case):
    if name.startswith("heyoka"):
        pytest.importorskip("heyoka")
    tolerance, *bounds = SOLVERS[name]
    found = measure.precision([case], [name], [tolerance], 1, peers.solver_of).iloc[0]
    assert (found["failed"], found["engine"]) == ("", name)
    assert (found[["coordinates", "event_time_s", "contact_force"]] < bounds).all()


@pytest.mark.peers
@pytest.mark.parametrize("name", ["bare run-up", "attached", "one impact a period"])
def test_reference_is_the_motion_of_heyoka_at_round_off(name):
    pytest.importorskip("heyoka")
    case = measure.truth(name, measure.cases()[name])
    found = measure.precision([case], ["heyoka"], [1e-16], 1, peers.solver_of).iloc[0]
    assert found["coordinates"] < 1e-11
    assert found["event_time_s"] < 1e-13


@pytest.mark.parametrize(
    ("name", "table"),
    [("attached", "attached-mu01-fe46"), ("one impact a period", "inelastic-mu02-fe51.5")],
)
def test_reference_is_the_motion_of_the_tables(name, table):
    found, known = measure.truth(name, measure.cases()[name]), load_reference(table)
    errors = measure.event_errors(found.events, known.events)
    assert errors["event_time_s"] < 1e-12
    rows = known.trajectory.set_index(known.trajectory["t_s"].round(9)).loc[found.trajectory["t_s"].round(9)]
    assert np.abs(rows["y_m"].to_numpy() - found.trajectory["y_m"].to_numpy()).max() < 1e-11
